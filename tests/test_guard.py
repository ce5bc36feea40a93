"""Whatever happens to a guarded child becomes a named error, and limits hold."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from btfcore import guard
from btfcore.errors import Cancelled, GuardedFailure, InvalidImage

posix_only = pytest.mark.skipif(os.name != "posix", reason="the system has no such limits")

TASKS = """
import os, sys, time
import numpy as np
from btfcore.errors import InvalidImage

def double(arrays, options):
    return {key: 2 * value for key, value in arrays.items()}, options | {"seen": sorted(arrays)}

def refuse(arrays, options):
    raise InvalidImage("7 of 9 rows are missing")

def stumble(arrays, options):
    raise LookupError("nobody expected this")

def leave(arrays, options):
    print("last words", flush=True)
    os._exit(3)

def crash(arrays, options):
    os.kill(os.getpid(), 11)

def hang(arrays, options):
    time.sleep(60)

def spin(arrays, options):
    while True:
        pass

def devour(arrays, options):
    return {"much": np.ones(1 << 40, np.uint8)}, {}

def vanish(arrays, options):
    os.remove(sys.argv[2] + "/in.json")
    os.mkdir(sys.argv[2] + "/out.json.lock")
    os._exit(0)

def paths(arrays, options):
    return {}, {"path": sys.path, "threads": os.environ["OMP_NUM_THREADS"]}
"""


@pytest.fixture
def call(tmp_path, monkeypatch):
    """Run a task of a package that stands in for btfcore's own."""
    root = tmp_path / "root"
    (root / "btfcore").mkdir(parents=True)
    here = os.path.dirname(guard.__file__)
    for name in os.listdir(here):
        if name.endswith(".py"):
            os.symlink(os.path.join(here, name), root / "btfcore" / name)
    (root / "btfcore" / "trial.py").write_text(TASKS)
    monkeypatch.setattr(guard, "_ROOT", str(root))

    def run(name, arrays=None, options=None, **knobs):
        knobs = {"limit_s": 30, "label": "trying"} | knobs
        return guard.run_guarded(f"btfcore.trial:{name}", arrays or {}, options or {}, **knobs)

    return run


def test_arrays_and_options_go_in_and_out(call):
    given = {"file": np.arange(3.0), "args": np.ones((2, 0), np.uint8), "x": np.array(4)}
    arrays, options = call("double", given, {"text": "grün", "none": None})
    assert options == {"text": "grün", "none": None, "seen": ["args", "file", "x"]}
    for key, value in given.items():
        assert np.array_equal(arrays[key], 2 * value)
        assert arrays[key].shape == value.shape


def test_errors_of_the_child_are_named_in_the_parent(call):
    with pytest.raises(InvalidImage, match="7 of 9 rows are missing"):
        call("refuse")
    with pytest.raises(GuardedFailure, match="trying failed.*nobody expected this"):
        call("stumble")
    with pytest.raises(GuardedFailure, match="exit status 3: last words"):
        call("leave")
    with pytest.raises(GuardedFailure, match="without an answer"):
        call("vanish")


@posix_only
def test_crashes_and_limits_are_named(call):
    with pytest.raises(GuardedFailure, match="SIGSEGV"):
        call("crash")
    with pytest.raises(GuardedFailure, match=r"longer than 0\.5 s"):
        call("hang", limit_s=0.5)
    with pytest.raises(GuardedFailure, match="memory"):
        call("devour", limit_mb=2048)


def test_tasks_outside_the_package_are_refused():
    with pytest.raises(ValueError, match="outside btfcore"):
        guard.run_guarded("os:system", {}, {}, limit_s=1)


def test_cancelling_kills_the_child_and_leaves_no_files(call, tmp_path, monkeypatch):
    monkeypatch.setattr(guard.tempfile, "tempdir", str(tmp_path))
    calls = []

    def stop(fraction, label):
        calls.append((fraction, label))
        if len(calls) > 3:
            raise Cancelled

    start = time.monotonic()
    with pytest.raises(Cancelled):
        call("hang", progress=stop)
    assert time.monotonic() - start < 20  # not the 60 s that the child sleeps
    assert [label for _, label in calls] == ["trying"] * 4
    assert sorted(fraction for fraction, _ in calls) == [fraction for fraction, _ in calls]
    assert not list(tmp_path.glob("patina-*"))


def test_no_room_for_temporary_files_is_named(call, tmp_path, monkeypatch):
    monkeypatch.setattr(guard.tempfile, "tempdir", str(tmp_path / "missing"))
    with pytest.raises(GuardedFailure, match="could not be served"):
        call("double")


def test_the_child_imports_nothing_from_the_working_folder(call, tmp_path, monkeypatch):
    (tmp_path / "numpy.py").write_text("raise SystemExit('a stranger was imported')")
    monkeypatch.chdir(tmp_path)
    _, options = call("paths")
    assert "" not in options["path"]
    assert str(tmp_path) not in options["path"]
    assert options["threads"] == "1"


@posix_only
def test_an_orphan_ends_by_its_processor_time(tmp_path, call):
    folder = tmp_path / "job"
    folder.mkdir()
    job = {"task": "btfcore.trial:spin", "options": {}, "limit_mb": 4096, "cpu_s": 1}
    (folder / "in.json").write_text(json.dumps(job))
    np.savez(folder / "in.npz")
    command = [sys.executable, "-P", "-c", guard._BOOT, guard._ROOT, str(folder)]
    ended = subprocess.run(command, timeout=60, check=False)
    assert ended.returncode in (-signal.SIGXCPU, -signal.SIGKILL)
