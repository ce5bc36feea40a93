"""Zip archives as a stranger might send them, byte by byte."""

import struct
import zlib
from dataclasses import dataclass

SYMLINK = 0o120777 << 16


@dataclass
class Member:
    """One member; what the directory says may differ from what is there."""

    name: bytes
    data: bytes = b""
    method: int = 0
    flags: int = 0
    attributes: int = 0
    size: int | None = None
    packed: int | None = None
    offset: int | None = None
    crc: int | None = None
    extra: bytes = b""
    system: int = 3


def archive(members, *, count=None, length=None, offset=None, comment=b"", before=b"", zip64=None):
    """Bytes of an archive; count, length and offset of the directory may be lies.

    zip64: the fields of a 64-bit end record (count, length, offset), with 0xFFFF… in the old.
    """
    body, directory = before, b""
    for member in members:
        stored = member.data
        if member.method == 8:
            worker = zlib.compressobj(9, zlib.DEFLATED, -15)
            stored = worker.compress(member.data) + worker.flush()
        place = len(body) - len(before) if member.offset is None else member.offset
        size = len(member.data) if member.size is None else member.size
        packed = len(stored) if member.packed is None else member.packed
        crc = zlib.crc32(member.data) if member.crc is None else member.crc
        local = (20, member.flags, member.method, 0, 33, crc, packed, size, len(member.name), 0)
        body += b"PK\x03\x04" + struct.pack("<5H3L2H", *local) + member.name + stored
        head = (20 | member.system << 8, 20, member.flags, member.method, 0, 33, crc, packed, size)
        tail = (len(member.name), len(member.extra), 0, 0, 0, member.attributes, place)
        directory += b"PK\x01\x02" + struct.pack("<6H3L5H2L", *head, *tail)
        directory += member.name + member.extra
    start = len(body) - len(before)
    count = len(members) if count is None else count
    length = len(directory) if length is None else length
    offset = start if offset is None else offset
    wide = b""
    if zip64 is not None:
        fields = (44, 45, 45, 0, 0, zip64[0], zip64[0], zip64[1], zip64[2])
        wide = b"PK\x06\x06" + struct.pack("<Q2H2L4Q", *fields)
        wide += b"PK\x06\x07" + struct.pack("<LQL", 0, len(body) + len(directory), 1)
        count, length, offset = 0xFFFF, 0xFFFFFFFF, 0xFFFFFFFF
    end = struct.pack("<4H2LH", 0, 0, count, count, length, offset, len(comment))
    return body + directory + wide + b"PK\x05\x06" + end + comment


NAME = b"tl000 pl000 tv000 pv000.png"

# What the archive is, and words of the error that it must cause.
ARCHIVES = {
    "parent": (archive([Member(b"../" + NAME)]), "leads out"),
    "parent inside": (archive([Member(b"a/../../" + NAME)]), "leads out"),
    "backslash parent": (archive([Member(b"..\\" + NAME)]), "leads out"),
    "absolute": (archive([Member(b"/etc/" + NAME)]), "absolute"),
    "drive": (archive([Member(b"C:\\" + NAME)]), "absolute"),
    "share": (archive([Member(b"\\\\host\\x\\" + NAME)]), "absolute"),
    "null": (archive([Member(b"a\0b.png")]), "null character"),
    "no name": (archive([Member(b"")]), "is empty"),
    "link": (archive([Member(NAME, b"/etc/passwd", attributes=SYMLINK)]), "is a link"),
    "encrypted": (archive([Member(NAME, b"x", flags=1)]), "encrypted"),
    "strongly encrypted": (archive([Member(NAME, b"x", flags=0x41)]), "encrypted"),
    "twice": (archive([Member(NAME, b"x"), Member(NAME, b"y")]), "twice"),
    "twice up to case": (archive([Member(NAME, b"x"), Member(NAME.upper(), b"y")]), "twice"),
    "bomb": (archive([Member(NAME, bytes(1 << 25), method=8)]), "would grow"),
    "huge": (archive([Member(NAME, b"x", method=8, size=1 << 31)]), "up to 1,073,741,824"),
    "larger than stored": (archive([Member(NAME, b"x", size=99)]), "cannot be"),
    "past the end": (archive([Member(NAME, b"x", offset=1 << 30)]), "cannot be"),
    "into the directory": (archive([Member(NAME, b"x", packed=400, size=400)]), "cannot be"),
    "overlapping": (
        archive(
            [
                Member(NAME, bytes(5000)),
                *(
                    Member(f"{n}.png".encode(), b"", size=5000, packed=5000, offset=0)
                    for n in range(4)
                ),
            ]
        ),
        "overlap",
    ),
    "count too high": (archive([Member(NAME, b"x")], count=2), "not fit|breaks off"),
    "count too low": (archive([Member(NAME), Member(b"x")], count=1), "too many"),
    "length too long": (archive([Member(NAME, b"x")], length=1 << 20), "does not fit"),
    "length absurd": (archive([Member(NAME, b"x")], length=1 << 31), "are read"),
    "offset too far": (archive([Member(NAME, b"x")], offset=1 << 20), "does not fit"),
    "64-bit count": (archive([Member(NAME)], zip64=(1 << 62, 80, 0)), "are read"),
    "64-bit length": (archive([Member(NAME)], zip64=(1, 1 << 62, 0)), "are read"),
    "64-bit offset": (archive([Member(NAME)], zip64=(1, 73, 1 << 63)), "does not fit"),
    "64-bit missing": (archive([Member(NAME)], count=0xFFFF), "64-bit"),
    "64-bit sizes missing": (archive([Member(NAME, b"x", size=0xFFFFFFFF)]), "64-bit sizes"),
    "several disks": (archive([Member(NAME)])[:-18] + b"\1\0" + archive([Member(NAME)])[-16:],
                      "several"),
    "no archive": (b"PK\x03\x04" + bytes(100), "no whole zip"),
    "empty": (b"", "no whole zip"),
    "comment lies": (archive([Member(NAME)]) + b"more", "no whole zip"),
}  # fmt: skip

# Stored bytes that are said to be deflated.
NO_DEFLATE = archive([Member(NAME, b"\xff" * 9)]).replace(b"\0\0\0\0\x21\0", b"\x08\0\0\0\x21\0")

# Archives whose directory is sound, but a member is not.
MEMBERS = {
    "another method": (archive([Member(NAME, b"x", method=14)]), "method 14"),
    "wrong checksum": (archive([Member(NAME, b"x", crc=7)]), "other bytes"),
    "longer than said": (archive([Member(NAME, bytes(999), method=8, size=9)]), "other bytes"),
    "shorter than said": (archive([Member(NAME, b"x" * 9, method=8, size=999)]), "other bytes"),
    "no deflate": (NO_DEFLATE, "broken"),
    "no local header": (b"XX" + archive([Member(NAME, b"x")])[2:], "does not lie"),
}  # fmt: skip
