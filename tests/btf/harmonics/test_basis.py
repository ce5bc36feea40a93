"""Harmonics are orthonormal, turn within their bands, and are those of scipy."""

import numpy as np
import pytest
from scipy.special import eval_legendre, sph_harm_y

from btfcore.btf.harmonics.basis import degrees, evaluate, functions
from btfcore.errors import InvalidParameter

ORDER = 6


def quadrature(kind):
    """Directions and weights that integrate every product of two functions up to order 6."""
    node, weight = np.polynomial.legendre.leggauss(20)
    z = node if kind == "spherical" else (node + 1) / 2
    weight = weight if kind == "spherical" else weight / 2
    phi = 2 * np.pi * np.arange(32) / 32
    z, phi = (a.ravel() for a in np.meshgrid(z, phi, indexing="ij"))
    across = np.sqrt(1 - z * z)
    directions = np.stack([across * np.cos(phi), across * np.sin(phi), z], axis=1)
    return directions, np.repeat(weight, 32) * 2 * np.pi / 32


def scattered(count=200, seed=0):
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


@pytest.mark.parametrize("kind", ["spherical", "hemispherical"])
def test_orthonormal(kind):
    directions, weights = quadrature(kind)
    values = evaluate(directions, ORDER, kind)
    assert values.shape == (len(directions), functions(ORDER)) and functions(ORDER) == 49
    gram = values.T @ (values * weights[:, None])
    np.testing.assert_allclose(gram, np.eye(49), atol=2e-13)


def test_the_spherical_ones_are_those_of_scipy():
    directions = np.concatenate([scattered(), [[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, -1, 0]]])
    theta, phi = np.arccos(directions[:, 2]), np.arctan2(directions[:, 1], directions[:, 0])
    values = evaluate(directions, ORDER)
    for column, (degree, m) in enumerate(degrees(ORDER)):
        complex_one = sph_harm_y(degree, abs(m), theta, phi) * (-1) ** m
        part = complex_one.imag if m < 0 else complex_one.real
        expected = part * (np.sqrt(2) if m else 1)
        np.testing.assert_allclose(values[:, column], expected, atol=3e-14)


def test_the_first_ones_are_the_coordinates():
    directions = scattered()
    x, y, z = directions.T
    scale = np.sqrt(3 / (4 * np.pi))
    expected = np.stack(
        [np.full(len(x), np.sqrt(1 / (4 * np.pi))), scale * y, scale * z, scale * x]
    )
    np.testing.assert_allclose(evaluate(directions, 1), expected.T, atol=1e-15)


def test_the_hemispherical_ones_are_spherical_ones_of_a_stretched_angle():
    """Gautron et al. 2004: cos θ is replaced by 2 cos θ - 1, and the norm grows by √2."""
    upper = scattered() * (1, 1, 0) + np.abs(scattered()) * (0, 0, 1)
    phi = np.arctan2(upper[:, 1], upper[:, 0])
    z = 2 * upper[:, 2] - 1
    across = np.sqrt(1 - z * z)
    stretched = np.stack([across * np.cos(phi), across * np.sin(phi), z], axis=1)
    found = evaluate(upper, ORDER, "hemispherical")
    np.testing.assert_allclose(found, np.sqrt(2) * evaluate(stretched, ORDER), atol=1e-13)


def test_addition_theorem():
    one, two = scattered(50, 1), scattered(50, 2)
    first, second = evaluate(one, ORDER), evaluate(two, ORDER)
    cosine = (one * two).sum(axis=1)
    for degree in range(ORDER + 1):
        band = slice(degree**2, (degree + 1) ** 2)
        total = (first[:, band] * second[:, band]).sum(axis=1)
        expected = (2 * degree + 1) / (4 * np.pi) * eval_legendre(degree, cosine)
        np.testing.assert_allclose(total, expected, atol=1e-14)


@pytest.mark.parametrize("kind", ["spherical", "hemispherical"])
@pytest.mark.parametrize("angle", [0.3, 2.0, np.pi])
def test_turning_about_the_normal_mixes_pairs_of_a_band_only(kind, angle):
    upper = np.abs(scattered()) * np.array([1, 1, 1]) if kind == "hemispherical" else scattered()
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    before, after = evaluate(upper, ORDER, kind), evaluate(upper @ turn.T, ORDER, kind)
    for column, (degree, m) in enumerate(degrees(ORDER)):
        other = degree * degree + degree - m
        expected = np.cos(m * angle) * before[:, column] - np.sin(m * angle) * before[:, other]
        np.testing.assert_allclose(after[:, column], expected, atol=1e-13)


@pytest.mark.parametrize("kind", ["spherical", "hemispherical"])
def test_pole_and_horizon_need_no_care(kind):
    phi = np.linspace(0, 6, 7)
    near = np.stack([1e-9 * np.cos(phi), 1e-9 * np.sin(phi), np.ones(7)], axis=1)
    pole = evaluate(np.array([[0.0, 0, 1]]), ORDER, kind)[0]
    np.testing.assert_allclose(evaluate(near, ORDER, kind), np.tile(pole, (7, 1)), atol=1e-7)
    assert all(abs(value) == 0 for value, (_, m) in zip(pole, degrees(ORDER), strict=True) if m)
    horizon = np.stack([np.cos(phi), np.sin(phi), np.zeros(7)], axis=1)
    assert np.isfinite(evaluate(horizon, ORDER, kind)).all()


def test_hemispherical_ones_end_at_the_horizon():
    below = np.array([[0.6, 0.0, -0.8], [1.0, 0.0, -1e-5]])
    found = evaluate(below, 3, "hemispherical")
    expected = evaluate(below * (1, 1, 0), 3, "hemispherical")
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("order", [-1, 7, 2.5])
def test_orders_out_of_range_are_refused(order):
    with pytest.raises(InvalidParameter, match=f"order {order}.*0 … 6"):
        evaluate(np.array([[0.0, 0, 1]]), order)


def test_unknown_kinds_are_refused():
    with pytest.raises(InvalidParameter, match="cubic"):
        evaluate(np.array([[0.0, 0, 1]]), 2, "cubic")
