"""Errors of a dense mesh, a field and a quilt, measured on the results alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.connection import carried
from btfcore.mesh.topology import edges
from btfcore.types import DenseMesh, Field, Quilt


def mean_turn(dense: DenseMesh, field: Field) -> float:
    """Mean angle in degrees between the tangents at an edge's ends, carried along it."""
    pairs, _ = edges(dense.faces)
    normals = dense.normals.astype(np.float64)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    tail, head = pairs.T
    moved = carried(field.tangents[tail].astype(np.float64), normals[tail], normals[head])
    cosine = (moved * field.tangents[head]).sum(axis=1)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())


def uprightness(dense: DenseMesh, field: Field) -> float:
    """Mean cosine between the pictures' up and the projected +y, weighted by its length."""
    normals = dense.normals.astype(np.float64)
    over = np.cross(normals, field.tangents)
    wish = (0.0, 1.0, 0.0) - normals * normals[:, 1:2]
    return float((over * wish).sum() / max(np.linalg.norm(wish, axis=1).sum(), 1e-12))


@dataclass(frozen=True)
class Isometry:
    """Singular values of surface → sample inside patches, in texels per dense-mesh step.

    median, low and high: 50, 2.5 and 97.5 % quantiles over the scale asked for; within: share
    of triangles with both values within a factor 1.3; mirrored: share of mirrored triangles.
    """

    median: float
    low: float
    high: float
    within: float
    mirrored: float


def isometry(dense: DenseMesh, quilt: Quilt, *, scale: float = 1.0) -> Isometry:
    """Compare each triangle of one patch with its image in the sample."""
    faces = dense.faces[(quilt.patch[dense.faces] == quilt.patch[dense.faces[:, :1]]).all(axis=1)]
    corner, image = dense.vertices[faces] / dense.step, quilt.source[faces].astype(np.float64)
    one, two = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    normal = np.cross(one, two)
    double = np.linalg.norm(normal, axis=1)
    solid = double > 1e-3
    x = one / np.maximum(np.linalg.norm(one, axis=1), 1e-12)[:, None]
    y = np.cross(normal / np.maximum(double, 1e-12)[:, None], x)
    plane = np.stack([[(one * x).sum(1), (two * x).sum(1)], [(one * y).sum(1), (two * y).sum(1)]])
    plane = np.moveaxis(plane, 2, 0)[solid]
    there = np.stack([image[:, 1] - image[:, 0], image[:, 2] - image[:, 0]], axis=2)[solid]
    jacobian = there @ np.linalg.inv(plane) * scale
    values = np.linalg.svd(jacobian, compute_uv=False)
    low, median, high = np.quantile(values, [0.025, 0.5, 0.975])
    near = ((values > 1 / 1.3) & (values < 1.3)).all(axis=1)
    mirrored = np.linalg.det(jacobian) > 0  # rows go down, so that a sound one is negative
    return Isometry(
        float(median), float(low), float(high), float(near.mean()), float(mirrored.mean())
    )
