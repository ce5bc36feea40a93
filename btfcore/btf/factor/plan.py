"""How a factorisation keeps within its memory: block sizes from what is left after the factors."""

from __future__ import annotations

from dataclasses import dataclass

from btfcore.btf.factor.blocks import BLOCK_MB, reading_mb
from btfcore.btf.factor.kernels import LANES
from btfcore.btf.stack import ImageStack
from btfcore.errors import InvalidParameter

_FIXED_MB = 8.0  # interpreter, small arrays, what the allocator keeps


@dataclass(frozen=True)
class Plan:
    """images: of a block; keep: all coded blocks fit into memory; needed_mb: what it all takes."""

    images: int
    keep: bool
    needed_mb: float


def plan(name: str, stack: ImageStack, *, width: int, rank: int, memory_mb: float) -> Plan:
    """Divide `memory_mb` MiB; raises `InvalidParameter` where the factors alone need more."""
    count, height, columns = stack.shape
    texels = -(-height * columns // LANES) * LANES
    # tall: f8 sums and f4 factors; right: f4; then the results beside them
    factors = texels * width * 12 + count * 3 * width * 4
    results = height * columns * rank * 4 + count * 3 * (rank + 1) * 4
    fixed = (factors + results) / 2**20 + reading_mb(stack) + _FIXED_MB
    image = texels * 12 / 2**20  # coded
    least = fixed + 2 * image
    if not memory_mb >= least:  # neither is NaN
        raise InvalidParameter(
            f"{name}: {memory_mb:g} MiB of memory, where {width} columns of {height * columns}"
            f" texels and {count} images need {least:.0f}"
        )
    left = memory_mb - fixed
    whole = (count + 4) * image * 1.02
    keep = whole <= left
    block = min(BLOCK_MB, left / 2)
    images = max(1, int(block / image))
    if images > 4:
        images -= images % 4
    images = min(images, count)
    return Plan(images, keep, fixed + (whole if keep else images * image))
