"""Reference of the exponential map, in Dijkstra's order; the product sweeps by levels.

Dijkstra's order with upwind averaging of transported frames: every vertex takes the mean of
what its settled neighbours predict for it (Schmidt et al. 2006, "Interactive decal
compositing with discrete exponential maps"; averaging as in Schmidt 2013).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.types import F4, F8, I4


@njit(cache=True)
def _push(keys, items, size, key, item):  # type: ignore[no-untyped-def]
    place = size
    while place > 0:
        parent = (place - 1) // 2
        if keys[parent] <= key:
            break
        keys[place] = keys[parent]
        items[place] = items[parent]
        place = parent
    keys[place] = key
    items[place] = item


@njit(cache=True)
def _pop(keys, items, size):  # type: ignore[no-untyped-def]
    """Move the smallest item out of the heap's root; the caller has read it."""
    key, item = keys[size - 1], items[size - 1]
    size -= 1
    place = 0
    while True:
        child = 2 * place + 1
        if child >= size:
            break
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[place] = keys[child]
        items[place] = items[child]
        place = child
    if size > 0:
        keys[place] = key
        items[place] = item


@njit(cache=True)
def exponential_map(
    indptr: I4, indices: I4, edge: F4, turn: F4, order: I4, local: I4
) -> tuple[F8, F8]:
    """Flatten the patch `order` (its first vertex is the centre) into the centre's frame.

    Returns (coordinates (n, 2) f8 in steps, frames (n, 2) f8: cos and sin of the angle that
    takes a direction of the vertex's frame into the plane).
    """
    count = len(order)
    slots = 0
    for vertex in order:
        slots += indptr[vertex + 1] - indptr[vertex]
    keys = np.empty(slots + 1, np.float64)
    items = np.empty(slots + 1, np.int32)
    settled = np.zeros(count, np.bool_)
    plane = np.zeros((count, 2), np.float64)
    frame = np.zeros((count, 2), np.float64)
    frame[:, 0] = 1.0
    keys[0], items[0] = 0.0, 0
    size = 1
    while size > 0:
        here = items[0]
        _pop(keys, items, size)
        size -= 1
        if settled[here]:
            continue
        vertex = order[here]
        if here != 0:
            x = y = cos = sin = 0.0
            votes = 0
            for slot in range(indptr[vertex], indptr[vertex + 1]):
                other = local[indices[slot]]
                if other < 0 or not settled[other]:
                    continue
                # the edge as seen from here, brought into the neighbour's frame and the plane
                c = frame[other, 0] * turn[slot, 0] + frame[other, 1] * turn[slot, 1]
                s = frame[other, 1] * turn[slot, 0] - frame[other, 0] * turn[slot, 1]
                x += plane[other, 0] - (c * edge[slot, 0] - s * edge[slot, 1])
                y += plane[other, 1] - (s * edge[slot, 0] + c * edge[slot, 1])
                cos += c
                sin += s
                votes += 1
            plane[here, 0], plane[here, 1] = x / votes, y / votes
            norm = np.sqrt(cos * cos + sin * sin)
            if norm > 1e-12:
                frame[here, 0], frame[here, 1] = cos / norm, sin / norm
        settled[here] = True
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = local[indices[slot]]
            if other < 0 or settled[other]:
                continue
            x = plane[here, 0] + frame[here, 0] * edge[slot, 0] - frame[here, 1] * edge[slot, 1]
            y = plane[here, 1] + frame[here, 1] * edge[slot, 0] + frame[here, 0] * edge[slot, 1]
            _push(keys, items, size, np.sqrt(x * x + y * y), other)
            size += 1
    return plane, frame
