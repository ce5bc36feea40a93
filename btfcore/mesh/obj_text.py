"""Puts OBJ text into the plain form that every parser reads alike."""

from __future__ import annotations

import re

from btfcore.errors import InvalidMesh

_RELATIVE = re.compile(rb"^f[^\n]* -", re.MULTILINE)
_ZERO = re.compile(rb"^f(?:[^\n]* )?0+(?:[/ \n]|$)", re.MULTILINE)
_COMMENT = re.compile(rb"#[^\n]*")
_INDENT = re.compile(rb"^ +", re.MULTILINE)


def tidy_obj(data: bytes) -> bytes:
    """Remove byte-order mark, comments, tabs, indents and relative indices from an OBJ file.

    Relative indices count backwards from the line where they stand. Raises `InvalidMesh`
    where a face uses index 0 (OBJ counts from 1) or reaches back before the first vertex.
    """
    text = data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    text = text.replace(b"\\\n", b" ").replace(b"\t", b" ")
    if b"#" in text:
        text = _COMMENT.sub(b"", text)
    if text.startswith(b" ") or b"\n " in text:
        text = _INDENT.sub(b"", text)
    if (zero := _ZERO.search(text)) is not None:
        line = text.count(b"\n", 0, zero.start()) + 1
        raise InvalidMesh(f"line {line} names vertex 0, OBJ counts from 1")
    return _absolute(text) if _RELATIVE.search(text) else text


def _absolute(text: bytes) -> bytes:
    """Rewrite every relative index as an absolute one."""
    counts = {b"v": 0, b"vt": 0, b"vn": 0}
    lines = text.split(b"\n")
    for number, line in enumerate(lines):
        word = line.split(None, 1)[0] if line.strip() else b""
        if word in counts:
            counts[word] += 1
        elif word == b"f" and b"-" in line:
            corners = line.split()[1:]
            try:
                fixed = [_corner(corner, tuple(counts.values())) for corner in corners]
            except ValueError as error:
                raise InvalidMesh(f"line {number + 1}: {error}") from error
            lines[number] = b"f " + b" ".join(fixed)
    return b"\n".join(lines)


def _corner(corner: bytes, counts: tuple[int, ...]) -> bytes:
    parts = corner.split(b"/")
    for place, (part, count) in enumerate(zip(parts, counts, strict=False)):
        if part.startswith(b"-"):
            index = count + 1 + int(part)
            if index < 1:
                raise ValueError(f"index {part.decode()} reaches back before the first of {count}")
            parts[place] = str(index).encode()
    return b"/".join(parts)
