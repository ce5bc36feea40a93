"""Small symmetric problems in f8, with the same bits whatever BLAS there is and its threads."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.types import F8

_SWEEPS = 60
_FAST = {"contract"}


@njit(cache=True, nogil=True, fastmath=_FAST)
def add_gram(tall, out):  # type: ignore[no-untyped-def]
    """Add the Gram matrix of the columns of `tall` (n, l) f4 or f8 to `out` (l, l) f8."""
    count, width = tall.shape
    line = np.empty(width)
    for i in range(count):
        for j in range(width):
            line[j] = tall[i, j]
        for k in range(width):
            value, goal = line[k], out[k]
            for j in range(width):
                goal[j] += value * line[j]


@njit(cache=True, nogil=True, fastmath=_FAST)
def turned(tall, matrix, out):  # type: ignore[no-untyped-def]
    """Write `tall` (n, l) times `matrix` (l, k) f8 into `out` (n, k), summed in f8."""
    width, wanted = matrix.shape
    line = np.empty(wanted)
    for i in range(len(tall)):
        line[:] = 0
        for k in range(width):
            value, row = np.float64(tall[i, k]), matrix[k]
            for j in range(wanted):
                line[j] += value * row[j]
        for j in range(wanted):
            out[i, j] = line[j]


def product(one: F8, two: F8) -> F8:
    """Matrix product (n, k) of small f8 matrices (n, l) and (l, k)."""
    out = np.empty((len(one), two.shape[1]))
    turned(np.ascontiguousarray(one), np.ascontiguousarray(two), out)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _jacobi(a, vectors):  # type: ignore[no-untyped-def]
    # cyclic two-sided rotations; `vectors` holds the eigenvectors as rows
    n = len(a)
    for _ in range(_SWEEPS):
        turns = 0
        for p in range(n - 1):
            for q in range(p + 1, n):
                off = a[p, q]
                if np.abs(off) <= 1e-16 * np.sqrt(np.abs(a[p, p] * a[q, q])):
                    continue
                turns += 1
                tau = (a[q, q] - a[p, p]) / (2 * off)
                root = np.sqrt(1 + tau * tau) if np.abs(tau) < 1e150 else np.abs(tau)
                t = 1 / (tau + root) if tau >= 0 else 1 / (tau - root)
                c = 1 / np.sqrt(1 + t * t)
                s = t * c
                row_p, row_q, v_p, v_q = a[p], a[q], vectors[p], vectors[q]
                app, aqq = a[p, p] - t * off, a[q, q] + t * off
                for k in range(n):
                    x, y = row_p[k], row_q[k]
                    row_p[k], row_q[k] = c * x - s * y, s * x + c * y
                    x, y = v_p[k], v_q[k]
                    v_p[k], v_q[k] = c * x - s * y, s * x + c * y
                for k in range(n):
                    a[k, p], a[k, q] = row_p[k], row_q[k]
                a[p, p], a[q, q], a[p, q], a[q, p] = app, aqq, 0.0, 0.0
        if turns == 0:
            return


def eigen(matrix: F8) -> tuple[F8, F8]:
    """Eigenvalues (n,) of a symmetric f8 matrix (n, n), descending, and eigenvectors as columns.

    Jacobi's method: small eigenvalues of a scaled matrix keep their digits (Demmel and Veselić,
    "Jacobi's method is more accurate than QR", 1992).
    """
    work, vectors = matrix.copy(), np.eye(len(matrix))
    _jacobi(work, vectors)
    values = np.diagonal(work)
    order = np.argsort(-values, kind="stable")
    return values[order].copy(), np.ascontiguousarray(vectors[order].T)


def whitening(gram: F8, *, least: float) -> tuple[F8, F8]:
    """Singular values (k,) and the matrix (l, k) that makes columns with this Gram orthonormal.

    The new columns are the left singular vectors; those of singular values below `least` times
    the greatest are left out.
    """
    scale = np.sqrt(np.maximum(np.diagonal(gram), 0))
    used = np.flatnonzero(scale > least * scale.max(initial=0))
    if len(used) == 0:
        return np.empty(0), np.empty((len(gram), 0))
    values, vectors = eigen(np.ascontiguousarray(gram[np.ix_(used, used)]))
    keep = values > (least**2) * values[0]
    singular = np.sqrt(values[keep])
    out = np.zeros((len(gram), len(singular)))
    out[used] = vectors[:, keep] / singular
    return singular, out
