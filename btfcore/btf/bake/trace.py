"""Where lines of sight meet a relief, exactly: cell by cell, a quadratic in each.

The surface is bilinear between texel centres, so along a ray its height is a quadratic in every
cell; its first root is the hit. Nothing is stepped over, however thin, and there is no step
size to choose.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.types import F4, F8

_FAR = 1e300


@njit(cache=True, nogil=True, error_model="numpy")
def trace(
    height: F4, ceiling: F4, first: int, width: int, run: F8, level: F8, x: F8, y: F8
) -> None:
    """Fill in where the lines of sight through consecutive texels meet the relief.

    height (h, w) f4 in texels, repeated for ever in both directions; ceiling (h, w) f4:
    highest corner of the cell that begins at each texel. first : number of the first texel in
    an image of `width` columns, which may be smaller than the relief. run (2,) f8: columns and
    rows by which a line of sight moves towards the viewer per unit of height. level (3,) f8:
    height at which lines pass through their texels, highest and lowest height. x, y (n,) f8:
    column and row of the hits, wrapped into the relief.
    """
    rows, columns = height.shape
    plane, top, bottom = level[0], level[1], level[2]
    along_x, along_y = -run[0], -run[1]  # per unit of height on the way down
    last = top - bottom
    for k in range(len(x)):
        start_x = (first + k) % width + run[0] * (top - plane)
        start_y = (first + k) // width + run[1] * (top - plane)
        column, next_x, step_x, gap_x = enter(start_x, along_x)
        row, next_y, step_y, gap_y = enter(start_y, along_y)
        i, j = column % columns, row % rows
        now = 0.0
        found = last
        while now < last:
            leave = min(next_x, next_y, last)
            if top - leave < ceiling[j, i]:
                base, slope_x, slope_y, twist = cell(height, j, i)
                u, w = start_x + along_x * now - column, start_y + along_y * now - row
                c0 = top - now - (base + slope_x * u + slope_y * w + twist * u * w)
                climb = slope_x * along_x + slope_y * along_y
                c1 = -1 - climb - twist * (u * along_y + w * along_x)
                c2 = -twist * along_x * along_y
                root = first_root(c0, c1, c2, leave - now)
                if root >= 0:
                    found = now + root
                    break
            now = leave
            if next_x <= next_y:
                next_x += gap_x
                column += step_x
                i = wrapped(i + step_x, columns)
            else:
                next_y += gap_y
                row += step_y
                j = wrapped(j + step_y, rows)
        x[k] = folded(start_x + along_x * found, columns)
        y[k] = folded(start_y + along_y * found, rows)


@njit(cache=True, nogil=True, error_model="numpy")
def folded(position, size):  # type: ignore[no-untyped-def]
    """Position brought back to 0 … size, the end excluded."""
    inside = position % size
    return inside if inside < size else 0.0  # a position just below 0 is rounded to size


@njit(cache=True, nogil=True, error_model="numpy")
def enter(position, speed):  # type: ignore[no-untyped-def]
    """Cell that a ray enters on one axis, time to its border, step, and time per cell."""
    place = int(np.floor(position))
    if speed > 1e-12:
        return place, (place + 1 - position) / speed, 1, 1 / speed
    if speed < -1e-12:
        if place == position:
            place -= 1
        return place, (place - position) / speed, -1, -1 / speed
    return place, _FAR, 1, _FAR


@njit(cache=True, nogil=True, error_model="numpy")
def wrapped(place, size):  # type: ignore[no-untyped-def]
    """Index one step beyond either end, brought back to the other end."""
    if place == size:
        return 0
    return size - 1 if place < 0 else place


@njit(cache=True, nogil=True, error_model="numpy")
def cell(height, row, column):  # type: ignore[no-untyped-def]
    """Bilinear surface of a cell: height at its first corner, two slopes and the twist."""
    right, below = wrapped(column + 1, height.shape[1]), wrapped(row + 1, height.shape[0])
    base = np.float64(height[row, column])
    beside, under = np.float64(height[row, right]), np.float64(height[below, column])
    across = np.float64(height[below, right])
    return base, beside - base, under - base, across - beside - under + base


@njit(cache=True, nogil=True, error_model="numpy")
def first_root(c0, c1, c2, end):  # type: ignore[no-untyped-def]
    """Smallest root of c0 + c1 t + c2 t² within 0 … end where c0 is the gap left; else -1."""
    if c0 <= 0:
        return 0.0
    if c0 + end * (c1 + end * c2) > 0:
        # still above at the end: only a dip below zero on the way is a hit
        if not (c2 > 0 and c1 < 0 and -c1 < 2 * c2 * end and c1 * c1 > 4 * c2 * c0):
            return -1.0
    square = np.sqrt(max(c1 * c1 - 4 * c2 * c0, 0.0))
    root = 2 * c0 / (square - c1) if c1 < 0 else -(c1 + square) / (2 * c2)
    return min(max(root, 0.0), end)


@njit(cache=True, nogil=True, error_model="numpy")
def surface(height, x, y):  # type: ignore[no-untyped-def]
    """Height of the relief at a column and row within it."""
    column, row = int(x), int(y)
    base, slope_x, slope_y, twist = cell(height, row, column)
    u, w = x - column, y - row
    return base + slope_x * u + slope_y * w + twist * u * w
