"""Breadth-first work patches (Zhou §III-B, "Work Patch/Image")."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.types import I4


@njit(cache=True)
def grow(indptr: I4, indices: I4, seed: int, levels: int, local: I4, limit: int) -> tuple[I4, I4]:
    """Grow the breadth-first disk of `levels` levels around `seed`.

    local : (N,) i4, -1 everywhere on entry; on return the position of every reached vertex
    in the order (reset it with `release`). Growth stops after a level that makes the patch
    larger than `limit` vertices.
    Returns (order (n,) i4, start (L+1,) i4): vertices by level; level l lies in
    order[start[l]:start[l + 1]], so every smaller patch is a prefix.
    """
    order = np.empty(256, np.int32)
    start = np.empty(levels + 2, np.int32)
    order[0] = seed
    local[seed] = 0
    count = 1
    start[0] = 0
    start[1] = 1
    reached = 0
    for level in range(levels):
        if start[level] == start[level + 1] or count > limit:
            break
        for index in range(start[level], start[level + 1]):
            vertex = order[index]
            for slot in range(indptr[vertex], indptr[vertex + 1]):
                other = indices[slot]
                if local[other] < 0:
                    if count == len(order):
                        longer = np.empty(2 * count, np.int32)
                        longer[:count] = order
                        order = longer
                    local[other] = count
                    order[count] = other
                    count += 1
        start[level + 2] = count
        reached = level + 1
    return order[:count].copy(), start[: reached + 2].copy()


@njit(cache=True)
def release(order: I4, local: I4) -> None:
    """Reset `local` to -1 for the vertices of a patch."""
    for vertex in order:
        local[vertex] = -1


@njit(cache=True)
def near_levels(
    indptr: I4, indices: I4, order: I4, local: I4, inside: NDArray[np.bool_], levels: int
) -> NDArray[np.bool_]:
    """Which vertices (n,) of a patch lie within `levels` levels of those `inside` (n,)."""
    count = len(order)
    near = inside.copy()
    queue = np.empty(count, np.int32)
    depth = np.zeros(count, np.int32)
    tail, head = 0, 0
    for here in range(count):
        if near[here]:
            queue[tail] = here
            tail += 1
    while head < tail:
        here = queue[head]
        head += 1
        if depth[here] == levels:
            continue
        vertex = order[here]
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = local[indices[slot]]
            if other >= 0 and not near[other]:
                near[other] = True
                depth[other] = depth[here] + 1
                queue[tail] = other
                tail += 1
    return near
