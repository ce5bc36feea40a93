"""The papers' nearest directions: the right ones, weighted by the inverse squared angle."""

import numpy as np
import pytest

from btfcore.btf.directions import angle_between, layout
from btfcore.btf.interpolation.interpolator import prepare
from btfcore.btf.interpolation.nearest import nearest_weights_plain
from tests.btf.interpolation.sets import SETS, scattered


@pytest.mark.parametrize(("method", "slots"), [("nearest4", 4), ("nearest", 1)])
@pytest.mark.parametrize("name", SETS)
def test_the_kernel_and_its_twin_agree(name, method, slots):
    directions = SETS[name]
    slots = min(slots, len(directions))
    queries = np.concatenate([scattered(1000, 8), -scattered(50, 9), directions])
    index, weight = prepare(directions, method).weights(queries)
    nodes = np.arange(len(directions), dtype=np.int32)
    want_index, want = nearest_weights_plain(directions, nodes, queries, slots)
    np.testing.assert_allclose(weight, want, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(index[:1000], want_index[:1000])


def test_weights_fall_with_the_squared_angle():
    directions = layout("ubo81").views
    queries = scattered(200, 3)
    index, weight = prepare(directions, "nearest4").weights(queries)
    angle = angle_between(queries[:, None], directions[None])
    taken = np.take_along_axis(angle, index.astype(np.int64), axis=1)
    np.testing.assert_allclose(taken, np.sort(angle, axis=1)[:, :4], atol=1e-12)
    np.testing.assert_allclose(
        weight * taken**2, (weight * taken**2)[:, :1].repeat(4, 1), rtol=1e-6
    )


def test_fewer_than_four_directions_are_all_taken():
    index, weight = prepare(SETS["two"], "nearest4").weights(scattered(20, 1))
    assert index.shape == (20, 2) and (weight > 0).all()
