"""A sample made ready for quilting: its channels at the pattern's scale, and statistics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from btfcore.errors import InvalidImage
from btfcore.types import F4, F8, Frozen, Sample


@dataclass(frozen=True, eq=False)
class SampleGrid(Frozen):
    """Channels of a sample on the grid in which patches are placed.

    cut (h, w, K) f4: all channels, whose distances are the sample's own; match (h, w, k) f4:
    their principal parts, mean removed; unit: dense-mesh steps per grid texel; shrink: grid
    texels per sample texel (below 1 the pattern is smaller than the dense mesh resolves, so
    it is filtered); texel_difference and random_difference: mean distance of neighbouring and
    of random texels.
    """

    cut: F4
    match: F4
    unit: float
    shrink: float
    texel_difference: float
    random_difference: float

    def to_sample(self, place: F4 | F8) -> F4:
        """Grid (column, row) as sample (column, row)."""
        if self.shrink == 1.0:
            return place.astype(np.float32)
        return ((place + 0.5) / self.shrink - 0.5).astype(np.float32)

    def from_sample(self, place: F4 | F8) -> F4:
        """Sample (column, row) as grid (column, row); the inverse of `to_sample`."""
        if self.shrink == 1.0:
            return place.astype(np.float32)
        return ((place + 0.5) * self.shrink - 0.5).astype(np.float32)


def sample_grid(sample: Sample, *, scale: float = 1.0, match_channels: int = 4) -> SampleGrid:
    """Prepare `sample` for a pattern `scale` times its natural size.

    Raises `InvalidImage` where less than 2 × 2 texels are left.
    """
    shrink = min(scale, 1.0)
    channels = reduced_channels(sample, scale)
    cut = _without_copies(channels)
    cut = np.ascontiguousarray(cut - cut.mean(axis=(0, 1), dtype=np.float64), np.float32)
    near, far = differences(cut)
    match = _principal(cut, match_channels)
    return SampleGrid(cut, match, max(scale, 1.0), shrink, near, far)


def colour_grid(sample: Sample, grid: SampleGrid) -> F4:
    """Colours (h, w, 3) f4 of `sample` on its grid."""
    return sample.colour if grid.shrink == 1.0 else _reduced(sample.colour, grid.shrink)


def reduced_channels(sample: Sample, scale: float) -> F4:
    """Channels (h, w, K) f4 of `sample` for a pattern `scale` times its natural size.

    Raises `InvalidImage` where less than 2 × 2 texels are left.
    """
    channels = sample.channels
    height, width = channels.shape[:2]
    if scale < 1.0:
        channels = _reduced(channels, scale)
    if min(channels.shape[:2]) < 2:
        raise InvalidImage(
            f"sample {sample.name!r} of {width} x {height} texels at scale {scale:g} leaves"
            f" {channels.shape[1]} x {channels.shape[0]}; quilting needs at least 2 x 2"
        )
    return channels


def mask_grid(sample: Sample, scale: float) -> F4:
    """Feature (h, w) f4 of `sample` on its grid; 0 where it has none.

    Raises `InvalidImage` for a mask of another size than the sample's.
    """
    size = sample.channels.shape[:2]
    if sample.mask is None:
        return np.zeros([max(int(side * min(scale, 1.0) + 1e-9), 0) for side in size], np.float32)
    if sample.mask.shape != size:
        raise InvalidImage(
            f"sample {sample.name!r}: a mask of {sample.mask.shape[1]} x {sample.mask.shape[0]}"
            f" texels for {size[1]} x {size[0]}"
        )
    if scale >= 1.0:
        return sample.mask
    return np.ascontiguousarray(_reduced(sample.mask[..., None], scale)[..., 0])


def _reduced(channels: F4, shrink: float) -> F4:
    """Low-pass and resample (H, W, K) to `shrink` of its size."""
    height, width = channels.shape[:2]
    blur = 0.5 * np.sqrt(max(1 / shrink**2 - 1, 0.0))
    rows = (np.arange(int(height * shrink + 1e-9)) + 0.5) / shrink - 0.5
    columns = (np.arange(int(width * shrink + 1e-9)) + 0.5) / shrink - 0.5
    where = np.meshgrid(rows, columns, indexing="ij")
    layers = [
        map_coordinates(
            gaussian_filter(channels[..., k], blur, mode="nearest"), where, order=1, mode="nearest"
        )
        for k in range(channels.shape[2])
    ]
    return np.stack(layers, axis=-1).astype(np.float32)


def _without_copies(channels: F4) -> F4:
    """One channel of weight √K where all are the same (a grey picture stored as RGB)."""
    count = channels.shape[2]
    if count > 1 and np.array_equal(channels, np.repeat(channels[..., :1], count, axis=2)):
        return channels[..., :1] * np.float32(np.sqrt(count))
    return channels


def differences(cut: F4) -> tuple[float, float]:
    """Mean distance of neighbouring texels and of random pairs of texels."""
    wide = cut.astype(np.float64)
    across = np.sqrt(((wide[:, 1:] - wide[:, :-1]) ** 2).sum(axis=-1))
    down = np.sqrt(((wide[1:] - wide[:-1]) ** 2).sum(axis=-1))
    near = (across.sum() + down.sum()) / (across.size + down.size)
    flat = wide.reshape(-1, wide.shape[-1])
    pairs = np.random.default_rng(0).integers(0, len(flat), (2, 20_000))
    far = np.sqrt(((flat[pairs[0]] - flat[pairs[1]]) ** 2).sum(axis=-1)).mean()
    return float(near), float(far)


def _principal(cut: F4, most: int) -> F4:
    """Principal components of `cut` that carry 99.9 % of its variance, at most `most`."""
    count = cut.shape[2]
    if count == 1:
        return cut
    flat = cut.reshape(-1, count).astype(np.float64)
    # einsum, not a BLAS product: its sums do not depend on the number of threads
    values, vectors = np.linalg.eigh(np.einsum("ik,il->kl", flat, flat))
    values, vectors = values[::-1], vectors[:, ::-1]
    share = np.cumsum(values) / max(values.sum(), 1e-300)
    keep = min(int(np.searchsorted(share, 0.999)) + 1, most, count)
    signs = np.sign(vectors[np.abs(vectors).argmax(axis=0), np.arange(count)])
    match = np.einsum("ik,kl->il", flat, (vectors * signs)[:, :keep])
    return np.ascontiguousarray(match.reshape(*cut.shape[:2], keep), np.float32)
