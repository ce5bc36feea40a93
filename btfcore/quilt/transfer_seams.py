"""Seams of a carried quilt cut again, so that they follow what the finer mesh shows.

Each vertex of the band chooses among the patches of the old triangle that it lies on. One patch
after the other may take what it can of the band: the expansion move of Boykov, Veksler & Zabih
(2001, §5), exact by a minimum cut (Kolmogorov & Zabih 2004, §4), with the seam cost
V_pq = ‖A(p) − B(p)‖ + ‖A(q) − B(q)‖ of Kwatra et al. (2003, §3).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.mincut import minimum_cut
from btfcore.progress import Progress, between, blocks, silent
from btfcore.quilt.measure import colour_differences
from btfcore.quilt.metric import distance
from btfcore.quilt.sheet import Sheet
from btfcore.types import F8, I4, I8, U2

_SWEEPS = 2  # rounds over all patches; the second gains little, a third nothing
_LABEL = "cutting seams again"


def recut_seams(
    faces: I4,
    band: I4,
    candidates: tuple[I4, U2, F8],
    patch: I4,
    sheet: Sheet,
    *,
    progress: Progress = silent,
) -> I4:
    """Patches (n,) i4 of the `band` (n,) i4 ascending vertices, by the cheapest seams found.

    faces (G, 3) i4; candidates: patches (n, 3) i4, -1 for none, their samples (n, 3) u2 and
    positions (n, 3, 2) f8 in sample texels at each vertex of the band; patch (N,) i4: the
    quilt as it is, which stays beside the band and never costs less than the result.
    """
    given, owner, at = candidates
    progress(0.0, _LABEL)
    apart = _apart(given, owner, _on_grids(owner, at, sheet), sheet)
    node = np.full(len(patch), -1, np.int32)
    node[band] = np.arange(len(band), dtype=np.int32)
    tail, head = _edges(faces, node, progress=between(progress, 0.02, 0.1))
    pointer, edges = _edges_at(tail, head, node, len(band))
    progress(0.1, _LABEL)
    patch = patch.copy()
    entries = np.flatnonzero(given.ravel() >= 0)
    entries = entries[np.argsort(given.ravel()[entries], kind="stable")]
    labels = given.ravel()[entries]
    starts = np.flatnonzero(np.diff(labels, prepend=-1))
    local = np.full(len(band), -1, np.int32)
    for sweep in range(_SWEEPS):
        gained = 0.0
        for index, begin in enumerate(starts):
            if index % 32 == 0:
                progress(0.1 + 0.9 * (sweep + index / len(starts)) / _SWEEPS, _LABEL)
            end = starts[index + 1] if index + 1 < len(starts) else len(labels)
            alpha = int(labels[begin])
            rows = entries[begin:end] // 3
            rows = rows[patch[band[rows]] != alpha]
            if len(rows) == 0:
                continue
            gained += _expand(
                rows, alpha, tail, head, pointer, edges, node, band, local, given, apart, patch
            )
        if gained == 0.0:
            break
    return np.asarray(patch[band])


def _expand(
    rows: I8, alpha: int, tail: I4, head: I4, pointer: I4, edges: I4, node: I4, band: I4,
    local: I4, given: I4, apart: F8, patch: I4,
) -> float:  # fmt: skip
    """Let patch `alpha` take of the band's `rows` what makes seams cheaper; returns the gain."""
    local[rows] = np.arange(len(rows))
    ends, forward, keep, change, before = _graph(
        rows, alpha, tail, head, pointer, edges, node, local, given, apart, patch
    )
    _, side = minimum_cut(
        len(rows), ends[0], ends[1], forward, np.zeros(len(forward)), change, keep
    )
    taken = rows[side]
    gain = 0.0
    if len(taken):
        old = patch[band[taken]]
        patch[band[taken]] = alpha
        gain = before - _energy(rows, tail, head, pointer, edges, node, local, given, apart, patch)
        if not gain > 1e-9 * before:  # where costs break the triangle inequality
            patch[band[taken]] = old
            gain = 0.0
    local[rows] = -1
    return gain


def _on_grids(owner: U2, at: F8, sheet: Sheet) -> F8:
    """Sample texels as texels of the samples' grids."""
    out = at.copy()
    for index, grid in enumerate(sheet.grids):
        mine = owner == index
        out[mine] = grid.from_sample(at[mine])
    return out


def _apart(given: I4, owner: U2, at: F8, sheet: Sheet) -> F8:
    """Distances (n, 3) of candidates 0 and 1, 0 and 2, 1 and 2, in texel differences.

    Of one sample in its own channels, of two in colours, as `btfcore.quilt.measure` has it.
    """
    units = [grid.texel_difference for grid in sheet.grids] + [colour_differences(sheet)[0]]
    unit = 1.0 / np.maximum(units, 1e-12)
    return np.asarray(_distances(given, owner, at, sheet.cut, sheet.colour, sheet.frames, unit))


@njit(cache=True)
def _distances(given, owner, at, cut, colour, frames, unit):  # type: ignore[no-untyped-def]
    out = np.zeros((len(given), 3))
    for row in range(len(given)):
        for pair in range(3):
            a, b = (0, 1 + pair) if pair < 2 else (1, 2)
            if given[row, a] >= 0 and given[row, b] >= 0:
                one, two = owner[row, a], owner[row, b]
                far = distance(
                    cut, colour, frames, one, at[row, a, 0], at[row, a, 1],
                    two, at[row, b, 0], at[row, b, 1],
                )  # fmt: skip
                out[row, pair] = far * unit[one if one == two else len(unit) - 1]
    return out


def _edges(faces: I4, node: I4, *, progress: Progress = silent) -> tuple[I4, I4]:
    """Mesh edges, once each, with an end in the band."""
    keys = []
    for begin, end in blocks(len(faces), 1 << 20, progress, _LABEL):
        some = faces[begin:end]
        some = some[(node[some] >= 0).any(axis=1)]
        ends = np.concatenate([some[:, [0, 1]], some[:, [1, 2]], some[:, [2, 0]]])
        ends = ends[(node[ends] >= 0).any(axis=1)].astype(np.int64)
        keys.append(ends.min(axis=1) * len(node) + ends.max(axis=1))
    key = np.unique(np.concatenate(keys))
    return (key // len(node)).astype(np.int32), (key % len(node)).astype(np.int32)


@njit(cache=True)
def _edges_at(tail, head, node, count):  # type: ignore[no-untyped-def]
    """Edges at every row of the band as (pointer, edges)."""
    pointer = np.zeros(count + 1, np.int32)
    for edge in range(len(tail)):
        for vertex in (tail[edge], head[edge]):
            if node[vertex] >= 0:
                pointer[node[vertex] + 1] += 1
    for row in range(count):
        pointer[row + 1] += pointer[row]
    fill = pointer[:-1].copy()
    edges = np.empty(pointer[count], np.int32)
    for edge in range(len(tail)):
        for vertex in (tail[edge], head[edge]):
            if node[vertex] >= 0:
                edges[fill[node[vertex]]] = edge
                fill[node[vertex]] += 1
    return pointer, edges


@njit(cache=True)
def _between(row, one, two, given, apart):  # type: ignore[no-untyped-def]
    """Distance of two patches at a row of the band; -1 where it does not have both."""
    if row < 0:
        return -1.0
    a = b = -1
    for place in range(3):
        if given[row, place] == one:
            a = place
        if given[row, place] == two:
            b = place
    if a < 0 or b < 0:
        return -1.0
    return apart[row, a + b - 1]


@njit(cache=True)
def _cost(p, one, q, two, given, apart):  # type: ignore[no-untyped-def]
    """V_pq of an edge whose ends (rows of the band, -1 beside it) have patches one and two.

    Where an end does not know the other's patch the edge counts as its other end does; where
    neither does, as the way over a patch that both know.
    """
    if one == two:
        return 0.0
    here, there = _between(p, one, two, given, apart), _between(q, one, two, given, apart)
    if here >= 0 and there >= 0:
        return here + there
    if here >= 0 or there >= 0:
        return 2 * max(here, there)
    if p >= 0 and q >= 0:
        best = np.inf
        for place in range(3):
            via = given[p, place]
            if via >= 0:
                here, there = (
                    _between(p, one, via, given, apart),
                    _between(q, via, two, given, apart),
                )
                if here >= 0 and there >= 0:
                    best = min(best, here + there)
        if best < np.inf:
            return best
    return 0.0


@njit(cache=True)
def _graph(  # type: ignore[no-untyped-def]
    rows, alpha, tail, head, pointer, edges, node, local, given, apart, patch
):
    """Edges and terminal capacities of one expansion, and what its seams cost before."""
    most = 0
    for row in rows:
        most += pointer[row + 1] - pointer[row]
    ends, forward = np.empty((2, most), np.int32), np.empty(most)
    keep, change = np.zeros(len(rows)), np.zeros(len(rows))
    used, before = 0, 0.0
    for me in range(len(rows)):
        for slot in range(pointer[rows[me]], pointer[rows[me] + 1]):
            edge = edges[slot]
            v, w = tail[edge], head[edge]
            p, q = node[v], node[w]
            inner = p >= 0 and q >= 0 and local[p] >= 0 and local[q] >= 0
            if inner and p != rows[me]:
                continue  # once, from its tail
            was = _cost(p, patch[v], q, patch[w], given, apart)
            before += was
            first = _cost(p, alpha, q, patch[w], given, apart)
            second = _cost(p, patch[v], q, alpha, given, apart)
            if not inner:
                keep[me] += was
                change[me] += first if p == rows[me] else second
                continue
            # cost: was at (0, 0), first at (1, 0), second at (0, 1), nothing at (1, 1)
            _add(keep, change, local[p], first - was)
            _add(keep, change, local[q], -first)
            ends[0, used], ends[1, used] = local[p], local[q]
            forward[used] = max(first + second - was, 0.0)
            used += 1
    return ends[:, :used], forward[:used], keep, change, before


@njit(cache=True)
def _add(keep, change, me, cost):  # type: ignore[no-untyped-def]
    if cost > 0:
        change[me] += cost
    else:
        keep[me] -= cost


@njit(cache=True)
def _energy(  # type: ignore[no-untyped-def]
    rows, tail, head, pointer, edges, node, local, given, apart, patch
):
    """What the seams at the edges of `rows` cost."""
    total = 0.0
    for row in rows:
        for slot in range(pointer[row], pointer[row + 1]):
            v, w = tail[edges[slot]], head[edges[slot]]
            p, q = node[v], node[w]
            if p >= 0 and q >= 0 and local[p] >= 0 and local[q] >= 0 and p != row:
                continue
            total += _cost(p, patch[v], q, patch[w], given, apart)
    return total
