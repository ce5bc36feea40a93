"""What a quilt is made of, as colours per dense vertex: its seams, its charts, its field."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.patch.connectivity import adjacency
from btfcore.types import F4, DenseMesh, Field, Quilt

SEAM = np.array([1.0, 0.86, 0.0], np.float32)  # the yellow of the paper's figures
DARK = np.array([0.10, 0.17, 0.27], np.float32)  # streaks run from here …
PALE = np.array([0.93, 0.95, 0.90], np.float32)  # … to here
_GOLDEN = 0.61803398875
_REACH = 18  # steps of a streak, each one texel, ahead and behind
_TAIL = 0.25  # weight at a streak's far end behind, 1 ahead: it brightens along the field


def seam_colours(dense: DenseMesh, quilt: Quilt, colours: F4, *, width: int = 1) -> F4:
    """Take `colours` (N, 3), with seams of `width` dense-mesh steps on each side in yellow.

    A vertex lies on a seam where a neighbour belongs to another patch; borders of bare
    regions are no seams.
    """
    patch = quilt.patch
    edges = _edges(dense)
    a, b = edges[:, 0], edges[:, 1]
    on = np.zeros(len(patch), bool)
    apart = (patch[a] != patch[b]) & (patch[a] >= 0) & (patch[b] >= 0)
    on[edges[apart].ravel()] = True
    for _ in range(width - 1):
        near = edges[on[a] | on[b]]
        on[near.ravel()] = True
    out = colours.astype(np.float32)
    out[on] = SEAM
    return out


def chart_colours(dense: DenseMesh) -> F4:
    """One well distinguishable colour per chart, borders darker: (N, 3) f4 sRGB."""
    charts = np.arange(int(dense.chart.max()) + 1)
    hue = (0.56 + charts * _GOLDEN) % 1.0
    palette = _hsv(hue, 0.52 - 0.16 * (charts % 2), 0.93 - 0.10 * (charts // 2 % 3))
    colours = palette[dense.chart]
    edges = _edges(dense)
    border = edges[dense.chart[edges[:, 0]] != dense.chart[edges[:, 1]]]
    colours[np.unique(border)] *= np.float32(0.45)
    return colours


def field_colours(dense: DenseMesh, field: Field, *, seed: int = 0) -> F4:
    """Streaks along the field, brighter towards where it points: (N, 3) f4 sRGB.

    Line integral convolution (Cabral and Leedom 1993) of noise on the dense mesh: from every
    vertex a streamline is traced both ways over vertices, one step at a time, carrying its
    exact position; so streaks pass chart borders unhindered.
    """
    indptr, indices = adjacency(np.ascontiguousarray(dense.faces, np.int32), len(dense.vertices))
    noise = np.random.default_rng(seed).standard_normal(len(dense.vertices))
    noise = _blurred(noise, indptr, indices)
    points = np.ascontiguousarray(dense.vertices, np.float64)
    values = np.empty(len(points))
    _streaks(
        points, dense.normals, field.tangents, indptr, indices, noise, dense.step, _REACH, _TAIL,
        values,
    )  # fmt: skip
    order = np.argsort(values, kind="stable")  # ranks spread the contrast evenly
    rank = np.empty(len(values), np.float32)
    rank[order] = np.linspace(0.0, 1.0, len(values), dtype=np.float32)
    return DARK + (PALE - DARK) * rank[:, None]


def _edges(dense: DenseMesh) -> NDArray[np.int32]:
    """Edges of the dense mesh as (3G, 2), inner ones twice."""
    return dense.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def _blurred(noise: NDArray[np.float64], indptr, indices):  # type: ignore[no-untyped-def]
    """Mean of every vertex's noise and its neighbours'."""
    count = np.diff(indptr)
    owner = np.repeat(np.arange(len(noise)), count)
    return (noise + np.bincount(owner, noise[indices], len(noise))) / (count + 1)


def _hsv(hue: NDArray, saturation: NDArray, value: NDArray) -> F4:
    """Colours of hue, saturation and value in 0–1: (n, 3) f4."""
    ramp = np.abs((hue[:, None] * 6 + [0, 4, 2]) % 6 - 3) - 1
    pure = 1 - saturation[:, None] * (1 - np.clip(ramp, 0, 1))
    return (value[:, None] * pure).astype(np.float32)


@njit(cache=True)
def _streaks(  # type: ignore[no-untyped-def]
    points, normals, tangents, indptr, indices, noise, step, reach, tail, out
):
    for start in range(len(points)):
        total = noise[start]
        weights = 1.0
        for sense in (1.0, -1.0):
            here = start
            x, y, z = points[start, 0], points[start, 1], points[start, 2]
            for k in range(1, reach + 1):
                x += sense * step * tangents[here, 0]
                y += sense * step * tangents[here, 1]
                z += sense * step * tangents[here, 2]
                here = _nearest(points, indptr, indices, here, x, y, z)
                nx, ny, nz = normals[here, 0], normals[here, 1], normals[here, 2]
                off = (
                    (x - points[here, 0]) * nx
                    + (y - points[here, 1]) * ny
                    + (z - points[here, 2]) * nz
                )
                x, y, z = x - off * nx, y - off * ny, z - off * nz
                weight = 1.0 - k / (reach + 1.0) if sense > 0 else tail * (1 - k / (reach + 1.0))
                total += weight * noise[here]
                weights += weight
        out[start] = total / weights


@njit(cache=True)
def _nearest(points, indptr, indices, here, x, y, z):  # type: ignore[no-untyped-def]
    """Walk from vertex to vertex while the next one is nearer to (x, y, z)."""
    best = _squared(points, here, x, y, z)
    for _ in range(2):
        at = here
        for slot in range(indptr[at], indptr[at + 1]):
            distance = _squared(points, indices[slot], x, y, z)
            if distance < best:
                best = distance
                here = indices[slot]
        if here == at:
            break
    return here


@njit(cache=True)
def _squared(points, vertex, x, y, z):  # type: ignore[no-untyped-def]
    dx, dy, dz = points[vertex, 0] - x, points[vertex, 1] - y, points[vertex, 2] - z
    return dx * dx + dy * dy + dz * dz
