"""Bending a flattened patch along its field."""

from __future__ import annotations

import numpy as np
import pytest

from btfcore.patch.bend import bent, fit_bend


def disk(radius: int = 20) -> np.ndarray:
    """Integer points (n, 2) f8 of a disk, its centre first."""
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1].astype(np.float64)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    points = points[(points**2).sum(axis=1) <= radius**2]
    return points[np.argsort((points**2).sum(axis=1), kind="stable")]


def field(plane: np.ndarray, gradient: complex) -> np.ndarray:
    """Unit directions that turn by `gradient` radians per step along x and along y."""
    return np.exp(1j * (plane[:, 0] * gradient.real + plane[:, 1] * gradient.imag))


def left_over(plane: np.ndarray, direction: np.ndarray, bend: complex) -> np.ndarray:
    """Angles of the bent field about their mean, from the map's own derivative."""
    z = plane[:, 0] + 1j * plane[:, 1]
    turned = direction * (1 + 2 * bend * z)
    turned /= np.abs(turned)
    return np.angle(turned * np.conj(turned.mean() / abs(turned.mean())))


@pytest.mark.parametrize("gradient", [0.004, 0.004j, 0.003 - 0.002j])
def test_an_evenly_turning_field_is_straightened(gradient: complex) -> None:
    """The field after the bend turns by less than a tenth of what it did."""
    plane = disk()
    direction = field(plane, gradient)
    bend, left = fit_bend(direction, plane, np.ones(len(plane), bool), len(plane), 0.3)
    before = np.abs(left_over(plane, direction, 0)).max()
    after = np.abs(left_over(plane, direction, bend)).max()
    assert after < 0.1 * before
    assert left < 0.1 * before


def test_lengths_change_no_more_than_allowed() -> None:
    """However fast the field turns, the rim's lengths change by the bound at most."""
    plane = disk()
    direction = field(plane, 0.05)
    bend, left = fit_bend(direction, plane, np.ones(len(plane), bool), len(plane), 0.1)
    z = plane[:, 0] + 1j * plane[:, 1]
    assert np.abs(np.abs(1 + 2 * bend * z) - 1).max() <= 0.1 + 1e-9
    assert left > 0.1  # and the caller is told what is left


def test_the_map_is_the_one_its_derivative_belongs_to() -> None:
    """Finite differences of `bent` equal 1 + 2 a z."""
    plane = disk(6)
    bend = 0.003 - 0.002j
    z = plane[:, 0] + 1j * plane[:, 1]
    step = 1e-5
    moved = bent(plane + [step, 0.0], bend) - bent(plane, bend)
    assert np.allclose((moved[:, 0] + 1j * moved[:, 1]) / step, 1 + 2 * bend * z, atol=1e-6)
    assert np.allclose(bent(plane, bend)[0], 0.0)


def test_nothing_to_go_by_leaves_the_patch_alone() -> None:
    """No bare vertices, a field without a mean, points on a line: no bend."""
    plane = disk(5)
    none = np.zeros(len(plane), bool)
    assert fit_bend(field(plane, 0.01), plane, none, len(plane), 0.1) == (0j, 0.0)
    opposite = np.where(np.arange(len(plane)) % 2 == 0, 1.0 + 0j, -1.0 + 0j)
    opposite = opposite[: len(plane) // 2 * 2]
    all_of = np.ones(len(opposite), bool)
    assert fit_bend(opposite, plane, all_of, len(opposite), 0.1)[0] == 0
    line = np.stack([np.arange(9.0), np.zeros(9)], axis=1)
    bend, _ = fit_bend(field(line, 0.02), line, np.ones(9, bool), 9, 0.1)
    assert bend == 0
