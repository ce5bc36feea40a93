"""Gives more texels to pieces that are too small for the surface they must show."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.dense.check import Flags
from btfcore.dense.rasterise import free_texel
from btfcore.types import F8, I4

_REACH = 8  # texels from a piece at which one may be taken
_SMALL = 2.0  # texels; narrower pieces are shown enlarged
_LEAST = 6  # texels that a small piece grows to; larger ones double at most
_DOWN = np.array([0, 1, 1, -1, 0, -1, -1, 1], np.int32)  # full 2 x 2 blocks come first
_RIGHT = np.array([1, 0, 1, 0, -1, -1, 1, -1], np.int32)


def grow(uv: F8, piece: I4, wanted: Flags, face: I4, bary: F8) -> tuple[I4, F8]:
    """Add texels around each of the `wanted` pieces, a ring at most.

    wanted (pieces,) bool; face (size, size) i4 and bary (size, size, 3) f8 as `rasterise`
    gives them. Returns both with free texels added, which show the point of the piece nearest
    to their centre; of a piece narrower than two texels, the enlarged piece. A piece of few
    texels may also take free ones near by.
    """
    face, bary = face.copy(), bary.copy()
    order = np.argsort(piece, kind="stable").astype(np.int32)
    start = np.searchsorted(piece[order], np.arange(len(wanted) + 1)).astype(np.int32)
    of_texel = np.where(face >= 0, piece[face], -1).astype(np.int32)
    rows = np.argwhere((face >= 0) & np.append(wanted, False)[of_texel]).astype(np.int32)
    _grow(np.ascontiguousarray(uv), order, start, of_texel, rows, face, bary)
    return face, bary


@njit(cache=True)
def _grow(uv: F8, order: I4, start: I4, of_texel: I4, rows: I4, face: I4, bary: F8) -> None:
    size = face.shape[0]
    budget = np.zeros(len(start), np.int32)
    for place in range(len(rows)):
        budget[of_texel[rows[place, 0], rows[place, 1]]] += 1
    small = budget < _LEAST  # these may take free texels farther away
    for here in range(len(budget)):
        budget[here] = max(_LEAST - budget[here], budget[here])
    low, high = np.empty(2), np.empty(2)
    for place in range(len(rows)):
        row, column = rows[place, 0], rows[place, 1]
        here = of_texel[row, column]
        mine = order[start[here] : start[here + 1]]
        low[:], high[:] = np.inf, -np.inf
        for f in mine:
            for k in range(3):
                for axis in range(2):
                    low[axis] = min(low[axis], uv[f, k, axis])
                    high[axis] = max(high[axis], uv[f, k, axis])
        for way in range(8):
            down, right = _DOWN[way], _RIGHT[way]
            r, c = row + down, column + right
            if budget[here] == 0 or (0 <= r < size and 0 <= c < size and of_texel[r, c] == here):
                continue
            x, y = float(c), float(r)
            if high[0] - low[0] < _SMALL:
                x = (low[0] + high[0]) / 2 + right * 0.45 * (high[0] - low[0])
            if high[1] - low[1] < _SMALL:
                y = (low[1] + high[1]) / 2 + down * 0.45 * (high[1] - low[1])
            if small[here]:
                r, c = free_texel(face, size, float(r), float(c))
            if not (0 <= r < size and 0 <= c < size) or face[r, c] >= 0:
                continue
            if max(abs(r - row), abs(c - column)) > _REACH:
                continue
            _show(uv, mine, x, y, face, bary, r, c)
            budget[here] -= 1


@njit(cache=True)
def _show(uv: F8, mine: I4, x: float, y: float, face: I4, bary: F8, r: int, c: int) -> None:
    """Let texel (r, c) show the point of faces `mine` that lies nearest to (x, y)."""
    best = np.inf
    for f in mine:
        for k in range(3):  # nearest point of each edge
            ax, ay = uv[f, k, 0], uv[f, k, 1]
            bx, by = uv[f, (k + 1) % 3, 0] - ax, uv[f, (k + 1) % 3, 1] - ay
            square = bx * bx + by * by
            t = ((x - ax) * bx + (y - ay) * by) / square if square > 0 else 0.0
            t = min(max(t, 0.0), 1.0)
            far = (ax + t * bx - x) ** 2 + (ay + t * by - y) ** 2
            if far < best:
                best, face[r, c] = far, f
                bary[r, c] = 0
                bary[r, c, k], bary[r, c, (k + 1) % 3] = 1 - t, t
        ax, ay = uv[f, 0, 0], uv[f, 0, 1]
        bx, by, cx, cy = uv[f, 1, 0] - ax, uv[f, 1, 1] - ay, uv[f, 2, 0] - ax, uv[f, 2, 1] - ay
        area = bx * cy - by * cx
        if area != 0:
            two = ((x - ax) * cy - (y - ay) * cx) / area
            three = (bx * (y - ay) - by * (x - ax)) / area
            if min(two, three, 1 - two - three) >= 0:
                face[r, c] = f
                bary[r, c, 0], bary[r, c, 1], bary[r, c, 2] = 1 - two - three, two, three
                return
