"""Interpolation on rings: linear in phi along the two rings around a query, in theta between.

Continuous everywhere above the horizon, exact at the directions. Where none lies on the normal,
a made-up one is put there whose value is the mean of the first ring's. The usual way, a blend of
the first ring at phi and at phi + 180 degrees, has no single value on the normal: it depends on
the side that one comes from.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.btf.directions import HORIZON
from btfcore.btf.interpolation.rings import Rings
from btfcore.types import F8, I4

_SNAP = 1e-9


def grid_weights(rings: Rings, query: NDArray[Any], index: I4, weight: NDArray[Any]) -> None:
    """Fill `index` and `weight` (n, 4) for query vectors (n, 3): two of each of two rings."""
    _grid(rings.theta, rings.start, rings.phi, rings.member, query, index, weight)


@njit(cache=True, nogil=True)
def _grid(theta, start, phi, member, query, index, weight):  # type: ignore[no-untyped-def]
    last = len(theta) - 1
    around = 2 * np.pi
    for q in range(len(query)):
        x, y, z = float(query[q, 0]), float(query[q, 1]), float(query[q, 2])
        across = np.sqrt(x * x + y * y)
        for slot in range(4):
            index[q, slot] = member[start[last]]
            weight[q, slot] = 0.0
        if not z >= HORIZON * np.sqrt(across * across + z * z) or across + abs(z) == 0.0:
            continue  # below the horizon, or no direction at all
        polar, azimuth = np.arctan2(across, z), np.arctan2(y, x)
        if azimuth < 0.0:
            azimuth += around
        ring = 0
        while ring < last and theta[ring + 1] <= polar:
            ring += 1
        outer = 0.0
        if ring < last:
            outer = _snapped((polar - theta[ring]) / (theta[ring + 1] - theta[ring]))
        for side in range(2 if ring < last else 1):
            part = outer if side == 1 else 1.0 - outer
            first, count = start[ring + side], start[ring + side + 1] - start[ring + side]
            here, after, share = 0, 0, 0.0
            if count > 1:
                # one step of a regular ring, then a walk, as azimuths may be rounded
                here = int((azimuth - phi[first]) * count / around)
                here = min(max(here, 0), count - 1)
                while here >= 0 and phi[first + here] > azimuth:
                    here -= 1
                while here < count - 1 and phi[first + here + 1] <= azimuth:
                    here += 1
                low = phi[first + here] if here >= 0 else phi[first + count - 1] - around
                high = phi[first + here + 1] if here < count - 1 else phi[first] + around
                share = _snapped((azimuth - low) / (high - low))
                after = here + 1 if here < count - 1 else 0
                here = here if here >= 0 else count - 1
            index[q, 2 * side] = member[first + here]
            index[q, 2 * side + 1] = member[first + after]
            weight[q, 2 * side] = part * (1.0 - share)
            weight[q, 2 * side + 1] = part * share


@njit(cache=True, nogil=True)
def _snapped(share):  # type: ignore[no-untyped-def]
    """Take rounding off, so that a sample's own direction has one weight and no specks."""
    if share < _SNAP:
        return 0.0
    return 1.0 if share > 1.0 - _SNAP else share


def grid_weights_plain(rings: Rings, query: F8) -> tuple[I4, F8]:
    """Twin of `grid_weights` in plain numpy: (index (n, 4) i4, weight (n, 4) f8)."""
    index = np.full((len(query), 4), rings.member[rings.start[-2]], np.int32)
    weight = np.zeros((len(query), 4))
    length = np.linalg.norm(query, axis=1)
    seen = (query[:, 2] >= HORIZON * length) & (length > 0)
    polar = np.arctan2(np.hypot(query[:, 0], query[:, 1]), query[:, 2])
    azimuth = np.arctan2(query[:, 1], query[:, 0])
    azimuth[azimuth < 0] += 2 * np.pi
    ring = np.searchsorted(rings.theta, polar, side="right") - 1
    for k in range(len(rings.theta)):
        chosen = np.flatnonzero(seen & (ring == k))
        outer = np.zeros(len(chosen))
        if k + 1 < len(rings.theta):
            outer = _trimmed((polar[chosen] - rings.theta[k]) / np.diff(rings.theta)[k])
        for side in range(min(2, len(rings.theta) - k)):
            part = outer if side else 1 - outer
            members = rings.member[rings.start[k + side] : rings.start[k + side + 1]]
            own = rings.phi[rings.start[k + side] : rings.start[k + side + 1]]
            wrapped = np.concatenate([[own[-1] - 2 * np.pi], own, [own[0] + 2 * np.pi]])
            here = np.searchsorted(wrapped, azimuth[chosen], side="right") - 1
            share = (azimuth[chosen] - wrapped[here]) / np.diff(wrapped)[here]
            share = _trimmed(share) if len(members) > 1 else np.zeros(len(chosen))
            index[chosen, 2 * side] = members[(here - 1) % len(members)]
            index[chosen, 2 * side + 1] = members[here % len(members)]
            weight[chosen, 2 * side] = part * (1 - share)
            weight[chosen, 2 * side + 1] = part * share
    return index, weight


def _trimmed(share: F8) -> F8:
    return np.where(share < _SNAP, 0.0, np.where(share > 1 - _SNAP, 1.0, share))


def spread_pole(rings: Rings, index: I4, weight: NDArray[Any]) -> tuple[I4, NDArray[Any]]:
    """Share the made-up pole's weight out among the first ring: (n, max(4, its size)) each."""
    ring = rings.innermost
    width = max(4, len(ring))
    wide = np.zeros((len(index), width), np.int32)
    wide[:, :4] = index
    wide_weight = np.zeros((len(index), width), weight.dtype)
    wide_weight[:, :4] = weight
    rows = np.flatnonzero(index[:, 0] == rings.count)
    wide[rows] = np.resize(ring, width)
    even = weight[rows, 0] / len(ring)
    shared = np.zeros((len(rows), width), weight.dtype)
    shared[:, : len(ring)] = even[:, None]
    place = np.zeros(rings.count, np.int64)
    place[ring] = np.arange(len(ring))
    for slot in (2, 3):
        shared[np.arange(len(rows)), place[index[rows, slot]]] += weight[rows, slot]
    wide_weight[rows] = shared
    return wide, wide_weight
