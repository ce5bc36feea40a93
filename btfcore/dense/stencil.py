"""Stencils: which cells of a coarse grid every chart touches, as runs along rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.types import F8, I4, I8

Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Stencils:
    """Cells touched by charts, each in its own box of height x width cells.

    height, width (C,) i4; corner (C, 2) i8: (column, row) of the box's first cell in the
    chart's own coordinates. Row j of chart c owns the runs row[start[c] + j] …
    row[start[c] + j + 1] - 1 of `first` and `last`, columns within the box, both inclusive.
    """

    height: I8
    width: I8
    corner: I8
    start: I8
    row: I8
    first: I4
    last: I4

    def cells(self) -> I8:
        """Number of cells of every stencil, (C,) i8."""
        total = _offsets(self.last - self.first + 1)
        return np.diff(total[self.row[self.start]])


def cut_stencils(uv: F8, order: I8, bounds: I8) -> Stencils:
    """Stencils of charts laid on the unit grid, whose cells are centred at integers.

    uv : (F, 3, 2) f8 in cells. order (F,), bounds (C+1,): the faces sorted by chart.
    """
    low, high = _extents(uv, order, bounds)
    corner = np.rint(low).astype(np.int64)
    shape = np.rint(high).astype(np.int64) - corner + 1
    offset = _offsets(shape[:, 0] * shape[:, 1])
    mask = np.zeros(offset[-1], np.bool_)
    _touch(uv, order, bounds, corner, shape[:, 0], offset, mask)
    return _from_masks(mask, offset, shape[:, 1], shape[:, 0], corner)


def quarter_turn(some: Stencils) -> Stencils:
    """Turn every stencil by a quarter: (column, row) becomes (row, -column)."""
    height, width = some.width, some.height
    offset = _offsets(height * width)
    mask = np.zeros(offset[-1], np.bool_)
    _turn(some.height, some.width, some.start, some.row, some.first, some.last, offset, mask)
    corner = np.stack([some.corner[:, 1], 1 - some.corner[:, 0] - some.width], axis=1)
    return _from_masks(mask, offset, height, width, corner)


def stack(parts: list[Stencils]) -> Stencils:
    """All stencils of `parts` in one collection, one part after the other."""
    rows = _offsets(np.array([part.start[-1] for part in parts]))
    runs = _offsets(np.array([len(part.first) for part in parts]))
    pairs = list(enumerate(parts))
    return Stencils(
        np.concatenate([part.height for part in parts]),
        np.concatenate([part.width for part in parts]),
        np.concatenate([part.corner for part in parts]),
        np.concatenate([part.start[:-1] + rows[k] for k, part in pairs] + [rows[-1:]]),
        np.concatenate([part.row[:-1] + runs[k] for k, part in pairs] + [runs[-1:]]),
        np.concatenate([part.first for part in parts]),
        np.concatenate([part.last for part in parts]),
    )


def _offsets(sizes: I8) -> I8:
    return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)


def _from_masks(mask: Flags, offset: I8, height: I8, width: I8, corner: I8) -> Stencils:
    start = _offsets(height)
    row, first, last = _runs(mask, offset, height, width, start)
    return Stencils(height, width, corner, start, row, first, last)


@njit(cache=True)
def _extents(uv: F8, order: I8, bounds: I8) -> tuple[F8, F8]:
    """Lowest and highest coordinates of every chart, (C, 2) each."""
    count = len(bounds) - 1
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    for c in range(count):
        for at in range(bounds[c], bounds[c + 1]):
            for k in range(3):
                for axis in range(2):
                    x = uv[order[at], k, axis]
                    low[c, axis] = min(low[c, axis], x)
                    high[c, axis] = max(high[c, axis], x)
    return low, high


@njit(cache=True)
def _touch(uv: F8, order: I8, bounds: I8, corner: I8, width: I8, offset: I8, mask: Flags) -> None:
    """Mark every cell that a face touches: clip the face to each row of cells."""
    for c in range(len(bounds) - 1):
        for at in range(bounds[c], bounds[c + 1]):
            f = order[at]
            y_min = min(uv[f, 0, 1], uv[f, 1, 1], uv[f, 2, 1])
            y_max = max(uv[f, 0, 1], uv[f, 1, 1], uv[f, 2, 1])
            for y in range(int(np.rint(y_min)), int(np.rint(y_max)) + 1):
                x_min, x_max = np.inf, -np.inf
                for k in range(3):
                    ax, ay = uv[f, k, 0], uv[f, k, 1]
                    bx, by = uv[f, (k + 1) % 3, 0], uv[f, (k + 1) % 3, 1]
                    if max(ay, by) < y - 0.5 or min(ay, by) > y + 0.5:
                        continue
                    for end in range(2):
                        line = y - 0.5 if end == 0 else y + 0.5
                        if (ay - line) * (by - line) < 0:
                            x = ax + (bx - ax) * (line - ay) / (by - ay)
                            x_min, x_max = min(x_min, x), max(x_max, x)
                    if abs(ay - y) <= 0.5:
                        x_min, x_max = min(x_min, ax), max(x_max, ax)
                    if abs(by - y) <= 0.5:
                        x_min, x_max = min(x_min, bx), max(x_max, bx)
                base = offset[c] + (y - corner[c, 1]) * width[c] - corner[c, 0]
                if x_min <= x_max:
                    for x in range(int(np.rint(x_min)), int(np.rint(x_max)) + 1):
                        mask[base + x] = True


@njit(cache=True)
def _turn(
    height: I8, width: I8, start: I8, row: I8, first: I4, last: I4, offset: I8, mask: Flags
) -> None:
    for c in range(len(height)):
        for j in range(height[c]):
            for run in range(row[start[c] + j], row[start[c] + j + 1]):
                for x in range(first[run], last[run] + 1):
                    mask[offset[c] + (width[c] - 1 - x) * height[c] + j] = True


@njit(cache=True)
def _runs(mask: Flags, offset: I8, height: I8, width: I8, start: I8) -> tuple[I8, I4, I4]:
    row = np.zeros(start[-1] + 1, np.int64)
    first = np.empty(len(mask), np.int32)
    last = np.empty(len(mask), np.int32)
    total = 0
    for c in range(len(height)):
        for j in range(height[c]):
            base = offset[c] + j * width[c]
            inside = False
            for x in range(width[c]):
                if mask[base + x]:
                    if not inside:
                        first[total] = x
                        total += 1
                    last[total - 1] = x
                inside = mask[base + x]
            row[start[c] + j + 1] = total
    return row, first[:total].copy(), last[:total].copy()
