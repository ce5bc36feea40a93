"""Directions carried over the surface to where there is none yet, and blended there."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.progress import Progress, blocks, silent
from btfcore.types import F8, I4


@njit(cache=True)
def _add_carried(total: F8, weight: float, vector: F8, start: F8, stop: F8) -> None:
    """Add `vector`, carried from normal `start` to normal `stop`, unless they are opposed."""
    lean, onto = 1.0, 0.0
    for axis in range(3):
        lean += start[axis] * stop[axis]
        onto += stop[axis] * vector[axis]
    if lean > 0.05:
        for axis in range(3):
            total[axis] += weight * (vector[axis] - onto / lean * (start[axis] + stop[axis]))


@njit(cache=True)
def _finish(total: F8, normal: F8) -> bool:
    """Make `total` tangential and unit, in place; False where it has no direction."""
    onto, size = 0.0, 0.0
    for axis in range(3):
        onto += total[axis] * normal[axis]
        size += total[axis] * total[axis]
    length = 0.0
    for axis in range(3):
        total[axis] -= onto * normal[axis]
        length += total[axis] * total[axis]
    if not length > 1e-12 * size:
        return False
    for axis in range(3):
        total[axis] /= np.sqrt(length)
    return True


def blended(
    of: I4, indptr: I4, indices: I4, centres: F8, middle: F8, area: F8, tangents: F8,
    vertices: F8, normals: F8, reach: F8, *, progress: Progress = silent,
) -> F8:  # fmt: skip
    """Blend the clusters' tangents at the vertices, (N, 3) f8 unit.

    of (N,): own cluster; indptr, indices: touching clusters; centres, middle, area, tangents:
    place, normal, size and tangent of each. A cluster counts by its area and by how near its
    centre is, up to `reach` (C,).
    """
    out = np.empty((len(of), 3))
    for begin, end in blocks(len(of), 1 << 19, progress, "orientation field"):
        _blend(
            of, indptr, indices, centres, middle, area, tangents, vertices, normals, reach,
            begin, end, out,
        )  # fmt: skip
    return out


@njit(cache=True)
def _blend(  # type: ignore[no-untyped-def]
    of, indptr, indices, centres, middle, area, tangents, vertices, normals, reach, begin, end, out
):
    total = np.empty(3)
    for vertex in range(begin, end):
        own = of[vertex]
        total[:] = 0.0
        for slot in range(indptr[own] - 1, indptr[own + 1]):
            other = own if slot < indptr[own] else indices[slot]
            gap = 0.0
            for axis in range(3):
                gap += ((vertices[vertex, axis] - centres[other, axis]) / reach[own]) ** 2
            near = max(1.0 - gap, 1e-4)
            weight = area[other] * near * near
            _add_carried(total, weight, tangents[other], middle[other], normals[vertex])
        if not _finish(total, normals[vertex]):
            total[:] = 0.0
            _add_carried(total, 1.0, tangents[own], middle[own], normals[vertex])
            if not _finish(total, normals[vertex]):
                _any_tangent(total, normals[vertex])
        out[vertex] = total


@njit(cache=True)
def _any_tangent(total: F8, normal: F8) -> None:
    """Make `total` some unit tangent, the same for the same normal."""
    least = 0
    for axis in range(1, 3):
        if abs(normal[axis]) < abs(normal[least]):
            least = axis
    total[:] = 0.0
    total[least] = 1.0
    _finish(total, normal)


@njit(cache=True)
def filled(indptr: I4, indices: I4, normals: F8, tangents: F8) -> F8:
    """Give vertices without a direction (0) the mean of their neighbours', ring by ring.

    The filled part is then smoothed. Components that have no direction at all stay 0.
    """
    out = tangents.copy()
    count = len(out)
    known = np.empty(count, np.bool_)
    for vertex in range(count):
        known[vertex] = (out[vertex] != 0.0).any()
    order = np.empty(count, np.int32)  # of filling
    ring = [vertex for vertex in range(count) if not known[vertex]]
    filled = 0
    total = np.empty(3)
    while len(ring) > 0:
        start = filled
        rest = [vertex for vertex in ring[:0]]
        for vertex in ring:
            if _mean(total, vertex, indptr, indices, normals, out, known):
                out[vertex] = total
                order[filled] = vertex
                filled += 1
            else:
                rest.append(vertex)
        if filled == start:
            break
        for index in range(start, filled):
            known[order[index]] = True
        ring = rest
    for _ in range(20):
        for index in range(filled):
            vertex = order[index]
            if _mean(total, vertex, indptr, indices, normals, out, known):
                out[vertex] = total
    return out


@njit(cache=True)
def _mean(total, vertex, indptr, indices, normals, tangents, known):  # type: ignore[no-untyped-def]
    """Mean direction of the known neighbours, into `total`; False where there is none."""
    total[:] = 0.0
    any_known = False
    for slot in range(indptr[vertex], indptr[vertex + 1]):
        other = indices[slot]
        if known[other]:
            any_known = True
            _add_carried(total, 1.0, tangents[other], normals[other], normals[vertex])
    if not any_known:
        return False
    if not _finish(total, normals[vertex]):
        _any_tangent(total, normals[vertex])
    return True
