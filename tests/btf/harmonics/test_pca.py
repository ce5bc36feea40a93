"""Axes are those of numpy's SVD; what they leave is the sum of the other variances."""

import numpy as np
import pytest

from btfcore.btf.harmonics.pca import Moments, principal_axes

RNG = np.random.default_rng(11)
SPREAD = 0.7 ** np.arange(12)
VECTORS = RNG.normal(size=(12, 12)) @ (SPREAD[:, None] * RNG.normal(size=(12, 400))) + 5


def gathered(vectors, cuts=()):
    moments = Moments(len(vectors))
    for part in np.split(vectors, cuts, axis=1):
        moments.add(np.ascontiguousarray(part))
    return moments


def left_over(axes, vectors, metric=None):
    """Mean squared distance between vectors and what the axes keep of them."""
    centred = vectors - axes.mean[:, None]
    rest = centred - axes.decode @ (axes.encode @ centred)
    return ((rest if metric is None else metric @ rest) ** 2).sum(axis=0).mean()


def test_blocks_change_nothing():
    once, often = gathered(VECTORS), gathered(VECTORS, [1, 7, 7, 100, 399])
    np.testing.assert_allclose(often.mean, once.mean, rtol=1e-13)
    np.testing.assert_allclose(often.scatter, once.scatter, rtol=1e-11)
    np.testing.assert_allclose(once.mean, VECTORS.mean(axis=1), rtol=1e-13)
    np.testing.assert_allclose(once.scatter, np.cov(VECTORS) * 399, rtol=1e-11)
    assert once.count == often.count == 400


def test_a_large_common_value_costs_no_digits():
    small = RNG.normal(size=(3, 500))
    moments = gathered(small + 1e8, [100, 300])
    np.testing.assert_allclose(moments.scatter, gathered(small).scatter, rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("centred", [True, False])
@pytest.mark.parametrize("rank", [1, 4, 12])
def test_what_is_left_is_the_sum_of_the_other_variances(rank, centred):
    axes = principal_axes(gathered(VECTORS, [123]), rank, centred=centred)
    assert axes.decode.shape == (12, rank) and (np.diff(axes.variances) <= 0).all()
    expected = axes.variances[rank:].sum()
    assert left_over(axes, VECTORS) == pytest.approx(expected, rel=1e-9, abs=1e-12)
    np.testing.assert_allclose(axes.decode.T @ axes.decode, np.eye(rank), atol=1e-12)
    shifted = VECTORS - VECTORS.mean(axis=1, keepdims=True) if centred else VECTORS
    singular = np.linalg.svd(shifted, compute_uv=False)
    np.testing.assert_allclose(axes.variances, singular**2 / 400, rtol=1e-9)
    assert (axes.mean == 0).all() != centred


def test_a_metric_is_what_the_axes_are_best_in():
    metric = RNG.normal(size=(20, 12))
    plain = principal_axes(gathered(VECTORS), 3)
    axes = principal_axes(gathered(VECTORS), 3, metric=metric)
    expected = axes.variances[3:].sum()
    assert left_over(axes, VECTORS, metric) == pytest.approx(expected, rel=1e-9)
    assert left_over(plain, VECTORS, metric) > 1.01 * expected
    weights = axes.encode @ (VECTORS - axes.mean[:, None])
    kept = metric @ axes.decode @ weights
    between = np.linalg.norm(kept[:, :50] - kept[:, 50:100], axis=0)
    np.testing.assert_allclose(
        np.linalg.norm(weights[:, :50] - weights[:, 50:100], axis=0), between, rtol=1e-10
    )


def test_a_metric_that_does_not_see_some_directions():
    metric = np.eye(12)[:5]
    axes = principal_axes(gathered(VECTORS), 12, metric=metric)
    assert axes.decode.shape == (12, 5)
    assert left_over(axes, VECTORS, metric) < 1e-20
    assert (axes.decode[5:] == 0).all()


def test_fewer_vectors_than_components():
    axes = principal_axes(gathered(VECTORS[:, :4]), 10)
    assert axes.decode.shape == (12, 3)
    assert left_over(axes, VECTORS[:, :4]) < 1e-20


def test_vectors_that_are_all_the_same_have_one_axis_and_no_weight():
    axes = principal_axes(gathered(np.full((12, 9), 2.5)), 5)
    assert axes.decode.shape == (12, 1) and (axes.variances == 0).all()
    np.testing.assert_allclose(axes.mean, 2.5)
