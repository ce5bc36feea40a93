"""Lights are checked at the door, and joined in order."""

import numpy as np
import pytest

from btfcore.errors import InvalidParameter
from btfcore.render.lights import NONE, Lights, directional, joined


def test_directions_of_any_length_become_unit():
    lights = directional([[0, 0, 1e-200], [3e200, 0, 0], [1, 1, 0]])
    np.testing.assert_allclose(np.linalg.norm(lights.direction, axis=1), 1.0)
    np.testing.assert_array_equal(lights.direction[0], [0, 0, 1])
    np.testing.assert_array_equal(lights.intensity, np.ones((3, 3)))


def test_intensity_is_one_number_one_a_light_or_a_colour():
    assert directional([0, 0, 1], 2.0).intensity.tolist() == [[2, 2, 2]]
    assert directional(np.eye(3)[:2], [1.0, 2.0]).intensity.tolist() == [[1, 1, 1], [2, 2, 2]]
    assert directional([0, 0, 1], [1.0, 0.5, 0.0]).intensity.tolist() == [[1, 0.5, 0]]


@pytest.mark.parametrize("wrong", [[0, 0, 0], [np.nan, 0, 1], [np.inf, 0, 0]])
def test_what_is_no_direction_is_refused(wrong):
    with pytest.raises(InvalidParameter, match="no direction"):
        directional(wrong)


@pytest.mark.parametrize("wrong", [-1.0, np.nan, np.inf, 1e31])
def test_absurd_intensities_are_refused(wrong):
    with pytest.raises(InvalidParameter, match="intensity"):
        directional([0, 0, 1], wrong)


def test_lengths_and_counts_are_checked():
    with pytest.raises(InvalidParameter, match="length 2"):
        Lights(np.array([[0, 0, 2.0]]), np.ones((1, 3)))
    with pytest.raises(InvalidParameter, match="2 of 1"):
        Lights(np.array([[0, 0, 1.0]]), np.ones((1, 3)), sampled=2)
    with pytest.raises(InvalidParameter, match=r"\(5, 3\)"):
        Lights(np.array([[0, 0, 1.0]]), np.ones((1, 3)), harmonics=np.ones((5, 3)))


def test_joined_keeps_order_and_the_environment_last():
    sky = Lights(np.eye(3), np.ones((3, 3)), sampled=3, harmonics=np.ones((4, 3)))
    both = joined([directional([0, 1, 0], 2.0), sky])
    assert len(both) == 4
    assert both.sampled == 3
    assert both.harmonics.shape == (4, 3)
    assert both.intensity[0, 0] == 2.0
    assert len(joined([])) == len(NONE) == 0
    with pytest.raises(InvalidParameter, match="last"):
        joined([sky, directional([0, 1, 0])])
