"""All samples of a document in one space of channels, ready for cuts and for matching.

A patch of a painted sample meets the background's, so distances between texels of any two
samples must mean something (`btfcore.btf.joint.common_channels` sees to that). Everything else
that painting asks about a sample is computed when first asked for, and kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numba import njit

from btfcore.btf.factor.symmetric import add_gram, eigen, turned
from btfcore.btf.feature import Component, components, half_width, prepared
from btfcore.errors import InvalidImage, InvalidParameter
from btfcore.quilt.grid import SampleGrid, differences, mask_grid, reduced_channels
from btfcore.quilt.sheet import BARRED, Sheet, stacked, without_features
from btfcore.types import F4, F8, I4, U2, Frozen, Sample

PAIRS = 20_000  # of feature and background texels that the normaliser is a mean over
ENOUGH = 0.999  # share of a sample's variance that its principal channels carry
RUN = 1 << 15  # texels at once that are widened to f8
NARROW = 3.0  # grid texels; features of less half-width are thickened again where reduced


@dataclass(frozen=True, eq=False)
class MatchSpace(Frozen):
    """What one sample is matched by.

    values (Σh, w, k) f4: all samples of the sheet in its principal space, its own mean removed,
    so that whatever lies around a patch can be matched; grid: the sample, whose `match` is its
    own part of the values.
    """

    values: F4
    grid: SampleGrid


@dataclass(frozen=True, eq=False)
class Palette(Frozen):
    """Samples on one sheet; see `palette_of`.

    sheet: its `colour` is its `cut` (Σh, w, K) f4, in which all samples compare; feature
    (Σh, w) f4 in 0–1: the masks, 0 where a sample has none; grids: the samples one by one,
    matched by their own principal channels; names: of the samples.
    """

    sheet: Sheet
    feature: F4
    grids: tuple[SampleGrid, ...]
    names: tuple[str, ...]
    spaces: tuple[tuple[F8, F8], ...]  # of each sample: mean (K,), principal directions (K, k)
    _kept: dict[Any, Any] = field(default_factory=dict, repr=False)

    def feature_of(self, index: int) -> F4:
        """Feature (h, w) f4 of one sample."""
        top, height, width = self.sheet.frames[index, :3]
        return self.feature[top : top + height, :width]

    def normaliser(self, index: int) -> float:
        """Twice the mean distance of feature texels to background texels of a sample, u.

        By which the seams' costs V are divided against the constraint's (random pairs of
        texels would mostly lie on the background). Over 20,000 seeded pairs, with feature
        above ½ and background below 0.05 (up to ½ where nothing is below). Raises
        `InvalidImage` where the sample has no feature, or one that looks like its background.
        """
        if ("u", index) not in self._kept:
            self._kept["u", index] = self._normaliser(index)
        return float(self._kept["u", index])

    def half_width(self, index: int) -> float:
        """Medial half-width of a sample's feature in grid texels; 0 where it has none."""
        if ("width", index) not in self._kept:
            self._kept["width", index] = half_width(self.feature_of(index) > 0.5)
        return float(self._kept["width", index])

    def components(self, index: int) -> tuple[I4, tuple[Component, ...]]:
        """Connected parts of a sample's feature on its grid; see `feature.components`."""
        if ("parts", index) not in self._kept:
            self._kept["parts", index] = components(self.feature_of(index) > 0.5)
        found: tuple[I4, tuple[Component, ...]] = self._kept["parts", index]
        return found

    def axis(self, index: int) -> float:
        """Angle in radians, counter-clockwise from +column, of the axis a feature lies along.

        The direction in which its connected parts are longest, each about its own centre, by
        area: in (-π/2, π/2]; 0 where there is no feature.
        """
        if ("axis", index) not in self._kept:
            labels, _ = self.components(index)
            self._kept["axis", index] = _axis(labels)
        return float(self._kept["axis", index])

    def match(self, index: int) -> MatchSpace:
        """Values of all samples in the principal space of one."""
        if ("match", index) not in self._kept:
            values = _projected(self.sheet.cut, *self.spaces[index])
            self._kept["match", index] = MatchSpace(values, self.grids[index])
        found: MatchSpace = self._kept["match", index]
        return found

    def feature_at(self, sample: U2, source: F4) -> F4:
        """Feature (n,) f4 at positions source (n, 2) f4 (column, row) of samples (n,)."""
        return feature_at(self.feature, self.sheet.frames, sample, source)

    def values_at(self, values: F4, sample: U2, source: F4) -> F4:
        """Of values (Σh, w, k) f4 on the sheet, those (n, k) at positions; as `feature_at`."""
        return values_at(values, self.sheet.frames, sample, source)

    @property
    def background(self) -> Sheet:
        """The sheet with all features barred, for synthesising the background alone.

        Raises `InvalidImage` where a sample's feature leaves too little of it.
        """
        if "background" not in self._kept:
            self._kept["background"] = without_features(self.sheet, self.feature, self.names)
        found: Sheet = self._kept["background"]
        return found

    def _normaliser(self, index: int) -> float:
        top, height, width = self.sheet.frames[index, :3]
        values = self.sheet.cut[top : top + height, :width]
        mask = self.feature_of(index)
        inside = mask > 0.5
        outside = mask < BARRED
        if not outside.any():
            outside = ~inside
        if not inside.any() or not outside.any():
            raise InvalidImage(
                f"sample {self.names[index]!r}: {100 * float(inside.mean()):.2f} % of it is"
                " feature; feature and background are needed to paint with it"
            )
        random = np.random.default_rng(0)
        sides = []
        for which in (inside, outside):
            row, column = np.nonzero(which)
            chosen = random.integers(0, len(row), PAIRS)
            sides.append(values[row[chosen], column[chosen]].astype(np.float64))
        distance = np.sqrt(((sides[0] - sides[1]) ** 2).sum(axis=1))
        mean = 2 * float(distance.mean())
        if not mean > 0:
            raise InvalidImage(
                f"sample {self.names[index]!r}: its feature cannot be told from its background"
            )
        return mean


def palette_of(
    samples: Sequence[Sample], scales: Sequence[float], match_channels: int = 4
) -> Palette:
    """Stack samples whose channels compare, each at its scale.

    samples : with channels (H, W, K) f4 of one space, see `btfcore.btf.joint.common_channels`.
    match_channels : principal channels used in matching, at most. Masks are reduced with the
    patterns; where that leaves a feature less than 3 grid texels of half-width it is thickened
    again (`btfcore.btf.feature.prepared`), lest nothing of it can be painted.

    Raises `InvalidParameter` where the numbers of channels or scales differ, `InvalidImage`
    where less than 2 × 2 texels are left, or for a mask of another size than its sample's.
    """
    if len(samples) == 0 or len(samples) != len(scales):
        raise InvalidParameter(f"{len(samples)} samples and {len(scales)} scales for a palette")
    counts = [sample.channels.shape[2] for sample in samples]
    if len(set(counts)) > 1:
        raise InvalidParameter(
            f"samples of {' and '.join(map(str, counts))} channels cannot be compared"
        )
    parts = [reduced_channels(each, scale) for each, scale in zip(samples, scales, strict=True)]
    sizes = np.array([part.shape for part in parts], np.int32)
    first = np.concatenate([[0], np.cumsum(sizes[:-1, 0])]).astype(np.int32)
    cut = stacked(parts)
    frames = np.ascontiguousarray(np.concatenate([first[:, None], sizes], axis=1))
    spaces = tuple(_space(part, match_channels) for part in parts)
    grids = tuple(
        _grid(cut[top : top + len(part), : part.shape[1]], space, scale)
        for top, part, space, scale in zip(first, parts, spaces, scales, strict=True)
    )
    masks = [_feature(each, scale) for each, scale in zip(samples, scales, strict=True)]
    sheet = Sheet(cut, cut, frames, grids)
    names = tuple(sample.name for sample in samples)
    return Palette(sheet, stacked(masks), grids, names, spaces)


def _space(channels: F4, most: int) -> tuple[F8, F8]:
    """Mean (K,) and the principal directions (K, k) of a sample's channels (h, w, K)."""
    count = channels.shape[2]
    flat = channels.reshape(-1, count)
    mean = flat.mean(axis=0, dtype=np.float64)
    gram = np.zeros((count, count))
    for start in range(0, len(flat), RUN):
        add_gram(flat[start : start + RUN] - mean, gram)
    values, vectors = eigen(gram)
    share = np.cumsum(values) / max(float(values.sum()), 1e-300)
    keep = min(int(np.searchsorted(share, ENOUGH)) + 1, most, count)
    peak = np.abs(vectors).argmax(axis=0)
    signs = np.where(vectors[peak, np.arange(count)] < 0, -1.0, 1.0)
    return mean, np.ascontiguousarray((vectors * signs)[:, :keep])


def _projected(values: F4, mean: F8, directions: F8) -> F4:
    """Values (h, w, K) less a mean (K,), in directions (K, k): (h, w, k) f4."""
    flat = values.reshape(-1, values.shape[2])
    out = np.empty((len(flat), directions.shape[1]), np.float32)
    for start in range(0, len(flat), RUN):
        run = slice(start, start + RUN)
        turned(flat[run] - mean, directions, out[run])
    return out.reshape(*values.shape[:2], -1)


def _grid(own: F4, space: tuple[F8, F8], scale: float) -> SampleGrid:
    """One sample's part (h, w, K) of the sheet as a grid."""
    own = np.ascontiguousarray(own)  # nothing is copied where no sample is wider
    near, far = differences(own)
    match = _projected(own, *space)
    return SampleGrid(own, match, max(scale, 1.0), min(scale, 1.0), near, far)


def _axis(labels: I4) -> float:
    """Main axis of the parts of a feature, `labels` (h, w) i4 being -1 outside."""
    row, column = np.nonzero(labels >= 0)
    if len(row) == 0:
        return 0.0
    part = labels[row, column]
    count = np.maximum(np.bincount(part), 1)
    x = column - (np.bincount(part, column) / count)[part]
    y = (np.bincount(part, row) / count)[part] - row
    # twice the angle, so that a line's two directions are one
    return float(np.arctan2(2 * (x * y).sum(), (x * x).sum() - (y * y).sum()) / 2)


def _feature(sample: Sample, scale: float) -> F4:
    """Feature (h, w) f4 of a sample on its grid, thickened again where it got too narrow."""
    mask = mask_grid(sample, scale)
    if sample.mask is None or scale >= 1.0:
        return mask
    peak = float(mask.max())
    if peak > 0 and (sample.mask > 0.5).any():
        inside = mask > min(0.5, 0.5 * peak)
        if half_width(inside) < NARROW:
            # where hardly any background is left, the mask stays what it is
            with suppress(InvalidImage):
                return prepared(inside.astype(np.float32), name=sample.name, thicken=NARROW).mask
    return mask


@njit(cache=True)
def feature_at(feature: F4, frames: I4, sample: U2, source: F4) -> F4:
    """Feature (n,) f4 at positions source (n, 2) f4 (column, row) of samples (n,).

    feature (Σh, w) and frames (R, 4) as a palette's; bilinear, clamped at each sample's border.
    """
    out = np.empty(len(source), np.float32)
    for index in range(len(source)):
        frame = frames[sample[index]]
        top, height, width = frame[0], frame[1], frame[2]
        x = min(max(np.float64(source[index, 0]), 0.0), width - 1.0)
        y = min(max(np.float64(source[index, 1]), 0.0), height - 1.0)
        column, row = int(x), int(y)
        right, below = min(column + 1, width - 1), top + min(row + 1, height - 1)
        fx, fy = x - column, y - row
        row += top
        upper = (1 - fx) * feature[row, column] + fx * feature[row, right]
        lower = (1 - fx) * feature[below, column] + fx * feature[below, right]
        out[index] = (1 - fy) * upper + fy * lower
    return out


@njit(cache=True)
def values_at(values: F4, frames: I4, sample: U2, source: F4) -> F4:
    """Values (n, k) f4 of (Σh, w, k) at positions source (n, 2) f4 of samples (n,).

    As `feature_at`; for `Palette.match`'s values or the sheet's channels.
    """
    channels = values.shape[2]
    out = np.empty((len(source), channels), np.float32)
    for index in range(len(source)):
        frame = frames[sample[index]]
        top, height, width = frame[0], frame[1], frame[2]
        x = min(max(np.float64(source[index, 0]), 0.0), width - 1.0)
        y = min(max(np.float64(source[index, 1]), 0.0), height - 1.0)
        column, row = int(x), int(y)
        right, below = min(column + 1, width - 1), top + min(row + 1, height - 1)
        fx, fy = x - column, y - row
        row += top
        for k in range(channels):
            upper = (1 - fx) * values[row, column, k] + fx * values[row, right, k]
            lower = (1 - fx) * values[below, column, k] + fx * values[below, right, k]
            out[index, k] = (1 - fy) * upper + fy * lower
    return out
