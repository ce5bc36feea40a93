"""Structural similarity of two pictures (Wang, Bovik, Sheikh, Simoncelli 2004)."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.errors import InvalidParameter
from btfcore.types import F4, F8

SIZE = 11  # of the window
SIGMA = 1.5
_C1, _C2 = 0.01**2, 0.03**2


def ssim(one: F4, two: F4) -> float:
    """Mean SSIM of two pictures (H, W) with values in 0–1.

    Gaussian windows of 11 × 11, σ = 1.5, that lie wholly inside; in pictures narrower than
    that, of the largest odd size that does. Raises `InvalidParameter` where sizes differ.
    """
    if one.shape != two.shape or one.ndim != 2 or one.size == 0:
        raise InvalidParameter(f"pictures of shapes {one.shape} and {two.shape} to compare")
    return float(_ssim(one, two, window(one.shape[0]), window(one.shape[1])))


def window(length: int) -> F8:
    """Weights of the window along an edge of `length` texels; their sum is 1."""
    size = min(SIZE, length - 1 + length % 2)
    at = np.arange(size) - size // 2
    weights = np.exp(-(at**2) / (2 * SIGMA**2))
    return weights / weights.sum()


@njit(cache=True, nogil=True, error_model="numpy")
def _ssim(one, two, down, along):  # type: ignore[no-untyped-def]
    height, width = one.shape
    rows, columns = height - len(down) + 1, width - len(along) + 1
    # moments filtered along rows, in a ring of as many rows as the window has
    ring = np.zeros((5, len(down), columns))
    line = np.zeros((5, width))
    sums = np.zeros((5, columns))
    lanes = np.zeros(columns)
    for i in range(height):
        for j in range(width):
            x, y = np.float64(one[i, j]), np.float64(two[i, j])
            line[0, j], line[1, j] = x, y
            line[2, j], line[3, j], line[4, j] = x * x, y * y, x * y
        for m in range(5):
            goal, source = ring[m, i % len(down)], line[m]
            goal[:] = 0
            for k in range(len(along)):
                weight = along[k]
                for j in range(columns):
                    goal[j] += weight * source[j + k]
        top = i - len(down) + 1
        if top < 0:
            continue
        sums[:] = 0
        for m in range(5):
            goal = sums[m]
            for k in range(len(down)):
                weight, source = down[k], ring[m, (top + k) % len(down)]
                for j in range(columns):
                    goal[j] += weight * source[j]
        for j in range(columns):
            x, y = sums[0, j], sums[1, j]
            xx, yy, xy = sums[2, j] - x * x, sums[3, j] - y * y, sums[4, j] - x * y
            above = (2 * x * y + _C1) * (2 * xy + _C2)
            lanes[j] += above / ((x * x + y * y + _C1) * (xx + yy + _C2))
    return lanes.sum() / (rows * columns)
