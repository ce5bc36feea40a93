"""Brings images that are dear to read into memory or into a mapped temporary file, once."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.factor.mapped import release
from btfcore.btf.sample import BtfSample
from btfcore.btf.stack import LARGEST_HALF, ArrayStack, ImageStack, block_size
from btfcore.errors import OutputFailed
from btfcore.progress import Progress, silent
from btfcore.types import F4, I8

BLOCK_MB = 64.0


@dataclass(frozen=True)
class Flaws:
    """Counts of values that are no radiance: NaN, infinite and negative ones."""

    nan: int
    infinite: int
    negative: int

    @property
    def total(self) -> int:
        """All of them."""
        return self.nan + self.infinite + self.negative


def blocks(stack: ImageStack, *, block_mb: float = BLOCK_MB) -> Iterator[I8]:
    """Numbers of the images, in blocks that fit into `block_mb` MiB as f4."""
    step = block_size(stack, budget_mb=block_mb)
    for start in range(0, stack.shape[0], step):
        yield np.arange(start, min(start + step, stack.shape[0]))


def materialize(
    sample: BtfSample, *, memory_mb: float = 1024, progress: Progress = silent
) -> BtfSample:
    """Return the sample with images that are cheap to read again and again.

    Stacks that are not dear are left alone. Others are read once: into memory as f4 where
    that fits into `memory_mb` MiB, as half floats where only those fit, else into an unnamed
    temporary file of half floats that vanishes with the sample. Half floats are scaled per
    image so that nothing overflows; they are exact to 5e-4 of the value. Raises
    `OutputFailed` where the temporary folder is full.
    """
    stack = sample.stack
    if not stack.dear:
        return sample
    values = int(np.prod(stack.shape)) * 3
    full = values * 4 <= memory_mb * 2**20
    shape = (*stack.shape, 3)
    images: NDArray[Any] | None = None
    file: IO[bytes] | None = None
    if full or values * 2 <= memory_mb * 2**20:
        images = np.empty(shape, np.float32 if full else np.float16)
    else:
        file = _temporary(sample.name, values * 2)
    scale = None if full else np.ones(stack.shape[0], np.float32)
    for numbers in blocks(stack, block_mb=min(BLOCK_MB, max(1.0, memory_mb / 8))):
        block = stack.read(numbers)
        if scale is not None:
            scale[numbers], block = halved(block)
        if images is not None:
            images[numbers[0] : numbers[-1] + 1] = block
        elif file is not None:  # written, not mapped: pages of a map would count as memory
            _append(file, np.ascontiguousarray(block, np.float16), sample.name)
        progress((numbers[-1] + 1) / stack.shape[0], "reading images")
    if file is not None:
        images = np.memmap(file, np.float16, "r", shape=shape)
    assert images is not None
    return replace(sample, stack=ArrayStack(images, scale=scale, sound=True))


def _temporary(name: str, size: int) -> IO[bytes]:
    """Open a file without a name that has room for `size` bytes."""
    folder = tempfile.gettempdir()
    room = shutil.disk_usage(folder).free
    if size > room:
        raise OutputFailed(
            f"{name}: its images take {size / 1e9:.1f} GB, but the temporary folder {folder} has"
            f" room for {room / 1e9:.1f} GB"
        )
    return tempfile.TemporaryFile(prefix="patina-")


def _append(file: IO[bytes], block: NDArray[np.float16], name: str) -> None:
    try:
        file.write(block.data)
        file.flush()
    except OSError as error:
        raise OutputFailed(
            f"{name}: the temporary folder {tempfile.gettempdir()} cannot take its images:"
            f" {error.strerror or error}"
        ) from error


def held_mb(stack: ImageStack) -> float:
    """Return how many MiB of memory a stack's images take up; mapped files take none."""
    images = stack.images if isinstance(stack, ArrayStack) else None
    return 0.0 if images is None or isinstance(images, np.memmap) else images.nbytes / 2**20


def halved(block: F4) -> tuple[F4, F4]:
    """Factors (n,) of images (n, H, W, 3), 1 where nothing exceeds 65504, and images over them."""
    peak = block.max(axis=(1, 2, 3))
    scale = np.maximum(peak / np.float32(LARGEST_HALF), np.float32(1))
    return scale, block if (scale == 1).all() else block / scale[:, None, None, None]


def flaws(stack: ImageStack) -> Flaws:
    """Count the values that `read` mends: in all of an `ArrayStack`, or as told by the stack.

    Stacks of image files know the flaws of what has been read so far; others have none.
    """
    told = getattr(stack, "flaws", None)
    if isinstance(told, Flaws):
        return told
    nan = infinite = negative = 0
    if isinstance(stack, ArrayStack) and not stack.sound:
        for numbers in blocks(stack):
            values = stack.raw(numbers)
            release(stack)
            nan += int(np.isnan(values).sum())
            infinite += int(np.isinf(values).sum())
            negative += int(((values < 0) & np.isfinite(values)).sum())
    return Flaws(nan, infinite, negative)
