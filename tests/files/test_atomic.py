"""Laws of output files: whole or absent, whatever interrupts the writing."""

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from btfcore.errors import Cancelled, OutputFailed
from btfcore.files.atomic import atomic_group, atomic_output, check_writable, write_bytes

ROOT = Path(__file__).resolve().parents[2]


def content(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_finished_block_leaves_exactly_its_file(tmp_path):
    for text in (b"one", b"", b"two" * 100000):
        with atomic_output(tmp_path / "out.bin") as handle:
            handle.write(text)
            assert (tmp_path / "out.bin").exists() == (text != b"one")
        assert content(tmp_path) == {"out.bin": text}


@pytest.mark.parametrize("fault", [KeyboardInterrupt, Cancelled, ValueError, MemoryError])
@pytest.mark.parametrize("older", [None, b"older"])
def test_an_interrupted_block_changes_nothing(tmp_path, fault, older):
    path = tmp_path / "out.bin"
    if older is not None:
        path.write_bytes(older)
    with pytest.raises(fault), atomic_output(path) as handle:
        handle.write(b"half")
        raise fault
    assert content(tmp_path) == ({} if older is None else {"out.bin": older})


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_full_disk_is_named_and_leaves_nothing(tmp_path, monkeypatch, call):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, call, full)
    with pytest.raises(OutputFailed, match=r"out\.bin.*disk is full"):
        write_bytes(tmp_path / "out.bin", b"data")
    assert content(tmp_path) == {}


def test_a_group_appears_together_or_not_at_all(tmp_path):
    paths = [tmp_path / name for name in ("a", "b", "c")]
    with pytest.raises(Cancelled), atomic_group(paths) as handles:
        for handle in handles:
            handle.write(b"x")
        raise Cancelled
    assert content(tmp_path) == {}
    with atomic_group(paths) as handles:
        for handle, path in zip(handles, paths, strict=True):
            handle.write(path.name.encode())
    assert content(tmp_path) == {"a": b"a", "b": b"b", "c": b"c"}


def test_the_last_of_a_group_is_renamed_last(tmp_path, monkeypatch):
    done = []
    monkeypatch.setattr(os, "replace", lambda _, final: done.append(Path(final).name))
    with atomic_group([tmp_path / "png", tmp_path / "mtl", tmp_path / "obj"]):
        pass
    assert done == ["png", "mtl", "obj"]


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("folder", "is a directory"),
        ("folder/", "is a directory"),
        ("missing/out.bin", "does not exist"),
        ("file/out.bin", "not a directory"),
        ("x" * 300, "name is too long"),
        ("nul\0", "null"),
    ],
)
def test_impossible_places_are_named_before_and_at_writing(tmp_path, name, reason):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_bytes(b"kept")
    before = sorted(os.listdir(tmp_path))
    for attempt in (check_writable, lambda path: write_bytes(path, b"data")):
        with pytest.raises(OutputFailed, match=reason):
            attempt(f"{tmp_path}/{name}")
    assert sorted(os.listdir(tmp_path)) == before
    assert (tmp_path / "file").read_bytes() == b"kept"


@pytest.mark.skipif(not os.path.exists("/dev/null"), reason="no device files here")
def test_devices_are_not_replaced():
    with pytest.raises(OutputFailed, match="not a regular file"):
        check_writable("/dev/null")


def test_refusal_of_the_system_is_named(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(os, "open", refuse)  # root may write anywhere, so modes cannot tell
    for attempt in (check_writable, lambda path: write_bytes(path, b"data")):
        with pytest.raises(OutputFailed, match=r"out\.bin.*permission denied"):
            attempt(tmp_path / "out.bin")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root ignores modes")
def test_an_unwritable_folder_is_named(tmp_path):
    tmp_path.chmod(0o555)
    with pytest.raises(OutputFailed, match="permission denied"):
        check_writable(tmp_path / "out.bin")


def test_checking_leaves_nothing_and_keeps_the_older_file(tmp_path):
    check_writable(tmp_path / "out.bin")
    assert content(tmp_path) == {}
    (tmp_path / "out.bin").write_bytes(b"older")
    check_writable(tmp_path / "out.bin")
    assert content(tmp_path) == {"out.bin": b"older"}


def test_links_are_written_through_and_modes_follow_the_umask(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link.bin").symlink_to(tmp_path / "real" / "target.bin")
    (tmp_path / "plain").write_bytes(b"")
    write_bytes(tmp_path / "link.bin", b"data")
    assert (tmp_path / "link.bin").is_symlink()
    assert (tmp_path / "real" / "target.bin").read_bytes() == b"data"
    mode = (tmp_path / "real" / "target.bin").stat().st_mode
    assert mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX limits")
def test_a_file_size_limit_is_named_and_leaves_nothing(tmp_path):
    code = (
        "import resource, sys, numpy as np\n"
        "from btfcore.errors import OutputFailed\n"
        "from btfcore.files.atomic import atomic_output\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (65536, 65536))\n"
        "try:\n"
        "    with atomic_output(sys.argv[1]) as handle:\n"
        "        for _ in range(64):\n"
        "            handle.write(bytes(4096))\n"
        "except OutputFailed as error:\n"
        "    sys.exit(0 if 'size limit' in str(error) else str(error))\n"
        "sys.exit('no error')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "out.bin")], cwd=ROOT, capture_output=True
    )
    assert done.returncode == 0, done.stderr.decode()
    assert content(tmp_path) == {}


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGKILL")
def test_a_killed_writer_leaves_nothing_under_the_final_name(tmp_path):
    code = (
        "import sys, time\n"
        "from btfcore.files.atomic import atomic_output\n"
        "with atomic_output(sys.argv[1]) as handle:\n"
        "    while True:\n"
        "        handle.write(bytes(4096)); handle.flush(); time.sleep(0.001)\n"
    )
    (tmp_path / "old.bin").write_bytes(b"older")
    for name in ("new.bin", "old.bin"):
        child = subprocess.Popen([sys.executable, "-c", code, str(tmp_path / name)], cwd=ROOT)
        try:
            limit = time.monotonic() + 30
            while time.monotonic() < limit:
                if any(path.suffix == ".part" and path.stat().st_size > 4096
                       for path in tmp_path.iterdir()):  # fmt: skip
                    break
                time.sleep(0.01)
        finally:
            child.send_signal(signal.SIGKILL)
            child.wait()
        for path in tmp_path.glob(".patina-*.part"):
            path.unlink()
    assert content(tmp_path) == {"old.bin": b"older"}
