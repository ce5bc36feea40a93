"""Bending a flattened patch so that its texture follows the field around a curve.

An isometric map carries one straight pattern over the whole patch, however the field turns.
The conformal map z → z + a z² turns directions by 2 Im(a z) and changes lengths by the factor
1 + 2 Re(a z): a little stretch at the rim buys a turn of the same size.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def fit_bend(direction, plane, bare, count, most):  # type: ignore[no-untyped-def]
    """Bend `a` (complex) that best straightens the field, and the median angle that is left.

    direction (n,) complex: unit field directions in the plane; plane (n, 2) f8; bare (n,):
    the vertices that matter, of the first `count`; most: bound on |2 a z|, the change of
    length at the patch's rim.
    """
    mean = 0j
    used = 0
    for here in range(count):
        if bare[here]:
            mean += direction[here]
            used += 1
    if used < 3 or abs(mean) < 1e-9:
        return 0j, 0.0
    mean /= abs(mean)
    angle = np.empty(used, np.float64)
    xs, ys = np.empty(used, np.float64), np.empty(used, np.float64)
    at = 0
    reach = 0.0
    for here in range(count):
        size = plane[here, 0] ** 2 + plane[here, 1] ** 2
        reach = max(reach, size)
        if bare[here]:
            turned = direction[here] * mean.conjugate()
            angle[at] = np.arctan2(turned.imag, turned.real)
            xs[at], ys[at] = plane[here, 0], plane[here, 1]
            at += 1
    mx, my, ma = xs.mean(), ys.mean(), angle.mean()
    xx = yy = xy = xa = ya = 0.0
    for at in range(used):
        x, y, t = xs[at] - mx, ys[at] - my, angle[at] - ma
        xx += x * x
        yy += y * y
        xy += x * y
        xa += x * t
        ya += y * t
    det = xx * yy - xy * xy
    bend = 0j
    if det > 1e-9 * (xx + yy) ** 2 and most > 0.0:
        gx, gy = (yy * xa - xy * ya) / det, (xx * ya - xy * xa) / det
        bend = complex(-0.5 * gy, -0.5 * gx)
        rim = 2 * abs(bend) * np.sqrt(reach)
        if rim > most:
            bend *= most / rim
    for at in range(used):
        angle[at] += 2 * (bend.real * ys[at] + bend.imag * xs[at])
    middle = np.median(angle)
    return bend, np.median(np.abs(angle - middle))


@njit(cache=True)
def bent(plane, bend):  # type: ignore[no-untyped-def]
    """Apply z → z + a z² to coordinates (n, 2) f8."""
    result = np.empty_like(plane)
    for here in range(len(plane)):
        z = complex(plane[here, 0], plane[here, 1])
        w = z + bend * z * z
        result[here, 0], result[here, 1] = w.real, w.imag
    return result
