"""What lies behind: laws of mixing, and what is shown of colours and surroundings."""

import numpy as np
import pytest

from btfcore.btf.colour import linear_to_srgb, srgb_to_linear
from btfcore.errors import InvalidParameter
from btfcore.render.backdrop import (
    GRADIENT,
    NOTHING,
    Backdrop,
    develop_picture,
    over,
    parse_backdrop,
)
from btfcore.render.camera import Turntable
from btfcore.render.environment import Environment
from btfcore.render.tonemap import develop

CAMERA = Turntable(20, 10)


def picture(alpha, height=30, width=40):
    """Premultiplied noise of one alpha."""
    values = np.random.default_rng(0).random((height, width, 3)) * 2
    out = np.concatenate([values, np.ones((height, width, 1))], axis=2) * alpha
    return out.astype(np.float32)


@pytest.mark.parametrize(("exposure", "curve"), [(0.0, "clip"), (1.5, "filmic"), (-2, "reinhard")])
def test_a_full_picture_is_developed_as_radiance_is(exposure, curve):
    full = picture(1.0)
    expected = develop(full[..., :3], exposure, curve).astype(int)
    for backdrop in (GRADIENT, NOTHING, Backdrop((1, 0, 0), (1, 0, 0))):
        found = develop_picture(full, backdrop, CAMERA, exposure=exposure, curve=curve)
        assert np.abs(found[..., :3] - expected).max() <= 1
        assert found.shape[2] == (4 if backdrop.transparent else 3)


def test_an_empty_picture_is_its_backdrop_under_any_exposure():
    found = develop_picture(picture(0.0), parse_backdrop("#40a0ff", None), CAMERA, exposure=3)
    assert (found == [0x40, 0xA0, 0xFF]).all()
    shown = develop_picture(picture(0.0), GRADIENT, CAMERA, exposure=-4, curve="filmic")
    assert np.array_equal(shown[0, 0], np.rint(np.array(GRADIENT.top) * 255))
    assert np.array_equal(shown[-1, 0], np.rint(np.array(GRADIENT.bottom) * 255))
    assert (np.diff(shown[:, 5].astype(int), axis=0) <= 0).all()


def test_halves_are_mixed_in_linear_light():
    white = np.ones((2, 2, 4), np.float32) * 0.5
    shown = develop_picture(white, parse_backdrop("#000000", None), CAMERA)
    assert (shown == np.rint(linear_to_srgb(np.float32(0.5)) * 255)).all()
    clear = develop_picture(white, NOTHING, CAMERA)
    assert (clear == [255, 255, 255, 128]).all()


def test_surroundings_are_where_the_camera_looks_and_exposed_with_the_surface():
    # each texel holds its own direction, as far as that is positive
    height = 64
    polar = np.pi * (np.arange(height) + 0.5) / height
    around = np.pi * ((np.arange(2 * height) + 0.5) / height - 1)
    x = np.sin(polar)[:, None] * np.cos(around)
    z = np.sin(polar)[:, None] * np.sin(around)
    y = np.broadcast_to(np.cos(polar)[:, None], x.shape)
    radiance = np.stack([x, y, z], axis=-1).astype(np.float32) + 1
    backdrop = Backdrop(environment=Environment(radiance))
    empty = picture(0.0)
    seen = over(empty, backdrop, CAMERA)
    assert (seen[..., 3] == 1).all()
    column, row = np.meshgrid(np.arange(40) + 0.5, np.arange(30) + 0.5)
    rays = CAMERA.rays(np.stack([column, row], axis=-1), (40, 30))
    assert np.abs(seen[..., :3] - 1 - rays).max() < 0.01
    brighter = develop_picture(empty, backdrop, CAMERA, exposure=-1.0)
    assert np.abs(brighter.astype(int) - develop(seen[..., :3], -1.0)).max() <= 1


def test_colours_lie_under_linear_pictures_too():
    half = picture(0.25)
    seen = over(half, parse_backdrop("#808080", None), CAMERA)
    grey = srgb_to_linear(np.float32(128 / 255))
    assert np.allclose(seen[..., :3], half[..., :3] + 0.75 * grey)
    assert over(half, NOTHING, CAMERA) is half


def test_hostile_radiance_shows_no_surprise():
    wild = np.array([[[np.inf, 1e38, -1, 1], [np.nan, 0, 0, 0]]], np.float32)
    shown = develop_picture(wild, GRADIENT, CAMERA, exposure=60)
    assert np.array_equal(shown[0, 0], [255, 255, 0])


@pytest.mark.parametrize("text", ["", "#12345", "#gggggg", "white", "123456", "environment"])
def test_words_that_name_no_backdrop_are_refused(text):
    with pytest.raises(InvalidParameter, match="background"):
        parse_backdrop(text, None)
