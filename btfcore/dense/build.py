"""The watertight dense mesh: one vertex per covered texel (Zhou §III-A, MCGIM)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from btfcore.dense.check import Counts, Flags, dense_counts, input_counts
from btfcore.dense.corners import place_corners
from btfcore.dense.cut import Pieces, cut_into_disks, label_parts
from btfcore.dense.flips import flip_seams
from btfcore.dense.grid import TexelGrid, build_grid
from btfcore.dense.grow import grow
from btfcore.dense.rasterise import rasterise
from btfcore.dense.rim import boundary, mend_rim
from btfcore.dense.salvage import manifold_part
from btfcore.dense.walk import outer_walks
from btfcore.dense.zipper import without_points, zip_seams
from btfcore.errors import InvalidParameter
from btfcore.mesh.topology import vertex_normals
from btfcore.progress import Progress, between, silent
from btfcore.types import F8, I4, Atlas, DenseMesh, Frozen

_ATTEMPTS = 5  # each after giving more texels to the pieces in trouble


@dataclass(frozen=True, eq=False)
class _Zipped(Frozen):
    """One attempt: its texels, vertices and faces, and where it is not as it should be."""

    grid: TexelGrid
    points: F8
    normals: F8
    faces: I4
    wrong: Flags
    lost: Flags


def build_dense_mesh(atlas: Atlas, *, progress: Progress = silent) -> DenseMesh:
    """Sample the surface at the atlas's texels and zip its charts together.

    The mesh of `atlas` must be manifold and coherently wound. The result has one vertex per
    covered texel, exactly on the input surface, and no other; it is manifold, and each of its
    components has the input's Euler number and boundary loops, hence is closed where the
    input is. A component for which the atlas has too few texels to be so (4 for a sphere, 7
    for a torus) takes free ones beside its charts; where these do not suffice either it stays
    an open patch or is left out, which `btfcore.dense.diagnostics` tells.

    Raises `InvalidParameter` where a chart finds no texel or not a single triangle fits, and
    whatever `progress` raises.
    """
    progress(0.0, "cutting charts")
    pieces = cut_into_disks(atlas)
    component, count = label_parts(pieces.twin)
    target = input_counts(atlas.mesh.faces, pieces.twin, component, len(atlas.mesh.vertices))
    progress(0.15, "sampling the surface")
    face, bary = rasterise(atlas.uv, pieces.piece, pieces.count, atlas.size)
    normals = vertex_normals(atlas.mesh.vertices, atlas.mesh.faces)
    for attempt in range(_ATTEMPTS):
        zipped = _zip(
            atlas, pieces, component, target, face, bary, normals,
            between(progress, 0.2 + 0.15 * attempt, 0.35 + 0.15 * attempt),
        )  # fmt: skip
        if not (zipped.wrong.any() or zipped.lost.any()) or attempt == _ATTEMPTS - 1:
            break
        wanted = np.zeros(pieces.count, bool)
        wanted[zipped.grid.piece[zipped.wrong]] = True
        wanted[pieces.piece[zipped.lost[component]]] = True
        face, bary = grow(atlas.uv, pieces.piece, wanted, face, bary)
    covered = face >= 0
    dense = _finish(atlas, zipped, component, face[covered], bary[covered])
    progress(1.0, "dense mesh")
    return dense


def _zip(
    atlas: Atlas, pieces: Pieces, component: I4, target: Counts, face: I4, bary: F8,
    mesh_normals: F8, progress: Progress,
) -> _Zipped:  # fmt: skip
    """Build the faces over the texels that `face` covers."""
    covered = face >= 0
    where, weight = face[covered], bary[covered]
    corner = atlas.mesh.faces[where]
    points = _blend(atlas.mesh.vertices, corner, weight)
    normals = _blend(mesh_normals, corner, weight)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(
        length > 1e-6, normals / np.maximum(length, 1e-6), mesh_normals[corner[:, 0]]
    )
    progress(0.2, "joining texels")
    grid = build_grid(atlas.uv, pieces, face, points)
    walks = outer_walks(grid, pieces.count, points)
    progress(0.4, "zipping charts")
    corners = place_corners(atlas.uv, pieces, walks, grid.texel)
    faces, twin, cross = zip_seams(points, walks, corners, pieces.count)
    rim = boundary(pieces, walks, corners, cross)
    faces, twin, gone, not_simple = mend_rim(rim, faces, twin, grid.texel, grid.edges, points)
    faces, twin = without_points(faces, twin, gone)
    progress(0.7, "flipping edges")
    faces, twin = flip_seams(faces, twin, grid, points, normals)
    faces = np.concatenate([grid.faces, faces])
    progress(0.9, "checking the mesh")
    border = np.zeros(len(points), bool)
    border[walks.vertex] = True
    count = len(target.faces)
    reached, wrong = dense_counts(faces, border, component[where], count)
    wrong[not_simple] = True
    lost = (reached.euler != target.euler) | (reached.loops != target.loops) | (reached.faces == 0)
    lost[np.unique(component[where][wrong])] = False  # these are known more exactly
    return _Zipped(grid, points, normals, faces, wrong, lost)


def _finish(atlas: Atlas, zipped: _Zipped, component: I4, where: I4, weight: F8) -> DenseMesh:
    """Leave out what makes no surface and the vertices that no face uses."""
    faces, inside = zipped.faces, len(zipped.grid.faces)
    if zipped.wrong.any():
        ill = np.zeros(int(component.max()) + 1, bool)
        ill[component[where][zipped.wrong]] = True
        mine = np.flatnonzero(ill[component[where]][faces[:, 0]])
        keep = np.ones(len(faces), bool)
        keep[mine] = False
        keep[mine[manifold_part(faces[mine])]] = True
        inside = int(keep[:inside].sum())
        faces = faces[keep]
    if len(faces) == 0:
        raise InvalidParameter(
            f"no triangle fits an atlas of {atlas.size} x {atlas.size} texels: raise the rate"
        )
    used = np.zeros(len(where), bool)
    used[faces] = True
    number = (np.cumsum(used) - 1).astype(np.int32)
    return DenseMesh(
        zipped.points[used],
        zipped.normals[used].astype(np.float32),
        number[faces],
        zipped.grid.texel[used],
        atlas.chart[where[used]],
        where[used],
        weight[used].astype(np.float32),
        atlas.size,
        inside,
    )


def _blend(values: F8, corner: I4, weight: F8) -> NDArray[np.float64]:
    """Barycentric mean of per-vertex values (V, 3) at `corner` (N, 3)."""
    out = values[corner[:, 0]] * weight[:, :1]
    out += values[corner[:, 1]] * weight[:, 1:2]
    out += values[corner[:, 2]] * weight[:, 2:]
    return out
