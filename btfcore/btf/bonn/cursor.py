"""A place in the bytes of a file, from which nothing is read that is not there."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.errors import InvalidBtf
from btfcore.types import F8


class Cursor:
    """Reads little-endian fields one after the other.

    Each count is held against the file's end, in whole numbers without a limit, before
    anything of its size is made. Errors are `InvalidBtf` and begin with `name`, the file's.
    """

    def __init__(self, name: str, data: Any) -> None:
        """Stand at byte 0 of `data`: bytes, a mapped file or another buffer."""
        self.name = name
        self.data = data
        self.size = len(data)
        self.position = 0

    @property
    def left(self) -> int:
        """Number of bytes from here to the end."""
        return self.size - self.position

    def wrong(self, text: str) -> InvalidBtf:
        """Return the error that says `text` of this file."""
        return InvalidBtf(f"{self.name}: {text}")

    def need(self, what: str, length: int) -> int:
        """Go `length` bytes on and return where they begin, if there are so many."""
        if length > self.left:
            raise self.wrong(
                f"{what} at byte {self.position:,} needs {length:,} bytes, but the file ends"
                f" at byte {self.size:,}"
            )
        begin = self.position
        self.position += length
        return begin

    def u8(self, what: str) -> int:
        """Unsigned number of one byte."""
        return self._number("<B", what)

    def u32(self, what: str) -> int:
        """Unsigned number of four bytes."""
        return self._number("<I", what)

    def i32(self, what: str) -> int:
        """Signed number of four bytes."""
        return self._number("<i", what)

    def count(self, what: str, most: int) -> int:
        """Unsigned number of four bytes from 1 to `most`."""
        at, value = self.position, self.u32(what)
        if not 1 <= value <= most:
            raise self.wrong(f"{what} at byte {at:,} is {value:,}, but 1 to {most:,} can be read")
        return value

    def floats(self, what: str, count: int) -> F8:
        """`count` numbers stored as f4, (count,) f8, finite or not."""
        with np.errstate(invalid="ignore"):  # a signalling NaN
            return self.array(what, (count,), "<f4").astype(np.float64)

    def text(self, what: str, length: int) -> str:
        """At most `length` bytes up to the first NUL, without what cannot be printed."""
        begin = self.need(what, length)
        raw = bytes(self.data[begin : begin + length]).split(b"\0", 1)[0]
        try:
            words = raw.decode("utf-8")
        except UnicodeDecodeError:
            words = raw.decode("latin-1")
        return "".join(letter if letter.isprintable() else " " for letter in words).strip()

    def array(self, what: str, shape: tuple[int, ...], kind: str) -> NDArray[Any]:
        """View `shape` numbers of dtype `kind` where they lie in the file; nothing is read."""
        count = math.prod(shape)
        begin = self.need(what, count * np.dtype(kind).itemsize)
        if count == 0:
            return np.empty(shape, kind)
        return np.frombuffer(self.data, kind, count, begin).reshape(shape)

    def finish(self) -> None:
        """Raise where bytes are left over."""
        if self.left:
            raise self.wrong(
                f"{self.left:,} bytes follow the last field, which ends at byte {self.position:,}"
            )

    def _number(self, kind: str, what: str) -> int:
        begin = self.need(what, struct.calcsize(kind))
        return int(struct.unpack_from(kind, self.data, begin)[0])
