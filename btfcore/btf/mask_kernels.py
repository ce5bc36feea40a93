"""Compiled loops behind the tools that draw a mask; they write into what they are given."""

from __future__ import annotations

from math import ceil, floor, sqrt
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.types import F4, F8


@njit(cache=True, nogil=True)
def draw_segments(mask: F4, path: F8, hardness: float, remove: bool, tiles: bool) -> None:
    """Draw a polyline of (column, row, radius) into a mask (H, W); one point is a dab."""
    height, width = mask.shape
    last = max(len(path) - 1, 1)
    for k in range(last):
        x0, y0, r0 = path[k, 0], path[k, 1], path[k, 2]
        end = min(k + 1, len(path) - 1)
        dx, dy, dr = path[end, 0] - x0, path[end, 1] - y0, path[end, 2] - r0
        length2 = dx * dx + dy * dy
        r = max(r0, r0 + dr)
        reach = r + max(r * (1.0 - hardness), 0.5)
        top, bottom = ceil(min(y0, y0 + dy) - reach), floor(max(y0, y0 + dy) + reach)
        left, right = ceil(min(x0, x0 + dx) - reach), floor(max(x0, x0 + dx) + reach)
        if not tiles:
            top, bottom = max(top, 0), min(bottom, height - 1)
            left, right = max(left, 0), min(right, width - 1)
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                ex, ey = column - x0, row - y0
                along = 0.0
                if length2 > 0.0:
                    along = min(max((ex * dx + ey * dy) / length2, 0.0), 1.0)
                ex -= along * dx
                ey -= along * dy
                radius = r0 + along * dr
                ramp = max(2.0 * radius * (1.0 - hardness), 1.0)
                cover = 0.5 + (radius - sqrt(ex * ex + ey * ey)) / ramp
                if cover <= 0.0:
                    continue
                cover = min(cover, 1.0)
                i, j = row % height, column % width
                if remove:
                    mask[i, j] = min(mask[i, j], np.float32(1.0 - cover))
                else:
                    mask[i, j] = max(mask[i, j], np.float32(cover))


@njit(cache=True, nogil=True)
def winding_area(points: F8, out: F8) -> None:
    """Mean winding number of a closed polygon over unit squares, added to `out` (h, w + 2).

    points (n, 2): (x, y) within 0–w and 0–h; square (i, j) spans x from j to j + 1. What is
    added are differences along the rows: their running sum is the mean winding number.
    """
    height, width = out.shape[0], out.shape[1] - 2
    for k in range(len(points)):
        x0, y0 = points[k - 1, 0], points[k - 1, 1]
        x1, y1 = points[k, 0], points[k, 1]
        if y0 == y1:
            continue
        sign = 1.0
        if y0 > y1:
            x0, y0, x1, y1, sign = x1, y1, x0, y0, -1.0
        slope = (x1 - x0) / (y1 - y0)
        x = x0
        for row in range(floor(y0), min(ceil(y1), height)):
            part = min(row + 1.0, y1) - max(float(row), y0)
            beyond = min(max(x + slope * part, 0.0), float(width))
            _row_area(out[row], min(x, beyond), max(x, beyond), sign * part)
            x = beyond


@njit(cache=True, nogil=True)
def _row_area(row: F8, low: float, high: float, part: float) -> None:
    """Add the piece of one edge that lies in one row, from `low` to `high`, `part` tall."""
    first, last = floor(low), ceil(high)
    if last <= first + 1:
        middle = 0.5 * (low + high) - first
        row[first] += part * (1.0 - middle)
        row[first + 1] += part * middle
        return
    per = 1.0 / (high - low)  # share of the piece in one column that it crosses
    before = 0.0
    for column in range(first, last):
        # mean over this column of the share of the piece that lies to the left
        inner, outer = max(low, float(column)), min(high, column + 1.0)
        a, b = (inner - low) * per, (outer - low) * per
        mean = 0.5 * (a + b) * (outer - inner) + b * (column + 1.0 - outer)
        row[column] += part * (mean - before)
        before = mean
    row[last] += part * (1.0 - before)


@njit(cache=True, nogil=True)
def spread_flood(open_: NDArray[Any], row: int, column: int, tiles: bool) -> NDArray[np.bool_]:
    """Texels of `open_` (H, W) bool that hang together with one of them (8 neighbours)."""
    height, width = open_.shape
    found = np.zeros((height, width), np.bool_)
    if not open_[row, column]:
        return found
    stack = np.empty(64, np.int64)
    stack[0] = row * width + column
    found[row, column] = True
    count = 1
    while count > 0:
        count -= 1
        i, j = stack[count] // width, stack[count] % width
        for di in range(-1, 2):
            for dj in range(-1, 2):
                p, q = i + di, j + dj
                if tiles:
                    p, q = p % height, q % width
                elif p < 0 or q < 0 or p >= height or q >= width:
                    continue
                if open_[p, q] and not found[p, q]:
                    found[p, q] = True
                    if count == len(stack):
                        longer = np.empty(2 * count, np.int64)
                        longer[:count] = stack
                        stack = longer
                    stack[count] = p * width + q
                    count += 1
    return found
