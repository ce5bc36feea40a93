"""A save that is killed, or that the system refuses, leaves the old file or the new one whole."""

import errno
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from btfcore.errors import Cancelled, OutputFailed
from btfcore.files import atomic
from btfcore.files.project import write
from btfcore.files.project.read import project_token, read_project
from btfcore.files.project.write import write_project
from tests.files.project.projects import project

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork and SIGKILL")
@pytest.mark.parametrize("mode", ["links", "no-links"])
def test_killed_at_each_step(tmp_path, mode):
    command = [sys.executable, "-m", "tests.files.project.killed", str(tmp_path), mode]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    steps = [json.loads(line) for line in done.stdout.splitlines()]
    names = [name for _, name, *_ in steps]
    for name in ("_sweep", "create", "_lock", "write", "flush", "fsync", "verify", "check_sum",
                 "replace", "_sync_folder"):  # fmt: skip
        assert name in names
    assert names.count("write") > 50 and names[-1] == ""  # the last run was left alone
    assert ("link" in names) == (mode == "links") and ("copyfile" in names) == (mode != "links")
    new = [bool(each) for _, _, each, *_ in steps]
    assert new == sorted(new) and new[-1]  # old up to the replacement, new after it
    replaced = names.index("_sync_folder")
    assert new.index(True) == replaced and names[replaced - 1] == "replace"
    for _, _, is_new, is_old, kept, _ in steps:
        assert is_old == (not is_new)
        assert kept or not is_new  # the old one is the backup before the new one counts
    assert steps[replaced - 2][5] == 2 and steps[-1][5] == 0  # swept by the save that followed


class Full(io.FileIO):
    """A file on a disk that is full after some writes."""

    left = 0

    def write(self, data):
        Full.left -= 1
        if Full.left < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(data)


def test_a_disk_full_at_each_write(tmp_path, monkeypatch):
    path, one = tmp_path / "a.patina", project()
    token = write_project(path, one)
    before = path.read_bytes()
    monkeypatch.setattr(
        atomic, "_temporary", lambda folder, prefix="": Full(folder / f"{prefix}x.part", "xb")
    )
    room = 0
    while project_token(path) == token:
        Full.left = room
        try:
            write_project(path, one)
        except OutputFailed as error:
            assert "disk is full" in str(error)
            assert path.read_bytes() == before
            assert [each.name for each in tmp_path.iterdir()] == ["a.patina"]
        room += 3
    assert room > 50


@pytest.mark.parametrize("call", ["fsync", "replace", "link"])
def test_a_refusal_at_the_end_leaves_the_old_file(tmp_path, monkeypatch, call):
    path = tmp_path / "a.patina"
    write_project(path, project())
    before = path.read_bytes()

    def refuse(*_):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, call, refuse)
    with pytest.raises(OutputFailed, match="a.patina"):
        write_project(path, project())
    assert path.read_bytes() == before
    assert [each.name for each in tmp_path.iterdir()] == ["a.patina"]


def test_what_does_not_read_back_does_not_count(tmp_path, monkeypatch):
    path = tmp_path / "a.patina"
    token = write_project(path, project())

    def rot(archive, handle, name, arrays):
        added(archive, handle, name, arrays)
        if name.startswith("dense"):  # what a bad disk does, after the checksum was made
            handle.flush()
            os.pwrite(handle.fileno(), b"\xff", handle.tell() - 100)

    added = write._add_arrays
    monkeypatch.setattr(write, "_add_arrays", rot)
    with pytest.raises(OutputFailed, match="does not read back: .*dense.* checksum"):
        write_project(path, project())
    assert project_token(path) == token
    assert [each.name for each in tmp_path.iterdir()] == ["a.patina"]


@pytest.mark.parametrize("at", [0.0, 0.3, 0.8])
def test_cancelling_a_save_leaves_the_old_file(tmp_path, at):
    path = tmp_path / "a.patina"
    token = write_project(path, project())

    def progress(fraction, label):
        if fraction >= at:
            raise Cancelled

    with pytest.raises(Cancelled):
        write_project(path, project(), progress=progress)
    assert read_project(path).token == token
    assert [each.name for each in tmp_path.iterdir()] == ["a.patina"]


def test_a_save_under_way_is_not_swept_by_another(tmp_path):
    pytest.importorskip("fcntl")
    path = tmp_path / "a.patina"
    with atomic.verified_output(path, lambda _: None) as handle:
        handle.write(b"slow")
        write_project(tmp_path / "b.patina", project())
        assert len(list(tmp_path.glob(".patina-save-*.part"))) == 1
    assert path.read_bytes() == b"slow"
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a.patina", "b.patina"]


def test_a_link_is_written_through_and_its_target_kept(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "a.patina").symlink_to(tmp_path / "real" / "b.patina")
    first = write_project(tmp_path / "a.patina", project())
    write_project(tmp_path / "a.patina", project())
    assert (tmp_path / "a.patina").is_symlink()
    assert project_token(tmp_path / "real" / "a.patina.bak") == first
