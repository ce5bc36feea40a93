"""Merging of vertices: by exact position, and along edges of no length."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.mesh.topology import find, join
from btfcore.types import F8, I4

_MIX = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9)


def weld(vertices: F8, faces: I4) -> tuple[F8, I4]:
    """Merge vertices at exactly one position and drop those that no face names.

    vertices (V, 3), finite where named; faces (F, 3) within 0 … V-1. -0.0 equals 0.0. The
    vertices that stay keep their order.
    """
    named = np.zeros(len(vertices), bool)
    named[faces] = True
    points = vertices[named] + 0.0  # turns -0.0 into 0.0
    compact = np.cumsum(named) - 1
    first, inverse = _distinct(points)
    return points[first], inverse[compact[faces]].astype(np.int32)


def collapse_short_edges(vertices: F8, faces: I4, length: float) -> tuple[I4, int]:
    """Rename the ends of every edge no longer than `length` to one vertex.

    Returns faces (F, 3), some now naming a vertex twice, and how many vertices vanished.
    """
    root = _collapse(vertices, faces, length)
    return root[faces], int((root != np.arange(len(root))).sum())


def _distinct(points: F8) -> tuple[I4, I4]:
    """First row of each distinct position, ascending, and the distinct row of every row."""
    bits = np.ascontiguousarray(points).view(np.uint64)
    key = np.zeros(len(points), np.uint64)
    for axis, factor in enumerate(_MIX):
        key ^= bits[:, axis] * np.uint64(factor)
        key ^= key >> np.uint64(29)
        key *= np.uint64(_MIX[0])
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    if not np.array_equal(points[first][inverse], points):  # two positions share a key
        _, first, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
    rank = np.empty(len(first), np.int32)
    order = np.argsort(first)
    rank[order] = np.arange(len(first))
    return first[order].astype(np.int32), rank[inverse.reshape(-1)]


@njit(cache=True)
def _collapse(vertices: F8, faces: I4, length: float) -> I4:
    parent = np.arange(len(vertices)).astype(np.int32)
    for face in range(len(faces)):
        for corner in range(3):
            one, other = faces[face, corner], faces[face, (corner + 1) % 3]
            squared = 0.0
            for axis in range(3):
                squared += (vertices[one, axis] - vertices[other, axis]) ** 2
            if squared <= length * length:
                join(parent, one, other)
    for vertex in range(len(parent)):
        parent[vertex] = find(parent, vertex)
    return parent
