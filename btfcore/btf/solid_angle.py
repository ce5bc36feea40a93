"""Solid angles of directions: the Voronoi cells that they cut the hemisphere into."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.types import F8

_CORNERS = 64  # of a cell that the kernel starts with room for


def solid_angles(directions: F8) -> F8:
    """Area (n,) f8, in steradians, of the hemisphere z ≥ 0 that is nearest to each direction.

    directions (n, 3) f8: distinct unit vectors. The areas add up to 2π.
    """
    return np.asarray(_cells(np.ascontiguousarray(directions, np.float64)))


@njit(cache=True)
def _cells(directions):  # type: ignore[no-untyped-def]
    """Clip the hemisphere by the bisector to every other direction, and sum up what is left.

    One quarter after the other: clipped whole, it would get edges of half a circle, whose
    ends do not tell which way round they run.
    """
    count = len(directions)
    areas = np.zeros(count)
    corner, kept = np.empty((_CORNERS, 3)), np.empty((_CORNERS, 3))
    side = np.empty(_CORNERS)
    for me in range(count):
        for quarter in range(4):
            corner[:3] = 0.0
            corner[0, 2] = 1.0
            corner[1, quarter % 2] = 1.0 if quarter < 2 else -1.0
            corner[2, (quarter + 1) % 2] = 1.0 if quarter in (0, 3) else -1.0
            corners = 3
            for other in range(count):
                if other == me or corners == 0:
                    continue
                plane = directions[me] - directions[other]
                outside = False
                if corners + 2 > len(kept):
                    corner, kept = _grown(corner), _grown(kept)
                    side = np.empty(len(kept))
                for k in range(corners):
                    side[k] = (corner[k] * plane).sum()
                    outside = outside or side[k] < 0.0
                if not outside:
                    continue
                found = 0
                for k in range(corners):
                    after = (k + 1) % corners
                    if side[k] >= 0.0:
                        kept[found] = corner[k]
                        found += 1
                    if (side[k] >= 0.0) != (side[after] >= 0.0):
                        # on the great circle through both ends, where it meets the bisector
                        point = corner[after] * side[k] - corner[k] * side[after]
                        if side[k] < 0.0:
                            point = -point
                        kept[found] = point / max(np.sqrt((point * point).sum()), 1e-300)
                        found += 1
                corner, kept = kept, corner
                corners = found
            for k in range(1, corners - 1):
                areas[me] += abs(_triangle(corner[0], corner[k], corner[k + 1]))
    return areas


@njit(cache=True)
def _grown(rows):  # type: ignore[no-untyped-def]
    larger = np.empty((2 * len(rows), 3))
    larger[: len(rows)] = rows
    return larger


@njit(cache=True)
def _triangle(a, b, c):  # type: ignore[no-untyped-def]
    """Signed solid angle of a spherical triangle (van Oosterom and Strackee 1983)."""
    over = (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
    under = 1.0 + (a * b).sum() + (b * c).sum() + (c * a).sum()
    return 2.0 * np.arctan2(over, under)
