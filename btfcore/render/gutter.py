"""Which dense vertex every texel of the atlas image shows, the gutter included.

Viewers sample the gutter: triangles of the input mesh overhang the covered texels by up to
half a texel, bilinear filtering reaches half a texel further, and mip levels further still.
A gutter texel beside a chart therefore shows the surface *across* the seam: its position is
extrapolated from the chart, and the dense mesh is walked over the zipper to the vertex that
lies there. Texels further out copy the nearest covered texel, without limit.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.patch.connectivity import adjacency
from btfcore.progress import Progress, between, blocks, silent
from btfcore.types import F8, I4, DenseMesh

RINGS = 3  # texels from a chart within which the gutter continues the surface across the seam


def gutter_source(dense: DenseMesh, *, progress: Progress = silent) -> I4:
    """Dense vertex that every texel of the atlas image copies.

    Returns (size, size) i4: a covered texel's own vertex; in the gutter within `RINGS` texels
    of a chart the vertex across the seam that lies nearest to the extrapolated position,
    elsewhere the vertex of the nearest covered texel (Euclidean). Depends on the mesh only:
    compute once, gather colours as often as they change.
    """
    label = "filling the gutter"
    progress(0.0, label)
    owner = texel_owner(dense)
    source = nearest_owner(owner)
    progress(0.2, label)
    faces = np.ascontiguousarray(dense.faces, np.int32)
    indptr, indices = adjacency(faces, len(dense.vertices), progress=between(progress, 0.2, 0.7))
    points = np.ascontiguousarray(dense.vertices, np.float64)
    for begin, end in blocks(dense.size, 256, progress, label, 0.7, 1.0):
        _walk_across(
            owner, dense.chart, points, dense.normals, indptr, indices, RINGS, begin, end, source
        )
    return source


def texel_owner(dense: DenseMesh) -> I4:
    """Vertex of every covered texel, -1 elsewhere: (size, size) i4."""
    owner = np.full((dense.size, dense.size), -1, np.int32)
    owner[dense.texel[:, 0], dense.texel[:, 1]] = np.arange(len(dense.texel), dtype=np.int32)
    return owner


def texel_frames(dense: DenseMesh, vertices: NDArray[np.integer]) -> F8:
    """How positions change from texel to texel inside the charts of `vertices` (n,).

    Returns (n, 3, 2) f8, ∂position/∂column and ∂position/∂row: least squares over the
    neighbouring texels of the same chart; where those lie on one line the other direction
    is turned about the normal; zero where a texel is alone.
    """
    points = np.ascontiguousarray(dense.vertices, np.float64)
    frames = np.empty((len(vertices), 3, 2))
    wanted = np.ascontiguousarray(vertices, np.int64)
    owner = texel_owner(dense)
    _frames(owner, dense.chart, points, dense.normals, dense.texel, wanted, frames)
    return frames


@njit(cache=True)
def nearest_owner(owner: I4) -> I4:
    """Owner of the covered texel nearest to each texel: exact, two linear passes.

    owner : (H, W) i4, at least one entry ≥ 0. The method is the lower envelope of parabolas
    of Felzenszwalb and Huttenlocher (2012).
    """
    height, width = owner.shape
    row_of = np.full((height, width), -1, np.int32)  # nearest covered row in the same column
    for column in range(width):
        last = -1
        for row in range(height):
            if owner[row, column] >= 0:
                last = row
            row_of[row, column] = last
        last = -1
        for row in range(height - 1, -1, -1):
            if owner[row, column] >= 0:
                last = row
            above = row_of[row, column]
            if last >= 0 and (above < 0 or last - row < row - above):
                row_of[row, column] = last
    nearest = np.empty((height, width), np.int32)
    hull = np.empty(width, np.int64)
    bound = np.empty(width + 1)
    for row in range(height):
        count = 0
        for column in range(width):
            if row_of[row, column] < 0:
                continue
            high = float((row_of[row, column] - row) ** 2 + column**2)
            meet = -np.inf
            while count > 0:
                other = hull[count - 1]
                low = float((row_of[row, other] - row) ** 2 + other**2)
                meet = (high - low) / (2.0 * (column - other))
                if meet > bound[count - 1]:
                    break
                count -= 1
                meet = -np.inf
            hull[count] = column
            bound[count] = meet
            count += 1
        place = 0
        for column in range(width):
            while place + 1 < count and bound[place + 1] < column:
                place += 1
            best = hull[place]
            nearest[row, column] = owner[row_of[row, best], best]
    return nearest


@njit(cache=True)
def _frame(owner, chart, points, normals, row, column):  # type: ignore[no-untyped-def]
    """∂position/∂column and ∂position/∂row at a covered texel, as two 3-vectors."""
    height, width = owner.shape
    vertex = owner[row, column]
    cc, cr, rr = 0.0, 0.0, 0.0
    by_column = np.zeros(3)
    by_row = np.zeros(3)
    for dr in range(-1, 2):
        for dc in range(-1, 2):
            r, c = row + dr, column + dc
            if (dr == 0 and dc == 0) or r < 0 or c < 0 or r >= height or c >= width:
                continue
            other = owner[r, c]
            if other < 0 or chart[other] != chart[vertex]:
                continue
            cc += dc * dc
            cr += dc * dr
            rr += dr * dr
            for axis in range(3):
                move = points[other, axis] - points[vertex, axis]
                by_column[axis] += dc * move
                by_row[axis] += dr * move
    determinant = cc * rr - cr * cr
    if determinant > 0.0:
        d_column = (rr * by_column - cr * by_row) / determinant
        d_row = (cc * by_row - cr * by_column) / determinant
        return d_column, d_row
    if cc + rr == 0.0:
        return by_column, by_row
    # all neighbours on one line: along it the mean, across it a quarter turn
    lc, lr = (1.0, cr / cc) if cc > 0.0 else (0.0, 1.0)
    along = by_column / cc if cc > 0.0 else by_row / rr
    n = normals[vertex]
    turned = np.array(
        [
            n[1] * along[2] - n[2] * along[1],
            n[2] * along[0] - n[0] * along[2],
            n[0] * along[1] - n[1] * along[0],
        ]
    )
    # `along` is J·(lc, lr) and `turned` is J·(lr, -lc), since t = -row
    square = lc * lc + lr * lr
    return (lc * along + lr * turned) / square, (lr * along - lc * turned) / square


@njit(cache=True)
def _frames(owner, chart, points, normals, texel, wanted, frames):  # type: ignore[no-untyped-def]
    for index in range(len(wanted)):
        row, column = texel[wanted[index]]
        d_column, d_row = _frame(owner, chart, points, normals, row, column)
        frames[index, :, 0] = d_column
        frames[index, :, 1] = d_row


@njit(cache=True)
def _walk_across(  # type: ignore[no-untyped-def]
    owner, chart, points, normals, indptr, indices, rings, begin, end, source
):
    width = owner.shape[1]
    for row in range(begin, end):
        for column in range(width):
            if owner[row, column] >= 0:
                continue
            near = _nearest_covered(owner, row, column, rings)
            if near < 0:
                continue
            r, c = near // width, near % width
            vertex = owner[r, c]
            d_column, d_row = _frame(owner, chart, points, normals, r, c)
            target = points[vertex] + (column - c) * d_column + (row - r) * d_row
            source[row, column] = _walk(points, indptr, indices, vertex, target)


@njit(cache=True)
def _nearest_covered(owner, row, column, rings):  # type: ignore[no-untyped-def]
    """Flat index of the covered texel nearest to (row, column) within `rings`, else -1."""
    height, width = owner.shape
    best, place = rings * rings + 1, -1
    for r in range(max(row - rings, 0), min(row + rings + 1, height)):
        for c in range(max(column - rings, 0), min(column + rings + 1, width)):
            away = (r - row) ** 2 + (c - column) ** 2
            if away < best and owner[r, c] >= 0:
                best, place = away, r * width + c
    return place


@njit(cache=True)
def _walk(points, indptr, indices, vertex, target):  # type: ignore[no-untyped-def]
    """Go from `vertex` over mesh edges as long as the distance to `target` falls."""
    best = ((points[vertex] - target) ** 2).sum()
    while True:
        here = vertex
        for slot in range(indptr[here], indptr[here + 1]):
            other = indices[slot]
            away = 0.0
            for axis in range(3):
                away += (points[other, axis] - target[axis]) ** 2
            if away < best:
                best, vertex = away, other
        if vertex == here:
            return vertex
