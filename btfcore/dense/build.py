"""The watertight dense mesh: one vertex per covered texel (Zhou §III-A, MCGIM)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

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
from btfcore.progress import Progress, between, blocks, silent
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
    face, bary = rasterise(
        atlas.uv, pieces.piece, pieces.count, atlas.size, progress=between(progress, 0.15, 0.18)
    )
    progress(0.18, "sampling the surface")
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
    covered = np.flatnonzero(face >= 0)
    where = face.reshape(-1)[covered]
    progress(0.95, "dense mesh")
    dense = _finish(atlas, zipped, component, where, bary.reshape(-1, 3)[covered], progress)
    progress(1.0, "dense mesh")
    return dense


def _zip(
    atlas: Atlas, pieces: Pieces, component: I4, target: Counts, face: I4, bary: F8,
    mesh_normals: F8, progress: Progress,
) -> _Zipped:  # fmt: skip
    """Build the faces over the texels that `face` covers."""
    covered = np.flatnonzero(face >= 0)
    where = face.reshape(-1)[covered]
    progress(0.0, "sampling the surface")
    weight = bary.reshape(-1, 3)[covered]
    progress(0.05, "sampling the surface")
    points, normals = np.empty((len(where), 3)), np.empty((len(where), 3))
    for begin, end in blocks(len(where), 1 << 19, progress, "sampling the surface", 0.1, 0.2):
        _sample(
            atlas.mesh.vertices, mesh_normals, atlas.mesh.faces, where, weight, begin, end,
            points, normals,
        )  # fmt: skip
    progress(0.2, "joining texels")
    grid = build_grid(atlas.uv, pieces, face, points, progress=between(progress, 0.2, 0.3))
    progress(0.3, "joining texels")
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
    component = component[where]
    border = np.zeros(len(points), bool)
    border[walks.vertex] = True
    count = len(target.faces)
    reached, wrong = dense_counts(
        faces, border, component, count, progress=between(progress, 0.9, 1.0)
    )
    wrong[not_simple] = True
    lost = (reached.euler != target.euler) | (reached.loops != target.loops) | (reached.faces == 0)
    lost[np.unique(component[wrong])] = False  # these are known more exactly
    return _Zipped(grid, points, normals, faces, wrong, lost)


def _finish(
    atlas: Atlas, zipped: _Zipped, component: I4, where: I4, weight: F8, progress: Progress
) -> DenseMesh:
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
    for begin, end in blocks(len(faces), 1 << 20, progress, "dense mesh", 0.95, 0.97):
        used[faces[begin:end]] = True
    points, normals, texel = zipped.points, zipped.normals, zipped.grid.texel
    if not used.all():
        number = (np.cumsum(used) - 1).astype(np.int32)
        faces = number[faces]
        progress(0.98, "dense mesh")
        points, normals, texel = points[used], normals[used], texel[used]
        where, weight = where[used], weight[used]
    progress(0.99, "dense mesh")
    return DenseMesh(
        points, normals.astype(np.float32), faces, texel, atlas.chart[where], where,
        weight.astype(np.float32), atlas.size, inside,
    )  # fmt: skip


@njit(cache=True)
def _sample(
    vertices: F8, normals: F8, faces: I4, where: I4, weight: F8, begin: int, end: int,
    point: F8, normal: F8,
) -> None:  # fmt: skip
    """Place and unit normal at barycentric `weight` (N, 3) of the faces `where` (N,)."""
    for here in range(begin, end):
        a, b, c = faces[where[here], 0], faces[where[here], 1], faces[where[here], 2]
        u, v, w = weight[here, 0], weight[here, 1], weight[here, 2]
        for axis in range(3):
            point[here, axis] = (
                u * vertices[a, axis] + v * vertices[b, axis] + w * vertices[c, axis]
            )
            normal[here, axis] = u * normals[a, axis] + v * normals[b, axis] + w * normals[c, axis]
        length = np.sqrt(normal[here, 0] ** 2 + normal[here, 1] ** 2 + normal[here, 2] ** 2)
        for axis in range(3):
            normal[here, axis] = normal[here, axis] / length if length > 1e-6 else normals[a, axis]
