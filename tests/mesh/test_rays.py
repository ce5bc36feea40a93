"""Rays meet what a plain search over all triangles finds, and slip through nothing."""

import numpy as np
import pytest

from btfcore.errors import InvalidMesh
from btfcore.mesh.rays import blocked, ray_tree


def soup(count, seed=0, size=0.3):
    """Random triangles in the unit cube."""
    rng = np.random.default_rng(seed)
    vertices = rng.uniform(-1, 1, (count, 1, 3)) + rng.uniform(-size, size, (count, 3, 3))
    return vertices.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def plain(vertices, faces, origins, directions):
    """Signed volumes of every ray with every triangle's edges, and on which side it begins."""
    out = np.zeros(len(origins), bool)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    for n, (o, d) in enumerate(zip(origins, directions, strict=True)):
        one, two, three = (
            np.einsum("tc,tc->t", np.cross(p - o, q - o), d[None])
            for p, q in ((a, b), (b, c), (c, a))
        )
        through = ((one > 0) & (two > 0) & (three > 0)) | ((one < 0) & (two < 0) & (three < 0))
        normal = np.cross(b - a, c - a)
        ahead = np.einsum("tc,tc->t", a - o, normal) / np.einsum("tc,c->t", normal, d)
        out[n] = (through & (ahead > 0)).any()
    return out


def directions_of(count, seed=1):
    d = np.random.default_rng(seed).normal(size=(count, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


@pytest.mark.parametrize("count", [1, 2, 5, 300])
def test_a_ray_is_blocked_where_the_plain_search_says(count):
    vertices, faces = soup(count, size=0.3 if count > 9 else 2.0)
    origins = np.random.default_rng(2).uniform(-1.5, 1.5, (400, 3))
    directions = directions_of(400)
    tree = ray_tree(vertices, faces)
    found = blocked(tree, origins, directions)
    assert np.array_equal(found, plain(vertices, faces, origins, directions))
    assert found.any()


def test_the_tree_holds_every_triangle_once_inside_its_boxes():
    vertices, faces = soup(500)
    tree = ray_tree(vertices, faces)
    leaves = np.flatnonzero(tree.count > 0)
    held = np.concatenate([tree.child[k] + np.arange(tree.count[k]) for k in leaves])
    assert np.array_equal(np.sort(held), np.arange(500))
    for k in leaves:
        rows = tree.triangle[tree.child[k] : tree.child[k] + tree.count[k]]
        corners = np.concatenate(
            [rows[:, :3], rows[:, :3] + rows[:, 3:6], rows[:, :3] + rows[:, 6:]]
        )
        assert (corners >= tree.box[k, :3]).all() and (corners <= tree.box[k, 3:]).all()
    for k in np.flatnonzero(tree.count == 0):
        for inner in (tree.child[k], tree.child[k] + 1):
            assert (tree.box[inner, :3] >= tree.box[k, :3]).all()
            assert (tree.box[inner, 3:] <= tree.box[k, 3:]).all()


def test_nothing_slips_between_neighbours():
    # rays through the very vertices and edges of a closed grid, along its axes too
    steps = np.linspace(-1, 1, 9)
    x, y = np.meshgrid(steps, steps, indexing="ij")
    vertices = np.stack([x, y, 0.1 * np.sin(3 * x) * np.cos(2 * y)], axis=-1).reshape(-1, 3)
    corner = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    faces = np.concatenate(
        [
            np.stack([corner, corner + 9, corner + 1], axis=1),
            np.stack([corner + 1, corner + 9, corner + 10], axis=1),
        ]
    )
    inner = np.linspace(-0.99, 0.99, 100)
    targets = np.concatenate(
        [
            vertices[(np.abs(vertices[:, :2]) < 0.9).all(axis=1)],
            np.stack([inner, 0 * inner, 0 * inner], axis=1),
            np.stack([inner, -inner, 0 * inner], axis=1),
        ]
    )
    tree = ray_tree(vertices, faces)
    for direction in ((0, 0, 1), (0.1, 0.2, 1), (0, 0.05, 1)):
        along = np.broadcast_to(np.array(direction, float), targets.shape)
        assert blocked(tree, targets - 3 * along, along).all()
        assert not blocked(tree, targets + 3 * along, along).any()


def test_rays_along_axes_and_none_at_all():
    vertices, faces = soup(50)
    origins = np.random.default_rng(3).uniform(-1.5, 1.5, (200, 3))
    for axis in np.concatenate([np.eye(3), -np.eye(3)]):
        directions = np.broadcast_to(axis, origins.shape)
        with np.errstate(divide="ignore", invalid="ignore"):
            wanted = plain(vertices, faces, origins, directions)
        assert np.array_equal(blocked(ray_tree(vertices, faces), origins, directions), wanted)
    nothing = ray_tree(vertices, np.zeros((0, 3), int))
    assert not blocked(nothing, origins, directions).any()
    assert not blocked(ray_tree(vertices, faces), origins, directions * np.nan).any()


def test_equal_and_flat_triangles_are_borne():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0.5, 0]], float)
    faces = np.concatenate([np.tile([[0, 1, 2]], (100, 1)), [[0, 0, 0], [1, 3, 2]]])
    tree = ray_tree(vertices, faces)
    found = blocked(tree, np.array([[0.2, 0.2, 1], [2, 2, 1]]), np.array([[0, 0, -1.0]] * 2))
    assert found.tolist() == [True, False]


def test_broken_meshes_are_refused():
    vertices, faces = soup(2)
    with pytest.raises(InvalidMesh, match=r"0\.\.6, the mesh has 6 vertices"):
        ray_tree(vertices, faces + (faces == 5))
    vertices[1] = np.nan
    with pytest.raises(InvalidMesh, match="not finite"):
        ray_tree(vertices, faces)
