"""The watertight dense mesh: one vertex per covered texel (Zhou §III-A, MCGIM)."""

from __future__ import annotations

import numpy as np

from btfcore.dense.corners import place_corners
from btfcore.dense.cut import cut_into_disks
from btfcore.dense.flips import flip_seams
from btfcore.dense.grid import build_grid
from btfcore.dense.rasterise import rasterise
from btfcore.dense.walk import outer_walks
from btfcore.dense.zipper import zip_seams
from btfcore.mesh.topology import vertex_normals
from btfcore.progress import Progress, silent
from btfcore.types import Atlas, DenseMesh


def build_dense_mesh(atlas: Atlas, *, progress: Progress = silent) -> DenseMesh:
    """Sample the surface at the atlas's texels and zip its charts together."""
    progress(0.0, "cutting charts")
    pieces = cut_into_disks(atlas)
    progress(0.2, "sampling the surface")
    face, bary = rasterise(atlas.uv, pieces.piece, pieces.count, atlas.size)
    covered = face >= 0
    where, weight = face[covered], bary[covered]
    corner = atlas.mesh.faces[where]
    points = _blend(atlas.mesh.vertices, corner, weight)
    normals = _blend(vertex_normals(atlas.mesh.vertices, atlas.mesh.faces), corner, weight)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(length > 0, length, 1)
    progress(0.4, "joining texels")
    grid = build_grid(atlas.uv, pieces, face, points)
    walks = outer_walks(grid, pieces.count)
    progress(0.6, "zipping charts")
    corners = place_corners(atlas.uv, pieces, walks, grid.texel)
    faces, twin = zip_seams(points, walks, corners, pieces.count)
    progress(0.8, "flipping edges")
    faces, twin, _ = flip_seams(faces, twin, grid, points, normals)
    progress(1.0, "dense mesh")
    return DenseMesh(
        points,
        normals.astype(np.float32),
        np.concatenate([grid.faces, faces]),
        grid.texel,
        atlas.chart[where],
        where,
        weight.astype(np.float32),
        atlas.size,
        len(grid.faces),
    )


def _blend(values, corner, weight):  # type: ignore[no-untyped-def]
    return np.einsum("nk,nkd->nd", weight, values[corner])
