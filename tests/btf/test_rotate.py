"""Rotating the material rotates the sample: coordinates, directions, and images by both."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf.directions import angle_between, from_angles, layout, to_angles
from btfcore.btf.materialize import materialize
from btfcore.btf.rotate import copies, rotate_directions, rotated, rotation
from btfcore.btf.sample import BtfSample, from_picture
from btfcore.btf.stack import SubsetStack
from btfcore.errors import InvalidParameter
from tests.btf.interpolation.analytic import relief
from tests.btf.interpolation.sets import scattered

ANGLES = (0.0, 0.3, np.pi / 6, np.pi / 2, 2.0, np.pi, -1.1, 5.0)


def test_what_pointed_along_the_columns_points_along_the_angle():
    for angle in ANGLES:
        turned = rotation((20, 30), angle)
        start, stop = turned.to_copy([[14.5, 9.5], [15.5, 9.5]])
        np.testing.assert_allclose(
            stop - start, (np.cos(angle), -np.sin(angle)), atol=1e-12
        )  # rows run downwards
        np.testing.assert_allclose(start, (np.array(turned.extent[::-1]) - 1) / 2, atol=1e-12)


@pytest.mark.parametrize("fit", ["all", "inside"])
@pytest.mark.parametrize("angle", ANGLES)
def test_the_way_there_and_back_is_the_identity(angle, fit):
    turned = rotation((7, 12), angle, fit=fit)
    position = np.random.default_rng(0).uniform(-5, 20, (3, 9, 2))
    np.testing.assert_allclose(turned.to_sample(turned.to_copy(position)), position, atol=1e-12)


def test_rotations_compose():
    position = np.random.default_rng(0).uniform(0, 10, (20, 2))
    for one in ANGLES:
        for two in ANGLES:
            first = rotation((9, 13), one)
            second = rotation(first.extent, two)
            both = rotation((9, 13), one + two)
            middle = [(np.array(turned.extent[::-1]) - 1) / 2 for turned in (second, both)]
            np.testing.assert_allclose(
                second.to_copy(first.to_copy(position)) - middle[0],
                both.to_copy(position) - middle[1],
                atol=1e-12,
            )


@pytest.mark.parametrize("angle", ANGLES)
def test_the_large_copy_holds_every_texel_and_the_small_one_nothing_else(angle):
    shape = (11, 17)
    whole, small = (rotation(shape, angle, fit=fit) for fit in ("all", "inside"))
    corners = whole.to_copy([[0, 0], [16, 0], [0, 10], [16, 10]])
    limit = np.array(whole.extent[::-1]) - 1
    assert (corners > -1e-6).all() and (corners < limit + 1e-6).all()
    assert small.valid().all()
    count = whole.valid().sum()
    assert 0.75 * 11 * 17 < count <= 1.3 * 11 * 17  # the area is kept, but for the rim
    for more in ((1, 0), (0, 1)):  # neither side of the small one could be longer
        wider = replace(small, extent=(small.extent[0] + more[0], small.extent[1] + more[1]))
        assert not wider.valid().all()


def test_quarter_turns_are_exact():
    image = np.random.default_rng(1).random((4, 6, 3)).astype(np.float32)
    sample = from_picture("p", image)
    for quarter in range(-4, 6):
        for fit in ("all", "inside"):
            found = rotated(sample, quarter * np.pi / 2, fit=fit)
            np.testing.assert_array_equal(found.image(0, 0), np.rot90(image, quarter))


def test_there_are_72_copies_five_degrees_apart():
    found = list(copies((8, 8)))
    assert len(found) == 72 and found[0].extent == (8, 8)
    np.testing.assert_allclose(np.degrees([one.angle for one in found]), 5 * np.arange(72))


def test_directions_turn_about_the_normal_like_phi():
    directions = scattered(50, 1)
    for angle in ANGLES:
        turned = rotate_directions(directions, angle)
        theta, phi = to_angles(directions)
        np.testing.assert_allclose(turned, from_angles(theta, phi + angle), atol=1e-12)
        back = rotate_directions(turned, -angle)
        assert angle_between(back, directions).max() < 1e-12


def everything(sample):
    """All images in the order of their pairs."""
    numbers = sample.index[sample.index >= 0]
    return sample.stack.read(numbers)


@pytest.fixture(scope="module")
def table():
    return layout("12x2x12x2")


def test_four_quarter_turns_are_the_identity(table):
    sample = relief((6, 9), table.views, table.lights)
    sample = replace(sample, mask=np.random.default_rng(0).random((6, 9)).astype(np.float32))
    found = sample
    for _ in range(4):
        found = rotated(found, np.pi / 2)
    np.testing.assert_array_equal(found.index, sample.index)
    np.testing.assert_array_equal(everything(found), everything(sample))
    np.testing.assert_array_equal(found.mask, sample.mask)


@pytest.mark.parametrize("directions", ["same", "turned"])
def test_the_turned_relief_is_the_relief_turned(table, directions):
    """A quarter turn to the last bits of single precision; others up to the bilinear texels."""
    sample = relief((24, 30), table.views, table.lights)
    for angle, within in ((np.pi / 2, 1e-6), (np.pi, 1e-6), (np.pi / 6, 4e-3), (-np.pi / 3, 4e-3)):
        found = rotated(sample, angle, directions=directions)
        truth = relief(found.shape, found.views, found.lights, turn=angle)
        np.testing.assert_array_equal(found.index, truth.index)
        error = everything(found).astype(float) - everything(truth)
        assert np.abs(error).max() < 5 * within
        assert np.sqrt((error**2).mean()) < within, np.degrees(angle)
        if directions == "same":
            np.testing.assert_array_equal(found.views, sample.views)


def test_a_light_that_does_not_turn_along_is_wrong(table):
    """The law above can fail: images turned without their directions are another material."""
    sample = relief((24, 30), table.views, table.lights)
    found = rotated(sample, np.pi / 2, directions="turned")
    wrong = replace(found, views=sample.views, lights=sample.lights)
    truth = relief(found.shape, sample.views, sample.lights, turn=np.pi / 2)
    error = everything(wrong).astype(float) - everything(truth)
    assert np.sqrt((error**2).mean()) > 0.05


def test_angles_off_the_layout_are_interpolated():
    lights = layout("12x8x12x8").lights
    sample = relief((24, 30), from_angles([0.0], [0.0]), lights)
    angle = np.radians(17)
    for method, within in (("auto", 0.03), ("nearest", 0.15)):
        found = rotated(sample, angle, method=method)
        truth = relief(found.shape, found.views, found.lights, turn=angle)
        error = everything(found).astype(float) - everything(truth)
        assert np.sqrt((error**2).mean()) < within


def test_tiles_fill_the_corners_by_repetition():
    rows, columns = np.mgrid[:8, :8]
    wave = 0.5 + 0.4 * np.cos(2 * np.pi * columns / 8) * np.cos(2 * np.pi * rows / 8)
    image = np.repeat(wave[:, :, None], 3, axis=2).astype(np.float32)
    sample = from_picture("p", image, tiles=True)
    found = rotated(sample, np.pi / 4)
    assert not found.tiles and found.shape == (11, 11)
    place = rotation((8, 8), np.pi / 4).source()
    truth = 0.5 + 0.4 * np.cos(2 * np.pi * place[..., 0] / 8) * np.cos(
        2 * np.pi * place[..., 1] / 8
    )
    assert np.abs(found.image(0, 0)[..., 0] - truth).max() < 0.15  # eight texels a wave, bilinear
    assert rotated(sample, np.pi / 2).tiles and not rotated(replace(sample, tiles=False), 0).tiles


def test_missing_pairs_turn_along(table):
    sample = relief((3, 3), table.views, table.lights)
    sample = without(sample, 0, 5)  # at phi 0 and 150, on the inner rings
    found = rotated(sample, np.radians(60))
    missing = np.argwhere(found.index < 0)
    assert missing.tolist() == [[2, 7]]
    again = rotated(found, np.radians(-60))
    assert np.argwhere(again.index < 0).tolist() == [[0, 5]]


def without(sample, view, light):
    """Return the sample without one image."""
    index = sample.index.copy()
    number = index[view, light]
    index[index > number] -= 1
    index[view, light] = -1
    stack = SubsetStack(sample.stack, np.delete(np.arange(sample.images), number))
    return replace(sample, stack=stack, index=index)


def test_the_copy_is_read_lazily_and_can_be_materialized(table):
    sample = relief((8, 8), table.views, table.lights)
    found = rotated(sample, 0.4)
    assert isinstance(found, BtfSample) and found.stack.dear
    settled = materialize(found)
    assert not settled.stack.dear
    np.testing.assert_array_equal(settled.stack.read([3, 0]), found.stack.read([3, 0]))


@pytest.mark.parametrize(
    "call",
    [
        lambda sample: rotated(sample, np.nan),
        lambda sample: rotated(sample, 0.1, fit="most"),
        lambda sample: rotated(sample, 0.1, directions="other"),
        lambda sample: rotated(sample, 0.1, method="grid"),
        lambda sample: rotation((0, 3), 0.1),
    ],
)
def test_bad_knobs_are_refused(call):
    sample = relief((3, 3), scattered(4, 1), scattered(5, 2))
    with pytest.raises(InvalidParameter):
        call(sample)
