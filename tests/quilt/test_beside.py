"""Looking beside a seam, and avoiding places that were taken: each does what its knob says."""

import numpy as np
import pytest

from btfcore.errors import InvalidParameter
from btfcore.quilt.appearance import PARTS, appearance
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.reuse import Reuse
from btfcore.quilt.synthesize import Synthesizer
from tests.surfaces import blobs, constant_field, plane


def test_few_dimensions_keep_the_neighbourhoods_distances():
    channels = np.random.default_rng(0).random((20, 24, 1)).astype(np.float32)
    channels[:, 1:] = channels[:, :1]  # every row constant: at most 5 dimensions of 25
    parts = appearance(channels, 2)
    assert parts.shape == (20, 24, PARTS)
    for a, b in (((5, 7), (12, 4)), ((9, 9), (10, 20))):
        one, two = (channels[r - 2 : r + 3, c - 2 : c + 3].astype(np.float64) for r, c in (a, b))
        expected = np.sqrt(((one - two) ** 2).sum() / 25)
        assert np.linalg.norm(parts[a] - parts[b]) == pytest.approx(expected, rel=1e-4)


def test_distances_are_never_above_those_of_the_neighbourhoods():
    channels = np.random.default_rng(1).random((16, 16, 3)).astype(np.float32)
    parts = appearance(channels, 1)
    one, two = channels[3:6, 3:6], channels[9:12, 7:10]
    whole = np.sqrt(((one - two).astype(np.float64) ** 2).sum() / 9)
    assert 0 < np.linalg.norm(parts[4, 4] - parts[10, 8]) <= whole


def test_a_taken_place_costs_by_the_matches_spread():
    reuse = Reuse(30, 40, 2.0)
    reuse.matched(1.0, 2.0)
    reuse.matched(1.0, 4.0)
    assert (reuse.penalty() == 0).all()
    reuse.taken(10.0, 20.0)
    penalty = reuse.penalty()
    assert np.unravel_index(penalty.argmax(), penalty.shape) == (20, 10)
    assert penalty.max() == pytest.approx(2.0 * 2.0)
    reuse.taken(10.0, 20.0)
    assert reuse.penalty().max() == pytest.approx(8.0)


def centres(parameters):
    """Mean sample coordinates of each patch of a quilted plane."""
    engine = Synthesizer(plane(90, 90), constant_field(plane(90, 90)), blobs(), parameters)
    quilt = engine.run()
    assert (quilt.patch >= 0).all()
    return np.array([quilt.source[quilt.patch == k].mean(axis=0) for k in np.unique(quilt.patch)])


@pytest.mark.parametrize("knobs", [{"beside": 2}, {"reuse": 4.0}])
def test_the_knobs_change_the_quilt_and_leave_it_whole_and_repeatable(knobs):
    usual, one, two = (
        centres(QuiltParameters(work_patch=12, sway=0.0, **k)) for k in ({}, knobs, knobs)
    )
    np.testing.assert_array_equal(one, two)
    assert len(usual) != len(one) or not np.array_equal(usual, one)


def test_knobs_out_of_range_are_refused():
    for knobs in ({"beside": 9}, {"beside": -1}, {"reuse": -0.5}, {"reuse": float("nan")}):
        with pytest.raises(InvalidParameter, match=next(iter(knobs))):
            QuiltParameters(**knobs)
