"""Which sample goes where: regions, their borders, and how far a sample may cross one.

A hard border is cut into the connectivity: patches, seams and their costs end there. Across a
soft border the edges stay, and each sample may reach some levels into the other's region, so
that a minimum cut finds the line on which the two meet (Kwatra et al. 2003, §3, between
patches of two samples instead of one).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.errors import InvalidParameter
from btfcore.patch.connectivity import Connectivity, faces_at_vertices
from btfcore.types import I4, U2, Frozen


@dataclass(frozen=True, eq=False)
class Borders(Frozen):
    """Which borders between regions are hard.

    hard : those between regions of different samples, unless `pairs` (P, 2) i4 of regions,
    with `kinds` (P,) bool (True: hard), says otherwise. Regions of the same sample have no
    border between them but one that `pairs` names hard.
    """

    hard: bool
    pairs: I4
    kinds: NDArray[np.bool_]

    @classmethod
    def all(cls, hard: bool) -> Borders:
        """All borders hard, or all soft."""
        return cls(hard, np.zeros((0, 2), np.int32), np.zeros(0, bool))


@dataclass(frozen=True, eq=False)
class Layout(Frozen):
    """Samples of the vertices of one dense mesh.

    home (N,) u2: sample that each vertex shall have; allowed (R, N) bool: which sample it may
    take; net: connectivity, cut along the hard borders.
    """

    home: U2
    allowed: NDArray[np.bool_]
    net: Connectivity


def lay_out(
    net: Connectivity, region: I4, sample: Sequence[int], borders: Borders, width: int
) -> Layout:
    """Lay samples out over the regions of a dense mesh.

    region (N,) i4: region of every vertex; sample: the sample of each region, numbered from
    0 without gaps; width: levels that a sample may reach across a soft border. It reaches no
    further than half the depth of the part of the region that lies there, so that this part
    keeps a core of its own. Raises `InvalidParameter` for numbers out of range.
    """
    of = np.asarray(sample, np.int32)
    count = len(net.indptr) - 1
    if region.shape != (count,) or (count and not 0 <= region.min() <= region.max() < len(of)):
        raise InvalidParameter(f"regions of shape {region.shape} for {count} vertices")
    if not 0 <= of.min() <= of.max() < 2**16:
        raise InvalidParameter(f"samples {of.min()} … {of.max()} of regions")
    region = np.ascontiguousarray(region, np.int32)
    home = of[region]
    apart = _hard_edges(
        net.indptr, net.indices, region, of, borders.hard, borders.pairs, borders.kinds
    )
    if apart.any():
        net = _cut(net, apart)
    samples = int(of.max()) + 1
    allowed = np.zeros((samples, count), bool)
    allowed[home, np.arange(count)] = True
    if samples > 1 and width > 0:
        depth = _depth(net.indptr, net.indices, home)
        reach = np.minimum(_core(net.indptr, net.indices, home, depth) // 2, width)
        for index in range(samples):
            _spread(
                net.indptr, net.indices, region, of, home, index, depth, reach,
                borders.hard, borders.pairs, borders.kinds, allowed[index],
            )  # fmt: skip
    return Layout(home.astype(np.uint16), allowed, net)


def _cut(net: Connectivity, apart: NDArray[np.bool_]) -> Connectivity:
    """Connectivity without the half-edges `apart` (M,) and the faces that they bound."""
    kept = np.concatenate([[0], np.cumsum(~apart)]).astype(np.int32)
    stay = _whole_faces(net.indptr, net.indices, apart, net.faces)
    faces = np.ascontiguousarray(net.faces[stay])
    face_ptr, face_of = faces_at_vertices(faces, len(net.indptr) - 1)
    return Connectivity(
        kept[net.indptr], net.indices[~apart], face_ptr, face_of, faces,
        net.edge[~apart], net.turn[~apart], net.area[stay],
    )  # fmt: skip


@njit(cache=True)
def _hard(one, other, of, default, pairs, kinds):  # type: ignore[no-untyped-def]
    """Whether the border between two regions is hard."""
    if one == other:
        return False
    for index in range(len(pairs)):
        a, b = pairs[index, 0], pairs[index, 1]
        if (a == one and b == other) or (a == other and b == one):
            return kinds[index]
    return default and of[one] != of[other]


@njit(cache=True)
def _hard_edges(indptr, indices, region, of, default, pairs, kinds):  # type: ignore[no-untyped-def]
    apart = np.zeros(len(indices), np.bool_)
    for vertex in range(len(indptr) - 1):
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = region[indices[slot]]
            if other != region[vertex]:
                apart[slot] = _hard(region[vertex], other, of, default, pairs, kinds)
    return apart


@njit(cache=True)
def _whole_faces(indptr, indices, apart, faces):  # type: ignore[no-untyped-def]
    """Which faces have no edge that is cut."""
    whole = np.ones(len(faces), np.bool_)
    for face in range(len(faces)):
        for corner in range(3):
            vertex, other = faces[face, corner], faces[face, (corner + 1) % 3]
            for slot in range(indptr[vertex], indptr[vertex + 1]):
                if indices[slot] == other and apart[slot]:
                    whole[face] = False
    return whole


@njit(cache=True)
def _depth(indptr, indices, home):  # type: ignore[no-untyped-def]
    """Levels (N,) i4 from a border between samples, 1 beside it, 0 where none is joined."""
    count = len(home)
    depth = np.zeros(count, np.int32)
    queue = np.empty(count, np.int32)
    tail, head = 0, 0
    for vertex in range(count):
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            if home[indices[slot]] != home[vertex]:
                depth[vertex] = 1
                queue[tail] = vertex
                tail += 1
                break
    while head < tail:
        here = queue[head]
        head += 1
        for slot in range(indptr[here], indptr[here + 1]):
            other = indices[slot]
            if depth[other] == 0:
                depth[other] = depth[here] + 1
                queue[tail] = other
                tail += 1
    return depth


@njit(cache=True)
def _core(indptr, indices, home, depth):  # type: ignore[no-untyped-def]
    """Greatest depth (N,) i4 in the connected part of one sample that each vertex is in."""
    count = len(home)
    core = np.full(count, -1, np.int32)
    queue = np.empty(count, np.int32)
    for seed in range(count):
        if core[seed] >= 0:
            continue
        queue[0], core[seed] = seed, 0
        tail, head, deepest = 1, 0, 0
        while head < tail:
            here = queue[head]
            head += 1
            deepest = max(deepest, depth[here])
            for slot in range(indptr[here], indptr[here + 1]):
                other = indices[slot]
                if core[other] < 0 and home[other] == home[here]:
                    core[other] = 0
                    queue[tail] = other
                    tail += 1
        for index in range(tail):
            core[queue[index]] = deepest
    return core


@njit(cache=True)
def _spread(  # type: ignore[no-untyped-def]
    indptr, indices, region, of, home, sample, depth, reach, default, pairs, kinds, allowed
):
    """Let `sample` reach across its soft borders, up to `reach` levels deep; in `allowed` (N,).

    Breadth-first from each of its regions' rims; the region that a level came from must have
    no hard border with the one that it enters.
    """
    count = len(home)
    queue = np.empty(count, np.int32)
    origin = np.empty(count, np.int32)
    level = np.zeros(count, np.int32)
    tail, head = 0, 0
    for vertex in range(count):
        if home[vertex] == sample and depth[vertex] == 1:
            queue[tail], origin[tail] = vertex, region[vertex]
            tail += 1
    while head < tail:
        here, start = queue[head], origin[head]
        head += 1
        for slot in range(indptr[here], indptr[here + 1]):
            other = indices[slot]
            if allowed[other] or level[here] + 1 > reach[other]:
                continue
            if _hard(start, region[other], of, default, pairs, kinds):
                continue
            allowed[other] = True
            level[other] = level[here] + 1
            queue[tail], origin[tail] = other, start
            tail += 1
