"""Sub-texel registration of a placement: shift and turn that fit the overlap best.

Matching tries whole texels and few orientations; a few Gauss-Newton steps on the same
residuals (Lucas & Kanade 1981) find the fraction between them, which a seam across a regular
pattern pays for.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.types import F4, F8

DAMPING = 1e-3


@njit(cache=True)
def register(
    match: F4,
    spun: F8,
    values: F4,
    at: tuple[float, float, float],
    reach: float,
    sway: float,
    rounds: int,
) -> tuple[float, float, float, float]:
    """Improve a placement `at` (column, row, turn); returns it with its mean SSD (inf: none).

    match (h, w, k) f4; spun (n, 2) f8: overlap vertices (column, row) about the patch's centre
    in grid texels, before the turn; values (n, k) f4 their synthesised values. The shift stays
    within `reach` texels, the turn within `sway` radians of where it began.
    """
    height, width, channels = match.shape
    column, row, turn = at
    best = (column, row, turn, np.inf)
    for _ in range(rounds):
        cos, sin = np.cos(turn), np.sin(turn)
        a00 = a01 = a02 = a11 = a12 = a22 = 0.0
        b0 = b1 = b2 = 0.0
        total, count = 0.0, 0
        for index in range(len(spun)):
            # rows go down: a turn by +θ (counter-clockwise seen) maps (x, y) so
            x, y = spun[index, 0], spun[index, 1]
            u, v = cos * x + sin * y, -sin * x + cos * y
            px, py = column + u, row + v
            if px < 0.0 or py < 0.0 or px > width - 1 or py > height - 1:
                continue
            c, r = min(int(px), width - 2), min(int(py), height - 2)
            fx, fy = px - c, py - r
            count += 1
            for k in range(channels):
                q00, q01 = match[r, c, k], match[r, c + 1, k]
                q10, q11 = match[r + 1, c, k], match[r + 1, c + 1, k]
                top, low = q00 + fx * (q01 - q00), q10 + fx * (q11 - q10)
                error = top + fy * (low - top) - values[index, k]
                gx = (1 - fy) * (q01 - q00) + fy * (q11 - q10)
                gy = low - top
                gt = gx * v - gy * u
                total += error * error
                a00 += gx * gx
                a01 += gx * gy
                a02 += gx * gt
                a11 += gy * gy
                a12 += gy * gt
                a22 += gt * gt
                b0 += gx * error
                b1 += gy * error
                b2 += gt * error
        if count == 0:
            break
        if not total / count < best[3]:
            break
        best = (column, row, turn, total / count)
        # a little damping keeps stripes from sliding along themselves
        a00, a11, a22 = a00 * (1 + DAMPING), a11 * (1 + DAMPING), a22 * (1 + DAMPING)
        c00, c01, c02 = a11 * a22 - a12 * a12, a02 * a12 - a01 * a22, a01 * a12 - a02 * a11
        det = a00 * c00 + a01 * c01 + a02 * c02
        if not det > 1e-12 * a00 * a11 * a22:
            break
        c11, c12, c22 = a00 * a22 - a02 * a02, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01
        column -= (c00 * b0 + c01 * b1 + c02 * b2) / det
        row -= (c01 * b0 + c11 * b1 + c12 * b2) / det
        turn -= (c02 * b0 + c12 * b1 + c22 * b2) / det
        # the patch's centre stays inside the sample: it must be covered
        column = min(max(column, at[0] - reach, 0.0), at[0] + reach, width - 1.0)
        row = min(max(row, at[1] - reach, 0.0), at[1] + reach, height - 1.0)
        turn = min(max(turn, at[2] - sway), at[2] + sway)
    return best
