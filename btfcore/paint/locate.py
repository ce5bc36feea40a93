"""From points in space to places on the dense mesh."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from btfcore.errors import InvalidEdit
from btfcore.patch.connectivity import faces_at_vertices
from btfcore.types import F8, I4, DenseMesh, Frozen

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

TOLERANCE = 0.05  # of the bounding box's diagonal
FLAT = 1e-24  # squared sine of the angle of a triangle that counts as a line
NEIGHBOURS = 8  # vertices around which the nearest triangle is sought


@dataclass(frozen=True, eq=False)
class Feet(Frozen):
    """Places on the dense mesh nearest to n points.

    vertex (n,) i4: nearest corner of the triangle, -1 where no place was found; face (n,) i4:
    the triangle; corner (n, 3) i4: its vertices; bary (n, 3) f8 in it; position (n, 3) f8 in
    world units; distance (n,) f8 of the point from it in world units, inf where no place was
    found; start (n, 3) f8: distances of the corners in steps, from which a geodesic march may
    start. Where the place lies on the border of an open mesh they are measured from the point
    itself, in the triangle's plane: beyond (n,) f8 is how far it lies outside, in steps.
    """

    vertex: I4
    face: I4
    corner: I4
    bary: F8
    position: F8
    distance: F8
    start: F8
    beyond: F8

    def __len__(self) -> int:
        """Return how many points were asked for."""
        return len(self.vertex)


class Locator:
    """Finds points on one dense mesh; its search tree is built when first asked."""

    def __init__(self, dense: DenseMesh, *, tolerance: float = TOLERANCE) -> None:
        """Prepare for `dense`; `tolerance` is a share of its bounding box's diagonal."""
        self.dense = dense
        # corners (3,) of the bounding box, in world units
        self.low, self.high = dense.vertices.min(axis=0), dense.vertices.max(axis=0)
        self.tolerance = tolerance * float(np.linalg.norm(self.high - self.low))
        """How far from the surface a point may lie, in world units."""

    @cached_property
    def step(self) -> float:
        """Dense-mesh step in world units."""
        return self.dense.step or 1.0

    @cached_property
    def _tree(self) -> cKDTree:
        from scipy.spatial import cKDTree

        return cKDTree(self.dense.vertices)

    @cached_property
    def _stars(self) -> tuple[I4, I4]:
        pointer, face_of = faces_at_vertices(
            np.ascontiguousarray(self.dense.faces, np.int32), len(self.dense.vertices)
        )
        return pointer, face_of

    def nearest(self, points: F8, normals: F8 | None = None) -> Feet:
        """Return the places nearest to `points` (n, 3), however far they are.

        normals (n, 3): only vertices whose normal is within 90° of it count; a normal of
        zeros asks for no side. With normals, places beyond the tolerance may stay unfound.
        """
        points = np.ascontiguousarray(points, np.float64).reshape(-1, 3)
        sides = np.zeros_like(points) if normals is None else np.array(normals, np.float64)
        sides = np.ascontiguousarray(sides.reshape(-1, 3))
        count = len(points)
        vertex, face = np.full(count, -1, np.int32), np.full(count, -1, np.int32)
        corner = np.zeros((count, 3), np.int32)
        bary, start, position = np.zeros((count, 3)), np.zeros((count, 3)), points.copy()
        distance, beyond = np.full(count, np.inf), np.zeros(count)
        asked, near = np.arange(count), min(NEIGHBOURS, len(self.dense.vertices))
        while len(asked):
            away, found = self._tree.query(points[asked], near)
            away = np.reshape(away, (-1, near))  # of one neighbour they come flat
            found = np.reshape(found, (-1, near))
            _feet(
                points, sides, asked, found, self.dense.vertices, self.dense.normals,
                self.dense.faces, *self._stars, self.step, vertex, face, corner, bary, position,
                distance, start, beyond,
            )  # fmt: skip
            if near == len(self.dense.vertices):
                break
            # none of the nearest looks that way: ask for more, as far as one may reach
            asked = asked[(vertex[asked] < 0) & (away[:, -1] <= self.tolerance)]
            near = min(near * NEIGHBOURS, len(self.dense.vertices))
        return Feet(vertex, face, corner, bary, position, distance, start, beyond)

    def find(self, point: F8, normal: F8 | None = None, *, what: str = "the point") -> Feet:
        """Return the one place nearest to `point` (3,), on the side of `normal` if given.

        Raises `InvalidEdit` with the distance and the point where it is beyond the tolerance.
        """
        point = np.asarray(point, np.float64).reshape(3)
        if not np.isfinite(point).all():
            raise InvalidEdit(f"{what} at {_shown(point)} is not finite")
        feet = self.nearest(point, normal)
        if feet.distance[0] <= self.tolerance:
            return feet
        if math.isinf(feet.distance[0]):
            raise InvalidEdit(
                f"{what} at {_shown(point)} has no surface that looks its way within"
                f" {self.tolerance:.3g}"
            )
        raise InvalidEdit(
            f"{what} at {_shown(point)} is {feet.distance[0]:.3g} away from the surface,"
            f" farther than {self.tolerance:.3g}"
        )


def _shown(point: F8) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in point) + ")"


@njit(cache=True)
def _feet(  # type: ignore[no-untyped-def]
    points, sides, asked, found, vertices, normals, faces, face_ptr, face_of, step,
    vertex, face_at, corner, bary, position, distance, start, beyond,
):  # fmt: skip
    """Search the stars of the vertices `found` (n, k) for the triangle nearest to each point."""
    weight = np.empty(3)
    for row in range(len(asked)):
        index = asked[row]
        point, side = points[index], sides[index]
        sided = side[0] != 0 or side[1] != 0 or side[2] != 0
        best, chosen = np.inf, -1
        for place in range(found.shape[1]):
            near = found[row, place]
            if sided and (
                side[0] * normals[near, 0] + side[1] * normals[near, 1] + side[2] * normals[near, 2]
                <= 0
            ):
                continue
            for slot in range(face_ptr[near], face_ptr[near + 1]):
                face = face_of[slot]
                a, b, c = faces[face]
                _closest(point, vertices[a], vertices[b], vertices[c], weight)
                away = 0.0
                for axis in range(3):
                    on = (
                        weight[0] * vertices[a, axis]
                        + weight[1] * vertices[b, axis]
                        + weight[2] * vertices[c, axis]
                    )
                    away += (on - point[axis]) ** 2
                if away < best or (away == best and face < chosen):
                    best, chosen = away, face
                    bary[index] = weight
        if chosen < 0:
            continue
        face_at[index] = chosen
        corner[index] = faces[chosen]
        distance[index] = np.sqrt(best)
        a, b, c = faces[chosen]
        for axis in range(3):
            position[index, axis] = (
                bary[index, 0] * vertices[a, axis]
                + bary[index, 1] * vertices[b, axis]
                + bary[index, 2] * vertices[c, axis]
            )
        flat = position[index].copy()
        if _on_border(bary[index], faces, chosen, face_ptr, face_of):
            _drop(point, vertices[a], vertices[b], vertices[c], flat)
            beyond[index] = np.sqrt(((flat - position[index]) ** 2).sum()) / step
        nearest = 0
        for which in range(3):
            length = 0.0
            for axis in range(3):
                length += (vertices[faces[chosen, which], axis] - flat[axis]) ** 2
            start[index, which] = np.sqrt(length) / step
            if start[index, which] < start[index, nearest]:
                nearest = which
        vertex[index] = faces[chosen, nearest]


@njit(cache=True)
def _on_border(weight, faces, face, face_ptr, face_of):  # type: ignore[no-untyped-def]
    """Whether a foot lies on the mesh's border: on such an edge, or at a vertex of one."""
    for which in range(3):
        if weight[which] > 0:
            continue
        one, two = faces[face, (which + 1) % 3], faces[face, (which + 2) % 3]
        if _faces_of_edge(one, two, faces, face_ptr, face_of) == 1:
            return True
    for which in range(3):
        vertex = faces[face, which]
        if weight[which] < 1:
            continue
        for slot in range(face_ptr[vertex], face_ptr[vertex + 1]):
            for corner in range(3):
                other = faces[face_of[slot], corner]
                if other != vertex and _faces_of_edge(vertex, other, faces, face_ptr, face_of) == 1:
                    return True
    return False


@njit(cache=True)
def _faces_of_edge(one, two, faces, face_ptr, face_of):  # type: ignore[no-untyped-def]
    """How many faces have the edge between two vertices."""
    count = 0
    for slot in range(face_ptr[one], face_ptr[one + 1]):
        face = face_of[slot]
        if faces[face, 0] == two or faces[face, 1] == two or faces[face, 2] == two:
            count += 1
    return count


@njit(cache=True)
def _drop(point, a, b, c, flat):  # type: ignore[no-untyped-def]
    """Drop `point` onto the plane of a triangle; into `flat`, left as it is without a plane."""
    normal = np.cross(b - a, c - a)
    size = normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2
    if size > 0:
        along = 0.0
        for axis in range(3):
            along += normal[axis] * (point[axis] - a[axis])
        for axis in range(3):
            flat[axis] = point[axis] - along / size * normal[axis]


@njit(cache=True)
def _closest(p, a, b, c, weight):  # type: ignore[no-untyped-def]
    """Barycentric `weight` of the triangle's point nearest to p, by Voronoi regions.

    Ericson 2005, "Real-Time Collision Detection", §5.1.5.
    """
    d1 = d2 = d3 = d4 = d5 = d6 = long = wide = 0.0
    for axis in range(3):
        ab, ac = b[axis] - a[axis], c[axis] - a[axis]
        d1 += ab * (p[axis] - a[axis])
        d2 += ac * (p[axis] - a[axis])
        d3 += ab * (p[axis] - b[axis])
        d4 += ac * (p[axis] - b[axis])
        d5 += ab * (p[axis] - c[axis])
        d6 += ac * (p[axis] - c[axis])
        long += ab * ab
        wide += ac * ac
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    total = va + vb + vc  # four times the squared area
    weight[:] = 0.0
    if total <= FLAT * long * wide:
        _closest_side(p, a, b, c, weight)
    elif d1 <= 0 and d2 <= 0:
        weight[0] = 1.0
    elif d3 >= 0 and d4 <= d3:
        weight[1] = 1.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        weight[1] = d1 / (d1 - d3)
        weight[0] = 1.0 - weight[1]
    elif d6 >= 0 and d5 <= d6:
        weight[2] = 1.0
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        weight[2] = d2 / (d2 - d6)
        weight[0] = 1.0 - weight[2]
    elif va <= 0 and d4 >= d3 and d5 >= d6:
        weight[2] = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        weight[1] = 1.0 - weight[2]
    else:
        weight[1], weight[2] = vb / total, vc / total
        weight[0] = 1.0 - weight[1] - weight[2]


@njit(cache=True)
def _closest_side(p, a, b, c, weight):  # type: ignore[no-untyped-def]
    """Barycentric `weight` of the point nearest to p on the sides of a triangle of no area."""
    best = np.inf
    corner = (a, b, c)
    for which in range(3):
        begin, end = corner[which], corner[(which + 1) % 3]
        along = length = away = 0.0
        for axis in range(3):
            side = end[axis] - begin[axis]
            along += side * (p[axis] - begin[axis])
            length += side * side
        share = min(max(along / length, 0.0), 1.0) if length > 0 else 0.0
        for axis in range(3):
            away += (begin[axis] + share * (end[axis] - begin[axis]) - p[axis]) ** 2
        if away < best:
            best = away
            weight[:] = 0.0
            weight[which], weight[(which + 1) % 3] = 1.0 - share, share
