"""Folders in which running Patinas keep their work, and what crashed ones left there.

A folder belongs to the process that holds the lock on its file "lock". The system lets go of a
lock when its process ends, however that happens, so a crashed session is one whose lock can be
had: no process number has to be compared, and two that want the same folder cannot both get it.
Where the file system has no locks, the process named in "session.json" is looked up instead.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import secrets
import shutil
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from btfcore.errors import OutputFailed
from btfcore.files.atomic import write_bytes

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]
    import msvcrt

LOCK, INFO, CRASH = "lock", "session.json", "crash.txt"
SUFFIX, ABOUT = ".patina", ".json"
MOST_FILES, MOST_SESSIONS = 2, 20
LARGEST_TEXT = 1 << 16  # bytes of a small file that are read

_NO_LOCKS = {errno.ENOTSUP, errno.ENOSYS, errno.ENOLCK, errno.EINVAL}
_BEING_MADE_S = 3600.0  # a folder without a lock file is somebody's next session for that long


@dataclass(frozen=True)
class About:
    """What is known of a saved painting without reading it.

    name : for the user; edits : how many; saved : seconds since 1970; path, token : the user's
    own file and which save of it the painting began with, "" where there is none; extra : plain
    values that the window wants back.
    """

    name: str = ""
    edits: int = 0
    saved: float = 0.0
    path: str = ""
    token: str = ""
    extra: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Save:
    """One file of a session: where it lies, its bytes and what it holds."""

    file: Path
    size: int
    about: About


@dataclass(frozen=True)
class Left:
    """What a session left that did not end well: its saves, the newest first, and last words."""

    folder: Path
    saves: tuple[Save, ...]
    crash: str = ""


class Held:
    """A session's folder that this process holds until it is removed or let go."""

    def __init__(self, folder: Path, lock: BinaryIO) -> None:
        """`lock` is the open and locked file of `folder`."""
        self.folder = folder
        self._lock = lock

    @property
    def whole(self) -> bool:
        """Whether the folder is still there, with the lock that is held."""
        try:
            return os.path.samestat(os.fstat(self._lock.fileno()), (self.folder / LOCK).stat())
        except (OSError, ValueError):
            return False

    def next_file(self) -> Path:
        """Where the next save goes."""
        numbers = [_number(file) for file in _saves(self.folder)]
        return self.folder / f"{max(numbers, default=0) + 1:06}{SUFFIX}"

    def tell(self, file: Path, about: About) -> None:
        """Write what `file`, which need not be there yet, holds; raises `OutputFailed`."""
        text = json.dumps(vars(about) | {"extra": dict(about.extra)})
        write_bytes(file.with_suffix(ABOUT), text.encode())

    def prune(self, most: int = MOST_FILES) -> None:
        """Keep the newest `most` saves; raises nothing."""
        saves = _saves(self.folder)
        kept = {file.stem for file in saves[:most]}
        for file in [*saves[most:], *self.folder.glob(f"*{ABOUT}")]:
            if file.name != INFO and file.stem not in kept:
                with contextlib.suppress(OSError):
                    file.unlink()

    def release(self) -> None:
        """Let go of the folder; what is in it stays, for the next start to find."""
        self._lock.close()

    def remove(self) -> None:
        """Remove the folder with all that is in it; raises nothing."""
        with contextlib.suppress(OSError):
            for each in self.folder.iterdir():
                if each.name == LOCK:  # the last one, so that nobody takes half a folder
                    continue
                with contextlib.suppress(OSError):
                    shutil.rmtree(each) if each.is_dir() else each.unlink()
        if fcntl is None:
            self._lock.close()  # an open file cannot be removed there
        with contextlib.suppress(OSError):
            (self.folder / LOCK).unlink()
        self._lock.close()
        with contextlib.suppress(OSError):
            self.folder.rmdir()


def open_session(root: Path) -> Held:
    """Make and hold a folder of its own below `root`; raises `OutputFailed`."""
    try:
        root.mkdir(parents=True, exist_ok=True)
        for _ in range(20):
            folder = root / f"{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}-{secrets.token_hex(4)}"
            folder.mkdir()
            held = _take(folder, "xb")
            if held is None:
                continue  # swept away by another Patina before it was locked
            info = {"pid": os.getpid(), "started": _started(os.getpid()), "host": _host()}
            write_bytes(folder / INFO, json.dumps(info).encode())
            return held
    except OSError as error:
        reason = "the disk is full" if error.errno == errno.ENOSPC else error.strerror or error
        raise OutputFailed(f"cannot write in folder {root}: {reason}") from error
    raise OutputFailed(f"cannot write in folder {root}: each new folder in it vanishes")


def claim(folder: Path, *, patience_s: float = 0.5) -> Held | None:
    """Take over a crashed session's folder; None where a running Patina has it, or it is gone.

    Another Patina may be looking at it just now, so it is tried for `patience_s` seconds.
    """
    end = time.monotonic() + patience_s
    while True:
        try:
            held = _take(folder, "r+b")
        except OSError:
            return None
        if held is not None or time.monotonic() >= end:
            return held
        time.sleep(0.02)


def left_sessions(root: Path) -> list[Left]:
    """Sessions below `root` that left saves and do not run any more, the newest first."""
    found = []
    for folder in _folders(root):
        held = _look_at(folder)
        if held is not None:
            saves, crash = tuple(map(_save, _saves(folder))), _text(folder / CRASH).strip()
            held.release()
            if saves:
                found.append(Left(folder, saves, crash))
    return sorted(found, key=lambda each: -each.saves[0].about.saved)


def last_words(root: Path) -> list[str]:
    """What crashed sessions below `root` wrote that left no save; call it before `sweep`."""
    found = []
    for folder in _folders(root):
        held = _look_at(folder)
        if held is not None:
            words = "" if _saves(folder) else _text(folder / CRASH).strip()
            held.release()
            found += [words] if words else []
    return found


def sweep(root: Path, most: int = MOST_SESSIONS) -> None:
    """Remove folders of ended sessions that hold nothing, and all but the `most` newest others."""
    kept = {each.folder for each in left_sessions(root)[:most]}
    for folder in _folders(root):
        if folder in kept:
            continue
        held = claim(folder, patience_s=0.0)
        if held is not None:
            held.remove()
        elif not (folder / LOCK).exists():
            with contextlib.suppress(OSError):  # only where it is empty
                if time.time() - folder.stat().st_mtime > _BEING_MADE_S:
                    folder.rmdir()


# --- inside


def _look_at(folder: Path) -> Held | None:
    """Keep others from taking a folder while it is read, but not from reading it too."""
    try:
        return _take(folder, "r+b", shared=True)
    except OSError:
        return None


def _take(folder: Path, mode: str, *, shared: bool = False) -> Held | None:
    """Lock a folder's lock file; None where somebody else holds it or has removed it."""
    handle: BinaryIO = open(folder / LOCK, mode)  # type: ignore[assignment]  # noqa: SIM115
    try:
        if not _locked(handle, folder, shared):
            handle.close()
            return None
        held = Held(folder, handle)
        if held.whole:
            return held
    except OSError:
        handle.close()
        raise
    handle.close()
    return None


def _locked(handle: BinaryIO, folder: Path, shared: bool) -> bool:
    """Lock an open file without waiting; whether that went well."""
    try:
        if fcntl is None:
            msvcrt.locking(handle.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        else:
            kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
            fcntl.flock(handle, kind | fcntl.LOCK_NB)
    except OSError as error:
        if fcntl is not None and error.errno in _NO_LOCKS:
            return not _runs(folder)
        return False
    return True


def _runs(folder: Path) -> bool:
    """Whether the process that made the folder still runs; yes where that cannot be told."""
    try:
        info = json.loads(_text(folder / INFO) or "null")
        if info is None:
            return False
        pid, started, host = int(info["pid"]), str(info["started"]), str(info["host"])
    except (ValueError, KeyError, TypeError):
        return True
    if host != _host():
        return True
    try:
        os.kill(pid, 0)  # asks only; never reached on Windows, which has locks
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return _started(pid) == started


def _started(pid: int) -> str:
    """When a process began, in a form that no other process of that number has; "" if unknown."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return f"{boot} {fields[19]}"
    except (OSError, IndexError):
        return ""


def _host() -> str:
    return socket.gethostname()


def _folders(root: Path) -> list[Path]:
    try:
        return sorted(path for path in root.iterdir() if path.is_dir() and not path.is_symlink())
    except OSError:
        return []


def _saves(folder: Path) -> list[Path]:
    """Project files of a session, the newest first."""
    return sorted(folder.glob(f"*{SUFFIX}"), key=lambda file: (-_number(file), file.name))


def _number(file: Path) -> int:
    return int(file.stem) if file.stem.isascii() and file.stem.isdigit() else 0


def _text(file: Path) -> str:
    """The beginning of a small text file; "" where it cannot be read."""
    try:
        with file.open("rb") as handle:
            return handle.read(LARGEST_TEXT).decode("utf-8", "replace")
    except OSError:
        return ""


def _save(file: Path) -> Save:
    try:
        status = file.stat()
        size, changed = status.st_size, status.st_mtime
    except OSError:
        size, changed = 0, 0.0
    try:
        known = json.loads(_text(file.with_suffix(ABOUT)))
        kinds = {"name": str, "edits": int, "saved": float, "path": str, "token": str}
        right = all(isinstance(known[name], kind) for name, kind in kinds.items())
        if right and isinstance(known["extra"], dict) and 0 <= known["saved"] < 1e11:
            return Save(file, size, About(**{name: known[name] for name in (*kinds, "extra")}))
    except (ValueError, KeyError, TypeError, RecursionError):
        pass
    return Save(file, size, About(saved=changed))
