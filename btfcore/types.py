"""Frozen values that flow between the stages; their arrays are read-only.

Conventions: image row 0 is on top, texel centres lie at integer (column, row).
A local frame is s = +column, t = -row, n = outward normal, right-handed; so a triangle
wound counter-clockwise seen from outside has a *negative* determinant in (column, row).
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]
F4 = NDArray[np.float32]
C8 = NDArray[np.complex64]
I8 = NDArray[np.int64]
I4 = NDArray[np.int32]
U2 = NDArray[np.uint16]


class Frozen:
    """Mixin: makes every array field of a frozen dataclass read-only."""

    def __post_init__(self) -> None:
        """Lock the arrays."""
        for item in fields(self):  # type: ignore[arg-type]
            value = getattr(self, item.name)
            if isinstance(value, np.ndarray):
                value.flags.writeable = False


@dataclass(frozen=True, eq=False)
class Mesh(Frozen):
    """Triangle mesh: vertices (V, 3) f8 in world units, faces (F, 3) i4, coherent winding.

    region (F,) i4 indexes region_names; None where the mesh is one region.
    """

    vertices: F8
    faces: I4
    region: I4 | None = None
    region_names: tuple[str, ...] = ()

    @property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal, the unit of every distance we report."""
        return float(np.linalg.norm(self.vertices.max(axis=0) - self.vertices.min(axis=0)))


@dataclass(frozen=True, eq=False)
class Atlas(Frozen):
    """Charts of a mesh laid out in a `size` x `size` image (Zhou §III-A).

    uv : (F, 3, 2) f8, (column, row) of every face corner in texels; charts are not mirrored.
    chart : (F,) i4, chart of every face, 0 … charts-1.
    """

    mesh: Mesh
    uv: F8
    chart: I4
    size: int


@dataclass(frozen=True, eq=False)
class DenseMesh(Frozen):
    """The multi-chart geometry image as a watertight mesh: one vertex per covered texel.

    vertices (N, 3) f8; normals (N, 3) f4 unit; faces (G, 3) i4, the first `grid_faces` of
    them inside charts, the rest zippered; texel (N, 2) i4 (row, column); chart (N,) i4;
    face (N,) i4 and bary (N, 3) f4: where on the input mesh the vertex lies; size: side of
    the atlas image in texels.
    """

    vertices: F8
    normals: F4
    faces: I4
    texel: I4
    chart: I4
    face: I4
    bary: F4
    size: int
    grid_faces: int

    @property
    def step(self) -> float:
        """Dense-mesh step √(area / vertices) in world units."""
        corner = self.vertices[self.faces]
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        return float(np.sqrt(np.linalg.norm(normal, axis=1).sum() / 2 / len(self.vertices)))


@dataclass(frozen=True, eq=False)
class Field(Frozen):
    """Orientation field on a dense mesh: tangents (N, 3) f4, unit, orthogonal to the normals.

    singularities : (S, 3) f8 positions on the surface where the field turns around.
    """

    tangents: F4
    singularities: F8


@dataclass(frozen=True, eq=False)
class Prepared:
    """A mesh ready to be decorated: its atlas, dense mesh and orientation field."""

    mesh: Mesh
    atlas: Atlas
    dense: DenseMesh
    field: Field


@dataclass(frozen=True, eq=False)
class Sample(Frozen):
    """A texture sample: colour (H, W, 3) f4, sRGB-coded 0–1, and what it is matched by.

    channels : (H, W, K) f4, coordinates in which Euclidean distance is the sample's own
    distance (for an image: its sRGB colours; for a BTF: weighted factors).
    tiles : the sample's opposite borders fit each other.
    mask : (H, W) f4 in 0–1, the feature S_f (an imperfection; Zhou §IV-A), or None.
    """

    name: str
    colour: F4
    channels: F4
    tiles: bool = False
    mask: F4 | None = None


@dataclass(frozen=True, eq=False)
class Quilt(Frozen):
    """What is stored per dense vertex (the quilting map); never colours.

    source (N, 2) f4 (column, row) in the sample; angle (N,) f4 radians, from the field's
    tangent to the sample's +column axis, counter-clockwise about the normal; sample (N,) u2;
    patch (N,) i4, -1 where bare.
    """

    source: F4
    angle: F4
    sample: U2
    patch: I4


@dataclass(frozen=True)
class MeshStatistics:
    """Counts of a mesh: Euler number, boundary and non-manifold edges, loops, components."""

    vertices: int
    faces: int
    boundary_edges: int
    boundary_loops: int
    nonmanifold_edges: int
    euler: int
    components: int


@dataclass(frozen=True)
class ImportReport:
    """What reading a mesh found and mended: `notes` are sentences fit for a user."""

    path: str
    statistics: MeshStatistics
    notes: tuple[str, ...] = field(default=())
