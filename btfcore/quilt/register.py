"""Registration of a placement: the shift, turn and slight warp that fit the overlap best.

Matching tries whole texels and few orientations; a few Gauss-Newton steps on the same
residuals (Lucas & Kanade 1981) find the fraction between them, and how the patch has to give
so that a regular pattern meets its neighbours on all sides (Wu & Yu 2004, "Feature matching
and deformation for texture synthesis", with a polynomial for their thin plates).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.types import F4, F8

C16 = NDArray[np.complex128]

DAMPING = 1e-3  # of the shift and the turn: keeps stripes from sliding along themselves
STIFF = 0.5  # a warp at its bound costs this share of the residual
MANY = 8  # parameters of a warp


@njit(cache=True)
def warped(plane, warp, radius):  # type: ignore[no-untyped-def]
    """Where a warp (8,) puts points (n,) complex, y up, and how it turns directions there.

    (column, row) + e^{iθ} ((1 + s) z + b z² / radius + q z̄), with warp = (column, row, θ, s,
    Re b, Im b, Re q, Im q). Returns ((n, 2) f8 (column, row), (n,) complex unit rotations).
    """
    count = len(plane)
    place = np.empty((count, 2), np.float64)
    turn = np.empty(count, np.complex128)
    spin = complex(np.cos(warp[2]), np.sin(warp[2]))
    bend, shear = complex(warp[4], warp[5]) / radius, complex(warp[6], warp[7])
    for here in range(count):
        z = plane[here]
        w = spin * ((1 + warp[3]) * z + bend * z * z + shear * z.conjugate())
        place[here, 0], place[here, 1] = warp[0] + w.real, warp[1] - w.imag
        # the rotation nearest to the map's derivative is that of its conformal part
        part = spin * (1 + warp[3] + 2 * bend * z)
        size = abs(part)
        turn[here] = part / size if size > 1e-12 else spin
    return place, turn


@njit(cache=True)
def fit_warp(
    match: F4,
    plane: C16,
    values: F4,
    start: F8,
    radius: float,
    reach: float,
    sway: float,
    give: float,
    rounds: int,
) -> tuple[F8, float]:
    """Improve a warp `start` (8,) (see `warped`); returns it with its mean SSD (inf: none).

    match (h, w, k) f4; plane (n,) complex: overlap vertices about the patch's centre in grid
    texels, y up; values (n, k) f4: their synthesised values; radius: unit of the bend. The
    shift stays within `reach` texels and the centre inside the sample, the turn within `sway`
    radians of where it began, each part of the warp within `give`; 0 leaves a rigid motion.
    """
    height, width, channels = match.shape
    best, least = start.copy(), np.inf
    now = start.copy()
    used = MANY if give > 0.0 else 3
    move = np.empty(MANY, np.complex128)
    for _ in range(rounds):
        spin = complex(np.cos(now[2]), np.sin(now[2]))
        bend, shear = complex(now[4], now[5]) / radius, complex(now[6], now[7])
        normal = np.zeros((MANY, MANY), np.float64)
        slope = np.zeros(MANY, np.float64)
        total, count = 0.0, 0
        for index in range(len(plane)):
            z = plane[index]
            inner = (1 + now[3]) * z + bend * z * z + shear * z.conjugate()
            w = spin * inner
            px, py = now[0] + w.real, now[1] - w.imag
            if px < 0.0 or py < 0.0 or px > width - 1 or py > height - 1:
                continue
            c, r = min(int(px), width - 2), min(int(py), height - 2)
            fx, fy = px - c, py - r
            count += 1
            xx = xy = yy = ex = ey = 0.0
            for k in range(channels):
                q00, q01 = match[r, c, k], match[r, c + 1, k]
                q10, q11 = match[r + 1, c, k], match[r + 1, c + 1, k]
                top, low = q00 + fx * (q01 - q00), q10 + fx * (q11 - q10)
                error = top + fy * (low - top) - values[index, k]
                gx = (1 - fy) * (q01 - q00) + fy * (q11 - q10)
                gy = low - top
                total += error * error
                xx += gx * gx
                xy += gx * gy
                yy += gy * gy
                ex += gx * error
                ey += gy * error
            # how each parameter moves the point, y up; (1, -i) move it along columns and rows
            move[0], move[1], move[2], move[3] = 1.0, -1j, 1j * w, spin * z
            move[4] = spin * z * z / radius
            move[5] = 1j * move[4]
            move[6] = spin * z.conjugate()
            move[7] = 1j * move[6]
            for i in range(used):
                mx, my = move[i].real, -move[i].imag
                slope[i] += mx * ex + my * ey
                tx, ty = mx * xx + my * xy, mx * xy + my * yy
                for j in range(i, used):
                    normal[i, j] += tx * move[j].real - ty * move[j].imag
        if count == 0 or not total / count < least:
            break
        best[:], least = now, total / count
        for i in range(used):
            for j in range(i):
                normal[i, j] = normal[j, i]
        for i in range(3):
            normal[i, i] *= 1 + DAMPING
        for i in range(3, used):
            weight = STIFF * total / give**2
            normal[i, i] += weight
            slope[i] += weight * now[i]
        step = np.zeros(MANY, np.float64)
        if not solve(normal, slope, used, step):
            break
        now -= step
        # the patch's centre stays inside the sample: it must be covered
        now[0] = min(max(now[0], start[0] - reach, 0.0), start[0] + reach, width - 1.0)
        now[1] = min(max(now[1], start[1] - reach, 0.0), start[1] + reach, height - 1.0)
        now[2] = min(max(now[2], start[2] - sway), start[2] + sway)
        for i in range(3, used):
            now[i] = min(max(now[i], -give), give)
    return best, least


@njit(cache=True)
def solve(matrix, right, size, out):  # type: ignore[no-untyped-def]
    """Solve the first `size` symmetric positive equations by Cholesky; False where it fails."""
    factor = np.zeros((size, size), np.float64)
    for i in range(size):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i == j:
                if not total > 1e-12 * matrix[i, i]:
                    return False
                factor[i, i] = np.sqrt(total)
            else:
                factor[i, j] = total / factor[j, j]
    for i in range(size):
        total = right[i]
        for k in range(i):
            total -= factor[i, k] * out[k]
        out[i] = total / factor[i, i]
    for i in range(size - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, size):
            total -= factor[k, i] * out[k]
        out[i] = total / factor[i, i]
    return True


def register(
    match: F4,
    spun: F8,
    values: F4,
    at: tuple[float, float, float],
    reach: float,
    sway: float,
    rounds: int,
) -> tuple[float, float, float, float]:
    """Register by a rigid motion alone: (column, row, turn), and the mean SSD (inf: none).

    spun (n, 2) f8: overlap vertices (column, row) about the patch's centre before the turn;
    otherwise as `fit_warp`.
    """
    plane = spun[:, 0] - 1j * spun[:, 1]
    start = np.array([*at, 0.0, 0.0, 0.0, 0.0, 0.0])
    best, cost = fit_warp(match, plane, values, start, 1.0, reach, sway, 0.0, rounds)
    return float(best[0]), float(best[1]), float(best[2]), float(cost)
