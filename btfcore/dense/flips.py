"""Edge flips between zippered triangles: first to make them legal, then to make them good.

Half-edge 3 face + k runs from corner k to k + 1; `twin` is the opposite one or a code of
`btfcore.dense.zipper`. A flip keeps the surface as it is, so whatever is legal afterwards has
the right topology.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.dense.cut import after
from btfcore.dense.edge_table import count_edge, edge_count, new_table
from btfcore.dense.grid import U1, TexelGrid, joined
from btfcore.dense.zipper import WALL
from btfcore.types import F8, I4, I8

_ROUNDS = 12  # of quality flips
_PATIENCE = 60  # sweeps over edges that are in the way
_MOST = 4  # flips per triangle, in each of the two stages; the edge table has room for them


def flip_seams(faces: I4, twin: I4, grid: TexelGrid, points: F8, normals: F8) -> tuple[I4, I4]:
    """Flip until no edge is a loop or doubled, then to shorter edges without folds.

    faces (M, 3) i4 and twin (3M,) i4 as `zip_seams` gives them; normals (N, 3) f8 of the
    surface. Returns both after the flips. Where an edge cannot be put right it stays
    as it is.
    """
    faces, twin, edges = faces.copy(), twin.copy(), grid.edges.copy()
    _pair_walls(faces, twin, grid.texel, edges)
    keys, counts = _count_edges(faces, twin, grid.texel, edges)
    _repair(faces, twin, grid.texel, edges, keys, counts)
    _improve(faces, twin, grid.texel, edges, keys, counts, np.ascontiguousarray(points),
             np.ascontiguousarray(normals))  # fmt: skip
    return faces, twin


@njit(cache=True)
def _pair_walls(faces: I4, twin: I4, texel: I4, edges: U1) -> None:
    """Join zippered triangles across edges of the walk that have no grid triangle."""
    walls = np.flatnonzero(twin == WALL)
    key = np.empty(len(walls), np.int64)
    for i in range(len(walls)):
        one, other = _ends(faces, walls[i])
        key[i] = (np.int64(min(one, other)) << 32) | np.int64(max(one, other))
    order = np.argsort(key, kind="mergesort")
    for i in range(1, len(order)):
        if key[order[i]] == key[order[i - 1]]:
            one, other = walls[order[i - 1]], walls[order[i]]
            if faces[one // 3, one % 3] != faces[other // 3, other % 3]:
                twin[one], twin[other] = other, one
                _forget(faces[one // 3, one % 3], faces[other // 3, other % 3], texel, edges)


@njit(cache=True)
def _forget(one: int, other: int, texel: I4, edges: U1) -> None:
    """Take an edge that now belongs to the zipper out of the planar map."""
    if joined(one, other, texel, edges):
        for a, b in ((one, other), (other, one)):
            down, right = texel[b, 0] - texel[a, 0], texel[b, 1] - texel[a, 1]
            way = int(np.rint(np.arctan2(-down, right) / (np.pi / 4))) & 7
            edges[a] &= ~(1 << way) & 255


@njit(cache=True)
def _ends(faces: I4, half: int) -> tuple[int, int]:
    return faces[half // 3, half % 3], faces[half // 3, (half + 1 - 3 * (half % 3 == 2)) % 3]


@njit(cache=True)
def _count_edges(faces: I4, twin: I4, texel: I4, edges: U1) -> tuple[I8, I4]:
    """Count the zipper's edges that are none of the planar map's."""
    keys, counts = new_table((2 * _MOST + 3) * len(faces) + 64)
    for half in range(len(twin)):
        one, other = faces[half // 3, half % 3], faces[half // 3, after(half) % 3]
        if twin[half] < half and not (twin[half] == WALL and joined(one, other, texel, edges)):
            count_edge(keys, counts, one, other, 1)
    return keys, counts


@njit(cache=True)
def _times(one: int, other: int, texel: I4, edges: U1, keys: I8, counts: I4) -> int:
    """How often an edge exists; a loop counts as two."""
    if one == other:
        return 2
    return edge_count(keys, counts, one, other) + joined(one, other, texel, edges)


@njit(cache=True)
def flip(faces: I4, twin: I4, half: int) -> None:
    """Turn the edge of `half` in the quadrilateral of its two (different) triangles."""
    other = twin[half]
    s, t = half // 3, other // 3
    h1, h2 = after(half), after(after(half))
    g1, g2 = after(other), after(after(other))
    a, b, c = faces[s, half % 3], faces[t, other % 3], faces[s, h2 % 3]
    d = faces[t, g2 % 3]
    old = (h2, g1, g2, h1)
    new = (3 * s, 3 * s + 1, 3 * t, 3 * t + 1)
    beyond = (twin[h2], twin[g1], twin[g2], twin[h1])
    faces[s, 0], faces[s, 1], faces[s, 2] = c, a, d
    faces[t, 0], faces[t, 1], faces[t, 2] = d, b, c
    for i in range(4):
        there = beyond[i]
        for k in range(4):
            if beyond[i] == old[k]:
                there = new[k]
        twin[new[i]] = there
        if there >= 0:
            twin[there] = new[i]
    twin[3 * s + 2], twin[3 * t + 2] = 3 * t + 2, 3 * s + 2


@njit(cache=True)
def _turn(faces: I4, twin: I4, half: int, keys: I8, counts: I4) -> tuple[int, int]:
    """Flip and recount; returns the two vertices of the new edge."""
    other = twin[half]
    a, b = faces[half // 3, half % 3], faces[other // 3, other % 3]
    c, d = faces[half // 3, (half % 3 + 2) % 3], faces[other // 3, (other % 3 + 2) % 3]
    count_edge(keys, counts, a, b, -1)
    count_edge(keys, counts, c, d, 1)
    flip(faces, twin, half)
    return c, d


@njit(cache=True)
def _repair(faces: I4, twin: I4, texel: I4, edges: U1, keys: I8, counts: I4) -> None:
    """Flip loops and doubled edges away, as far as that succeeds."""
    state = 12345
    budget = _MOST * len(faces)
    for sweep in range(_PATIENCE):
        left = changed = 0
        for half in range(len(twin)):
            other = twin[half]
            if other < half:  # each edge once; walls and boundary cannot turn
                continue
            a, b = faces[half // 3, half % 3], faces[other // 3, other % 3]
            if _times(a, b, texel, edges, keys, counts) < 2:
                continue
            left += 1
            if half // 3 == other // 3:
                continue
            c, d = faces[half // 3, (half % 3 + 2) % 3], faces[other // 3, (other % 3 + 2) % 3]
            if _times(c, d, texel, edges, keys, counts) == 0:
                _turn(faces, twin, half, keys, counts)
                changed += 1
                left -= 1
        budget -= changed
        if left == 0 or budget < len(faces):
            break
        if changed:
            continue
        for half in range(len(twin)):  # stuck: shake the neighbourhood of what is left
            other = twin[half]
            if other < half:
                continue
            a, b = faces[half // 3, half % 3], faces[other // 3, other % 3]
            if _times(a, b, texel, edges, keys, counts) < 2:
                continue
            here = half
            for _ in range(4 + sweep % 8):
                state = (state * 1103515245 + 12345) & 0x7FFFFFFF
                here = 3 * (here // 3) + (state >> 8) % 3
                if twin[here] < 0:
                    continue
                one, two = here, twin[here]
                here = two
                if one // 3 == two // 3:
                    continue
                c = faces[one // 3, (one % 3 + 2) % 3]
                d = faces[two // 3, (two % 3 + 2) % 3]
                if _times(c, d, texel, edges, keys, counts) <= (sweep % 4 == 3) and c != d:
                    _turn(faces, twin, one, keys, counts)
                    budget -= 1
                    break


@njit(cache=True)
def _fold(points: F8, normals: F8, a: int, b: int, c: int) -> bool:
    """Whether triangle a, b, c looks against the surface at its corners."""
    ux, uy = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    uz = points[b, 2] - points[a, 2]
    vx, vy = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1]
    vz = points[c, 2] - points[a, 2]
    return (
        (uy * vz - uz * vy) * (normals[a, 0] + normals[b, 0] + normals[c, 0])
        + (uz * vx - ux * vz) * (normals[a, 1] + normals[b, 1] + normals[c, 1])
        + (ux * vy - uy * vx) * (normals[a, 2] + normals[b, 2] + normals[c, 2])
    ) < 0


@njit(cache=True)
def _square(points: F8, a: int, b: int) -> float:
    x, y = points[a, 0] - points[b, 0], points[a, 1] - points[b, 1]
    return x * x + y * y + (points[a, 2] - points[b, 2]) ** 2


@njit(cache=True)
def _improve(
    faces: I4, twin: I4, texel: I4, edges: U1, keys: I8, counts: I4, points: F8, normals: F8
) -> None:
    """Flip where it unfolds triangles or, folding none, makes the edge shorter."""
    budget = _MOST * len(faces)
    for _ in range(_ROUNDS):
        changed = 0
        for half in range(len(twin)):
            other = twin[half]
            if other < half or half // 3 == other // 3:
                continue
            a, b = faces[half // 3, half % 3], faces[other // 3, other % 3]
            c, d = faces[half // 3, (half % 3 + 2) % 3], faces[other // 3, (other % 3 + 2) % 3]
            shorter = _square(points, c, d) < _square(points, a, b) * (1 - 1e-9)
            before = _fold(points, normals, a, b, c) + np.int64(_fold(points, normals, b, a, d))
            if not shorter and before == 0:
                continue
            now = _fold(points, normals, c, a, d) + np.int64(_fold(points, normals, d, b, c))
            if now > before or (now == before and not shorter):
                continue
            if _times(c, d, texel, edges, keys, counts) == 0:
                _turn(faces, twin, half, keys, counts)
                changed += 1
        budget -= changed
        if changed == 0 or budget < 2 * len(faces):
            break
