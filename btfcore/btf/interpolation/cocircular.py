"""Delaunay triangles of points on one circle, chosen by number instead of by rounding.

Four directions of two rings lie on a circle, and so do all of the innermost ring: which diagonals
Qhull takes there hangs on the last bit, and would change when a table goes through a file.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from btfcore.types import F8

Triangles = NDArray[np.int64]
_TIE = 1e-4  # power of a point to a circle over the squared side: above single precision


def settled_ties(points: F8, triangles: Triangles) -> Triangles:
    """Triangles in which every polygon on a circle is a fan about its lowest number.

    points (n, 2); triangles (T, 3), counter-clockwise. What is no tie is left as it is, and so
    is a polygon whose fan would have a triangle without area.
    """
    one, two = _ties(points, triangles)
    if len(one) == 0:
        return triangles
    group = _joined(len(triangles), one, two)
    order = np.argsort(group, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(group[order])) + 1)
    return np.concatenate([_fan(points, triangles[part]) for part in parts])


def _ties(points: F8, triangles: Triangles) -> tuple[Triangles, Triangles]:
    """Pairs of triangles (two (E,)) side by side whose four corners lie on one circle."""
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(triangles)), 3)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    same = (edges[order][1:] == edges[order][:-1]).all(axis=1)
    one, two = owner[order[:-1][same]], owner[order[1:][same]]
    shared = edges[order[1:][same]]
    far = triangles[two].sum(axis=1) - shared.sum(axis=1)
    a, b, c = np.moveaxis(points[triangles[one]], 1, 0)
    d = points[far]
    lifted = [np.column_stack([p - d, ((p - d) ** 2).sum(axis=1)]) for p in (a, b, c)]
    volume = np.linalg.det(np.stack(lifted, axis=1))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    side = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    tied = np.abs(volume) < _TIE * area * side
    return one[tied], two[tied]


def _joined(count: int, one: Triangles, two: Triangles) -> Triangles:
    """Group (count,) of every triangle: the lowest number that ties lead to."""
    group = np.arange(count)
    while True:
        lowest = group.copy()
        np.minimum.at(lowest, one, group[two])
        np.minimum.at(lowest, two, group[one])
        if np.array_equal(lowest, group):
            return group
        group = lowest


def _fan(points: F8, part: Triangles) -> Triangles:
    """Cut the polygon of the triangles `part` from its lowest corner, where that is fair."""
    if len(part) == 1:
        return part
    edges = part[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    inner = {(int(b), int(a)) for a, b in edges}
    after = {int(a): int(b) for a, b in edges if (int(a), int(b)) not in inner}
    first = min(after)
    loop = [first]
    while after[loop[-1]] != first and len(loop) <= len(after):
        loop.append(after[loop[-1]])
    if len(loop) != len(part) + 2:
        return part
    fan = np.array([[first, b, c] for b, c in zip(loop[1:], loop[2:], strict=False)])
    return fan if _least_area(points[fan]) > 0.1 * _least_area(points[part]) else part


def _least_area(corner: F8) -> float:
    one, two = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    return float((one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).min())
