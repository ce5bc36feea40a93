"""The paper's quadrature sums solid angles exactly and comes to the analytic coefficients."""

import numpy as np
import pytest

from btfcore.btf.directions import layout, rings
from btfcore.btf.harmonics.basis import evaluate
from btfcore.btf.harmonics.cubemap import cube_texels, light_angles, quadrature, smooth_shading
from btfcore.errors import InvalidParameter

# zonal coefficients of max(z, 0): ∫ of the cosine against Y_l0, by hand
LOBE = {
    0: np.sqrt(np.pi) / 2,
    1: np.sqrt(np.pi / 3),
    2: np.sqrt(5 * np.pi) / 8,
    3: 0.0,
    4: -np.sqrt(np.pi) / 16,
    5: 0.0,
    6: np.sqrt(13 * np.pi) / 128,
}


def cosine_lobe():
    expected = np.zeros(49)
    for degree, value in LOBE.items():
        expected[degree * degree + degree] = value
    return expected


@pytest.mark.parametrize("side", [2, 6, 32])
def test_solid_angles(side):
    directions, angles = cube_texels(side)
    assert len(directions) == 3 * side * side and (directions[:, 2] > 0).all()
    assert angles.sum() == pytest.approx(2 * np.pi, rel=1e-13)
    assert len(np.unique(np.round(directions, 9), axis=0)) == len(directions)
    top = angles[: side * side].sum()
    assert top == pytest.approx(2 * np.pi / 3, rel=1e-13)  # one face of six
    np.testing.assert_allclose((directions * angles[:, None]).sum(axis=0)[:2], 0, atol=1e-12)


def test_a_finer_cube_comes_to_the_cosine_lobe_with_the_square_of_its_side():
    errors = []
    for side in (8, 16, 32, 64):
        directions, angles = cube_texels(side)
        found = evaluate(directions, 6).T @ (angles * directions[:, 2])
        errors.append(np.abs(found - cosine_lobe()).max())
    assert errors[-1] < 2e-4
    ratios = np.array(errors[:-1]) / errors[1:]
    assert ((ratios > 3.5) & (ratios < 4.5)).all()


@pytest.mark.parametrize("order", [2, 6])
def test_finer_lights_come_to_the_cosine_lobe(order):
    errors = []
    for count in (4, 8, 16):
        steps = np.arange(count + 1) / count
        lights = rings([(90 * s, max(1, 4 * count * i // count), 0) for i, s in enumerate(steps)])
        found = quadrature(lights, order, side=64) @ lights[:, 2]
        errors.append(np.abs(found - cosine_lobe()[: (order + 1) ** 2]).max())
    assert errors[0] > 2.5 * errors[1] > 5 * errors[2] and errors[2] < 5e-3


def test_a_mirrored_sky_has_even_functions_only():
    lights = layout("ubo151").lights
    found = quadrature(lights, 4, below="mirrored") @ np.ones(len(lights))
    expected = np.zeros(25)
    expected[0] = np.sqrt(4 * np.pi)
    np.testing.assert_allclose(found, expected, atol=2e-3)
    half = quadrature(lights, 4) @ np.ones(len(lights))
    assert half[0] == pytest.approx(np.sqrt(np.pi), rel=1e-12)
    assert half[2] == pytest.approx(
        np.sqrt(3 * np.pi) / 2, rel=1e-3
    )  # odd: the lower half is black


def test_hemispherical_constants():
    lights = layout("12x8x12x8").lights
    errors = []
    for side in (32, 64, 128):
        found = quadrature(lights, 5, "hemispherical", side=side) @ np.ones(len(lights))
        assert found[0] == pytest.approx(np.sqrt(2 * np.pi), rel=1e-12)
        errors.append(np.abs(found[1:]).max())
    assert errors[0] > 3.5 * errors[1] > 12 * errors[2]


def test_shading_is_exact_at_the_lights_and_sums_to_one():
    lights = layout("ubo81").lights
    index, weights = smooth_shading(lights, lights)
    assert (index[np.arange(81), weights.argmax(axis=1)] == np.arange(81)).all()
    np.testing.assert_allclose(weights.max(axis=1), 1, atol=1e-8)
    directions, _ = cube_texels(16)
    _, weights = smooth_shading(lights, directions)
    assert (weights >= 0).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_lights_still_make_an_integral(count):
    lights = rings([(30, count, 10)])
    found = quadrature(lights, 2) @ np.full(count, 3.0)
    assert found[0] == pytest.approx(3 * np.sqrt(np.pi), rel=1e-12)


def test_solid_angles_of_lights():
    lights = layout("ubo151").lights
    angles = light_angles(lights)
    assert angles.sum() == pytest.approx(2 * np.pi, rel=1e-13)
    ring = angles[np.abs(lights[:, 2] - np.cos(np.radians(75))) < 1e-9]
    assert ring.min() > angles[:100].max()  # the last ring has the horizon to itself
    dense = rings([(theta, max(1, 4 * theta // 6), 0) for theta in range(0, 91, 6)])
    assert (light_angles(dense) * dense[:, 2]).sum() == pytest.approx(np.pi, rel=0.005)


@pytest.mark.parametrize(
    "knob", [{"side": 7}, {"side": 0}, {"side": 1000}, {"below": "grey"}, {"order": 9}]
)
def test_knobs_out_of_range(knob):
    with pytest.raises(InvalidParameter, match=str(next(iter(knob.values())))):
        quadrature(layout("ubo81").lights, **{"order": 2, **knob})
