"""Sub-texel registration of placements."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from btfcore.quilt.register import fit_warp, register, solve, warped


def smooth_sample(channels: int = 2, seed: int = 0) -> np.ndarray:
    """Smooth noise (64, 64, channels) f4."""
    noise = np.random.default_rng(seed).standard_normal((64, 64, channels))
    layers = [gaussian_filter(noise[..., k], 2.0) for k in range(channels)]
    return (np.stack(layers, axis=2) * 10).astype(np.float32)


def seen_at(match: np.ndarray, spun: np.ndarray, at: tuple[float, float, float]) -> np.ndarray:
    """Bilinear values of the sample where a placement puts the vertices: the numpy twin."""
    turned = (spun[:, 0] - 1j * spun[:, 1]) * np.exp(1j * at[2])
    column, row = at[0] + turned.real, at[1] - turned.imag
    layers = [map_coordinates(match[..., k], [row, column], order=1) for k in range(match.shape[2])]
    return np.stack(layers, axis=1).astype(np.float32)


@pytest.mark.parametrize(
    ("true", "start"),
    [
        ((30.4, 32.7, 0.0), (30.0, 33.0, 0.0)),
        ((30.4, 32.7, 0.03), (31.0, 32.0, 0.0)),
        ((25.6, 38.1, 0.48), (26.0, 38.0, 0.5)),
    ],
)
def test_the_true_placement_is_found(true, start) -> None:  # type: ignore[no-untyped-def]
    """Values cut out at a fractional placement lead back to it."""
    match = smooth_sample()
    spun = np.random.default_rng(1).uniform(-12, 12, (400, 2))
    found = register(match, spun, seen_at(match, spun, true), start, 1.5, 0.1, 10)
    assert np.allclose(found[:2], true[:2], atol=0.02)
    assert abs(found[2] - true[2]) < 0.002
    assert found[3] < 1e-3


def test_it_never_gets_worse_and_stays_near() -> None:
    """The mean SSD returned is true, no larger than at the start, and the bounds are kept."""
    match = smooth_sample()
    random = np.random.default_rng(2)
    for _ in range(20):
        spun = random.uniform(-10, 10, (200, 2))
        values = seen_at(match, spun, (random.uniform(20, 40), random.uniform(20, 40), 0.0))
        start = (random.uniform(20, 40), random.uniform(20, 40), random.uniform(-1, 1))
        column, row, turn, cost = register(match, spun, values, start, 1.5, 0.05, 6)
        assert abs(column - start[0]) <= 1.5 + 1e-12
        assert abs(row - start[1]) <= 1.5 + 1e-12
        assert abs(turn - start[2]) <= 0.05 + 1e-12
        before = ((seen_at(match, spun, start) - values) ** 2).sum(axis=1).mean()
        after = ((seen_at(match, spun, (column, row, turn)) - values) ** 2).sum(axis=1).mean()
        assert cost <= before * (1 + 1e-5)
        assert cost == pytest.approx(after, rel=1e-4, abs=1e-6)


def test_nothing_to_go_by() -> None:
    """A constant sample stays where it was; no vertex inside the sample says so."""
    flat = np.ones((16, 16, 3), np.float32)
    spun = np.random.default_rng(3).uniform(-3, 3, (50, 2))
    found = register(flat, spun, np.ones((50, 3), np.float32), (8.0, 8.0, 0.2), 1.5, 0.1, 6)
    assert found == (8.0, 8.0, 0.2, 0.0)
    outside = register(flat, spun + 100, np.ones((50, 3), np.float32), (8.0, 8.0, 0.0), 1, 0.1, 6)
    assert outside == (8.0, 8.0, 0.0, np.inf)


WARP = np.array([30.4, 32.7, 0.02, 0.03, 0.04, -0.02, -0.01, 0.03])


def test_a_warp_and_its_turns_are_those_of_its_formula() -> None:
    """Places follow the polynomial; rotations are the polar factors of finite differences."""
    random = np.random.default_rng(4)
    plane = random.uniform(-12, 12, 50) + 1j * random.uniform(-12, 12, 50)
    place, turn = warped(plane, WARP, 17.0)
    spin, bend, shear = np.exp(1j * WARP[2]), WARP[4] + 1j * WARP[5], WARP[6] + 1j * WARP[7]
    there = spin * ((1 + WARP[3]) * plane + bend * plane**2 / 17.0 + shear * plane.conj())
    assert np.allclose(place[:, 0], WARP[0] + there.real)
    assert np.allclose(place[:, 1], WARP[1] - there.imag)
    step = 1e-5
    for index in range(5):
        moved = [warped(plane[index : index + 1] + d, WARP, 17.0)[0][0] for d in (step, 1j * step)]
        columns = [(m - place[index]) * [1, -1] / step for m in moved]  # y up
        u, _, v = np.linalg.svd(np.stack(columns, axis=1))
        rotation = u @ v
        assert np.allclose([turn[index].real, turn[index].imag], rotation[:, 0], atol=1e-4)


def test_a_warp_is_found_and_bounded() -> None:
    """Values seen through a warp lead back to it; no part leaves its bound."""
    match = smooth_sample()
    random = np.random.default_rng(5)
    plane = random.uniform(-12, 12, 600) + 1j * random.uniform(-12, 12, 600)
    place, _ = warped(plane, WARP, 17.0)
    layers = [map_coordinates(match[..., k], place.T[::-1], order=1) for k in range(2)]
    values = np.stack(layers, axis=1).astype(np.float32)
    start = np.array([30.0, 33.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    found, cost = fit_warp(match, plane, values, start, 17.0, 1.5, 0.1, 0.1, 12)
    _, rigid = fit_warp(match, plane, values, start, 17.0, 1.5, 0.1, 0.0, 12)
    assert cost < 0.02 * rigid
    assert np.abs(found - WARP).max() < 0.02
    tight, _ = fit_warp(match, plane, values, start, 17.0, 1.5, 0.1, 0.01, 12)
    assert np.abs(tight[3:]).max() <= 0.01


def test_small_systems_are_solved() -> None:
    """Cholesky agrees with numpy and refuses what is not positive."""
    random = np.random.default_rng(6)
    root = random.standard_normal((8, 8))
    matrix, right, out = root @ root.T + 0.1 * np.eye(8), random.standard_normal(8), np.zeros(8)
    assert solve(matrix, right, 8, out)
    assert np.allclose(out, np.linalg.solve(matrix, right))
    assert not solve(-matrix, right, 8, out)
