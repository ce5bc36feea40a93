"""Encoded images hold what was given, read by the library's own door."""

import time

import numpy as np
import OpenImageIO
import pytest

from btfcore.btf.oiio_door import kind_of, raw_picture
from btfcore.errors import InvalidParameter
from btfcore.files.exr import encode_exr, encode_hdr, encode_jpeg

OPTIONS = {"most": 1 << 20, "size": None, "icc": False}


def back(tmp_path, data, ending):
    path = tmp_path / f"image.{ending}"
    path.write_bytes(data)
    return raw_picture(path, kind_of(data[:32]), OPTIONS, [])


@pytest.fixture
def radiance():
    return np.random.default_rng(1).gamma(0.5, 4, (5, 9, 3)).astype(np.float32)


def test_floats_are_exact_and_halves_nearly(tmp_path, radiance):
    radiance[0, 0] = 1e6, 0, 65504
    values, meaning = back(tmp_path, encode_exr(radiance, half=False), "exr")
    assert np.array_equal(values, radiance)
    assert meaning == "rec709"
    values, meaning = back(tmp_path, encode_exr(radiance), "exr")
    assert values.dtype == np.float16
    assert np.array_equal(values, np.minimum(radiance, 65504).astype(np.float16))


def test_radiance_files_share_an_exponent(tmp_path, radiance):
    values, _ = back(tmp_path, encode_hdr(radiance), "hdr")
    step = radiance.max(axis=2, keepdims=True) / 128
    assert (np.abs(values - radiance) <= step).all()


def test_jpegs_are_srgb():
    grey = np.full((16, 16, 3), 0.2140411, np.float32)  # sRGB 0.5
    data = encode_jpeg(grey, quality=100)
    assert data.startswith(b"\xff\xd8\xff")
    assert len(encode_jpeg(grey, quality=10)) <= len(data)


def test_other_shapes_are_refused():
    for shape in ((4, 4), (4, 4, 2), (4, 4, 5), (0, 4, 3)):
        with pytest.raises(InvalidParameter, match="is needed"):
            encode_exr(np.zeros(shape, np.float32))
    with pytest.raises(InvalidParameter, match="quality of 0"):
        encode_jpeg(np.zeros((4, 4, 3), np.float32), quality=0)
    with pytest.raises(InvalidParameter, match=r"\(H, W, 3\) is needed"):
        encode_hdr(np.zeros((4, 4, 4), np.float32))


def test_alpha_is_a_band_of_its_own(tmp_path, radiance):
    alpha = np.linspace(0, 1, 45, dtype=np.float32).reshape(5, 9, 1)
    image = np.concatenate([radiance * alpha, alpha], axis=2)
    path = tmp_path / "image.exr"
    path.write_bytes(encode_exr(image, half=False))
    opened = OpenImageIO.ImageInput.open(str(path))
    assert opened.spec().channelnames == ("R", "G", "B", "A")
    assert opened.spec().alpha_channel == 3
    assert np.array_equal(opened.read_image("float"), image)


def test_the_same_image_makes_the_same_bytes():
    image = np.linspace(0, 2, 4 * 5 * 3, dtype=np.float32).reshape(4, 5, 3)
    one = encode_exr(image)
    time.sleep(1.1)  # dates are written in whole seconds
    assert encode_exr(image) == one
