"""Inner loops of the harmonic fit; their bits do not depend on the number of threads.

The BLAS behind numpy sums in another order when it has more threads (seen on products of this
size); these kernels do not, work on f4 images without a copy, and cost the same CPU time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.types import F4, F8

TILE = 256


@njit(cache=True, nogil=True)
def add_product(matrix: F8, columns: NDArray[Any], out: F8, start: int, stop: int) -> None:
    """Add `matrix` (A, B) f8 times columns start … stop of `columns` (B, N) to `out` (A, N) f8.

    `columns` is f4 or f8. Every column is summed in the order of its rows, whatever the range.
    """
    rows, inner = matrix.shape
    block = np.empty((4, TILE))
    for low in range(start, stop, TILE):
        wide = min(TILE, stop - low)
        for k in range(0, inner, 4):
            deep = min(4, inner - k)
            for j in range(4):
                for n in range(wide):
                    block[j, n] = columns[k + j, low + n] if j < deep else 0.0
            for i in range(rows):
                a = matrix[i, k]
                b = matrix[i, k + 1] if deep > 1 else 0.0
                c = matrix[i, k + 2] if deep > 2 else 0.0
                d = matrix[i, k + 3] if deep > 3 else 0.0
                for n in range(wide):
                    out[i, low + n] += (a * block[0, n] + b * block[1, n]) + (
                        c * block[2, n] + d * block[3, n]
                    )


@njit(cache=True, nogil=True)
def add_gram(columns: F8, out: F8, start: int, stop: int) -> None:
    """Add Σ c cᵀ over columns start … stop of `columns` (D, N) to `out` (D, D), upper triangle."""
    size = columns.shape[0]
    tile = np.empty((TILE, size))
    for low in range(start, stop, TILE):
        wide = min(TILE, stop - low)
        full = (wide + 7) // 8 * 8
        for i in range(size):
            for n in range(full):
                tile[n, i] = columns[i, low + n] if n < wide else 0.0
        for n in range(0, full, 8):
            for i in range(size):
                a, b, c, d = tile[n, i], tile[n + 1, i], tile[n + 2, i], tile[n + 3, i]
                e, f, g, h = tile[n + 4, i], tile[n + 5, i], tile[n + 6, i], tile[n + 7, i]
                for j in range(i, size):
                    out[i, j] += (
                        (a * tile[n, j] + b * tile[n + 1, j])
                        + (c * tile[n + 2, j] + d * tile[n + 3, j])
                    ) + (
                        (e * tile[n + 4, j] + f * tile[n + 5, j])
                        + (g * tile[n + 6, j] + h * tile[n + 7, j])
                    )


@njit(cache=True, nogil=True)
def shade(weights: F4, colours: F8, mean: F8, out: F4) -> None:
    """Write mean (3,) + weights (N, K) · colours (K, 3), not below 0, to `out` (N, 3)."""
    for n in range(weights.shape[0]):
        red, green, blue = mean[0], mean[1], mean[2]
        for k in range(weights.shape[1]):
            weight = np.float64(weights[n, k])
            red += weight * colours[k, 0]
            green += weight * colours[k, 1]
            blue += weight * colours[k, 2]
        out[n, 0], out[n, 1], out[n, 2] = max(red, 0.0), max(green, 0.0), max(blue, 0.0)


@njit(cache=True, nogil=True)
def add_errors(truth: F4, series: F8, final: F8, table: F8, sums: F8) -> None:
    """Add the squared sums of one image's N values to `sums` (6,).

    In order: truth, truth - series, series - final, truth - final, and the second and fourth
    again as sRGB-coded values, by `table` over the square root of radiance.
    """
    for n in range(truth.shape[0]):
        a, b, c = np.float64(truth[n]), series[n], final[n]
        sums[0] += a * a
        sums[1] += (a - b) * (a - b)
        sums[2] += (b - c) * (b - c)
        sums[3] += (a - c) * (a - c)
        coded = _coded(a, table)
        one, two = coded - _coded(b, table), coded - _coded(c, table)
        sums[4] += one * one
        sums[5] += two * two


@njit(cache=True, nogil=True)
def _coded(value: float, table: F8) -> float:
    last = len(table) - 1
    place = np.sqrt(min(max(value, 0.0), 1.0)) * last
    low = min(int(place), last - 1)
    return table[low] + (place - low) * (table[low + 1] - table[low])


@njit(cache=True, nogil=True)
def orthogonalise(columns: F8, turns: F8) -> int:
    """Turn pairs of rows of `columns` (n, m) until all are orthogonal; the same to `turns`.

    One-sided Jacobi rotations (Hestenes) on a matrix whose columns are stored as rows. Returns
    the number of sweeps.
    """
    count = columns.shape[0]
    whole = 0.0
    for i in range(count):
        whole += (columns[i] * columns[i]).sum()
    nothing = whole * 1e-34
    for sweep in range(60):
        turned = False
        for p in range(count - 1):
            for q in range(p + 1, count):
                alpha = beta = gamma = 0.0
                for k in range(columns.shape[1]):
                    alpha += columns[p, k] * columns[p, k]
                    beta += columns[q, k] * columns[q, k]
                    gamma += columns[p, k] * columns[q, k]
                if min(alpha, beta) <= nothing or abs(gamma) <= 1e-15 * np.sqrt(alpha * beta):
                    continue
                turned = True
                zeta = (beta - alpha) / (2 * gamma)
                tangent = 1 / (abs(zeta) + np.sqrt(1 + zeta * zeta))
                if zeta < 0:
                    tangent = -tangent
                cosine = 1 / np.sqrt(1 + tangent * tangent)
                _turn(columns, p, q, cosine, cosine * tangent)
                _turn(turns, p, q, cosine, cosine * tangent)
        if not turned:
            return sweep
    return 60


@njit(cache=True, nogil=True)
def _turn(rows: F8, p: int, q: int, cosine: float, sine: float) -> None:
    for k in range(rows.shape[1]):
        one, two = rows[p, k], rows[q, k]
        rows[p, k] = cosine * one - sine * two
        rows[q, k] = sine * one + cosine * two
