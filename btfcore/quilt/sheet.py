"""The samples of one surface stacked into one array, as the kernels read them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from btfcore.quilt.grid import SampleGrid, colour_grid, sample_grid
from btfcore.types import F4, I4, Frozen, Sample

ANYWHERE: NDArray[np.bool_] = np.zeros(0, np.bool_)  # every vertex may take the sample


@dataclass(frozen=True, eq=False)
class Sheet(Frozen):
    """Channels of R samples, one above the other.

    cut (Σh, w, K) f4: each sample's own channels, whose distances mean something within that
    sample only; colour (Σh, w, 3) f4: sRGB colours, which compare across samples (one texel
    of zeros where there is but one sample); frames (R, 4) i4: first row, height, width and
    number of channels of each; grids: the samples one by one.
    """

    cut: F4
    colour: F4
    frames: I4
    grids: tuple[SampleGrid, ...] = ()

    def compared_by(self, channels: Sequence[F4]) -> Sheet:
        """Return this sheet with other channels, (h, w, k) f4 of each sample, in `cut`."""
        most = max(each.shape[2] for each in channels)
        cut = np.zeros((*self.cut.shape[:2], most), np.float32)
        frames = self.frames.copy()
        for index, each in enumerate(channels):
            top, height, width = frames[index, :3]
            cut[top : top + height, :width, : each.shape[2]] = each
            frames[index, 3] = each.shape[2]
        return Sheet(cut, self.colour, frames, self.grids)

    def colours(self, index: int) -> F4:
        """Colours (h, w, 3) f4 of one of several samples."""
        top, height, width = self.frames[index, :3]
        return np.ascontiguousarray(self.colour[top : top + height, :width])


def single(grid: F4) -> Sheet:
    """One sample's channels (h, w, K) as a sheet; nothing is copied."""
    frames = np.array([[0, *grid.shape]], np.int32)
    return Sheet(grid.view(), np.zeros((1, 1, 3), grid.dtype), frames)


def sheet_of(
    samples: Sequence[Sample], scales: Sequence[float], *, match_channels: int | None
) -> Sheet:
    """Stack `samples`, each at its scale; None matches on all channels.

    Raises `InvalidImage` as `sample_grid` does.
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
        return Sheet(alone.cut, alone.colour, alone.frames, grids)
    sizes = np.array([grid.cut.shape for grid in grids], np.int32)
    first = np.concatenate([[0], np.cumsum(sizes[:, 0])]).astype(np.int32)
    cut = np.zeros((first[-1], sizes[:, 1].max(), sizes[:, 2].max()), np.float32)
    colour = np.zeros((*cut.shape[:2], 3), np.float32)
    for top, sample, grid in zip(first, samples, grids, strict=False):
        height, width, channels = grid.cut.shape
        cut[top : top + height, :width, :channels] = grid.cut
        colour[top : top + height, :width] = colour_grid(sample, grid)
    return Sheet(cut, colour, np.concatenate([first[:-1, None], sizes], axis=1), grids)
