"""Archives and folders of strangers: a named error, or nothing but what is there."""

import struct

import pytest

from btfcore.btf.readers.bonn_names import looks_like_named_images, read_named_images
from btfcore.btf.readers.listing import list_files
from btfcore.btf.readers.members import read_bytes
from btfcore.btf.readers.pbr_files import looks_like_pbr, read_pbr
from btfcore.btf.readers.ptm import looks_like_ptm, read_ptm
from btfcore.btf.readers.table import looks_like_table, read_table
from btfcore.errors import InvalidBtf, PatinaError
from tests.btf.readers.hostile import ARCHIVES, MEMBERS, NAME, Member, archive
from tests.btf.readers.sets import picture, png, to_folder, to_zip

READERS = (read_named_images, read_table, read_ptm, read_pbr)
GUESSES = (looks_like_named_images, looks_like_table, looks_like_ptm, looks_like_pbr)


@pytest.mark.parametrize("kind", ARCHIVES)
def test_hostile_archives_are_refused_by_every_reader(tmp_path, kind):
    data, words = ARCHIVES[kind]
    path = tmp_path / "set.zip"
    path.write_bytes(data)
    with pytest.raises(InvalidBtf, match=words) as caught:
        list_files(path)
    assert str(caught.value).startswith("set.zip: ")
    for reader in READERS:
        with pytest.raises(PatinaError):
            reader(path)
    assert not any(guess(path) for guess in GUESSES)
    assert [each.name for each in tmp_path.iterdir()] == ["set.zip"]


@pytest.mark.parametrize("kind", MEMBERS)
def test_members_that_lie_are_refused_when_read(tmp_path, kind):
    data, words = MEMBERS[kind]
    path = tmp_path / "set.zip"
    path.write_bytes(data)
    files = list_files(path)
    with pytest.raises(InvalidBtf, match=words) as caught:
        read_bytes(files.place, files.entries[0], most=1 << 20)
    assert str(caught.value).startswith(NAME.decode())


def test_a_bomb_in_a_member_is_unpacked_no_further_than_announced(tmp_path, in_process):
    path = tmp_path / "set.zip"
    path.write_bytes(archive([Member(NAME, bytes(1 << 24), method=8, size=100)]))
    with pytest.raises(InvalidBtf, match=r"\(101 of 100\)"):
        read_named_images(path)


def test_a_hundred_thousand_empty_members(tmp_path, in_process):
    path = tmp_path / "set.zip"
    members = [Member(b"%06d.png" % number) for number in range(2000)]
    path.write_bytes(archive(members))
    with pytest.raises(InvalidBtf, match="none of its 2000 images"):
        read_named_images(path)
    entry = struct.pack("<6H3L5H2L", 20, 20, 0, 0, 0, 33, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0)
    many = b"".join(b"PK\x01\x02" + entry + b"%08d" % n for n in range(140_000))
    end = struct.pack("<4H2LH", 0, 0, 0xFFFF, 0xFFFF, len(many), 0, 0)
    fields = (44, 45, 45, 0, 0, 140_000, 140_000, len(many), 0)
    wide = b"PK\x06\x06" + struct.pack("<Q2H2L4Q", *fields)
    wide += b"PK\x06\x07" + struct.pack("<LQL", 0, len(many), 1)
    path.write_bytes(many + wide + b"PK\x05\x06" + end)
    with pytest.raises(InvalidBtf, match="140,000 members"):
        read_named_images(path)


def test_sixty_four_bit_archives_and_those_behind_something_are_read(tmp_path):
    data = png(picture(3))
    plain = archive([Member(NAME, data)])
    length = plain.rindex(b"PK\x05\x06") - plain.index(b"PK\x01\x02")
    start = plain.index(b"PK\x01\x02")
    extra = struct.pack("<2H2Q", 1, 16, len(data), len(data))
    wide = Member(NAME, data, size=0xFFFFFFFF, packed=0xFFFFFFFF, extra=extra)
    cases = [
        plain,
        archive([Member(NAME, data)], before=b"#!/bin/sh\n"),
        archive([Member(NAME, data)], zip64=(1, length, start)),
        archive([wide]),
        archive([Member(NAME, data, method=8)], comment=b"made by hand PK\x05\x06"),
    ]
    for number, content in enumerate(cases):
        path = tmp_path / f"{number}.zip"
        path.write_bytes(content)
        files = list_files(path)
        assert read_bytes(files.place, files.entries[0], most=1 << 20) == data, number


def test_nested_archives_and_leftovers_are_passed_over(tmp_path, in_process):
    files = {
        NAME.decode(): png(picture(1)),
        "__MACOSX/._x tl000 pl000 tv000 pv000.png": b"fork",
        ".DS_Store": b"",
        "more.zip": b"PK\x03\x04",
        "read me.txt": b"hello",
    }
    sample = read_named_images(to_zip(tmp_path / "set.zip", files))
    assert sample.images == 1
    assert any("1 archives inside" in note for note in sample.notes)


def test_links_in_folders(tmp_path, in_process):
    outside = to_folder(tmp_path / "outside", {"tl000 pl000 tv000 pv000.png": png(picture(1))})
    inside = to_folder(tmp_path / "set", {"tl010 pl000 tv000 pv000.png": png(picture(2))})
    (inside / "folder").symlink_to(outside)
    (inside / "loop").symlink_to(inside)
    (inside / "gone").symlink_to(tmp_path / "nowhere")
    sample = read_named_images(inside)
    assert sample.images == 1
    assert any("3 links" in note for note in sample.notes)
    (inside / "secret.png").symlink_to(outside / "tl000 pl000 tv000 pv000.png")
    for reader in (read_named_images, read_table, read_pbr):
        with pytest.raises(InvalidBtf, match=r"secret\.png is a link that leads out"):
            reader(inside)


def test_what_is_not_there_or_no_file_at_all(tmp_path):
    for path in (tmp_path / "nothing", tmp_path / "x\0y"):
        for reader in READERS:
            with pytest.raises(PatinaError):
                reader(path)
        assert not any(guess(path) for guess in GUESSES)


def test_broken_images_in_a_real_child(tmp_path):
    whole = png(picture(1, (200, 200)))
    to_folder(tmp_path / "cut", {"tl000 pl000 tv000 pv000.png": whole[:-400]})
    with pytest.raises(PatinaError, match=r"^tl000 pl000 tv000 pv000\.png: .*cut off"):
        read_named_images(tmp_path / "cut")
    text = {"tl000 pl000 tv000 pv000.exr": b"version https://git-lfs.github.com/spec/v1\n"}
    with pytest.raises(PatinaError, match=r"^tl000 pl000 tv000 pv000\.exr: a Git LFS pointer"):
        read_named_images(to_folder(tmp_path / "lfs", text))
