"""A direct solver for sparse Hermitian positive definite systems on surfaces.

SciPy's LU calls a threaded BLAS, which on a busy machine waits for its threads up to a hundred
times longer than the work takes. This one has no BLAS: L D Lᴴ row by row (Davis 2005, Algorithm
849) after a nested dissection by coordinates, which suits points on a surface; on an idle machine
it takes as long.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import csc_array

from btfcore.types import F8, I4

C16 = NDArray[np.complex128]
LEAF = 24  # unknowns that are not dissected further


class HermitianSolver:
    """Factorises once, answers many right-hand sides."""

    def __init__(self, matrix: csc_array, order: I4) -> None:
        """Factorise `matrix` (n, n), eliminating the unknowns in `order` (see `dissected`)."""
        permuted = csc_array(csc_array(matrix[order])[:, order])
        permuted.sort_indices()
        values = permuted.data.astype(np.complex128)
        self._order = order
        factors = _factorise(permuted.indptr, permuted.indices, values)
        self._start, self._row, self._lower, self._diagonal = factors

    def solve(self, right: C16) -> C16:
        """Solve for one right-hand side, (n,) c16."""
        out = np.empty_like(right)
        own = right[self._order]
        out[self._order] = _solve(self._start, self._row, self._lower, self._diagonal, own)
        return out


def dissected(points: F8, pairs: I4) -> I4:
    """Order of elimination with little fill-in, (n,) i4, by nested dissection.

    points : (n, 3) f8; pairs : (E, 2) i4, the unknowns that are coupled. The points are halved
    across their longest side; those of the upper half that are coupled to the lower one come
    last; so on in either half.
    """
    count = len(points)
    side = np.zeros(count, np.int8)
    out = np.empty(count, np.int32)
    tasks = [(0, count, np.arange(count, dtype=np.int32), pairs)]
    while tasks:
        start, stop, members, inner = tasks.pop()
        if len(members) <= LEAF or len(inner) == 0:
            out[start:stop] = members
            continue
        here = points[members]
        axis = int(np.ptp(here, axis=0).argmax())
        ranks = np.argsort(here[:, axis], kind="stable")
        side[members[ranks[: len(ranks) // 2]]] = 0
        side[members[ranks[len(ranks) // 2 :]]] = 1
        ends = side[inner]
        across = inner[ends[:, 0] != ends[:, 1]]
        side[across[side[across] == 1]] = 2
        parts = [members[side[members] == label] for label in range(3)]
        ends = side[inner]
        within = ends[:, 0] == ends[:, 1]
        last = stop - len(parts[2])
        out[last:stop] = parts[2]
        middle = start + len(parts[0])
        tasks.append((start, middle, parts[0], inner[within & (ends[:, 0] == 0)]))
        tasks.append((middle, last, parts[1], inner[within & (ends[:, 0] == 1)]))
    return out


@njit(cache=True)
def _factorise(indptr, indices, values):  # type: ignore[no-untyped-def]
    """Lower factor by columns (start, row, value) with unit diagonal, and the diagonal D."""
    count = len(indptr) - 1
    parent = np.full(count, -1, np.int32)
    flag = np.full(count, -1, np.int32)
    size = np.zeros(count, np.int64)
    for k in range(count):
        flag[k] = k
        for slot in range(indptr[k], indptr[k + 1]):
            i = indices[slot]
            if i >= k:
                continue
            while flag[i] != k:
                if parent[i] < 0:
                    parent[i] = k
                size[i] += 1
                flag[i] = k
                i = parent[i]
    start = np.zeros(count + 1, np.int64)
    for k in range(count):
        start[k + 1] = start[k] + size[k]
    row = np.empty(start[count], np.int32)
    lower = np.empty(start[count], np.complex128)
    diagonal = np.zeros(count)
    filled = np.zeros(count, np.int64)
    work = np.zeros(count, np.complex128)
    pattern = np.empty(count, np.int32)
    for k in range(count):
        flag[k] = count + k
        top = count
        for slot in range(indptr[k], indptr[k + 1]):
            i = indices[slot]
            if i == k:
                diagonal[k] = values[slot].real
            if i >= k:
                continue
            work[i] = values[slot]
            length = 0
            while flag[i] != count + k:  # the path up the elimination tree
                pattern[length] = i
                length += 1
                flag[i] = count + k
                i = parent[i]
            while length > 0:
                length -= 1
                top -= 1
                pattern[top] = pattern[length]
        for place in range(top, count):
            i = pattern[place]
            value = work[i]
            work[i] = 0.0
            last = start[i] + filled[i]
            for slot in range(start[i], last):
                work[row[slot]] -= lower[slot] * value
            entry = value.conjugate() / diagonal[i]
            diagonal[k] -= (entry * value).real
            row[last] = k
            lower[last] = entry
            filled[i] += 1
    return start, row, lower, diagonal


@njit(cache=True)
def _solve(start, row, lower, diagonal, right):  # type: ignore[no-untyped-def]
    out = right.copy()
    count = len(out)
    for k in range(count):
        value = out[k]
        for slot in range(start[k], start[k + 1]):
            out[row[slot]] -= lower[slot] * value
    for k in range(count):
        out[k] /= diagonal[k]
    for k in range(count - 1, -1, -1):
        value = out[k]
        for slot in range(start[k], start[k + 1]):
            value -= lower[slot].conjugate() * out[row[slot]]
        out[k] = value
    return out
