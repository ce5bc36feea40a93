"""Patch fitting: which vertices take the new patch (Zhou §III-B, Kwatra et al. 2003, §3).

Nodes are the old vertices of the overlap, edges the dense mesh's own. Cutting between p and
q costs V_pq = ‖A(p) − B(p)‖ + ‖A(q) − B(q)‖. What a patch *would* have beside its border is
stored per half-edge as a ghost coordinate, so costs across the overlap's two rims and across
old seams are exact, and no vertex needs to be tied to either side by force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.mincut import minimum_cut
from btfcore.patch.grow import near_levels
from btfcore.quilt.metric import distance, half_edge, old_seam
from btfcore.quilt.sheet import ANYWHERE, Sheet, single
from btfcore.types import F4, I4, U2

BARE, OLD = -1, -2  # what a patch vertex is, where it is no node


@dataclass(frozen=True, eq=False)
class Cut:
    """An optimal seam: `fresh` (inner,) bool marks the patch vertices that take new values.

    flow: its cost, seams that no cut avoids included; gained: bare vertices covered; missed:
    bare vertices that the placement does not reach.
    """

    fresh: NDArray[np.bool_]
    flow: float
    gained: int
    missed: int


def fit(
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
    band: int,
    *,
    owner: U2 | None = None,
    mine: int = 0,
    allowed: NDArray[np.bool_] | None = None,
) -> Cut:
    """Cut the placement `place` (n, 2) f4 (grid coordinates of the patch's vertices).

    patch (N,), source (N, 2), ghost (M, 2): the quilt so far, in grid coordinates; grid
    (h, w, K): the channels that distances are taken in; band: levels of overlap, counted
    from the bare vertices, in which the seam may run.

    Where several samples share the surface, grid holds them all, owner (N,) u2 is the sample
    of every synthesised vertex, `mine` the patch's, and allowed (N,) bool says which vertices
    may take it. Placements on texels that the sheet bars count as not covered.
    """
    sheet = grid if isinstance(grid, Sheet) else single(grid)
    owner = np.zeros(1, np.uint16) if owner is None else owner
    allowed = ANYWHERE if allowed is None else allowed
    height, width = sheet.frames[mine, 1], sheet.frames[mine, 2]
    inside, covered, node, count = _nodes(
        indptr, indices, order, inner, local, place, patch, allowed, height, width, band,
        sheet.barred, sheet.frames[mine, 0],
    )  # fmt: skip
    bare = patch[order[:inner]] < 0
    fresh = bare & covered[:inner]
    gained = int(fresh.sum())
    missed = int(bare.sum()) - gained
    fixed = _fixed(
        indptr, indices, order, inner, local, place, patch, source, ghost,
        sheet.cut, sheet.colour, sheet.frames, owner, mine, inside, covered, node,
    )  # fmt: skip
    if count == 0:
        return Cut(fresh, fixed, gained, missed)
    tail, head, forward, backward, keep, change, extra = _graph(
        indptr, indices, order, inner, local, place, patch, source, ghost,
        sheet.cut, sheet.colour, sheet.frames, owner, mine, inside, covered, node, count,
    )  # fmt: skip
    flow, side = minimum_cut(count + extra, tail, head, forward, backward, change, keep)
    is_node = node[:inner] >= 0
    fresh[is_node] = side[node[:inner][is_node]]
    return Cut(fresh, fixed + flow, gained, missed)


@njit(cache=True)
def _nodes(  # type: ignore[no-untyped-def]
    indptr, indices, order, inner, local, place, patch, allowed, height, width, band, barred, top
):
    """Which vertices lie inside the sample, are covered, and are graph nodes."""
    count = len(order)
    inside = np.empty(count, np.bool_)
    covered = np.empty(count, np.bool_)
    for here in range(count):
        x, y = place[here, 0], place[here, 1]
        inside[here] = x >= 0.0 and y >= 0.0 and x <= width - 1 and y <= height - 1
        covered[here] = inside[here] and (len(allowed) == 0 or allowed[order[here]])
        if len(barred) and covered[here]:
            covered[here] = not barred_at(barred, top, height, width, x, y)
    node = np.full(count, OLD, np.int32)
    queue = np.empty(inner, np.int32)
    depth = np.full(inner, -1, np.int32)
    tail = 0
    for here in range(inner):
        if patch[order[here]] < 0:
            node[here] = BARE
            if covered[here]:
                depth[here] = 0
                queue[tail] = here
                tail += 1
    for here in range(inner, count):
        if patch[order[here]] < 0:
            node[here] = BARE
    head, nodes = 0, 0
    while head < tail:
        here = queue[head]
        head += 1
        if depth[here] == band:
            continue
        vertex = order[here]
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = local[indices[slot]]
            if 0 <= other < inner and depth[other] < 0 and covered[other] and node[other] == OLD:
                depth[other] = depth[here] + 1
                node[other] = nodes
                nodes += 1
                queue[tail] = other
                tail += 1
    return inside, covered, node, nodes


@njit(cache=True)
def barred_at(barred, top, height, width, x, y):  # type: ignore[no-untyped-def]
    """Whether the bilinear value at (column x, row y) has part of a barred texel.

    barred (Σh, w) bool of a sheet, of which the sample's part begins at row `top`.
    """
    x, y = min(max(x, 0.0), width - 1.0), min(max(y, 0.0), height - 1.0)
    column, row = int(x), int(y)
    right = column + 1 if x > column else column
    below = row + 1 if y > row else row
    row, below = top + row, top + below
    return (
        barred[row, column] or barred[row, right] or barred[below, column] or barred[below, right]
    )


@njit(cache=True)
def barred_places(barred: NDArray[np.bool_], frame: I4, place: F4) -> NDArray[np.bool_]:
    """Which positions (n, 2) f4 of the sample with `frame` (4,) are barred, see `barred_at`."""
    out = np.zeros(len(place), np.bool_)
    if len(barred):
        for here in range(len(place)):
            out[here] = barred_at(
                barred, frame[0], frame[1], frame[2], place[here, 0], place[here, 1]
            )
    return out


def near_bare(
    indptr: I4, indices: I4, order: I4, local: I4, patch: I4, levels: int
) -> NDArray[np.bool_]:
    """Which vertices (n,) of a patch lie within `levels` levels of a bare one."""
    return np.asarray(near_levels(indptr, indices, order, local, patch[order] < 0, levels))


@njit(cache=True)
def _fixed(  # type: ignore[no-untyped-def]
    indptr, indices, order, inner, local, place, patch, source, ghost,
    sheet, colour, frames, owner, fresh, inside, covered, node,
):  # fmt: skip
    """Cost of the seams between bare vertices that are covered and old ones that must stay.

    The same for every cut of a placement, but not for every placement.
    """
    several = len(frames) > 1
    total = 0.0
    for here in range(inner):
        if node[here] != BARE or not covered[here]:
            continue
        p = order[here]
        for slot in range(indptr[p], indptr[p + 1]):
            q = indices[slot]
            other = local[q]
            if patch[q] < 0 or (other >= 0 and node[other] >= 0):
                continue
            b = owner[q] if several else 0
            back = half_edge(indptr, indices, q, p)
            rim = distance(
                sheet, colour, frames, b, ghost[back, 0], ghost[back, 1],
                fresh, place[here, 0], place[here, 1],
            )  # fmt: skip
            total += rim
            if other >= 0 and inside[other]:
                rim = distance(
                    sheet, colour, frames, b, source[q, 0], source[q, 1],
                    fresh, place[other, 0], place[other, 1],
                )  # fmt: skip
            total += rim
    return total


@njit(cache=True)
def _graph(  # type: ignore[no-untyped-def]
    indptr, indices, order, inner, local, place, patch, source, ghost,
    sheet, colour, frames, owner, fresh, inside, covered, node, count,
):  # fmt: skip
    """Edges and terminal capacities; seam nodes follow the vertex nodes."""
    slots = 0
    for here in range(inner):
        if node[here] >= 0:
            slots += indptr[order[here] + 1] - indptr[order[here]]
    tail, head = np.empty(slots, np.int32), np.empty(slots, np.int32)
    forward = np.empty(slots, np.float64)
    keep = np.zeros(count + slots // 2 + 1, np.float64)  # cost of keeping the old value
    change = np.zeros(count + slots // 2 + 1, np.float64)  # cost of taking the new one
    own = np.zeros(len(order), np.float64)  # ‖A − B‖ at the vertex itself
    several = len(frames) > 1
    for here in range(len(order)):
        vertex = order[here]
        if node[here] != BARE:
            own[here] = distance(
                sheet, colour, frames, owner[vertex] if several else 0,
                source[vertex, 0], source[vertex, 1], fresh, place[here, 0], place[here, 1],
            )  # fmt: skip
    edges, extra = 0, 0
    for here in range(inner):
        me = node[here]
        if me < 0:
            continue
        p = order[here]
        a = owner[p] if several else 0
        for slot in range(indptr[p], indptr[p + 1]):
            q = indices[slot]
            other = local[q]
            if other >= 0 and node[other] == BARE:
                if other < inner and covered[other]:
                    keep[me] += own[here] + distance(
                        sheet, colour, frames, a, ghost[slot, 0], ghost[slot, 1],
                        fresh, place[other, 0], place[other, 1],
                    )  # fmt: skip
                continue
            if other < 0 and patch[q] < 0:
                continue
            same = patch[p] == patch[q]
            b = owner[q] if several else 0
            if other >= 0 and node[other] >= 0:
                if other < here:
                    continue
                if same:
                    tail[edges], head[edges] = me, node[other]
                    forward[edges] = own[here] + own[other]
                    edges += 1
                    continue
                back = half_edge(indptr, indices, q, p)
                # M(p, q, A_p, B), M(p, q, A_q, B) and the old seam M(p, q, A_p, A_q)
                mine = own[here] + distance(
                    sheet, colour, frames, a, ghost[slot, 0], ghost[slot, 1],
                    fresh, place[other, 0], place[other, 1],
                )  # fmt: skip
                theirs = own[other] + distance(
                    sheet, colour, frames, b, ghost[back, 0], ghost[back, 1],
                    fresh, place[here, 0], place[here, 1],
                )  # fmt: skip
                seam = count + extra
                extra += 1
                tail[edges], head[edges], forward[edges] = me, seam, mine
                tail[edges + 1], head[edges + 1], forward[edges + 1] = seam, node[other], theirs
                edges += 2
                keep[seam] = old_seam(sheet, colour, frames, a, b, source, ghost, p, q, slot, back)
                continue
            # q keeps its old value whatever happens
            if same:
                rim = own[here]
            else:
                back = half_edge(indptr, indices, q, p)
                rim = distance(
                    sheet, colour, frames, b, ghost[back, 0], ghost[back, 1],
                    fresh, place[here, 0], place[here, 1],
                )  # fmt: skip
                keep[me] += old_seam(sheet, colour, frames, a, b, source, ghost, p, q, slot, back)
            change[me] += rim + (own[other] if other >= 0 and inside[other] else rim)
    total = count + extra
    return (
        tail[:edges], head[:edges], forward[:edges], forward[:edges],
        keep[:total], change[:total], extra,
    )  # fmt: skip
