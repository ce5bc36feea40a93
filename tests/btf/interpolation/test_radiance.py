"""Reference evaluation: exact on the images, near the truth between them, texels bilinear."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf.directions import from_angles, layout
from btfcore.btf.interpolation.radiance import picture, prepared, radiance
from btfcore.btf.interpolation.texels import bilinear
from btfcore.btf.sample import from_picture
from btfcore.btf.stack import ArrayStack
from btfcore.errors import InvalidParameter
from tests.btf.interpolation.analytic import normals, offsets, relief, shaded
from tests.btf.interpolation.sets import SETS, scattered

METHODS = ("grid", "barycentric", "nearest4", "nearest")
TABLE = layout("12x4x12x4")


@pytest.fixture(scope="module")
def btf():
    return relief((9, 12), TABLE.views, TABLE.lights)


@pytest.mark.parametrize("method", METHODS)
def test_measured_directions_give_their_image(btf, method):
    for view, light in ((0, 0), (47, 47), (13, 30)):
        found = picture(btf, TABLE.views[view], TABLE.lights[light], method=method)
        assert found.dtype == np.float32 and found.shape == (9, 12, 3)
        np.testing.assert_allclose(found, btf.image(view, light), atol=1e-6)


def test_between_them_every_scheme_beats_the_nearest_image(btf):
    normal = normals(*offsets((9, 12)))
    wrong = dict.fromkeys(METHODS, 0.0)
    for view, light in zip(scattered(25, 3, 1.2), scattered(25, 4, 1.2), strict=True):
        truth = shaded(normal, view, light)
        for method in METHODS:
            found = picture(btf, view, light, method=method)
            wrong[method] += float(((found - truth) ** 2).sum())
    assert max(wrong[method] for method in METHODS[:3]) < 0.6 * wrong["nearest"]
    assert wrong["grid"] < 0.2 * wrong["nearest"]


@pytest.mark.parametrize("method", METHODS)
def test_a_constant_sample_stays_constant(method):
    ones = np.full((48 * 48, 2, 3, 3), 0.7, np.float32)
    btf = replace(relief((2, 3), TABLE.views, TABLE.lights), stack=ArrayStack(ones))
    views, lights = scattered(100, 5), scattered(100, 6)
    found = radiance(btf, np.zeros(100), np.ones(100), views, lights, method=method)
    np.testing.assert_allclose(found, 0.7, atol=1e-6)


def test_texels_of_one_picture_and_of_scattered_queries_agree(btf):
    rows, columns = (part.ravel() for part in np.mgrid[:9, :12])
    view, light = scattered(2, 8)
    whole = picture(btf, view, light)
    np.testing.assert_allclose(
        radiance(btf, rows, columns, view, light).reshape(9, 12, 3), whole, atol=1e-6
    )
    between = radiance(btf, [2.5], [3.25], view, light)[0]
    want = 0.375 * (whole[2, 3] + whole[3, 3]) + 0.125 * (whole[2, 4] + whole[3, 4])
    np.testing.assert_allclose(between, want, atol=1e-6)


def test_below_the_horizon_is_black(btf):
    up, down = from_angles([0.3, 2.0], [1.0, 1.0])
    for view, light in ((up, down), (down, up)):
        assert (picture(btf, view, light) == 0).all()
        assert (radiance(btf, [1.0, 2.0], [0.0, 5.0], view, light) == 0).all()


def test_a_missing_cosine_is_put_in(btf):
    bare = replace(btf, cosine=False)
    view, light = TABLE.views[3], TABLE.lights[40]
    np.testing.assert_allclose(
        picture(bare, view, 2 * light), picture(btf, view, light) * light[2], rtol=1e-5
    )
    np.testing.assert_allclose(
        radiance(bare, [4.0], [4.0], view, light)[0], picture(bare, view, light)[4, 4], rtol=1e-5
    )


def test_fading_lights_go_on_to_black_at_the_horizon(btf):
    view, phi = TABLE.views[3], 1.0
    low = from_angles(np.radians([74.9, 75.001, 80, 89.99]), phi)
    held, faded = (
        np.array([picture(btf, view, light, fade=fade) for light in low]) for fade in (False, True)
    )
    np.testing.assert_allclose(held[1:], held[[1, 1, 1]], atol=1e-6)
    np.testing.assert_array_equal(faded[0], held[0])
    ratio = np.cos(np.radians([75.001, 80, 89.99])) / np.cos(np.radians(75))
    np.testing.assert_allclose(faded[1:], ratio[:, None, None, None] * held[1:], atol=1e-5)
    np.testing.assert_allclose(
        radiance(btf, [4.0], [4.0], view, low[2], fade=True)[0], faded[2, 4, 4], rtol=1e-5
    )


def test_an_ordinary_picture_looks_the_same_from_everywhere():
    colours = np.random.default_rng(1).random((4, 5, 3)).astype(np.float32)
    btf = from_picture("p", colours)
    for view, light in zip(scattered(5, 1), scattered(5, 2), strict=True):
        np.testing.assert_array_equal(picture(btf, view, light), colours)


def test_a_scheme_that_does_not_fit_names_the_sample():
    btf = relief((2, 2), SETS["few"], SETS["one ring"], name="felt")
    with pytest.raises(InvalidParameter, match="felt: views: these directions form no grid"):
        prepared(btf, "grid")
    for call in (
        lambda: picture(btf, np.zeros((2, 3)), [0, 0, 1.0]),
        lambda: picture(btf, [0, 1.0], [0, 0, 1.0]),
        lambda: radiance(btf, np.zeros((2, 2)), np.zeros((2, 2)), [0, 0, 1.0], [0, 0, 1.0]),
    ):
        with pytest.raises(InvalidParameter):
            call()


def test_whole_positions_are_the_texels_bit_for_bit():
    images = np.random.default_rng(2).random((2, 5, 4, 3)).astype(np.float32)
    rows, columns = np.mgrid[:5, :4]
    where = np.stack([columns, rows], axis=-1).astype(float)
    for tiles in (False, True):
        np.testing.assert_array_equal(bilinear(images, where, tiles=tiles), images)
    np.testing.assert_array_equal(bilinear(images, where + (4, -5), tiles=True), images)
    held = bilinear(images, np.array([[-3.0, 9.0], [3.6, 0.0]]))
    np.testing.assert_array_equal(held[:, 0], images[:, 4, 0])
    np.testing.assert_array_equal(held[:, 1], images[:, 0, 3])


def test_between_the_borders_a_tile_is_continuous():
    images = np.random.default_rng(3).random((1, 4, 4, 1)).astype(np.float32)
    found = bilinear(images, np.array([[-0.25, 1.0], [3.75, 1.0], [-1e-17, 1.0]]), tiles=True)[0]
    want = 0.25 * images[0, 1, 3] + 0.75 * images[0, 1, 0]
    np.testing.assert_allclose(found[:2], [want, want], atol=1e-6)
    np.testing.assert_allclose(found[2], images[0, 1, 0], atol=1e-6)
