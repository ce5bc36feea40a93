"""Laws of the stored quilting map: exact, deterministic, and distrustful when read."""

import io
import os
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from btfcore.errors import InvalidQuilt, OutputFailed
from btfcore.files.quilt_npz import read_quilt_npz, write_quilt_npz
from tests.boxes import box, quilt_on


@pytest.fixture
def stored(tmp_path):
    _, dense = box(5)
    quilt, field = quilt_on(dense)
    path = tmp_path / "quilt.npz"
    write_quilt_npz(path, dense, field, quilt)
    return path, dense, field, quilt


def owners(dense, field, quilt):
    return {
        **dict.fromkeys(("vertices", "normals", "faces", "texel"), dense),
        **dict.fromkeys(("source", "angle", "sample", "patch"), quilt),
        "tangents": field,
    }


def test_numpy_alone_reads_every_array_bit_for_bit(stored):
    path, *values = stored
    with np.load(path, allow_pickle=False) as arrays:
        owner = owners(*values)
        assert sorted(arrays.files) == sorted(owner)
        for name, value in owner.items():
            assert arrays[name].dtype == getattr(value, name).dtype
            assert np.array_equal(arrays[name], getattr(value, name))


def test_reading_returns_what_was_written_locked(stored):
    path, *values = stored
    found = read_quilt_npz(path)
    for name, value in owners(*values).items():
        assert np.array_equal(getattr(found, name), getattr(value, name))
        assert not getattr(found, name).flags.writeable


def test_the_same_quilt_gives_the_same_bytes(stored, tmp_path):
    path, dense, field, quilt = stored
    again = tmp_path / "again.npz"
    write_quilt_npz(again, dense, field, quilt)
    assert again.read_bytes() == path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        assert {member.date_time for member in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


def rewrite(path, **changes):
    with np.load(path) as arrays:
        kept = {name: arrays[name] for name in arrays.files}
    kept.update(changes)
    np.savez(path, **{name: value for name, value in kept.items() if value is not None})


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("angle", lambda a: None, "angle.npy missing"),
        ("angle", lambda a: a[:-1], "149 rows of angle for 150"),
        ("angle", lambda a: a.astype(np.float64), "angle is float64"),
        ("angle", lambda a: a[:, None], "shape"),
        ("source", lambda a: np.where(a > 3, np.nan, a).astype(a.dtype), "source are not finite"),
        ("faces", lambda a: a + 1, "of 150 vertices"),
        ("faces", lambda a: a - 1, "faces name -1"),
        ("faces", lambda a: a[:0], "0 faces"),
        ("normals", lambda a: a * 2, "normals of length 2"),
        ("texel", lambda a: a * 0, "belong to two"),
        ("texel", lambda a: a - 99, "negative"),
        ("patch", lambda a: a - 2, "below -1"),
        ("patch", lambda a: np.array([{}] * len(a)), "patch is object"),
        ("vertices", lambda a: np.asfortranarray(a), "by rows"),
    ],
)
def test_contradictions_are_named(stored, name, change, words):
    path = stored[0]
    with np.load(path) as arrays:
        value = arrays[name]
    rewrite(path, **{name: change(value)})
    with pytest.raises(InvalidQuilt, match=words):
        read_quilt_npz(path)


def test_no_archive_more_members_compression_and_huge_shapes_are_refused(stored, tmp_path):
    path = stored[0]
    for data in (b"", b"PK\x03\x04", b"not a zip" * 100):
        (tmp_path / "bad.npz").write_bytes(data)
        with pytest.raises(InvalidQuilt, match=r"bad\.npz"):
            read_quilt_npz(tmp_path / "bad.npz")
    for absent in (tmp_path / "absent.npz", tmp_path):
        with pytest.raises(InvalidQuilt, match="cannot read"):
            read_quilt_npz(absent)
    with np.load(path) as arrays:
        kept = {name: arrays[name] for name in arrays.files}
    np.savez(tmp_path / "more.npz", **kept, extra=np.zeros(3))
    with pytest.raises(InvalidQuilt, match="10 members"):
        read_quilt_npz(tmp_path / "more.npz")
    np.savez_compressed(tmp_path / "pressed.npz", **kept)
    with pytest.raises(InvalidQuilt, match="compressed"):
        read_quilt_npz(tmp_path / "pressed.npz")
    header = io.BytesIO()
    shape = (1 << 60, 3)
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": shape}
    )
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(tmp_path / "huge.npz", "w") as new:
        for member in old.namelist():
            data = header.getvalue() if member == "vertices.npy" else old.read(member)
            new.writestr(member, data)
    with pytest.raises(InvalidQuilt, match="needs 27670116110564327424 bytes"):
        read_quilt_npz(tmp_path / "huge.npz")


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_damaged_bytes_are_refused_by_name_or_harmless(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("damage")
    _, dense = box(3)
    quilt, field = quilt_on(dense)
    path = folder / "quilt.npz"
    write_quilt_npz(path, dense, field, quilt)
    raw = bytearray(path.read_bytes())
    if data.draw(st.booleans()):
        raw = raw[: data.draw(st.integers(0, len(raw) - 1))]
    else:
        for _ in range(data.draw(st.integers(1, 4))):
            raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(raw)
    try:
        read_quilt_npz(path)
    except InvalidQuilt:
        pass


def test_a_full_disk_leaves_nothing(stored, tmp_path, monkeypatch):
    _, dense, field, quilt = stored
    folder = tmp_path / "full"
    folder.mkdir()

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputFailed, match="disk is full"):
        write_quilt_npz(folder / "quilt.npz", dense, field, quilt)
    assert list(folder.iterdir()) == []
