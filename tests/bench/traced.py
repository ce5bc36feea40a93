"""Radiance traced straight from a relief, each point under a view and a light of its own.

What `btfcore.btf.bake` bakes for whole images is asked here for any points and directions, so
that a rendering can be held against the relief itself: no table, no factors, nothing between
directions or texels. Shading, horizons and cells are the baker's own kernels.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import njit

from btfcore.btf.bake.horizon import horizons
from btfcore.btf.bake.relief import Relief
from btfcore.btf.bake.shade import LANES, LOWEST, ROWS, look, shade
from btfcore.btf.bake.trace import cell, enter, first_root, folded, wrapped
from btfcore.types import F4, F8, I8

_LEAST = 1e-6  # length of a light's way along the plane, below which it stands upright
_SLICE = 4096


def traced(relief: Relief, source: F8, views: F8, lights: F8, *, threads: int = 1) -> F4:
    """Radiance (n, 3) f4 of points of a relief, with shadows and parallax, without bounces.

    source (n, 2): column and row on the reference plane, between texels too; views, lights
    (n, 3): unit, in the relief's frame (+column, -row, outward). Black where either is not
    above the horizon. The light has irradiance π, as in `btfcore.btf.bake.build.baked`.
    """
    count = len(source)
    out = np.zeros((count, 3), np.float32)
    place, view, light = (
        np.ascontiguousarray(part, np.float64) for part in (source, views, lights)
    )

    def one(first: int) -> None:
        rows = slice(first, first + _SLICE)
        _traced(
            relief.height, relief.ceiling, relief.maps, relief.level, relief.coat, relief.flat,
            place[rows], view[rows], light[rows], out[rows],
        )  # fmt: skip

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(one, range(0, count, _SLICE)))
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _traced(
    height: F4, ceiling: F4, maps: F4, level: F8, coat: F4, flat: bool, source: F8, views: F8,
    lights: F8, out: F4,
) -> None:  # fmt: skip
    x, y = np.empty(1), np.empty(1)
    surface = np.zeros((1, ROWS, LANES), np.float32)
    hidden = np.zeros((1, LANES), np.float32)
    way, reach = np.empty((1, 2)), np.empty((1, 2))
    limit, light = np.empty(1, np.float32), np.empty((1, 3), np.float32)
    run, view = np.empty(2), np.empty(3, np.float32)
    zero: I8 = np.zeros(1, np.int64)
    texels = np.array([0, 1])
    for k in range(len(source)):
        if not (views[k, 2] >= 0 and lights[k, 2] > 0):
            continue
        steep = max(views[k, 2], LOWEST)
        run[0], run[1] = views[k, 0] / steep, -views[k, 1] / steep
        if flat:
            x[0] = folded(source[k, 0], height.shape[1])
            y[0] = folded(source[k, 1], height.shape[0])
        else:
            x[0], y[0] = _hit(height, ceiling, source[k, 0], source[k, 1], run, level)
        for c in range(3):
            view[c], light[0, c] = views[k, c], lights[k, c]
        look(maps, x, y, view, coat, surface)
        across = np.hypot(lights[k, 0], lights[k, 1])
        tangent = max(lights[k, 2], LOWEST) / max(across, _LEAST)
        limit[0] = tangent
        if not flat:
            azimuth = np.arctan2(lights[k, 1], lights[k, 0]) if across >= _LEAST else 0.0
            way[0, 0], way[0, 1] = np.cos(azimuth), -np.sin(azimuth)
            reach[0, 0], reach[0, 1] = tangent * (1 - 1e-6), tangent
            horizons(height, ceiling, level[1], x, y, way, reach, hidden)
        shade(
            surface, hidden, zero, limit, view, coat, light, out[k : k + 1].reshape(1, 1, 3), zero,
            texels,
        )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _hit(height, ceiling, at_x, at_y, run, level):  # type: ignore[no-untyped-def]
    """Column and row where the line of sight through a point of the plane meets the relief.

    The loop of `btfcore.btf.bake.trace.trace`, for one line that may pass between texels.
    """
    rows, columns = height.shape
    plane, top, bottom = level[0], level[1], level[2]
    along_x, along_y = -run[0], -run[1]
    last = top - bottom
    start_x, start_y = at_x + run[0] * (top - plane), at_y + run[1] * (top - plane)
    column, next_x, step_x, gap_x = enter(start_x, along_x)
    row, next_y, step_y, gap_y = enter(start_y, along_y)
    i, j = column % columns, row % rows
    now, found = 0.0, last
    while now < last:
        leave = min(next_x, next_y, last)
        if top - leave < ceiling[j, i]:
            base, slope_x, slope_y, twist = cell(height, j, i)
            u, w = start_x + along_x * now - column, start_y + along_y * now - row
            c0 = top - now - (base + slope_x * u + slope_y * w + twist * u * w)
            c1 = -1 - (slope_x * along_x + slope_y * along_y) - twist * (u * along_y + w * along_x)
            root = first_root(c0, c1, -twist * along_x * along_y, leave - now)
            if root >= 0:
                found = now + root
                break
        now = leave
        if next_x <= next_y:
            next_x += gap_x
            column += step_x
            i = wrapped(i + step_x, columns)
        else:
            next_y += gap_y
            row += step_y
            j = wrapped(j + step_y, rows)
    return (
        folded(start_x + along_x * found, columns),
        folded(start_y + along_y * found, rows),
    )
