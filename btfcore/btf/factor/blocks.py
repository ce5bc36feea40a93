"""Streams a stack of images as coded blocks, within bounds of memory."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from btfcore.btf.factor.encoding import knobs
from btfcore.btf.factor.kernels import LANES, fill
from btfcore.btf.factor.mapped import release
from btfcore.btf.sample import Encoding
from btfcore.btf.stack import ImageStack
from btfcore.types import F4

BLOCK_MB = 32.0
READ_MB = 4.0  # of f4 at once: reading may need several times that for a moment
_READS = 6  # that several
_NOTHING = np.empty((0, 0, 0), np.float32)


def cores() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def strips(count: int, *, pieces: int, unit: int = 1) -> list[tuple[int, int]]:
    """Cut 0 … count into about `pieces` ranges whose borders are multiples of `unit`."""
    step = max(unit, -(-count // (pieces * unit)) * unit)
    return [(start, min(start + step, count)) for start in range(0, count, step)]


def share(
    pool: ThreadPoolExecutor, work: Callable[[int, int], None], count: int, unit: int
) -> None:
    """Do `work(start, stop)` on strips of 0 … count on several threads; raises what it raised."""
    for _ in pool.map(lambda strip: work(*strip), strips(count, pieces=16, unit=unit)):
        pass


@dataclass(frozen=True, eq=False)
class Block:
    """Coded images `first` … `first` + `count` - 1, less their means over texels.

    tiles (T, m, 32) f4 as in `kernels`, m a multiple of 4 and at least 3 count; mean (m,) f4;
    energy: sum of squares of the coded values, before and after the means were taken off.
    """

    first: int
    count: int
    tiles: F4
    mean: F4
    energy: tuple[float, float]


class CodedBlocks:
    """A stack as coded blocks, as often as wanted.

    Blocks are kept in memory where `keep` is set; those of a stack that is dear to read in an
    unnamed temporary file, or made anew where the disk is full. Every pass gives the same
    blocks, each valid until the next one is asked for.
    """

    def __init__(
        self,
        stack: ImageStack,
        encoding: Encoding,
        pool: ThreadPoolExecutor,
        *,
        images: int,
        keep: bool,
    ) -> None:
        """Blocks of `images` images."""
        self._stack, self._knobs, self._pool = stack, knobs(encoding), pool
        self._images, self._keep = images, keep
        self._kept: dict[int, Block] = {}
        self._spooled: dict[int, Block] = {}
        self._buffer: F4 | None = None
        self._spool = Spool() if stack.dear and not keep else None

    def __iter__(self) -> Iterator[Block]:
        """All blocks, in order."""
        for first in range(0, self._stack.shape[0], self._images):
            block = self._kept.get(first) or self._unspooled(first) or self._coded(first)
            if self._keep:
                self._kept[first] = block
            elif self._spool is not None and first not in self._spooled:
                if self._spool.write(block.tiles):
                    self._spooled[first] = replace(block, tiles=_NOTHING)
            yield block

    def _unspooled(self, first: int) -> Block | None:
        block = self._spooled.get(first)
        if block is None or self._spool is None:
            return None
        tiles = self._room(block.count)
        self._spool.read(first // self._images, tiles)
        return replace(block, tiles=tiles)

    def _coded(self, first: int) -> Block:
        total, height, width = self._stack.shape
        count = min(self._images, total - first)
        tiles = self._room(count)
        mean = np.zeros(tiles.shape[1], np.float32)
        tiles[:, 3 * count :] = 0
        at_once = images_within(self._stack, READ_MB)
        energy = np.zeros((count, 2))
        for start in range(0, count, at_once):
            stop = min(start + at_once, count)
            images = self._stack.read(np.arange(first + start, first + stop))
            images = images.reshape(stop - start, height * width, 3)

            def one(j: int, images: F4 = images, start: int = start) -> None:
                energy[j] = fill(images[j - start], tiles, 3 * j, *self._knobs, mean)

            for _ in self._pool.map(one, range(start, stop)):
                pass
            release(self._stack)
        # summed in the images' order, whatever thread did which
        before, after = energy.sum(axis=0)
        return Block(first, count, tiles, mean, (float(before), float(after)))

    def _room(self, count: int) -> F4:
        _, height, width = self._stack.shape
        shape = (-(-height * width // LANES), -(-3 * count // 4) * 4, LANES)
        if self._keep or self._buffer is None or self._buffer.shape != shape:
            self._buffer = None  # let go of the old one first
            self._buffer = np.empty(shape, np.float32)
        return self._buffer


class Spool:
    """Blocks of equal size (but the last) in an unnamed temporary file, written in order."""

    def __init__(self) -> None:
        """Open the file; the system removes it with this object."""
        self._file = tempfile.TemporaryFile("w+b", buffering=0, prefix="patina-")  # noqa: SIM115
        self._step = self._end = 0
        self._full = False

    def write(self, tiles: F4) -> bool:
        """Append a block; False from the first one on for which there is no room."""
        rest = memoryview(tiles).cast("B")  # type: ignore[arg-type]
        self._step = self._step or tiles.nbytes
        try:
            while len(rest) and not self._full:
                rest = rest[self._file.write(rest) :]
        except OSError:  # the disk is full
            self._full = True
            self._file.truncate(self._end)
        self._end += 0 if self._full else tiles.nbytes
        return not self._full

    def read(self, number: int, tiles: F4) -> None:
        """Fill `tiles` with block `number`, which was written."""
        self._file.seek(number * self._step)
        rest = memoryview(tiles).cast("B")  # type: ignore[arg-type]
        while len(rest):
            rest = rest[self._file.readinto(rest) :]


def images_within(stack: ImageStack, megabytes: float) -> int:
    """How many images of a stack fit into `megabytes` MiB as f4, at least one."""
    _, height, width = stack.shape
    return max(1, int(megabytes * 2**20 / (height * width * 12)))


def reading_mb(stack: ImageStack) -> float:
    """MiB that reading may need for a moment, `READ_MB` at once."""
    _, height, width = stack.shape
    return images_within(stack, READ_MB) * height * width * 12 * _READS / 2**20
