"""Laws of the clusters that the field is solved on, and of blending between them."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from btfcore.clusters import CONE, gather_clusters, neighbours
from btfcore.connection import carried, frames
from btfcore.mesh.topology import edges
from btfcore.spread import blended, filled
from tests.surfaces import plane, sphere
from tests.test_field import blob


def clusters_of(dense, target):
    return gather_clusters(dense, dense.normals.astype(np.float64), target=target)


@pytest.mark.parametrize("make", [plane, blob])
@pytest.mark.parametrize("target", [20, 300, 100_000])
def test_clusters_are_connected_parts_of_similar_normals(make, target):
    dense = make()
    found = clusters_of(dense, target)
    count = len(found.area)
    assert count == len(dense.vertices) if target == 100_000 else count < 3 * target
    np.testing.assert_array_equal(np.bincount(found.of), found.area)
    pairs, _ = edges(dense.faces)
    inner = pairs[found.of[pairs[:, 0]] == found.of[pairs[:, 1]]]
    size = len(dense.vertices)
    graph = coo_array((np.ones(len(inner)), inner.T), shape=(size, size))
    assert connected_components(graph, directed=False)[0] == count
    # normals lie within one cone about the first, so within twice its angle about the mean
    lean = (dense.normals * found.normals[found.of]).sum(axis=1)
    assert lean.min() > 2 * CONE**2 - 1
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1, atol=1e-12)


def test_every_edge_between_clusters_is_counted():
    dense = plane()
    found = clusters_of(dense, 100)
    pairs, _ = edges(dense.faces)
    ends = np.sort(found.of[pairs], axis=1)
    crossing = {tuple(pair) for pair in ends[ends[:, 0] != ends[:, 1]]}
    assert crossing == {tuple(pair) for pair in found.edges}
    assert (found.weight > 0).all()
    assert found.component.max() == 0


def test_neighbours_equal_the_adjacency_matrix():
    pairs, _ = edges(sphere(2).faces)
    count = int(pairs.max()) + 1
    indptr, indices = neighbours(pairs, count)
    matrix = coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count)).tocsr()
    matrix = matrix + matrix.T
    for vertex in range(count):
        row = indices[indptr[vertex] : indptr[vertex + 1]]
        assert sorted(row) == sorted(
            matrix.indices[matrix.indptr[vertex] : matrix.indptr[vertex + 1]]
        )


def test_blending_equals_the_sum_written_out():
    dense = blob(3)
    normals = dense.normals.astype(np.float64)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    found = clusters_of(dense, 60)
    tangents = frames(found.normals)[0]
    indptr, indices = neighbours(found.edges, len(found.area))
    reach = 2 * found.spacing
    fast = blended(
        found.of, indptr, indices, found.points, found.normals, found.area, tangents,
        dense.vertices, normals, reach,
    )  # fmt: skip
    for vertex in range(len(normals)):
        own = found.of[vertex]
        near = np.concatenate([[own], indices[indptr[own] : indptr[own + 1]]])
        here = np.repeat(normals[vertex][None], len(near), axis=0)
        lean = (found.normals[near] * here).sum(axis=1) > -0.95
        moved = carried(tangents[near], found.normals[near], here)
        gap = ((dense.vertices[vertex] - found.points[near]) ** 2).sum(axis=1) / reach[own] ** 2
        weight = found.area[near] * np.maximum(1 - gap, 1e-4) ** 2 * lean
        total = (moved * weight[:, None]).sum(axis=0)
        np.testing.assert_allclose(fast[vertex], total / np.linalg.norm(total), atol=1e-9)


def test_filling_keeps_what_is_known_and_continues_it():
    dense = plane()
    normals = dense.normals.astype(np.float64)
    pairs, _ = edges(dense.faces)
    indptr, indices = neighbours(pairs, len(normals))
    full = np.tile([0.6, 0.8, 0.0], (len(normals), 1))
    holes = full.copy()
    holes[np.random.default_rng(0).random(len(holes)) < 0.6] = 0
    holes[:300] = 0
    np.testing.assert_allclose(filled(indptr, indices, normals, holes), full, atol=1e-12)
    nothing = np.zeros_like(full)
    np.testing.assert_array_equal(filled(indptr, indices, normals, nothing), nothing)
