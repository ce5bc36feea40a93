"""Geodesic discs by the discrete exponential map, grown only as far as they are needed.

The map of `btfcore.patch.expmap` on a disc of a radius in steps instead of whole breadth-first
levels, of which a regular grid needs twice as many vertices for the same reach. A disc can be
grown on; what was there keeps its coordinates, bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.patch.connectivity import Connectivity
from btfcore.types import F8, I4

SWEEPS = 2
DETOUR = 1.5  # ways along edges over straight ones: √2 on a grid with diagonals one way


@dataclass(frozen=True, eq=False)
class Disc:
    """A piece of the surface in the plane of its first vertex's frame.

    order (n,) i4: vertices by breadth-first level; plane (n, 2) f8 in dense-mesh steps; frame
    (n, 2) f8: cos and sin of the angle that takes directions of a vertex's frame into the
    plane; way (n,) f8: length in steps of a way along edges from the centre; open (n,) bool:
    vertices some of whose neighbours may be missing. full: there is nothing beyond, or `limit`
    vertices were reached.
    """

    order: I4
    plane: F8
    frame: F8
    way: F8
    open: NDArray[np.bool_]
    full: bool


def disc(net: Connectivity, local: I4, seed: int, radius: float, limit: int) -> Disc:
    """Disc of `radius` steps around `seed`, its rim the first vertices beyond.

    Where the surface folds, the map may lead back to its centre; the disc ends there by the
    length of the ways along edges.

    local (N,) i4: -1 everywhere, also afterwards. Growth stops after the level that makes
    more than `limit` vertices.
    """
    start = Disc(
        np.array([seed], np.int32), np.zeros((1, 2)), np.array([[1.0, 0.0]]),
        np.zeros(1), np.ones(1, np.bool_), False,
    )  # fmt: skip
    return grown(net, local, start, radius, limit)


def grown(net: Connectivity, local: I4, part: Disc, radius: float, limit: int) -> Disc:
    """Grow a disc on to `radius` steps; its vertices come first and stay where they are."""
    order, plane, frame, way, open_, full = _grown(
        net.indptr, net.indices, net.edge, net.turn, local, part.order, part.plane, part.frame,
        part.way, part.open, radius, limit,
    )  # fmt: skip
    return Disc(order, plane, frame, way, open_, bool(full))


@njit(cache=True)
def _grown(  # type: ignore[no-untyped-def]
    indptr, indices, edge, turn, local, first, plane0, frame0, way0, open0, radius, limit
):
    count = fixed = len(first)
    room = max(4 * count, 1024)
    order = np.empty(room, np.int32)
    plane, frame, way = np.empty((room, 2)), np.empty((room, 2)), np.empty(room)
    open_ = np.ones(room, np.bool_)
    order[:count], plane[:count], frame[:count] = first, plane0, frame0
    way[:count], open_[:count] = way0, open0
    for here in range(count):
        local[order[here]] = here
    begin, full = 0, False
    while begin < count:
        below = count
        if below > limit:
            full = True
            break
        for here in range(begin, below):
            x, y = plane[here, 0], plane[here, 1]
            if not open_[here] or x * x + y * y > radius * radius or way[here] > DETOUR * radius:
                continue
            open_[here] = False
            vertex = order[here]
            for slot in range(indptr[vertex], indptr[vertex + 1]):
                other = indices[slot]
                if local[other] >= 0:
                    continue
                if count == room:
                    room *= 2
                    order = _longer(order, np.empty(room, np.int32))
                    plane = _longer(plane, np.empty((room, 2)))
                    frame = _longer(frame, np.empty((room, 2)))
                    way = _longer(way, np.empty(room))
                    open_ = _longer(open_, np.ones(room, np.bool_))
                local[other] = count
                order[count] = other
                count += 1
        for here in range(below, count):
            _predict(indptr, indices, edge, turn, order, local, here, below, plane, frame, way)
        begin = below
    _sweep(indptr, indices, edge, turn, order, local, max(fixed, 1), count, plane, frame)
    for here in range(count):
        local[order[here]] = -1
    return (
        order[:count].copy(), plane[:count].copy(), frame[:count].copy(), way[:count].copy(),
        open_[:count].copy(), full or not open_[:count].any(),
    )  # fmt: skip


@njit(cache=True)
def _sweep(indptr, indices, edge, turn, order, local, begin, count, plane, frame):  # type: ignore[no-untyped-def]
    """Predict the vertices from `begin` on by all their neighbours, `SWEEPS` times.

    What is read of the edges is the same in every sweep, so it is gathered once, in a row.
    """
    start = np.zeros(count - begin + 1, np.int64)
    for here in range(begin, count):
        vertex = order[here]
        known = 0
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            known += local[indices[slot]] >= 0
        start[here - begin + 1] = start[here - begin] + known
    near = np.empty(start[-1], np.int32)
    ends = np.empty((start[-1], 4), np.float32)
    at = 0
    for here in range(begin, count):
        vertex = order[here]
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = local[indices[slot]]
            if other >= 0:
                near[at] = other
                ends[at, 0], ends[at, 1] = turn[slot, 0], turn[slot, 1]
                ends[at, 2], ends[at, 3] = edge[slot, 0], edge[slot, 1]
                at += 1
    for _ in range(SWEEPS):
        for here in range(begin, count):
            x = y = cos = sin = 0.0
            first, last = start[here - begin], start[here - begin + 1]
            for at in range(first, last):
                other = near[at]
                c = frame[other, 0] * ends[at, 0] + frame[other, 1] * ends[at, 1]
                s = frame[other, 1] * ends[at, 0] - frame[other, 0] * ends[at, 1]
                x += plane[other, 0] - (c * ends[at, 2] - s * ends[at, 3])
                y += plane[other, 1] - (s * ends[at, 2] + c * ends[at, 3])
                cos += c
                sin += s
            votes = last - first
            plane[here, 0], plane[here, 1] = x / votes, y / votes
            norm = np.sqrt(cos * cos + sin * sin)
            if norm > 1e-12:
                frame[here, 0], frame[here, 1] = cos / norm, sin / norm
            else:
                frame[here, 0], frame[here, 1] = 1.0, 0.0


@njit(cache=True)
def _longer(short, longer):  # type: ignore[no-untyped-def]
    longer[: len(short)] = short
    return longer


@njit(cache=True)
def _predict(indptr, indices, edge, turn, order, local, here, below, plane, frame, way):  # type: ignore[no-untyped-def]
    """Place vertex `here` at the mean of what its neighbours before `below` predict; its way."""
    vertex = order[here]
    x = y = cos = sin = 0.0
    votes = 0
    least = np.inf
    for slot in range(indptr[vertex], indptr[vertex + 1]):
        other = local[indices[slot]]
        if other < 0 or other >= below:
            continue
        c = frame[other, 0] * turn[slot, 0] + frame[other, 1] * turn[slot, 1]
        s = frame[other, 1] * turn[slot, 0] - frame[other, 0] * turn[slot, 1]
        x += plane[other, 0] - (c * edge[slot, 0] - s * edge[slot, 1])
        y += plane[other, 1] - (s * edge[slot, 0] + c * edge[slot, 1])
        cos += c
        sin += s
        votes += 1
        along, across = np.float64(edge[slot, 0]), np.float64(edge[slot, 1])
        least = min(least, way[other] + np.sqrt(along * along + across * across))
    way[here] = least
    plane[here, 0], plane[here, 1] = x / votes, y / votes
    norm = np.sqrt(cos * cos + sin * sin)
    if norm > 1e-12:
        frame[here, 0], frame[here, 1] = cos / norm, sin / norm
    else:
        frame[here, 0], frame[here, 1] = 1.0, 0.0
