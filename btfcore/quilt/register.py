"""Sub-texel registration of a placement: shift and turn that fit the overlap best.

Matching tries whole texels and few orientations; a few Gauss-Newton steps on the same
residuals (Lucas & Kanade 1981) find the fraction between them, which a seam across a regular
pattern pays for.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.types import F4, F8


@njit(cache=True)
def register(match: F4, spun: F8, values: F4, at: F8, reach: float, sway: float, rounds: int) -> F8:
    """Improve a placement `at` (column, row, turn), which is returned as (4,) with its mean SSD.

    match (h, w, k) f4; spun (n, 2) f8: overlap vertices (column, row) about the patch's centre
    in grid texels, before the turn; values (n, k) f4 their synthesised values. The shift stays
    within `reach` texels, the turn within `sway` radians of where it began.
    """
    height, width, channels = match.shape
    best = np.array([at[0], at[1], at[2], np.inf])
    now = at.copy()
    damping = 1e-3
    for _ in range(rounds):
        cos, sin = np.cos(now[2]), np.sin(now[2])
        a00 = a01 = a02 = a11 = a12 = a22 = 0.0
        b0 = b1 = b2 = 0.0
        total, count = 0.0, 0
        for index in range(len(spun)):
            # rows go down: a turn by +θ (counter-clockwise seen) maps (x, y) so
            x, y = spun[index, 0], spun[index, 1]
            u, v = cos * x + sin * y, -sin * x + cos * y
            px, py = now[0] + u, now[1] + v
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
        mean = total / count
        if mean < best[3]:
            best[0], best[1], best[2], best[3] = now[0], now[1], now[2], mean
        else:
            break
        a00 *= 1 + damping
        a11 *= 1 + damping
        a22 = a22 * (1 + damping) + 1e-12
        if sway == 0.0:
            a02 = a12 = b2 = 0.0
            a22 = 1.0
        # Cramer's rule on the symmetric 3 x 3 system
        c00, c01, c02 = a11 * a22 - a12 * a12, a02 * a12 - a01 * a22, a01 * a12 - a02 * a11
        det = a00 * c00 + a01 * c01 + a02 * c02
        if not det > 1e-18:
            break
        c11, c12, c22 = a00 * a22 - a02 * a02, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01
        now = np.array(
            [
                now[0] - (c00 * b0 + c01 * b1 + c02 * b2) / det,
                now[1] - (c01 * b0 + c11 * b1 + c12 * b2) / det,
                now[2] - (c02 * b0 + c12 * b1 + c22 * b2) / det,
            ]
        )
        now[0] = min(max(now[0], at[0] - reach), at[0] + reach)
        now[1] = min(max(now[1], at[1] - reach), at[1] + reach)
        now[2] = min(max(now[2], at[2] - sway), at[2] + sway)
    return best
