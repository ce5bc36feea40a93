"""Environment maps come in as they were written, and lights as they were said."""

import numpy as np
import pytest
from PIL import Image

from btfcore.btf.colour import srgb_to_linear
from btfcore.errors import InvalidImage, InvalidParameter
from btfcore.files.exr import encode_exr, encode_hdr
from btfcore.files.light_file import (
    LightSetting,
    lights_of,
    parse_light,
    parse_lights,
    read_environment,
)
from btfcore.render.camera import Turntable
from btfcore.render.environment import Environment, total
from tests.render.skies import sun_and_sky


def test_exr_and_hdr_keep_their_range(tmp_path):
    radiance = 30 * sun_and_sky(16, radius=15)
    assert radiance.max() > 20_000
    (tmp_path / "sky.exr").write_bytes(encode_exr(radiance, half=False))
    found, notes = read_environment(tmp_path / "sky.exr", rotation=30, intensity=2)
    assert np.array_equal(found.radiance, radiance)
    assert (found.rotation, found.intensity) == (30, 2)
    assert "linear" in notes[0]
    (tmp_path / "sky.hdr").write_bytes(encode_hdr(radiance))
    found, _ = read_environment(tmp_path / "sky.hdr")
    assert (np.abs(found.radiance - radiance) <= radiance.max(axis=2, keepdims=True) / 128).all()


def test_pictures_of_8_bits_are_srgb(tmp_path):
    codes = np.random.default_rng(0).integers(0, 256, (4, 8, 3), np.uint8)
    Image.fromarray(codes).save(tmp_path / "room.png")
    found, notes = read_environment(tmp_path / "room.png")
    assert np.array_equal(found.radiance, srgb_to_linear(codes))
    assert any("too dim" in note for note in notes)
    Image.fromarray(codes).save(tmp_path / "room.jpg")
    assert read_environment(tmp_path / "room.jpg")[0].radiance.shape == (4, 8, 3)


def test_flaws_are_mended_and_told(tmp_path):
    radiance = np.ones((4, 8, 3), np.float32)
    radiance[0, 0] = np.nan, np.inf, -1
    (tmp_path / "bad.exr").write_bytes(encode_exr(radiance, half=False))
    found, notes = read_environment(tmp_path / "bad.exr")
    assert found.radiance[0, 0].tolist() == [0, 65504, 0]
    assert "mended 1 NaN, 1 infinite and 1 negative values" in notes


def test_large_maps_are_reduced_with_their_energy(tmp_path):
    radiance = sun_and_sky(64)
    (tmp_path / "sky.exr").write_bytes(encode_exr(radiance, half=False))
    found, notes = read_environment(tmp_path / "sky.exr", most_rows=20)
    assert found.radiance.shape == (20, 40, 3)
    assert np.allclose(total(found), total(Environment(radiance)), rtol=1e-6)
    assert "reduced from 128 x 64 to 40 x 20, keeping its energy" in notes


def test_what_is_no_map_is_refused(tmp_path):
    (tmp_path / "cube.exr").write_bytes(encode_exr(np.ones((6, 4, 3), np.float32)))
    with pytest.raises(InvalidImage, match=r"cube.exr: its size is 4 x 6; .* twice as wide"):
        read_environment(tmp_path / "cube.exr")
    with pytest.raises(InvalidImage, match="gone.hdr: there is no such file"):
        read_environment(tmp_path / "gone.hdr")
    (tmp_path / "text.hdr").write_bytes(b"#?RADIANCE\nnothing\n")
    with pytest.raises(InvalidImage, match="text.hdr"):
        read_environment(tmp_path / "text.hdr")
    whole = encode_exr(sun_and_sky(16))
    (tmp_path / "cut.exr").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InvalidImage, match="cut.exr"):
        read_environment(tmp_path / "cut.exr")
    huge = np.full((2, 4, 3), 3e38, np.float32)
    (tmp_path / "huge.exr").write_bytes(encode_exr(huge, half=False))
    with pytest.raises(InvalidImage, match="huge.exr: radiances up to 3e"):
        read_environment(tmp_path / "huge.exr")


def test_lights_are_what_was_said():
    assert parse_light("30,45") == LightSetting(30, 45)
    assert parse_light(" world: -30 , 45.5 , 2e0 ") == LightSetting(-30, 45.5, 2)
    red = parse_light("camera:0,0,3,#FF0080")
    assert red.camera and red.intensity == 3
    assert red.colour == pytest.approx((1, 0, 0.21586), rel=1e-4)
    lights = parse_lights(["0,0", "90,0,2,#ff0000", "12,90"])
    assert np.allclose(lights.direction, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-15)
    assert np.allclose(lights.intensity, [[1, 1, 1], [2, 0, 0], [1, 1, 1]])
    assert len(parse_lights([])) == 0


def test_a_light_stands_where_a_camera_of_the_same_angles_does():
    for azimuth, elevation in ((30, 18), (200, -40), (-75, 80)):
        camera = Turntable(azimuth, elevation)
        light = parse_light(f"{azimuth},{elevation}").direction()
        assert np.allclose(light, camera.axes()[2])
        assert np.allclose(parse_light("camera:0,0").direction(camera.axes()), light)
        above = parse_light("camera:0,90").direction(camera.axes())
        assert np.allclose(above, camera.axes()[1])
    with pytest.raises(InvalidParameter, match="no camera"):
        lights_of([LightSetting(0, 0, camera=True)])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "form"),
        ("30", "form"),
        ("1,2,3,#ffffff,5", "form"),
        ("sun:1,2", "form"),
        ("a,2", "'a' is no number"),
        ("nan,2", "'nan' is no number"),
        ("1,inf", "'inf' is no number"),
        ("1,91", "elevation of 91"),
        ("1,2,-1", "intensity of -1"),
        ("1,2,1e9", "intensity of 1e\\+09"),
        ("1,2,1,red", "'red' is no colour"),
        ("1,2,1,#ff", "'#ff' is no colour"),
    ],
)
def test_what_is_no_light_is_named(text, said):
    with pytest.raises(InvalidParameter, match=said) as caught:
        parse_light(text)
    assert repr(text) in str(caught.value)
