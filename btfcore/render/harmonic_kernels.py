"""Radiance from spherical harmonics and their components (Furukawa §2, equation 1).

The weights of a texel are blended between views and contracted with the components once; each
light then costs one dot product with the basis functions in its direction, and an environment
one with its own coefficients in the surfel's frame.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from btfcore.btf.harmonics.basis import _recurrence, evaluate, functions
from btfcore.render.factor_kernels import add_light, corners, store
from btfcore.render.lights import Lights
from btfcore.render.lookup import find_views, lamps_into, scratch, unit_in_place
from btfcore.render.lookup_tables import Lookup, lookup
from btfcore.render.material import HarmonicMaterial
from btfcore.render.pool import BLOCK
from btfcore.render.reference import quadrature
from btfcore.render.rows import LANES, aligned, blend, blend_more, dot, locked, padded
from btfcore.types import F4, F8

_ZERO, _ONE = np.float32(0), np.float32(1)


class HarmonicTables(NamedTuple):
    """A `HarmonicMaterial` as kernels take it.

    weights (A·H·W·rank,) f4, rank being K rounded up to whole vectors; components
    ((rank + 1)·3·terms,) f4, one row for each component and last the mean, terms being M rounded
    up; first, second: factors of the recurrence of the basis.
    """

    weights: F4
    rank: int
    own: int
    components: F4
    terms: int
    height: int
    across: int
    tiles: bool
    views: Lookup
    order: int
    spherical: bool
    horizon: np.float32
    first: F8
    second: F8


class Environment(NamedTuple):
    """An environment at points of a quadrature: directions (Q, 3) f8, radiance · share (Q, 3)."""

    points: F8
    light: F8


NOWHERE = Environment(np.zeros((0, 3)), np.zeros((0, 3)))


def harmonic_tables(material: HarmonicMaterial) -> HarmonicTables:
    """Lay a material out; copies the weights unless K is whole vectors."""
    own, count = material.rank, functions(material.order)
    rank, terms = padded(own), padded(count)
    weights = np.ascontiguousarray(material.weights, np.float32)
    if rank != own:
        weights = aligned((*material.weights.shape[:3], rank))
        weights[..., :own] = material.weights
    components = aligned((rank + 1, 3, terms))
    components[:own, :, :count] = np.swapaxes(material.components[:own], 1, 2)
    components[rank, :, :count] = material.components[own].T
    return HarmonicTables(
        locked(weights.reshape(-1)), rank, own, locked(components.reshape(-1)), terms,
        *material.shape, material.tiles, lookup(material.views), material.order,
        material.kind == "spherical", np.float32(material.horizon), *_recurrence(material.order),
    )  # fmt: skip


def environment(lights: Lights, made: HarmonicTables) -> Environment:
    """What `lights.harmonics` is for a material, exact up to its order; `NOWHERE` for none."""
    if lights.harmonics is None:
        return NOWHERE
    coefficients = lights.harmonics
    if made.spherical:  # turning mixes no degrees: higher ones are orthogonal to the material
        coefficients = coefficients[: functions(made.order)]
    order = int(np.sqrt(len(coefficients))) - 1
    points, share = quadrature(order + made.order)
    radiance = np.einsum("qm,mc->qc", evaluate(points, order), coefficients)
    return Environment(points, radiance * share[:, None] / np.pi)


@njit(cache=True, nogil=True, error_model="numpy")
def basis_into(x, y, z, made, out):  # type: ignore[no-untyped-def]
    """Basis functions in a unit direction; a twin of `btfcore.btf.harmonics.basis.evaluate`."""
    if made.spherical:
        height, stretch, scale = z, 1.0, np.sqrt(1 / (4 * np.pi))
    else:
        z = min(max(z, 0.0), 1.0)
        height, stretch, scale = 2 * z - 1, 2 * np.sqrt(z / (1 + z)), np.sqrt(1 / (2 * np.pi))
    real, imaginary = scale, 0.0
    for m in range(made.order + 1):
        if m:
            grow = stretch * np.sqrt((2 * m + 1) / (2 * m))
            real, imaginary = grow * (real * x - imaginary * y), grow * (real * y + imaginary * x)
        before, now = 0.0, 1.0
        for degree in range(m, made.order + 1):
            if degree > m:
                a, b = made.first[degree, m], made.second[degree, m]
                before, now = now, a * (height * now - b * before)
            middle = degree * degree + degree
            if m == 0:
                out[middle] = np.float32(real * now)
            else:
                out[middle + m] = np.float32(np.sqrt(2.0) * real * now)
                out[middle - m] = np.float32(np.sqrt(2.0) * imaginary * now)


@njit(inline="always", error_model="numpy")
def _texel_into(made, node, share, i, at, part, out):  # type: ignore[no-untyped-def]
    """Weights (rank,) between four views and four texels."""
    size, rank = made.height * made.across, made.rank
    v0, v1, v2, v3 = node[i, 0] * size, node[i, 1] * size, node[i, 2] * size, node[i, 3] * size
    a0, a1, a2, a3 = share[i, 0], share[i, 1], share[i, 2], share[i, 3]
    t0, t1, t2, t3 = at
    b0, b1, b2, b3 = part
    blend(
        made.weights,
        (
            (v0 + t0) * rank, (v0 + t1) * rank, (v0 + t2) * rank, (v0 + t3) * rank,
            (v1 + t0) * rank, (v1 + t1) * rank, (v1 + t2) * rank, (v1 + t3) * rank,
            (v2 + t0) * rank, (v2 + t1) * rank, (v2 + t2) * rank, (v2 + t3) * rank,
            (v3 + t0) * rank, (v3 + t1) * rank, (v3 + t2) * rank, (v3 + t3) * rank,
        ),
        (
            a0 * b0, a0 * b1, a0 * b2, a0 * b3, a1 * b0, a1 * b1, a1 * b2, a1 * b3,
            a2 * b0, a2 * b1, a2 * b2, a2 * b3, a3 * b0, a3 * b1, a3 * b2, a3 * b3,
        ),
        out, 0, rank,
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _contract(made, weights, out, begin):  # type: ignore[no-untyped-def]
    """Coefficients (3·terms,) over the light: components times weights, plus the mean."""
    width, rows, w = 3 * made.terms, made.components, weights
    blend(rows, (made.rank * width,), (_ONE,), out, begin, width)
    for k in range(0, made.rank, LANES):  # so many rows at once, to touch the sum less often
        at = k * width
        blend_more(
            rows,
            (
                at, at + width, at + 2 * width, at + 3 * width, at + 4 * width, at + 5 * width,
                at + 6 * width, at + 7 * width,
            ),
            (w[k], w[k + 1], w[k + 2], w[k + 3], w[k + 4], w[k + 5], w[k + 6], w[k + 7]),
            out, begin, width,
        )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _add_environment(made, around, frame, n, coefficients, begin, work, sums, i):  # type: ignore[no-untyped-def]
    terms = made.terms
    for q in range(len(around.points)):
        px, py, pz = around.points[q, 0], around.points[q, 1], around.points[q, 2]
        x = frame[n, 0, 0] * px + frame[n, 0, 1] * py + frame[n, 0, 2] * pz
        y = frame[n, 1, 0] * px + frame[n, 1, 1] * py + frame[n, 1, 2] * pz
        z = frame[n, 2, 0] * px + frame[n, 2, 1] * py + frame[n, 2, 2] * pz
        length = np.sqrt(x * x + y * y + z * z)
        if not made.spherical and not z > 0:
            continue
        basis_into(x / length, y / length, z / length, made, work)
        for colour in range(3):
            value = dot(work, 0, coefficients, begin + colour * terms, terms)
            sums[i, colour] += np.float32(value * around.light[q, colour])


@njit(cache=True, nogil=True, error_model="numpy")
def harmonic_slice(surfels, task, begin, end, eye, lights, visible, made, around, out):  # type: ignore[no-untyped-def]
    """Write the radiance of the task's rows begin … end; see `factor_slice`.

    around : the `Environment`, which adds to `lights`.
    """
    rank, terms = made.rank, made.terms
    views, lamps = scratch(made.views.slots), scratch(1)
    weights, work = np.zeros(max(rank, 1), np.float32), np.zeros(terms, np.float32)
    coefficients = np.zeros(BLOCK * 3 * terms, np.float32)
    found, sums = np.zeros((3, BLOCK), np.float32), np.empty((BLOCK, 3), np.float32)
    horizon = made.horizon
    least = np.sqrt(_ONE - min(horizon, _ONE) ** 2)
    for start in range(begin, end, BLOCK):
        count = min(BLOCK, end - start)
        find_views(made.views, surfels, task, eye, start, count, views)
        sums[:] = _ZERO
        for i in range(count):
            n = task.numbers[task.rows[start + i]]
            at, part = corners(
                surfels.source[n, 0], surfels.source[n, 1], made.height, made.across, made.tiles
            )
            _texel_into(made, views.node, views.share, i, at, part, weights)
            _contract(made, weights, coefficients, i * 3 * terms)
            _add_environment(
                made, around, surfels.frame, n, coefficients, i * 3 * terms, work, sums, i
            )
        for light in range(len(lights[0])):
            lamps_into(surfels, task, lights[0][light], start, count, lamps)
            unit_in_place(lamps, False)
            for i in range(count):
                x, y, z = lamps.x[i], lamps.y[i], lamps.z[i]
                lamps.gain[i] = min(max(z, _ZERO) / horizon, _ONE)
                if not z > _ZERO:
                    continue
                if z < horizon:
                    stretch = least / max(np.sqrt(x * x + y * y), np.float32(1e-30))
                    x, y, z = x * stretch, y * stretch, horizon
                basis_into(np.float64(x), np.float64(y), np.float64(z), made, work)
                for colour in range(3):
                    value = dot(work, 0, coefficients, (i * 3 + colour) * terms, terms)
                    found[colour, i] = max(value, _ZERO)
            add_light(found, lamps.gain, lights[1][light], visible, light, task, start, count, sums)
        store(sums, task, start, count, out)
