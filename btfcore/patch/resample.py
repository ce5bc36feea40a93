"""The work image: a patch's synthesised part on a regular grid (Zhou §III-B)."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.types import F4, F8, I4


@njit(cache=True)
def work_image(
    faces: I4,
    face_ptr: I4,
    face_of: I4,
    order: I4,
    local: I4,
    point: F8,
    values: F4,
    known: NDArray[np.bool_],
    half: int,
) -> tuple[F4, F4]:
    """Rasterise the triangles whose three vertices are known.

    point (n, 2) f8: (column, row) of the patch's vertices, the centre at (0, 0); values
    (n, K) f4 at the vertices; known (n,) bool. The image has side 2·half + 1 and its middle
    pixel at the patch's centre. Returns (image (K, side, side) f4, zero where unknown, mask
    (side, side) f4 of 0 and 1).
    """
    side = 2 * half + 1
    channels = values.shape[1]
    image = np.zeros((channels, side, side), np.float32)
    mask = np.zeros((side, side), np.float32)
    for here in range(len(order)):
        if not known[here]:
            continue
        vertex = order[here]
        for index in range(face_ptr[vertex], face_ptr[vertex + 1]):
            face = face_of[index]
            a, b, c = local[faces[face, 0]], local[faces[face, 1]], local[faces[face, 2]]
            if a < 0 or b < 0 or c < 0 or min(a, b, c) != here:
                continue
            if not (known[a] and known[b] and known[c]):
                continue
            ax, ay = point[a, 0] + half, point[a, 1] + half
            ux, uy = point[b, 0] - point[a, 0], point[b, 1] - point[a, 1]
            vx, vy = point[c, 0] - point[a, 0], point[c, 1] - point[a, 1]
            twice = ux * vy - uy * vx
            if abs(twice) < 1e-9:
                continue
            left = max(int(np.ceil(ax + min(0.0, ux, vx) - 1e-9)), 0)
            right = min(int(np.floor(ax + max(0.0, ux, vx) + 1e-9)), side - 1)
            top = max(int(np.ceil(ay + min(0.0, uy, vy) - 1e-9)), 0)
            bottom = min(int(np.floor(ay + max(0.0, uy, vy) + 1e-9)), side - 1)
            for row in range(top, bottom + 1):
                for column in range(left, right + 1):
                    x, y = column - ax, row - ay
                    w1 = (x * vy - y * vx) / twice
                    w2 = (y * ux - x * uy) / twice
                    w0 = 1.0 - w1 - w2
                    if w0 < -1e-9 or w1 < -1e-9 or w2 < -1e-9:
                        continue
                    mask[row, column] = 1.0
                    for k in range(channels):
                        image[k, row, column] = (
                            w0 * values[a, k] + w1 * values[b, k] + w2 * values[c, k]
                        )
    return image, mask


@njit(cache=True)
def look_up(grid: F4, source: F4) -> F4:
    """Bilinear values (n, K) f4 of `grid` (H, W, K) at (column, row), clamped at its border."""
    height, width, channels = grid.shape
    result = np.empty((len(source), channels), np.float32)
    for index in range(len(source)):
        x = min(max(source[index, 0], np.float32(0.0)), np.float32(width - 1))
        y = min(max(source[index, 1], np.float32(0.0)), np.float32(height - 1))
        column, row = min(int(x), max(width - 2, 0)), min(int(y), max(height - 2, 0))
        right, below = min(column + 1, width - 1), min(row + 1, height - 1)
        fx, fy = x - np.float32(column), y - np.float32(row)
        for k in range(channels):
            upper = grid[row, column, k] * (1 - fx) + grid[row, right, k] * fx
            lower = grid[below, column, k] * (1 - fx) + grid[below, right, k] * fx
            result[index, k] = upper * (1 - fy) + lower * fy
    return result
