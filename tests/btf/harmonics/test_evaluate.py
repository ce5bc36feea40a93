"""Images come back by equation (1), between views as weighted sums, black below the horizon."""

import numpy as np
import pytest

from btfcore.btf.harmonics.basis import evaluate
from btfcore.btf.harmonics.evaluate import (
    HarmonicStack,
    blended_radiance,
    blended_weights,
    harmonic_radiance,
)
from btfcore.btf.harmonics.fit import fit_harmonics
from btfcore.btf.harmonics.values import HarmonicFactors
from btfcore.btf.stack import ImageStack
from btfcore.errors import InvalidBtf, InvalidParameter
from tests.btf.harmonics.scenes import bumpy, few_views

LIGHTS = np.array([[0.0, 0, 1], [0.6, 0, 0.8], [0, -0.8, 0.6], [0.48, 0.64, 0.6]])


@pytest.fixture(scope="module")
def factors():
    return fit_harmonics(bumpy(few_views("12x5x12x5", 3), 6), order=3, components=5)


def test_equation_one(factors):
    coefficients = factors.mean + np.einsum(
        "ijk,kmc->ijmc", factors.weights[1].astype(float), factors.components
    )
    expected = np.einsum("lm,ijmc->lijc", evaluate(LIGHTS, 3), coefficients)
    assert (expected > 0).all()
    np.testing.assert_allclose(harmonic_radiance(factors, 1, LIGHTS), expected, rtol=1e-5)


def test_lights_below_the_horizon_are_black_and_nothing_is_negative(factors):
    low = np.array([[0.6, 0, -0.8], [1.0, 0, -1e-6]])
    images = harmonic_radiance(factors, 0, low)
    assert (images[0] == 0).all() and (images[1] >= 0).all()
    shifted = HarmonicFactors(
        "dark", factors.weights, factors.components, factors.mean - 1, factors.views, 3,
        "spherical", factors.variances,
    )  # fmt: skip
    images = harmonic_radiance(shifted, 0, LIGHTS)
    assert (images == 0).any() and (images >= 0).all()


def test_three_views_blend_as_the_sum_of_their_functions(factors):
    shares = [0.2, 0.5, 0.3]
    one = blended_radiance(factors, [0, 1, 2], shares, LIGHTS)
    each = [harmonic_radiance(factors, view, LIGHTS) for view in range(3)]
    expected = sum(share * image for share, image in zip(shares, each, strict=True))
    np.testing.assert_allclose(one, expected, rtol=2e-5)
    np.testing.assert_array_equal(blended_weights(factors, [2], [1.0]), factors.weights[2])


def test_the_stack_is_every_view_under_every_light(factors):
    stack = HarmonicStack(factors, LIGHTS)
    assert isinstance(stack, ImageStack) and stack.shape == (12, 6, 6) and stack.dear
    images = stack.read([11, 0, 5, 4])
    for image, (view, light) in zip(images, [(2, 3), (0, 0), (1, 1), (1, 0)], strict=True):
        expected = harmonic_radiance(factors, view, LIGHTS[light : light + 1])[0]
        np.testing.assert_array_equal(image, expected)
    chosen = HarmonicStack(factors, LIGHTS, np.array([[2, 0], [0, 3]]))
    np.testing.assert_array_equal(chosen.read([1]), stack.read([3]))


@pytest.mark.parametrize(
    "views, shares, text",
    [
        ([3], [1.0], "out of 0 … 2"),
        ([-1], [1.0], "out of 0 … 2"),
        ([0, 1], [0.5, 0.6], "sum to 1"),
        ([0, 1], [1.5, -0.5], "sum to 1"),
        ([0, 1], [1.0], "shares"),
        ([0], [np.nan], "sum to 1"),
    ],
)
def test_views_and_shares_are_checked(factors, views, shares, text):
    with pytest.raises(InvalidParameter, match=f"bumpy: .*{text}"):
        blended_weights(factors, views, shares)


@pytest.mark.parametrize("lights", [[[0, 0, 2.0]], [[np.nan, 0, 1]], [[0.0, 1]], np.empty((0, 3))])
def test_lights_are_checked(factors, lights):
    with pytest.raises(InvalidParameter, match="bumpy: light"):
        harmonic_radiance(factors, 0, lights)


def test_pairs_are_checked(factors):
    with pytest.raises(InvalidParameter, match="3 views and 4 lights"):
        HarmonicStack(factors, LIGHTS, np.array([[0, 4]]))


def test_factors_are_locked_and_checked(factors):
    with pytest.raises(ValueError, match="read-only"):
        factors.components[0] = 0
    with pytest.raises(InvalidBtf, match=r"components of shape \(5, 16, 3\), not \(5, 25, 3\)"):
        HarmonicFactors(
            "odd", factors.weights, factors.components, factors.mean, factors.views, 4,
            "spherical", factors.variances,
        )  # fmt: skip
    with pytest.raises(InvalidBtf, match="float64"):
        HarmonicFactors(
            "odd", factors.weights.astype(float), factors.components, factors.mean,
            factors.views, 3, "spherical", factors.variances,
        )  # fmt: skip
