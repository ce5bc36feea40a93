"""Distance between two places of the samples, the terms of V_pq (Zhou §IV-A)."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.types import F4, I4


@njit(cache=True)
def distance(
    sheet: F4,
    colour: F4,
    frames: I4,
    a: int,
    ax: float,
    ay: float,
    b: int,
    bx: float,
    by: float,
) -> float:
    """Distance of the bilinear values at two (column, row), clamped at the samples' borders.

    sheet (Σh, w, K), colour (Σh, w, C) and frames (R, 4) of a `btfcore.quilt.sheet.Sheet`; a
    and b: the samples of the two. Channels of different samples mean different things, so
    there `colour` is compared; where all share one space, it is `sheet` itself.
    """
    if len(frames) == 1:
        a, b = 0, 0
    top, low = frames[a, 0], frames[b, 0]
    height, width = frames[a, 1], frames[a, 2]
    ax, ay = min(max(ax, 0.0), width - 1.0), min(max(ay, 0.0), height - 1.0)
    ac, ar = int(ax), int(ay)
    ac1, ar1 = min(ac + 1, width - 1), top + min(ar + 1, height - 1)
    height, width = frames[b, 1], frames[b, 2]
    bx, by = min(max(bx, 0.0), width - 1.0), min(max(by, 0.0), height - 1.0)
    bc, br = int(bx), int(by)
    bc1, br1 = min(bc + 1, width - 1), low + min(br + 1, height - 1)
    afx, afy, bfx, bfy = ax - ac, ay - ar, bx - bc, by - br
    ar, br = top + ar, low + br
    a00, a01, a10, a11 = (1 - afx) * (1 - afy), afx * (1 - afy), (1 - afx) * afy, afx * afy
    b00, b01, b10, b11 = (1 - bfx) * (1 - bfy), bfx * (1 - bfy), (1 - bfx) * bfy, bfx * bfy
    grid = sheet if a == b else colour
    channels = frames[a, 3] if a == b else colour.shape[2]
    total = 0.0
    for k in range(channels):
        va = (
            a00 * grid[ar, ac, k] + a01 * grid[ar, ac1, k]
            + a10 * grid[ar1, ac, k] + a11 * grid[ar1, ac1, k]
        )  # fmt: skip
        vb = (
            b00 * grid[br, bc, k] + b01 * grid[br, bc1, k]
            + b10 * grid[br1, bc, k] + b11 * grid[br1, bc1, k]
        )  # fmt: skip
        total += (va - vb) ** 2
    return np.sqrt(total)


@njit(cache=True)
def half_edge(indptr: I4, indices: I4, tail: int, head: int) -> int:
    """Slot of the half-edge tail→head; -1 where there is none."""
    for slot in range(indptr[tail], indptr[tail + 1]):
        if indices[slot] == head:
            return slot
    return -1


@njit(cache=True)
def old_seam(  # type: ignore[no-untyped-def]
    sheet, colour, frames, a, b, source, ghost, p, q, slot, back
):
    """V_pq of a seam that is there: between p of sample a and q of sample b (Zhou §IV-A).

    source (N, 2) and ghost (M, 2): the quilt; slot, back: half-edges p→q and q→p.
    """
    return distance(
        sheet, colour, frames, a, source[p, 0], source[p, 1], b, ghost[back, 0], ghost[back, 1]
    ) + distance(
        sheet, colour, frames, a, ghost[slot, 0], ghost[slot, 1], b, source[q, 0], source[q, 1]
    )
