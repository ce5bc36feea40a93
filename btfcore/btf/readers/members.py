"""The bytes of one file of a folder or one member of a zip archive, never more than announced."""

from __future__ import annotations

import zlib
from pathlib import Path

from btfcore.btf.readers.entries import Entry
from btfcore.errors import InvalidBtf

_HEADER = 30
_LFS = b"version https://git-lfs"


def read_bytes(place: Path, entry: Entry, *, most: int) -> bytes:
    """Content of `entry` of the folder or archive `place`; at most `most` bytes.

    Raises `InvalidBtf`, beginning with the entry's name, where it is larger, cut off, packed
    in another way than deflate, or not what its checksum says.
    """
    if entry.size > most:
        raise InvalidBtf(f"{entry.name}: {entry.size:,} bytes, up to {most:,} are read")
    try:
        if entry.offset < 0:
            with (place / entry.name).open("rb") as stream:
                data = stream.read(most + 1)
        else:
            data = _unpacked(place, entry)
    except (OSError, ValueError) as error:
        raise InvalidBtf(f"{entry.name}: it cannot be read: {error}") from error
    if len(data) > most:
        raise InvalidBtf(f"{entry.name}: more than {most:,} bytes")
    if data.startswith(_LFS):
        raise InvalidBtf(
            f"{entry.name}: a Git LFS pointer, not the file itself: run `git lfs pull`"
        )
    return data


def _unpacked(place: Path, entry: Entry) -> bytes:
    if entry.method not in (0, 8):
        raise InvalidBtf(f"{entry.name}: packed by zip method {entry.method}; only deflate is read")
    with place.open("rb") as stream:
        stream.seek(entry.offset)
        header = stream.read(_HEADER)
        if len(header) < _HEADER or not header.startswith(b"PK\x03\x04"):
            raise InvalidBtf(f"{entry.name}: it does not lie at {entry.offset:,}, where it should")
        names = int.from_bytes(header[26:28], "little") + int.from_bytes(header[28:30], "little")
        stream.seek(names, 1)
        packed = stream.read(entry.packed)
    if len(packed) < entry.packed:
        raise InvalidBtf(f"{entry.name}: the archive breaks off within it")
    if entry.method == 0:
        data = packed
    else:
        worker = zlib.decompressobj(-15)
        try:
            data = worker.decompress(packed, entry.size + 1)
        except zlib.error as error:
            raise InvalidBtf(f"{entry.name}: its packed bytes are broken ({error})") from error
    if len(data) != entry.size or zlib.crc32(data) != entry.crc:
        raise InvalidBtf(
            f"{entry.name}: unpacks to other bytes than the zip's directory says"
            f" ({len(data):,} of {entry.size:,})"
        )
    return data
