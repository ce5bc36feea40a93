"""BDI files: all values as half floats, one texel's after the other, in chunks of rows."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from btfcore.btf.bonn.cursor import Cursor
from btfcore.btf.bonn.header import MOST_SIDE, Layout, skip_rotations
from btfcore.btf.stack import mended
from btfcore.types import F4, I8

FULL, PACKED, SPARSE = 0, 1, 2
_TEXELS = 1 << 12  # turned over at a time
_MOST_LINES = MOST_SIDE


class BdiStack:
    """An `ImageStack` of a BDI file; texels the file leaves out are black.

    An image lies scattered over the whole file. So a run of neighbouring images, as many as
    fit into `memory_mb` MiB as half floats, is gathered at once and kept until others are
    asked for: reading all images in order goes through the file once. flip : the file's last
    row is on top.
    """

    def __init__(
        self,
        chunks: tuple[NDArray[Any], ...],
        stored: I8 | None,
        shape: tuple[int, int, int],
        *,
        flip: bool = False,
        memory_mb: float = 512,
    ) -> None:
        """Hold chunks (n, J, 1 or 3) f2 of texels; stored : which texels those are, or all."""
        self._chunks = chunks
        self._stored = stored
        self._shape = shape
        self._flip = flip
        self._channels = chunks[0].shape[2]
        image = shape[1] * shape[2] * self._channels * 2
        self._window = max(1, min(shape[0], int(memory_mb * 2**20 / image)))
        self._run: tuple[int, NDArray[np.float16]] | None = None

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of images, rows, columns."""
        return self._shape

    @property
    def dear(self) -> bool:
        """Reading goes through the whole file."""
        return True

    def read(self, numbers: ArrayLike) -> F4:
        """Images `numbers` (n,) as (n, H, W, 3) f4 linear radiance."""
        chosen = np.asarray(numbers, np.int64).ravel()
        count, height, width = self._shape
        if len(chosen) == 0:
            return np.empty((0, height, width, 3), np.float32)
        if not (chosen.min() >= 0 and chosen.max() < count):
            raise IndexError(f"images {chosen.min()} to {chosen.max()} of {count}")
        if chosen.max() - chosen.min() < self._window:
            start, run = self._near(int(chosen.min()), int(chosen.max()))
            values = run[chosen - start]
        else:
            values = np.concatenate(
                [self._gather(number, number + 1) for number in chosen.tolist()]
            )
        with np.errstate(invalid="ignore"):  # a signalling NaN
            images = values.reshape(-1, height, width, self._channels).astype(np.float32)
        if self._channels == 1:
            images = np.repeat(images, 3, axis=3)
        return mended(np.ascontiguousarray(images[:, ::-1]) if self._flip else images)

    def _near(self, low: int, high: int) -> tuple[int, NDArray[np.float16]]:
        """First number and values of the run that holds images `low` to `high`."""
        run = self._run
        if run is None or low < run[0] or high >= run[0] + len(run[1]):
            self._run = None  # let go of the old one before the new is made
            del run
            stop = min(low + self._window, self._shape[0])
            self._run = run = (low, self._gather(low, stop))
        return run

    def _gather(self, first: int, stop: int) -> NDArray[np.float16]:
        """Images `first` to `stop` as (n, H·W, channels) f2."""
        texels = self._shape[1] * self._shape[2]
        out = np.zeros((stop - first, texels, self._channels), np.float16)
        done = 0
        for chunk in self._chunks:
            for start in range(0, len(chunk), _TEXELS):
                part = chunk[start : start + _TEXELS, first:stop].transpose(1, 0, 2)
                here = slice(done, done + part.shape[1])
                out[:, here if self._stored is None else self._stored[here]] = part
                done = here.stop
        return out


def read_bdi(
    cursor: Cursor, layout: Layout, *, flip: bool, memory_mb: float
) -> tuple[BdiStack, tuple[str, ...]]:
    """Read what follows the size of a BDI file: a `BdiStack`, and what was noticed.

    Texels run along the rows. The last chunk may be filled up to the size of the others.
    """
    lines = cursor.count("rows per chunk", _MOST_LINES)
    at, compression = cursor.position, cursor.u8("compression")
    if compression not in (FULL, SPARSE):
        what = "bzip" if compression == PACKED else "unknown"
        raise cursor.wrong(
            f"compression at byte {at:,} is {compression} ({what}), but only 0 (full) and"
            " 2 (sparse) can be read"
        )
    at = cursor.position
    mask = cursor.array("mask", (layout.texels,), "u1")
    notes = skip_rotations(cursor)
    count = int(np.count_nonzero(mask)) if compression == SPARSE else layout.texels
    if count == 0:
        raise cursor.wrong(f"mask at byte {at:,} leaves no texel")
    chunks = _read_chunks(cursor, layout, count, layout.width * lines)
    cursor.finish()
    shape = (layout.images, layout.height, layout.width)
    stored = None
    if count < layout.texels:
        stored = np.flatnonzero(mask)
        notes += (f"{layout.texels - count:,} texels are not in the file and black",)
    return BdiStack(chunks, stored, shape, flip=flip, memory_mb=memory_mb), notes


def _read_chunks(
    cursor: Cursor, layout: Layout, texels: int, most: int
) -> tuple[NDArray[Any], ...]:
    channels = layout.description.channels
    one = layout.images * channels * 2
    # All of it must be there before the (perhaps very many) chunks are gone through.
    if texels * one > cursor.left:
        raise cursor.wrong(
            f"{texels:,} texels of {one:,} bytes from byte {cursor.position:,} on, but the file"
            f" ends at byte {cursor.size:,}"
        )
    chunks: list[NDArray[Any]] = []
    for start in range(0, texels, most):
        number, count = len(chunks), min(most, texels - start)
        at, size = cursor.position, cursor.u32(f"size of chunk {number}")
        last = start + most >= texels
        if size != count * one and not (last and size == most * one):
            raise cursor.wrong(
                f"size of chunk {number} at byte {at:,} is {size:,}, but {count:,} texels take"
                f" {count * one:,} bytes"
            )
        chunks.append(cursor.array(f"chunk {number}", (count, layout.images, channels), "<f2"))
        cursor.need(f"chunk {number}", size - count * one)
    return tuple(chunks)
