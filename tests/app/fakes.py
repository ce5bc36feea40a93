"""A torus whose atlas is one rectangle, made by formula: a surface to draw without an atlas."""

import numpy as np

from btfcore.types import Atlas, DenseMesh, Field, Mesh, Quilt
from tests.surfaces import blobs, grid_faces


def _torus(v, u):
    ring = 1.0 + 0.42 * np.cos(v)
    points = np.stack([ring * np.cos(u), 0.42 * np.sin(v), -ring * np.sin(u)], axis=-1)
    normals = np.stack([np.cos(v) * np.cos(u), np.sin(v), -np.cos(v) * np.sin(u)], axis=-1)
    tangents = np.stack([-np.sin(u), 0 * u, -np.cos(u)], axis=-1)
    return tuple(each.reshape(-1, 3) for each in (points, normals, tangents))


def torus(size=96, coarse=24):
    """(mesh, atlas, dense, field): `coarse` cells a side, `size` texels a side, wrapped."""
    grid = np.meshgrid(np.arange(coarse), np.arange(coarse), indexing="ij")
    points, _, _ = _torus(*(-2 * np.pi * grid[0] / coarse, 2 * np.pi * grid[1] / coarse))
    row, column = (g.ravel() for g in grid)
    corner = [(0, 0), (1, 0), (0, 1), (0, 1), (1, 0), (1, 1)]
    faces = np.stack(
        [(row + r) % coarse * coarse + (column + c) % coarse for r, c in corner], axis=-1
    ).reshape(-1, 3)
    uv = np.stack([np.stack([column + c, row + r], axis=-1) for r, c in corner], axis=1)
    uv = uv.reshape(-1, 3, 2) * ((size - 1) / coarse)
    mesh = Mesh(points, faces.astype(np.int32))
    atlas = Atlas(mesh, uv, np.zeros(len(faces), np.int32), size)
    angle = 2 * np.pi * np.arange(size) / size
    v, u = np.meshgrid(-angle, angle, indexing="ij")
    vertices, normals, tangents = _torus(v, u)
    texel = np.stack(np.divmod(np.arange(size * size), size), axis=-1).astype(np.int32)
    dense = DenseMesh(
        vertices, normals.astype(np.float32), grid_faces(size, size, wrap=False), texel,
        np.zeros(size * size, np.int32), np.zeros(size * size, np.int32),
        np.zeros((size * size, 3), np.float32), size, 2 * (size - 1) ** 2,
    )  # fmt: skip
    return mesh, atlas, dense, Field(tangents.astype(np.float32), np.zeros((1, 3)) + [1.42, 0, 0])


def quilt(dense, sample, cells=4):
    """Squares of the sample laid side by side."""
    height, width = sample.colour.shape[:2]
    row, column = dense.texel.T
    source = np.stack([column % (width - 1), row % (height - 1)], axis=-1).astype(np.float32)
    side = dense.size // cells
    patch = (row // side * cells + column // side).astype(np.int32)
    count = len(dense.vertices)
    return Quilt(source, np.zeros(count, np.float32), np.zeros(count, np.uint16), patch)


__all__ = ["blobs", "quilt", "torus"]
