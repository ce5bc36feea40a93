"""Images averaged over squares of texels: a fine bake as a sample without jagged shadows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from btfcore.btf.sample import BtfSample
from btfcore.btf.stack import ImageStack
from btfcore.types import F4


class BinnedStack:
    """Another stack's images, each texel the mean of `by` × `by` of theirs; an `ImageStack`."""

    def __init__(self, stack: ImageStack, by: int) -> None:
        """Look at `stack`, whose sides `by` must divide."""
        self._stack = stack
        self._by = by

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of images, rows, columns."""
        count, height, width = self._stack.shape
        return count, height // self._by, width // self._by

    @property
    def dear(self) -> bool:
        """As that of what is averaged."""
        return self._stack.dear

    def read(self, numbers: ArrayLike) -> F4:
        """Images `numbers` (n,) as (n, H, W, 3) f4 linear radiance."""
        wanted = np.asarray(numbers, np.int64).reshape(-1)
        _, height, width = self.shape
        out = np.empty((len(wanted), height, width, 3), np.float32)
        # A fine image is `by`² times larger than what is asked for: few at a time.
        for first in range(0, len(wanted), 32):
            part = self._stack.read(wanted[first : first + 32])
            out[first : first + 32] = means(part, self._by)
        return out


def means(images: F4, by: int) -> F4:
    """Means (n, H/by, W/by, C) of images (n, H, W, C) over squares of `by` texels a side."""
    total = images[:, ::by, ::by].copy()
    for down in range(by):
        for right in range(by):
            if down or right:
                total += images[:, down::by, right::by]
    return total / np.float32(by * by)


def binned(sample: BtfSample, by: int) -> BtfSample:
    """Return a sample at 1/`by` of its resolution."""
    if by == 1:
        return sample
    mask = sample.mask
    return replace(
        sample,
        stack=BinnedStack(sample.stack, by),
        mask=None if mask is None else means(mask[None, ..., None], by)[0, ..., 0],
        texel_size=None if sample.texel_size is None else sample.texel_size * by,
    )
