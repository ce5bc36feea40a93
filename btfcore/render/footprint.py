"""Texels of an atlas under the samples of a picture: which are needed, and their filtered mean.

A sample covers a parallelogram of texels, found exactly from its face. Where that is smaller
than a texel, the atlas is read bilinearly. Where it is larger, probes along its longer axis
read the two nearest levels of a pyramid of means trilinearly, as anisotropic filters of
graphics hardware do (McCormack et al. 1999, "Feline"): so nothing flickers on a turntable.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.render.raster import GBuffer, Raster
from btfcore.types import F4, F8, I4, I8

PROBES = 8  # at most, along the longer axis
U1 = NDArray[np.uint8]


def level_offsets(size: int) -> I8:
    """Where each level of a flat pyramid begins, level 0 (`size` x `size`) first: (L + 1,) i8."""
    sides = [size]
    while sides[-1] > 1:
        sides.append((sides[-1] + 1) // 2)
    return np.concatenate([[0], np.cumsum(np.square(np.array(sides, np.int64)))])


def texel_places(uv: F4, size: int) -> F8:
    """Positions (n, 2) f8, (column, row) with texel centres at integers, of coordinates (n, 2)."""
    return np.asarray(uv, np.float64) * size - 0.5


def mark(seen: GBuffer, drawn: Raster, top: int, places: F8, offsets: I8, marks: U1) -> None:
    """Set to 1 what the samples of a band need of a flat pyramid of marks (T,) u1.

    top : first row of samples of the band. Bands may be marked at the same time.
    """
    centre = np.array([drawn.grid[0] / 2, drawn.grid[1] / 2])
    _mark(seen.face, seen.bary, drawn.points, drawn.faces, places, drawn.focal, centre, top,
          offsets, marks)  # fmt: skip


def spread_down(marks: U1, offsets: I8) -> int:
    """Mark all texels that marked means are made of; returns how many levels are in use."""
    return int(_spread_down(marks, offsets))


def pyramid(colour: F4, slot: I4, marks: U1, offsets: I8, levels: int) -> F4:
    """Means of the marked texels above level 0, flat: (T', 3) f4.

    colour (n, 3) f4; slot (size²,) i4: which colour a marked texel of level 0 has.
    """
    upper = np.zeros((int(offsets[levels] - offsets[1]), 3), np.float32)
    _build(colour, slot, marks, offsets, levels, upper)
    return upper


def gather(
    seen: GBuffer, drawn: Raster, top: int, places: F8, offsets: I8, slot: I4, colour: F4, upper: F4
) -> F4:
    """Mean over the samples of each pixel of a band: (h, w, 4) f4, premultiplied by alpha."""
    rows, columns = seen.face.shape
    step = drawn.samples
    out = np.empty((rows // step, columns // step, 4), np.float32)
    centre = np.array([drawn.grid[0] / 2, drawn.grid[1] / 2])
    _gather(seen.face, seen.bary, drawn.points, drawn.faces, places, drawn.focal, centre, top,
            offsets, slot, colour, upper, step, out)  # fmt: skip
    return out


# --- inside


@njit(cache=True, nogil=True)
def _axes(points, face, places, focal, x, y, n, out):  # type: ignore[no-untyped-def]
    """∂(column, row) by one sample to the right and one down: `out` (2, 2), rows the axes.

    n (3, 3) is room to work in.
    """
    a, b, c = points[face[0]], points[face[1]], points[face[2]]
    for k in range(3):
        p, q = (b, c) if k == 0 else ((c, a) if k == 1 else (a, b))
        n[k, 0] = p[1] * q[2] - p[2] * q[1]
        n[k, 1] = p[2] * q[0] - p[0] * q[2]
        n[k, 2] = p[0] * q[1] - p[1] * q[0]
    total = 0.0
    for k in range(3):
        total += n[k, 0] * x + n[k, 1] * y + n[k, 2]
    out[:] = 0.0
    if total == 0.0:
        return
    for axis in range(2):
        change = n[0, axis] + n[1, axis] + n[2, axis]
        step = 1.0 / focal if axis == 0 else -1.0 / focal
        for k in range(3):
            share = (n[k, 0] * x + n[k, 1] * y + n[k, 2]) / total
            moved = (n[k, axis] - share * change) / total * step
            out[axis, 0] += moved * places[face[k], 0]
            out[axis, 1] += moved * places[face[k], 1]


@njit(cache=True, nogil=True)
def _probes(axes, levels):  # type: ignore[no-untyped-def]
    """Number of probes, their common step (column, row), the lower level and the upper's share."""
    one = np.sqrt(axes[0, 0] ** 2 + axes[0, 1] ** 2)
    two = np.sqrt(axes[1, 0] ** 2 + axes[1, 1] ** 2)
    longer = 0 if one >= two else 1
    major, minor = max(one, two), min(one, two)
    if not major > 1.0:  # also where it is not a number
        return 1, 0.0, 0.0, 0, 0.0
    count = int(min(np.ceil(major / max(minor, 1.0)), float(PROBES)))
    height = np.log2(max(major / count, 1.0))
    height = min(height, levels - 1.0)
    level = min(int(height), levels - 1)
    return count, axes[longer, 0] / count, axes[longer, 1] / count, level, height - level


@njit(cache=True, nogil=True)
def _place(face, bary, places):  # type: ignore[no-untyped-def]
    two, three = np.float64(bary[0]), np.float64(bary[1])
    one = 1.0 - two - three
    column = one * places[face[0], 0] + two * places[face[1], 0] + three * places[face[2], 0]
    row = one * places[face[0], 1] + two * places[face[1], 1] + three * places[face[2], 1]
    return column, row


@njit(cache=True, nogil=True)
def _corners(column, row, level, side):  # type: ignore[no-untyped-def]
    """Texels (left, right, above, below) around a place of level 0 at a level, and shares."""
    scale = 1.0 / (1 << level)
    x = min(max((column + 0.5) * scale - 0.5, 0.0), side - 1.0)
    y = min(max((row + 0.5) * scale - 0.5, 0.0), side - 1.0)
    left, above = int(x), int(y)
    right, below = min(left + 1, side - 1), min(above + 1, side - 1)
    return left, right, above, below, x - left, y - above


@njit(cache=True, nogil=True)
def _side(offsets, level):  # type: ignore[no-untyped-def]
    return int(np.sqrt(np.float64(offsets[level + 1] - offsets[level])) + 0.5)


@njit(cache=True, nogil=True)
def _mark(face, bary, points, faces, places, focal, centre, top, offsets, marks):  # type: ignore[no-untyped-def]
    rows, columns = face.shape
    levels = len(offsets) - 1
    axes, room = np.empty((2, 2)), np.empty((3, 3))
    for row in range(rows):
        y = (centre[1] - (top + row + 0.5)) / focal
        for at in range(columns):
            if face[row, at] < 0:
                continue
            corner = faces[face[row, at]]
            _axes(points, corner, places, focal, (at + 0.5 - centre[0]) / focal, y, room, axes)
            count, dx, dy, level, share = _probes(axes, levels)
            px, py = _place(corner, bary[row, at], places)
            for probe in range(count):
                off = probe + 0.5 - 0.5 * count
                for each in range(level, level + (2 if share > 0.0 else 1)):
                    side = _side(offsets, each)
                    left, right, above, below, _, _ = _corners(
                        px + off * dx, py + off * dy, each, side
                    )
                    base = offsets[each]
                    marks[base + above * side + left] = 1
                    marks[base + above * side + right] = 1
                    marks[base + below * side + left] = 1
                    marks[base + below * side + right] = 1


@njit(cache=True, nogil=True)
def _spread_down(marks, offsets):  # type: ignore[no-untyped-def]
    used = 1
    for level in range(len(offsets) - 2, 0, -1):
        side, finer = _side(offsets, level), _side(offsets, level - 1)
        for row in range(side):
            for column in range(side):
                if marks[offsets[level] + row * side + column] == 0:
                    continue
                used = max(used, level + 1)
                for r in range(2 * row, min(2 * row + 2, finer)):
                    for c in range(2 * column, min(2 * column + 2, finer)):
                        marks[offsets[level - 1] + r * finer + c] = 1
    return used


@njit(cache=True, nogil=True)
def _build(colour, slot, marks, offsets, levels, upper):  # type: ignore[no-untyped-def]
    base = offsets[1]
    for level in range(1, levels):
        side, finer = _side(offsets, level), _side(offsets, level - 1)
        for row in range(side):
            for column in range(side):
                here = offsets[level] + row * side + column
                if marks[here] == 0:
                    continue
                total, count = np.zeros(3), 0
                for r in range(2 * row, min(2 * row + 2, finer)):
                    for c in range(2 * column, min(2 * column + 2, finer)):
                        for band in range(3):
                            if level == 1:
                                total[band] += colour[slot[r * finer + c], band]
                            else:
                                below = offsets[level - 1] - base + r * finer + c
                                total[band] += upper[below, band]
                        count += 1
                for band in range(3):
                    upper[here - base, band] = total[band] / count


@njit(cache=True, nogil=True)
def _fetch(column, row, level, share, offsets, slot, colour, upper, out):  # type: ignore[no-untyped-def]
    """Add to `out` the bilinear value at a level, `share` times."""
    side = _side(offsets, level)
    left, right, above, below, x, y = _corners(column, row, level, side)
    for k in range(4):
        r, fy = (above, 1.0 - y) if k < 2 else (below, y)
        c, fx = (left, 1.0 - x) if k % 2 == 0 else (right, x)
        weight = share * fx * fy
        if weight == 0.0:
            continue
        if level == 0:
            which = slot[r * side + c]
            for band in range(3):
                out[band] += weight * colour[which, band]
        else:
            which = offsets[level] - offsets[1] + r * side + c
            for band in range(3):
                out[band] += weight * upper[which, band]


@njit(cache=True, nogil=True)
def _gather(  # type: ignore[no-untyped-def]
    face, bary, points, faces, places, focal, centre, top, offsets, slot, colour, upper, step, out
):
    levels = len(offsets) - 1
    axes, room, total = np.empty((2, 2)), np.empty((3, 3)), np.empty(3)
    each = 1.0 / (step * step)
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            total[:] = 0.0
            hit = 0
            for sub in range(step * step):
                r, c = row * step + sub // step, column * step + sub % step
                if face[r, c] < 0:
                    continue
                hit += 1
                corner = faces[face[r, c]]
                x, y = (c + 0.5 - centre[0]) / focal, (centre[1] - (top + r + 0.5)) / focal
                _axes(points, corner, places, focal, x, y, room, axes)
                count, dx, dy, level, share = _probes(axes, levels)
                px, py = _place(corner, bary[r, c], places)
                for probe in range(count):
                    off = probe + 0.5 - 0.5 * count
                    cx, cy = px + off * dx, py + off * dy
                    part = each / count
                    _fetch(cx, cy, level, part * (1.0 - share), offsets, slot, colour, upper, total)
                    if share > 0.0:
                        _fetch(cx, cy, level + 1, part * share, offsets, slot, colour, upper, total)
            for band in range(3):
                out[row, column, band] = total[band]
            out[row, column, 3] = hit * each
