"""The laws of the dense mesh, checked from its arrays without the project's own counting."""

import numpy as np


def topology(faces):
    """Per connected component: (vertex count, Euler number, boundary loops), sorted.

    Also whether edges, winding and vertex fans are those of a manifold.
    """
    faces = np.asarray(faces, np.int64)
    count = int(faces.max()) + 1
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward = ends[:, 0] * count + ends[:, 1]
    coherent = len(np.unique(forward)) == len(forward) and (ends[:, 0] != ends[:, 1]).all()
    undirected = np.sort(ends, axis=1)
    keys, times = np.unique(undirected[:, 0] * count + undirected[:, 1], return_counts=True)
    edges = np.stack([keys // count, keys % count], 1)
    label = roots(count, edges)
    order = np.argsort(forward)
    back = ends[:, 1] * count + ends[:, 0]
    at = order[np.searchsorted(forward[order], back).clip(max=len(order) - 1)]
    rim = forward[at] != back
    one = np.flatnonzero(~rim)
    # fans: corners of a vertex joined across the edges that leave it
    start = np.arange(3 * len(faces))  # row k F + f: half-edge k of face f, and its corner
    stop = (start + len(faces)) % len(start)
    pairs = np.concatenate(
        [np.stack([start[one], stop[at[one]]], 1), np.stack([stop[one], start[at[one]]], 1)]
    )
    fans = len(np.unique(roots(3 * len(faces), pairs)))
    manifold = coherent and times.max() <= 2 and fans == len(np.unique(faces))
    used = np.unique(faces)
    ring = roots(count, ends[rim])
    parts = []
    for part in np.unique(label[used]):
        v = int((label[used] == part).sum())
        e = int((label[edges[:, 0]] == part).sum())
        f = int((label[faces[:, 0]] == part).sum())
        loops = len(np.unique(ring[ends[rim][label[ends[rim][:, 0]] == part]]))
        parts.append((v, v - e + f, loops))
    return sorted(parts), manifold


def roots(count, edges):
    """Connected component of each of `count` nodes."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    edges = np.asarray(edges).reshape(-1, 2)
    graph = coo_matrix((np.ones(len(edges)), edges.T), (count, count))
    return connected_components(graph, directed=False)[1]


def kinds(parts):
    return sorted((euler, loops) for _, euler, loops in parts)


def assert_lawful(dense, mesh):
    """All that `build_dense_mesh` promises, topology and geometry of the samples."""
    parts, manifold = topology(dense.faces)
    wanted, _ = topology(mesh.faces)
    assert manifold
    assert kinds(parts) == kinds(wanted)
    assert_samples(dense, mesh)


def assert_samples(dense, mesh):
    """One vertex per texel, all used, exactly where `face` and `bary` say; unit normals."""
    count = len(dense.vertices)
    assert np.array_equal(np.unique(dense.faces), np.arange(count))
    assert dense.texel.min() >= 0 and dense.texel.max() < dense.size
    assert len(np.unique(dense.texel @ [dense.size, 1])) == count
    assert len(dense.normals) == len(dense.chart) == len(dense.face) == len(dense.bary) == count
    assert dense.bary.min() >= 0 and np.allclose(dense.bary.sum(1), 1, atol=1e-6)
    where = np.einsum("nk,nkd->nd", dense.bary, mesh.vertices[mesh.faces[dense.face]])
    assert np.abs(where - dense.vertices).max() <= 1e-6 * mesh.diagonal
    assert np.allclose(np.linalg.norm(dense.normals, axis=1), 1, atol=1e-5)
    inside = dense.faces[: dense.grid_faces]
    for k in range(3):
        step = np.abs(dense.texel[inside[:, k]] - dense.texel[inside[:, k - 1]]).max(initial=0)
        assert step <= 1
        assert (dense.chart[inside[:, k]] == dense.chart[inside[:, k - 1]]).all()
