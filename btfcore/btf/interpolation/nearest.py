"""The papers' nearest directions, weighted by the inverse squared angle (Tong §5, Zhou §III-B).

Exact at the directions, but not continuous: where the set of nearest ones changes, so does the
value by a jump. Tong takes 4 views and 4 lights; the weights are ours, the paper names none.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.btf.directions import HORIZON
from btfcore.types import F8, I4

_HIT = 1e-18  # squared angle below which the query is the direction itself


def nearest_weights(
    directions: F8, nodes: I4, query: NDArray[Any], index: I4, weight: NDArray[Any]
) -> None:
    """Fill `index` and `weight` (n, m) with the m nearest of `directions[nodes]`, nearest first.

    query : (n, 3) vectors; equal distances go to the lower node; m is at most len(nodes).
    """
    _nearest(directions[nodes], nodes, query, index, weight)


@njit(cache=True, nogil=True)
def _nearest(points, nodes, query, index, weight):  # type: ignore[no-untyped-def]
    slots = index.shape[1]
    chord = np.empty(slots)
    for q in range(len(query)):
        x, y, z = float(query[q, 0]), float(query[q, 1]), float(query[q, 2])
        length = np.sqrt(x * x + y * y + z * z)
        for slot in range(slots):
            index[q, slot] = nodes[slot]
            weight[q, slot] = 0.0
            chord[slot] = np.inf
        if not z >= HORIZON * length or length == 0.0:
            continue  # below the horizon, or no direction at all
        x, y, z = x / length, y / length, z / length
        for k in range(len(points)):
            dx, dy, dz = x - points[k, 0], y - points[k, 1], z - points[k, 2]
            apart = dx * dx + dy * dy + dz * dz
            if apart < chord[slots - 1]:
                slot = slots - 1
                while slot > 0 and apart < chord[slot - 1]:
                    chord[slot], index[q, slot] = chord[slot - 1], index[q, slot - 1]
                    slot -= 1
                chord[slot], index[q, slot] = apart, nodes[k]
        least = _squared_angle(chord[0])
        weight[q, 0] = 1.0
        if least < _HIT:
            continue
        total = 1.0
        for slot in range(1, slots):
            chord[slot] = least / _squared_angle(chord[slot])
            total += chord[slot]
        weight[q, 0] = 1.0 / total
        for slot in range(1, slots):
            weight[q, slot] = chord[slot] / total


@njit(cache=True, nogil=True)
def _squared_angle(chord):  # type: ignore[no-untyped-def]
    """Squared angle of a squared chord of the unit sphere."""
    half = np.arcsin(min(1.0, np.sqrt(chord) / 2))
    return 4.0 * half * half


def nearest_weights_plain(directions: F8, nodes: I4, query: F8, slots: int) -> tuple[I4, F8]:
    """Twin of `nearest_weights` in plain numpy: (index (n, slots) i4, weight (n, slots) f8)."""
    index = np.tile(nodes[:slots], (len(query), 1)).astype(np.int32)
    weight = np.zeros((len(query), slots))
    length = np.linalg.norm(query, axis=1)
    seen = np.flatnonzero((query[:, 2] >= HORIZON * length) & (length > 0))
    unit = query[seen] / length[seen, None]
    away = (unit[:, None] - directions[nodes][None]) ** 2
    chord = away[:, :, 0] + away[:, :, 1] + away[:, :, 2]
    order = np.argsort(chord, axis=1, kind="stable")[:, :slots]
    angle = (2 * np.arcsin(np.minimum(1, np.sqrt(np.take_along_axis(chord, order, 1)) / 2))) ** 2
    hit = angle[:, 0] < _HIT
    angle[hit] = np.where(np.arange(slots) == 0, 1.0, np.inf)
    share = angle[:, :1] / angle
    index[seen] = nodes[order]
    weight[seen] = share / share.sum(axis=1, keepdims=True)
    return index, weight
