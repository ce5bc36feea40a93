"""What is written as a Bonn zip is read back under the same views and lights."""

import zipfile

import numpy as np
import pytest

from btfcore.btf.directions import layout
from btfcore.btf.readers import decode as decoding
from btfcore.btf.readers.bonn_names import read_named_images
from btfcore.btf.sample import BtfSample, full_index
from btfcore.btf.stack import ArrayStack
from btfcore.errors import Cancelled, InvalidParameter, OutputFailed
from btfcore.files.bonn_zip import KINDS, write_bonn_zip
from tests.btf.readers.conftest import in_process  # noqa: F401

# error of radiance below 1: half a step of 8 bits at its steepest, of half floats, of RGBE
TOLERANCE = {"png": 0.0045, "jpeg": 0.05, "exr": 5e-4, "exr-float": 0, "hdr": 0.0079}


def sample_on(name, *, missing=(), peak=1.0):
    """Few views and lights of a layout, with smooth images of (6, 8) texels."""
    directions = layout(name)
    views, lights = directions.views[[0, 5, 20]], directions.lights[[0, 3, 11, 40]]
    index = full_index(3, 4)
    for pair in missing:
        index[pair] = -1
    index[index >= 0] = np.arange((index >= 0).sum())
    y, x = np.mgrid[:6, :8] / 8
    rng = np.random.default_rng(5)
    count = int((index >= 0).sum())
    waves = rng.random((count, 1, 1, 3)) * 0.7 + 0.3 * (x + y)[None, :, :, None] / 2
    images = (waves * peak).astype(np.float32)
    return BtfSample("made", ArrayStack(images), views, lights, index)


def compare(written, found, tolerance):
    assert len(found.views) == len(written.views)
    assert len(found.lights) == len(written.lights)
    for view, light in written.pairs().tolist():
        place = []
        for old, new in ((written.views[view], found.views), (written.lights[light], found.lights)):
            apart = np.linalg.norm(new - old, axis=1)
            assert apart.min() < 1e-9
            place.append(int(apart.argmin()))
        apart = np.abs(found.image(*place) - np.minimum(written.image(view, light), 65504))
        assert apart.max() <= tolerance


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["ubo81", "12x5x12x5", "ubo151"])
def test_round_trip(tmp_path, kind, name, in_process):  # noqa: F811
    sample = sample_on(name, missing=[(1, 2)])
    path = tmp_path / "made.zip"
    notes = write_bonn_zip(path, sample, kind=kind, block_mb=0.005)
    found = read_named_images(path)
    compare(sample, found, TOLERANCE[kind])
    assert found.missing == 1
    assert any("1 conditions" in note for note in notes)
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        whole = "directions.csv" not in archive.namelist()
    assert whole == (name == "ubo81")
    assert any("whole degrees" in note for note in notes) != whole


def test_names_are_those_of_the_lab(tmp_path):
    path = tmp_path / "made.zip"
    write_bonn_zip(path, sample_on("ubo81"))
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
    assert names[0] == "tv000_pv000/00000 tl000 pl000 tv000 pv000.png"
    assert names[-1] == "tv045_pv020/00011 tl060 pl054 tv045 pv020.png"


def test_names_are_rounded_only_beside_a_table(tmp_path, in_process):  # noqa: F811
    exact = sample_on("12x5x12x5")
    path = tmp_path / "made.zip"
    write_bonn_zip(path, exact, kind="exr-float")
    with zipfile.ZipFile(path) as archive:
        text = archive.read("directions.csv").decode().splitlines()
    assert text[0] == "file,vx,vy,vz,lx,ly,lz"
    values = np.array([line.split(",")[1:] for line in text[1:]], float)
    pairs = exact.pairs()
    assert np.array_equal(values[:, :3], exact.views[pairs[:, 0]])
    assert np.array_equal(values[:, 3:], exact.lights[pairs[:, 1]])


def test_what_is_clipped_is_counted(tmp_path, in_process):  # noqa: F811
    bright = sample_on("ubo81", peak=3)
    over = int((bright.stack.read(range(12)) > 1).sum())
    notes = write_bonn_zip(tmp_path / "a.zip", bright, kind="png")
    assert any(f"clipped {over:,} values above 1" in note for note in notes)
    assert write_bonn_zip(tmp_path / "b.zip", bright, kind="exr") == ()
    compare(bright, read_named_images(tmp_path / "b.zip"), 2e-3)
    sun = sample_on("ubo81", peak=1e6)
    (note,) = write_bonn_zip(tmp_path / "c.zip", sun, kind="exr")
    assert "above 65504" in note
    compare(sun, read_named_images(tmp_path / "c.zip"), 32)


def test_the_same_sample_makes_the_same_bytes(tmp_path):
    sample = sample_on("ubo81")
    for name in ("a.zip", "b.zip"):
        write_bonn_zip(tmp_path / name, sample)
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()


def test_nothing_is_left_behind_or_lost(tmp_path):
    path = tmp_path / "made.zip"
    path.write_bytes(b"older")

    def stop(fraction, label):
        if fraction > 0.5:
            raise Cancelled

    with pytest.raises(Cancelled):
        write_bonn_zip(path, sample_on("ubo81"), progress=stop)
    with pytest.raises(InvalidParameter, match="'gif'"):
        write_bonn_zip(path, sample_on("ubo81"), kind="gif")
    assert path.read_bytes() == b"older"
    assert [each.name for each in tmp_path.iterdir()] == ["made.zip"]
    with pytest.raises(OutputFailed):
        write_bonn_zip(tmp_path / "no" / "made.zip", sample_on("ubo81"))


def test_what_the_zip_cannot_hold_is_told(tmp_path):
    from dataclasses import replace

    full = replace(
        sample_on("ubo81"), mask=np.zeros((6, 8), np.float32), licence="CC0", texel_size=0.1
    )
    (note,) = write_bonn_zip(tmp_path / "a.zip", full)
    assert note.endswith("mask, texel size, licence")
    assert decoding.IMAGES  # the reader knows every ending that is written
    assert {f".{ending}" for ending, _, _ in KINDS.values()} <= set(decoding.IMAGES)
