"""The boundary of an open surface: its loops, and what keeps them simple.

Texels that hang on a boundary by one edge are let go, loops too short to be seen are opened
by taking a triangle away, and a vertex that the boundary passes twice is passed by with an
extra triangle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from btfcore.dense.check import Flags
from btfcore.dense.corners import Corners
from btfcore.dense.cut import Pieces
from btfcore.dense.edge_table import count_edge, edge_count, new_table
from btfcore.dense.grid import U1, joined
from btfcore.dense.walk import Walks
from btfcore.dense.zipper import OPEN, POINT, WALL
from btfcore.types import F8, I4, I8, Frozen


@dataclass(frozen=True, eq=False)
class Rim(Frozen):
    """Loops of the surface's boundary, surface on the left.

    vertex : (R,) i4, where each boundary edge starts; half : (R,) i4, its zippered half-edge,
    WALL where it is a step of a texel walk, OPEN where it has no triangle at all;
    start : (loops + 1,) i4, loop l owns edges start[l] … start[l + 1].
    """

    vertex: I4
    half: I4
    start: I4


def boundary(pieces: Pieces, walks: Walks, corners: Corners, cross: I4) -> Rim:
    """Collect the loops of open arcs and of the strips that end at the boundary."""
    free = np.zeros(pieces.count, bool)
    free[pieces.piece[np.flatnonzero((pieces.ahead >= 0) & (pieces.twin < 0)) // 3]] = True
    free &= np.diff(corners.start) == 0
    if not free.any() and not (corners.mate < 0).any():
        return Rim(np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(1, np.int32))
    return Rim(
        *_loops(free, walks.vertex, walks.start, corners.place, corners.steps, corners.mate,
                corners.around, corners.start, cross)
    )  # fmt: skip


@njit(cache=True)
def _loops(
    free: Flags, vertex: I4, begin: I4, place: I4, steps: I4, mate: I4, around: I4,
    start: I4, cross: I4,
) -> tuple[I4, I4, I4]:  # fmt: skip
    room = len(vertex) + 2 * len(place) + 1
    name, half = np.empty(room, np.int32), np.empty(room, np.int32)
    first = np.zeros(len(free) + len(place) + 1, np.int32)
    count = loops = 0
    for piece in range(len(free)):
        if free[piece]:
            for at in range(begin[piece], begin[piece + 1]):
                name[count], half[count] = vertex[at], WALL
                count += 1
            loops += 1
            first[loops] = count
    done = np.zeros(len(place), np.bool_)
    owner = np.empty(len(place), np.int32)
    for piece in range(len(start) - 1):
        owner[start[piece] : start[piece + 1]] = piece
    for arc in range(len(place)):
        if mate[arc] >= 0 or done[arc]:
            continue
        here = arc
        while not done[here]:
            done[here] = True
            piece = owner[here]
            length = begin[piece + 1] - begin[piece]
            for step in range(steps[here]):
                name[count] = vertex[begin[piece] + (place[here] - begin[piece] + step) % length]
                half[count] = WALL
                count += 1
            here = here + 1 if here + 1 < start[piece + 1] else start[piece]
            while mate[here] >= 0:
                if cross[here] != POINT:
                    name[count], half[count] = vertex[place[here]], cross[here]
                    count += 1
                here = around[here]
        loops += 1
        first[loops] = count
    return name[:count].copy(), half[:count].copy(), first[: loops + 1].copy()


def mend_rim(
    rim: Rim, faces: I4, twin: I4, texel: I4, edges: U1, points: F8
) -> tuple[I4, I4, Flags, I4]:
    """Make every boundary loop simple, of three edges or more.

    faces, twin as `zip_seams` gives them; texel, edges of the `TexelGrid`; points (N, 3).
    Returns faces and twin with triangles added, which faces are gone, (M,) bool, and the
    vertices at which a loop is still not simple, (B,) i4.
    """
    if len(rim.vertex) == 0:
        return faces, twin, np.zeros(len(faces), bool), np.zeros(0, np.int32)
    return _mend(rim.vertex, rim.half, rim.start, faces, twin, texel, edges,
                 np.ascontiguousarray(points))  # fmt: skip


@njit(cache=True)
def _mend(
    vertex: I4, half: I4, start: I4, old_faces: I4, old_twin: I4, texel: I4, edges: U1, points: F8
) -> tuple[I4, I4, Flags, I4]:
    count = len(vertex)
    room = 8 * count + 8 * len(start) + 16
    name, code = np.empty(room, np.int32), np.empty(room, np.int32)
    name[:count], code[:count] = vertex, half
    ahead, behind = np.full(room, -1, np.int32), np.full(room, -1, np.int32)
    loop = np.full(room, -1, np.int32)
    size = np.zeros(len(start) - 1, np.int32)
    visits = np.zeros(len(texel), np.int32)
    for lap in range(len(start) - 1):
        size[lap] = start[lap + 1] - start[lap]
        for i in range(start[lap], start[lap + 1]):
            ahead[i] = i + 1 if i + 1 < start[lap + 1] else start[lap]
            behind[ahead[i]] = i
            loop[i] = lap
            visits[vertex[i]] += 1
    trial, spared = size.copy(), np.zeros(len(size), np.bool_)
    _prune(
        name, code, ahead.copy(), behind.copy(), loop.copy(), trial, visits.copy(), count, spared
    )
    spared = (trial < 1) & (size > 3)  # nothing but hanging texels: ears can join them
    _prune(name, code, ahead, behind, loop, size, visits, count, spared)
    faces = np.empty((len(old_faces) + room, 3), np.int32)
    faces[: len(old_faces)] = old_faces
    twin = np.full(3 * len(faces), WALL, np.int32)
    twin[: len(old_twin)] = old_twin
    total = len(old_faces)
    gone = np.zeros(len(faces), np.bool_)
    for lap in range(len(size)):
        while 0 < size[lap] < 3:
            grown = _open(lap, -1, name, code, ahead, behind, loop, size, visits, count,
                          faces, twin, gone)  # fmt: skip
            if grown == count:
                break
            count = grown
    keys, counts = new_table(4 * (3 * total + room))
    for h in range(3 * total):
        if not gone[h // 3]:
            count_edge(keys, counts, faces[h // 3, h % 3], faces[h // 3, (h % 3 + 1) % 3], 1)
    total, count = _ears(name, code, ahead, behind, loop, size, visits, count, faces, twin, gone,
                         total, texel, edges, points, keys, counts)  # fmt: skip
    wrong = np.zeros(len(texel), np.bool_)
    for i in range(count):
        if loop[i] >= 0 and (visits[name[i]] > 1 or size[loop[i]] < 3):
            wrong[name[i]] = True
    return (
        faces[:total].copy(),
        twin[: 3 * total].copy(),
        gone[:total].copy(),
        np.flatnonzero(wrong).astype(np.int32),
    )


@njit(cache=True)
def _prune(
    name: I4, code: I4, ahead: I4, behind: I4, loop: I4, size: I4, visits: I4, count: int,
    spared: Flags,
) -> None:  # fmt: skip
    """Let go of edges that the boundary runs along and straight back."""
    for first in range(count):
        here = first
        while loop[here] >= 0 and not spared[loop[here]]:
            back, front = behind[here], ahead[here]
            bare = code[here] < 0 and code[back] == code[here]
            if back == here or not bare or name[front] != name[back]:
                break
            visits[name[here]] -= 1
            visits[name[back]] -= 1
            size[loop[here]] -= 2
            before = behind[back]
            loop[here] = loop[back] = -1
            if front == back:  # nothing is left of this loop
                break
            ahead[before], behind[front] = front, before
            here = front
    for i in range(count):
        single = loop[i] >= 0 and ahead[i] == i and code[i] == WALL
        if single and not spared[loop[i]]:
            size[loop[i]] = 0
            visits[name[i]] -= 1
            loop[i] = -1


@njit(cache=True)
def _open(
    lap: int, keep: int, name: I4, code: I4, ahead: I4, behind: I4, loop: I4, size: I4,
    visits: I4, count: int, faces: I4, twin: I4, gone: Flags,
) -> int:  # fmt: skip
    """Take a triangle away at a boundary edge (not one of vertex `keep`): the loop grows."""
    if count + 1 > len(name):
        return count
    for i in range(count):
        if loop[i] != lap or code[i] < 0:
            continue
        a, b = name[i], name[ahead[i]]
        face, k = code[i] // 3, code[i] % 3
        c = faces[face, (k + 2) % 3]
        far, near = twin[3 * face + (k + 1) % 3], twin[3 * face + (k + 2) % 3]
        if visits[c] or c in (a, b) or keep in (a, b) or min(far, near) < WALL:
            continue
        if far // 3 == face or near // 3 == face:
            continue
        gone[face] = True
        for there in (far, near):
            if there >= 0:
                twin[there] = OPEN
        code[i] = near
        name[count], code[count], loop[count] = c, far, lap
        ahead[count], behind[count] = ahead[i], i
        behind[ahead[i]] = count
        ahead[i] = count
        visits[c] += 1
        size[lap] += 1
        return count + 1
    return count


@njit(cache=True)
def _ears(
    name: I4, code: I4, ahead: I4, behind: I4, loop: I4, size: I4, visits: I4, count: int,
    faces: I4, twin: I4, gone: Flags, total: int, texel: I4, edges: U1, points: F8,
    keys: I8, counts: I4,
) -> tuple[int, int]:  # fmt: skip
    """Pass by vertices that the boundary meets more than once, by the shortest new edges."""
    while True:
        ready = np.empty(count, np.int32)
        cost = np.empty(count)
        found = 0
        for i in range(count):
            if loop[i] >= 0 and visits[name[i]] > 1:
                x, y = name[behind[i]], name[ahead[i]]
                ready[found], cost[found] = i, ((points[x] - points[y]) ** 2).sum()
                found += 1
        order = np.argsort(cost[:found], kind="mergesort")
        done = 0
        for place in order:
            i = ready[place]
            p, n = behind[i], ahead[i]
            x, u, y = name[p], name[i], name[n]
            if visits[u] < 2 or x == y or x == u or y == u or total >= len(faces):
                continue
            if joined(x, y, texel, edges) or edge_count(keys, counts, x, y):
                continue
            if size[loop[i]] < 4:
                grown = _open(loop[i], u, name, code, ahead, behind, loop, size, visits, count,
                              faces, twin, gone)  # fmt: skip
                if grown == count:
                    continue
                count = grown
                x, y = name[behind[i]], name[ahead[i]]
                p, n = behind[i], ahead[i]
            faces[total, 0], faces[total, 1], faces[total, 2] = y, u, x
            _attach(i, 3 * total, name, code, ahead, loop, twin, count)
            _attach(p, 3 * total + 1, name, code, ahead, loop, twin, count)
            twin[3 * total + 2] = OPEN
            code[p] = 3 * total + 2
            total += 1
            count_edge(keys, counts, x, y, 1)
            ahead[p], behind[n] = n, p
            visits[u] -= 1
            size[loop[i]] -= 1
            loop[i] = -1
            done += 1
        if done == 0:
            return total, count


@njit(cache=True)
def _attach(
    item: int, half: int, name: I4, code: I4, ahead: I4, loop: I4, twin: I4, count: int
) -> None:
    """Put half-edge `half` of a new triangle against a boundary edge."""
    if code[item] >= 0:
        twin[half], twin[code[item]] = code[item], half
        return
    twin[half] = WALL
    if code[item] == OPEN:  # no triangle was there: from behind it is now this one's edge
        twin[half] = OPEN
        for other in range(count):
            if loop[other] >= 0 and code[other] == OPEN and other != item:
                if name[other] == name[ahead[item]] and name[ahead[other]] == name[item]:
                    code[other] = half
                    break
