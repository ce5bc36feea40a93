"""Factors that spend more of their rank on an imperfection than its small area would earn.

An SVD spreads its error evenly over the texels. A crack covers a twentieth of its sample, yet
is what the sample is for: its texels are shown to the factorisation several times over, as
rows below the picture that are cut off again afterwards.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from btfcore.btf.factor.svd import factorize
from btfcore.btf.sample import BtfFactors, BtfSample
from btfcore.btf.stack import ImageStack
from btfcore.types import F4, I8


class RepeatedStack:
    """Another stack's images with some of their texels once more in rows below."""

    def __init__(self, stack: ImageStack, texels: I8) -> None:
        """Append `texels` (n,) of the flattened images, n a multiple of their width."""
        self._stack = stack
        self._texels = texels

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of images, rows, columns."""
        count, height, width = self._stack.shape
        return count, height + len(self._texels) // width, width

    @property
    def dear(self) -> bool:
        """As that of what is repeated."""
        return self._stack.dear

    def read(self, numbers: ArrayLike) -> F4:
        """Images `numbers` (n,) as (n, H, W, 3) f4 linear radiance."""
        images = self._stack.read(numbers)
        flat = images.reshape(len(images), -1, 3)
        more = flat[:, self._texels].reshape(len(images), -1, images.shape[2], 3)
        return np.concatenate([images, more], axis=1)


def emphasised(
    sample: BtfSample, *, rank: int, times: int = 3, memory_mb: float = 2048.0
) -> BtfFactors:
    """Return `rank` factors for which texels of the feature (mask > 0.5) count 1 + `times`.

    Without a mask, or with `times` 0, these are the usual ones.
    """
    chosen = np.zeros(0, np.int64)
    if sample.mask is not None:
        chosen = np.flatnonzero(sample.mask.ravel() > 0.5)
    height, width = sample.shape
    rows = round(len(chosen) * times / width)
    if rows == 0:
        return factorize(sample, rank=rank, memory_mb=memory_mb)
    texels = np.resize(chosen, rows * width)
    more = replace(sample, stack=RepeatedStack(sample.stack, texels), mask=None)
    factors = factorize(more, rank=rank, memory_mb=memory_mb)
    return replace(factors, weights=factors.weights[:height].copy())
