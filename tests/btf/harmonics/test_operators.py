"""Least squares are least, come back to harmonics exactly, and answer to the ridge."""

import numpy as np
import pytest

from btfcore.btf.directions import layout
from btfcore.btf.harmonics.basis import evaluate, functions
from btfcore.btf.harmonics.cubemap import light_angles
from btfcore.btf.harmonics.operators import (
    FitParameters,
    coefficients,
    least_squares,
    view_operators,
)
from btfcore.errors import InvalidBtf, InvalidParameter
from tests.btf.harmonics.scenes import bumpy, few_views, without

RNG = np.random.default_rng(8)
SUFFICIENT = [
    ("12x8x12x8", 4, "spherical"),
    ("12x8x12x8", 5, "hemispherical"),
    ("ubo81", 4, "spherical"),
    ("ubo151", 4, "spherical"),
    ("ubo151", 6, "hemispherical"),
]


@pytest.mark.parametrize("name, order, kind", SUFFICIENT)
def test_functions_of_the_band_come_back_exactly(name, order, kind):
    lights = layout(name).lights
    truth = RNG.normal(size=(functions(order), 2, 3))
    radiance = np.einsum("lm,mij->lij", evaluate(lights, order, kind), truth)
    found = coefficients(radiance, lights, FitParameters(order, kind, ridge=0))
    np.testing.assert_allclose(found, truth, atol=2e-11)


def test_order_six_on_the_151_directions_comes_back_where_it_is_asked_for():
    """The condition, 1.7e5, is past the limit for noisy data but harmless for exact values."""
    lights = layout("ubo151").lights
    truth = RNG.normal(size=functions(6))
    found = least_squares(lights, 6, ridge=0, limit=1e6) @ (evaluate(lights, 6) @ truth)
    np.testing.assert_allclose(found, truth, atol=1e-9)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("ridge", [0.0, 1e-3])
def test_the_gradient_vanishes_at_the_solution(weighted, ridge):
    lights = layout("ubo81").lights
    weights = light_angles(lights) if weighted else np.ones(81)
    values, radiance = evaluate(lights, 3), RNG.uniform(size=81)
    found = least_squares(lights, 3, ridge=ridge, weights=weights) @ radiance
    penalty = ridge * np.trace(values.T @ (values * weights[:, None])) / 16
    slope = values.T @ (weights * (values @ found - radiance)) + penalty * found
    assert np.abs(slope).max() < 1e-12


def test_a_larger_ridge_fits_worse_with_smaller_coefficients():
    lights = layout("12x8x12x8").lights
    values, radiance = evaluate(lights, 4), RNG.uniform(size=96)
    residuals, sizes = [], []
    for ridge in (0, 1e-6, 1e-4, 1e-2, 1, 100):
        found = least_squares(lights, 4, ridge=ridge) @ radiance
        residuals.append(np.linalg.norm(values @ found - radiance))
        sizes.append(np.linalg.norm(found))
    assert (np.diff(residuals) > 0).all() and (np.diff(sizes) < 0).all()


def test_regularised_combinations_give_the_smallest_solution():
    lights = layout("12x8x12x8").lights
    values = evaluate(lights, 6, "hemispherical")
    radiance = values @ RNG.normal(size=49)
    found = least_squares(lights, 6, "hemispherical", ridge=0)
    expected = np.linalg.pinv(values, rcond=1e-4) @ radiance
    np.testing.assert_allclose(found @ radiance, expected, atol=1e-10)
    assert abs((found @ radiance)[6 * 6 + 6 - 6]) < 1e-12  # sin 6φ


def test_a_cosine_lobe_survives_both_ways_of_fitting():
    lights = layout("ubo151").lights
    for parameters in (
        FitParameters(4),
        FitParameters(4, weighting="solid_angle"),
        FitParameters(5, "hemispherical"),
        FitParameters(4, quadrature="cubemap", below="mirrored"),
    ):
        found = coefficients(lights[:, 2], lights, parameters)
        again = evaluate(lights, parameters.order, parameters.kind) @ found
        assert np.abs(again - lights[:, 2]).max() < 0.1


def test_views_with_the_same_lights_share_their_operator():
    sample = bumpy(few_views("ubo81"), 2)
    operators, notes = view_operators(sample, FitParameters(3))
    assert operators[0].solve is operators[2].solve and notes == ()
    np.testing.assert_array_equal(operators[1].images, sample.index[1])


def test_missing_images_are_left_out_of_their_view_only():
    whole = bumpy(few_views("ubo81"), 2)
    sample = without(whole, [(1, 5), (1, 44)])
    operators, notes = view_operators(sample, FitParameters(3))
    assert len(operators[1].lights) == 79 and not {5, 44} & set(operators[1].lights)
    expected = least_squares(sample.lights[operators[1].lights], 3)
    np.testing.assert_array_equal(operators[1].solve, expected)
    np.testing.assert_array_equal(
        sample.stack.read(operators[1].images), whole.stack.read(81 + operators[1].lights)
    )
    assert "2 images are missing" in notes[0]


def test_a_view_with_too_few_images_is_named():
    sample = without(bumpy(few_views("ubo81"), 2), [(2, k) for k in range(10, 81)])
    with pytest.raises(InvalidParameter, match="bumpy: view 2, 71 images missing: .*10 lights"):
        view_operators(sample, FitParameters(3))
    _, notes = view_operators(sample, FitParameters(3, singular="regularise"))
    assert "10 lights" in notes[0] and "regularised" in notes[0]


def test_a_view_without_images_is_refused_in_any_case():
    sample = without(bumpy(few_views("ubo81"), 2), [(1, k) for k in range(81)])
    with pytest.raises(InvalidBtf, match="view 1 has no image"):
        view_operators(sample, FitParameters(0, singular="regularise"))


@pytest.mark.parametrize(
    "knob",
    [{"ridge": -1.0}, {"ridge": float("nan")}, {"quadrature": "magic"}, {"weighting": "heavy"}],
)
def test_knobs_out_of_range(knob):
    with pytest.raises(InvalidParameter, match=str(next(iter(knob.values())))):
        FitParameters(**knob)


def test_values_and_lights_are_checked():
    broken = np.ones(81)
    broken[[3, 5]] = np.nan, np.inf
    with pytest.raises(InvalidParameter, match="felt: 2 of 81 values are not finite"):
        coefficients(broken, layout("ubo81").lights, name="felt")
    with pytest.raises(InvalidParameter, match="light 0 is no unit vector, its length is nan"):
        coefficients(np.ones(1), np.array([[np.nan, 0, 1]]))
    with pytest.raises(InvalidParameter, match="80 values for 81 lights"):
        coefficients(np.ones(80), layout("ubo81").lights)
