"""Colours of a quilting map: per dense vertex, and as an image of the atlas."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.errors import InvalidParameter
from btfcore.progress import Progress, blocks, silent
from btfcore.render.gutter import gutter_source
from btfcore.types import F4, I4, DenseMesh, Quilt, Sample

BARE = np.float32(0.5)  # grey of vertices that no patch covers yet


def vertex_colours(quilt: Quilt, samples: Sequence[Sample], *, progress: Progress = silent) -> F4:
    """Colour of every dense vertex: (N, 3) f4, coded like the samples (sRGB 0–1).

    Bilinear look-up at the vertex's own source position in its own sample, so nothing is
    ever blended across patches; positions beyond the sample take its edge, or wrap where the
    sample tiles. Bare vertices are neutral grey. Raises `InvalidParameter` where a covered
    vertex names a sample that is not there or a position that is not finite.
    """
    colours = np.full((len(quilt.patch), 3), BARE, np.float32)
    covered = quilt.patch >= 0
    if not covered.any():
        return colours
    highest = int(quilt.sample[covered].max())
    if highest >= len(samples):
        raise InvalidParameter(f"the quilt names sample {highest}, only {len(samples)} given")
    if not np.isfinite(quilt.source[covered]).all():
        raise InvalidParameter("the quilt holds source positions that are not finite")
    for index, sample in enumerate(samples):
        colour = np.ascontiguousarray(sample.colour, np.float32)
        for begin, end in blocks(len(colours), 1 << 19, progress, "colours"):
            part = slice(begin, end)
            _look_up(
                colour, sample.tiles, quilt.source[part], quilt.sample[part], quilt.patch[part],
                index, colours[part],
            )  # fmt: skip
    return colours


def atlas_texture(
    dense: DenseMesh, colours: F4, *, source: I4 | None = None, progress: Progress = silent
) -> NDArray[np.uint8]:
    """Image of the atlas, gutter filled without limit: (size, size, 3) u8, row 0 on top.

    colours : (N, 3) f4, 0–1 per dense vertex, clipped and rounded to 8 bits. `source` is
    what `gutter_source` returned for this dense mesh; hand it in where colours change often.
    """
    if colours.shape != (len(dense.vertices), 3):
        raise InvalidParameter(
            f"colours have shape {colours.shape}, the dense mesh {len(dense.vertices)} vertices"
        )
    if source is None:
        source = gutter_source(dense, progress=progress)
    return _gather(source, quantise(colours))


def quantise(colours: F4) -> NDArray[np.uint8]:
    """Clip (n, 3) colours to 0–1 and round them to 8 bits; what is not a number becomes 0."""
    return _quantise(np.ascontiguousarray(colours, np.float32))


@njit(cache=True)
def _look_up(colour, tiles, source, sample, patch, index, out):  # type: ignore[no-untyped-def]
    height, width = colour.shape[:2]
    for vertex in range(len(patch)):
        if patch[vertex] < 0 or sample[vertex] != index:
            continue
        x, y = np.float64(source[vertex, 0]), np.float64(source[vertex, 1])
        if tiles:
            x, y = x % width, y % height
        else:
            x, y = min(max(x, 0.0), width - 1.0), min(max(y, 0.0), height - 1.0)
        left, top = int(np.floor(x)), int(np.floor(y))
        fx, fy = np.float32(x - left), np.float32(y - top)
        if tiles:  # a tiny negative x rounds up to `width` itself
            left, top = left % width, top % height
            right, bottom = (left + 1) % width, (top + 1) % height
        else:
            right, bottom = min(left + 1, width - 1), min(top + 1, height - 1)
        one = np.float32(1.0)
        for band in range(3):
            above = (one - fx) * colour[top, left, band] + fx * colour[top, right, band]
            below = (one - fx) * colour[bottom, left, band] + fx * colour[bottom, right, band]
            out[vertex, band] = (one - fy) * above + fy * below


@njit(cache=True)
def _gather(source, colours):  # type: ignore[no-untyped-def]
    height, width = source.shape
    image = np.empty((height, width, 3), np.uint8)
    for row in range(height):
        for column in range(width):
            vertex = source[row, column]
            image[row, column, 0] = colours[vertex, 0]
            image[row, column, 1] = colours[vertex, 1]
            image[row, column, 2] = colours[vertex, 2]
    return image


@njit(cache=True)
def _quantise(colours):  # type: ignore[no-untyped-def]
    coded = np.zeros(colours.shape, np.uint8)
    for index in range(len(colours)):
        for band in range(colours.shape[1]):
            value = colours[index, band]
            if value > 0.0:  # false for NaN too
                coded[index, band] = np.uint8(min(value, np.float32(1.0)) * 255.0 + 0.5)
    return coded
