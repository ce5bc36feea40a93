"""The grid: linear in phi and theta, and its kernel does what plain numpy does."""

import numpy as np
import pytest

from btfcore.btf.directions import from_angles, layout, rings
from btfcore.btf.interpolation.grid import grid_weights_plain
from btfcore.btf.interpolation.interpolator import prepare
from btfcore.btf.interpolation.rings import find_rings
from tests.btf.interpolation.sets import GRIDS, dense, scattered


@pytest.mark.parametrize("name", GRIDS)
def test_the_kernel_and_its_twin_agree(name):
    directions = GRIDS[name]
    found = prepare(directions, "grid")
    table = find_rings(directions, np.arange(len(directions), dtype=np.int32))
    around = from_angles(np.radians(40), np.linspace(-7, 7, 500))
    queries = np.concatenate([scattered(2000, 8), -scattered(50, 9), directions, around])
    nodes = len(directions) + 1
    np.testing.assert_allclose(
        dense(grid_weights_plain(table, queries), nodes),
        dense(found.node_weights(queries), nodes),
        atol=1e-12,
    )


def test_between_rings_it_is_bilinear_in_the_angles():
    found = prepare(layout("12x8x1x1").views, "grid")
    weight = dense(found.weights(from_angles(np.radians([37.5]), np.radians([100]))), 96)[0]
    want = np.zeros((8, 12))  # rings 35 and 45 degrees, azimuths 90 and 120
    want[3, 3], want[3, 4], want[4, 3], want[4, 4] = 0.5, 0.25, 1 / 6, 1 / 12
    np.testing.assert_allclose(weight.reshape(8, 12), want, atol=1e-12)


def test_rings_may_differ_in_their_azimuths():
    directions = layout("ubo151").views  # 23.5 degrees: from 0 by 30; 30 degrees: from 15 by 30
    weight = dense(
        prepare(directions, "grid").weights(from_angles([np.radians(26.75)], [0.0])), 151
    )
    assert dict(zip(np.flatnonzero(weight[0]).tolist(), weight[0][weight[0] > 0], strict=True)) == (
        pytest.approx({7: 0.5, 19: 0.25, 30: 0.25})
    )


def test_without_a_direction_on_the_normal_the_first_ring_has_its_mean_there():
    directions = rings([(20, 8, 5), (50, 8, 0)])
    found = prepare(directions, "grid")
    theta, phi = np.radians([0.0, 10.0, 20.0]), np.radians(5)
    weight = dense(found.weights(from_angles(theta, phi)), 16)[:, :8]
    even, own = np.full(8, 1 / 8), np.eye(8)[0]
    np.testing.assert_allclose(weight, [even, (even + own) / 2, own], atol=1e-12)


@pytest.mark.parametrize(
    ("name", "step"), [("12x8", 30), ("12x5", 60), ("ubo81", 180), ("ubo151", 60), ("one ring", 45)]
)
def test_turning_the_query_by_a_step_turns_the_weights(name, step):
    """Rings whose azimuths fit a common step have no preferred direction, the pole included."""
    directions = GRIDS[name]
    found = prepare(directions, "grid")
    turn = np.radians(step)
    matrix = np.array(
        [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    )
    queries = np.concatenate([scattered(500, 4), scattered(200, 5, 0.1)])
    turned = dense(found.weights(queries @ matrix.T), len(directions))
    moved = (directions @ matrix.T) @ directions.T
    place = moved.argmax(axis=1)
    np.testing.assert_allclose(
        turned[:, place], dense(found.weights(queries), len(directions)), atol=1e-9
    )
