"""A dense mesh's vertices gathered into a few thousand clusters, a graph to solve on.

A linear system of the size of a dense mesh takes half a minute; one of the size of its
clusters takes a few hundredths of a second, and unlike a decimated mesh the clusters know
which vertices they stand for, whatever the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from btfcore.mesh.topology import edges
from btfcore.progress import Progress, between, silent
from btfcore.types import F8, I4, DenseMesh, Frozen

TARGET = 4000  # clusters aimed at
_LABEL = "orientation field"
CONE = 0.5  # cosine of the widest angle between a cluster's first normal and its others


@dataclass(frozen=True, eq=False)
class Clusters(Frozen):
    """Graph of the clusters of a dense mesh with N vertices.

    of (N,) i4: cluster of every vertex; points (C, 3) f8 and normals (C, 3) f8: mean position
    and unit mean normal; area (C,) f8 in square dense-mesh steps, i.e. vertices; component
    (C,) i4; edges (E, 2) i4: touching clusters, the smaller first; weight (E,) f8: length of
    the common border over the distance of the centres; spacing (C,) f8: mean of those distances
    in the cluster's component, world units. indptr (N+1,) i4, indices i4: the neighbours of the
    vertices.
    """

    of: I4
    points: F8
    normals: F8
    area: F8
    component: I4
    edges: I4
    weight: F8
    spacing: F8
    indptr: I4
    indices: I4


def gather_clusters(
    dense: DenseMesh, normals: F8, *, target: int = TARGET, progress: Progress = silent
) -> Clusters:
    """Join the vertices of `dense` to about `target` clusters of similar size and normal.

    normals : (N, 3) f8 unit, those of `dense` made safe. A mesh of at most `target` vertices
    keeps every vertex as a cluster of its own.
    """
    count = len(dense.vertices)
    pairs, _ = edges(dense.faces, progress=between(progress, 0.0, 0.5))
    progress(0.5, _LABEL)
    indptr, indices = neighbours(pairs, count)
    progress(0.6, _LABEL)
    size = count / target
    # a hexagonal disk of r levels has 3r(r + 1) + 1 vertices; greedy disks overlap by a third
    levels = 0 if size <= 1 else max(1, round(float(np.sqrt(size / 2))))
    of = _grow(indptr, indices, normals, levels)
    progress(0.75, _LABEL)
    clusters = int(of.max()) + 1
    area = np.bincount(of, minlength=clusters).astype(np.float64)
    points = _means(of, dense.vertices, area)
    normals = _means(of, normals, area)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]
    progress(0.85, _LABEL)
    ends = of[pairs]
    progress(0.95, _LABEL)
    links, border = _borders(ends, clusters)
    apart = np.linalg.norm(points[links[:, 0]] - points[links[:, 1]], axis=1)
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(clusters,) * 2)
    component = connected_components(graph, directed=False)[1].astype(np.int32)
    spacing = _component_means(component[links[:, 0]], apart, component)
    # borders are counted in edges, so distances are counted in edges too
    size_of = np.sqrt(_component_means(component, area, component))
    unit = spacing[links[:, 0]] / size_of[links[:, 0]]
    weight = border * unit / np.maximum(apart, 0.1 * unit + 1e-300)
    return Clusters(of, points, normals, area, component, links, weight, spacing, indptr, indices)


def _component_means(label: I4, values: F8, component: I4) -> F8:
    """Mean over each component of values labelled by component, given back to its clusters."""
    count = int(component.max()) + 1
    total = np.bincount(label, values, count)
    return (total / np.maximum(np.bincount(label, minlength=count), 1))[component]


def _means(of: I4, values: F8, area: F8) -> F8:
    columns = [np.bincount(of, values[:, k], len(area)) / area for k in range(values.shape[1])]
    return np.stack(columns, axis=1)


def _borders(pairs: I4, clusters: int) -> tuple[I4, F8]:
    """Pairs of different clusters, (E, 2) i4 sorted, and by how many edges they touch."""
    across = pairs[pairs[:, 0] != pairs[:, 1]].astype(np.int64)
    key = across.min(axis=1) * clusters + across.max(axis=1)
    distinct, times = np.unique(key, return_counts=True)
    links = np.stack([distinct // clusters, distinct % clusters], axis=1)
    return links.astype(np.int32), times.astype(np.float64)


@njit(cache=True)
def neighbours(pairs: I4, count: int) -> tuple[I4, I4]:
    """Neighbours of each vertex as compressed rows."""
    indptr = np.zeros(count + 1, np.int32)
    for edge in range(len(pairs)):
        indptr[pairs[edge, 0] + 1] += 1
        indptr[pairs[edge, 1] + 1] += 1
    for vertex in range(count):
        indptr[vertex + 1] += indptr[vertex]
    fill = indptr[:-1].copy()
    indices = np.empty(2 * len(pairs), np.int32)
    for edge in range(len(pairs)):
        a, b = pairs[edge]
        indices[fill[a]] = b
        indices[fill[b]] = a
        fill[a] += 1
        fill[b] += 1
    return indptr, indices


@njit(cache=True)
def _grow(indptr: I4, indices: I4, normals: F8, levels: int) -> I4:
    """Cluster of every vertex: disks of `levels` levels, each beside those before it."""
    count = len(indptr) - 1
    of = np.full(count, -1, np.int32)
    queue = np.empty(count, np.int32)  # the disk being grown
    waiting = np.empty(len(indices) + 1, np.int32)  # where the next disks may start
    first, last, clusters = 0, 0, 0
    for start in range(count):
        if of[start] >= 0:
            continue
        waiting[0] = start
        first, last = 0, 1
        while first < last:
            seed = waiting[first]
            first += 1
            if of[seed] >= 0:
                continue
            of[seed] = clusters
            queue[0] = seed
            head, tail, level, stop = 0, 1, 0, 1
            while head < tail:
                if head == stop:
                    level, stop = level + 1, tail
                here = queue[head]
                head += 1
                for slot in range(indptr[here], indptr[here + 1]):
                    other = indices[slot]
                    if of[other] >= 0:
                        continue
                    lean = 0.0
                    for axis in range(3):
                        lean += normals[seed, axis] * normals[other, axis]
                    if level < levels and lean > CONE:
                        of[other] = clusters
                        queue[tail] = other
                        tail += 1
                    elif last < len(waiting):
                        waiting[last] = other
                        last += 1
            clusters += 1
    return of
