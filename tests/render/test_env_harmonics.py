"""Environment maps as harmonics: exact for what they can hold, and turned like the map."""

import numpy as np
import pytest

from btfcore.btf.harmonics.basis import evaluate
from btfcore.errors import InvalidParameter
from btfcore.render.env_harmonics import (
    environment_harmonics,
    hanning,
    rotated,
    rotated_about_y,
)
from btfcore.render.environment import Environment, total
from tests.render.skies import band_limited, normals, sun_and_sky


def any_rotation(seed):
    matrix, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return matrix * np.sign(np.linalg.det(matrix))


@pytest.mark.parametrize("height", [16, 33, 128])
@pytest.mark.parametrize("order", [0, 3, 6])
def test_a_band_limited_map_gives_its_own_coefficients(height, order):
    radiance, coefficients = band_limited(height, order)
    found = environment_harmonics(Environment(radiance), order)
    assert np.abs(found - coefficients).max() < 1e-5


def test_the_first_coefficient_is_the_energy():
    radiance = sun_and_sky(256)
    found = environment_harmonics(Environment(radiance, intensity=2), 0)
    energy = total(Environment(radiance, intensity=2))
    assert np.allclose(found[0] * np.sqrt(4 * np.pi), energy, rtol=1e-4)


def test_turned_coefficients_are_those_of_the_turned_function():
    at = normals(100)
    for seed, order in ((0, 6), (1, 4), (2, 1)):
        _, coefficients = band_limited(8, order, seed)
        turn = any_rotation(seed)
        there = np.einsum("ij,nj->ni", turn, at)
        before = evaluate(at, order) @ coefficients
        after = evaluate(there, order) @ rotated(coefficients, turn)
        assert np.allclose(after, before, atol=1e-11)


def test_turning_the_map_turns_the_coefficients():
    # by whole texels the turned map is the shifted one: rightwards is from +x to +z
    radiance = sun_and_sky(64)
    shifted = np.roll(radiance, 20, axis=1)
    still = environment_harmonics(Environment(radiance), 5)
    found = environment_harmonics(Environment(shifted), 5)
    degrees = -20 * 360 / 128
    assert np.allclose(rotated_about_y(still, degrees), found, atol=1e-9)
    turned = environment_harmonics(Environment(radiance, rotation=degrees), 5)
    assert np.allclose(turned, found, atol=1e-9)


def test_turns_follow_one_another():
    _, coefficients = band_limited(8, 4)
    one, two = any_rotation(3), any_rotation(4)
    assert np.allclose(
        rotated(rotated(coefficients, one), two), rotated(coefficients, two @ one), atol=1e-12
    )
    assert np.allclose(rotated(rotated(coefficients, one), one.T), coefficients, atol=1e-12)


def test_the_window_takes_the_ringing():
    radiance = sun_and_sky(64)
    plain = environment_harmonics(Environment(radiance), 6)
    soft = environment_harmonics(Environment(radiance), 6, window="hanning")
    assert np.allclose(soft, plain * hanning(6)[:, None])
    assert np.array_equal(soft[0], plain[0])
    basis = evaluate(normals(2000), 6)
    assert (basis @ plain).min() < 0
    assert (basis @ soft).min() > 0.2 * (basis @ plain).min()


def test_what_cannot_be_is_refused():
    environment = Environment(np.ones((4, 8, 3), np.float32))
    with pytest.raises(InvalidParameter, match="window 'hann'"):
        environment_harmonics(environment, 2, window="hann")
    with pytest.raises(InvalidParameter, match="order 7"):
        environment_harmonics(environment, 7)
    with pytest.raises(InvalidParameter, match="5 coefficients"):
        rotated(np.zeros((5, 3)), np.eye(3))
    with pytest.raises(InvalidParameter, match="no rotation"):
        rotated(np.zeros((4, 3)), 2 * np.eye(3))
    with pytest.raises(InvalidParameter, match="no rotation"):
        rotated(np.zeros((4, 3)), np.full((3, 3), np.nan))
