"""The files of a folder or the members of a zip archive, listed without trusting their names."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from btfcore.btf.readers.entries import MOST_ENTRIES, Entry, hidden
from btfcore.btf.readers.zip_directory import read_directory
from btfcore.errors import InvalidBtf

_DEEPEST = 8


@dataclass(frozen=True)
class FileSet:
    """What `list_files` found: the `entries` of a folder, or of an `archive`, at `place`."""

    name: str
    place: Path
    archive: bool
    entries: tuple[Entry, ...]
    notes: tuple[str, ...] = field(default=())

    def ending(self, *suffixes: str) -> list[Entry]:
        """Entries with one of the endings (lower case, with dot), sorted by name."""
        found = [entry for entry in self.entries if entry.suffix in suffixes]
        return sorted(found, key=lambda entry: entry.name)


def list_files(path: str | Path) -> FileSet:
    """List a folder (files below it too, up to eight folders deep) or a zip archive.

    Hidden files, macOS' resource forks and folders that are links are passed over. Raises
    `InvalidBtf` where nothing is there, a zip archive is damaged or hostile (see
    `btfcore.btf.readers.zip_directory`), a link leads out of the folder, or there are more
    than 131,072 files.
    """
    given = Path(path)
    try:
        place = Path(os.path.realpath(given, strict=True))
        if place.is_dir():
            notes: list[str] = []
            entries = tuple(_walk(place, notes))
            return FileSet(given.name or place.name, place, False, entries, tuple(notes))
    except FileNotFoundError:
        raise InvalidBtf(f"{given.name}: there is no such file or folder") from None
    except (OSError, ValueError) as error:
        raise InvalidBtf(f"{given.name}: it cannot be opened: {error}") from error
    found, remarks = read_directory(place)
    return FileSet(given.stem, place, True, found, remarks)


def pick_files(folder: Path, names: Iterable[str]) -> FileSet:
    """Those of the files `names` (safe ones) that are in `folder`, without listing it.

    Raises `InvalidBtf` where a link leads out of the folder.
    """
    place = Path(os.path.realpath(folder))
    found = []
    for name in names:
        try:
            path = place / name
            if path.is_file() and not _outside(str(path), place, name):
                found.append(Entry(name, path.stat().st_size))
        except (OSError, ValueError):
            continue
    return FileSet(place.name, place, False, tuple(found))


def is_zip(path: str | Path) -> bool:
    """Whether `path` is a file that begins like a zip archive; never raises."""
    try:
        with Path(path).open("rb") as stream:
            return stream.read(4) in (b"PK\x03\x04", b"PK\x05\x06")
    except (OSError, ValueError):
        return False


def _walk(root: Path, notes: list[str]) -> Iterator[Entry]:
    pending = [(root, "", 0)]
    count = links = 0
    while pending:
        folder, prefix, depth = pending.pop()
        with os.scandir(folder) as listing:
            for item in listing:
                count += 1
                if count > MOST_ENTRIES:
                    raise InvalidBtf(f"{root.name}: more than {MOST_ENTRIES:,} files")
                if hidden(item.name):
                    continue
                name = prefix + item.name
                if item.is_dir(follow_symlinks=False):
                    if depth < _DEEPEST:
                        pending.append((Path(item.path), name + "/", depth + 1))
                elif item.is_symlink() and (not item.is_file() or _outside(item.path, root, name)):
                    links += 1
                elif item.is_file():
                    yield Entry(name, item.stat().st_size)
    if links:
        notes.append(f"passed over {links} links that are broken or lead to folders")


def _outside(path: str, root: Path, name: str) -> bool:
    real = Path(os.path.realpath(path))
    if not real.is_relative_to(root):
        raise InvalidBtf(f"{root.name}: {name} is a link that leads out of the folder")
    return not stat.S_ISREG(real.stat().st_mode)
