"""Where rays meet a triangle mesh first: face, place in it and distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from btfcore.errors import InvalidParameter
from btfcore.mesh.rays import RayTree, inverse, stack_size
from btfcore.types import F8, I4, Frozen

_EDGE = 1e-9  # of a triangle, by which it is enlarged, so that rays do not slip between two


@dataclass(frozen=True, eq=False)
class Crossings(Frozen):
    """First crossing of each of n rays with a mesh.

    face (n,) i4: the triangle, -1 where the ray meets none; bary (n, 3) f8: weights of its
    corners, each in 0–1, zeros where none; distance (n,) f8: from the ray's origin, in lengths
    of its direction, inf where none.
    """

    face: I4
    bary: F8
    distance: F8

    def __len__(self) -> int:
        """Return how many rays there were."""
        return len(self.face)


def first_crossings(
    tree: RayTree, origins: ArrayLike, directions: ArrayLike, *, nearest: ArrayLike = 0.0
) -> Crossings:
    """Nearest crossing of each half-line with the triangles of `tree`.

    origins (n, 3) or (3,) for all rays, directions (n, 3) of any length; nearest (n,) or a
    number: crossings no farther than this do not count, in lengths of the direction. Both
    sides of a triangle count, its rim too; a triangle in whose plane a ray lies does not. Where
    several are equally far, as at an edge that they share, it is the one with the lowest
    number. Rays that are not finite meet nothing. Raises `InvalidParameter` where the numbers
    of origins, directions and distances differ.

    Children are visited near one first (Möller and Trumbore 1997 for the triangles; Wald 2007
    for the tree).
    """
    along = np.ascontiguousarray(directions, np.float64).reshape(-1, 3)
    start = np.asarray(origins, np.float64)
    least = np.asarray(nearest, np.float64)
    if start.shape not in ((3,), along.shape) or least.shape not in ((), along.shape[:1]):
        raise InvalidParameter(
            f"rays of {len(along)} directions with origins of shape {start.shape}"
            f" and least distances of shape {least.shape}"
        )
    start = np.ascontiguousarray(np.broadcast_to(start, along.shape))
    least = np.ascontiguousarray(np.broadcast_to(least, along.shape[:1]))
    face = np.full(len(along), -1, np.int32)
    bary, distance = np.zeros(along.shape), np.full(len(along), np.inf)
    if len(tree.box):
        _first_crossings(
            tree.box, tree.child, tree.count, tree.triangle, tree.face, start, along, least,
            np.empty(stack_size(), np.int64), np.empty(stack_size()), face, bary, distance,
        )  # fmt: skip
    return Crossings(face, bary, distance)


@njit(cache=True, nogil=True)
def _first_crossings(  # type: ignore[no-untyped-def]
    box, child, count, triangle, number, origins, directions, nearest, stack, entered, face, bary,
    distance,
):  # fmt: skip
    """Walk the tree for each ray; `stack` and `entered` are scratch."""
    for n in range(len(origins)):
        ox, oy, oz = origins[n, 0], origins[n, 1], origins[n, 2]
        dx, dy, dz = directions[n, 0], directions[n, 1], directions[n, 2]
        if not np.isfinite(ox + oy + oz + dx + dy + dz):
            continue
        ix, iy, iz = inverse(dx), inverse(dy), inverse(dz)
        least, best, found = nearest[n], np.inf, -1
        enter, leave = _span(box, 0, ox, oy, oz, ix, iy, iz)
        top = 0
        if leave >= max(enter, 0.0):
            stack[0], entered[0], top = 0, enter, 1
        while top > 0:
            top -= 1
            node = stack[top]
            if entered[top] > best:
                continue
            here = child[node]
            if count[node] > 0:
                for t in range(here, here + count[node]):
                    away, u, v = _crossing(triangle, t, ox, oy, oz, dx, dy, dz)
                    if not away > least or away > best:
                        continue
                    if away < best or number[t] < found:
                        best, found = away, number[t]
                        _weigh(bary, n, u, v)
                continue
            near, far = here, here + 1
            enter, leave = _span(box, near, ox, oy, oz, ix, iy, iz)
            enter_far, leave_far = _span(box, far, ox, oy, oz, ix, iy, iz)
            if enter_far < enter:
                near, far = far, near
                enter, leave, enter_far, leave_far = enter_far, leave_far, enter, leave
            if leave_far >= max(enter_far, 0.0) and enter_far <= best:
                stack[top], entered[top] = far, enter_far
                top += 1
            if leave >= max(enter, 0.0) and enter <= best:
                stack[top], entered[top] = near, enter
                top += 1
        face[n] = found
        distance[n] = best


@njit(cache=True, nogil=True)
def _span(box, b, ox, oy, oz, ix, iy, iz):  # type: ignore[no-untyped-def]
    """Where a ray enters and leaves a box; outside it, the latter is the smaller."""
    x0, x1 = (box[b, 0] - ox) * ix, (box[b, 3] - ox) * ix
    y0, y1 = (box[b, 1] - oy) * iy, (box[b, 4] - oy) * iy
    z0, z1 = (box[b, 2] - oz) * iz, (box[b, 5] - oz) * iz
    enter = max(max(min(x0, x1), min(y0, y1)), min(z0, z1))
    leave = min(min(max(x0, x1), max(y0, y1)), max(z0, z1))
    return enter, leave


@njit(cache=True, nogil=True)
def _crossing(triangle, t, ox, oy, oz, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Distance, and weights of the second and third corner; a distance of -1 is none."""
    ax, ay, az = triangle[t, 3], triangle[t, 4], triangle[t, 5]
    bx, by, bz = triangle[t, 6], triangle[t, 7], triangle[t, 8]
    px, py, pz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
    volume = ax * px + ay * py + az * pz
    if volume == 0.0:
        return -1.0, 0.0, 0.0
    inverse = 1.0 / volume
    tx, ty, tz = ox - triangle[t, 0], oy - triangle[t, 1], oz - triangle[t, 2]
    u = (tx * px + ty * py + tz * pz) * inverse
    if not -_EDGE <= u <= 1.0 + _EDGE:
        return -1.0, 0.0, 0.0
    qx, qy, qz = ty * az - tz * ay, tz * ax - tx * az, tx * ay - ty * ax
    v = (dx * qx + dy * qy + dz * qz) * inverse
    if not (v >= -_EDGE and u + v <= 1.0 + _EDGE):
        return -1.0, 0.0, 0.0
    return (bx * qx + by * qy + bz * qz) * inverse, u, v


@njit(cache=True, nogil=True)
def _weigh(bary, n, u, v):  # type: ignore[no-untyped-def]
    """Write weights into row `n`, moved into the triangle where they lie on its enlarged rim."""
    u, v = max(u, 0.0), max(v, 0.0)
    if u + v > 1.0:
        total = u + v
        u, v = u / total, v / total
    bary[n, 0] = max(1.0 - u - v, 0.0)
    bary[n, 1], bary[n, 2] = u, v
