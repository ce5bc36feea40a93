"""Splits vertices so that a coherently wound triangle soup becomes a manifold.

Corners are joined into fans across paired half-edges and every fan becomes a vertex. So an
edge of more than two faces falls apart into pairs and borders, a bow-tie vertex into its
leaves, and no face, hole or agreement between neighbours is lost elsewhere.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.errors import InvalidMesh
from btfcore.mesh.topology import edges, fans, is_manifold, sorted_half_edges, twins
from btfcore.types import F8, I4

_ROUNDS = 64
_MANY = 33  # at edges of more faces all pairs cannot be compared in reasonable time


def split_nonmanifold(vertices: F8, faces: I4) -> tuple[I4, I4]:
    """Make a mesh manifold by duplicating vertices.

    Around an edge with an even number of faces those are paired that bound the same solid
    wedge, so bodies that touch come apart and stay closed; with an odd number, those that
    continue each other best. What has no partner gets a border.
    Returns (faces, source): faces (F, 3) i4 naming new vertices, source (V',) i4, the old
    vertex of each. Vertices that are manifold already keep their place in the order.
    Raises `InvalidMesh` should the result not be manifold, with the number of bad edges.
    """
    twin = twins(faces)
    _pair_wedges(vertices, faces, twin)
    for _ in range(_ROUNDS):
        split, source = _by_fans(faces, twin)
        bad = _crowded(split)
        if len(bad) == 0:
            break
        _part(twin, bad)
    if not is_manifold(split):
        bad_edges = int((edges(split)[1] > 2).sum())
        raise InvalidMesh(f"mesh cannot be split into a manifold: {bad_edges} edges stay crowded")
    return split, source


def _by_fans(faces: I4, twin: I4) -> tuple[I4, I4]:
    """Order the fans by their old vertex; a vertex's second fan follows its first."""
    fan, count = fans(twin)
    source = np.empty(count, np.int32)
    source[fan] = faces.reshape(-1)
    order = np.argsort(source, kind="stable")
    rank = np.empty(count, np.int32)
    rank[order] = np.arange(count)
    return rank[fan].reshape(-1, 3), source[order]


def _crowded(faces: I4) -> I4:
    """Half-edges on edges of more than two faces."""
    low, high, order = sorted_half_edges(faces)
    _, counts = edges(faces)
    return order[np.repeat(counts > 2, counts)]


def _part(twin: I4, half_edges: I4) -> None:
    mates = twin[half_edges]
    twin[mates[mates >= 0]] = -1
    twin[half_edges] = -1


def _pair_wedges(vertices: F8, faces: I4, twin: I4) -> None:
    """Pair, in `twin`, half-edges of crowded edges that bound one wedge of a solid."""
    crowded = _crowded(faces)
    if len(crowded) == 0:
        return
    face, corner = np.divmod(crowded, 3)
    start = faces[face, corner]
    stop = faces[face, (corner + 1) % 3]
    tip = vertices[faces[face, (corner + 2) % 3]]
    low, high = np.minimum(start, stop), np.maximum(start, stop)
    axis = vertices[high] - vertices[low]
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    # any frame about the axis will do, as long as all faces of the edge share it
    helper = np.eye(3)[np.abs(axis).argmin(axis=1)]
    across = np.cross(axis, helper)
    up = np.cross(axis, across)
    arm = tip - vertices[low]
    angle = np.arctan2((arm * up).sum(axis=1), (arm * across).sum(axis=1))
    forward = start == low
    order = np.lexsort((crowded, forward, angle, high, low))
    _pair(twin, crowded[order], low[order], high[order], forward[order], angle[order])


@njit(cache=True)
def _pair(twin: I4, half_edges: I4, low: I4, high: I4, forward: I4, angle: F8) -> None:
    """Pair the half-edges of each crowded edge, which come sorted by edge and angle."""
    first = 0
    while first < len(half_edges):
        stop = first + 1
        while stop < len(half_edges) and low[stop] == low[first] and high[stop] == high[first]:
            stop += 1
        if (stop - first) % 2 == 0 or stop - first > _MANY:
            _pair_brackets(twin, half_edges[first:stop], forward[first:stop])
        else:
            _pair_straightest(twin, half_edges[first:stop], forward[first:stop], angle[first:stop])
        first = stop


@njit(cache=True)
def _pair_brackets(twin: I4, half_edges: I4, forward: I4) -> None:
    """Match faces by angle like brackets: backward opens a solid wedge, forward closes it."""
    count = len(half_edges)
    opened = np.empty(count, np.int64)
    depth = 0
    for step in range(2 * count):  # twice around: wedges may span the start
        here = half_edges[step % count]
        if twin[here] >= 0:
            continue
        if forward[step % count]:
            if depth:
                depth -= 1
                twin[opened[depth]] = here
                twin[here] = opened[depth]
        elif step < count:
            opened[depth] = here
            depth += 1


@njit(cache=True)
def _pair_straightest(twin: I4, half_edges: I4, forward: I4, angle: F8) -> None:
    """Pair, again and again, the two that continue each other best; one at least stays."""
    while True:
        best, one, other = np.inf, -1, -1
        for i in range(len(half_edges)):
            for j in range(len(half_edges)):
                if forward[i] or not forward[j]:
                    continue
                if twin[half_edges[i]] >= 0 or twin[half_edges[j]] >= 0:
                    continue
                bend = abs(abs(angle[i] - angle[j]) - np.pi)
                if bend < best:
                    best, one, other = bend, i, j
        if one < 0:
            return
        twin[half_edges[one]] = half_edges[other]
        twin[half_edges[other]] = half_edges[one]
