"""Runs foreign native code in a child process with limits of time and memory.

xatlas, image decoders and mesh parsers can crash, hang or ask for absurd amounts of memory
on hostile files. They run here: arrays and JSON go in and out through files without pickle,
and whatever happens to the child becomes a named error in the parent.
"""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore import errors
from btfcore.progress import Progress, silent

Arrays = dict[str, NDArray[Any]]
Options = dict[str, Any]
_ROOT = str(Path(__file__).resolve().parent.parent)
_BOOT = "import sys; sys.path.insert(0, sys.argv[1]); from btfcore.guard import _child; _child()"


def run_guarded(
    task: str,
    arrays: Mapping[str, NDArray[Any]],
    options: Mapping[str, Any],
    *,
    limit_s: float,
    limit_mb: int = 8192,
    progress: Progress = silent,
    label: str = "working",
) -> tuple[Arrays, Options]:
    """Run ``module:function`` of btfcore in a child process and return what it returns.

    The function takes ``(arrays, options)`` and returns the same pair of dictionaries; the
    values of `options` are JSON. A `PatinaError` raised in the child is raised here again;
    a crash, a time-out (`limit_s` seconds) or too much memory (`limit_mb` MiB of address
    space, POSIX only) raises `GuardedFailure`. Cancelling through `progress` kills the child.
    """
    if not task.startswith("btfcore."):
        raise ValueError(f"guarded task {task!r} lies outside btfcore")
    with tempfile.TemporaryDirectory(prefix="patina-") as name:
        folder = Path(name)
        np.savez(folder / "in.npz", **{f"_{key}": value for key, value in arrays.items()})
        job = {"task": task, "options": dict(options), "limit_mb": limit_mb}
        (folder / "in.json").write_text(json.dumps(job), encoding="utf-8")
        _watch(folder, task, limit_s, progress, label)
        return _result(folder, task)


def _watch(folder: Path, task: str, limit_s: float, progress: Progress, label: str) -> None:
    """Start the child and wait for it, listening to `progress`; kill it when it must stop."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    with (folder / "log").open("wb") as log:
        child = subprocess.Popen(
            [sys.executable, "-c", _BOOT, _ROOT, str(folder)],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            env=environment,
        )
        start = time.monotonic()
        try:
            while True:
                try:
                    child.wait(timeout=0.05)
                    break
                except subprocess.TimeoutExpired:
                    spent = time.monotonic() - start
                    if spent > limit_s:
                        raise errors.GuardedFailure(
                            f"{task} ran longer than {limit_s:g} s and was stopped"
                        ) from None
                    progress(min(spent / limit_s, 0.99), label)
        finally:
            if child.poll() is None:
                child.kill()
                child.wait()
    if child.returncode != 0:
        tail = (folder / "log").read_bytes()[-400:].decode("utf-8", "replace").strip()
        last = tail.splitlines()[-1] if tail else "no message"
        raise errors.GuardedFailure(f"{task} ended with exit status {child.returncode}: {last}")


def _result(folder: Path, task: str) -> tuple[Arrays, Options]:
    """Read what the child left, raising its error again where there was one."""
    try:
        answer = json.loads((folder / "out.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise errors.GuardedFailure(f"{task} ended without an answer") from error
    if "error" in answer:
        kind = getattr(errors, answer["error"], errors.GuardedFailure)
        raise kind(answer["message"])
    with np.load(folder / "out.npz", allow_pickle=False) as stored:
        return {key[1:]: stored[key] for key in stored.files}, answer["options"]


def _limit_memory(limit_mb: int) -> None:
    """Cap the address space where the system can."""
    try:
        import resource
    except ImportError:  # Windows has no resource module
        return
    if sys.platform == "linux":  # macOS ignores or refuses RLIMIT_AS
        resource.setrlimit(resource.RLIMIT_AS, (limit_mb << 20, limit_mb << 20))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _child() -> None:
    """Entry of the child process: run the task found in the folder named by argv[2]."""
    folder = Path(sys.argv[2])
    job = json.loads((folder / "in.json").read_text(encoding="utf-8"))
    _limit_memory(int(job["limit_mb"]))
    module, _, name = job["task"].partition(":")
    if not module.startswith("btfcore."):
        raise SystemExit(f"task {job['task']!r} lies outside btfcore")
    answer: dict[str, Any]
    try:
        with np.load(folder / "in.npz", allow_pickle=False) as stored:
            arrays = {key[1:]: stored[key] for key in stored.files}
        out, options = getattr(importlib.import_module(module), name)(arrays, job["options"])
        np.savez(folder / "out.npz", **{f"_{key}": value for key, value in out.items()})
        answer = {"options": options}
    except errors.PatinaError as error:
        answer = {"error": type(error).__name__, "message": str(error)}
    except MemoryError:
        text = f"{job['task']} needs more than {job['limit_mb']} MiB of memory"
        answer = {"error": "GuardedFailure", "message": text}
    (folder / "out.json").write_text(json.dumps(answer), encoding="utf-8")
