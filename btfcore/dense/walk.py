"""Walks around the faces of the texels' planar map that no triangle fills.

Every piece gets one outer walk; pinches, dangling edges and single texels are legal in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from btfcore.dense.check import Flags
from btfcore.dense.grid import COLUMN, ROW, U1, TexelGrid
from btfcore.mesh.topology import find, join
from btfcore.types import F8, I4, Frozen

_LOOK = 3  # texels within which islands are joined where they are nearest on the surface


@dataclass(frozen=True, eq=False)
class Walks(Frozen):
    """Cyclic walks with the texels on their left; position i steps to the next of its walk.

    vertex : (P,) i4 vertex at each position; start : (W + 1,) i4, walk w owns positions
    start[w] … start[w + 1]; walks 0 … pieces-1 are the pieces' outer ones, the rest run
    around holes in them. A walk of one position makes no step.
    """

    vertex: I4
    start: I4


def outer_walks(grid: TexelGrid, pieces: int, points: F8) -> Walks:
    """Walk every unfilled face of the planar map, islands of one piece joined by bridges.

    A bridge is an edge between texels of two islands and joins their walks to one. Those
    nearest on the surface come first: across a notch, texels may be near in the picture only.
    points (N, 3) f8: where the vertices lie.
    """
    vertex, start, outer = _trace(grid.number, grid.texel, grid.edges, grid.filled)
    island = _islands(grid.number, grid.texel, grid.edges)
    vertex, ahead, first = _bridge(
        grid.number,
        grid.texel,
        grid.piece,
        np.ascontiguousarray(points),
        island,
        vertex,
        start,
        outer,
    )
    holes = start[:-1][~outer]
    heads = np.full(pieces, -1, np.int32)
    heads[grid.piece[vertex[first]]] = first
    return Walks(*_collect(vertex, ahead, np.concatenate([heads, holes]).astype(np.int32)))


@njit(cache=True)
def _trace(number: I4, texel: I4, edges: U1, filled: U1) -> tuple[I4, I4, Flags]:
    """Positions of all walks one after the other, their starts, and which are outer ones."""
    todo = np.zeros(len(texel), np.uint8)
    total = 0
    for v in range(len(texel)):
        right = ((filled[v] << 1) | (filled[v] >> 7)) & 255  # bit k: octant k-1, on the right
        todo[v] = edges[v] & ~right
        total += edges[v] == 0
        for k in range(8):
            total += (todo[v] >> k) & 1
    vertex = np.empty(total, np.int32)
    start = np.empty(total + 1, np.int32)
    outer = np.empty(total, np.bool_)
    walks = place = 0
    for first in range(len(texel)):
        if edges[first] == 0:
            vertex[place] = first
            start[walks], outer[walks] = place, True
            place, walks = place + 1, walks + 1
        for k in range(8):
            if not (todo[first] >> k) & 1:
                continue
            start[walks] = place
            area = 0
            v, way = first, k
            while (todo[v] >> way) & 1:
                todo[v] &= ~(1 << way) & 255
                vertex[place] = v
                place += 1
                row, column = texel[v, 0] + ROW[way], texel[v, 1] + COLUMN[way]
                area -= texel[v, 1] * row - column * texel[v, 0]
                v = number[row, column]
                way = (way + 5) & 7
                while not (edges[v] >> way) & 1:
                    way = (way + 1) & 7
            outer[walks] = area >= 0
            walks += 1
    start[walks] = place
    return vertex, start[: walks + 1].copy(), outer[:walks].copy()


@njit(cache=True)
def _islands(number: I4, texel: I4, edges: U1) -> I4:
    parent = np.arange(len(texel)).astype(np.int32)
    for v in range(len(texel)):
        if edges[v] & (1 << 0):
            join(parent, v, number[texel[v, 0], texel[v, 1] + 1])
        if edges[v] & (1 << 6):
            join(parent, v, number[texel[v, 0] + 1, texel[v, 1]])
    for v in range(len(texel)):
        parent[v] = find(parent, v)
    return parent


@njit(cache=True)
def _bridge(
    number: I4,
    texel: I4,
    piece: I4,
    points: F8,
    island: I4,
    vertex: I4,
    start: I4,
    outer: Flags,
) -> tuple[I4, I4, I4]:
    """Join islands of a piece: (vertex, next position, one position per piece)."""
    walks = len(start) - 1
    room = len(vertex) + 2 * walks
    names = np.empty(room, np.int32)
    names[: len(vertex)] = vertex
    ahead = np.full(room, -1, np.int32)
    behind = np.full(room, -1, np.int32)
    for walk in range(walks):
        for place in range(start[walk], start[walk + 1]):
            after = place + 1 if place + 1 < start[walk + 1] else start[walk]
            ahead[place], behind[after] = after, place
    # islands of each piece, all but the largest reach out for another
    size = np.zeros(len(texel), np.int32)
    for v in range(len(texel)):
        size[island[v]] += 1
    pieces = 0
    for v in range(len(texel)):
        pieces = max(pieces, piece[v] + 1)
    largest = np.full(pieces, -1, np.int32)
    many = np.zeros(pieces, np.int32)
    for v in range(len(texel)):
        if island[v] == v:
            many[piece[v]] += 1
            if largest[piece[v]] < 0 or size[v] > size[largest[piece[v]]]:
                largest[piece[v]] = v
    visit = np.full(len(texel), -1, np.int32)  # a position on the outer walk, or -1
    first = np.empty(pieces, np.int32)
    for walk in range(walks):
        if outer[walk]:
            for place in range(start[walk], start[walk + 1]):
                visit[vertex[place]] = place
            first[piece[vertex[start[walk]]]] = start[walk]
    more = np.full(room, -1, np.int32)  # other positions of the same vertex
    for walk in range(walks):
        if outer[walk]:
            for place in range(start[walk], start[walk + 1]):
                if visit[vertex[place]] != place:
                    more[place] = more[visit[vertex[place]]]
                    more[visit[vertex[place]]] = place
    count = len(vertex)
    root = np.arange(len(texel)).astype(np.int32)
    lost = np.empty(len(texel), np.int32)
    strays = 0
    for v in range(len(texel)):
        if many[piece[v]] > 1 and largest[piece[v]] != island[v]:
            lost[strays] = v
            strays += 1
    lost = lost[:strays]
    one, other = _near_pairs(number, texel, piece, points, island, visit, lost)
    for pair in range(len(one)):
        a, b = one[pair], other[pair]
        if find(root, island[a]) != find(root, island[b]):
            join(root, island[a], island[b])
            p = _facing(texel, names, ahead, behind, visit, more, a, b)
            q = _facing(texel, names, ahead, behind, visit, more, b, a)
            count = _splice(names, ahead, behind, visit, more, p, q, count)
    lost = lost[np.argsort(island[lost], kind="mergesort")]
    begin = 0
    while begin < len(lost):
        end = begin
        here = island[lost[begin]]
        while end < len(lost) and island[lost[end]] == here:
            end += 1
        mine = lost[begin:end]
        begin = end
        if find(root, here) == find(root, largest[piece[here]]):
            continue
        a, b = _nearest(number, texel, piece, island, root, visit, mine)
        join(root, island[a], island[b])
        p = _facing(texel, names, ahead, behind, visit, more, a, b)
        q = _facing(texel, names, ahead, behind, visit, more, b, a)
        count = _splice(names, ahead, behind, visit, more, p, q, count)
    return names[:count].copy(), ahead[:count].copy(), first


@njit(cache=True)
def _near_pairs(
    number: I4, texel: I4, piece: I4, points: F8, island: I4, visit: I4, lost: I4
) -> tuple[I4, I4]:
    """Pairs of vertices of two islands that are few texels apart, nearest on the surface first."""
    rows, columns = number.shape
    side = 2 * _LOOK + 1
    one = np.empty(side * side * len(lost), np.int32)
    other = np.empty(side * side * len(lost), np.int32)
    far = np.empty(side * side * len(lost))
    count = 0
    for v in lost:
        if visit[v] < 0:
            continue
        for r in range(max(texel[v, 0] - _LOOK, 0), min(texel[v, 0] + _LOOK + 1, rows)):
            for c in range(max(texel[v, 1] - _LOOK, 0), min(texel[v, 1] + _LOOK + 1, columns)):
                w = number[r, c]
                if w < 0 or piece[w] != piece[v] or island[w] == island[v] or visit[w] < 0:
                    continue
                one[count], other[count] = v, w
                far[count] = _square(points, v, w)
                count += 1
    order = np.argsort(far[:count], kind="mergesort")
    return one[order], other[order]


@njit(cache=True)
def _square(points: F8, a: int, b: int) -> float:
    total = 0.0
    for axis in range(3):
        total += (points[a, axis] - points[b, axis]) ** 2
    return total


@njit(cache=True)
def _nearest(
    number: I4, texel: I4, piece: I4, island: I4, root: I4, visit: I4, mine: I4
) -> tuple[int, int]:
    """Outer vertex of an island and the nearest texel of another group of its piece."""
    rows, columns = number.shape
    best, one, other = np.inf, -1, -1
    for v in mine:
        if visit[v] < 0:
            continue
        own = find(root, island[v])
        ring = 1
        while ring * ring < best and ring < max(rows, columns):
            for r in range(texel[v, 0] - ring, texel[v, 0] + ring + 1):
                if r < 0 or r >= rows:
                    continue
                step = 1 if abs(r - texel[v, 0]) == ring else 2 * ring
                for c in range(texel[v, 1] - ring, texel[v, 1] + ring + 1, step):
                    w = number[r, c] if 0 <= c < columns else -1
                    if w < 0 or piece[w] != piece[v] or visit[w] < 0:
                        continue
                    far = (r - texel[v, 0]) ** 2 + (c - texel[v, 1]) ** 2
                    if far < best and find(root, island[w]) != own:
                        best, one, other = far, v, w
            ring += 1
    return one, other


@njit(cache=True)
def _facing(
    texel: I4, names: I4, ahead: I4, behind: I4, visit: I4, more: I4, a: int, b: int
) -> int:
    """Position of vertex a at which the walk's free side looks towards vertex b."""
    place = visit[a]
    best, least = place, np.inf
    to_b = _angle(texel, a, b)
    while place >= 0:
        back, front = names[behind[place]], names[ahead[place]]
        if back == a:
            return place
        start = _angle(texel, a, back)
        width = (_angle(texel, a, front) - start) % (2 * np.pi)
        if width < 1e-9:
            width = 2 * np.pi
        turn = (to_b - start) % (2 * np.pi)
        if turn - width < least:
            best, least = place, turn - width
        place = more[place]
    return best


@njit(cache=True)
def _angle(texel: I4, a: int, b: int) -> float:
    return np.arctan2(-(texel[b, 0] - texel[a, 0]), texel[b, 1] - texel[a, 1])


@njit(cache=True)
def _splice(
    names: I4, ahead: I4, behind: I4, visit: I4, more: I4, p: int, q: int, count: int
) -> int:
    """Join two walks by a bridge from position p to q; positions that return are new ones."""
    after_p, before_q = ahead[p], behind[q]
    back_p, back_q = p, q
    if after_p != p:
        back_p = count
        count += 1
        names[back_p] = names[p]
        more[back_p] = more[visit[names[p]]]
        more[visit[names[p]]] = back_p
        ahead[back_p], behind[after_p] = after_p, back_p
    if before_q != q:
        back_q = count
        count += 1
        names[back_q] = names[q]
        more[back_q] = more[visit[names[q]]]
        more[visit[names[q]]] = back_q
        behind[back_q], ahead[before_q] = before_q, back_q
    ahead[p], behind[q] = q, p
    ahead[back_q], behind[back_p] = back_p, back_q
    return count


@njit(cache=True)
def _collect(names: I4, ahead: I4, heads: I4) -> tuple[I4, I4]:
    """Lay the linked walks out one after the other, beginning at `heads`."""
    vertex = np.empty(len(names), np.int32)
    start = np.zeros(len(heads) + 1, np.int32)
    place = 0
    for walk in range(len(heads)):
        here = heads[walk]
        while here >= 0:
            vertex[place] = names[here]
            place += 1
            here = ahead[here] if ahead[here] != heads[walk] else -1
        start[walk + 1] = place
    return vertex[:place].copy(), start
