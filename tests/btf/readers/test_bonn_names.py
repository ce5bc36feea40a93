"""Every image is found under the view and light that its name states."""

import numpy as np
import pytest

from btfcore.btf.colour import linear_to_srgb, srgb_to_linear, xyz_to_linear
from btfcore.btf.readers.bonn_names import looks_like_named_images, read_named_images
from btfcore.btf.readers.conditions import from_angles
from btfcore.btf.readers.snap import MOST_DEG
from btfcore.errors import InvalidBtf, InvalidImage, InvalidParameter
from tests.btf.readers.sets import RINGS, UBO, UTIA, encoded, named, picture, png, to_folder, to_zip

pytestmark = pytest.mark.usefixtures("in_process")


def at(sample, view, light):
    """Image of a view and light given as (θ, φ) in degrees."""
    places = []
    for directions, angles in ((sample.views, view), (sample.lights, light)):
        apart = np.linalg.norm(directions - from_angles(*angles), axis=1)
        assert apart.min() < 1e-12
        places.append(int(apart.argmin()))
    return sample.image(*places)


def check_numbers(sample, decode):
    """Every condition shows the image that was numbered for it."""
    for n, (view, light) in enumerate((view, light) for view in RINGS for light in RINGS):
        assert decode(at(sample, view, light)[..., 0]) == pytest.approx(n, abs=0.05)


@pytest.mark.parametrize("pattern", [UBO, UTIA, "a/b/c/pv{pv} tv{tv} x tl{tl:03d}-pl{pl:03d}"])
@pytest.mark.parametrize("archive", [False, True])
def test_each_image_lies_where_its_name_says(tmp_path, pattern, archive):
    files = named(pattern, ".png")
    where = to_zip(tmp_path / "set.zip", files) if archive else to_folder(tmp_path / "set", files)
    assert looks_like_named_images(where)
    sample = read_named_images(where)
    assert sample.name == "set"
    assert sample.stack.shape == (36, 6, 8)
    assert sample.missing == 0
    assert sample.stack.dear
    check_numbers(sample, lambda image: linear_to_srgb(image) * 255)


@pytest.mark.parametrize("suffix", [".jpg", ".jpeg", ".exr", ".hdr"])
def test_every_format_is_read_as_what_it_is(tmp_path, suffix):
    sample = read_named_images(to_zip(tmp_path / "set.zip", named(UBO, suffix)))
    if suffix.startswith(".j"):
        check_numbers(sample, lambda image: linear_to_srgb(image) * 255)
        assert "sRGB" in sample.notes[-1]
    else:  # Radiance HDR has 8 bits for the largest of the colours
        decoded = sample.stack.read(range(36))[..., 0].mean(axis=(1, 2))
        assert decoded * 50 == pytest.approx(np.arange(36), rel=0.01, abs=0.1)
        assert "linear" in sample.notes[-1]


def test_float_images_of_utia_are_xyz_unless_they_say_otherwise(tmp_path):
    import OpenImageIO as oiio

    xyz = np.full((6, 8, 3), (0.5, 0.4, 0.3), np.float32)
    plain, stated = tmp_path / "plain.exr", tmp_path / "stated.exr"
    for path, names in ((plain, ("R", "G", "B")), (stated, ("X", "Y", "Z"))):
        spec = oiio.ImageSpec(8, 6, 3, "half")
        spec.channelnames = names
        out = oiio.ImageOutput.create(str(path))
        assert out.open(str(path), spec) and out.write_image(xyz) and out.close()
    expected = xyz_to_linear(xyz[0, 0])
    cases = [  # name, file, what is expected
        (UTIA, plain.read_bytes(), expected),
        (UBO, plain.read_bytes(), xyz[0, 0]),
        (UBO, stated.read_bytes(), expected),
        (UTIA, encoded(7, ".exr"), np.array([7 / 50, 5 / 50, 7 / 50])),  # says Rec. 709
    ]
    for number, (pattern, data, wanted) in enumerate(cases):
        name = pattern.format(n=0, tl=0, pl=0, tv=0, pv=0) + ".exr"
        sample = read_named_images(to_folder(tmp_path / str(number), {name: data}))
        assert sample.image(0, 0)[5, 7] == pytest.approx(wanted, abs=2e-3), number
    forced = read_named_images(tmp_path / "0", colour="linear")
    assert forced.image(0, 0)[0, 0] == pytest.approx(xyz[0, 0], abs=1e-3)
    with pytest.raises(InvalidParameter, match="colour 'rgb'"):
        read_named_images(tmp_path / "0", colour="rgb")


def test_the_pole_is_one_direction_whatever_its_azimuth(tmp_path):
    files = {
        "tl000 pl000 tv030 pv000.png": png(picture(1)),
        "tl000 pl090 tv030 pv180.png": png(picture(2)),
        "tl045 pl360 tv030 pv180.png": png(picture(3)),
    }
    sample = read_named_images(to_folder(tmp_path, files))
    assert len(sample.views) == 2
    assert len(sample.lights) == 2
    assert np.array_equal(sample.lights[0], [0, 0, 1])
    assert linear_to_srgb(at(sample, (30, 180), (45, 0)))[0, 0, 0] * 255 == pytest.approx(3)
    (note,) = [note for note in sample.notes if "no image" in note]
    assert note.startswith("1 of 4 conditions")
    assert (sample.index == -1).sum() == 1


def test_a_condition_shown_twice_is_refused_with_both_names(tmp_path):
    files = {
        "tl000 pl000 tv030 pv000.png": png(picture(1)),
        "other/tl000 pl090 tv030 pv360.png": png(picture(2)),
    }
    with pytest.raises(InvalidBtf) as caught:
        read_named_images(to_folder(tmp_path / "twice", files))
    assert all(name in str(caught.value) for name in files)


def test_lights_that_stepped_aside_are_put_back(tmp_path):
    views = lights = [(0, 0), (30, 0), (30, 120), (30, 240), (60, 0), (60, 90), (60, 180)]
    files = {}
    for n, (view, light) in enumerate((view, light) for view in views for light in lights):
        moved = (light[0] + 4, light[1] + 3) if view == light else light
        name = UTIA.format(tv=view[0], pv=view[1], tl=moved[0], pl=moved[1])
        files[name + ".png"] = png(picture(n))
    sample = read_named_images(to_folder(tmp_path, files))
    assert sample.index.shape == (7, 7)
    assert sample.missing == 0
    for n, (view, light) in enumerate((view, light) for view in views for light in lights):
        shown = linear_to_srgb(at(sample, view, light))[0, 0, 0] * 255
        assert shown == pytest.approx(n, abs=0.01)
    (note,) = [note for note in sample.notes if "steps aside" in note]
    assert "7 images" in note
    assert float(note.split("up to ")[1].split("°")[0]) < MOST_DEG


def test_lights_far_from_any_other_stay_where_they_are(tmp_path):
    views = lights = [(0, 0), (30, 0), (30, 120), (30, 240)]
    files = {}
    for view in views:
        for light in lights:
            moved = (light[0] + 8, light[1]) if view == light else light
            name = UTIA.format(tv=view[0], pv=view[1], tl=moved[0], pl=moved[1])
            files[name + ".png"] = png(picture(1))
    sample = read_named_images(to_folder(tmp_path, files))
    assert sample.index.shape == (4, 8)
    assert sample.missing == 16


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("tl091 pl000 tv000 pv000.png", "tl 91"),
        ("tl000 pl400 tv000 pv000.png", "pl 400"),
        ("tl000 pl000 tv000.png", "none of its 1 images"),
        ("rock.png", "none of its 1 images"),
    ],
)
def test_names_that_make_no_sense(tmp_path, name, words):
    to_folder(tmp_path / "odd", {name: png(picture(1))})
    with pytest.raises(InvalidBtf, match=words) as caught:
        read_named_images(tmp_path / "odd")
    assert str(caught.value).startswith("odd: ")


def test_images_of_another_size_are_named_with_both_sizes(tmp_path):
    files = named(UBO, ".png", views=RINGS[:1])
    odd = sorted(files)[3]
    files[odd] = png(picture(1, (9, 8)))
    sample = read_named_images(to_folder(tmp_path, files))
    with pytest.raises(InvalidImage, match="8 x 9.*8 x 6") as caught:
        sample.stack.read(range(6))
    assert str(caught.value).startswith(odd)


def test_sixteen_bits_are_kept(tmp_path):
    values = np.arange(48, dtype=np.uint16).reshape(6, 8) * 1000
    to_folder(tmp_path, {"tl000 pl000 tv000 pv000.png": png(values)})
    image = read_named_images(tmp_path).image(0, 0)
    assert np.array_equal(image[..., 1], srgb_to_linear(values))
