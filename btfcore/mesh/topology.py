"""Edges, half-edges, fans and counts of triangle meshes given as plain arrays.

Half-edge ``h = 3 * face + k`` runs from corner k of its face to corner k + 1; corner h is the
corner at which half-edge h starts. Nothing here assumes a manifold.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from btfcore.progress import Progress, between, silent
from btfcore.types import F8, I4, I8, MeshStatistics


def edges(faces: ArrayLike, *, progress: Progress = silent) -> tuple[I4, I4]:
    """Undirected edges, (E, 2) i4 with the smaller vertex first, sorted; and their face counts.

    Linear in the number of faces, also where one vertex belongs to all of them.
    """
    triangles = _triangles(faces)
    low, high, order = sorted_half_edges(triangles, progress=between(progress, 0.0, 0.7))
    progress(0.7, "edges")
    first = _run_starts(low, high, order)
    progress(0.8, "edges")
    chosen = order[first]
    pairs = np.empty((len(chosen), 2), np.int32)
    pairs[:, 0] = low[chosen]
    progress(0.9, "edges")
    pairs[:, 1] = high[chosen]
    progress(0.95, "edges")
    counts = np.empty(len(first), np.int32)
    counts[:-1] = first[1:] - first[:-1]
    counts[-1:] = len(order) - first[-1:]
    progress(1.0, "edges")
    return pairs, counts


def twins(faces: ArrayLike) -> I4:
    """Opposite half-edge of every half-edge, (3F,) i4.

    -1 where the edge does not have exactly two faces that run through it in opposite
    directions: at boundaries, non-manifold edges and breaks of the winding.
    """
    triangles = _triangles(faces)
    low, high, order = sorted_half_edges(triangles)
    return _twins(triangles.reshape(-1), low, high, order)


def fans(twin: I4) -> tuple[I4, int]:
    """Join the corners that meet around a vertex across paired half-edges.

    twin : (3F,) i4 as `twins` gives it. Returns the fan of every corner, (3F,) i4 numbered in
    order of first appearance, and the number of fans. In a manifold mesh fans are vertices.
    """
    return _fans(np.ascontiguousarray(twin, np.int32))


def is_manifold(faces: ArrayLike) -> bool:
    """Whether edges have one or two faces, vertices one fan each, and the winding agrees."""
    triangles = _triangles(faces)
    if len(triangles) == 0:
        return True
    twin = twins(triangles)
    _, counts = edges(triangles)
    if counts.max() > 2 or int((twin >= 0).sum()) != 2 * int((counts == 2).sum()):
        return False
    used = np.zeros(int(triangles.max()) + 1, bool)
    used[triangles] = True
    return fans(twin)[1] == int(used.sum())


def components(faces: ArrayLike) -> I4:
    """Component of every face, (F,) i4, 0 … in order of first appearance; joined by edges."""
    triangles = _triangles(faces)
    low, high, order = sorted_half_edges(triangles)
    return _components(len(triangles), low, high, order)


def statistics(vertices: ArrayLike, faces: ArrayLike) -> MeshStatistics:
    """Count what describes a mesh's topology.

    boundary_edges have one face, nonmanifold_edges more than two; boundary_loops are
    connected curves of boundary edges; euler = V - E + F over all given vertices.
    """
    triangles = _triangles(faces)
    count = len(np.asarray(vertices))
    pairs, faces_at = edges(triangles)
    rim = pairs[faces_at == 1]
    labels = components(triangles)
    return MeshStatistics(
        vertices=count,
        faces=len(triangles),
        boundary_edges=len(rim),
        boundary_loops=_curves(rim, count),
        nonmanifold_edges=int((faces_at > 2).sum()),
        euler=count - len(pairs) + len(triangles),
        components=int(labels.max()) + 1 if len(labels) else 0,
    )


def vertex_normals(vertices: ArrayLike, faces: ArrayLike) -> F8:
    """Average the face normals at each vertex by angle; unit, (V, 3) f8.

    A vertex whose normals cancel or that has no face of positive area takes +z, so that
    every row is a finite unit vector. The mesh's scale and place do not matter.
    """
    points = np.array(vertices, np.float64).reshape(-1, 3)
    triangles = _triangles(faces)
    if len(points):
        points -= points.mean(axis=0)
        points /= max(float(np.abs(points).max()), np.finfo(np.float64).tiny)
    normals: F8 = _vertex_normals(points, triangles)
    return normals


def sorted_half_edges(faces: I4, *, progress: Progress = silent) -> tuple[I4, I4, I4]:
    """Smaller and larger end of each half-edge, and their order by (smaller, larger, index)."""
    low, high = _ends(faces)
    count = int(faces.max()) + 1 if len(faces) else 0
    progress(0.3, "edges")
    by_high = _counting_sort(high, np.arange(len(low), dtype=np.int32), count)
    progress(0.6, "edges")
    return low, high, _counting_sort(low, by_high, count)


def _triangles(faces: ArrayLike) -> I4:
    return np.ascontiguousarray(faces, np.int32).reshape(-1, 3)


@njit(cache=True)
def _ends(faces: I4) -> tuple[I4, I4]:
    low, high = np.empty(3 * len(faces), np.int32), np.empty(3 * len(faces), np.int32)
    for face in range(len(faces)):
        for corner in range(3):
            one, other = faces[face, corner], faces[face, (corner + 1) % 3]
            low[3 * face + corner] = min(one, other)
            high[3 * face + corner] = max(one, other)
    return low, high


@njit(cache=True)
def _counting_sort(key: I4, items: I4, count: int) -> I4:
    """Items stably sorted by key[item], keys being 0 … count-1."""
    start = np.zeros(count + 1, np.int64)
    for item in items:
        start[key[item] + 1] += 1
    for value in range(count):
        start[value + 1] += start[value]
    out = np.empty_like(items)
    for item in items:
        out[start[key[item]]] = item
        start[key[item]] += 1
    return out


@njit(cache=True)
def _run_starts(low: I4, high: I4, order: I4) -> I8:
    """Where in `order` each run of half-edges of one edge begins."""
    starts = np.empty(len(order), np.int64)
    count = 0
    for place in range(len(order)):
        here, before = order[place], order[place - 1]
        if place == 0 or low[here] != low[before] or high[here] != high[before]:
            starts[count] = place
            count += 1
    return starts[:count]


@njit(cache=True)
def _twins(origin: I4, low: I4, high: I4, order: I4) -> I4:
    twin = np.full(len(order), -1, np.int32)
    starts = _run_starts(low, high, order)
    for run in range(len(starts)):
        stop = starts[run + 1] if run + 1 < len(starts) else len(order)
        if stop - starts[run] == 2:
            one, other = order[starts[run]], order[starts[run] + 1]
            if origin[one] != origin[other]:
                twin[one] = other
                twin[other] = one
    return twin


@njit(cache=True)
def find(parent: I4, item: int) -> int:
    """Root of an item in a union-find forest, halving the path on the way."""
    while parent[item] != item:
        parent[item] = parent[parent[item]]
        item = parent[item]
    return item


@njit(cache=True)
def join(parent: I4, one: int, other: int) -> None:
    """Join two trees of a union-find forest; the smaller root stays, whatever the order."""
    one, other = find(parent, one), find(parent, other)
    if one < other:
        parent[other] = one
    else:
        parent[one] = other


@njit(cache=True)
def _labels(parent: I4) -> tuple[I4, int]:
    """Label the trees of a forest in order of first appearance."""
    label = np.full(len(parent), -1, np.int32)
    count = 0
    for item in range(len(parent)):
        root = find(parent, item)
        if label[root] < 0:
            label[root] = count
            count += 1
        label[item] = label[root]
    return label, count


@njit(cache=True)
def _fans(twin: I4) -> tuple[I4, int]:
    parent = np.arange(len(twin)).astype(np.int32)
    for one in range(len(twin)):
        other = twin[one]
        if other > one:
            after_one = one - 2 if one % 3 == 2 else one + 1
            after_other = other - 2 if other % 3 == 2 else other + 1
            join(parent, one, after_other)
            join(parent, other, after_one)
    return _labels(parent)


@njit(cache=True)
def _components(count: int, low: I4, high: I4, order: I4) -> I4:
    parent = np.arange(count).astype(np.int32)
    for place in range(1, len(order)):
        here, before = order[place], order[place - 1]
        if low[here] == low[before] and high[here] == high[before]:
            join(parent, here // 3, before // 3)
    return _labels(parent)[0]


@njit(cache=True)
def _curves(rim: I4, count: int) -> int:
    """Count the connected curves that boundary edges form among `count` vertices."""
    parent = np.arange(count).astype(np.int32)
    for edge in range(len(rim)):
        join(parent, rim[edge, 0], rim[edge, 1])
    seen = np.zeros(count, np.bool_)
    curves = 0
    for edge in range(len(rim)):
        root = find(parent, rim[edge, 0])
        if not seen[root]:
            seen[root] = True
            curves += 1
    return curves


@njit(cache=True)
def _vertex_normals(points: F8, faces: I4) -> F8:
    normals = np.zeros((len(points), 3))
    side = np.empty((3, 3))
    for face in range(len(faces)):
        for corner in range(3):
            for axis in range(3):
                side[corner, axis] = (
                    points[faces[face, (corner + 1) % 3], axis] - points[faces[face, corner], axis]
                )
        x = side[0, 1] * side[1, 2] - side[0, 2] * side[1, 1]
        y = side[0, 2] * side[1, 0] - side[0, 0] * side[1, 2]
        z = side[0, 0] * side[1, 1] - side[0, 1] * side[1, 0]
        doubled = np.sqrt(x * x + y * y + z * z)
        if doubled == 0:
            continue
        for corner in range(3):
            dot = 0.0
            for axis in range(3):
                dot -= side[corner, axis] * side[(corner + 2) % 3, axis]
            # doubled area is the cross product of the sides at every corner
            weight = np.arctan2(doubled, dot) / doubled
            normals[faces[face, corner], 0] += x * weight
            normals[faces[face, corner], 1] += y * weight
            normals[faces[face, corner], 2] += z * weight
    for vertex in range(len(points)):
        length = np.sqrt((normals[vertex] * normals[vertex]).sum())
        if length > 1e-12:
            normals[vertex] /= length
        else:
            normals[vertex] = np.array([0.0, 0.0, 1.0])
    return normals
