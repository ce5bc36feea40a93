"""Cuts charts into topological disks, their texture coordinates left in place (Zhou §III-A)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from btfcore.mesh.topology import fans, find, join, twins
from btfcore.types import F8, I4, I8, Atlas, Frozen

_SAME_UV = 1e-4  # texels


@dataclass(frozen=True, eq=False)
class Pieces(Frozen):
    """Charts cut into disks; half-edge 3 f + k starts at corner k of face f.

    piece : (F,) i4, 0 … count-1; twin : (3F,) i4, partner in the mesh, -1 at its boundary;
    inner : (3F,) i4, partner inside the piece, -1 at its border; ahead, behind : (3F,) i4,
    next and previous half-edge along the border, surface on the left (-1 elsewhere).
    """

    piece: I4
    count: int
    twin: I4
    inner: I4
    ahead: I4
    behind: I4


def cut_into_disks(atlas: Atlas) -> Pieces:
    """Split every chart into pieces of Euler number 1, i.e. with one border and no handle.

    A chart that is no disk is halved by a breadth-first search from two faces far apart,
    until all parts are disks; a single face is one.
    """
    faces = atlas.mesh.faces
    twin = twins(faces)
    inner = _inner(twin, np.ascontiguousarray(atlas.uv), np.ascontiguousarray(atlas.chart))
    piece, count = label_parts(inner)
    while True:
        corner, corners = fans(inner)
        euler = _euler(piece, count, inner, corner, corners)
        bent = np.flatnonzero(euler != 1)
        if len(bent) == 0:
            break
        _halve(piece, inner, bent.astype(np.int32), count)
        piece, count = label_parts(inner)
    ahead, behind = _border(inner)
    return Pieces(piece, count, twin, inner, ahead, behind)


@njit(cache=True)
def after(half: int) -> int:
    """Next half-edge around the face."""
    return half - 2 if half % 3 == 2 else half + 1


@njit(cache=True)
def _inner(twin: I4, uv: F8, chart: I4) -> I4:
    """Keep the partners across which chart and texture coordinates continue."""
    inner = np.full(len(twin), -1, np.int32)
    for one in range(len(twin)):
        other = twin[one]
        if other < 0 or chart[one // 3] != chart[other // 3]:
            continue
        gap = 0.0
        for axis in range(2):
            start, stop = uv[one // 3, one % 3, axis], uv[after(one) // 3, after(one) % 3, axis]
            back, front = uv[other // 3, other % 3, axis], uv[other // 3, after(other) % 3, axis]
            gap = max(gap, abs(start - front), abs(stop - back))
        if gap <= _SAME_UV:
            inner[one] = other
    return inner


@njit(cache=True)
def label_parts(inner: I4) -> tuple[I4, int]:
    """Number the sets of faces that paired half-edges connect, in order of first face: (F,) i4."""
    count = len(inner) // 3
    parent = np.arange(count).astype(np.int32)
    for one in range(len(inner)):
        if inner[one] > one:
            join(parent, one // 3, inner[one] // 3)
    label = np.full(count, -1, np.int32)
    labels = 0
    for face in range(count):
        root = find(parent, face)
        if label[root] < 0:
            label[root] = labels
            labels += 1
        label[face] = label[root]
    return label, labels


@njit(cache=True)
def _euler(piece: I4, count: int, inner: I4, corner: I4, corners: int) -> I8:
    """V - E + F of every piece, its vertices being its corners joined inside it."""
    twice = np.zeros(count, np.int64)
    seen = np.zeros(corners, np.bool_)
    for half in range(len(inner)):
        here = piece[half // 3]
        if not seen[corner[half]]:
            seen[corner[half]] = True
            twice[here] += 2
        twice[here] -= 1 if inner[half] >= 0 else 2
        if half % 3 == 0:
            twice[here] += 2
    return twice // 2


@njit(cache=True)
def _farthest(start: int, inner: I4, seen: I4, mark: int, queue: I4) -> int:
    """Last face that a breadth-first search from `start` reaches."""
    queue[0] = start
    seen[start] = mark
    head, tail = 0, 1
    while head < tail:
        face = queue[head]
        head += 1
        for half in range(3 * face, 3 * face + 3):
            other = inner[half] // 3 if inner[half] >= 0 else -1
            if other >= 0 and seen[other] != mark:
                seen[other] = mark
                queue[tail] = other
                tail += 1
    return queue[tail - 1]


@njit(cache=True)
def _halve(piece: I4, inner: I4, bent: I4, count: int) -> None:
    """Cut each piece in `bent` into two connected halves, by clearing `inner` between them."""
    first = np.full(count, -1, np.int32)
    for face in range(len(piece) - 1, -1, -1):
        first[piece[face]] = face
    seen = np.full(len(piece), -1, np.int32)
    side = np.full(len(piece), -1, np.int32)
    queue = np.empty(len(piece), np.int32)
    for turn in range(len(bent)):
        one = _farthest(first[bent[turn]], inner, seen, 2 * turn, queue)
        other = _farthest(one, inner, seen, 2 * turn + 1, queue)
        side[one], side[other] = 2 * turn, 2 * turn + 1
        queue[0], queue[1] = one, other
        head, tail = 0, 2
        while head < tail:
            face = queue[head]
            head += 1
            for half in range(3 * face, 3 * face + 3):
                if inner[half] >= 0 and side[inner[half] // 3] < 0:
                    side[inner[half] // 3] = side[face]
                    queue[tail] = inner[half] // 3
                    tail += 1
    for half in range(len(inner)):
        if inner[half] >= 0 and side[half // 3] != side[inner[half] // 3]:
            inner[half] = -1


@njit(cache=True)
def _border(inner: I4) -> tuple[I4, I4]:
    """Next and previous border half-edge of every border half-edge."""
    ahead = np.full(len(inner), -1, np.int32)
    behind = np.full(len(inner), -1, np.int32)
    for half in range(len(inner)):
        if inner[half] >= 0:
            continue
        turn = after(half)
        while inner[turn] >= 0:
            turn = after(inner[turn])
        ahead[half] = turn
        behind[turn] = half
    return ahead, behind
