"""Samples charts at texel centres: which face, and where in it (Zhou §III-A)."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.errors import InvalidParameter
from btfcore.progress import Progress, silent
from btfcore.types import F8, I4

_TEXELS = 1 << 18  # sampled between two calls of progress
_INSIDE = -1e-9  # barycentric; keeps texels that lie on an edge


def rasterise(
    uv: F8, piece: I4, count: int, size: int, *, progress: Progress = silent
) -> tuple[I4, F8]:
    """Face and barycentric coordinates of every texel centre.

    uv (F, 3, 2) f8 (column, row); piece (F,) i4, 0 … count-1. Returns face (size, size) i4,
    -1 where no chart is, and bary (size, size, 3) f8, ≥ 0 and of sum 1. Where faces of one
    chart overlap (foldovers) the ones that are not mirrored go first. A piece that contains
    no texel centre gets the free texel nearest to its largest face, and that face's middle.
    Raises `InvalidParameter` where no texel is left for a piece.
    """
    uv = np.ascontiguousarray(uv)
    face = np.full((size, size), -1, np.int32)
    bary = np.zeros((size, size, 3))
    area = _signed_areas(uv)
    # runs of faces of about as many texels each
    run = (np.cumsum(np.abs(area) / 2 + 1) / _TEXELS).astype(np.int64)
    ends = np.append(np.flatnonzero(np.diff(run)) + 1, len(uv))
    for mirrored in (False, True):
        begin = 0
        for end in ends:
            progress(0.4 * mirrored + 0.4 * begin / len(uv), "sampling the surface")
            _fill(uv, area, size, begin, end, mirrored, face, bary)
            begin = end
    progress(0.8, "sampling the surface")
    bare = _give_one(uv, area, piece, count, size, face, bary)
    if bare:
        raise InvalidParameter(
            f"{bare} of {count} charts find no texel in an atlas of {size} x {size}: raise the rate"
        )
    return face, bary


@njit(cache=True)
def _signed_areas(uv: F8) -> F8:
    """Twice the area of each face, positive where it is not mirrored (rows go down)."""
    area = np.empty(len(uv))
    for f in range(len(uv)):
        area[f] = (uv[f, 2, 0] - uv[f, 0, 0]) * (uv[f, 1, 1] - uv[f, 0, 1]) - (
            uv[f, 1, 0] - uv[f, 0, 0]
        ) * (uv[f, 2, 1] - uv[f, 0, 1])
    return area


@njit(cache=True)
def _fill(
    uv: F8, area: F8, size: int, begin: int, end: int, mirrored: bool, face: I4, bary: F8
) -> None:
    for f in range(begin, end):
        if (area[f] < 0) != mirrored or abs(area[f]) < 1e-12:
            continue
        ax, ay, bx, by = uv[f, 0, 0], uv[f, 0, 1], uv[f, 1, 0], uv[f, 1, 1]
        cx, cy = uv[f, 2, 0], uv[f, 2, 1]
        left = max(int(np.ceil(min(ax, bx, cx) - 1e-9)), 0)
        right = min(int(np.floor(max(ax, bx, cx) + 1e-9)), size - 1)
        top = max(int(np.ceil(min(ay, by, cy) - 1e-9)), 0)
        bottom = min(int(np.floor(max(ay, by, cy) + 1e-9)), size - 1)
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                if face[row, column] >= 0:
                    continue
                one = ((cx - column) * (by - row) - (bx - column) * (cy - row)) / area[f]
                two = ((ax - column) * (cy - row) - (cx - column) * (ay - row)) / area[f]
                three = 1 - one - two
                if min(one, two, three) < _INSIDE:
                    continue
                one, two, three = max(one, 0.0), max(two, 0.0), max(three, 0.0)
                total = one + two + three
                face[row, column] = f
                bary[row, column, 0] = one / total
                bary[row, column, 1] = two / total
                bary[row, column, 2] = three / total


@njit(cache=True)
def _give_one(uv: F8, area: F8, piece: I4, count: int, size: int, face: I4, bary: F8) -> int:
    """Place the pieces that have no texel; returns how many found none."""
    has = np.zeros(count, np.bool_)
    for row in range(size):
        for column in range(size):
            if face[row, column] >= 0:
                has[piece[face[row, column]]] = True
    largest = np.full(count, -1, np.int32)
    for f in range(len(uv)):
        here = piece[f]
        if not has[here] and (largest[here] < 0 or abs(area[f]) > abs(area[largest[here]])):
            largest[here] = f
    bare = 0
    for here in range(count):
        f = largest[here]
        if f < 0:
            continue
        x = (uv[f, 0, 0] + uv[f, 1, 0] + uv[f, 2, 0]) / 3
        y = (uv[f, 0, 1] + uv[f, 1, 1] + uv[f, 2, 1]) / 3
        row, column = free_texel(face, size, y, x)
        if row < 0:
            bare += 1
            continue
        face[row, column] = f
        for k in range(3):
            bary[row, column, k] = 1 / 3
    return bare


@njit(cache=True)
def free_texel(face: I4, size: int, y: float, x: float) -> tuple[int, int]:
    """Free texel nearest to (y, x), or (-1, -1)."""
    top, left = int(np.rint(y)), int(np.rint(x))
    best, row, column = np.inf, -1, -1
    for ring in range(size):
        if (ring - 1) ** 2 > best:
            break
        for r in range(max(top - ring, 0), min(top + ring, size - 1) + 1):
            step = 1 if abs(r - top) == ring else max(2 * ring, 1)
            for c in range(left - ring, left + ring + 1, step):
                if 0 <= c < size and face[r, c] < 0:
                    far = (r - y) ** 2 + (c - x) ** 2
                    if far < best:
                        best, row, column = far, r, c
    return row, column
