"""Distance of points to a triangle mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from btfcore.errors import InvalidMesh
from btfcore.types import F8, I8, Mesh


def distance_to_mesh(points: ArrayLike, mesh: Mesh, *, sample: int | None = None) -> F8:
    """Distance from each point to the nearest point of the mesh's surface, in world units.

    points : (P, 3); sample : measure only this many of them, taken at even spacing in the
    given order (None: all). Returns (P,) f8, or (sample,) f8 where that is fewer. Distances
    are computed about the mesh's middle in units of its diagonal, so that far origins and
    extreme scales do not spoil them. Raises `InvalidMesh` where a coordinate is not finite or
    the mesh has no face.
    """
    import igl  # the library is large and only some stages measure distances

    where = np.ascontiguousarray(points, np.float64).reshape(-1, 3)
    if sample is not None and sample < len(where):
        where = where[np.linspace(0, len(where) - 1, sample).astype(np.int64)]
    if len(mesh.faces) == 0:
        raise InvalidMesh("distance to a mesh of 0 faces")
    if not (np.isfinite(where).all() and np.isfinite(mesh.vertices).all()):
        raise InvalidMesh("distance between points that are not finite")
    if len(where) == 0:
        return np.zeros(0)
    middle = (mesh.vertices.max(axis=0) + mesh.vertices.min(axis=0)) / 2
    unit = mesh.diagonal or 1.0
    squared, _, _ = igl.point_mesh_squared_distance(
        (where - middle) / unit,
        np.ascontiguousarray((mesh.vertices - middle) / unit),
        np.ascontiguousarray(mesh.faces, np.int64),
    )
    distance: F8 = np.sqrt(np.maximum(np.atleast_1d(squared), 0)) * unit
    return distance


def nearest_face(points: F8, corners: F8) -> I8:
    """Find the triangle of `corners` (F, 3, 3) nearest to each of `points` (P, 3): (P,)."""
    import igl

    if len(points) == 0:
        return np.zeros(0, np.int64)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    unit = float(np.linalg.norm(high - low)) or 1.0
    _, nearest, _ = igl.point_mesh_squared_distance(
        (points - low) / unit,
        np.ascontiguousarray((corners.reshape(-1, 3) - low) / unit),
        np.arange(3 * len(corners), dtype=np.int64).reshape(-1, 3),
    )
    found: I8 = np.atleast_1d(nearest).astype(np.int64)
    return found
