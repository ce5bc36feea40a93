"""Files that are either whole or absent: written beside their place, then renamed into it."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import shutil
import stat
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

from btfcore.errors import OutputFailed

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_FOLDER_SYNC_OPTIONAL = {errno.EINVAL, errno.ENOTSUP, errno.EBADF, errno.EACCES, errno.EPERM}
_NO_LINKS = {errno.EPERM, errno.ENOTSUP, errno.ENOSYS, errno.EMLINK, errno.EINVAL}
_WRITING, _SAVING = ".patina-", ".patina-save-"


@contextlib.contextmanager
def atomic_output(path: str | Path) -> Iterator[BinaryIO]:
    """Open a binary file that appears under `path` only when the block ends without error.

    The bytes go to a temporary file in the same folder, which is flushed, synced to disk and
    renamed. Whatever interrupts the block (an error, `Cancelled`, Ctrl-C), the temporary file
    is removed and an older file under `path` stays as it was. Raises `OutputFailed` where the
    system refuses: missing folder, no permission, disk full, `path` no regular file.
    """
    with atomic_group([path]) as (handle,):
        yield handle


@contextlib.contextmanager
def atomic_group(paths: Sequence[str | Path]) -> Iterator[tuple[BinaryIO, ...]]:
    """Like `atomic_output` for files that belong together.

    None is renamed before all are whole on disk; then they are renamed in the order given,
    so name last the file that refers to the others.
    """
    finals = [_final(path) for path in paths]
    handles: list[BinaryIO] = []
    pending: list[Path] = []
    current = finals[0]
    try:
        try:
            for current in finals:
                handles.append(_temporary(current.parent))
                pending.append(Path(handles[-1].name))
            current = finals[-1]
            yield tuple(handles)
            for place, handle in enumerate(handles):
                current = finals[place]
                handle.flush()
                _sync(handle.fileno())
                handle.close()
            for current in finals:
                os.replace(pending[0], current)
                del pending[0]
            for folder in dict.fromkeys(final.parent for final in finals):
                _sync_folder(folder)
        finally:
            _discard(handles, pending)
    except OSError as error:
        raise _refused(current, error) from error


@contextlib.contextmanager
def verified_output(
    path: str | Path, verify: Callable[[Path], None], *, backup: str | None = None
) -> Iterator[BinaryIO]:
    """Like `atomic_output`, but what was written is opened again before it counts.

    After the bytes are on disk, `verify` gets the temporary file; what it raises leaves the
    older file as it was. backup : name in the same folder that the older file then has too. At
    every instant the old or the new file is whole under `path`: the older one gets its second
    name as a hard link (or, where the file system has none, as a copy), and is only then
    replaced. Temporary files of this kind that a killed process left are removed; those of a
    process that still writes are locked, and stay.
    """
    final = _final(path)
    handles: list[BinaryIO] = []
    pending: list[Path] = []
    try:
        try:
            _sweep(final.parent)
            handles.append(_temporary(final.parent, _SAVING))
            pending.append(Path(handles[0].name))
            _lock(handles[0])
            yield handles[0]
            handles[0].flush()
            _sync(handles[0].fileno())
            if fcntl is None:
                handles[0].close()  # an open file cannot be renamed there
            verify(pending[0])
            if backup is not None and final.exists():
                _keep(final, final.parent / backup, pending)
            os.replace(pending[0], final)
            del pending[0]
            _sync_folder(final.parent)
        finally:
            _discard(handles, pending)
    except OSError as error:
        raise _refused(final, error) from error


def _keep(final: Path, backup: Path, pending: list[Path]) -> None:
    """Let the file `final` also be found as `backup`, whose former content goes."""
    second = final.parent / f"{_SAVING}{secrets.token_hex(8)}.part"
    pending.append(second)
    try:
        os.link(final, second)
    except OSError as error:
        if error.errno not in _NO_LINKS:
            raise
        shutil.copyfile(final, second)
        with second.open("rb+") as handle:
            _sync(handle.fileno())
    os.replace(second, backup)
    pending.remove(second)


def _sweep(folder: Path) -> None:
    """Remove what killed processes left of `verified_output`."""
    if fcntl is None:
        return
    for left in folder.glob(f"{_SAVING}*.part"):
        with contextlib.suppress(OSError), left.open("rb") as handle:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)  # fails while it is written
            left.unlink()


def _lock(handle: BinaryIO) -> None:
    if fcntl is not None:
        with contextlib.suppress(OSError):  # some file systems have no locks
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _sync(descriptor: int) -> None:
    """Wait until a file is on the disk itself; on macOS `fsync` does not."""
    full = getattr(fcntl, "F_FULLFSYNC", None)
    if fcntl is not None and full is not None:
        with contextlib.suppress(OSError):
            fcntl.fcntl(descriptor, full)
            return
    os.fsync(descriptor)


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write `data` to `path` by `atomic_output`."""
    with atomic_output(path) as handle:
        handle.write(data)


def check_writable(path: str | Path) -> None:
    """Find out before long work whether `path` can be written; leaves nothing behind.

    Raises `OutputFailed` as `atomic_output` would, except for what only time can tell.
    """
    final = _final(path)
    try:
        with _temporary(final.parent) as handle:
            temporary = handle.name
        os.unlink(temporary)
    except OSError as error:
        raise _refused(final, error) from error


def _final(path: str | Path) -> Path:
    """Where `path` really leads (a link is written through), refusing what is no file."""
    given = Path(path)
    try:
        final = Path(os.path.realpath(given))
        if os.fspath(path).endswith(("/", os.sep)) or final.is_dir():
            raise OutputFailed(f"cannot write {given}: it is a directory")
        mode = final.stat().st_mode if final.exists() else None
    except (OSError, ValueError) as error:
        raise OutputFailed(f"cannot write {given}: {_reason(error)}") from error
    if mode is not None and not stat.S_ISREG(mode):
        raise OutputFailed(f"cannot write {given}: it is not a regular file")
    if mode is not None and not os.access(final, os.W_OK):
        raise OutputFailed(f"cannot write {given}: the existing file is write-protected")
    if not final.parent.is_dir():
        what = "is not a directory" if final.parent.exists() else "does not exist"
        raise OutputFailed(f"cannot write {given}: the folder {final.parent} {what}")
    return final


def _temporary(folder: Path, prefix: str = _WRITING) -> BinaryIO:
    """Open a new hidden file in `folder`; unlike `tempfile`'s its mode obeys the umask."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    name = folder / f"{prefix}{secrets.token_hex(8)}.part"
    return open(name, "wb", opener=lambda file, _: os.open(file, flags, 0o666))


def _discard(handles: Sequence[BinaryIO], pending: Sequence[Path]) -> None:
    """Close all handles and remove the temporary files not yet renamed, whatever happens."""
    for handle in handles:
        with contextlib.suppress(OSError):
            handle.close()
    for temporary in pending:
        with contextlib.suppress(OSError):
            temporary.unlink()


def _sync_folder(folder: Path) -> None:
    """Make renames in `folder` survive a power cut, where the system knows how."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno not in _FOLDER_SYNC_OPTIONAL:
            raise


def _reason(error: Exception) -> str:
    """Why the system refused, in a user's words."""
    number = getattr(error, "errno", None)
    words = {
        errno.ENOSPC: "the disk is full",
        errno.EDQUOT: "the disk quota is used up",
        errno.EFBIG: "the file would grow beyond the size limit",
        errno.EACCES: "permission denied",
        errno.EROFS: "the file system is read-only",
        errno.ENAMETOOLONG: "the name is too long",
    }
    if number in words:
        return words[number]
    return getattr(error, "strerror", None) or str(error)


def _refused(path: Path, error: OSError) -> OutputFailed:
    if error.errno in (errno.EACCES, errno.EROFS, errno.EPERM):
        return OutputFailed(f"cannot write {path} in folder {path.parent}: {_reason(error)}")
    return OutputFailed(f"cannot write {path}: {_reason(error)}")
