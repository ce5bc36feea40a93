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
        self._start = np.argsort(self._rank).astype(np.int32)  # vertices in seeded order
        self._next = 0
        self._filled = np.zeros(count, np.int32)
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
        while self._next < len(self._start):
            candidate = int(self._start[self._next])
            if self._patch[candidate] < 0:
                return candidate
            self._next += 1
        return -1

    def ahead(self, vertex: int, levels: int) -> tuple[int, int, int]:
        """A bare vertex `levels` levels into the bare part, near `vertex`.

        Also returns how many levels it came, and how many bare vertices lie near, counting no
        further than 2·levels levels (and at least 8).
        """
        best, depth, near = _ahead(
            self._indptr, self._indices, self._patch, self._filled, vertex, levels
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
def _ahead(indptr, indices, patch, filled, vertex, levels):  # type: ignore[no-untyped-def]
    # the bare neighbourhood of the vertex, by levels
    seen = {vertex: 0}
    queue = [vertex]
    head = 0
    while head < len(queue):
        here = queue[head]
        head += 1
        if seen[here] >= max(2 * levels, 8):
            continue
        for slot in range(indptr[here], indptr[here + 1]):
            other = indices[slot]
            if patch[other] < 0 and other not in seen:
                seen[other] = seen[here] + 1
                queue.append(other)
    # its levels counted from the synthesised part
    depth = {vertex: 0}
    order = [vertex]
    for here in queue:
        if filled[here] > 0 and here not in depth:
            depth[here] = 0
            order.append(here)
    head = 0
    best = vertex
    while head < len(order):
        here = order[head]
        head += 1
        if depth[here] > depth[best] or (depth[here] == depth[best] and seen[here] < seen[best]):
            best = here
        if depth[here] >= levels:
            continue
        for slot in range(indptr[here], indptr[here + 1]):
            other = indices[slot]
            if other in seen and other not in depth:
                depth[other] = depth[here] + 1
                order.append(other)
    return best, depth[best], len(queue)
