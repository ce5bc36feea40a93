"""The rank that a wanted error takes, and the knee that highlights call for."""

import numpy as np
import pytest

from btfcore.btf.factor import rank as ranks
from btfcore.btf.factor.errors import factor_errors
from btfcore.btf.factor.knee import choose_knee
from btfcore.btf.factor.optimum import optimal_errors
from btfcore.btf.factor.svd import factorize
from btfcore.btf.sample import Encoding
from btfcore.btf.stack import ArrayStack
from btfcore.errors import InvalidParameter
from tests.btf.factor.sets import material, sample_of


@pytest.mark.parametrize(("goal", "some"), [(0.05, 40), (0.02, 5), (0.008, 10_000)])
def test_the_fewest_factors_that_meet_the_goal_are_kept(goal, some, monkeypatch):
    monkeypatch.setattr(ranks, "SUBSET", some)
    sample = material(16)
    factors = factorize(sample, rank="auto", rmse=goal)
    assert 1 < factors.rank < 120 and factors.notes == ()
    assert factor_errors(sample, factors).srgb_rmse <= goal
    assert factor_errors(sample, factors, rank=factors.rank - 1).srgb_rmse > goal


def test_a_goal_out_of_reach_is_said_to_be_so(monkeypatch):
    monkeypatch.setattr("btfcore.btf.factor.svd.CAP", 7)
    sample = material(16)
    factors = factorize(sample, rank="auto", rmse=0.001)
    assert factors.rank == 7
    reached = factor_errors(sample, factors).srgb_rmse
    assert f"7 factors reach a mean sRGB RMSE of {reached:.4f}, not the 0.001" in factors.notes[0]


def test_a_flat_sample_needs_no_factor():
    sample = sample_of(np.full((20, 5, 5, 3), 0.3, np.float32))
    assert factorize(sample, rank="auto").rank == 0
    assert factorize(sample_of(np.ones((1, 5, 5, 3), np.float32)), rank="auto").rank == 3


def test_a_knee_is_for_heavy_highlights_only():
    dull = choose_knee(material(12, shine=0.1).stack)
    assert dull.knee is None and dull.energy < 0.05
    images = np.random.default_rng(0).uniform(0, 0.9, (100, 10, 10, 3)).astype(np.float32)
    images.reshape(-1)[::1000] = 200.0
    found = choose_knee(ArrayStack(images))
    assert found.knee == 1.0
    assert found.values == pytest.approx(0.001, rel=1e-6) and found.peak == 200
    squares = images.astype(np.float64) ** 2
    assert found.energy == pytest.approx(squares[images > 1].sum() / squares.sum(), rel=1e-6)
    assert found.values_seen == images.size
    bright = choose_knee(ArrayStack(images * 10))
    assert bright.above == pytest.approx(np.quantile(images * 10, 0.995), rel=1e-5)
    assert choose_knee(ArrayStack(images), above=300.0).knee is None
    assert choose_knee(ArrayStack(np.zeros((5, 3, 3, 3), np.float32))).energy == 0


def test_the_optimum_is_that_of_the_singular_values():
    generator = np.random.default_rng(1)
    images = generator.random((30, 4, 5, 3)).astype(np.float32)
    sample = sample_of(images)
    found = optimal_errors(sample, [0, 3, 20], Encoding("linear"), centred=False)
    matrix = images.transpose(1, 2, 0, 3).reshape(20, 90).astype(np.float64)
    left, values, right = np.linalg.svd(matrix, full_matrices=False)
    best = (left[:, :3] * values[:3]) @ right[:3]
    norm = np.linalg.norm(matrix)
    assert found == pytest.approx([1, np.linalg.norm(matrix - best) / norm, 0], abs=1e-7)
    assert optimal_errors(sample, [3], Encoding("linear"))[0] < found[1]
    wide = sample_of(np.ones((2000, 65, 65, 3), np.uint8))
    with pytest.raises(InvalidParameter, match="4225 texels"):
        optimal_errors(wide, [3], Encoding())
