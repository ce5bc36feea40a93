"""Pictures of a decorated surface without any graphics library.

Two ways. In atlas space, radiance is computed once for every surfel that the picture shows,
towards the eye, and read by the picture's samples through the atlas. Per pixel, every sample is
shaded on its own at its own place. Both average over samples in linear radiance, and give the
same bits for any number of threads.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit

from btfcore.errors import InvalidParameter
from btfcore.progress import Progress, between, silent
from btfcore.render.camera import Turntable
from btfcore.render.footprint import (
    gather,
    level_offsets,
    mark,
    pyramid,
    spread_down,
    texel_places,
)
from btfcore.render.pool import shared_pool
from btfcore.render.raster import GBuffer, Raster, gbuffer, raster
from btfcore.types import F4, F8, I4, I8, Frozen

_LABEL = "rendering"
_CHUNK = 1 << 16  # surfels shaded between two calls of progress


class Shade(Protocol):
    """Linear radiance (n, 3) f4 of the surfels `chosen` (n,) towards a homogeneous eye (4,).

    position (n, 3): where each is looked at, None: at its own place.
    """

    def __call__(self, chosen: I8, eye: F8, position: F8 | None) -> F4:
        """Return the radiance."""


@dataclass(frozen=True, eq=False)
class Subject(Frozen):
    """The shape that is drawn, and which surfel each texel of its atlas shows.

    positions (n, 3) f8 scene coordinates; uv (n, 2) f4 from the atlas's upper left corner; faces
    (m, 3) i4; closed: seen from outside only; gutter (size, size) i4: surfel of every texel.
    """

    positions: F8
    uv: F4
    faces: I4
    closed: bool
    gutter: I4


def render_linear(
    subject: Subject,
    shade: Shade,
    camera: Turntable,
    *,
    size: tuple[int, int],
    samples: int = 4,
    per_pixel: bool = False,
    pool: Executor | None | str = "shared",
    progress: Progress = silent,
) -> F4:
    """Picture (H, W, 4) f4: linear radiance premultiplied by alpha, row 0 on top.

    size : width and height in pixels. samples : along each side of a pixel. per_pixel : shade
    every sample from the surfel of its nearest texel at its own place, else every surfel once.
    pool : threads, None for the calling one alone. Raises `InvalidParameter`.
    """
    threads = shared_pool() if isinstance(pool, str) else pool
    drawn = raster(
        subject.positions, subject.faces, camera, size=size, samples=samples,
        both_sides=not subject.closed,
    )  # fmt: skip
    places = texel_places(subject.uv, len(subject.gutter))
    draw = _per_pixel if per_pixel else _through_atlas
    picture = draw(subject, shade, camera, drawn, places, threads, progress)
    if not np.isfinite(picture).all():
        raise InvalidParameter("a light is too bright: radiance beyond single floats")
    return picture


def shown_surfels(subject: Subject, camera: Turntable, *, size: tuple[int, int],
                  samples: int = 4) -> I8:  # fmt: skip
    """Numbers (n,) i8, ascending, of the surfels that a picture in atlas space needs."""
    drawn = raster(
        subject.positions, subject.faces, camera, size=size, samples=samples,
        both_sides=not subject.closed,
    )  # fmt: skip
    places = texel_places(subject.uv, len(subject.gutter))
    side = len(subject.gutter)
    marks, _ = _needed(drawn, places, level_offsets(side), shared_pool(), silent)
    return np.unique(subject.gutter.reshape(-1)[marks[: side * side] > 0]).astype(np.int64)


# --- inside


def _through_atlas(
    subject: Subject, shade: Shade, camera: Turntable, drawn: Raster, places: F8,
    pool: Executor | None, progress: Progress,
) -> F4:  # fmt: skip
    side = len(subject.gutter)
    offsets = level_offsets(side)
    marks, levels = _needed(drawn, places, offsets, pool, between(progress, 0.0, 0.2))
    flat = subject.gutter.reshape(-1)
    wanted = np.flatnonzero(marks[: side * side])
    chosen, where = np.unique(flat[wanted], return_inverse=True)
    slot = np.zeros(side * side, np.int32)
    slot[wanted] = where
    colour = np.zeros((max(len(chosen), 1), 3), np.float32)
    numbers = chosen.astype(np.int64)
    for begin in range(0, len(numbers), _CHUNK):
        progress(0.2 + 0.6 * begin / len(numbers), _LABEL)
        part = slice(begin, begin + _CHUNK)
        colour[part] = shade(numbers[part], camera.eye, None)
    upper = pyramid(colour, slot, marks, offsets, levels)

    out = np.empty((drawn.size[1], drawn.size[0], 4), np.float32)

    def draw(first: int, last: int) -> None:
        seen = gbuffer(drawn, first, last)
        top = first * drawn.samples
        out[first:last] = gather(seen, drawn, top, places, offsets, slot, colour, upper)

    _over_bands(draw, drawn, pool, between(progress, 0.8, 1.0))
    return out


def _needed(
    drawn: Raster, places: F8, offsets: I8, pool: Executor | None, progress: Progress
) -> tuple[np.ndarray, int]:
    """Marks of the atlas's pyramid that the picture needs, and the levels in use."""
    marks = np.zeros(int(offsets[-1]), np.uint8)

    def look(first: int, last: int) -> None:
        mark(gbuffer(drawn, first, last), drawn, first * drawn.samples, places, offsets, marks)

    _over_bands(look, drawn, pool, progress)
    return marks, spread_down(marks, offsets)


def _per_pixel(
    subject: Subject, shade: Shade, camera: Turntable, drawn: Raster, places: F8,
    pool: Executor | None, progress: Progress,
) -> F4:  # fmt: skip
    bands = drawn.bands()
    out = np.empty((drawn.size[1], drawn.size[0], 4), np.float32)
    for number, (first, last) in enumerate(bands):
        progress(number / len(bands), _LABEL)
        seen = gbuffer(drawn, first, last)
        place, surfel, position = _points(seen, drawn, subject, places)
        colour = np.zeros((len(place), 3), np.float32)
        for begin in range(0, len(place), _CHUNK):
            progress(number / len(bands), _LABEL)
            part = slice(begin, begin + _CHUNK)
            colour[part] = shade(surfel[part], camera.eye, position[part])
        out[first:last] = _averaged(place, colour, seen, drawn)
    return out


def _points(seen: GBuffer, drawn: Raster, subject: Subject, places: F8) -> tuple[I8, I8, F8]:
    """Flat numbers, surfels and scene positions of all samples of a band that show something."""
    place = np.flatnonzero(seen.face >= 0)
    corner = drawn.faces[seen.face.reshape(-1)[place]]
    later = seen.bary.reshape(-1, 2)[place].astype(np.float64)
    share = np.column_stack([1 - later.sum(axis=1), later])
    texel = np.einsum("nk,nkj->nj", share, places[corner], optimize=False)
    column, row = np.clip(np.rint(texel), 0, len(subject.gutter) - 1).astype(np.int64).T
    position = np.einsum("nk,nkj->nj", share, subject.positions[corner], optimize=False)
    return place, subject.gutter[row, column].astype(np.int64), position


def _averaged(place: I8, colour: F4, seen: GBuffer, drawn: Raster) -> F4:
    rows, columns = seen.face.shape
    step = drawn.samples
    out = np.zeros((rows // step, columns // step, 4))
    _add(place, colour, columns, step, out)
    return out.astype(np.float32)


@njit(cache=True, nogil=True)
def _add(place, colour, columns, step, out):  # type: ignore[no-untyped-def]
    share = 1.0 / (step * step)
    for index in range(len(place)):
        row, column = place[index] // columns // step, place[index] % columns // step
        for band in range(3):
            out[row, column, band] += share * colour[index, band]
        out[row, column, 3] += share


def _over_bands(
    work: Callable[[int, int], None], drawn: Raster, pool: Executor | None, progress: Progress
) -> None:
    """Call `work(first, last)` for all bands of pixel rows, each of which writes its own."""
    bands = drawn.bands()
    if pool is None:
        for number, band in enumerate(bands):
            progress(number / len(bands), _LABEL)
            work(*band)
        return
    waiting = [pool.submit(work, *band) for band in bands]
    try:
        for number, each in enumerate(waiting):
            progress(number / len(bands), _LABEL)
            each.result()
    finally:
        for each in waiting:
            each.cancel()
        for each in waiting:  # none may still write when this returns
            if not each.cancelled():
                each.exception()
