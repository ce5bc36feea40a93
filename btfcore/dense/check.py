"""Compares the topology of a dense mesh, component by component, with the input's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.mesh.topology import fans, find, join, sorted_half_edges, twins
from btfcore.progress import Progress, blocks, silent
from btfcore.types import I4, I8, Frozen

_LABEL = "checking the mesh"
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Counts(Frozen):
    """Per component: faces, Euler number over the used vertices, boundary loops; (C,) i8."""

    faces: I8
    euler: I8
    loops: I8


def input_counts(faces: I4, twin: I4, component: I4, vertices: int) -> Counts:
    """Counts of a manifold mesh; twin (3F,) i4, component (F,) i4."""
    of_corner = np.repeat(component, 3)
    count = int(component.max()) + 1
    corner = faces.reshape(-1)
    owner = np.full(vertices, -1, np.int32)
    owner[corner] = of_corner
    points = np.bincount(owner[owner >= 0], minlength=count)
    open_ = twin < 0
    rim = np.bincount(of_corner[open_], minlength=count)
    number = np.bincount(component, minlength=count)
    ends = np.stack([corner, np.roll(faces, -1, axis=1).reshape(-1)], axis=1)[open_]
    return Counts(
        number,
        points + number - (3 * number + rim) // 2,
        _loops(np.ascontiguousarray(ends, np.int32), owner, count),
    )


def dense_counts(
    faces: I4, border: Flags, component: I4, count: int, *, progress: Progress = silent
) -> tuple[Counts, Flags]:
    """Counts of a dense mesh, and its vertices at which it is no manifold: (N,) bool.

    border (N,) bool marks the vertices on texel walks: all others lie inside the grid, so
    only triangles that touch a border are looked at one by one. component (N,) i4.
    """
    near = faces[border[faces].any(axis=1)]
    progress(0.3, _LABEL)
    wrong = np.zeros(len(border), bool)
    low, high, order = sorted_half_edges(near)
    single, crowded = _runs(near.reshape(-1), low, high, order)
    known = border[low] & border[high]  # all triangles at these edges are in `near`
    for bad in (low[crowded], high[crowded]):
        wrong[bad] = True
    fan, fan_count = fans(twins(near))
    first = np.full(fan_count, -1, np.int32)
    first[fan[::-1]] = near.reshape(-1)[::-1]
    wrong |= (np.bincount(first, minlength=len(border)) > 1) & border
    rim = np.flatnonzero(single & known)
    corner = near.reshape(-1)
    ends = np.stack([corner[rim], np.roll(near, -1, axis=1).reshape(-1)[rim]], axis=1)
    progress(0.5, _LABEL)
    number = np.bincount(component[faces[:, 0]], minlength=count)
    used = np.zeros(len(border), bool)
    for begin, end in blocks(len(faces), 1 << 20, progress, _LABEL, 0.6, 0.9):
        used[faces[begin:end]] = True
    open_ = np.bincount(component[ends[:, 0]], minlength=count)
    points = np.bincount(component[used], minlength=count)
    euler = points + number - (3 * number + open_) // 2
    loops = _loops(np.ascontiguousarray(ends, np.int32), component, count)
    return Counts(number, euler, loops), wrong


@njit(cache=True)
def _runs(corner: I4, low: I4, high: I4, order: I4) -> tuple[np.ndarray, np.ndarray]:
    """Half-edges that are alone on their edge, and those that others contradict."""
    single = np.zeros(len(order), np.bool_)
    crowded = np.zeros(len(order), np.bool_)
    begin = 0
    while begin < len(order):
        end = begin + 1
        one = order[begin]
        while end < len(order) and low[order[end]] == low[one] and high[order[end]] == high[one]:
            end += 1
        loop = low[one] == high[one]
        if end - begin == 1 and not loop:
            single[one] = True
        elif loop or end - begin > 2 or corner[one] == corner[order[begin + 1]]:
            crowded[one] = True
        begin = end
    return single, crowded


@njit(cache=True)
def _loops(ends: I4, component: I4, count: int) -> I8:
    """Connected curves of boundary edges (B, 2) per component of their vertices."""
    parent = np.arange(len(component)).astype(np.int32)
    for edge in range(len(ends)):
        join(parent, ends[edge, 0], ends[edge, 1])
    loops = np.zeros(count, np.int64)
    seen = np.zeros(len(component), np.bool_)
    for edge in range(len(ends)):
        root = find(parent, ends[edge, 0])
        if not seen[root]:
            seen[root] = True
            loops[component[root]] += 1
    return loops
