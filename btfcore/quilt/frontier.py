"""Which vertex to synthesise next: the most constrained one (Zhou §III-B, Fig. 4)."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.types import I4


class Frontier:
    """Bare vertices beside synthesised ones, with the number of their synthesised neighbours."""

    def __init__(self, indptr: I4, indices: I4, patch: I4, seed: int) -> None:
        """Start from the quilt so far (`patch` is read, never written, and -1 where bare)."""
        count = len(patch)
        self._indptr, self._indices, self._patch = indptr, indices, patch
        self._rank = np.random.default_rng(seed).permutation(count).astype(np.int32)
        self._start = np.empty(count, np.int32)  # vertices in seeded order
        self._start[self._rank] = np.arange(count, dtype=np.int32)
        self._next = 0
        self._filled = np.zeros(count, np.int32)
        self._seen = np.full(count, -1, np.int32)
        self._list = np.empty(count, np.int32)
        self._size = 0
        self.add(np.flatnonzero(patch >= 0).astype(np.int32))

    def add(self, fresh: I4) -> None:
        """Tell that the vertices `fresh`, bare before, are synthesised now."""
        self._size = _add(
            self._indptr, self._indices, self._patch, fresh, self._filled, self._list, self._size
        )

    def pick(self) -> int:
        """Return the bare vertex with most synthesised neighbours, ties in seeded order.

        Where none touches the synthesised part, the next bare one in seeded order; -1 when
        every vertex is covered.
        """
        vertex, self._size = _pick(self._patch, self._filled, self._rank, self._list, self._size)
        if vertex >= 0:
            return int(vertex)
        self._next = _next_bare(self._patch, self._start, self._next)
        return int(self._start[self._next]) if self._next < len(self._start) else -1

    def ahead(self, vertex: int, levels: int) -> tuple[int, int, int]:
        """A bare vertex `levels` levels into the bare part, near `vertex`.

        Also returns how many levels it came, and how many bare vertices lie near, counting no
        further than 2·levels levels (and at least 8).
        """
        best, depth, near = _ahead(
            self._indptr, self._indices, self._patch, self._filled, self._seen, vertex, levels
        )
        return int(best), int(depth), int(near)


@njit(cache=True)
def _add(indptr, indices, patch, fresh, filled, listed, size):  # type: ignore[no-untyped-def]
    for vertex in fresh:
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = indices[slot]
            if patch[other] >= 0:
                continue
            if filled[other] == 0:
                listed[size] = other
                size += 1
            filled[other] += 1
    return size


@njit(cache=True)
def _pick(patch, filled, rank, listed, size):  # type: ignore[no-untyped-def]
    best, kept = -1, 0
    for index in range(size):
        vertex = listed[index]
        if patch[vertex] >= 0:
            continue
        listed[kept] = vertex
        kept += 1
        if (
            best < 0
            or filled[vertex] > filled[best]
            or (filled[vertex] == filled[best] and rank[vertex] < rank[best])
        ):
            best = vertex
    return best, kept


@njit(cache=True)
def _next_bare(patch, start, place):  # type: ignore[no-untyped-def]
    """First place at or after `place` of a bare vertex in the order `start`."""
    while place < len(start) and patch[start[place]] >= 0:
        place += 1
    return place


@njit(cache=True)
def _ahead(indptr, indices, patch, filled, seen, vertex, levels):  # type: ignore[no-untyped-def]
    """Breadth-first into the bare part; `seen` (N,) is all -1 on entry and on return."""
    reach = max(2 * levels, 8)
    queue = np.empty(256, np.int32)
    queue[0] = vertex
    seen[vertex] = 0
    count, head = 1, 0
    while head < count:  # the bare neighbourhood of the vertex
        here = queue[head]
        head += 1
        if seen[here] >= reach:
            continue
        for slot in range(indptr[here], indptr[here + 1]):
            other = indices[slot]
            if patch[other] < 0 and seen[other] < 0:
                if count == len(queue):
                    longer = np.empty(2 * count, np.int32)
                    longer[:count] = queue
                    queue = longer
                seen[other] = seen[here] + 1
                queue[count] = other
                count += 1
    # its levels counted from the synthesised part; -2 - level marks where they were before
    order = np.empty(count, np.int32)
    depth = np.empty(count, np.int32)
    order[0], depth[0] = vertex, 0
    size = 1
    best, best_depth, best_seen = vertex, 0, 0
    seen[vertex] = -2
    for index in range(1, count):
        here = queue[index]
        if filled[here] > 0:
            order[size], depth[size] = here, 0
            size += 1
            seen[here] = -2 - seen[here]
    head = 0
    while head < size:
        here, level = order[head], depth[head]
        head += 1
        near = -2 - seen[here]
        if level > best_depth or (level == best_depth and near < best_seen):
            best, best_depth, best_seen = here, level, near
        if level >= levels:
            continue
        for slot in range(indptr[here], indptr[here + 1]):
            other = indices[slot]
            if seen[other] >= 0:
                order[size], depth[size] = other, level + 1
                size += 1
                seen[other] = -2 - seen[other]
    for index in range(count):
        seen[queue[index]] = -1
    return best, best_depth, count
