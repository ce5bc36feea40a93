"""How high a relief's horizon stands, exactly, as seen from points on it.

In each cell that the way towards a light crosses, the height is a quadratic in the distance s,
(z(s) - z) / s has at most one maximum inside, and the horizon is the largest of all. At the
point itself the surface's own slope counts, so that a light behind it is hidden without any
bias, and points never hide themselves.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.btf.bake.trace import cell, enter, surface, wrapped
from btfcore.types import F4, F8


@njit(cache=True, nogil=True, error_model="numpy")
def horizons(
    height: F4, ceiling: F4, top: float, x: F8, y: F8, ways: F8, reach: F8, out: F4
) -> None:
    """Fill in the tangent of the horizon's elevation as seen from points of a relief.

    height, ceiling : as in `trace.trace`; top : the highest height. x, y (n,) f8: columns and
    rows of the points. ways (A, 2) f8: unit steps in columns and rows. reach (A, 2) f8: the
    tangents between which the horizon matters; results beyond them may stay at the limit.
    out (A, n) f4.
    """
    for k in range(len(x)):
        z = surface(height, x[k], y[k])
        for a in range(len(ways)):
            out[a, k] = _horizon(
                height, ceiling, top, x[k], y[k], z, ways[a, 0], ways[a, 1], reach[a]
            )


@njit(cache=True, nogil=True, error_model="numpy")
def _horizon(height, ceiling, top, x, y, z, along_x, along_y, reach):  # type: ignore[no-untyped-def]
    rows, columns = height.shape
    column, next_x, step_x, gap_x = enter(x, along_x)
    row, next_y, step_y, gap_y = enter(y, along_y)
    i, j = column % columns, row % rows
    best, enough = reach[0], reach[1]
    now = 0.0
    room = top - z
    while best < enough and best * now < room:
        leave = min(next_x, next_y)
        if ceiling[j, i] - z > best * now:
            base, slope_x, slope_y, twist = cell(height, j, i)
            u, w = x + along_x * now - column, y + along_y * now - row
            a = twist * along_x * along_y
            b = slope_x * along_x + slope_y * along_y + twist * (u * along_y + w * along_x)
            if now == 0:
                best = max(best, b, a * leave + b)
            else:
                c = base + slope_x * u + slope_y * w + twist * u * w - z
                span = leave - now
                best = max(best, (c + span * (b + a * span)) / leave)
                if a < 0:  # a crest inside the cell may stand higher than both ends
                    c += now * (a * now - b)
                    square = c / a
                    if now * now < square < leave * leave:
                        s = np.sqrt(square)
                        best = max(best, a * s + b - 2 * a * now + c / s)
        now = leave
        if next_x <= next_y:
            next_x += gap_x
            column += step_x
            i = wrapped(i + step_x, columns)
        else:
            next_y += gap_y
            row += step_y
            j = wrapped(j + step_y, rows)
    return best
