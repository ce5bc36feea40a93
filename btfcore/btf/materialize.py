"""Brings images that are dear to read into memory or into a mapped temporary file, once."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.sample import BtfSample
from btfcore.btf.stack import LARGEST_HALF, ArrayStack, ImageStack, block_size
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
    image so that nothing overflows; they are exact to 5e-4 of the value.
    """
    stack = sample.stack
    if not stack.dear:
        return sample
    values = int(np.prod(stack.shape)) * 3
    full = values * 4 <= memory_mb * 2**20
    images: NDArray[Any]
    if full or values * 2 <= memory_mb * 2**20:
        images = np.empty((*stack.shape, 3), np.float32 if full else np.float16)
    else:
        file = tempfile.TemporaryFile(prefix="patina-")
        images = np.memmap(file, np.float16, "w+", shape=(*stack.shape, 3))
    scale = None if full else np.ones(stack.shape[0], np.float32)
    for numbers in blocks(stack):
        block = stack.read(numbers)
        if scale is not None:
            scale[numbers], block = halved(block)
        images[numbers[0] : numbers[-1] + 1] = block
        progress((numbers[-1] + 1) / stack.shape[0], "reading images")
    return replace(sample, stack=ArrayStack(images, scale=scale, sound=True))


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
            nan += int(np.isnan(values).sum())
            infinite += int(np.isinf(values).sum())
            negative += int(((values < 0) & np.isfinite(values)).sum())
    return Flaws(nan, infinite, negative)
