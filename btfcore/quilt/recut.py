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
from btfcore.quilt.metric import distance, half_edge, old_seam
from btfcore.quilt.sheet import Sheet, single
from btfcore.types import F4, F8, I4, U2


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
    grid: F4 | Sheet,
    bias: F8,
    *,
    owner: U2 | None = None,
    mine: int = 0,
) -> Recut:
    """Cut `place` (n, 2) f4 (grid coordinates of the patch's vertices) into the quilt.

    order (n,): the patch's vertices, the first `inner` proper and the rest their neighbours;
    local (N,): positions in it; patch (N,), source (N, 2), ghost (M, 2): the quilt so far, in
    grid coordinates; grid (h, w, K): the channels that distances are taken in; bias (inner,)
    f8: what else it costs a vertex to turn new, below 0 where it gains. Bare vertices stay bare
    and cost nothing; where `place` leaves the sample, the old value stays.

    Where several samples share the surface, grid holds them all, owner (N,) u2 is the sample
    of every synthesised vertex, and `mine` the patch's.
    """
    sheet = grid if isinstance(grid, Sheet) else single(grid)
    owner = np.zeros(1, np.uint16) if owner is None else owner
    height, width = sheet.frames[mine, 1], sheet.frames[mine, 2]
    inside = (place >= 0).all(axis=1) & (place[:, 0] <= width - 1) & (place[:, 1] <= height - 1)
    old = inside & (patch[order] >= 0)
    old[inner:] = False
    node = np.where(old, np.cumsum(old) - 1, -1).astype(np.int32)
    count = int(old.sum())
    fresh = np.zeros(inner, np.bool_)
    if count == 0:
        return Recut(fresh, 0.0, 0.0)
    tail, head, capacity, keep, change = _graph(
        indptr, indices, order, inner, local, place, patch, source, ghost,
        sheet.cut, sheet.colour, sheet.frames, owner, mine, node, count,
    )  # fmt: skip
    bias = bias[old[:inner]]
    keep[:count] += np.maximum(-bias, 0.0)
    change[:count] += np.maximum(bias, 0.0)
    before = float(keep.sum())
    after, side = minimum_cut(len(keep), tail, head, capacity, capacity, change, keep)
    fresh[old[:inner]] = side[:count]
    return Recut(fresh, before, after)


@njit(cache=True)
def _graph(  # type: ignore[no-untyped-def]
    indptr, indices, order, inner, local, place, patch, source, ghost,
    sheet, colour, frames, owner, fresh, node, count,
):  # fmt: skip
    """Edges and terminal capacities; a node per old seam follows the vertex nodes.

    keep: cost of staying old; change: cost of turning new.
    """
    several = len(frames) > 1
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
        v = order[here]
        if patch[v] >= 0:
            own[here] = distance(
                sheet, colour, frames, owner[v] if several else 0, source[v, 0], source[v, 1],
                fresh, place[here, 0], place[here, 1],
            )  # fmt: skip
    edges, seams = 0, 0
    for here in range(inner):
        me = node[here]
        if me < 0:
            continue
        p = order[here]
        a = owner[p] if several else 0
        for slot in range(indptr[p], indptr[p + 1]):
            q = indices[slot]
            other = local[q]
            b = owner[q] if several else 0
            if patch[q] < 0 or (node[other] >= 0 and other < here):
                continue
            mine = theirs = own[here] + own[other]  # V where only q, or only p, is new
            was = 0.0
            if patch[p] != patch[q]:
                back = half_edge(indptr, indices, q, p)
                was = old_seam(sheet, colour, frames, a, b, source, ghost, p, q, slot, back)
                mine = own[here] + distance(
                    sheet, colour, frames, a, ghost[slot, 0], ghost[slot, 1],
                    fresh, place[other, 0], place[other, 1],
                )  # fmt: skip
                theirs = own[other] + distance(
                    sheet, colour, frames, b, ghost[back, 0], ghost[back, 1],
                    fresh, place[here, 0], place[here, 1],
                )  # fmt: skip
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


def vertex_costs(
    indptr: I4,
    indices: I4,
    vertices: I4,
    patch: I4,
    source: F4,
    ghost: F4,
    grid: F4 | Sheet,
    owner: U2 | None = None,
) -> F8:
    """Seam cost (len(vertices),) f8 of the half-edges that leave each of `vertices`.

    Summed over all vertices it is Σ V_pq; V_pq is shared between the two ends of an edge.
    grid, owner: see `recut`.
    """
    sheet = grid if isinstance(grid, Sheet) else single(grid)
    owner = np.zeros(1, np.uint16) if owner is None else owner
    return np.asarray(
        _vertex_costs(
            indptr, indices, vertices, patch, source, ghost, sheet.cut, sheet.colour,
            sheet.frames, owner,
        )
    )  # fmt: skip


@njit(cache=True)
def _vertex_costs(  # type: ignore[no-untyped-def]
    indptr, indices, vertices, patch, source, ghost, sheet, colour, frames, owner
):
    several = len(frames) > 1
    cost = np.zeros(len(vertices), np.float64)
    for index in range(len(vertices)):
        p = vertices[index]
        if patch[p] < 0:
            continue
        for slot in range(indptr[p], indptr[p + 1]):
            q = indices[slot]
            if patch[q] >= 0 and patch[q] != patch[p]:
                cost[index] += distance(
                    sheet, colour, frames, owner[p] if several else 0,
                    ghost[slot, 0], ghost[slot, 1],
                    owner[q] if several else 0, source[q, 0], source[q, 1],
                )  # fmt: skip
    return cost
