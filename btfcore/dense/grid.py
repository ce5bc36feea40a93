"""Joins neighbouring texels of a chart into a planar map of edges and triangles.

Directions 0 … 7 run counter-clockwise in the picture from +column; octant k lies between
directions k and k + 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.dense.cut import Pieces, after
from btfcore.progress import Progress, silent
from btfcore.types import F8, I4, Frozen

U1 = NDArray[np.uint8]

ROW = np.array([0, -1, -1, -1, 0, 1, 1, 1], np.int32)
COLUMN = np.array([1, 1, 0, -1, -1, -1, 0, 1], np.int32)
_RIGHT, _DOWN = 1, 2


@dataclass(frozen=True, eq=False)
class TexelGrid(Frozen):
    """Planar map of the covered texels, numbered row by row.

    number (size, size) i4, -1 where bare; texel (N, 2) i4 (row, column); piece (N,) i4;
    edges (N,) u1: bit k set where an edge leaves in direction k; filled (N,) u1: bit k set
    where a triangle fills octant k; faces (G, 3) i4, wound counter-clockwise from outside.
    """

    number: I4
    texel: I4
    piece: I4
    edges: U1
    filled: U1
    faces: I4


def build_grid(
    uv: F8, pieces: Pieces, face: I4, points: F8, *, progress: Progress = silent
) -> TexelGrid:
    """Two triangles per full block of 2 x 2 texels, one where three of them are covered.

    face (size, size) i4 as `rasterise` gives it; points (N, 3) f8: texels' places on the
    surface in row order, they choose the shorter diagonal. Two neighbouring texels are not
    joined where the border of their own piece runs between them (a notch or a slit).
    """
    number = np.full(face.shape, -1, np.int32)
    covered = np.flatnonzero(face >= 0)
    number.reshape(-1)[covered] = np.arange(len(covered), dtype=np.int32)
    progress(0.2, "joining texels")
    texel = np.empty((len(covered), 2), np.int32)
    texel[:, 0], texel[:, 1] = np.divmod(covered, face.shape[1])
    progress(0.3, "joining texels")
    piece = pieces.piece[face.reshape(-1)[covered]]
    progress(0.5, "joining texels")
    wall = _walls(np.ascontiguousarray(uv), pieces.piece, pieces.inner, number, piece)
    progress(0.6, "joining texels")
    edges, filled, faces = _blocks(number, piece, wall, np.ascontiguousarray(points))
    return TexelGrid(number, texel, piece, edges, filled, faces)


@njit(cache=True)
def joined(one: int, other: int, texel: I4, edges: U1) -> bool:
    """Whether the planar map has an edge between two vertices."""
    down, right = texel[other, 0] - texel[one, 0], texel[other, 1] - texel[one, 1]
    if abs(down) > 1 or abs(right) > 1:
        return False
    for k in range(8):
        if ROW[k] == down and COLUMN[k] == right:
            return (edges[one] >> k) & 1 == 1
    return False


@njit(cache=True)
def _walls(uv: F8, piece: I4, inner: I4, number: I4, of_texel: I4) -> U1:
    """Mark the grid edges (to the right, down) that their own piece's border crosses."""
    size = number.shape[0]
    wall = np.zeros((size, size), np.uint8)
    for half in range(len(inner)):
        if inner[half] >= 0:
            continue
        here = piece[half // 3]
        x0, y0 = uv[half // 3, half % 3, 0], uv[half // 3, half % 3, 1]
        x1, y1 = uv[half // 3, after(half) % 3, 0], uv[half // 3, after(half) % 3, 1]
        for column in range(int(np.ceil(min(x0, x1))), int(np.floor(max(x0, x1))) + 1):
            if x0 == x1 or column < 0 or column >= size:
                continue
            y = y0 + (column - x0) / (x1 - x0) * (y1 - y0)
            row = int(np.floor(y))
            if 0 <= row < size - 1 and 1e-6 < y - row < 1 - 1e-6:
                a, b = number[row, column], number[row + 1, column]
                if a >= 0 and b >= 0 and of_texel[a] == here and of_texel[b] == here:
                    wall[row, column] |= _DOWN
        for row in range(int(np.ceil(min(y0, y1))), int(np.floor(max(y0, y1))) + 1):
            if y0 == y1 or row < 0 or row >= size:
                continue
            x = x0 + (row - y0) / (y1 - y0) * (x1 - x0)
            column = int(np.floor(x))
            if 0 <= column < size - 1 and 1e-6 < x - column < 1 - 1e-6:
                a, b = number[row, column], number[row, column + 1]
                if a >= 0 and b >= 0 and of_texel[a] == here and of_texel[b] == here:
                    wall[row, column] |= _RIGHT
    return wall


@njit(cache=True)
def _distance(points: F8, a: int, b: int) -> float:
    total = 0.0
    for axis in range(3):
        total += (points[a, axis] - points[b, axis]) ** 2
    return total


@njit(cache=True)
def _blocks(number: I4, piece: I4, wall: U1, points: F8) -> tuple[U1, U1, I4]:
    size = number.shape[0]
    edges = np.zeros(len(piece), np.uint8)
    filled = np.zeros(len(piece), np.uint8)
    faces = np.empty((2 * len(piece), 3), np.int32)
    count = 0
    for row in range(size):
        for column in range(size):
            a = number[row, column]
            if a >= 0 and column + 1 < size:
                b = number[row, column + 1]
                if b >= 0 and piece[a] == piece[b] and not wall[row, column] & _RIGHT:
                    edges[a] |= 1 << 0
                    edges[b] |= 1 << 4
            if a >= 0 and row + 1 < size:
                c = number[row + 1, column]
                if c >= 0 and piece[a] == piece[c] and not wall[row, column] & _DOWN:
                    edges[a] |= 1 << 6
                    edges[c] |= 1 << 2
    for row in range(size - 1):
        for column in range(size - 1):
            a, b = number[row, column], number[row, column + 1]
            c, d = number[row + 1, column], number[row + 1, column + 1]
            top = a >= 0 and b >= 0 and edges[a] & (1 << 0) != 0
            left = a >= 0 and c >= 0 and edges[a] & (1 << 6) != 0
            low = c >= 0 and d >= 0 and edges[c] & (1 << 0) != 0
            right = b >= 0 and d >= 0 and edges[b] & (1 << 6) != 0
            rising = falling = False  # diagonals c-b and a-d
            if top and left and low and right:
                rising = _distance(points, b, c) <= _distance(points, a, d)
                falling = not rising
                filled[a] |= (1 << 6) | (1 << 7)
                filled[b] |= (1 << 4) | (1 << 5)
                filled[c] |= (1 << 0) | (1 << 1)
                filled[d] |= (1 << 2) | (1 << 3)
                if rising:
                    _put(faces, count, a, c, b)
                    _put(faces, count + 1, b, c, d)
                else:
                    _put(faces, count, a, c, d)
                    _put(faces, count + 1, a, d, b)
                count += 2
            elif top and left and not _same(piece, a, d):
                rising = True
                filled[a] |= (1 << 6) | (1 << 7)
                filled[b] |= 1 << 4
                filled[c] |= 1 << 1
                _put(faces, count, a, c, b)
                count += 1
            elif low and right and not _same(piece, d, a):
                rising = True
                filled[d] |= (1 << 2) | (1 << 3)
                filled[b] |= 1 << 5
                filled[c] |= 1 << 0
                _put(faces, count, b, c, d)
                count += 1
            elif left and low and not _same(piece, c, b):
                falling = True
                filled[c] |= (1 << 0) | (1 << 1)
                filled[a] |= 1 << 6
                filled[d] |= 1 << 3
                _put(faces, count, a, c, d)
                count += 1
            elif top and right and not _same(piece, b, c):
                falling = True
                filled[b] |= (1 << 4) | (1 << 5)
                filled[a] |= 1 << 7
                filled[d] |= 1 << 2
                _put(faces, count, a, d, b)
                count += 1
            if rising:
                edges[b] |= 1 << 5
                edges[c] |= 1 << 1
            if falling:
                edges[a] |= 1 << 7
                edges[d] |= 1 << 3
    return edges, filled, faces[:count].copy()


@njit(cache=True)
def _same(piece: I4, one: int, other: int) -> bool:
    return other >= 0 and piece[one] == piece[other]


@njit(cache=True)
def _put(faces: I4, place: int, a: int, b: int, c: int) -> None:
    faces[place, 0], faces[place, 1], faces[place, 2] = a, b, c
