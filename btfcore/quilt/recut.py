"""Cutting a placement into a part that is synthesised already (Kwatra et al. 2003, §3).

Every synthesised vertex of the patch may take the new value or keep its old one; the vertices
around the patch keep theirs. All-old is one of the labellings, so the optimum never costs
more than what is there: the costs are exactly those that the seams are measured with.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.mincut import minimum_cut
from btfcore.types import F4, F8, I4


@dataclass(frozen=True, eq=False)
class Recut:
    """An optimal seam: `fresh` (inner,) bool marks the vertices that take the new value.

    before, after: Σ V_pq over the mesh edges with an end in the patch proper and Σ bias, as it
    was and as the cut leaves it (both larger by the same constant where a bias is negative).
    """

    fresh: NDArray[np.bool_]
    before: float
    after: float


def recut(
    indptr: I4,
    indices: I4,
    order: I4,
    inner: int,
    local: I4,
    place: F4,
    patch: I4,
    source: F4,
    ghost: F4,
    grid: F4,
    bias: F8,
) -> Recut:
    """Cut `place` (n, 2) f4 (grid coordinates of the patch's vertices) into the quilt.

    order (n,): the patch's vertices, the first `inner` proper and the rest their neighbours;
    local (N,): positions in it; patch (N,), source (N, 2), ghost (M, 2): the quilt so far, in
    grid coordinates; grid (h, w, K): the channels that distances are taken in; bias (inner,)
    f8: what else it costs a vertex to turn new, below 0 where it gains. Bare vertices stay bare
    and cost nothing; where `place` leaves the sample, the old value stays.
    """
    height, width = grid.shape[:2]
    inside = (place >= 0).all(axis=1) & (place[:, 0] <= width - 1) & (place[:, 1] <= height - 1)
    old = inside & (patch[order] >= 0)
    old[inner:] = False
    node = np.where(old, np.cumsum(old) - 1, -1).astype(np.int32)
    count = int(old.sum())
    fresh = np.zeros(inner, np.bool_)
    if count == 0:
        return Recut(fresh, 0.0, 0.0)
    tail, head, capacity, keep, change = _graph(
        indptr, indices, order, inner, local, place, patch, source, ghost, grid, node, count
    )
    bias = bias[old[:inner]]
    keep[:count] += np.maximum(-bias, 0.0)
    change[:count] += np.maximum(bias, 0.0)
    before = float(keep.sum())
    after, side = minimum_cut(len(keep), tail, head, capacity, capacity, change, keep)
    fresh[old[:inner]] = side[:count]
    return Recut(fresh, before, after)


@njit(cache=True)
def _graph(  # type: ignore[no-untyped-def]
    indptr, indices, order, inner, local, place, patch, source, ghost, grid, node, count
):
    """Edges and terminal capacities; a node per old seam follows the vertex nodes.

    keep: cost of staying old; change: cost of turning new.
    """
    slots = 0
    for here in range(inner):
        if node[here] >= 0:
            slots += indptr[order[here] + 1] - indptr[order[here]]
    tail, head = np.empty(slots, np.int32), np.empty(slots, np.int32)
    capacity = np.empty(slots, np.float64)
    keep = np.zeros(count + slots // 2 + 1, np.float64)
    change = np.zeros(count + slots // 2 + 1, np.float64)
    own = np.zeros(len(order), np.float64)  # ‖A − B‖ at the vertex itself
    for here in range(len(order)):
        if patch[order[here]] >= 0:
            own[here] = distance(grid, source[order[here]], place[here])
    edges, seams = 0, 0
    for here in range(inner):
        me = node[here]
        if me < 0:
            continue
        p = order[here]
        for slot in range(indptr[p], indptr[p + 1]):
            q = indices[slot]
            other = local[q]
            if patch[q] < 0 or (node[other] >= 0 and other < here):
                continue
            mine = theirs = own[here] + own[other]  # V where only q, or only p, is new
            was = 0.0
            if patch[p] != patch[q]:
                back = half_edge(indptr, indices, q, p)
                was = distance(grid, ghost[back], source[p])
                was += distance(grid, ghost[slot], source[q])
                mine = own[here] + distance(grid, ghost[slot], place[other])
                theirs = own[other] + distance(grid, ghost[back], place[here])
            if node[other] < 0:  # q keeps its old value whatever happens
                keep[me] += was
                change[me] += theirs
            elif patch[p] == patch[q]:
                tail[edges], head[edges], capacity[edges] = me, node[other], mine
                edges += 1
            else:  # the triangle inequality makes the seam node's graph exact
                seam = count + seams
                seams += 1
                tail[edges], head[edges], capacity[edges] = me, seam, mine
                tail[edges + 1], head[edges + 1], capacity[edges + 1] = seam, node[other], theirs
                edges += 2
                keep[seam] = was
    total = count + seams
    return tail[:edges], head[:edges], capacity[:edges], keep[:total], change[:total]


@njit(cache=True)
def half_edge(indptr: I4, indices: I4, tail: int, head: int) -> int:
    """Slot of the half-edge tail→head; -1 where there is none."""
    for slot in range(indptr[tail], indptr[tail + 1]):
        if indices[slot] == head:
            return slot
    return -1


@njit(cache=True)
def distance(grid: F4, a: F4, b: F4) -> float:
    """Distance of the bilinear values of `grid` (h, w, K) at two (column, row), clamped."""
    height, width, channels = grid.shape
    ax, ay = min(max(a[0], 0.0), width - 1.0), min(max(a[1], 0.0), height - 1.0)
    bx, by = min(max(b[0], 0.0), width - 1.0), min(max(b[1], 0.0), height - 1.0)
    ac, ar, bc, br = int(ax), int(ay), int(bx), int(by)
    ac1, ar1 = min(ac + 1, width - 1), min(ar + 1, height - 1)
    bc1, br1 = min(bc + 1, width - 1), min(br + 1, height - 1)
    afx, afy, bfx, bfy = ax - ac, ay - ar, bx - bc, by - br
    a00, a01, a10, a11 = (1 - afx) * (1 - afy), afx * (1 - afy), (1 - afx) * afy, afx * afy
    b00, b01, b10, b11 = (1 - bfx) * (1 - bfy), bfx * (1 - bfy), (1 - bfx) * bfy, bfx * bfy
    total = 0.0
    for k in range(channels):
        step = (
            a00 * grid[ar, ac, k] + a01 * grid[ar, ac1, k]
            + a10 * grid[ar1, ac, k] + a11 * grid[ar1, ac1, k]
            - b00 * grid[br, bc, k] - b01 * grid[br, bc1, k]
            - b10 * grid[br1, bc, k] - b11 * grid[br1, bc1, k]
        )  # fmt: skip
        total += step * step
    return np.sqrt(total)


@njit(cache=True)
def vertex_costs(
    indptr: I4, indices: I4, vertices: I4, patch: I4, source: F4, ghost: F4, grid: F4
) -> F8:
    """Seam cost (len(vertices),) f8 of the half-edges that leave each of `vertices`.

    Summed over all vertices it is Σ V_pq; V_pq is shared between the two ends of an edge.
    """
    cost = np.zeros(len(vertices), np.float64)
    for index in range(len(vertices)):
        vertex = vertices[index]
        if patch[vertex] < 0:
            continue
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = indices[slot]
            if patch[other] >= 0 and patch[other] != patch[vertex]:
                cost[index] += distance(grid, ghost[slot], source[other])
    return cost
