"""Barycentric interpolation in the triangulated chart: three directions a query.

Linear in the chart within a triangle, continuous everywhere above the horizon, exact at the
directions. A query outside the triangles takes the nearest point of their border.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.btf.directions import HORIZON
from btfcore.btf.interpolation.triangulation import Triangulation, chart
from btfcore.types import F8, I4

OUTSIDE = 1e-6  # distance in the chart past the border that is not worth a word
_INSIDE = -1e-10
_SNAP = 1e-9


def barycentric_weights(
    net: Triangulation,
    query: NDArray[Any],
    index: I4,
    weight: NDArray[Any],
    outside: NDArray[np.bool_],
) -> None:
    """Fill `index` and `weight` (n, 3) for query vectors (n, 3), and which were `outside` (n,)."""
    _barycentric(
        *(net.triangles, net.affine, net.edges, net.segment),
        *(net.low, net.scale, net.side, net.first, net.candidates),
        *(query, index, weight, outside),
    )


@njit(cache=True, nogil=True)
def _barycentric(  # type: ignore[no-untyped-def]
    triangles, affine, edges, segment, low, scale, side, first, candidates,
    query, index, weight, outside,
):  # fmt: skip
    for q in range(len(query)):
        x, y, z = float(query[q, 0]), float(query[q, 1]), float(query[q, 2])
        length = np.sqrt(x * x + y * y + z * z)
        outside[q] = False
        for slot in range(3):
            index[q, slot] = edges[0, 0]
            weight[q, slot] = 0.0
        if not z >= HORIZON * length or length == 0.0:
            continue  # below the horizon, or no direction at all
        u, v = x / (length + z), y / (length + z)
        column, row = int(np.floor((u - low[0]) * scale)), int(np.floor((v - low[1]) * scale))
        best, most, one, two = -1, _INSIDE, 0.0, 0.0
        if 0 <= column < side and 0 <= row < side:
            cell = row * side + column
            for place in range(first[cell], first[cell + 1]):
                k = candidates[place]
                du, dv = u - affine[k, 0], v - affine[k, 1]
                a = affine[k, 2] * du + affine[k, 3] * dv
                b = affine[k, 4] * du + affine[k, 5] * dv
                least = min(a, b, 1.0 - a - b)
                if least > most:
                    best, most, one, two = k, least, a, b
                if least >= 0.0:
                    break
        if best >= 0:
            one, two = _snapped(one), _snapped(two)
            three = _snapped(1.0 - one - two)
            total = one + two + three
            for slot in range(3):
                index[q, slot] = triangles[best, slot]
            weight[q, 0], weight[q, 1], weight[q, 2] = one / total, two / total, three / total
            continue
        nearest, share, edge = np.inf, 0.0, 0
        for k in range(len(edges)):
            du, dv = u - segment[k, 0], v - segment[k, 1]
            along = (du * segment[k, 2] + dv * segment[k, 3]) * segment[k, 4]
            along = min(max(along, 0.0), 1.0)
            du, dv = du - along * segment[k, 2], dv - along * segment[k, 3]
            distance = du * du + dv * dv
            if distance < nearest:
                nearest, share, edge = distance, along, k
        share = _snapped(share)
        index[q, 0], index[q, 1] = edges[edge, 0], edges[edge, 1]
        weight[q, 0], weight[q, 1] = 1.0 - share, share
        outside[q] = nearest > OUTSIDE * OUTSIDE


@njit(cache=True, nogil=True)
def _snapped(share):  # type: ignore[no-untyped-def]
    """Take rounding off, so that a sample's own direction has one weight and no specks."""
    if share < _SNAP:
        return 0.0
    return 1.0 if share > 1.0 - _SNAP else share


def barycentric_weights_plain(net: Triangulation, query: F8) -> tuple[I4, F8, NDArray[np.bool_]]:
    """Twin of `barycentric_weights` in plain numpy that tries every triangle and edge."""
    count = len(query)
    index = np.full((count, 3), net.edges[0, 0], np.int32)
    weight = np.zeros((count, 3))
    outside = np.zeros(count, bool)
    length = np.linalg.norm(query, axis=1)
    seen = np.flatnonzero((query[:, 2] >= HORIZON * length) & (length > 0))
    point = chart(query[seen])
    away = point[:, None] - net.affine[None, :, :2]  # (n, T, 2)
    one, two = (away * net.affine[:, 2:4]).sum(axis=2), (away * net.affine[:, 4:]).sum(axis=2)
    all_three = np.stack([one, two, 1 - one - two], axis=2)
    least = all_three.min(axis=2)
    inside = np.zeros(len(seen), bool)
    if len(net.triangles):
        best = least.argmax(axis=1)
        inside = least.max(axis=1) > _INSIDE
        share = _trimmed(all_three[np.arange(len(seen)), best][inside])
        index[seen[inside]] = net.triangles[best[inside]]
        weight[seen[inside]] = share / share.sum(axis=1, keepdims=True)
    start, offset, inverse = net.segment[:, :2], net.segment[:, 2:4], net.segment[:, 4]
    away = point[~inside][:, None] - start[None]
    along = np.clip((away * offset).sum(axis=2) * inverse, 0, 1)
    distance = ((away - along[:, :, None] * offset) ** 2).sum(axis=2)
    edge = distance.argmin(axis=1)
    rows = np.arange(len(edge))
    share = _trimmed(along[rows, edge])
    index[seen[~inside], :2] = net.edges[edge]
    weight[seen[~inside], :2] = np.stack([1 - share, share], axis=1)
    outside[seen[~inside]] = distance[rows, edge] > OUTSIDE**2
    return index, weight, outside


def _trimmed(share: F8) -> F8:
    return np.where(share < _SNAP, 0.0, np.where(share > 1 - _SNAP, 1.0, share))
