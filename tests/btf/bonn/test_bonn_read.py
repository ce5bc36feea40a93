"""What Bonn's formats say is what comes out: every form, colour model and piece of header."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from btfcore.btf.bonn.reader import HEAD, bonn_sample, is_bonn, read_bonn
from btfcore.btf.materialize import materialize
from btfcore.btf.stack import ImageStack
from btfcore.errors import InvalidBtf, InvalidParameter
from tests.btf.bonn import synthetic as make

E = make.EPSILON
FORMS = {
    **{f"dfmf {size} {t}": make.dfmf(scalar=size, transposed=t) for size in (2, 4, 8)
       for t in (False, True)},
    **{f"fmf12 {size} {t}": make.fmf(scalar=size, transposed=t) for size in (2, 4, 8)
       for t in (False, True)},
    **{f"fmf06 {turns}": make.fmf(extension=None, rotations=turns) for turns in (None, 0, 3)},
    **{f"fmf12 extension {number}": make.fmf(extension=number) for number in (0, 1)},
    "fmf12 no map": make.fmf(height_map=(0, 4)),
    **{f"pvf {size} {light}": make.pvf(scalar=size, per_light=light) for size in (2, 8)
       for light in (False, True)},
    "pvf without rotations": make.pvf(rotations=None),
    "pvf old": make.pvf(old=True),
    "pvf old, no R, per light": make.pvf(old=True, rotations=None, per_light=True),
    **{f"bdi sparse {lines}": make.bdi(lines=lines) for lines in (1, 3, 8, 1000)},
    "bdi sparse padded": make.bdi(padded=True),
    "bdi full": make.bdi(compression=0, rotations=2),
    "bdi full, mask ignored": make.bdi(compression=0, holes=True, lines=5),
}  # fmt: skip


def sample_of(made, **knobs):
    return bonn_sample("cloth.btf", bytes(made[0].data), **knobs)


def images(made, **knobs):
    sample = sample_of(made, **knobs)
    return sample.stack.read(np.arange(sample.images))


@pytest.mark.parametrize("form", FORMS)
def test_values_are_exactly_those_of_the_file(form):
    made = FORMS[form]
    sample = sample_of(made)
    assert isinstance(sample.stack, ImageStack) and sample.stack.dear
    assert sample.stack.shape == (20, make.HEIGHT, make.WIDTH)
    assert np.array_equal(images(made), np.maximum(made[1], 0))


@pytest.mark.parametrize("form", FORMS)
def test_images_do_not_depend_on_what_is_read_with_them_nor_on_memory(form):
    sample = sample_of(FORMS[form])
    frugal = sample_of(FORMS[form], memory_mb=0)
    whole = sample.stack.read(np.arange(20))
    for number in (0, 7, 19):
        assert np.array_equal(sample.stack.read([number])[0], whole[number])
        assert np.array_equal(frugal.stack.read([number])[0], whole[number])
    mixed = [19, 3, 3, 0, 11]
    assert np.array_equal(sample.stack.read(mixed), whole[mixed])
    assert np.array_equal(frugal.stack.read(mixed), whole[mixed])
    assert np.array_equal(materialize(sample).stack.read(mixed), whole[mixed])
    assert sample.stack.read([]).shape == (0, make.HEIGHT, make.WIDTH, 3)
    for wrong in ([20], [-1], [0, 500]):
        with pytest.raises(IndexError):
            sample.stack.read(wrong)


@pytest.mark.parametrize("threads", [1, 2])
def test_bits_do_not_depend_on_the_number_of_threads(threads, tmp_path):
    # Large enough for BLAS to share it out; checked against this process's own bits.
    code = (
        "import numpy as np\n"
        "from tests.btf.bonn.test_bonn_read import large_bits\n"
        "print(large_bits())\n"
    )
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": str(threads)}
    root = Path(__file__).parents[3]
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=root, stdout=subprocess.PIPE, check=True
    )
    assert int(done.stdout) == large_bits()


def large_bits():
    """A checksum of what a stack of 12 images of 40,000 texels yields."""
    from zlib import crc32

    from btfcore.btf.bonn.factors import FactorStack, Plane
    from btfcore.btf.bonn.models import ColourModel

    draw = np.random.default_rng(5)
    planes = tuple(
        Plane(
            draw.standard_normal((12, 50)).astype(np.float16),
            draw.standard_normal((40_000, 50)).astype(np.float16) / 8,
        )
        for _ in range(3)
    )
    stack = FactorStack([planes], 200, 200, model=ColourModel(11))
    whole = stack.read(np.arange(12))
    for number in (0, 5):
        assert np.array_equal(stack.read([number])[0], whole[number])
    return crc32(whole.tobytes())


def test_the_light_runs_fastest_and_directions_are_those_of_the_table():
    true = make.truth()
    made = make.dfmf(true)
    sample = sample_of(made)
    for view, light in ((0, 0), (0, 3), (4, 1), (4, 3)):
        expected = np.maximum(made[1][view * make.LIGHTS + light], 0)
        assert np.array_equal(sample.image(view, light), expected)
    for vectors, angles in ((sample.views, true.views), (sample.lights, true.lights)):
        theta, phi = angles.astype(np.float32).astype(float).T
        expected = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
        assert np.allclose(vectors, np.stack(expected, 1), atol=1e-12)


def undone(model, v, mean, transform):
    """The models again, value by value."""
    yuv = np.array([[1, 0, 1.13983], [1, -0.39465, -0.5806], [1, 2.03211, 0]])
    one, two, three = v
    if model == 0:
        return v
    if model == 12:
        return np.exp(v) - E
    if model == 3:
        return np.array([one, two, three]) @ transform + mean
    if model == 4:
        return np.array([one + two - three, one + three, one - two - three])
    if model == 9:
        one = np.exp(one) - E
    if model == 10:
        one = np.exp(one) - E
        two, three = (np.sign(c) * np.exp(abs(c) + np.log(E)) for c in (two, three))
    if model == 11:
        one = np.exp(one) - E
        two, three = two * (one + E), three * (one + E)
    return yuv @ np.array([one, two, three])


@pytest.mark.parametrize("model", [0, 1, 3, 4, 9, 10, 11, 12])
def test_colour_models_are_undone(model):
    transform = np.array([[0.5, 0.25, 0], [0, 1, -0.5], [0.125, 0, 2]])
    made = make.dfmf(model=model, transform=transform)
    mean = np.array([0.5, 0.25, 0.125])
    coded = made[1].reshape(-1, 3)
    expected = np.array([undone(model, value, mean, transform) for value in coded])
    got = images(made).reshape(-1, 3)
    assert np.allclose(got, np.maximum(expected, 0), rtol=2e-5, atol=2e-6)
    assert (got == 0).any() or model in (10, 12)


def test_lab_is_colorimetric_and_linear():
    from btfcore.btf.bonn.models import ColourModel, decode

    lab = np.array([[100, 0, 0], [50, 0, 0], [0, 0, 0], [4, 0, 0]], np.float32)
    got = decode(ColourModel(2), lab)
    light = np.array([1, ((50 + 16) / 116) ** 3, 0, 4 / 903.2963])
    assert np.allclose(got, light[:, None], atol=2e-6)
    red = decode(ColourModel(2), np.array([54.2917, 80.8125, 69.8851], np.float32))
    assert np.allclose(red, [1, 0, 0], atol=2e-3)  # sRGB's red under D50


def test_dynamic_range_reduction_is_undone():
    made = make.fmf(reduced=1)
    assert np.allclose(images(made), np.maximum(np.exp(made[1]) - E, 0), rtol=1e-6)


@pytest.mark.parametrize("model", [0, 12])
def test_grey_samples_have_equal_colours(model):
    made = make.dfmf(model=model, channels=1, names=(b"Y",))
    expected = made[1] if model == 0 else np.exp(made[1]) - E
    assert np.allclose(images(made), np.maximum(expected, 0), rtol=1e-6)
    grey = make.bdi(channels=1, names=(b"Y",))
    assert np.array_equal(images(grey), np.repeat(grey[1], 3, axis=3))


@pytest.mark.parametrize("components", [1, 2, 3, 100])
def test_the_first_components_alone_can_be_read(components):
    true = make.truth()
    texels = make.WIDTH * make.HEIGHT
    left, right = true.matrix(20, texels, 0)
    expected = left[:, :components] @ right[:, :components].T
    got = images(make.dfmf(true), components=components)
    assert np.array_equal(got[..., 0].reshape(20, texels), np.maximum(expected, 0))
    assert images(make.fmf(true), components=components).shape == (20, 8, 6, 3)
    assert np.array_equal(images(make.pvf(true), components=100), np.maximum(make.pvf(true)[1], 0))
    notes = " ".join(sample_of(make.pvf(true), components=components).notes)
    assert (f"first {components} of 3" in notes) == (components < 3)


@pytest.mark.parametrize("form", FORMS)
def test_flip_turns_the_rows_over(form):
    assert np.array_equal(images(FORMS[form], flip=True), images(FORMS[form])[:, ::-1])


@pytest.mark.parametrize("cosine", [0, 1])
def test_values_with_and_without_cosine_are_left_as_they_are(cosine):
    made = make.dfmf(cosine=cosine)
    sample = sample_of(made)
    assert sample.cosine == bool(cosine)
    assert np.array_equal(images(made), np.maximum(made[1], 0))


@pytest.mark.parametrize("version", [1, 2, 3, 4])
def test_versions_of_the_description(version):
    sample = sample_of(make.dfmf(version=version))
    assert sample.cosine == (version > 1)
    assert any("too old" in note for note in sample.notes) == (version == 1)
    assert sample.texel_size == pytest.approx(1 / 12.5)
    assert sample.name == "cloth.btf"


@pytest.mark.parametrize("ppmm", [0, -3, np.nan, np.inf, 1e-30, 1e30])
def test_a_nonsensical_resolution_leaves_the_texel_size_open(ppmm):
    sample = sample_of(make.dfmf(ppmm=ppmm))
    assert sample.texel_size is None
    assert any("pixels per mm" in note for note in sample.notes)


def test_what_the_measurement_says_is_kept_printable():
    words = (b"dome\x07 \xe4\nX\0hidden", "Kamera \N{EURO SIGN}".encode(), b"s" * 80)
    sample = sample_of(make.dfmf(words=words, scale=(1, 2, 3)))
    assert sample.origin.isprintable()
    assert "dome" in sample.origin and "hidden" not in sample.origin
    assert "Kamera \N{EURO SIGN}" in sample.origin
    assert sample.origin.endswith("; " + "s" * 80)  # a string without an end stops at its field
    assert "RGB scale 1, 2, 3 in the file, not applied" in sample.notes
    assert any("rotations" in note for note in sample_of(make.dfmf(rotations=4)).notes)
    assert any("named X, Y, Z" in n for n in sample_of(make.dfmf(names=(b"X", b"Y", b"Z"))).notes)


def test_highlights_are_kept_and_what_is_not_finite_counts_as_nothing():
    made = make.dfmf(scalar=2)
    start, _ = made[0].at("U0")
    bad = bytearray(made[0].data)
    bad[start : start + 6] = np.array([np.nan, np.inf, 16384], "<f2").tobytes()
    start, _ = made[0].at("SxV0")
    bad[start : start + 6] = np.array([2, 2, 2], "<f2").tobytes()
    sample = bonn_sample("x", bytes(bad))
    first = sample.image(0, 0)
    assert first[0, 0, 0] == 32768
    assert np.isfinite(first).all() and first.min() == 0
    assert "2 factors are not finite and count as 0" in sample.notes
    logs = make.dfmf(model=12)
    start, _ = logs[0].at("U0")
    data = bytearray(logs[0].data)
    data[start : start + 2] = np.array([60000], "<f2").tobytes()
    assert np.isfinite(bonn_sample("x", bytes(data)).image(0, 0)).all()


def test_an_r_that_belongs_to_the_size_is_no_signature():
    # 264 + 4 + 4 + xml + 4 + 15 = 0x152 = 338, whose first byte is the letter R.
    xml = b"x" * (338 - 264 - 8 - 4 - 15)
    for turns in (None, 0, 2):
        made = make.fmf(extension=None, rotations=turns, xml=xml)
        start, _ = made[0].at("struct_size")
        assert made[0].data[start] == ord("R")
        assert np.array_equal(images(made), np.maximum(made[1], 0))


def test_a_description_of_the_size_of_the_old_magic_number():
    made = make.pvf(version=3, xml=b"x" * (301074 - 264 - 8))
    assert made[0].data[made[0].at("struct_size")[0] :][:4] == (301074).to_bytes(4, "little")
    sample = sample_of(made)
    assert sample.texel_size is not None
    assert np.array_equal(images(made), np.maximum(made[1], 0))


def test_lights_told_with_other_angles_are_the_same_lights():
    made = make.dfmf()
    start, length = made[0].at("lights2")
    angles = make.truth().lights.copy()
    angles[0, 1] = 1.0  # at the pole every azimuth serves
    angles[1:, 1] += 2 * np.pi
    data = made[0].patched("lights2", angles.astype("<f4").tobytes())
    assert length == angles.size * 4 and start
    assert bonn_sample("x", data).images == 20


def test_formats_are_known_by_their_first_bytes():
    for build in make.every().values():
        data = bytes(build()[0].data)
        assert is_bonn(data[:HEAD]) and not is_bonn(data[:7]) and not is_bonn(data[1:])
    assert not is_bonn(b"") and not is_bonn(b"!DFMF09FCR")


def test_reading_a_bdi_file_in_order_goes_through_it_once(monkeypatch):
    made = make.bdi()
    seven = 7 * make.WIDTH * make.HEIGHT * 3 * 2 / 2**20
    stack = sample_of(made, memory_mb=seven).stack
    gather, runs = stack._gather, []
    monkeypatch.setattr(stack, "_gather", lambda *run: runs.append(run) or gather(*run))
    for number in range(20):
        assert np.array_equal(stack.read([number])[0], made[1][number])
    assert runs == [(0, 7), (7, 14), (14, 20)]
    assert np.array_equal(stack.read([0, 19]), made[1][[0, 19]])
    assert runs[3:] == [(0, 1), (19, 20)]  # too far apart for one run


def test_files_are_read_by_path(tmp_path):
    made = make.fmf()
    path = tmp_path / "cloth \N{SNOWMAN}.btf"
    path.write_bytes(made[0].data)
    sample = read_bonn(path)
    assert sample.name == "cloth \N{SNOWMAN}"
    assert np.array_equal(sample.stack.read([4])[0], np.maximum(made[1][4], 0))
    assert not sample.views.flags.writeable and sample.missing == 0


@pytest.mark.parametrize("knobs", [{"components": 0}, {"components": -1}, {"memory_mb": -1}])
def test_knobs_are_checked(knobs, tmp_path):
    with pytest.raises(InvalidParameter, match=next(iter(knobs))):
        sample_of(FORMS["pvf old"], **knobs)


def test_the_real_directions_fit(data):
    # The 151 directions of Bonn's dome, written into a file and read again.
    table = np.genfromtxt(data / "btf" / "ubo2014_151_directions.csv", delimiter=",", names=True)
    angles = np.radians(np.stack([table["zenith_deg"], table["azimuth_deg"]], axis=1))
    made = make.dfmf(make.Truth(angles, angles))
    sample = sample_of(made)
    assert sample.index.shape == (151, 151)
    assert np.array_equal(sample.stack.read([22800])[0], np.maximum(made[1][22800], 0))


def test_errors_begin_with_the_name_of_the_file(tmp_path):
    path = tmp_path / "broken.btf"
    path.write_bytes(make.fmf()[0].data[:-1])
    with pytest.raises(InvalidBtf, match=r"^broken\.btf: right factors at byte [\d,]+ needs"):
        read_bonn(path)
