"""Radiance of many surfels in compiled code: `btfcore.render.reference` at the speed of a frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.errors import InvalidParameter
from btfcore.render.factor_kernels import FactorTables, factor_slice, factor_tables
from btfcore.render.harmonic_kernels import (
    HarmonicTables,
    environment,
    harmonic_slice,
    harmonic_tables,
)
from btfcore.render.lights import Lights
from btfcore.render.lookup import points, scaled_eye, task
from btfcore.render.material import (
    FactorMaterial,
    HarmonicMaterial,
    Material,
    bare_material,
)
from btfcore.render.pool import in_slices
from btfcore.render.raw_kernels import RawTables, raw_slice, raw_tables
from btfcore.render.rows import locked
from btfcore.render.surfels import Surfels
from btfcore.types import F4, F8, I4, I8

UNSEEN = locked(np.zeros((0, 0), np.float32))  # stands for no cast shadows


class Evaluator:
    """Materials laid out for the kernels once, and asked for every frame.

    Asking is safe from several threads at once.
    """

    def __init__(self, materials: Sequence[Material]) -> None:
        """Lay `materials` out, by sample number."""
        self.materials = tuple(materials)
        self._made = [_laid_out(each) for each in (*self.materials, bare_material())]

    def radiance(
        self,
        surfels: Surfels,
        eye: F8,
        lights: Lights,
        chosen: NDArray[Any] | None = None,
        *,
        position: NDArray[Any] | None = None,
        visible: F4 | None = None,
        out: F4 | None = None,
        pool: Executor | None = None,
    ) -> F4:
        """Linear radiance (n, 3) f4 ≥ 0, finite, of surfels towards `eye`.

        chosen (n,): numbers of the surfels, None: all. position (n, 3): where each is looked at
        instead of at its own place. visible (L, n) f4 in 0–1: share of each light that arrives.
        out (n, 3) f4: is filled and returned. pool: threads that share the work
        (`btfcore.render.pool.shared_pool`), None: the calling one; the bits are the same, and do
        not depend on which other surfels are chosen. Raises `InvalidParameter` where a surfel
        names a sample that is not there, and for arrays of wrong shapes.
        """
        numbers = np.arange(len(surfels)) if chosen is None else np.asarray(chosen)
        numbers = np.ascontiguousarray(numbers, np.int64)
        out = checked_out(out, len(numbers))
        seen = checked_shapes(len(numbers), len(lights), position, visible)
        for number, rows in by_sample(surfels, numbers, len(self.materials)):
            work = self.worker(number, surfels, numbers, rows, eye, lights, position, seen, out)
            in_slices(work, len(rows), pool)
        return out

    def made(self, number: int) -> FactorTables | RawTables | HarmonicTables:
        """Return what was laid out of a sample; the number after the last is what bare is."""
        return self._made[number]

    def worker(
        self,
        number: int,
        surfels: Surfels,
        numbers: I8,
        rows: I4,
        eye: F8,
        lights: Lights,
        position: NDArray[Any] | None,
        visible: F4,
        out: F4,
    ) -> Callable[[int, int], object]:
        """What fills the rows[begin:end] of `out` with radiance of one sample's material."""
        made = self._made[number]
        where, which, seen_from = points(surfels), task(numbers, position, rows), scaled_eye(eye)
        if isinstance(made, HarmonicTables):
            around = environment(lights, made)
            lamps = _lamps(lights, len(lights) - (lights.sampled if len(around.points) else 0))
            return lambda begin, end: harmonic_slice(
                where, which, begin, end, seen_from, lamps, visible, made, around, out
            )
        kernel = factor_slice if isinstance(made, FactorTables) else raw_slice
        lamps = _lamps(lights, len(lights))
        return lambda begin, end: kernel(
            where, which, begin, end, seen_from, lamps, visible, made, out
        )


def radiance(
    materials: Sequence[Material],
    surfels: Surfels,
    eye: F8,
    lights: Lights,
    chosen: NDArray[Any] | None = None,
    *,
    position: NDArray[Any] | None = None,
    visible: F4 | None = None,
    out: F4 | None = None,
    pool: Executor | None = None,
) -> F4:
    """Radiance of surfels, asked once; see `Evaluator.radiance`."""
    return Evaluator(materials).radiance(
        surfels, eye, lights, chosen, position=position, visible=visible, out=out, pool=pool
    )


def checked_out(out: F4 | None, count: int) -> F4:
    """Return `out`, or a new array (count, 3) f4; raises `InvalidParameter` for a wrong one."""
    if out is None:
        return np.empty((count, 3), np.float32)
    if out.shape != (count, 3) or out.dtype != np.float32 or not out.flags.c_contiguous:
        raise InvalidParameter(
            f"results into {out.shape} {out.dtype}, where ({count}, 3) float32 is needed"
        )
    return out


def checked_shapes(
    count: int, lights: int, position: NDArray[Any] | None, visible: F4 | None
) -> F4:
    """Return `visible` as kernels take it; raises `InvalidParameter` for wrong shapes."""
    if position is not None and position.shape != (count, 3):
        raise InvalidParameter(f"positions of shape {position.shape} for {count} surfels")
    if visible is None:
        return UNSEEN
    if visible.shape != (lights, count):
        raise InvalidParameter(
            f"visibility of shape {visible.shape} for {lights} lights and {count} surfels"
        )
    return locked(np.ascontiguousarray(visible, np.float32))


def by_sample(surfels: Surfels, numbers: I8, samples: int) -> list[tuple[int, I4]]:
    """Rows (m,) i4 of `numbers` of each sample that occurs, in order; bare ones as the last.

    Raises `InvalidParameter` where a sample or a surfel is not there.
    """
    if len(numbers) and not 0 <= numbers.min() <= numbers.max() < len(surfels):
        raise InvalidParameter(
            f"surfels {numbers.min()}..{numbers.max()} are named, there are {len(surfels)}"
        )
    counts = np.zeros(samples + 2, np.int64)
    rows = np.empty(len(numbers), np.int32)
    highest = int(_sorted(surfels.sample, numbers, samples, counts, rows))
    if highest >= samples:
        raise InvalidParameter(f"a surfel names sample {highest}, {samples} are given")
    return [
        (which, rows[counts[which] : counts[which + 1]])
        for which in range(samples + 1)
        if counts[which + 1] > counts[which]
    ]


@njit(cache=True, nogil=True)
def _sorted(sample, numbers, samples, starts, rows):  # type: ignore[no-untyped-def]
    """Counting sort by sample; returns the highest number out of range, else -1."""
    highest = np.int64(-1)
    for number in numbers:
        which = np.int64(sample[number])
        if which == 65535:  # bare
            which = samples
        elif which >= samples:
            highest = which if which > highest else highest
            which = samples
        starts[which + 1] += 1
    for k in range(samples + 1):
        starts[k + 1] += starts[k]
    place = starts.copy()
    for row in range(len(numbers)):
        own = min(np.int64(sample[numbers[row]]), samples)
        rows[place[own]] = row
        place[own] += 1
    return highest


def _laid_out(material: Material) -> FactorTables | RawTables | HarmonicTables:
    if isinstance(material, FactorMaterial):
        return factor_tables(material)
    if isinstance(material, HarmonicMaterial):
        return harmonic_tables(material)
    return raw_tables(material)


def _lamps(lights: Lights, count: int) -> tuple[F4, F4]:
    return (
        lights.direction[:count].astype(np.float32),
        lights.intensity[:count].astype(np.float32),
    )
