"""Deep images come out as the numbers that were stored, wherever their pixels lie."""

import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image

from btfcore.btf.readers.decode import decode_images
from btfcore.btf.readers.listing import pick_files
from btfcore.errors import InvalidImage, PatinaError

pytestmark = pytest.mark.usefixtures("in_process")


def write(path, values, kind, *, names=None, place=None, **settings):
    """Write with OpenImageIO; place: (x, y) of the data window and (w, h) of the display."""
    spec = oiio.ImageSpec(values.shape[1], values.shape[0], values.shape[2], kind)
    if names:
        spec.channelnames = names
    if place:
        spec.x, spec.y, spec.full_width, spec.full_height = place
    for key, value in settings.items():
        spec.attribute(key.replace("__", ":"), value)
    out = oiio.ImageOutput.create(str(path))
    assert out is not None and out.open(str(path), spec), oiio.geterror()
    assert out.write_image(np.ascontiguousarray(values)) and out.close()


def read(path, **knobs):
    files = pick_files(path.parent, [path.name])
    return decode_images(files, files.entries, **knobs)[0]


@pytest.fixture
def radiance():
    return np.random.default_rng(0).normal(2, 3, (6, 8, 3)).astype(np.float32)


@pytest.mark.parametrize(
    ("name", "kind", "dtype"),
    [
        ("a.exr", "float", np.float32),
        ("a.exr", "half", np.float16),
        ("a.tif", "float", np.float32),
        ("a.tif", "uint16", np.uint16),
        ("a.tif", "uint8", np.uint8),
        ("a.png", "uint16", np.uint16),
    ],
)
def test_raw_numbers(tmp_path, radiance, name, kind, dtype):
    radiance[0, 0] = np.nan if dtype in (np.float32, np.float16) else 0
    full = {np.uint16: 65535, np.uint8: 255}.get(dtype)
    values = radiance.astype(dtype) if full is None else (np.abs(radiance) % 1 * full).astype(dtype)
    write(tmp_path / name, values, kind)
    raw = read(tmp_path / name)
    assert raw.values.dtype == dtype
    assert np.array_equal(raw.values, values, equal_nan=full is None)
    if full is None:
        assert raw.flaws == (3, 0, int((values < 0).sum()))


def test_channels_by_name_and_alpha_left_alone(tmp_path, radiance):
    alpha = np.full((6, 8, 1), 0.25, np.float32)
    shuffled = np.concatenate([alpha, radiance[..., ::-1], radiance[..., :1]], axis=2)
    write(tmp_path / "a.exr", shuffled, "float", names=("A", "B", "G", "R", "Z"))
    raw = read(tmp_path / "a.exr")
    assert np.array_equal(raw.values, radiance)
    assert any("left out channels" in note for note in raw.notes)
    write(tmp_path / "l.exr", radiance, "float", names=("diffuse.R", "diffuse.G", "diffuse.B"))
    assert np.array_equal(read(tmp_path / "l.exr").values, radiance)
    write(tmp_path / "y.exr", radiance[..., :1], "float", names=("Y",))
    assert np.array_equal(read(tmp_path / "y.exr").values, radiance[..., 0])
    write(tmp_path / "x.exr", radiance, "float", names=("X", "Y", "Z"))
    assert read(tmp_path / "x.exr").meaning == "xyz"
    write(tmp_path / "u.exr", radiance, "float", names=("u", "v", "w"))
    with pytest.raises(InvalidImage, match=r"u\.exr: no colour channels.*u, v, w"):
        read(tmp_path / "u.exr")


@pytest.mark.parametrize(
    "place", [(2, 1, 12, 9), (-3, -2, 4, 3), (5, 5, 8, 6), (20, 0, 8, 6), (0, 0, 4, 4)]
)
def test_data_windows_are_laid_into_the_display_window(tmp_path, radiance, place):
    write(tmp_path / "a.exr", radiance, "float", place=place)
    raw = read(tmp_path / "a.exr")
    left, top, width, height = place
    assert raw.values.shape == (height, width, 3)
    for row in range(height):
        for column in range(width):
            inside = 0 <= row - top < 6 and 0 <= column - left < 8
            wanted = radiance[row - top, column - left] if inside else np.zeros(3)
            assert np.array_equal(raw.values[row, column], wanted)
    assert any("display window" in note for note in raw.notes)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_turns_are_undone_as_pillow_undoes_them(tmp_path, orientation):
    values = np.arange(6 * 8 * 3, dtype=np.uint16).reshape(6, 8, 3)
    write(tmp_path / "a.tif", values * 257, "uint16", Orientation=orientation)
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(values.astype(np.uint8)).save(tmp_path / "a.png", exif=exif)
    assert np.array_equal(read(tmp_path / "a.tif").values // 257, read(tmp_path / "a.png").values)


def test_content_counts_not_the_ending(tmp_path, radiance):
    write(tmp_path / "a.exr", radiance, "float")
    (tmp_path / "a.exr").rename(tmp_path / "a.png")
    assert np.array_equal(read(tmp_path / "a.png").values, radiance)


@pytest.mark.parametrize("name", ["a.tga", "a.bmp", "a.webp", "a.TIFF", "a.png"])
@pytest.mark.parametrize("mode", ["RGB", "L", "RGBA", "P", "1", "LA"])
def test_eight_bits_of_any_kind_without_alpha(tmp_path, name, mode):
    rng = np.random.default_rng(1)
    image = Image.fromarray(rng.integers(0, 255, (6, 8, 4), dtype=np.uint8)).convert(mode)
    knobs = {"lossless": True, "exact": True} if name.endswith("webp") else {}
    try:
        image.save(tmp_path / name, **knobs)
    except OSError:
        pytest.skip(f"Pillow writes no {mode} into {name}")
    raw = read(tmp_path / name)
    assert raw.values.dtype == np.uint8
    shown = np.asarray(image.convert("RGB"))
    assert np.array_equal(np.broadcast_to(raw.values.T, shown.T.shape).T, shown)


def test_limits_hold_before_anything_is_decoded(tmp_path, radiance):
    write(tmp_path / "a.exr", radiance, "float")
    Image.fromarray(np.zeros((6, 8, 3), np.uint8)).save(tmp_path / "a.png")
    for name in ("a.exr", "a.png"):
        with pytest.raises(InvalidImage, match=rf"^{name}: 8 x 6 = 48 pixels; 1 to 40"):
            read(tmp_path / name, most=40)
        with pytest.raises(InvalidImage, match=rf"^{name}: its size is 8 x 6.* 7 x 6"):
            read(tmp_path / name, size=(6, 7))
    write(tmp_path / "wide.exr", radiance, "float", place=(0, 0, 1 << 15, 1 << 15))
    with pytest.raises(InvalidImage, match="32,768 x 32,768"):
        read(tmp_path / "wide.exr")


def test_few_bytes_cannot_promise_many_pixels(tmp_path):
    Image.fromarray(np.zeros((300, 300), np.uint8)).save(tmp_path / "a.png")
    size = (tmp_path / "a.png").stat().st_size
    assert size < 900
    with pytest.raises(InvalidImage, match=f"90,000 pixels; 1 to {100 * size:,}"):
        read(tmp_path / "a.png", free=1000)
    assert read(tmp_path / "a.png", free=90_000).values.shape == (300, 300)


def test_files_cut_off_anywhere_are_refused_by_name(tmp_path, radiance):
    noise = np.random.default_rng(0).integers(0, 65535, (6, 8, 3)).astype(np.uint16)
    write(tmp_path / "a.exr", radiance, "float")
    write(tmp_path / "b.tif", noise, "uint16")
    write(tmp_path / "c.png", noise, "uint16")
    write(tmp_path / "d.hdr", np.abs(radiance), "float")
    for name in ("a.exr", "b.tif", "c.png", "d.hdr"):
        whole = (tmp_path / name).read_bytes()
        for end in np.linspace(0, len(whole) * 0.8, 10).astype(int):
            (tmp_path / name).write_bytes(whole[:end])
            with pytest.raises(PatinaError) as caught:
                read(tmp_path / name)
            assert str(caught.value).startswith(name)
