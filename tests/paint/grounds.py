"""Surfaces that the tests of strokes and areas stand on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from btfcore.paint.locate import Locator
from btfcore.patch.connectivity import Connectivity, connect
from btfcore.pipeline import load_mesh, prepare
from btfcore.types import DenseMesh, Field, Mesh
from tests.surfaces import constant_field, dense_mesh, grid_faces, plane, sphere

MESHES = Path(__file__).resolve().parents[2] / "resources" / "meshes"


@dataclass(frozen=True, eq=False)
class Ground:
    """A dense mesh with all that a test asks of it; `mesh` is the shape that it stands for."""

    dense: DenseMesh
    field: Field
    net: Connectivity
    mesh: Mesh

    @property
    def step(self) -> float:
        return self.dense.step

    def locator(self) -> Locator:
        return Locator(self.dense)


def ground(dense: DenseMesh, mesh: Mesh | None = None, field: Field | None = None) -> Ground:
    """Ground on a dense mesh; without `mesh` each of its triangles is one of the shape's."""
    field = constant_field(dense) if field is None else field
    own = Mesh(dense.vertices.copy(), dense.faces.copy()) if mesh is None else mesh
    return Ground(dense, field, connect(dense, field), own)


@cache
def flat(rows: int = 81, columns: int = 101) -> Ground:
    """Plane with texels of edge 1: x in 0 … columns-1, y in -(rows-1) … 0, facing +z."""
    return ground(plane(rows, columns))


@cache
def ball(level: int = 5) -> Ground:
    """Unit sphere."""
    return ground(sphere(level))


@cache
def walls(gap: float = 1.5, size: int = 41) -> Ground:
    """Two planes `gap` apart, the upper facing +z, the lower facing -z; not connected."""
    row, column = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    upper = np.stack([column, -row, 0 * row], axis=-1).reshape(-1, 3).astype(float)
    lower = upper - [0, 0, gap]
    faces = grid_faces(size, size)
    return ground(
        dense_mesh(
            np.concatenate([upper, lower]), np.concatenate([faces, faces[:, ::-1] + size * size])
        )
    )


@cache
def cow(rate: int = 128) -> Ground:
    """A real mesh with charts and zippers."""
    mesh, _ = load_mesh(MESHES / "spot.obj")
    prepared = prepare(mesh, rate=rate)
    return ground(prepared.dense, mesh, prepared.field)


@cache
def halves(rows: int = 61, columns: int = 81) -> Ground:
    """Plane whose shape has regions "left" (x ≤ 40: faces 0 and 1) and "right" (2 and 3)."""
    dense = plane(rows, columns)
    middle, wide, low = 40.5, columns - 1.0, 1.0 - rows
    corners = [(0, 0), (middle, 0), (wide, 0), (0, low), (middle, low), (wide, low)]
    faces = np.array([[0, 3, 1], [1, 3, 4], [1, 4, 2], [2, 4, 5]], np.int32)
    mesh = Mesh(
        np.array([(x, y, 0.0) for x, y in corners]), faces,
        np.array([0, 0, 1, 1], np.int32), ("left", "right"),
    )  # fmt: skip
    x, y = dense.vertices[:, 0], dense.vertices[:, 1]
    left = x < middle
    within = np.where(left, x / middle, (x - middle) / (wide - middle))
    face = np.where(left, 0, 2) + (within + y / low > 1)
    return ground(replace(dense, face=face.astype(np.int32)), mesh)
