"""Surfaces made ready for files: one vertex per position, normal and texture coordinate.

Corners of the mesh that meet around a vertex stay one vertex as long as no crease and no
chart border runs between them, so a cube keeps its flat look and charts their own borders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from btfcore.errors import InvalidParameter
from btfcore.files.tangents import vertex_tangents
from btfcore.mesh.topology import fans, twins, vertex_normals
from btfcore.progress import Progress, between, silent
from btfcore.render.gutter import texel_frames
from btfcore.types import F4, F8, I4, Atlas, DenseMesh, Frozen, Mesh

_FARTHEST = 1.5  # texels that a zippered triangle may reach out of its chart, half a gutter
_LABEL = "normals and tangents"
_TOGETHER = 2  # texels between corners on the same side of a seam


@dataclass(frozen=True, eq=False)
class ExportSurface(Frozen):
    """A textured surface with shared corners.

    positions (n, 3) f8 in world units; normals (n, 3) f4 unit; tangents (n, 4) f4, unit
    ∂position/∂u orthogonal to the normal, and the bitangent's sign; uv (n, 2) f4 with (0, 0)
    at the image's upper left corner; faces (m, 3) i4; origin (n,) i4: vertex of the mesh that
    was split here; closed: no edge is a boundary.
    """

    positions: F8
    normals: F4
    tangents: F4
    uv: F4
    faces: I4
    origin: I4
    closed: bool


def export_input(
    mesh: Mesh, atlas: Atlas, *, crease_deg: float = 60.0, progress: Progress = silent
) -> ExportSurface:
    """Take the input mesh's own shape with the atlas as texture coordinates.

    Normals are smooth (weighted by angle) except across edges whose faces turn by more than
    `crease_deg`. Raises `InvalidParameter` where the atlas belongs to another mesh.
    """
    if atlas.uv.shape != (len(mesh.faces), 3, 2):
        raise InvalidParameter(
            f"the atlas has {len(atlas.uv)} faces, the mesh to be written {len(mesh.faces)}"
        )
    twin = twins(mesh.faces)
    closed = bool((twin >= 0).all())
    progress(0.1, _LABEL)
    smooth = _cut(twin, _creases(mesh, twin, crease_deg))
    label, count = fans(smooth)
    progress(0.3, _LABEL)
    points = mesh.vertices[mesh.faces.reshape(-1)[_first(label, count)]]
    normals = vertex_normals(points, label.reshape(-1, 3))
    return _assemble(
        mesh.vertices, mesh.faces, atlas.uv, atlas.size, smooth, label, normals, closed, progress
    )


def export_dense(dense: DenseMesh, *, progress: Progress = silent) -> ExportSurface:
    """Take the dense mesh itself; zippered triangles reach from one chart into the gutter.

    A zippered triangle is textured on that side of the seam where most of its corners lie;
    the others get the coordinates where their position lies when the parameterisation is
    continued from there, and there the gutter shows the surface across the seam.
    """
    twin = twins(dense.faces)
    closed = bool((twin >= 0).all())
    progress(0.1, _LABEL)
    uv = dense.texel[dense.faces][..., ::-1].astype(np.float64)
    progress(0.2, _LABEL)
    torn = np.ptp(dense.chart[dense.faces], axis=1) > 0
    torn |= np.ptp(uv, axis=1).max(axis=1) > _TOGETHER  # a chart may border on itself
    progress(0.3, _LABEL)
    uv[torn] = _continued(dense, dense.faces[torn], uv[torn])
    label = dense.faces.reshape(-1)
    return _assemble(
        dense.vertices, dense.faces, uv, dense.size, twin, label, dense.normals, closed, progress
    )


def _creases(mesh: Mesh, twin: I4, crease_deg: float) -> NDArray[np.bool_]:
    """Half-edges across which the surface turns by more than `crease_deg`: (3F,) bool."""
    points = mesh.vertices - mesh.vertices.mean(axis=0)
    corner = (points / max(float(np.abs(points).max()), np.finfo(float).tiny))[mesh.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal /= np.where(length > 0, length, 1)
    one = np.arange(len(twin)) // 3
    turn = (normal[one] * normal[twin // 3]).sum(axis=1)
    flat = (length[one, 0] > 0) & (length[twin // 3, 0] > 0)
    return flat & (turn < np.cos(np.radians(crease_deg)))


def _cut(twin: I4, where: NDArray[np.bool_]) -> I4:
    """Pairing of half-edges with those in `where` (symmetric) parted."""
    return np.where(where, -1, twin).astype(np.int32)


def _first(label: I4, count: int) -> NDArray[np.int64]:
    """First corner of every label 0 … count-1, as (count,) indices."""
    first = np.zeros(count, np.int64)
    first[label[::-1]] = np.arange(len(label))[::-1]
    return first


def _assemble(
    vertices: F8,
    faces: I4,
    uv: F8,
    size: int,
    twin: I4,
    label: I4,
    normals: NDArray[np.floating],
    closed: bool,
    progress: Progress,
) -> ExportSurface:
    """Join corners over `twin` where their texture coordinates agree.

    uv (F, 3, 2) in texels; label (3F,): row of `normals` at every corner.
    """
    if not np.isfinite(uv).all():
        raise InvalidParameter(f"{int((~np.isfinite(uv)).any(axis=2).sum())} corners without uv")
    progress(0.4, _LABEL)
    flat = ((uv.reshape(-1, 2) + 0.5) / size).astype(np.float32)
    after = np.arange(len(twin)) + np.tile([1, 1, -2], len(faces))  # the corner where h ends
    differs = (flat != flat[after[twin]]).any(axis=1) | (flat[after] != flat[twin]).any(axis=1)
    progress(0.5, _LABEL)
    corner, count = fans(_cut(twin, differs))
    progress(0.6, _LABEL)
    first = _first(corner, count)
    origin = faces.reshape(-1)[first]
    split = corner.reshape(-1, 3)
    unit = normals[label[first]].astype(np.float64)
    length = np.linalg.norm(unit, axis=1, keepdims=True)
    unit = np.where(length > 0.5, unit / np.where(length > 0.5, length, 1), [0.0, 0.0, 1.0])
    positions = np.asarray(vertices, np.float64)[origin]
    tangents = vertex_tangents(
        positions, unit, flat[first], split, progress=between(progress, 0.7, 1.0)
    )
    return ExportSurface(
        positions, unit.astype(np.float32), tangents, flat[first], split, origin, closed
    )


def _continued(dense: DenseMesh, faces: I4, uv: F8) -> F8:
    """Texture coordinates of zippered `faces` (m, 3) on one side of the seam: (m, 3, 2)."""
    chart = dense.chart[faces]
    apart = np.abs(uv[:, :, None] - uv[:, None]).max(axis=3)
    together = (apart <= _TOGETHER) & (chart[:, :, None] == chart[:, None])
    home = np.where(together[:, 1, 2], 1, 0)  # two corners outvote one
    inside = together[np.arange(len(faces)), home]
    rim, place = np.unique(faces, return_inverse=True)
    frames = texel_frames(dense, rim)
    square = np.einsum("nki,nkj->nij", frames, frames)
    determinant = np.linalg.det(square)
    good = determinant > 1e-6 * np.einsum("nii->n", square) ** 2
    inverse = np.zeros((len(rim), 2, 3))
    inverse[good] = np.linalg.solve(square[good], frames[good].transpose(0, 2, 1))
    place = place.reshape(faces.shape)
    points = dense.vertices[faces]
    out = uv.copy()
    for corner in range(3):
        total = np.zeros((len(faces), 2))
        for base in range(3):
            move = np.einsum(
                "mij,mj->mi", inverse[place[:, base]], points[:, corner] - points[:, base]
            )
            far = np.linalg.norm(move, axis=1, keepdims=True)
            move *= np.minimum(1.0, _FARTHEST / np.maximum(far, 1e-12))
            total += np.where(inside[:, base, None], uv[:, base] + move, 0.0)
        mean = total / inside.sum(axis=1, keepdims=True)
        out[:, corner] = np.where(inside[:, corner, None], uv[:, corner], mean)
    return out
