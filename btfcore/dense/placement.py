"""Puts stencils on a square board one after the other, each as low as it fits."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.dense.stencil import Stencils
from btfcore.types import I4, I8

_SMALL = 12  # boxes up to this side are looked for from where the last one like it went


def place(stencils: Stencils, order: I8, size: int, margin: int) -> I4 | None:
    """Place charts in `order` on a size x size board with `margin` cells between them.

    stencils : R rotations of C charts, number ``r * C + c``; order (C,) names each chart once.
    Returns (C, 3) i4: rotation, column and row of the lower left cell of each stencil's box,
    or None where a chart finds no room. A chart goes where its upper edge is lowest; ties go
    to the smaller rotation, then to the left. Small ones do not look below the last
    one of their height and width.
    """
    found = np.zeros((len(order), 3), np.int32)
    if _place(
        stencils.height, stencils.width, stencils.start, stencils.row, stencils.first,
        stencils.last, order, size, margin, found,
    ):  # fmt: skip
        return found
    return None


@njit(cache=True)
def _place(
    height: I8, width: I8, start: I8, row: I8, first: I4, last: I4,
    order: I8, size: int, margin: int, found: I4,
) -> bool:  # fmt: skip
    count = len(order)
    rotations = len(height) // count
    # First busy and first free cell at or after each cell of a row.
    busy = np.full((size, size + 1), size, np.int32)
    free = np.empty((size, size + 1), np.int32)
    for x in range(size + 1):
        free[:, x] = x
    longest = np.full(size, size, np.int32)  # run of free cells in each row
    begin = np.zeros((_SMALL + 1, _SMALL + 1), np.int32)
    for chart in order:
        best, best_rotation, best_x, best_y = size + 1, -1, 0, 0
        for rotation in range(rotations):
            item = rotation * count + chart
            tall, wide = height[item], width[item]
            if wide > size:
                continue
            rows = row[start[item] : start[item] + tall + 1]
            small = tall <= _SMALL and wide <= _SMALL
            bottom = begin[tall, wide] if small else 0
            x, y = _lowest(
                busy, free, longest, rows, first, last, wide, bottom, min(best - 1, size) - tall
            )
            if y >= 0:
                best, best_rotation, best_x, best_y = y + tall, rotation, x, y
                if small:
                    begin[tall, wide] = y
        if best_rotation < 0:
            return False
        found[chart, 0], found[chart, 1], found[chart, 2] = best_rotation, best_x, best_y
        item = best_rotation * count + chart
        rows = row[start[item] : start[item] + height[item] + 1]
        _occupy(busy, free, longest, rows, first, last, best_x, best_y, margin)
    return True


@njit(cache=True)
def _lowest(
    busy: I4, free: I4, longest: I4, rows: I8, first: I4, last: I4,
    wide: int, bottom: int, top: int,
) -> tuple[int, int]:  # fmt: skip
    """Lowest, then leftmost place whose lowest row is within bottom … top; (-1, -1) if none."""
    size, tall = len(busy), len(rows) - 1
    widest, need = 0, 0
    for j in range(tall):
        for run in range(rows[j], rows[j + 1]):
            if last[run] - first[run] + 1 > need:
                widest, need = j, last[run] - first[run] + 1
    guess = 0  # the row that collided last is the likeliest to collide again
    for y in range(bottom, top + 1):
        if longest[y + widest] < need:
            continue
        x = 0
        while x + wide <= size:
            clear = True
            for step in range(tall):
                j = guess + step
                if j >= tall:
                    j -= tall
                for run in range(rows[j], rows[j + 1]):
                    hit = busy[y + j, x + first[run]]
                    if hit <= x + last[run]:
                        x = free[y + j, hit] - first[run]
                        clear = False
                        break
                if not clear:
                    guess = j
                    break
            if clear:
                return x, y
    return -1, -1


@njit(cache=True)
def _occupy(
    busy: I4, free: I4, longest: I4, rows: I8, first: I4, last: I4, x: int, y: int, margin: int
) -> None:
    size, tall = len(busy), len(rows) - 1
    for target in range(max(y - margin, 0), min(y + tall - 1 + margin, size - 1) + 1):
        for j in range(max(target - margin - y, 0), min(target + margin - y, tall - 1) + 1):
            for run in range(rows[j], rows[j + 1]):
                low = max(x + first[run] - margin, 0)
                high = min(x + last[run] + margin, size - 1)
                for column in range(low, high + 1):
                    busy[target, column] = column
        gap, longest[target] = 0, 0
        for column in range(size - 1, -1, -1):
            if busy[target, column] == column:
                free[target, column] = free[target, column + 1]
                gap = 0
            else:
                gap += 1
                longest[target] = max(longest[target], gap)
                busy[target, column] = busy[target, column + 1]
                free[target, column] = column
