"""Lines drawn on a surface become directions of its field."""

import numpy as np
import pytest

from app.tools.directions import along, shown_of, snapped, spread
from btfcore.types import DenseMesh, Field
from tests.surfaces import grid_faces


def tube(count=60, radius=0.5, length=2.0):
    """A dense mesh of a round tube along z, by formula."""
    turn = 2 * np.pi * np.arange(count) / count
    height = np.linspace(0, length, count)
    v, u = np.meshgrid(height, turn, indexing="ij")
    points = np.stack([radius * np.cos(u), radius * np.sin(u), v], axis=-1).reshape(-1, 3)
    normals = np.stack([np.cos(u), np.sin(u), 0 * u], axis=-1).reshape(-1, 3)
    texel = np.stack(np.divmod(np.arange(count * count), count), axis=-1).astype(np.int32)
    faces = grid_faces(count, count, wrap=False)
    number = count * count
    return DenseMesh(
        points, normals.astype(np.float32), faces, texel, np.zeros(number, np.int32),
        np.zeros(number, np.int32), np.zeros((number, 3), np.float32), count, len(faces),
    )  # fmt: skip


def test_directions_follow_the_line_and_lie_in_the_surface():
    turn = np.linspace(0, 2, 200)
    points = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    place, direction = along(points, points, 0.2)
    assert len(place) == 10 and np.abs(np.linalg.norm(direction, axis=1) - 1).max() < 1e-12
    wanted = np.stack([-place[:, 1], place[:, 0], 0 * place[:, 0]], axis=1)
    assert np.einsum("ij,ij->i", direction, wanted).min() > 0.999
    assert np.abs(np.einsum("ij,ij->i", direction, place)).max() < 1e-9
    steps = np.linalg.norm(np.diff(place, axis=0), axis=1)
    assert np.ptp(steps) < 1e-3


@pytest.mark.parametrize("points", [np.zeros((1, 3)), np.ones((5, 3))])
def test_a_line_without_length_has_no_direction(points):
    place, direction = along(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)), 0.1)
    assert place.shape == direction.shape == (0, 3)


def test_a_short_line_has_one_direction():
    points = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0]])
    place, direction = along(points, np.tile([0.0, 0.0, 1.0], (2, 1)), 5.0)
    assert place.tolist() == [[0.005, 0.0, 0.0]] and np.allclose(direction, [[1, 0, 0]])


def test_on_a_tube_directions_snap_to_its_axis_or_round_it():
    dense = tube()
    places = np.tile([0.5, 0.0, 1.0], (4, 1))
    drawn = np.array([[0, 0.2, 1.0], [0, -0.3, -1.0], [0, 1.0, 0.3], [0, -1.0, 0.2]])
    drawn /= np.linalg.norm(drawn, axis=1, keepdims=True)
    found = snapped(dense, places, drawn, 0.25)
    wanted = np.array([[0, 0, 1], [0, 0, -1], [0, 1, 0], [0, -1, 0]])
    assert np.einsum("ij,ij->i", found, wanted).min() > 0.999


def test_where_curvature_tells_nothing_the_direction_stays():
    dense = tube(radius=0.5)
    flat = DenseMesh(
        dense.vertices * [0, 1, 1], np.tile(np.float32([1, 0, 0]), (len(dense.vertices), 1)),
        dense.faces, dense.texel, dense.chart, dense.face, dense.bary, dense.size,
        dense.grid_faces,
    )  # fmt: skip
    drawn = np.array([[0.0, 0.6, 0.8]])
    assert np.array_equal(snapped(flat, np.array([[0.0, 0.1, 1.0]]), drawn, 0.25), drawn)
    far = np.array([[9.0, 0.0, 0.0]])
    assert np.array_equal(snapped(dense, far, drawn, 0.25), drawn)


def test_arrows_of_a_field_are_spread_evenly_and_point_along_it():
    dense = tube()
    tangents = np.cross([0.0, 0.0, 1.0], dense.normals).astype(np.float32)
    turning = np.array([[0.5, 0.0, 0.0]])
    shown = shown_of(dense, Field(tangents, turning), most=100)
    assert 50 <= len(shown.tails) <= 200 and np.array_equal(shown.singularities, turning)
    way = shown.heads - shown.tails
    round_it = np.cross([0.0, 0.0, 1.0], shown.tails)
    cosine = np.einsum("ij,ij->i", way, round_it) / np.linalg.norm(way, axis=1)
    assert (cosine / np.linalg.norm(round_it, axis=1)).min() > 0.999


def test_one_point_of_each_cell_is_chosen():
    points = np.random.default_rng(0).random((2000, 3))
    chosen = spread(points, 0.25)
    cells = np.floor((points - points.min(axis=0)) / 0.25)
    assert len(chosen) == len(np.unique(cells, axis=0)) == len(np.unique(cells[chosen], axis=0))
