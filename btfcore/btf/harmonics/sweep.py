"""Reads a sample view by view, as many rows at a time as fit into memory, and fits them."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from btfcore.btf.harmonics.linear import product
from btfcore.btf.harmonics.operators import ViewOperator
from btfcore.btf.sample import BtfSample
from btfcore.btf.stack import CropStack, ImageStack, block_size
from btfcore.progress import Progress, between, silent
from btfcore.types import F4, F8

LIGHTS_AT_ONCE = 16
TEXELS_AT_ONCE = 1 << 15
READ_MB = 32.0


@dataclass(frozen=True)
class Band:
    """Rows of one view: radiance (L, 3n) f4 and coefficients (M, 3n) f8 of its n texels.

    Texel and colour run together, the colour fastest. start : number of the first texel
    among those of all views. progress : of what is done with the band.
    """

    view: int
    rows: slice
    start: int
    operator: ViewOperator
    radiance: F4
    coefficients: F8
    progress: Progress = silent

    @property
    def texels(self) -> int:
        """Number n of texels."""
        return self.radiance.shape[1] // 3


def by_vector(columns: F8) -> F8:
    """Coefficient vectors (3M, n), entry 3m + c, as columns, from (M, 3n); maybe a view."""
    count = len(columns)
    return columns.reshape(count, -1, 3).transpose(0, 2, 1).reshape(3 * count, -1)


def by_texel(vectors: F8) -> F8:
    """Undo `by_vector`: (3M, n) to (M, 3n)."""
    count = len(vectors) // 3
    return vectors.reshape(count, 3, -1).transpose(0, 2, 1).reshape(count, -1)


class Sweep:
    """A way through all texels of all views that can be gone as often as needed."""

    def __init__(
        self,
        sample: BtfSample,
        operators: list[ViewOperator],
        *,
        functions: int,
        components: int,
        memory_mb: float,
    ) -> None:
        """Choose bands, and how many are read together, for work within `memory_mb` MiB."""
        self.sample, self.operators = sample, operators
        height, width = sample.shape
        self._lights = max(len(operator.images) for operator in operators)
        self._read_mb = min(READ_MB, memory_mb / 8)
        # coefficients, their vectors and copies; weights; reconstructions of a few images
        work = 5 * 24 * functions + 20 * components + 48 * LIGHTS_AT_ONCE
        budget = memory_mb * 0.8 * 2**20
        texels = min(TEXELS_AT_ONCE, budget / 2 / work)
        self._rows = int(np.clip(texels // width, 1, height))
        bands = -(-height // self._rows)
        room = budget / (self._rows * width) - work
        self._together = int(np.clip(room / (12 * self._lights), 1, bands))

    def bands(
        self, pool: ThreadPoolExecutor | None, progress: Progress, label: str
    ) -> Iterator[Band]:
        """Every band of every view, in order; a band's radiance lasts until the next one."""
        height, width = self.sample.shape
        high = self._rows * self._together
        buffer = np.empty(self._lights * min(high, height) * width * 3, np.float32)
        steps = [(v, first) for v in range(len(self.operators)) for first in range(0, height, high)]
        for number, (view, first) in enumerate(steps):
            inner = between(progress, number / len(steps), (number + 1) / len(steps))
            last = min(first + high, height)
            cuts = [slice(r, min(r + self._rows, last)) for r in range(first, last, self._rows)]
            operator = self.operators[view]
            parts = self._read(operator, cuts, buffer, between(inner, 0, 0.4), label)
            for part, (rows, radiance) in enumerate(zip(cuts, parts, strict=True)):
                share = (0.4 + 0.6 * part / len(cuts), 0.4 + 0.6 * (part + 1) / len(cuts))
                then = between(inner, *share)
                then(0.0, label)
                found = product(operator.solve, radiance, pool=pool)
                then(0.2, label)
                start = (view * height + rows.start) * width
                yield Band(view, rows, start, operator, radiance, found, between(then, 0.2, 1))
        progress(1.0, label)

    def _read(
        self,
        operator: ViewOperator,
        cuts: list[slice],
        buffer: F4,
        progress: Progress,
        label: str,
    ) -> list[F4]:
        """Radiance (L, 3n) of each band in `cuts`, laid out one after the other in `buffer`."""
        height, width = self.sample.shape
        whole = slice(cuts[0].start, cuts[-1].stop)
        stack: ImageStack = self.sample.stack
        if whole != slice(0, height):
            stack = CropStack(stack, whole, slice(0, width))
        images = operator.images
        parts, used = [], 0
        for rows in cuts:
            size = (rows.stop - rows.start) * width * 3
            parts.append(buffer[used : used + len(images) * size].reshape(len(images), size))
            used += len(images) * size
        step = block_size(self.sample.stack, budget_mb=self._read_mb)
        for low in range(0, len(images), step):
            progress(low / len(images), label)
            block = stack.read(images[low : low + step])
            for rows, part in zip(cuts, parts, strict=True):
                here = block[:, rows.start - whole.start : rows.stop - whole.start]
                part[low : low + step] = here.reshape(len(block), -1)
        return parts
