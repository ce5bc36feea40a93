"""The directory at the end of a zip archive, read with every count and place checked.

Written out here because archives come from strangers: nothing is allocated on their word, and
what a lenient reader would mend is an error.
"""

from __future__ import annotations

import os
import stat
import struct
from pathlib import Path
from typing import BinaryIO

from btfcore.btf.readers.entries import MOST_ENTRIES, Entry, hidden, unsafe
from btfcore.errors import InvalidBtf

LARGEST_MEMBER = 1 << 30
_LARGEST_DIRECTORY = 1 << 25
_MOST_TOTAL = 1 << 40
_BOMB_SIZE, _BOMB_RATIO = 1 << 24, 200
_END = struct.Struct("<4s4H2LH")
_END64 = struct.Struct("<4sQ2H2L4Q")
_LOCATOR = struct.Struct("<4sLQL")
_FILE = struct.Struct("<4s6H3L5H2L")
_FULL2, _FULL4 = 0xFFFF, 0xFFFFFFFF


def read_directory(path: Path) -> tuple[tuple[Entry, ...], tuple[str, ...]]:
    """Entries of the zip archive `path`, and notes about what was passed over.

    Raises `InvalidBtf`, beginning with the file's name, where the directory is missing, cut
    off or contradicts itself or the file's size; where a member is encrypted, a link, named
    twice (also up to case), named outside the archive, larger than 1 GiB, packed more than
    200 times (above 16 MiB); where members overlap or there are more than 131,072.
    """
    try:
        with path.open("rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            return _directory(stream, size)
    except InvalidBtf as error:
        raise InvalidBtf(f"{path.name}: {error}") from None
    except OSError as error:
        raise InvalidBtf(f"{path.name}: it cannot be read: {error}") from error


def _directory(stream: BinaryIO, size: int) -> tuple[tuple[Entry, ...], tuple[str, ...]]:
    count, length, offset, end = _summary(stream, size)
    if count > MOST_ENTRIES or length > _LARGEST_DIRECTORY:
        raise InvalidBtf(
            f"the zip's directory lists {count:,} members in {length:,} bytes; up to"
            f" {MOST_ENTRIES:,} members and {_LARGEST_DIRECTORY:,} bytes are read"
        )
    before = end - length - offset
    if before < 0 or count * _FILE.size > length:
        raise InvalidBtf(
            f"the zip's directory of {count:,} members and {length:,} bytes at {offset:,} does"
            f" not fit into the {end:,} bytes before its end"
        )
    stream.seek(end - length)
    table = stream.read(length)
    entries: list[Entry] = []
    seen: dict[str, str] = {}
    place = nested = total = stored = 0
    for number in range(count):
        entry, place = _member(table, place, number, before, end - length)
        if entry is None:
            continue
        other = seen.setdefault(entry.name.casefold(), entry.name)
        if other is not entry.name:
            raise InvalidBtf(f"the zip holds {entry.name!r} and {other!r}, the same name twice")
        total += entry.size
        stored += entry.packed
        nested += entry.suffix in (".zip", ".7z", ".rar", ".tar", ".gz", ".tgz")
        if not hidden(entry.name):
            entries.append(entry)
    if place != length:
        raise InvalidBtf(f"the zip's directory has {length - place:,} bytes too many")
    if total > _MOST_TOTAL or stored > size:
        raise InvalidBtf(
            f"the zip's members unpack to {total:,} bytes and occupy {stored:,} bytes of a file"
            f" of {size:,}: they overlap or lie"
        )
    notes = (f"passed over {nested} archives inside the archive",) if nested else ()
    return tuple(entries), notes


def _summary(stream: BinaryIO, size: int) -> tuple[int, int, int, int]:
    """Members, bytes and offset of the directory, and where it has to end."""
    reach = min(size, _FULL2 + _END.size)
    stream.seek(size - reach)
    tail = stream.read(reach)
    place = tail.rfind(b"PK\x05\x06")
    while place >= 0:
        if place + _END.size <= len(tail):
            _, disk, first, here, count, length, offset, comment = _END.unpack_from(tail, place)
            if place + _END.size + comment == len(tail):
                break
        place = tail.rfind(b"PK\x05\x06", 0, place)
    else:
        raise InvalidBtf("this is no whole zip archive: the directory at its end is missing")
    end = size - reach + place
    if _FULL2 in (here, count, disk, first) or _FULL4 in (length, offset):
        disk, first, here, count, length, offset, end = _summary64(stream, end)
    if disk != first or disk != 0 or here != count:
        raise InvalidBtf("the zip archive is one part of several")
    return count, length, offset, end


def _summary64(stream: BinaryIO, end: int) -> tuple[int, int, int, int, int, int, int]:
    start = end - _LOCATOR.size
    stream.seek(max(start, 0))
    raw = stream.read(_LOCATOR.size)
    if start < 0 or not raw.startswith(b"PK\x06\x07"):
        raise InvalidBtf("the zip's directory refers to a 64-bit one, which is missing")
    _, _, place, _ = _LOCATOR.unpack(raw)
    if place > start - _END64.size:
        raise InvalidBtf(f"the zip's 64-bit directory is said to lie at {place:,}, past its end")
    stream.seek(place)
    raw = stream.read(_END64.size)
    if not raw.startswith(b"PK\x06\x06"):
        raise InvalidBtf(f"the zip's 64-bit directory does not lie at {place:,}, where it should")
    _, _, _, _, disk, first, here, count, length, offset = _END64.unpack(raw)
    return disk, first, here, count, length, offset, place


def _member(
    table: bytes, place: int, number: int, before: int, limit: int
) -> tuple[Entry | None, int]:
    """Entry `number`, which begins at `place` of the directory, and where the next begins."""
    if place + _FILE.size > len(table) or table[place : place + 4] != b"PK\x01\x02":
        raise InvalidBtf(f"the zip's directory breaks off at member {number:,}")
    fields = _FILE.unpack_from(table, place)
    flags, method, crc, packed, size = fields[3], fields[4], fields[7], fields[8], fields[9]
    name_size, extra_size, comment_size, disk = fields[10:14]
    attributes, offset = fields[15], fields[16]
    start = place + _FILE.size
    after = start + name_size + extra_size + comment_size
    if after > len(table):
        raise InvalidBtf(f"the zip's directory breaks off at member {number:,}")
    raw = table[start : start + name_size]
    name = raw.decode("utf-8" if flags & 0x800 else "cp437", "replace").replace("\\", "/")
    shown = name[:100]
    reason = unsafe(name)
    if reason:
        raise InvalidBtf(f"the name {shown!r} in the zip {reason}")
    extra = table[start + name_size : start + name_size + extra_size]
    size, packed, offset = _wide(extra, size, packed, offset, shown)
    if flags & 0x2041:
        raise InvalidBtf(f"{shown!r} in the zip is encrypted")
    if (fields[1] >> 8) in (3, 19) and stat.S_ISLNK(attributes >> 16):
        raise InvalidBtf(f"{shown!r} in the zip is a link")
    if name.endswith("/"):
        return None, after
    offset += before
    if disk not in (0, _FULL2) or offset + 30 + packed > limit or (method == 0 and packed != size):
        raise InvalidBtf(
            f"{shown!r} in the zip is said to take {packed:,} bytes at {offset:,} for {size:,},"
            f" which cannot be: members end at {limit:,}"
        )
    if size > LARGEST_MEMBER:
        raise InvalidBtf(f"{shown!r} in the zip has {size:,} bytes, up to {LARGEST_MEMBER:,} do")
    if size > _BOMB_SIZE and size > _BOMB_RATIO * packed:
        raise InvalidBtf(f"{shown!r} in the zip would grow from {packed:,} to {size:,} bytes")
    return Entry(name, size, offset, packed, method, crc), after


def _wide(extra: bytes, size: int, packed: int, offset: int, shown: str) -> tuple[int, int, int]:
    """Replace 32-bit numbers that say "see the extra field" by its 64-bit ones."""
    if _FULL4 not in (size, packed, offset):
        return size, packed, offset
    place = 0
    while place + 4 <= len(extra):
        tag, length = struct.unpack_from("<2H", extra, place)
        if tag == 1:
            body = extra[place + 4 : place + 4 + length]
            values = [size, packed, offset]
            wide = [at for at in range(3) if values[at] == _FULL4]
            if len(body) < 8 * len(wide):
                break
            for at, value in zip(wide, struct.unpack_from(f"<{len(wide)}Q", body), strict=True):
                values[at] = value
            return values[0], values[1], values[2]
        place += 4 + length
    raise InvalidBtf(f"{shown!r} in the zip lacks the 64-bit sizes that it refers to")
