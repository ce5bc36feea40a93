"""Charts of a mesh before they have a place: which faces, and how they lie flat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.types import F8, I4, Frozen, Mesh


@dataclass(frozen=True, eq=False)
class Charts(Frozen):
    """Charts of `mesh`, flattened to true size; no sampling rate is involved yet.

    uv : (F, 3, 2) f8, (column, row) of every face corner in world lengths, each chart at an
    arbitrary place; not mirrored. chart : (F,) i4, 0 … count-1, every number is used.
    """

    mesh: Mesh
    uv: F8
    chart: I4

    @property
    def count(self) -> int:
        """Number of charts."""
        return int(self.chart.max()) + 1


def signed_areas(uv: F8) -> F8:
    """Area of every face of uv (F, 3, 2), positive where it is not mirrored (rows go down)."""
    one, two = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return (one[:, 1] * two[:, 0] - one[:, 0] * two[:, 1]) / 2


def surface_areas(mesh: Mesh) -> F8:
    """Area of every face, (F,) f8 in square world units."""
    corner = mesh.vertices[mesh.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return np.linalg.norm(normal, axis=1) / 2


def true_to_size(mesh: Mesh, uv: F8, chart: I4) -> F8:
    """Scale every chart to its surface area and turn over the mirrored ones."""
    count = int(chart.max()) + 1
    area = signed_areas(uv)
    balance = np.bincount(chart, area, count)
    flat = np.bincount(chart, np.abs(area), count)
    surface = np.bincount(chart, surface_areas(mesh), count)
    scale = np.sqrt(surface / np.maximum(flat, np.finfo(float).tiny))
    factor = np.stack([np.where(balance < 0, -scale, scale), scale], axis=1)
    return uv * factor[chart][:, None, :]
