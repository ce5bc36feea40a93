"""Faces on the same three vertices: copies, double-sided sheets and folds without thickness."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from btfcore.mesh.topology import components, edges, sorted_half_edges
from btfcore.types import I4


def drop_repeated(faces: I4) -> tuple[I4, int, int]:
    """Faces without those that `unrepeated` leaves out, and the counts that it gives."""
    kept, copies, folded = unrepeated(faces)
    return faces[kept], copies, folded


def unrepeated(faces: I4) -> tuple[NDArray[np.int64], int, int]:
    """Keep one face, or none, of each group on the same three vertices.

    Of a group the first face of the prevailing winding stays. Where the two windings balance,
    the group is one layer of a double-sided sheet, of which the first face stays; or, in a
    component that is closed (every edge has an even number of faces) and has other faces too,
    a fold without thickness, which goes whole so that the rest stays closed.
    Returns (faces to keep, ascending, number of copies dropped, number of folded faces dropped).
    """
    group, count = _groups(faces)
    if count == len(faces):
        return np.arange(len(faces)), 0, 0
    net = np.bincount(group, _signs(faces), count)
    label = components(faces)
    number = int(label.max()) + 1
    solid = _closed(faces, label, number)
    has_others = np.zeros(number, bool)
    has_others[label[net[group] != 0]] = True
    folded = (net[group] == 0) & (solid & has_others)[label]
    wanted = ~folded & (_signs(faces) == np.where(net[group] < 0, -1, 1))
    # a balanced group keeps its first face, whichever way it is wound
    wanted |= ~folded & (net[group] == 0)
    first = np.full(count, len(faces))
    places = np.flatnonzero(wanted)
    np.minimum.at(first, group[places], places)
    kept = np.sort(first[first < len(faces)])
    copies = len(faces) - len(kept) - int(folded.sum())
    return kept, copies, int(folded.sum())


def _groups(faces: I4) -> tuple[NDArray[np.int64], int]:
    """Give faces on the same vertices the same number."""
    ordered = np.sort(faces, axis=1)
    order = np.lexsort(ordered.T)
    fresh = np.ones(len(faces), bool)
    fresh[1:] = (ordered[order[1:]] != ordered[order[:-1]]).any(axis=1)
    group = np.empty(len(faces), np.int64)
    group[order] = np.cumsum(fresh) - 1
    return group, int(fresh.sum())


def _signs(faces: I4) -> NDArray[np.int64]:
    """+1 where a face's vertices ascend when read from the smallest on, else -1."""
    start = faces.argmin(axis=1)
    rows = np.arange(len(faces))
    ascending = faces[rows, (start + 1) % 3] < faces[rows, (start + 2) % 3]
    return np.where(ascending, 1, -1)


def _closed(faces: I4, label: I4, number: int) -> NDArray[np.bool_]:
    """Whether every edge of each component has an even number of faces."""
    _, counts = edges(faces)
    order = sorted_half_edges(faces)[2]
    odd = order[np.repeat(counts % 2 == 1, counts)]
    closed = np.ones(number, bool)
    closed[label[odd // 3]] = False
    return closed
