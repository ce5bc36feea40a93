"""Runs foreign native code in a child process with limits of time and memory.

xatlas, image decoders and mesh parsers can crash, hang or ask for absurd amounts of memory
on hostile files. They run here: arrays and JSON go in and out through files without pickle,
and whatever happens to the child becomes a named error in the parent.
"""

from __future__ import annotations

import importlib
import json
import os
import signal
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
    a crash, a time-out (`limit_s` seconds), too much memory (`limit_mb` MiB of address
    space, POSIX only) or no room for the temporary files raises `GuardedFailure`, which names
    `label`. Cancelling through `progress` kills the child; a child whose parent was killed
    ends when it has used up `limit_s` on every core.
    """
    if not task.startswith("btfcore."):
        raise ValueError(f"guarded task {task!r} lies outside btfcore")
    progress(0.0, label)
    try:
        with tempfile.TemporaryDirectory(prefix="patina-") as name:
            folder = Path(name)
            _store(folder / "in.npz", arrays)
            job = {"task": task, "options": dict(options), "limit_mb": limit_mb}
            job["cpu_s"] = int(limit_s * (os.cpu_count() or 1)) + 5
            (folder / "in.json").write_text(json.dumps(job), encoding="utf-8")
            _watch(folder, limit_s, progress, label)
            return _result(folder, label)
    except OSError as error:
        reason = f"{label}: the helper process could not be served: {error}"
        raise errors.GuardedFailure(reason) from error


def _store(file: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    named: dict[str, Any] = {f"_{key}": value for key, value in arrays.items()}
    np.savez(file, **named)  # the underscore keeps names apart from savez's own arguments


def _stored(file: Path) -> Arrays:
    with np.load(file, allow_pickle=False) as stored:
        return {key[1:]: stored[key] for key in stored.files}


def _watch(folder: Path, limit_s: float, progress: Progress, label: str) -> None:
    """Start the child and wait for it, listening to `progress`; kill it when it must stop."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    with (folder / "log").open("wb") as log:
        child = subprocess.Popen(
            [sys.executable, "-P", "-c", _BOOT, _ROOT, str(folder)],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            env=environment,
            start_new_session=True,  # Ctrl-C reaches the parent, which decides
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
                            f"{label} took longer than {limit_s:g} s and was stopped"
                        ) from None
                    progress(min(spent / limit_s, 0.99), label)
        finally:
            if child.poll() is None:
                child.kill()
                child.wait()
    if child.returncode != 0:
        raise errors.GuardedFailure(f"{label} failed: {_epitaph(folder, child.returncode)}")


def _epitaph(folder: Path, status: int) -> str:
    """Say how the child died, with the last line that it said itself."""
    with (folder / "log").open("rb") as log:
        log.seek(0, os.SEEK_END)
        log.seek(max(0, log.tell() - 400))
        tail = log.read().decode("utf-8", "replace").strip()
    last = tail.splitlines()[-1] if tail else "no message"
    if status < 0:
        return f"the helper process was ended by {signal.Signals(-status).name}: {last}"
    return f"the helper process ended with exit status {status}: {last}"


def _result(folder: Path, label: str) -> tuple[Arrays, Options]:
    """Read what the child left, raising its error again where there was one."""
    try:
        answer = json.loads((folder / "out.json").read_text(encoding="utf-8"))
        if "error" not in answer:
            return _stored(folder / "out.npz"), answer["options"]
    except (OSError, ValueError) as error:
        raise errors.GuardedFailure(f"{label} ended without an answer: {error}") from error
    kind = getattr(errors, answer["error"], errors.GuardedFailure)
    raise kind(answer["message"])


def _set_limits(limit_mb: int, cpu_s: int) -> None:
    """Cap the address space, processor time and core dumps where the system can."""
    try:
        import resource
    except ImportError:  # Windows has no resource module
        return
    if sys.platform == "linux":  # macOS ignores or refuses RLIMIT_AS
        resource.setrlimit(resource.RLIMIT_AS, (limit_mb << 20, limit_mb << 20))
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _child() -> None:
    """Entry of the child process: run the task found in the folder named by argv[2]."""
    folder = Path(sys.argv[2])
    job = json.loads((folder / "in.json").read_text(encoding="utf-8"))
    _set_limits(int(job["limit_mb"]), int(job["cpu_s"]))
    module, _, name = job["task"].partition(":")
    if not module.startswith("btfcore."):
        raise SystemExit(f"task {job['task']!r} lies outside btfcore")
    answer: dict[str, Any]
    try:
        arrays = _stored(folder / "in.npz")
        out, options = getattr(importlib.import_module(module), name)(arrays, job["options"])
        _store(folder / "out.npz", out)
        answer = {"options": options}
    except errors.PatinaError as error:
        answer = {"error": type(error).__name__, "message": str(error)}
    except MemoryError:
        text = f"more than {job['limit_mb']} MiB of memory would be needed"
        answer = {"error": "GuardedFailure", "message": text}
    (folder / "out.json").write_text(json.dumps(answer), encoding="utf-8")
