"""Measured materials: the carpet's brightness over all 151 × 151 pairs, and the relit leaf."""

import numpy as np
import pytest

from btfcore.btf.directions import layout
from btfcore.btf.harmonics.evaluate import HarmonicStack
from btfcore.btf.harmonics.fit import fit_harmonics
from btfcore.btf.materialize import materialize
from btfcore.btf.readers.ptm import read_ptm
from btfcore.btf.sample import cropped, subset
from tests.btf.harmonics.scenes import carpet


@pytest.fixture(scope="module")
def measured(data):
    return carpet(data, np.arange(0, 151, 7))


def test_the_carpet_is_brown_and_darker_under_low_lights(measured):
    colours = measured.stack.read(np.arange(measured.images)).reshape(22, 151, 3)
    assert (colours > 0).all()
    red, green, blue = colours.mean(axis=(0, 1))
    assert 0.15 > red > green > blue > 0.02
    high, low = colours[0, 1:7].mean(), colours[0, -24:].mean()
    assert 0.1 < low / high < 0.5  # the cosine of 75° is 0.26 times that of 11°


@pytest.mark.parametrize("kind", ["spherical", "hemispherical"])
def test_the_error_on_the_carpet_falls_with_the_order(measured, kind):
    errors = [
        fit_harmonics(measured, order=order, kind=kind, singular="regularise").errors
        for order in (2, 3, 4, 5, 6)
    ]
    assert (np.diff([error.truncation for error in errors]) < 0).all()
    assert errors[2].total < 0.06 and errors[2].srgb < 0.01
    assert errors[0].truncation > 1.3 * errors[-1].truncation


def test_lights_that_were_not_fitted_are_predicted(measured):
    """Every fifth light is left out; what the others say of it is near what was measured."""
    held = np.arange(4, 151, 5)
    rest = np.setdiff1d(np.arange(151), held)
    found = fit_harmonics(subset(measured, np.arange(22), rest), order=4, kind="hemispherical")
    truth = subset(measured, np.arange(22), held)
    stack = HarmonicStack(found, truth.lights, truth.pairs())
    images = np.arange(truth.images)
    whole = truth.stack.read(images).astype(float)
    error = np.linalg.norm(stack.read(images) - whole) / np.linalg.norm(whole)
    assert found.errors.total < error < 0.1


def test_the_leaf_is_nearly_of_order_four(data):
    """A PTM is a parabola in the light's coordinates, cut at 0: near to order 2, nearer to 4."""
    lights = layout("ubo81").lights
    leaf = read_ptm(data / "btf" / "rti_leaf_lrgb_ptm_512", lights=lights, colour="linear")
    leaf = materialize(cropped(leaf, slice(200, 232), slice(200, 232)))
    found = [fit_harmonics(leaf, order=order, components=24).errors for order in (2, 4)]
    assert found[1].truncation < 0.6 * found[0].truncation
    assert found[1].truncation < 0.02 and found[1].total < 0.03
