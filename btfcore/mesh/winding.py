"""Coherent winding: agreeing neighbours, and outward normals where a surface is closed."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.mesh.topology import components, sorted_half_edges, twins
from btfcore.types import F8, I4, I8


def agree(faces: I4) -> tuple[I4, int]:
    """Reverse faces so that neighbours across two-faced edges agree, as far as they can.

    Breadth first from the lowest face of each patch; in each patch the smaller part is
    reversed. On a one-sided surface the faces where the search meets itself go on
    disagreeing. Returns the faces and how many were reversed.
    """
    low, high, order = sorted_half_edges(faces)
    reverse = _disagreeing(faces.reshape(-1), low, high, order)
    turned = np.where(reverse[:, None], faces[:, ::-1], faces)
    return np.ascontiguousarray(turned), int(reverse.sum())


def outward(vertices: F8, faces: I4) -> tuple[I4, int]:
    """Reverse every closed component that encloses a negative volume.

    faces must be manifold and agree. Returns the faces and how many components were turned.
    """
    label = components(faces)
    count = int(label.max()) + 1
    closed = np.ones(count, bool)
    closed[label[(twins(faces).reshape(-1, 3) < 0).any(axis=1)]] = False
    first = np.full(count, len(faces))
    np.minimum.at(first, label, np.arange(len(faces)))
    corner = vertices[faces] - vertices[faces[first[label], 0]][:, None]  # (F, 3, 3)
    volume = np.einsum("fi,fi->f", corner[:, 0], np.cross(corner[:, 1], corner[:, 2]))
    inside_out = closed & (np.bincount(label, volume, count) < 0)
    turned = np.where(inside_out[label][:, None], faces[:, ::-1], faces)
    return np.ascontiguousarray(turned), int(inside_out.sum())


@njit(cache=True)
def _mates(low: I4, high: I4, order: I4) -> I8:
    """Find the other half-edge of every two-faced edge, whatever its direction; else -1."""
    mate = np.full(len(order), -1, np.int64)
    place = 0
    while place < len(order):
        here = order[place]
        stop = place + 1
        while stop < len(order):
            other = order[stop]
            if low[other] != low[here] or high[other] != high[here]:
                break
            stop += 1
        if stop - place == 2:
            mate[here] = order[place + 1]
            mate[order[place + 1]] = here
        place = stop
    return mate


@njit(cache=True)
def _disagreeing(origin: I4, low: I4, high: I4, order: I4) -> NDArray[np.bool_]:
    """Flag of every face that must be reversed, (F,) bool."""
    mate = _mates(low, high, order)
    count = len(order) // 3
    reverse = np.zeros(count, np.bool_)
    seen = np.zeros(count, np.bool_)
    queue = np.empty(count, np.int64)
    for seed in range(count):
        if seen[seed]:
            continue
        seen[seed] = True
        queue[0] = seed
        head, tail, turned = 0, 1, 0
        while head < tail:
            face = queue[head]
            head += 1
            turned += reverse[face]
            for edge in range(3 * face, 3 * face + 3):
                other = mate[edge]
                if other >= 0 and not seen[other // 3]:
                    seen[other // 3] = True
                    reverse[other // 3] = reverse[face] ^ (origin[edge] == origin[other])
                    queue[tail] = other // 3
                    tail += 1
        if 2 * turned > tail:
            for place in range(tail):
                reverse[queue[place]] = not reverse[queue[place]]
    return reverse
