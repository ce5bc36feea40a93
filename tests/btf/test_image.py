"""Every kind of image gives sRGB colours; every broken one a named error."""

import io
import struct
import zlib

import numpy as np
import pytest
from PIL import Image, ImageCms

from btfcore.btf.image import (
    from_array,
    read_image,
    read_image_notes,
    read_images,
)
from btfcore.errors import InvalidImage, PatinaError
from btfcore.types import Sample


@pytest.fixture
def picture():
    """A smooth colour picture, (40, 60, 3) u1."""
    y, x = np.mgrid[:40, :60]
    return np.stack([4 * x, 6 * y, 255 - 2 * x - 3 * y], axis=-1).astype(np.uint8)


def coded(sample):
    return np.rint(sample.colour * 255)


@pytest.mark.parametrize(
    ("suffix", "knobs", "tolerance"),
    [
        (".png", {}, 0),
        (".bmp", {}, 0),
        (".tga", {}, 0),
        (".tif", {"compression": "tiff_lzw"}, 0),
        (".webp", {"lossless": True}, 0),
        (".jpg", {"quality": 95, "subsampling": 0}, 6),
    ],
)
def test_formats_agree(tmp_path, picture, suffix, knobs, tolerance):
    file = tmp_path / f"some name{suffix}"
    Image.fromarray(picture).save(file, **knobs)
    sample, notes = read_image_notes(file)
    assert (sample.name, notes) == ("some name", ())
    assert sample.colour.dtype == np.float32
    assert np.array_equal(sample.colour, sample.channels)
    assert np.abs(coded(sample) - picture).max() <= tolerance
    assert not sample.colour.flags.writeable


def test_content_counts_not_the_ending(tmp_path, picture):
    Image.fromarray(picture).save(tmp_path / "liar.jpg", "PNG")
    assert np.array_equal(coded(read_image(tmp_path / "liar.jpg")), picture)


def test_modes(tmp_path, picture):
    colour = Image.fromarray(picture)
    grey = colour.convert("L")
    cases = {
        "palette": colour.convert("P", palette=Image.Palette.ADAPTIVE),
        "bits": grey.convert("1"),
        "grey": grey,
        "opaque": colour.convert("RGBA"),
        "cmyk": colour.convert("CMYK"),
    }
    paths = []
    for name, image in cases.items():
        paths.append(tmp_path / f"{name}.tif")
        image.save(paths[-1])
    samples = dict(zip(cases, read_images(paths), strict=True))
    assert all(isinstance(sample, Sample) for sample in samples.values())
    assert np.array_equal(coded(samples["palette"]), np.asarray(cases["palette"].convert("RGB")))
    assert np.array_equal(coded(samples["opaque"]), picture)
    assert np.abs(coded(samples["cmyk"]) - picture).max() <= 2
    for name in ("bits", "grey"):
        expected = np.asarray(cases[name].convert("L"))
        assert np.array_equal(coded(samples[name])[:, :, 1], expected)
        assert samples[name].channels.shape == (40, 60, 1)
    assert read_image_notes(paths[3])[1] == (
        "ignored its alpha channel, which is opaque everywhere",
    )


def test_distances_of_grey_samples_equal_those_of_their_colours():
    sample = from_array("grey", np.array([[0.2, 0.7]], np.float32))
    colour = np.linalg.norm(sample.colour[0, 0] - sample.colour[0, 1])
    assert abs(sample.channels[0, 0, 0] - sample.channels[0, 1, 0]) == pytest.approx(colour)


def test_sixteen_bits_keep_their_depth(tmp_path):
    values = np.arange(0, 60000, 10, dtype=np.uint16).reshape(60, 100)
    for name in ("deep.png", "deep.tif"):
        Image.fromarray(values).save(tmp_path / name)
        sample = read_image(tmp_path / name)
        assert sample.colour[:, :, 0] * 65535 == pytest.approx(values, abs=0.05)
        assert sample.channels.shape == (60, 100, 1)


def test_floats_are_stretched_with_a_note_and_refused_when_not_finite(tmp_path):
    values = np.linspace(-1, 3, 48, dtype=np.float32).reshape(6, 8)
    Image.fromarray(values).save(tmp_path / "height.tif")
    sample, notes = read_image_notes(tmp_path / "height.tif")
    assert "-1 … 3" in notes[0]
    assert (sample.colour.min(), sample.colour.max()) == (0, 1)
    values[2, 3] = np.nan
    Image.fromarray(values).save(tmp_path / "nan.tif")
    with pytest.raises(InvalidImage, match="1 of its pixels"):
        read_image(tmp_path / "nan.tif")


def test_transparent_parts_lie_over_mid_grey(tmp_path, picture):
    alpha = np.full((40, 60, 1), 255, np.uint8)
    alpha[:, :30] = 0
    Image.fromarray(np.concatenate([picture, alpha], axis=2)).save(tmp_path / "decal.png")
    sample, notes = read_image_notes(tmp_path / "decal.png")
    assert notes == ("laid its transparent parts over mid-grey",)
    assert (coded(sample)[:, :30] == 128).all()
    assert np.array_equal(coded(sample)[:, 30:], picture[:, 30:])
    Image.fromarray(alpha[:, :, 0]).convert("LA").save(tmp_path / "la.png")
    assert isinstance(read_image(tmp_path / "la.png"), Sample)


def test_the_camera_s_turn_is_undone(tmp_path, picture):
    turned = Image.fromarray(picture).transpose(Image.Transpose.ROTATE_90)
    exif = Image.Exif()
    exif[0x0112] = 6
    turned.save(tmp_path / "turned.png", exif=exif)
    assert np.array_equal(coded(read_image(tmp_path / "turned.png")), picture)


def test_colour_profiles(tmp_path, picture):
    plain = Image.fromarray(picture)
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    plain.save(tmp_path / "srgb.png", icc_profile=srgb)
    assert np.abs(coded(read_image(tmp_path / "srgb.png")) - picture).max() <= 1

    lab = ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes()
    for name, profile in {"lab.png": lab, "junk.png": b"no profile at all"}.items():
        plain.save(tmp_path / name, icc_profile=profile)
        sample, notes = read_image_notes(tmp_path / name)
        assert "ignored its colour profile" in notes[0]
        assert np.array_equal(coded(sample), picture)


def test_the_first_of_several_pictures_counts(tmp_path, picture):
    frames = [Image.fromarray(picture), Image.fromarray(255 - picture)]
    for name in ("moving.png", "moving.tif"):
        frames[0].save(tmp_path / name, save_all=True, append_images=frames[1:])
        sample, notes = read_image_notes(tmp_path / name)
        assert notes == ("took the first of 2 pictures",)
        assert np.array_equal(coded(sample), picture)


def png_of(width, height, rows=b""):
    """A grey PNG that claims a size, whatever rows it holds."""
    out = b"\x89PNG\r\n\x1a\n"
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    for kind, data in ((b"IHDR", head), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")):
        out += struct.pack(">I", len(data)) + kind + data
        out += struct.pack(">I", zlib.crc32(kind + data))
    return out


def test_sizes(tmp_path):
    (tmp_path / "one.png").write_bytes(png_of(1, 1, b"\0\x80"))
    assert read_image(tmp_path / "one.png").colour.shape == (1, 1, 3)
    (tmp_path / "long.png").write_bytes(png_of(30_000, 40, bytes(30_001 * 40)))
    sample, notes = read_image_notes(tmp_path / "long.png")
    assert (sample.colour.shape, notes) == ((40, 30_000, 3), ())
    (tmp_path / "square.png").write_bytes(png_of(30_000, 30_000))
    with pytest.raises(InvalidImage, match="30,000 x 30,000 = 900,000,000 pixels"):
        read_image(tmp_path / "square.png")
    (tmp_path / "wide.png").write_bytes(png_of(20_000, 1_000, bytes(20_001 * 1_000)))
    sample, notes = read_image_notes(tmp_path / "wide.png")
    assert sample.colour.shape[0] * sample.colour.shape[1] <= 1 << 24
    assert notes[0].startswith("reduced from 20000 x 1000 to ")


def test_thumbnails_and_one_broken_among_many(tmp_path, picture):
    paths = []
    for number in range(4):
        paths.append(tmp_path / f"{number}.png")
        Image.fromarray(picture).save(paths[-1])
    paths[1].write_bytes(paths[1].read_bytes()[:-60])
    paths[2] = tmp_path / "missing.png"
    found = read_images(paths, max_side=20)
    assert found[0].colour.shape == found[3].colour.shape == (13, 20, 3)
    assert isinstance(found[1], InvalidImage)
    assert "1.png" in str(found[1])
    assert "no such file" in str(found[2])
    assert read_images([]) == []


def test_one_that_kills_the_child_does_not_spoil_the_others(tmp_path, picture):
    small, large = tmp_path / "small.png", tmp_path / "large.png"
    Image.fromarray(picture).save(small)
    large.write_bytes(png_of(16_000, 16_000, bytes(16_001 * 16_000)))
    found = read_images([small, large, small], limit_mb=400)
    assert [isinstance(item, Sample) for item in found] == [True, False, True]
    assert "large.png" in str(found[1])


BROKEN = {
    "empty.png": (b"", "0 bytes"),
    "text.png": (b"this is no image", "begins with b'this is '"),
    "animation.gif": (b"GIF89a" + bytes(30), "no PNG, JPEG"),
    "pointer.jpg": (b"version https://git-lfs.github.com/spec/v1\n", "LFS"),
    "zero.png": (png_of(0, 0), "."),
    "short.png": (png_of(60, 40, bytes(200)), "broken or cut off"),
    "head.png": (b"\x89PNG\r\n\x1a\n", "."),
    "head.jpg": (b"\xff\xd8\xff\xe0", "."),
    "riff.webp": (b"RIFF\x10\0\0\0WAVEfmt ", "header makes no sense"),
    "junk.tga": (bytes(range(64)), "."),
}


def test_broken_files_are_refused_by_name(tmp_path):
    paths = []
    for name, (content, _) in BROKEN.items():
        paths.append(tmp_path / name)
        paths[-1].write_bytes(content)
    (tmp_path / "folder.png").mkdir()
    found = read_images([*paths, tmp_path / "folder.png"])
    for error, (name, (_, words)) in zip(found, BROKEN.items(), strict=False):
        assert isinstance(error, InvalidImage), name
        assert str(error).startswith(f"{name}: ")
        assert words in str(error)
    assert "folder" in str(found[-1])


def test_jpegs_and_tiffs_cut_off_anywhere_are_refused(tmp_path, picture):
    paths = []
    for suffix, knobs in ((".jpg", {}), (".tif", {"compression": "tiff_deflate"})):
        stream = io.BytesIO()
        kind = {"jpg": "JPEG", "tif": "TIFF"}[suffix[1:]]
        Image.fromarray(picture).save(stream, kind, **knobs)
        whole = stream.getvalue()
        for number, end in enumerate(np.linspace(1, len(whole) * 0.9, 12).astype(int)):
            paths.append(tmp_path / f"{number}{suffix}")
            paths[-1].write_bytes(whole[:end])
    assert all(isinstance(item, PatinaError) for item in read_images(paths))


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (np.zeros((4, 4, 4)), r"\(4, 4, 4\)"),
        (np.zeros((0, 4, 3)), r"\(0, 4, 3\)"),
        (np.full((2, 2, 3), 1.5), "12 values"),
        (np.full((2, 2, 3), np.nan), "12 values"),
    ],
)
def test_arrays_that_are_no_picture_are_refused(array, words):
    with pytest.raises(InvalidImage, match=words):
        from_array("array", array)


def test_arrays_of_every_depth_agree(picture):
    exact = picture.astype(np.float64) / 255
    for array in (picture, picture.astype(np.uint16) * 257, exact, exact.astype(np.float32)):
        assert from_array("same", array).colour == pytest.approx(exact, abs=1e-6)
