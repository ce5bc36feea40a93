"""Flattened patches in the field's frame."""

import numpy as np
import pytest

from btfcore.patch.connectivity import connect
from btfcore.patch.flatten import Flattener
from btfcore.quilt.lay import lay_along_field
from btfcore.types import Field
from tests.surfaces import constant_field, cylinder, plane, random_field, sphere


def laid(dense, field, *, seed=0, radius=10, bend=0.0, core=None):
    net = connect(dense, field)
    flattener = Flattener(dense, field, net)
    flat = flattener.flatten(seed, radius)
    lay = lay_along_field(net, flattener.local, flat, bend=bend, core=core)
    flattener.release(flat)
    return lay


def swirl(dense, strength):
    """Field whose direction turns with the column, `strength` radians per step."""
    angle = strength * (dense.vertices[:, 0] - dense.vertices[:, 0].mean())
    tangents = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    return Field(tangents.astype(np.float32), np.zeros((0, 3)))


MIDDLE = 20 * 50 + 25


@pytest.mark.parametrize("degrees", [0, 30, 135, -100])
def test_a_constant_field_lies_along_x(degrees):
    dense = plane()
    along = np.exp(1j * np.radians(degrees))
    lay = laid(dense, constant_field(dense, (along.real, along.imag, 0)), seed=MIDDLE)
    away = dense.vertices[lay.patch.order] - dense.vertices[MIDDLE]
    expected = (away[:, 0] + 1j * away[:, 1]) / along / dense.step
    assert np.allclose(lay.plane, expected, atol=1e-5)
    assert np.allclose(lay.turn, 1, atol=1e-5)
    assert lay.plane[0] == 0


def test_points_are_in_texels_and_keep_their_shape():
    dense = plane()
    lay = laid(dense, constant_field(dense), seed=MIDDLE)
    assert np.allclose(lay.points(2.5) * 2.5, lay.plane)
    assert len(lay.points(1.0)) == len(lay.patch.order)
    assert len(lay.turn) == lay.patch.inner < len(lay.patch.order)


def test_angles_are_those_between_field_and_sample():
    """A placement that turns its patch by θ has the sample's axis at -θ from the field."""
    dense = sphere(4)
    lay = laid(dense, constant_field(dense), seed=9, radius=6)
    whole = np.full(len(lay.patch.order), np.exp(0.3j))
    found = lay.angles(whole)
    assert found.shape == (lay.patch.inner,)
    expected = -np.angle(lay.turn) - 0.3
    assert np.allclose(np.exp(1j * found), np.exp(1j * expected))
    assert (found > -np.pi - 1e-12).all() and (found <= np.pi + 1e-12).all()


def test_the_median_direction_is_turned_to_x():
    dense = plane()
    lay = laid(dense, swirl(dense, 0.03), seed=MIDDLE)
    assert abs(np.median(np.angle(lay.turn))) < 0.02
    assert np.ptp(np.angle(lay.turn)) > 0.3


@pytest.mark.parametrize("strength", [0.01, 0.02, -0.02])
def test_bending_straightens_a_field_that_turns(strength):
    dense = plane()
    stiff = laid(dense, swirl(dense, strength), seed=MIDDLE)
    soft = laid(dense, swirl(dense, strength), seed=MIDDLE, bend=0.5)
    before, after = (np.abs(np.angle(each.turn)).mean() for each in (stiff, soft))
    assert after < 0.35 * before
    stretch = np.abs(soft.plane) / np.maximum(np.abs(stiff.plane), 1e-9)
    assert stretch[1:].max() < 1.26  # |1 + a z| with |2 a z| at most a half


def test_the_bend_is_bounded():
    dense = plane()
    strong = laid(dense, swirl(dense, 0.08), seed=MIDDLE, bend=0.1)
    stiff = laid(dense, swirl(dense, 0.08), seed=MIDDLE)
    stretch = np.abs(strong.plane[1:]) / np.abs(stiff.plane[1:])
    assert 1.02 < stretch.max() < 1.051 and 0.949 < stretch.min() < 0.98


def test_a_core_decides_alone():
    """With a core, only the directions at the first vertices are turned to +x."""
    dense = plane()
    field = swirl(dense, 0.05)
    tangents = field.tangents.copy()
    tangents[:, 0], tangents[:, 1] = np.cos(0.4), np.sin(0.4)
    near = np.abs(dense.vertices - dense.vertices[MIDDLE]).max(axis=1) <= 4
    tangents[near] = [1, 0, 0]
    lay = laid(dense, Field(tangents, np.zeros((0, 3))), seed=MIDDLE, core=9)
    assert np.allclose(lay.turn[:9], 1, atol=1e-5)
    whole = laid(dense, Field(tangents, np.zeros((0, 3))), seed=MIDDLE)
    assert np.angle(whole.turn[0]) < -0.3  # there the many outside have their way


def test_the_frame_turns_with_the_field():
    """Where the field is turned to the left, everything lies further to the right."""
    dense = cylinder()
    field = random_field(dense, 3)
    normals = dense.normals.astype(np.float64)
    turned = np.cross(normals, field.tangents.astype(np.float64))
    one = laid(dense, field, seed=30 * 60, radius=8)
    other = laid(dense, Field(turned.astype(np.float32), np.zeros((0, 3))), seed=30 * 60, radius=8)
    assert np.allclose(one.turn, other.turn, atol=1e-3)
    assert np.allclose(one.plane * -1j, other.plane, atol=1e-4)
