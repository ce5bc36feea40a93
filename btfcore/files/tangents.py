"""Tangent frames for normal maps, by MikkTSpace's rules of direction, weight and sign."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from btfcore.progress import Progress, silent
from btfcore.types import F4, F8, I4


def vertex_tangents(
    positions: F8, normals: F8, uv: F4, faces: I4, *, progress: Progress = silent
) -> F4:
    """Average the texture's u directions at each vertex: (n, 4) f4, unit tangent and sign.

    positions (n, 3), normals (n, 3) unit, uv (n, 2) with v running *down* the image, faces
    (m, 3) i4. A tangent is ∂position/∂u of the faces around, each projected to the tangent
    plane, normalised and weighted by its corner's angle; w = +1 where (tangent, image up,
    normal) is right-handed, so that bitangent = w · normal × tangent points up the image.
    Where no face has a texture area the tangent is an arbitrary unit vector across the normal.
    """
    points = positions - positions.mean(axis=0)
    points = points / max(float(np.abs(points).max()), np.finfo(float).tiny)
    corner, flat = points[faces], uv.astype(np.float64)[faces]
    one, two = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    (u1, v1), (u2, v2) = (flat[:, 1] - flat[:, 0]).T, (flat[:, 2] - flat[:, 0]).T
    area = u1 * v2 - u2 * v1
    side = np.sign(area)
    along = (one * v2[:, None] - two * v1[:, None]) * side[:, None]
    total = np.zeros((len(positions), 3))
    sign = np.zeros(len(positions))
    for k in range(3):
        progress(0.1 + 0.3 * k, "normals and tangents")
        vertex = faces[:, k]
        ahead = corner[:, (k + 1) % 3] - corner[:, k]
        behind = corner[:, (k + 2) % 3] - corner[:, k]
        angle = np.arctan2(
            np.linalg.norm(np.cross(ahead, behind), axis=1), (ahead * behind).sum(axis=1)
        )
        angle[area == 0] = 0.0
        tangent = _unit(_across(along, normals[vertex])) * angle[:, None]
        for axis in range(3):
            total[:, axis] += np.bincount(vertex, tangent[:, axis], len(positions))
        sign -= np.bincount(vertex, side * angle, len(positions))
    tangents = _unit(_across(total, normals))
    lost = np.linalg.norm(tangents, axis=1) < 0.5
    tangents[lost] = _any_across(normals[lost])
    return np.column_stack([tangents, np.where(sign >= 0, 1.0, -1.0)]).astype(np.float32)


def _across(vectors: F8, normals: F8) -> F8:
    """`vectors` less their part along the unit `normals`."""
    part: F8 = vectors - (vectors * normals).sum(axis=1, keepdims=True) * normals
    return part


def _unit(vectors: F8) -> F8:
    """Normalise rows; rows too short to have a direction become zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    sound = length > 1e-20
    return np.where(sound, vectors / np.where(sound, length, 1.0), 0.0)


def _any_across(normals: NDArray[np.float64]) -> F8:
    """Choose some unit vector orthogonal to each unit normal."""
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    return _unit(np.cross(axis, normals))
