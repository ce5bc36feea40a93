"""Where a quilt's seams cost most, kept up to date while they are cut again."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.patch.connectivity import Connectivity
from btfcore.progress import Progress, blocks, silent
from btfcore.quilt.recut import vertex_costs
from btfcore.quilt.state import QuiltState
from btfcore.types import F4, F8, I4

AROUND = 6  # levels over which seam costs are added up
REST = 32  # picks for which a place that failed is left alone; doubled every time
GIVE_UP = 4  # failures after which it waits until its surroundings change


class WorstSeams:
    """Seam cost of every vertex, summed over its surroundings, with a tabu list."""

    def __init__(
        self, net: Connectivity, state: QuiltState, grid: F4, *, progress: Progress = silent
    ) -> None:
        """Count every seam of `state` in the channels of `grid` (h, w, K)."""
        self._net, self._state, self._grid = net, state, grid
        count = len(state.patch)
        self.cost = np.zeros(count, np.float64)
        for begin, end in blocks(count, 200_000, progress, "finding the worst seams"):
            self.cost[begin:end] = self._costs(np.arange(begin, end, dtype=np.int32))
        self._seen = np.zeros(count, np.bool_)
        self.score = np.zeros(count, np.float64)
        self._failures = np.zeros(count, np.int32)
        self._rests = np.zeros(count, np.int64)  # the pick until which a vertex is left alone
        self._picks = 0
        seams = np.flatnonzero(self.cost).astype(np.int32)
        for begin, end in blocks(len(seams), 20_000, progress, "finding the worst seams"):
            self._score(seams[begin:end])

    def _costs(self, vertices: I4) -> F8:
        net, state = self._net, self._state
        return np.asarray(
            vertex_costs(
                net.indptr, net.indices, vertices, state.patch, state.source, state.ghost,
                self._grid,
            )
        )  # fmt: skip

    def _score(self, vertices: I4) -> None:
        self.score[vertices] = ball_sums(
            self._net.indptr, self._net.indices, self.cost, vertices, AROUND, self._seen
        )

    def total(self) -> float:
        """Σ V_pq of the whole quilt."""
        return float(self.cost.sum())

    def pick(self) -> tuple[int, int]:
        """The vertex amid the worst seams and how often it failed; (-1, 0) when none is left.

        Ties fall to the lowest vertex number. Where all that may be tried rests, the one
        whose rest ends first.
        """
        self._picks += 1
        open_ = (self.score > 0) & (self._failures < GIVE_UP)
        if not open_.any():
            return -1, 0
        ready = open_ & (self._rests <= self._picks)
        if not ready.any():
            self._picks = int(self._rests[open_].min())
            ready = open_ & (self._rests <= self._picks)
        vertex = int(np.where(ready, self.score, -1.0).argmax())
        return vertex, int(self._failures[vertex])

    def failed(self, vertices: I4) -> None:
        """Leave `vertices` alone for a while: a patch amid them gained nothing."""
        self._failures[vertices] += 1
        self._rests[vertices] = self._picks + REST * 2 ** np.minimum(self._failures[vertices], 16)

    def improved(self, vertices: I4) -> None:
        """Forget the failures of `vertices`: their surroundings are others now."""
        self._failures[vertices] = self._rests[vertices] = 0

    def update(self, changed: I4) -> float:
        """Recount after `changed` took new values; the gain, or 0, changing nothing, if none.

        Only half-edges that leave `changed` or a neighbour of it can cost another sum.
        """
        net = self._net
        near = ball(net.indptr, net.indices, changed, 1, self._seen)
        cost = self._costs(near)
        gain = float(self.cost[near].sum() - cost.sum())
        if not gain > 0:
            return 0.0
        self.cost[near] = cost
        around = ball(net.indptr, net.indices, near, AROUND, self._seen)
        seams = self.cost[around] > 0
        self.score[around[~seams]] = 0.0
        self._score(around[seams])
        return gain


@njit(cache=True)
def ball(indptr, indices, seeds, levels, seen):  # type: ignore[no-untyped-def]
    """Vertices (n,) i4 within `levels` edges of `seeds`, sorted; `seen` (N,) stays all False."""
    room = 4 * len(seeds) + 64
    queue = np.empty(room, np.int32)
    size = 0
    for vertex in seeds:
        seen[vertex] = True
        queue[size] = vertex
        size += 1
    begin = 0
    for _ in range(levels):
        end = size
        for at in range(begin, end):
            vertex = queue[at]
            for slot in range(indptr[vertex], indptr[vertex + 1]):
                other = indices[slot]
                if seen[other]:
                    continue
                if size == len(queue):
                    longer = np.empty(2 * size, np.int32)
                    longer[:size] = queue
                    queue = longer
                seen[other] = True
                queue[size] = other
                size += 1
        begin = end
    found = np.sort(queue[:size])
    for vertex in found:
        seen[vertex] = False
    return found


@njit(cache=True)
def ball_sums(indptr, indices, cost, centres, levels, seen):  # type: ignore[no-untyped-def]
    """Σ cost within `levels` edges of each of `centres`; `seen` (N,) stays all False."""
    sums = np.zeros(len(centres), np.float64)
    one = np.empty(1, np.int32)
    for index in range(len(centres)):
        one[0] = centres[index]
        for vertex in ball(indptr, indices, one, levels, seen):
            sums[index] += cost[vertex]
    return sums
