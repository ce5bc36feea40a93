"""The samples of one surface stacked into one array, as the kernels read them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from btfcore.errors import InvalidImage
from btfcore.quilt.grid import SampleGrid, colour_grid, mask_grid, sample_grid
from btfcore.types import F4, I4, Frozen, Sample

ANYWHERE: NDArray[np.bool_] = np.zeros(0, np.bool_)  # every vertex may take the sample
NOWHERE: NDArray[np.bool_] = np.zeros((0, 0), np.bool_)  # no texel is barred
BARRED = 0.05  # of a feature, above which its texels are no background
MOST_BARRED = 0.95  # share of a sample that may be


@dataclass(frozen=True, eq=False)
class Sheet(Frozen):
    """Channels of R samples, one above the other.

    cut (Σh, w, K) f4: each sample's own channels, whose distances mean something within that
    sample only; colour (Σh, w, k) f4: channels that compare across samples, such as sRGB
    colours (one texel of zeros where there is but one sample; the array `cut` itself where all
    samples share one space); frames (R, 4) i4: first row, height, width and number of channels
    of each; grids: the samples one by one; barred (Σh, w) bool: texels that no vertex may be
    synthesised from, (0, 0) where all may be.
    """

    cut: F4
    colour: F4
    frames: I4
    grids: tuple[SampleGrid, ...] = ()
    barred: NDArray[np.bool_] = field(default_factory=NOWHERE.copy)

    def compared_by(self, channels: Sequence[F4]) -> Sheet:
        """Return this sheet with other channels, (h, w, k) f4 of each sample, in `cut`."""
        most = max(each.shape[2] for each in channels)
        cut = np.zeros((*self.cut.shape[:2], most), np.float32)
        frames = self.frames.copy()
        for index, each in enumerate(channels):
            top, height, width = frames[index, :3]
            cut[top : top + height, :width, : each.shape[2]] = each
            frames[index, 3] = each.shape[2]
        return Sheet(cut, self.colour, frames, self.grids, self.barred)

    def colours(self, index: int) -> F4:
        """Colours (h, w, k) f4 of one of several samples."""
        top, height, width = self.frames[index, :3]
        return np.ascontiguousarray(self.colour[top : top + height, :width])

    def barred_of(self, index: int) -> NDArray[np.bool_]:
        """Barred texels (h, w) bool of one sample; (0, 0) where no sample has any."""
        top, height, width = self.frames[index, :3]
        return self.barred[top : top + height, :width]


def single(grid: F4) -> Sheet:
    """One sample's channels (h, w, K) as a sheet; nothing is copied."""
    frames = np.array([[0, *grid.shape]], np.int32)
    return Sheet(grid.view(), np.zeros((1, 1, 3), grid.dtype), frames)


def sheet_of(
    samples: Sequence[Sample],
    scales: Sequence[float],
    *,
    match_channels: int | None,
    features: bool = True,
) -> Sheet:
    """Stack `samples`, each at its scale; None matches on all channels.

    Without `features`, what their masks mark is barred, see `without_features`. Raises
    `InvalidImage` as `sample_grid` does.
    """
    grids = tuple(
        sample_grid(
            sample, scale=scale,
            match_channels=sample.channels.shape[2] if match_channels is None else match_channels,
        )
        for sample, scale in zip(samples, scales, strict=True)
    )  # fmt: skip
    if len(grids) == 1:
        alone = single(grids[0].cut)
        sheet = Sheet(alone.cut, alone.colour, alone.frames, grids)
    else:
        sizes = np.array([grid.cut.shape for grid in grids], np.int32)
        first = np.concatenate([[0], np.cumsum(sizes[:, 0])]).astype(np.int32)
        cut = np.zeros((first[-1], sizes[:, 1].max(), sizes[:, 2].max()), np.float32)
        colour = np.zeros((*cut.shape[:2], 3), np.float32)
        for top, sample, grid in zip(first, samples, grids, strict=False):
            height, width, channels = grid.cut.shape
            cut[top : top + height, :width, :channels] = grid.cut
            colour[top : top + height, :width] = colour_grid(sample, grid)
        sheet = Sheet(cut, colour, np.concatenate([first[:-1, None], sizes], axis=1), grids)
    if features or all(sample.mask is None for sample in samples):
        return sheet
    masks = [mask_grid(sample, scale) for sample, scale in zip(samples, scales, strict=True)]
    return without_features(sheet, stacked(masks), [sample.name for sample in samples])


def stacked(parts: Sequence[F4]) -> F4:
    """Arrays (h, w, …) f4 one above the other, zeros on the right of the narrower ones."""
    height = sum(len(part) for part in parts)
    width = max(part.shape[1] for part in parts)
    out = np.zeros((height, width, *parts[0].shape[2:]), np.float32)
    top = 0
    for part in parts:
        out[top : top + len(part), : part.shape[1]] = part
        top += len(part)
    return out


def without_features(sheet: Sheet, feature: F4, names: Sequence[str]) -> Sheet:
    """Return the sheet with the feature's texels barred, for synthesis of the background S_b.

    feature (Σh, w) f4 in 0–1: texels above 0.05 are barred, so that not even the soft edge of
    a feature is left. A position counts as barred where any texel that its bilinear value is
    made of is. Raises `InvalidImage` where more than 95 % of a sample are, or where no 3 × 3
    texels are left together.
    """
    barred = feature > BARRED
    for index, (top, height, width) in enumerate(sheet.frames[:, :3].tolist()):
        part = barred[top : top + height, :width]
        share = float(part.mean())
        if share > MOST_BARRED or not roomy(part, 1).any():
            raise InvalidImage(
                f"sample {names[index]!r}: its feature covers {100 * share:.1f} % of it; too"
                " little background is left to synthesise from"
            )
    return replace(sheet, barred=barred)


def roomy(barred: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Texels (h, w) with no barred one and no border within `reach` rows and columns."""
    return np.asarray(~maximum_filter(barred, 2 * reach + 1, mode="constant", cval=True), np.bool_)
