"""The zip around a package: few stored members, each of which can be mapped into memory.

Every reader takes the class of the error that it raises, since samples and projects share it.
"""

from __future__ import annotations

import os
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from btfcore.errors import InvalidBtf, PatinaError

MOST_MEMBERS = 64
LARGEST_DIRECTORY = 1 << 16
ALIGNMENT = 64
_END, _END64, _LOCATOR = b"PK\5\6", b"PK\6\6", b"PK\6\7"
_PADDING_ID = 0xD935


@dataclass(frozen=True)
class Member:
    """A stored member: where its bytes begin in the file, how many, and their checksum."""

    name: str
    start: int
    size: int
    crc: int


@dataclass(frozen=True)
class Limits:
    """What a kind of package may have: members, bytes of directory, and its error's class.

    strict: also refuse members that lie over each other, links, and names that are not plain
    relative ones.
    """

    members: int = MOST_MEMBERS
    directory: int = LARGEST_DIRECTORY
    error: type[PatinaError] = InvalidBtf
    strict: bool = False


SAMPLE = Limits()


def members(path: Path, limits: Limits = SAMPLE) -> dict[str, Member]:
    """Members of a package by name, checked against the file before anything is read.

    Raises the limits' error for a file that is no zip, has too many members, compressed,
    encrypted or repeated ones, or members that lie outside it.
    """
    where = path.name
    try:
        total = path.stat().st_size
        with path.open("rb") as stream:
            _check_directory(stream, total, where, limits)
            with zipfile.ZipFile(stream) as archive:
                return _members(archive.infolist(), stream, total, where, limits)
    # NotImplementedError is how zipfile refuses a member that asks for a newer zip version
    except (zipfile.BadZipFile, NotImplementedError, struct.error, ValueError) as error:
        raise limits.error(f"{where}: the zip is broken or cut off: {error}") from None
    except OSError as error:
        raise limits.error(f"{where}: cannot be read: {error.strerror or error}") from error


def read_member(path: Path, member: Member, *, most: int, limits: Limits = SAMPLE) -> bytes:
    """Bytes of a member after comparing its checksum; raises the limits' error."""
    where = f"{path.name}: {member.name}"
    if member.size > most:
        raise limits.error(f"{where} has {member.size:,} bytes, up to {most:,} are read")
    with path.open("rb") as stream:
        stream.seek(member.start)
        data = stream.read(member.size)
    if len(data) != member.size or zlib.crc32(data) != member.crc:
        raise limits.error(f"{where} is damaged: its checksum does not fit")
    return data


def check_sum(path: Path, member: Member, limits: Limits = SAMPLE) -> None:
    """Compare a member's checksum piece by piece; raises the limits' error."""
    crc, left = 0, member.size
    with path.open("rb") as stream:
        stream.seek(member.start)
        while left:
            piece = stream.read(min(left, 1 << 22))
            if not piece:
                break
            crc, left = zlib.crc32(piece, crc), left - len(piece)
    if left or crc != member.crc:
        raise limits.error(f"{path.name}: {member.name} is damaged: its checksum does not fit")


def add_member(
    archive: zipfile.ZipFile, stream: BinaryIO, name: str, size: int, pieces: Iterable[bytes]
) -> None:
    """Store a member whose bytes begin at a multiple of 64 in the file.

    The same bytes make the same file: no clock is read.
    """
    info = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
    info.external_attr = 0o644 << 16
    large = size >= 0xFFFF_0000
    head = stream.tell() + 30 + len(name.encode()) + (20 if large else 0) + 4
    padding = -head % ALIGNMENT
    info.extra = struct.pack("<HH", _PADDING_ID, padding) + bytes(padding)
    info.file_size = size
    with archive.open(info, "w", force_zip64=large) as member:
        for piece in pieces:
            member.write(piece)


def _check_directory(stream: BinaryIO, total: int, where: str, limits: Limits) -> None:
    """Refuse a central directory that is too large before the zip reader loads it."""
    stream.seek(max(0, total - 65557))
    tail = stream.read(65557)
    place = tail.rfind(_END)
    if place < 0 or len(tail) - place < 22:
        raise limits.error(f"{where}: this is no zip file, or its end is cut off")
    count, size = struct.unpack_from("<HI", tail, place + 10)
    if place >= 20 and tail[place - 20 : place - 16] == _LOCATOR:
        (offset,) = struct.unpack_from("<Q", tail, place - 12)
        stream.seek(min(offset, total))
        record = stream.read(56)
        if len(record) == 56 and record[:4] == _END64:
            count, size = struct.unpack_from("<QQ", record, 32)
        # some readers look for the record right before its locator instead
        beside = tail[max(0, place - 76) : place - 20]
        if len(beside) == 56 and beside[:4] == _END64:
            other = struct.unpack_from("<QQ", beside, 32)
            count, size = max(count, other[0]), max(size, other[1])
    if count > limits.members or size > limits.directory:
        raise limits.error(
            f"{where}: {count:,} members listed in {size:,} bytes; a package has up to"
            f" {limits.members} in {limits.directory:,}"
        )
    stream.seek(0, os.SEEK_SET)


def _members(
    infos: list[zipfile.ZipInfo], stream: BinaryIO, total: int, where: str, limits: Limits
) -> dict[str, Member]:
    found: dict[str, Member] = {}
    for info in infos:
        name, shown = info.filename, f"member {info.filename[:80]!r}"
        if name in found:
            raise limits.error(f"{where}: two members are named {name[:80]!r}")
        if info.flag_bits & 1:
            raise limits.error(f"{where}: {shown} is encrypted")
        if info.compress_type != zipfile.ZIP_STORED or info.compress_size != info.file_size:
            raise limits.error(f"{where}: {shown} is compressed; a package stores all")
        if limits.strict:
            _check_name(info, where, limits)
        stream.seek(info.header_offset)
        local = stream.read(30)
        if len(local) != 30 or local[:4] != b"PK\3\4":
            raise limits.error(f"{where}: {shown} has no header of its own")
        start = info.header_offset + 30 + sum(struct.unpack("<HH", local[26:30]))
        if start + info.file_size > total:
            raise limits.error(
                f"{where}: {shown} of {info.file_size:,} bytes reaches beyond the file's {total:,}"
            )
        found[name] = Member(name, start, info.file_size, info.CRC)
    if limits.strict:
        end, last = 0, ""
        for member in sorted(found.values(), key=lambda each: each.start):
            if member.start < end:
                raise limits.error(f"{where}: members {last!r} and {member.name!r} overlap")
            end, last = member.start + member.size, member.name
    return found


def _check_name(info: zipfile.ZipInfo, where: str, limits: Limits) -> None:
    """Refuse links, folders and names that could lead out of a folder, on any system."""
    # the reader cuts a name at a null character; what it was before that tells
    name, shown = info.orig_filename, f"member {info.orig_filename[:80]!r}"
    mode = info.external_attr >> 16
    if stat.S_ISLNK(mode):
        raise limits.error(f"{where}: {shown} is a symbolic link")
    parts = name.split("/")
    if not name or ".." in parts or "" in parts or not name.isprintable() or set(name) & set("\\:"):
        raise limits.error(f"{where}: {shown} is no plain name inside the package")
