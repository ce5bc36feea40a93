"""One file of a folder or of a zip archive, and which names are never followed."""

from __future__ import annotations

from dataclasses import dataclass

MOST_ENTRIES = 1 << 17


@dataclass(frozen=True)
class Entry:
    """One file: `name` with "/" between folders and none of "..", `size` in bytes.

    In a zip archive also where its local header lies (`offset`), how many bytes are stored
    (`packed`), how (`method` 0 or 8) and the checksum of the content.
    """

    name: str
    size: int
    offset: int = -1
    packed: int = -1
    method: int = 0
    crc: int = 0

    @property
    def base(self) -> str:
        """Name without folders."""
        return self.name.rpartition("/")[2]

    @property
    def suffix(self) -> str:
        """Ending in lower case, with its dot."""
        stem, dot, ending = self.base.rpartition(".")
        return f".{ending.lower()}" if stem and dot else ""


def hidden(name: str) -> bool:
    """Whether a name stands for what systems leave behind: hidden files, resource forks."""
    return any(part.startswith(".") or part == "__MACOSX" for part in name.split("/"))


def unsafe(name: str) -> str | None:
    """Why a name from a file must not be followed, or None: it has to stay where it is."""
    if not name or "\0" in name:
        return "is empty or holds a null character"
    parts = name.replace("\\", "/").split("/")
    if parts[0] == "" or (len(parts[0]) > 1 and parts[0][1] == ":"):
        return "is an absolute path"
    if ".." in parts:
        return "leads out of its folder"
    return None
