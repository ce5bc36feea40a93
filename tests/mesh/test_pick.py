"""The first crossing of a ray is the one that a plain search over all triangles finds."""

import numpy as np
import pytest

from btfcore.errors import InvalidParameter
from btfcore.mesh.pick import first_crossings
from btfcore.mesh.rays import ray_tree
from tests.mesh.test_rays import directions_of, soup


def plain(vertices, faces, origin, direction, nearest=0.0):
    """Nearest crossing by solving o + t d = a + u (b - a) + v (c - a) for every triangle."""
    best = (-1, np.inf, np.zeros(3))
    for number, (a, b, c) in enumerate(vertices[faces]):
        matrix = np.stack([b - a, c - a, -direction], axis=1)
        if abs(np.linalg.det(matrix)) < 1e-15:
            continue
        u, v, t = np.linalg.solve(matrix, origin - a)
        if min(u, v, 1 - u - v) >= 0 and nearest < t < best[1]:
            best = (number, t, np.array([1 - u - v, u, v]))
    return best


@pytest.mark.parametrize("count", [1, 2, 5, 200])
def test_the_first_crossing_is_that_of_the_plain_search(count):
    vertices, faces = soup(count, size=0.3 if count > 9 else 2.0)
    rng = np.random.default_rng(2)
    origins, directions = rng.uniform(-1.5, 1.5, (120, 3)), 1.7 * directions_of(120)
    nearest = np.where(np.arange(120) % 2, 0.0, 0.4)
    found = first_crossings(ray_tree(vertices, faces), origins, directions, nearest=nearest)
    for n in range(120):
        face, distance, bary = plain(vertices, faces, origins[n], directions[n], nearest[n])
        assert found.face[n] == face
        if face < 0:
            assert np.isinf(found.distance[n]) and not found.bary[n].any()
            continue
        assert found.distance[n] == pytest.approx(distance, rel=1e-9)
        assert found.bary[n] == pytest.approx(bary, abs=1e-9)
        on_face = found.bary[n] @ vertices[faces[face]]
        assert on_face == pytest.approx(origins[n] + distance * directions[n], abs=1e-9)
    assert (found.face >= 0).any()


def test_where_triangles_meet_the_ray_hits_one_of_them_and_always_the_same():
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0), indexing="ij"), -1).reshape(-1, 2)
    vertices = np.column_stack([grid, np.zeros(25)])
    corner = (np.arange(4)[:, None] * 5 + np.arange(4)).ravel()
    faces = np.concatenate(
        [
            np.stack([corner, corner + 5, corner + 6], 1),
            np.stack([corner, corner + 6, corner + 1], 1),
        ]
    )
    above = vertices + [0.0, 0.0, 2.0]  # straight over every vertex, those of the rim too
    down = np.broadcast_to([0.0, 0.0, -1.0], above.shape)
    found = first_crossings(ray_tree(vertices, faces), above, down)
    assert (found.face >= 0).all() and np.allclose(found.distance, 2.0)
    assert (found.bary.max(axis=1) > 1 - 1e-9).all()
    for number, face in enumerate(found.face):
        assert face == np.flatnonzero((faces == number).any(axis=1)).min()
    turned = np.random.default_rng(0).permutation(len(faces))
    other = first_crossings(ray_tree(vertices, faces[turned]), above, down)
    assert np.allclose(other.distance, found.distance)


def test_both_sides_are_met_and_a_ray_in_the_plane_is_not():
    vertices, faces = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]]
    tree = ray_tree(vertices, faces)
    origins = np.array([[0.2, 0.2, 1.0], [0.2, 0.2, -1.0], [-1.0, 0.2, 0.0], [0.2, 0.2, 1.0]])
    directions = np.array([[0.0, 0, -1], [0, 0, 1], [1, 0, 0], [np.nan, 0, -1]])
    assert first_crossings(tree, origins, directions).face.tolist() == [0, 0, -1, -1]


def test_one_origin_serves_all_rays_and_an_empty_mesh_is_never_met():
    vertices, faces = soup(80)
    tree, directions = ray_tree(vertices, faces), directions_of(50)
    one = first_crossings(tree, np.zeros(3), directions)
    all_ = first_crossings(tree, np.zeros((50, 3)), directions)
    assert np.array_equal(one.face, all_.face) and np.array_equal(one.distance, all_.distance)
    none = first_crossings(ray_tree(np.zeros((0, 3)), np.zeros((0, 3))), np.zeros(3), directions)
    assert (none.face == -1).all() and len(none) == 50
    with pytest.raises(InvalidParameter, match="50 directions"):
        first_crossings(tree, np.zeros((49, 3)), directions)


def test_the_tree_knows_the_number_of_each_of_its_triangles():
    vertices, faces = soup(300)
    tree = ray_tree(vertices, faces)
    assert np.array_equal(np.sort(tree.face), np.arange(300))
    assert np.array_equal(tree.triangle[:, :3], vertices[faces[tree.face, 0]])
