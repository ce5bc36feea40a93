"""Sub-texel registration of placements."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from btfcore.quilt.register import register


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
