"""Geodesic distance on a dense mesh by fast marching, a little at a time.

Fast marching on triangles (Kimmel and Sethian 1998, "Computing geodesic paths on manifolds"),
made label-correcting: a vertex that is lowered again is marched from again, so obtuse
triangles and what other fronts have left behind need no special case. All lengths are in
dense-mesh steps.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from btfcore.patch.connectivity import Connectivity
from btfcore.types import F4, F8, I4

TINY = 1e-5  # a vertex is not lowered by less, in steps: the field's own rounding
SLACK = 2.0  # steps that a front goes on where another disc is nearer: 1 errs by .2, 2 by .002


def unreached(net: Connectivity) -> F4:
    """Field (N,) f4 that no march has touched: +inf everywhere."""
    return np.full(len(net.indptr) - 1, np.inf, np.float32)


def march(net: Connectivity, value: F4, seeds: I4, start: F8, limit: float) -> I4:
    """Lower a distance field from seeds, only where it becomes smaller and up to `limit`.

    value (N,) f4, changed in place: +inf where nothing came yet, -inf where no front may
    enter. seeds (n,) i4 start at `start` (n,) f8. Fronts are straight across a triangle
    (Kimmel and Sethian 1998, §4), so distances from a line are exact on a plane and those from
    a point up to a step too long. Returns the vertices that were lowered, ascending, (k,) i4.
    """
    return np.asarray(
        _march(
            net.indptr, net.indices, net.edge, net.face_ptr, net.face_of, net.faces, value, value,
            np.ascontiguousarray(seeds, np.int32), np.ascontiguousarray(start, np.float64),
            0.0, float(limit), 0.0, False,
        )
    )  # fmt: skip


def press(
    net: Connectivity,
    value: F4,
    own: F4,
    seeds: I4,
    start: F8,
    radius: float,
    limit: float,
) -> I4:
    """Lower a field to the signed distance from a disc's edge, where that is smaller.

    value (N,) f4, changed in place; own (N,) f4: +inf everywhere, and so again on return;
    seeds (n,) i4 lie at the distances `start` (n,) f8 from the disc's middle. Values are
    distance - radius, up to `limit`. Fronts are circles about the middle, unfolded into the
    plane of each triangle (Novotni and Klein 2002, "Computing geodesic distances on triangular
    meshes"): exact on developable surfaces as long as the shortest way is unique. What other
    discs have left in `value` stops the front `SLACK` steps on, and does not bend it. Returns
    the vertices that were lowered, ascending, (k,) i4.
    """
    return np.asarray(
        _march(
            net.indptr, net.indices, net.edge, net.face_ptr, net.face_of, net.faces, value, own,
            np.ascontiguousarray(seeds, np.int32), np.ascontiguousarray(start, np.float64),
            float(radius), float(limit), SLACK, True,
        )
    )  # fmt: skip


@njit(cache=True, nogil=True)
def _march(  # type: ignore[no-untyped-def]
    indptr, indices, edge, face_ptr, face_of, faces, value, own, seeds, start, radius, limit,
    slack, circles,
):  # fmt: skip
    """March `own` from the seeds; `value`, perhaps the same array, becomes least own - radius."""
    keys = np.empty(256 + len(seeds), np.float32)
    items = np.empty(256 + len(seeds), np.int32)
    lowered = np.empty(256 + len(seeds), np.int32)
    touched = np.empty(256 + len(seeds), np.int32)
    size = low = touch = 0
    for index in range(len(seeds)):
        vertex, found = seeds[index], start[index]
        if (
            found >= own[vertex] - TINY
            or found - radius > limit
            or found - radius >= value[vertex] + slack
        ):
            continue
        low, touch = _take(value, own, vertex, found, radius, lowered, low, touched, touch)
        _push(keys, items, size, own[vertex], vertex)
        size += 1
    while size > 0:
        key, here = keys[0], items[0]
        _pop(keys, items, size)
        size -= 1
        if key != own[here]:
            continue  # it was lowered again after this entry
        more = 2 * (face_ptr[here + 1] - face_ptr[here])
        if size + more > len(keys):
            keys, items = _longer(keys, size + more), _longer(items, size + more)
        if low + more > len(lowered):
            lowered = _longer(lowered, low + more)
        if touch + more > len(touched):
            touched = _longer(touched, touch + more)
        for place in range(face_ptr[here], face_ptr[here + 1]):
            face = face_of[place]
            corner = 0
            while faces[face, corner] != here:
                corner += 1
            one, two = faces[face, (corner + 1) % 3], faces[face, (corner + 2) % 3]
            to_one = to_two = across = -1.0
            for _ in range(2):
                # a corner before both ends of its base is met from elsewhere
                if own[one] > key or own[one] > own[two]:
                    if to_one < 0:
                        to_one = _length(indptr, indices, edge, here, one)
                    found = key + to_one
                    if not math.isinf(own[two]):
                        if to_two < 0:
                            to_two = _length(indptr, indices, edge, here, two)
                        if across < 0:
                            across = _length(indptr, indices, edge, one, two)
                        found = _crossing(
                            float(key), float(own[two]), to_two, to_one, across, circles
                        )
                    if (
                        found < own[one] - TINY
                        and found - radius <= limit
                        and found - radius < value[one] + slack
                    ):
                        low, touch = _take(
                            value, own, one, found, radius, lowered, low, touched, touch
                        )
                        _push(keys, items, size, own[one], one)
                        size += 1
                one, two, to_one, to_two = two, one, to_two, to_one
    if circles:
        for index in range(touch):
            own[touched[index]] = np.inf
    order = np.sort(lowered[:low])
    distinct = 0
    for index in range(low):
        if index == 0 or order[index] != order[index - 1]:
            order[distinct] = order[index]
            distinct += 1
    return order[:distinct].copy()


@njit(cache=True)
def _take(  # type: ignore[no-untyped-def]
    value, own, vertex, found, radius, lowered, low, touched, touch
):
    """Set a vertex, and list it as touched the first time and as lowered if it was."""
    if math.isinf(own[vertex]):
        touched[touch] = vertex
        touch += 1
    if found - radius < value[vertex] - TINY:
        lowered[low] = vertex
        low += 1
        value[vertex] = found - radius
    own[vertex] = found
    return low, touch


@njit(cache=True)
def _crossing(first, second, base, from_first, from_second, circles):  # type: ignore[no-untyped-def]
    """Value at a triangle's third corner from those at the ends of its base.

    base: its length; from_second, from_first: lengths of the sides from the ends. The better
    side where the front comes from outside the triangle.
    """
    along = min(first + from_first, second + from_second)
    if base <= 0.0:
        return along
    x = (from_first * from_first - from_second * from_second + base * base) / (2.0 * base)
    y = math.sqrt(max(from_first * from_first - x * x, 0.0))
    if circles:  # about a middle on the base's other side
        middle = (first * first - second * second + base * base) / (2.0 * base)
        below = math.sqrt(max(first * first - middle * middle, 0.0))
        if below + y <= 0.0:
            return along
        foot = middle + (x - middle) * below / (below + y)
        found = math.sqrt((x - middle) ** 2 + (y + below) ** 2)
    else:
        slope = (second - first) / base
        if abs(slope) >= 1.0:
            return along
        root = math.sqrt(1.0 - slope * slope)
        foot = x - y * slope / root
        found = first + slope * x + root * y
    return min(found, along) if 0.0 < foot < base else along


@njit(cache=True)
def _length(indptr, indices, edge, tail, head):  # type: ignore[no-untyped-def]
    """Length of the edge tail→head; infinite where the net has no such edge."""
    for slot in range(indptr[tail], indptr[tail + 1]):
        if indices[slot] == head:
            s, t = float(edge[slot, 0]), float(edge[slot, 1])
            return math.sqrt(s * s + t * t)
    return math.inf


@njit(cache=True)
def _longer(old, room):  # type: ignore[no-untyped-def]
    """Copy of an array, at least twice as long."""
    longer = np.empty(max(2 * len(old), room), old.dtype)
    longer[: len(old)] = old
    return longer


@njit(cache=True)
def _push(keys, items, size, key, item):  # type: ignore[no-untyped-def]
    """Sift a new item up a binary heap of `size` entries."""
    place = size
    while place > 0:
        parent = (place - 1) >> 1
        if keys[parent] <= key:
            break
        keys[place], items[place] = keys[parent], items[parent]
        place = parent
    keys[place], items[place] = key, item


@njit(cache=True)
def _pop(keys, items, size):  # type: ignore[no-untyped-def]
    """Take the root out of a binary heap of `size` entries; the caller has read it."""
    last = size - 1
    key, item = keys[last], items[last]
    place = 0
    while True:
        child = 2 * place + 1
        if child >= last:
            break
        if child + 1 < last and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[place], items[place] = keys[child], items[child]
        place = child
    keys[place], items[place] = key, item
