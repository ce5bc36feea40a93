"""Divides the pieces' borders at their nodes and finds the nodes on the texel walks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from btfcore.dense.check import Flags
from btfcore.dense.cut import Pieces
from btfcore.dense.walk import Walks
from btfcore.types import F8, I4, Frozen

_TRIES = 4  # places that are tried for a piece's first corner
_CELLS = 4_000_000  # of the dynamic programme; above, only one place is tried
_SPACING = 4.0  # texels between the marks set along arcs
_MARKS = 250  # per piece, at most


@dataclass(frozen=True, eq=False)
class Corners(Frozen):
    """Where border arcs begin; an arc runs from its corner to the next one of its piece.

    half : (C,) i4, the arc's first half-edge, pieces in order and each in border order;
    place : (C,) i4, position on the walk; steps : (C,) i4, walk steps to the next corner;
    mate : (C,) i4, the arc on the other side of the seam, -1 along the mesh's boundary;
    around : (C,) i4, the next corner counter-clockwise about the same node, -1 at its end;
    start : (pieces + 1,) i4, piece p owns corners start[p] … start[p + 1].
    """

    half: I4
    place: I4
    steps: I4
    mate: I4
    around: I4
    start: I4


def place_corners(uv: F8, pieces: Pieces, walks: Walks, texel: I4) -> Corners:
    """Break borders where other than two pieces meet, and assign the corners to walks.

    The assignment is monotone along the walk and minimises the squared distance in texels,
    of the corners and of marks set between them: without these, two corners at one place (a
    chart that touches itself) could swallow the arc between them. Where two disks meet along
    their whole border three corners are set.
    """
    uv = np.ascontiguousarray(uv)
    is_corner = _corner_flags(pieces.twin, pieces.ahead, pieces.behind)
    half, start = _list_corners(is_corner, pieces.piece, pieces.count, pieces.ahead)
    mate, around = _link(half, is_corner, pieces.twin, pieces.ahead, pieces.behind)
    place, steps = _assign_all(uv, half, start, pieces.ahead, walks.vertex, walks.start, texel)
    return Corners(half, place, steps, mate, around, start)


@njit(cache=True)
def _corner_flags(twin: I4, ahead: I4, behind: I4) -> Flags:
    """Whether a border half-edge starts at a node: any number of pieces but two meets there."""
    flag = np.zeros(len(twin), np.bool_)
    for half in range(len(twin)):
        if ahead[half] < 0:
            continue
        other, before = twin[half], twin[behind[half]]
        if other < 0 or before < 0:
            flag[half] = (other < 0) != (before < 0)
        else:
            flag[half] = ahead[other] != before or other == behind[half]
    seen = np.zeros(len(twin), np.bool_)
    for half in range(len(twin)):
        if ahead[half] < 0 or seen[half]:
            continue
        count, none, here = 0, True, half
        while not seen[here]:
            seen[here] = True
            none = none and not flag[here]
            count += 1
            here = ahead[here]
        if not none or twin[half] < 0:
            continue
        for third in range(3):
            for _ in range(third * count // 3 - (third - 1) * count // 3 if third else 0):
                here = ahead[here]
            flag[here] = True
            flag[ahead[twin[here]]] = True
    return flag


@njit(cache=True)
def _list_corners(flag: Flags, piece: I4, pieces: int, ahead: I4) -> tuple[I4, I4]:
    start = np.zeros(pieces + 1, np.int32)
    first = np.full(pieces, -1, np.int32)
    for half in range(len(flag)):
        if flag[half]:
            start[piece[half // 3] + 1] += 1
            if first[piece[half // 3]] < 0:
                first[piece[half // 3]] = half
    for p in range(pieces):
        start[p + 1] += start[p]
    corners = np.empty(start[pieces], np.int32)
    for p in range(pieces):
        here = first[p]
        for place in range(start[p], start[p + 1]):
            corners[place] = here
            here = ahead[here]
            while not flag[here]:
                here = ahead[here]
    return corners, start


@njit(cache=True)
def _link(half: I4, flag: Flags, twin: I4, ahead: I4, behind: I4) -> tuple[I4, I4]:
    """Mates of arcs, and the corners around each node."""
    index = np.full(len(flag), -1, np.int32)
    for corner in range(len(half)):
        index[half[corner]] = corner
    mate = np.full(len(half), -1, np.int32)
    around = np.full(len(half), -1, np.int32)
    for corner in range(len(half)):
        last = half[corner]
        if twin[last] < 0:
            continue
        around[corner] = index[ahead[twin[last]]]
        while not flag[ahead[last]]:
            last = ahead[last]
        mate[corner] = index[twin[last]]
    return mate, around


@njit(cache=True)
def _assign_all(
    uv: F8, half: I4, start: I4, ahead: I4, vertex: I4, begin: I4, texel: I4
) -> tuple[I4, I4]:
    place = np.zeros(len(half), np.int32)
    steps = np.zeros(len(half), np.int32)
    for piece in range(len(start) - 1):
        low, high = start[piece], start[piece + 1]
        if low == high:
            continue
        walk = texel[vertex[begin[piece] : begin[piece + 1]]]
        target, row = _marks(uv, half[low:high], ahead)
        along = assign(target, walk)
        for corner in range(low, high):
            here = along[row[corner - low]]
            place[corner] = begin[piece] + here % len(walk)
            if corner + 1 < high:
                steps[corner] = along[row[corner + 1 - low]] - here
            else:
                steps[corner] = (len(walk) if len(walk) > 1 else 0) - (here - along[0])
    return place, steps


@njit(cache=True)
def _marks(uv: F8, half: I4, ahead: I4) -> tuple[F8, I4]:
    """Points (T, 2) along one piece's border, and which of them are its corners, (k,) i4."""
    length = 0.0
    here = half[0]
    while True:
        length += _length(uv, here)
        here = ahead[here]
        if here == half[0]:
            break
    spacing = max(_SPACING, length / _MARKS)
    target = np.empty((len(half) + int(length / spacing) + 2, 2))
    row = np.empty(len(half), np.int32)
    count = corners = 0
    run = 0.0
    while True:
        face, k = here // 3, here % 3
        if corners < len(half) and half[corners] == here:
            target[count] = uv[face, k]
            row[corners] = count
            count, corners, run = count + 1, corners + 1, 0.0
        size = _length(uv, here)
        place = spacing - run
        while place < size and count < len(target):
            target[count] = uv[face, k] + (uv[face, (k + 1) % 3] - uv[face, k]) * (place / size)
            count += 1
            place += spacing
        run = size - (place - spacing)
        here = ahead[here]
        if here == half[0]:
            break
    return target[:count], row


@njit(cache=True)
def _length(uv: F8, half: int) -> float:
    face, k = half // 3, half % 3
    x = uv[face, (k + 1) % 3, 0] - uv[face, k, 0]
    y = uv[face, (k + 1) % 3, 1] - uv[face, k, 1]
    return np.sqrt(x * x + y * y)


@njit(cache=True)
def assign(target: F8, walk: I4) -> I4:
    """Monotone cyclic assignment of points to positions of one walk.

    target (k, 2) f8 (column, row), k ≥ 1; walk (L, 2) i4 (row, column). Returns positions
    (k,) i4, ascending: the first below L, the last at most L beyond it, modulo L on the walk.
    """
    along = np.zeros(len(target), np.int32)
    corners, length = len(target), len(walk)
    if length < 2:
        return along
    tries = _TRIES if corners * length <= _CELLS else 1
    floor = 0.0  # what no assignment can undercut
    for corner in range(corners):
        best = np.inf
        for i in range(length):
            best = min(best, _far(walk, i, target, corner))
        floor += best
    near = np.empty(length)
    for i in range(length):
        near[i] = _far(walk, i, target, 0)
    order = np.argsort(near, kind="mergesort")
    least = np.inf
    cost = np.empty(length + 1)
    choice = np.empty((corners, length + 1), np.int32)
    for attempt in range(min(tries, length)):
        first = order[attempt]
        if near[first] > least or least <= floor * (1 + 1e-9):
            break
        cost[:] = near[first]
        for corner in range(1, corners):
            best, at = np.inf, 0
            for step in range(length + 1):
                i = first + step
                total = cost[step] + _far(walk, i - length if i >= length else i, target, corner)
                if total < best:
                    best, at = total, step
                cost[step] = best
                choice[corner, step] = at
        if cost[length] >= least:
            continue
        least = cost[length]
        step = length
        for corner in range(corners - 1, 0, -1):
            step = choice[corner, step]
            along[corner] = first + step
        along[0] = first
    return along


@njit(cache=True)
def _far(walk: I4, i: int, target: F8, corner: int) -> float:
    x, y = walk[i, 1] - target[corner, 0], walk[i, 0] - target[corner, 1]
    return x * x + y * y
