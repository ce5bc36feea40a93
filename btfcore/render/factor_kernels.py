"""Radiance from factors: sixteen rows of the table blended, dotted with a texel, decoded.

Rows of the table are laid out for `btfcore.render.rows.blend`: the K values of red, of green, of
blue, each padded with zeros, then the three means.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from btfcore.btf.factor.elementary import decode_rows
from btfcore.btf.factor.encoding import knobs
from btfcore.render.lookup import find_lights, find_views, scratch
from btfcore.render.lookup_tables import Lookup, lookup
from btfcore.render.material import FactorMaterial
from btfcore.render.pool import BLOCK
from btfcore.render.rows import aligned, blend, dot, locked, padded
from btfcore.types import F4

GREATEST = np.float32(3e38)
_ZERO, _ONE = np.float32(0), np.float32(1)


class FactorTables(NamedTuple):
    """A `FactorMaterial` as kernels take it.

    table (A·B·width,) f4: a row of width = padded(3 · rank + 3) a pair of nodes; weights
    (H·W·rank,) f4, rank being K rounded up to whole vectors.
    """

    table: F4
    nodes: int
    width: int
    weights: F4
    rank: int
    height: int
    across: int
    tiles: bool
    cosine: bool
    kind: int
    epsilon: np.float32
    knee: np.float32
    views: Lookup
    lights: Lookup


def factor_tables(material: FactorMaterial) -> FactorTables:
    """Lay a material out; copies the table, and the weights unless K is whole vectors."""
    views, lights, _, columns = material.table.shape
    own = columns - 1
    rank = padded(own)
    width = padded(3 * rank + 3)
    table = aligned((views * lights, width))
    flat = material.table.reshape(views * lights, 3, columns)
    for colour in range(3):
        table[:, colour * rank : colour * rank + own] = flat[:, colour, :own]
        table[:, 3 * rank + colour] = flat[:, colour, own]
    weights = material.weights
    if rank != own:
        weights = aligned((*material.shape, rank))
        weights[..., :own] = material.weights
    kind, epsilon, knee = knobs(material.encoding)
    return FactorTables(
        locked(table.reshape(-1)), lights, width, locked(weights.reshape(-1)), rank,
        *material.shape, material.tiles, material.cosine, kind, epsilon, knee,
        lookup(material.views), lookup(material.lights),
    )  # fmt: skip


@njit(inline="always", error_model="numpy")
def between(place, size, tiles):  # type: ignore[no-untyped-def]
    """Texels before and after a position along an axis, and the share of the one after."""
    if tiles:
        inside = place - size * np.floor(place * (1.0 / size))
    else:
        inside = min(max(place, 0.0), size - 1.0)
    before = min(max(int(inside), 0), size - 1)
    after = before + 1
    if after >= size:
        after = 0 if tiles else before
    return before, after, np.float32(inside - before)


@njit(inline="always", error_model="numpy")
def corners(column, row, height, width, tiles):  # type: ignore[no-untyped-def]
    """Flat numbers of the four texels around a position, and their shares."""
    left, right, x = between(np.float64(column), width, tiles)
    above, below, y = between(np.float64(row), height, tiles)
    above, below = above * width, below * width
    return (
        (above + left, above + right, below + left, below + right),
        ((_ONE - y) * (_ONE - x), (_ONE - y) * x, y * (_ONE - x), y * x),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def texels_into(flat, rank, height, width, tiles, surfels, task, begin, count, out):  # type: ignore[no-untyped-def]
    """Blend a map of `rank` values a texel, flat (H·W·rank,), for a block: out (BLOCK·rank,)."""
    for i in range(count):
        n = task.numbers[task.rows[begin + i]]
        at, share = corners(surfels.source[n, 0], surfels.source[n, 1], height, width, tiles)
        starts = (at[0] * rank, at[1] * rank, at[2] * rank, at[3] * rank)
        blend(flat, starts, share, out, i * rank, rank)


@njit(inline="always", error_model="numpy")
def row_into(table, nodes, width, views, lamps, i, out, begin):  # type: ignore[no-untyped-def]
    """Blend the rows of a surfel's view nodes and light nodes into out[begin …]."""
    v, a, w, b = views.node, views.share, lamps.node, lamps.share
    v0, v1, a0, a1 = v[i, 0] * nodes, v[i, 1] * nodes, a[i, 0], a[i, 1]
    v2, v3, a2, a3 = v[i, 2] * nodes, v[i, 3] * nodes, a[i, 2], a[i, 3]
    w0, w1, b0, b1 = w[i, 0], w[i, 1], b[i, 0], b[i, 1]
    w2, w3, b2, b3 = w[i, 2], w[i, 3], b[i, 2], b[i, 3]
    # past the outermost ring, in triangles and for pictures there are fewer rows to read
    if a2 == _ZERO and a3 == _ZERO:
        if b2 == _ZERO and b3 == _ZERO:
            blend(
                table,
                ((v0 + w0) * width, (v0 + w1) * width, (v1 + w0) * width, (v1 + w1) * width),
                (a0 * b0, a0 * b1, a1 * b0, a1 * b1),
                out, begin, width,
            )  # fmt: skip
            return
        blend(
            table,
            (
                (v0 + w0) * width, (v0 + w1) * width, (v0 + w2) * width, (v0 + w3) * width,
                (v1 + w0) * width, (v1 + w1) * width, (v1 + w2) * width, (v1 + w3) * width,
            ),
            (a0 * b0, a0 * b1, a0 * b2, a0 * b3, a1 * b0, a1 * b1, a1 * b2, a1 * b3),
            out, begin, width,
        )  # fmt: skip
        return
    if b2 == _ZERO and b3 == _ZERO:
        blend(
            table,
            (
                (v0 + w0) * width, (v0 + w1) * width, (v1 + w0) * width, (v1 + w1) * width,
                (v2 + w0) * width, (v2 + w1) * width, (v3 + w0) * width, (v3 + w1) * width,
            ),
            (a0 * b0, a0 * b1, a1 * b0, a1 * b1, a2 * b0, a2 * b1, a3 * b0, a3 * b1),
            out, begin, width,
        )  # fmt: skip
        return
    if a3 == _ZERO and b3 == _ZERO:
        blend(
            table,
            (
                (v0 + w0) * width, (v0 + w1) * width, (v0 + w2) * width,
                (v1 + w0) * width, (v1 + w1) * width, (v1 + w2) * width,
                (v2 + w0) * width, (v2 + w1) * width, (v2 + w2) * width,
            ),
            (a0 * b0, a0 * b1, a0 * b2, a1 * b0, a1 * b1, a1 * b2, a2 * b0, a2 * b1, a2 * b2),
            out, begin, width,
        )  # fmt: skip
        return
    blend(
        table,
        (
            (v0 + w0) * width, (v0 + w1) * width, (v0 + w2) * width, (v0 + w3) * width,
            (v1 + w0) * width, (v1 + w1) * width, (v1 + w2) * width, (v1 + w3) * width,
            (v2 + w0) * width, (v2 + w1) * width, (v2 + w2) * width, (v2 + w3) * width,
            (v3 + w0) * width, (v3 + w1) * width, (v3 + w2) * width, (v3 + w3) * width,
        ),
        (
            a0 * b0, a0 * b1, a0 * b2, a0 * b3, a1 * b0, a1 * b1, a1 * b2, a1 * b3,
            a2 * b0, a2 * b1, a2 * b2, a2 * b3, a3 * b0, a3 * b1, a3 * b2, a3 * b3,
        ),
        out, begin, width,
    )  # fmt: skip


@njit(inline="always", error_model="numpy")
def coded_into(row, weights, rank, coded, i):  # type: ignore[no-untyped-def]
    """Coded radiance of a block's texel: a blended row times its weights, plus the means."""
    for colour in range(3):
        value = dot(weights, i * rank, row, colour * rank, rank)
        coded[colour, i] = value + row[3 * rank + colour]


@njit(cache=True, nogil=True, error_model="numpy")
def see(made, views, weights, i, row, seen):  # type: ignore[no-untyped-def]
    """Coded radiance of a block's texel under every light node: seen[i, b, colour]."""
    rank, width, size = made.rank, made.width, made.nodes * made.width
    v, a = views.node, views.share
    v0, v1, v2, v3 = v[i, 0] * size, v[i, 1] * size, v[i, 2] * size, v[i, 3] * size
    shares = (a[i, 0], a[i, 1], a[i, 2], a[i, 3])
    for b in range(made.nodes):
        at = b * width
        blend(made.table, (v0 + at, v1 + at, v2 + at, v3 + at), shares, row, 0, width)
        for colour in range(3):
            value = dot(weights, i * rank, row, colour * rank, rank)
            seen[(i * made.nodes + b) * 3 + colour] = value + row[3 * rank + colour]


@njit(inline="always", error_model="numpy")
def under_light(seen, nodes, lamps, i, coded):  # type: ignore[no-untyped-def]
    """Blend what `see` found between the nodes of a light."""
    w, b = lamps.node, lamps.share
    for colour in range(3):
        value = _ZERO
        for k in range(4):
            value += b[i, k] * seen[(i * nodes + w[i, k]) * 3 + colour]
        coded[colour, i] = value


@njit(cache=True, nogil=True, error_model="numpy")
def factor_slice(surfels, task, begin, end, eye, lights, visible, made, out):  # type: ignore[no-untyped-def]
    """Write the radiance of the task's rows begin … end into `out` (n, 3) f4.

    lights : (direction (L, 3) f4, intensity (L, 3) f4); visible (L, n) f4 or (0, 0).
    """
    rank, width = made.rank, made.width
    views, lamps = scratch(made.views.slots), scratch(made.lights.slots)
    weights, row = np.zeros(BLOCK * rank, np.float32), np.zeros(width, np.float32)
    coded, sums = np.zeros((3, BLOCK), np.float32), np.empty((BLOCK, 3), np.float32)
    # with many lights it is cheaper to know a texel under all nodes first
    many = 2 * len(lights[0]) >= made.nodes > 1
    seen = np.empty(BLOCK * made.nodes * 3 if many else 0, np.float32)
    for start in range(begin, end, BLOCK):
        count = min(BLOCK, end - start)
        find_views(made.views, surfels, task, eye, start, count, views)
        texels_into(
            made.weights, rank, made.height, made.across, made.tiles, surfels, task, start, count,
            weights,
        )  # fmt: skip
        if many:
            for i in range(count):
                see(made, views, weights, i, row, seen)
        sums[:] = _ZERO
        for light in range(len(lights[0])):
            find_lights(
                made.lights, surfels, task, lights[0][light], made.cosine, start, count, lamps
            )
            for i in range(count):
                if not lamps.gain[i] > _ZERO:
                    continue
                if many:
                    under_light(seen, made.nodes, lamps, i, coded)
                else:
                    row_into(made.table, made.nodes, width, views, lamps, i, row, 0)
                    coded_into(row, weights, rank, coded, i)
            decode_rows(coded[0], coded[1], coded[2], made.kind, made.epsilon, made.knee)
            add_light(coded, lamps.gain, lights[1][light], visible, light, task, start, count, sums)
        store(sums, task, start, count, out)


@njit(cache=True, nogil=True, error_model="numpy")
def add_light(values, gain, intensity, visible, light, task, begin, count, sums):  # type: ignore[no-untyped-def]
    """Add radiance (3, BLOCK) under a light of strength 1 to `sums` (BLOCK, 3)."""
    for i in range(count):
        share = gain[i]
        if not share > _ZERO:
            continue
        if len(visible):
            share *= visible[light, task.rows[begin + i]]
        for colour in range(3):
            sums[i, colour] += values[colour, i] * share * intensity[colour]


@njit(cache=True, nogil=True, error_model="numpy")
def store(sums, task, begin, count, out):  # type: ignore[no-untyped-def]
    """Write a block's sums (BLOCK, 3) to their rows of `out`, cut to what is radiance."""
    for i in range(count):
        at = task.rows[begin + i]
        for colour in range(3):
            value = sums[i, colour]
            out[at, colour] = min(value, GREATEST) if value > _ZERO else _ZERO  # NaN is not
