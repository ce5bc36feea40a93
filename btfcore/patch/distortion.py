"""How far a flattened patch is from the surface: area, tears and orientation."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.types import F4, F8, I4


@njit(cache=True)
def sound_levels(
    indptr: I4,
    indices: I4,
    face_ptr: I4,
    face_of: I4,
    faces: I4,
    area: F4,
    edge: F4,
    order: I4,
    start: I4,
    local: I4,
    plane: F8,
    bound: float,
    share: float,
    stretch: float,
    stretched: float,
) -> tuple[int, int]:
    """Largest number of levels whose prefix of the patch is flattened soundly (0 if none).

    Also the first level with a torn edge, one more than there are where none is torn.

    Sound: at most `share` of the area lies outside [1/bound, bound] times the area on the
    surface or is mirrored (Zhou's T_d as an area test); at most `stretched` of the edges have
    changed their length by more than a factor `stretch`; and no edge is torn, i.e. no two
    neighbours were carried apart around a handle. Level l is the ring that breadth-first
    growth reached in step l; the centre alone is level 0.
    """
    levels = len(start) - 2
    level_of = np.empty(len(order), np.int32)
    for level in range(levels + 1):
        for here in range(start[level], start[level + 1]):
            level_of[here] = level
    whole = np.zeros(levels + 1, np.float64)
    bad = np.zeros(levels + 1, np.float64)
    edges = np.zeros(levels + 1, np.int64)
    changed = np.zeros(levels + 1, np.int64)
    torn = levels + 1
    for here in range(len(order)):
        vertex = order[here]
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = local[indices[slot]]
            if other < here:
                continue
            x = plane[other, 0] - plane[here, 0]
            y = plane[other, 1] - plane[here, 1]
            length = np.sqrt(edge[slot, 0] ** 2 + edge[slot, 1] ** 2)
            drawn = np.sqrt(x * x + y * y)
            edges[level_of[other]] += 1
            if drawn > stretch * length or drawn * stretch < length:
                changed[level_of[other]] += 1
            if abs(drawn - length) > 1.0 + 0.5 * length:
                torn = min(torn, level_of[other])
        for index in range(face_ptr[vertex], face_ptr[vertex + 1]):
            face = face_of[index]
            a, b, c = local[faces[face, 0]], local[faces[face, 1]], local[faces[face, 2]]
            if a < 0 or b < 0 or c < 0 or min(a, b, c) != here:
                continue
            x0, y0 = plane[b, 0] - plane[a, 0], plane[b, 1] - plane[a, 1]
            x1, y1 = plane[c, 0] - plane[a, 0], plane[c, 1] - plane[a, 1]
            flat = 0.5 * (x0 * y1 - x1 * y0)
            level = level_of[max(a, b, c)]
            whole[level] += area[face]
            if flat > bound * area[face] or flat * bound < area[face]:
                bad[level] += area[face]
    sound = 0
    total = wrong = 0.0
    lengths = off = 0
    for level in range(levels + 1):
        total += whole[level]
        wrong += bad[level]
        lengths += edges[level]
        off += changed[level]
        if level >= torn:
            break
        if wrong <= share * total and off <= stretched * lengths:
            sound = level
    return sound, torn


@njit(cache=True)
def field_directions(
    indptr: I4, indices: I4, edge: F4, order: I4, count: int, local: I4, plane: F8
) -> F8:
    """Unit direction (count, 2) of the field in the plane at the first `count` vertices.

    The rotation that best takes a vertex's edges, seen in its own frame, to the plane.
    """
    result = np.empty((count, 2), np.float64)
    for here in range(count):
        vertex = order[here]
        cos = sin = 0.0
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = local[indices[slot]]
            if other < 0:
                continue
            x = plane[other, 0] - plane[here, 0]
            y = plane[other, 1] - plane[here, 1]
            cos += edge[slot, 0] * x + edge[slot, 1] * y
            sin += edge[slot, 0] * y - edge[slot, 1] * x
        norm = np.sqrt(cos * cos + sin * sin)
        result[here, 0] = cos / norm if norm > 1e-12 else 1.0
        result[here, 1] = sin / norm if norm > 1e-12 else 0.0
    return result


@njit(cache=True)
def extend(indptr: I4, indices: I4, edge: F4, order: I4, local: I4, plane: F8) -> F8:
    """Place vertices that are NaN in `plane` by a placed neighbour's frame; the rest stay."""
    result = plane.copy()
    for here in range(len(order)):
        if not np.isnan(plane[here, 0]):
            continue
        vertex = order[here]
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = local[indices[slot]]
            if other < 0 or np.isnan(plane[other, 0]):
                continue
            near = order[other]
            cos = sin = x = y = 0.0
            for back in range(indptr[near], indptr[near + 1]):
                third = local[indices[back]]
                if indices[back] == vertex:
                    x, y = edge[back, 0], edge[back, 1]
                if third < 0 or np.isnan(plane[third, 0]):
                    continue
                dx, dy = plane[third, 0] - plane[other, 0], plane[third, 1] - plane[other, 1]
                cos += edge[back, 0] * dx + edge[back, 1] * dy
                sin += edge[back, 0] * dy - edge[back, 1] * dx
            norm = max(np.sqrt(cos * cos + sin * sin), 1e-12)
            result[here, 0] = plane[other, 0] + (cos * x - sin * y) / norm
            result[here, 1] = plane[other, 1] + (sin * x + cos * y) / norm
            break
    return result
