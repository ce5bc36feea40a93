"""Delaunay triangulation of directions in the stereographic chart, with a table to find triangles.

The chart (x, y) / (1 + z) maps the hemisphere to the unit disk; circles stay circles, so that
the planar Delaunay triangles are those of the sphere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError

from btfcore.btf.interpolation.cocircular import settled_ties
from btfcore.errors import InvalidParameter
from btfcore.types import F8, I4, Frozen

FLAT = 1e-4  # width over length below which points count as lying on one line
_SLIVER = 1e-12  # area over the squared extent below which a triangle is rounding only
_FINEST = 96


@dataclass(frozen=True, eq=False)
class Triangulation(Frozen):
    """Triangles over directions in the chart, and the border of their union.

    triangles (T, 3) i4 directions; affine (T, 6) f8: chart point of corner 2, and how the
    barycentric coordinates of corners 0 and 1 grow from there along u and v.
    edges (E, 2) i4 directions along the border, or along the line where all lie on one (T = 0
    then); segment (E, 5) f8: start, offset, 1 / squared length.
    A cell of the side x side table over `low` … `low` + side / scale lists the triangles
    `candidates[first[cell]:first[cell + 1]]` that may meet it.
    """

    triangles: I4
    affine: F8
    edges: I4
    segment: F8
    low: F8
    scale: float
    side: int
    first: I4
    candidates: I4


def chart(directions: NDArray[Any]) -> F8:
    """Stereographic coordinates (n, 2) f8 of vectors (n, 3) of any length."""
    vectors = np.asarray(directions, np.float64)
    length = np.sqrt((vectors**2).sum(axis=1))
    return vectors[:, :2] / (length + vectors[:, 2])[:, None]


def triangulate(directions: F8, nodes: I4) -> Triangulation:
    """Triangulate `directions[nodes]`, all different; raises `InvalidParameter` if that fails."""
    points = chart(directions[nodes])
    line = _line(points)
    if line is None:
        triangles = _delaunay(points)
        edges = _border(triangles)
    else:
        points, edges = line
        triangles = np.empty((0, 3), np.int64)
    corner = points[triangles]
    low, size = points.min(axis=0) - 1e-6, float(np.ptp(points, axis=0).max()) + 2e-6
    side = int(np.clip(np.ceil(np.sqrt(2 * len(triangles))), 1, _FINEST))
    first, candidates = _table(corner, low, side / size, side)
    offset = points[edges[:, 1]] - points[edges[:, 0]]
    squared = (offset**2).sum(axis=1)
    inverse = np.divide(1.0, squared, out=np.zeros_like(squared), where=squared > 0)
    return Triangulation(
        triangles=nodes[triangles].astype(np.int32),
        affine=_affine(corner),
        edges=nodes[edges].astype(np.int32),
        segment=np.column_stack([points[edges[:, 0]], offset, inverse]),
        low=low,
        scale=side / size,
        side=side,
        first=first,
        candidates=candidates,
    )


def _line(points: F8) -> tuple[F8, NDArray[np.int64]] | None:
    """Points moved onto one line, and edges (E, 2) along it; None where they fill a plane.

    A lone point has one edge of length 0.
    """
    if len(points) == 1:
        return points, np.zeros((1, 2), np.int64)
    middle = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - middle)
    if len(points) > 2 and spread[1] >= FLAT * spread[0]:
        return None
    place = (points - middle) @ axes[0]
    order = np.argsort(place, kind="stable")
    return middle + place[:, None] * axes[0], np.stack([order[:-1], order[1:]], axis=1)


def _delaunay(points: F8) -> NDArray[np.int64]:
    """Triangles (T, 3), counter-clockwise, that name every point."""
    # Qhull lifts points to a paraboloid, which drowns those far from the origin in rounding
    points = (points - points.mean(axis=0)) / np.ptp(points, axis=0).max()
    try:
        found = Delaunay(points).simplices.astype(np.int64)
    except QhullError as error:
        raise InvalidParameter(
            f"{len(points)} directions have no triangulation: {str(error).splitlines()[0]}"
        ) from error
    area = _doubled_area(points[found])
    found[area < 0] = found[area < 0][:, ::-1]
    found = found[np.abs(area) > _SLIVER]
    left_out = len(points) - len(np.unique(found))
    if left_out:
        raise InvalidParameter(
            f"{left_out} of {len(points)} directions lie so close to others or to a line that they"
            " cannot be triangulated"
        )
    return settled_ties(points, found)


def _border(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Edges (E, 2) of one triangle only."""
    edges = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, place, count = np.unique(
        np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True
    )
    return edges[place[count == 1]]


def _doubled_area(corner: F8) -> F8:
    one, two = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    return one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]


def _affine(corner: F8) -> F8:
    """Corner 2, and the slopes of the barycentric coordinates of corners 0 and 1 from there."""
    one, two = corner[:, 0] - corner[:, 2], corner[:, 1] - corner[:, 2]
    area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    slopes = np.stack([two[:, 1], -two[:, 0], -one[:, 1], one[:, 0]], axis=1)
    return np.concatenate([corner[:, 2], slopes / area[:, None]], axis=1)


def _table(corner: F8, low: F8, scale: float, side: int) -> tuple[I4, I4]:
    """Triangles by cell (side², CSR): those whose bounding box meets the cell."""
    lists: list[list[int]] = [[] for _ in range(side * side)]
    begin = np.clip((corner.min(axis=1) - low) * scale - 1e-6, 0, side - 1).astype(int)
    end = np.clip((corner.max(axis=1) - low) * scale + 1e-6, 0, side - 1).astype(int)
    for triangle in range(len(corner)):
        for row in range(begin[triangle, 1], end[triangle, 1] + 1):
            for column in range(begin[triangle, 0], end[triangle, 0] + 1):
                lists[row * side + column].append(triangle)
    sizes = [len(entry) for entry in lists]
    first = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32)
    return first, np.array([one for entry in lists for one in entry], np.int32)
