"""Products of blocks of coded images with tall factors, tiled for the cache.

A block holds n images as `tiles` (T, m, 32) f4: row 3 j + c is colour c of image j, tile t
holds texels 32 t … 32 t + 31, and what is beyond the last texel or image is 0. Each product is
summed in f4 over at most 256 terms and in f8 beyond. No BLAS takes part: its results may depend
on the number of its threads, these cannot, and they run at half to two thirds of its speed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.btf.factor.elementary import code_rows

LANES = 32  # texels of a tile: two cache lines
RUN = 256  # terms summed in f4
_FAST = {"contract"}


@njit(cache=True, nogil=True, error_model="numpy")
def fill(image, tiles, row, kind, epsilon, knee, mean):  # type: ignore[no-untyped-def]
    """Code an image (N, 3) f4 into rows `row` … `row` + 2 of `tiles`.

    mean (m,) f4 takes the means over texels, which are subtracted. Returns the sums of squares of
    the coded values, before and after.
    """
    texels = len(image)
    # lane by lane, so that the sums vectorise without being reordered
    total, squares, rest = np.zeros((3, LANES)), np.zeros(LANES), np.zeros(LANES)
    for t in range(len(tiles)):
        first = t * LANES
        count = min(LANES, texels - first)
        red, green, blue = tiles[t, row], tiles[t, row + 1], tiles[t, row + 2]
        for x in range(count):
            red[x], green[x] = image[first + x, 0], image[first + x, 1]
            blue[x] = image[first + x, 2]
        code_rows(red[:count], green[:count], blue[:count], kind, epsilon, knee)
        for c in range(3):
            line, goal = tiles[t, row + c, :count], total[c]
            for x in range(count):
                value = np.float64(line[x])
                goal[x] += value
                squares[x] += value * value
    for c in range(3):
        mean[row + c] = total[c].sum() / texels
    for t in range(len(tiles)):
        count = min(LANES, texels - t * LANES)
        for c in range(3):
            line, middle = tiles[t, row + c, :count], mean[row + c]
            for x in range(count):
                value = line[x] - middle
                line[x] = value
                rest[x] += np.float64(value) * np.float64(value)
            tiles[t, row + c, count:] = 0
    return squares.sum(), rest.sum()


@njit(cache=True, nogil=True, error_model="numpy")
def sketch(tiles, columns, signs, start, stop, out):  # type: ignore[no-untyped-def]
    """Add ± the rows of `tiles` to some columns of `out` (32 T, l) f8, tiles start … stop - 1.

    columns (m, s) i4, signs (m, s) f4: where each row goes.
    """
    width = out.shape[1]
    part = np.empty((width, LANES), np.float64)
    for t in range(start, stop):
        part[:] = 0
        for r in range(len(columns)):
            line = tiles[t, r]
            for k in range(columns.shape[1]):
                goal, sign = part[columns[r, k]], signs[r, k]
                for x in range(LANES):
                    goal[x] += sign * line[x]
        for x in range(LANES):
            for j in range(width):
                out[t * LANES + x, j] += part[j, x]


@njit(cache=True, nogil=True, fastmath=_FAST)
def down(tiles, tall, start, stop, out):  # type: ignore[no-untyped-def]
    """Rows start … stop - 1 of the block times `tall` (32 T, l) f4, into `out` (m, l) f8.

    start and stop are multiples of 4.
    """
    width = tall.shape[1]
    part = np.empty((stop - start, width), np.float32)
    out[start:stop] = 0
    group = RUN // LANES
    for first in range(0, len(tiles), group):
        part[:] = 0
        for t in range(first, min(first + group, len(tiles))):
            for r in range(0, stop - start, 4):
                p0, p1, p2, p3 = part[r], part[r + 1], part[r + 2], part[r + 3]
                d = tiles[t, start + r : start + r + 4]
                for k in range(0, LANES, 4):
                    a00, a01, a02, a03 = d[0, k], d[0, k + 1], d[0, k + 2], d[0, k + 3]
                    a10, a11, a12, a13 = d[1, k], d[1, k + 1], d[1, k + 2], d[1, k + 3]
                    a20, a21, a22, a23 = d[2, k], d[2, k + 1], d[2, k + 2], d[2, k + 3]
                    a30, a31, a32, a33 = d[3, k], d[3, k + 1], d[3, k + 2], d[3, k + 3]
                    q = t * LANES + k
                    q0, q1, q2, q3 = tall[q], tall[q + 1], tall[q + 2], tall[q + 3]
                    for j in range(width):
                        b0, b1, b2, b3 = q0[j], q1[j], q2[j], q3[j]
                        p0[j] += a00 * b0 + a01 * b1 + a02 * b2 + a03 * b3
                        p1[j] += a10 * b0 + a11 * b1 + a12 * b2 + a13 * b3
                        p2[j] += a20 * b0 + a21 * b1 + a22 * b2 + a23 * b3
                        p3[j] += a30 * b0 + a31 * b1 + a32 * b2 + a33 * b3
        for r in range(stop - start):
            for j in range(width):
                out[start + r, j] += part[r, j]


@njit(cache=True, nogil=True, fastmath=_FAST)
def up(tiles, wide, start, stop, out):  # type: ignore[no-untyped-def]
    """Add the block's transpose times `wide` (m, l) f4 to `out` (32 T, l) f8, for some tiles."""
    rows, width = wide.shape
    part = np.empty((LANES, width), np.float32)
    for t in range(start, stop):
        tile = tiles[t]
        for first in range(0, rows, RUN):
            part[:] = 0
            last = min(first + RUN, rows)
            for x in range(0, LANES, 4):
                p0, p1, p2, p3 = part[x], part[x + 1], part[x + 2], part[x + 3]
                for k in range(first, last, 4):
                    d = tile[k : k + 4]
                    a00, a01, a02, a03 = d[0, x], d[1, x], d[2, x], d[3, x]
                    a10, a11, a12, a13 = d[0, x + 1], d[1, x + 1], d[2, x + 1], d[3, x + 1]
                    a20, a21, a22, a23 = d[0, x + 2], d[1, x + 2], d[2, x + 2], d[3, x + 2]
                    a30, a31, a32, a33 = d[0, x + 3], d[1, x + 3], d[2, x + 3], d[3, x + 3]
                    q0, q1, q2, q3 = wide[k], wide[k + 1], wide[k + 2], wide[k + 3]
                    for j in range(width):
                        b0, b1, b2, b3 = q0[j], q1[j], q2[j], q3[j]
                        p0[j] += a00 * b0 + a01 * b1 + a02 * b2 + a03 * b3
                        p1[j] += a10 * b0 + a11 * b1 + a12 * b2 + a13 * b3
                        p2[j] += a20 * b0 + a21 * b1 + a22 * b2 + a23 * b3
                        p3[j] += a30 * b0 + a31 * b1 + a32 * b2 + a33 * b3
            for x in range(LANES):
                for j in range(width):
                    out[t * LANES + x, j] += part[x, j]


@njit(cache=True, nogil=True, fastmath=_FAST)
def combine(coefficients, rows, out):  # type: ignore[no-untyped-def]
    """Write `coefficients` (m, K) times `rows` (K, n), both f4, into `out` (m, n) f4."""
    count, length = out.shape
    depth = len(rows)
    whole = depth - depth % 4
    for r in range(count):
        goal = out[r]
        goal[:] = 0
        for k in range(0, whole, 4):
            a0, a1 = coefficients[r, k], coefficients[r, k + 1]
            a2, a3 = coefficients[r, k + 2], coefficients[r, k + 3]
            q0, q1, q2, q3 = rows[k], rows[k + 1], rows[k + 2], rows[k + 3]
            for j in range(length):
                goal[j] += a0 * q0[j] + a1 * q1[j] + a2 * q2[j] + a3 * q3[j]
        for k in range(whole, depth):
            a0, q0 = coefficients[r, k], rows[k]
            for j in range(length):
                goal[j] += a0 * q0[j]
