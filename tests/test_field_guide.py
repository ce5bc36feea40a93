"""Laws of fields drawn by the user, and of the door that their files pass."""

import json

import numpy as np
import pytest

from btfcore.errors import InvalidGuide
from btfcore.field import orientation_field, read_guide
from btfcore.guide import LARGEST_FILE, MOST_ENTRIES, Guide, spanned
from btfcore.types import Mesh
from tests.surfaces import cylinder, plane, sphere
from tests.test_field import blob, rotated, rotation


def solve(dense, positions, directions):
    guide = Guide(np.array(positions, float), np.array(directions, float))
    return orientation_field(dense, Mesh(dense.vertices.copy(), dense.faces.copy()), guide=guide)


PLACES = {
    "one": [(3, -4, 0)],
    "two": [(3, -4, 0), (30, -20, 0)],
    "same place": [(3, -4, 0)] * 3,
    "on a line": [(k, -k, 0) for k in range(5)],
    "in the plane": [(3, -4, 0), (30, -20, 0), (5, -33, 0), (44, -1, 0)],
    "around it": [(3, -4, 9), (30, -20, -7), (5, -33, 2), (44, -1, 40), (0, 0, 1e300)],
    "hundreds": np.random.default_rng(0).uniform(-50, 50, (1500, 3)),
}


@pytest.mark.parametrize("name", PLACES)
def test_a_constant_guide_on_a_plane_is_reproduced(name):
    direction = np.array([0.6, -0.8, 0.0])
    lengths = np.linspace(0.1, 1e6, len(PLACES[name]))[:, None]
    field = solve(plane(), PLACES[name], direction * lengths)
    np.testing.assert_allclose(field.tangents, np.tile(direction, (2000, 1)), atol=1e-6)
    assert len(field.singularities) == 0


def test_the_field_passes_through_the_vectors_drawn():
    dense = plane()
    drawn = np.array([(5, 0, 0), (40, -30, 0), (20, -20, 0)], float)
    directions = np.array([(1, 0, 0), (0, 2, 0), (-3, -3, 0)], float)
    tangents = solve(dense, drawn, directions).tangents
    for place, direction in zip(drawn, directions, strict=True):
        vertex = np.linalg.norm(dense.vertices - place, axis=1).argmin()
        expected = direction / np.linalg.norm(direction)
        np.testing.assert_allclose(tangents[vertex], expected, atol=1e-5)


def test_rotating_mesh_and_guide_rotates_the_field():
    dense, turn = blob(), rotation()
    places = np.array([(0, 1.4, 0), (1, 0, 0), (0, 0, -0.8), (0.3, -1, 0.4)], float)
    directions = np.array([(1, 0, 0.2), (0, 1, 0), (1, 1, 0), (0, 0.1, 1)], float)
    here = solve(dense, places, directions).tangents @ turn.T
    there = solve(rotated(dense, turn), places @ turn.T, directions @ turn.T).tangents
    assert np.quantile((here * there).sum(axis=1), 0.01) > 0.999


def test_where_the_guide_stands_upright_on_the_surface_neighbours_are_carried_on():
    dense = sphere(4)
    tangents = solve(dense, [(0, 0, 0)], [(0, 1, 0)]).tangents.astype(float)
    assert np.isfinite(tangents).all()
    assert np.abs(np.linalg.norm(tangents, axis=1) - 1).max() < 1e-6
    far = np.abs(dense.vertices[:, 1]) < 0.9
    flat = (0, 1, 0) - dense.normals * dense.normals[:, 1:2]
    flat /= np.linalg.norm(flat, axis=1)[:, None]
    assert (tangents * flat).sum(axis=1)[far].min() > 0.9999


def test_a_guide_without_any_tangential_part_leaves_the_field_to_itself():
    dense = plane()
    mesh = Mesh(dense.vertices.copy(), dense.faces.copy())
    free = orientation_field(dense, mesh).tangents
    np.testing.assert_array_equal(solve(dense, [(0, 0, 0)], [(0, 0, 1)]).tangents, free)
    np.testing.assert_array_equal(
        solve(dense, [(0, 0, 0)] * 2, [(1, 0, 0), (-1, 0, 0)]).tangents, free
    )


def test_opposed_vectors_on_a_cylinder_turn_between_them():
    dense = cylinder()
    radius = 60 / (2 * np.pi)
    tangents = solve(dense, [(0, -5, radius), (0, -70, radius)], [(1, 0, 0), (-1, 0, 0)]).tangents
    assert np.isfinite(tangents).all()
    assert np.abs(np.linalg.norm(tangents, axis=1) - 1).max() < 1e-6


def test_interpolated_vectors_equal_the_kernel_sum_written_out():
    random = np.random.default_rng(5)
    places, directions = random.standard_normal((2, 6, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    points = random.standard_normal((20, 3))

    def kernel(a, b):
        return -np.linalg.norm(a[:, None] - b[None], axis=2)

    system = np.block([[kernel(places, places), np.ones((6, 1))], [np.ones((1, 6)), 0]])
    weights = np.linalg.solve(system, np.concatenate([directions, np.zeros((1, 3))]))
    expected = kernel(points, places) @ weights[:6] + weights[6]
    found = spanned(Guide(places, directions), points, diagonal=2.0)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_file_is_read_as_written(tmp_path):
    path = tmp_path / "guide.json"
    path.write_text(json.dumps([{"position": [1, 2, 3.5], "direction": [0, -1, 0], "note": 1}]))
    guide = read_guide(path)
    np.testing.assert_array_equal(guide.positions, [[1, 2, 3.5]])
    np.testing.assert_array_equal(guide.directions, [[0, -1, 0]])


def entry(position="[0, 0, 0]", direction="[1, 0, 0]"):
    return f'{{"position": {position}, "direction": {direction}}}'


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "not JSON"),
        ("[1, 2", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("{}", "object, not a list"),
        ("3", "number, not a list"),
        ("[]", "0 vectors"),
        ("[3]", "entry 0 is a JSON number"),
        ('[{"position": [0, 0, 0]}]', "entry 0 has no 'direction'"),
        (f'[{entry()}, {{"direction": [0, 0, 1]}}]', "entry 1 has no 'position'"),
        (f"[{entry()}, {entry(direction='[0, 0, 0]')}]", "entry 1: direction is [0, 0, 0]"),
        (f"[{entry(position='[0, 0]')}]", "2 numbers, not 3"),
        (f"[{entry(position='7')}]", "a number, not 3"),
        (f"[{entry(position='[0, 0, true]')}]", "holds a boolean"),
        (f"[{entry(position='[0, 0, NaN]')}]", "holds nan"),
        (f"[{entry(direction='[0, 0, Infinity]')}]", "holds inf"),
        (f"[{entry(direction='[0, 0, 1e999]')}]", "holds inf"),
        (f"[{entry(direction='[0, 0, 1' + '0' * 400 + ']')}]", "holds inf"),
    ],
)
def test_a_bad_file_is_named_with_entry_and_number(tmp_path, text, says):
    path = tmp_path / "guide.json"
    path.write_text(text)
    with pytest.raises(InvalidGuide) as caught:
        read_guide(path)
    assert says in str(caught.value)
    assert str(path) in str(caught.value)


def test_files_that_cannot_be_read_or_are_too_large_are_named(tmp_path):
    with pytest.raises(InvalidGuide, match="No such file"):
        read_guide(tmp_path / "none.json")
    with pytest.raises(InvalidGuide, match="directory"):
        read_guide(tmp_path)
    path = tmp_path / "bytes.json"
    path.write_bytes(b"\xff\xfe\x00[")
    with pytest.raises(InvalidGuide, match="not JSON"):
        read_guide(path)
    path.write_text("[" + ",".join([entry()] * (MOST_ENTRIES + 1)) + "]")
    with pytest.raises(InvalidGuide, match=str(MOST_ENTRIES + 1)):
        read_guide(path)
    with path.open("wb") as file:
        file.truncate(LARGEST_FILE + 1)
    with pytest.raises(InvalidGuide, match=str(LARGEST_FILE + 1)):
        read_guide(path)


@pytest.mark.parametrize(
    ("positions", "directions", "says"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3)), "k > 0"),
        (np.zeros((2, 3)), np.ones((3, 3)), "not both"),
        (np.zeros((2, 3)), np.array([[1.0, 0, 0], [0, 0, 0]]), "entry 1"),
        (np.array([[0.0, 0, np.inf]]), np.ones((1, 3)), "entry 0: position"),
    ],
)
def test_guides_made_in_memory_are_checked_too(positions, directions, says):
    with pytest.raises(InvalidGuide, match=says):
        spanned(Guide(positions, directions), np.zeros((4, 3)), diagonal=1.0)
