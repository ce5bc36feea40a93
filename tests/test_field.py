"""Laws of the orientation field: tangential, upright, and turning around as topology demands."""

import dataclasses

import numpy as np
import pytest

from btfcore.connection import carried, face_indices, frames, transports
from btfcore.field import orientation_field
from btfcore.guide import Guide
from btfcore.mesh.topology import statistics, vertex_normals
from btfcore.types import Mesh
from tests.surfaces import cylinder, dense_mesh, grid_faces, plane, random_field, sphere


def mesh_of(dense):
    return Mesh(np.array(dense.vertices), np.array(dense.faces))


def solve(dense, **knobs):
    return orientation_field(dense, mesh_of(dense), **knobs)


def torus(rows=60, columns=90, radius=2.0):
    """Closed torus about the y axis."""
    row, column = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    turn, around = 2 * np.pi * row / rows, 2 * np.pi * column / columns
    ring = radius + np.cos(turn)
    points = np.stack([ring * np.sin(around), -np.sin(turn), ring * np.cos(around)], axis=-1)
    faces = grid_faces(rows + 1, columns, wrap=True) % (rows * columns)
    return dense_mesh(points.reshape(-1, 3), faces)


def blob(level=4):
    """A closed surface without symmetry."""
    ball = sphere(level)
    x, y, z = ball.vertices.T
    swell = 1 + 0.3 * np.sin(2 * x + 0.5) * np.cos(1.5 * y) + 0.2 * np.sin(3 * z + x)
    return dense_mesh(ball.vertices * swell[:, None] * (1.0, 1.4, 0.8), ball.faces)


def read(data, name):
    from btfcore.pipeline import load_mesh

    mesh, _ = load_mesh(next(data.rglob(name)))
    dense = dense_mesh(mesh.vertices, mesh.faces)
    normals = vertex_normals(mesh.vertices, mesh.faces).astype(np.float32)
    return dataclasses.replace(dense, normals=normals)


def rotation(seed=3):
    q, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    return q * np.sign(np.linalg.det(q))


def rotated(dense, turn):
    return dataclasses.replace(
        dense,
        vertices=dense.vertices @ turn.T,
        normals=(dense.normals @ turn.T).astype(np.float32),
    )


def winding(normals, tangents, faces):
    """Plain twin of `face_indices`, before rounding."""
    total = np.zeros(len(faces))
    for k in range(3):
        a, b = faces[:, k], faces[:, (k + 1) % 3]
        moved = carried(tangents[a], normals[a], normals[b])
        across = np.cross(normals[b], moved)
        total += np.arctan2((across * tangents[b]).sum(1), (moved * tangents[b]).sum(1))
    n0, n1, n2 = (normals[faces[:, k]] for k in range(3))
    triple = (n0 * np.cross(n1, n2)).sum(axis=1)
    dots = (n0 * n1 + n1 * n2 + n2 * n0).sum(axis=1)
    return (total + 2 * np.arctan2(triple, 1 + dots)) / (2 * np.pi)


SHAPES = {
    "sphere": sphere,
    "torus": torus,
    "blob": blob,
    "plane": plane,
    "cylinder": cylinder,
    "triangle": lambda: dense_mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]),
    "many": lambda: plane(100, 100),
}


@pytest.mark.parametrize("name", SHAPES)
def test_tangents_are_unit_and_tangential(name):
    dense = SHAPES[name]()
    tangents = solve(dense).tangents
    assert tangents.dtype == np.float32 and tangents.shape == dense.vertices.shape
    assert np.isfinite(tangents).all()
    exact = tangents.astype(np.float64)
    assert np.abs(np.linalg.norm(exact, axis=1) - 1).max() < 1e-6
    assert np.abs((exact * dense.normals).sum(axis=1)).max() < 1e-5


@pytest.mark.parametrize("name", ["sphere", "torus", "blob"])
def test_singularities_sum_to_the_euler_number(name):
    dense = SHAPES[name]()
    euler = statistics(dense.vertices, dense.faces).euler
    for field in (solve(dense), random_field(dense)):
        index = face_indices(dense.normals, field.tangents, dense.faces)
        assert index.sum() == euler


@pytest.mark.parametrize("name", ["3holes.off", "bunny.obj", "fertility.off", "torus.obj"])
def test_poincare_and_hopf_on_real_meshes(data, name):
    dense = read(data, name)
    field = solve(dense)
    index = face_indices(dense.normals, field.tangents, dense.faces)
    assert index.sum() == statistics(dense.vertices, dense.faces).euler
    assert len(field.singularities) == np.count_nonzero(index)


@pytest.mark.parametrize("name", ["sphere", "torus", "blob"])
def test_indices_are_integers_and_equal_their_plain_twin(name):
    dense = SHAPES[name]()
    normals = dense.normals.astype(np.float64)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    tangents = random_field(dense).tangents.astype(np.float64)
    tangents -= normals * (tangents * normals).sum(axis=1)[:, None]
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    plain = winding(normals, tangents, dense.faces)
    assert np.abs(plain - np.rint(plain)).max() < 1e-9
    assert abs(plain.sum() - statistics(dense.vertices, dense.faces).euler) < 1e-9
    np.testing.assert_array_equal(face_indices(normals, tangents, dense.faces), np.rint(plain))


def test_a_known_vortex_is_found_where_it_is():
    dense = plane(21, 21)
    offset = dense.vertices - (10.4, -9.7, 0.0)
    tangents = np.stack([-offset[:, 1], offset[:, 0], 0 * offset[:, 0]], axis=1)
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    for vectors, expected in ((tangents, 1), (tangents * (1, -1, 1), -1)):
        index = face_indices(dense.normals, vectors.astype(np.float32), dense.faces)
        assert index.sum() == expected == index[np.flatnonzero(index)[0]]
        found = dense.vertices[dense.faces[index != 0]].mean(axis=1)[0]
        assert np.linalg.norm(found - (10.4, -9.7, 0.0)) < 1


@pytest.mark.parametrize("make", [plane, cylinder, torus])
def test_surfaces_that_need_no_singularity_get_none(make):
    assert len(solve(make()).singularities) == 0


def test_a_sphere_has_its_two_singularities_at_its_poles():
    found = solve(sphere(5)).singularities
    assert len(found) == 2
    np.testing.assert_allclose(np.sort(found[:, 1]), [-1, 1], atol=0.1)


def uprightness(dense, tangents, up=(0.0, 1.0, 0.0)):
    """Mean cosine between t = n × s and the projection of `up`, weighted by its length."""
    over = np.cross(dense.normals, tangents)
    wish = np.asarray(up) - dense.normals * (dense.normals @ np.asarray(up))[:, None]
    return (over * wish).sum() / np.linalg.norm(wish, axis=1).sum()


def test_pictures_stand_upright_on_walls():
    for make in (plane, cylinder):
        dense = make()
        assert uprightness(dense, solve(dense).tangents) > 0.9999
    assert uprightness(sphere(4), solve(sphere(4)).tangents) > 0.98
    assert uprightness(blob(), solve(blob()).tangents) > 0.8


def test_on_floors_pictures_point_away_from_the_viewer():
    wall = plane()
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # z to y, y to -z
    floor = rotated(wall, turn)
    tangents = solve(floor).tangents
    np.testing.assert_allclose(floor.normals @ (0, 1, 0), 1, atol=1e-6)
    np.testing.assert_allclose(tangents, np.tile([1.0, 0, 0], (len(tangents), 1)), atol=1e-5)


@pytest.mark.parametrize("make", [torus, blob])
def test_rotating_the_mesh_and_its_axes_rotates_the_field(make):
    dense, turn = make(), rotation()
    turned = rotated(dense, turn)
    up, away = turn @ (0, 1, 0), turn @ (0, 0, -1)
    here = solve(dense).tangents @ turn.T
    there = solve(turned, up=tuple(up), away=tuple(away)).tangents
    assert np.median((here * there).sum(axis=1)) > 1 - 1e-6
    assert np.quantile((here * there).sum(axis=1), 0.01) > 0.999


@pytest.mark.parametrize("factor", [1e-12, 1e12])
def test_neither_size_nor_place_matter(factor):
    dense = blob(3)
    moved = dataclasses.replace(dense, vertices=(dense.vertices + (3, -2, 5)) * factor)
    here, there = solve(dense).tangents, solve(moved).tangents
    assert (here * there).sum(axis=1).min() > 0.999


def test_a_component_does_not_know_the_others():
    one, other = blob(3), torus(20, 30)
    both = dense_mesh(
        np.concatenate([one.vertices, other.vertices + 9]),
        np.concatenate([one.faces, other.faces + len(one.vertices)]),
    )
    together = solve(both).tangents
    apart = np.concatenate([solve(one).tangents, solve(other).tangents])
    assert (together * apart).sum(axis=1).min() > 0.999


def test_the_same_input_gives_the_same_bits():
    dense = plane(90, 90)
    guide = Guide(np.array([[3.0, -4, 0], [60, -50, 0]]), np.array([[1.0, 1, 0], [0, 1, 0]]))
    for knobs in ({}, {"guide": guide}):
        first, second = solve(dense, **knobs), solve(dense, **knobs)
        assert first.tangents.tobytes() == second.tangents.tobytes()
        assert first.singularities.tobytes() == second.singularities.tobytes()


def test_useless_normals_still_give_unit_tangents():
    dense = sphere(3)
    normals = dense.normals.copy()
    normals[::7] = 0
    normals[1::7] *= -1
    normals[2::7] = np.nan
    broken = dataclasses.replace(dense, normals=normals)
    guide = Guide(np.zeros((1, 3)), np.ones((1, 3)))
    for knobs in ({}, {"guide": guide}):
        tangents = solve(broken, **knobs).tangents
        assert np.abs(np.linalg.norm(tangents, axis=1) - 1).max() < 1e-5
        sound = np.isfinite(normals).all(axis=1)
        assert np.abs((tangents * normals).sum(axis=1)[sound]).max() < 1e-5


def test_vertices_of_no_face_and_loose_triangles_are_served():
    corners = np.random.default_rng(0).standard_normal((40 * 3 + 5, 3))
    faces = np.arange(120).reshape(40, 3)
    tangents = solve(dense_mesh(corners, faces)).tangents
    assert np.abs(np.linalg.norm(tangents, axis=1) - 1).max() < 1e-5


def test_a_field_on_a_sphere_is_about_as_smooth_as_its_parallels():
    """The field turns hardly more from vertex to vertex than the parallels of a sphere do."""
    dense = sphere(5)
    tail, head = dense.faces[:, 0], dense.faces[:, 1]
    normals = dense.normals.astype(np.float64)

    def mean_turn(tangents):
        moved = carried(tangents[tail], normals[tail], normals[head])
        return np.arccos(np.clip((moved * tangents[head]).sum(axis=1), -1, 1)).mean()

    parallels = np.cross((0.0, 1.0, 0.0), normals)
    parallels /= np.maximum(np.linalg.norm(parallels, axis=1), 1e-9)[:, None]
    assert mean_turn(solve(dense).tangents.astype(np.float64)) < 1.1 * mean_turn(parallels)


def test_cancelling_stops_the_field():
    from btfcore.errors import Cancelled

    def stop(fraction, label):
        if fraction > 0.2:
            raise Cancelled

    with pytest.raises(Cancelled):
        solve(plane(), progress=stop)


def test_frames_are_right_handed_and_transports_turn_nothing_between_equal_normals():
    normals = np.random.default_rng(1).standard_normal((50, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    s, t = frames(normals)
    np.testing.assert_allclose(np.cross(s, t), normals, atol=1e-12)
    pairs = np.stack([np.arange(50)] * 2, axis=1).astype(np.int32)
    np.testing.assert_allclose(transports(normals, pairs), 1, atol=1e-12)
    back = transports(normals, pairs[:, ::-1])
    np.testing.assert_allclose(back, 1, atol=1e-12)


def test_carrying_keeps_lengths_and_comes_back():
    random = np.random.default_rng(2)
    start, stop = (
        v / np.linalg.norm(v, axis=1)[:, None] for v in random.standard_normal((2, 99, 3))
    )
    s, t = frames(start)
    vectors = s * 0.3 - t * 1.7
    moved = carried(vectors, start, stop)
    np.testing.assert_allclose((moved * stop).sum(axis=1), 0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), np.hypot(0.3, 1.7), atol=1e-9)
    np.testing.assert_allclose(carried(moved, stop, start), vectors, atol=1e-9)
