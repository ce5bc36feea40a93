"""What a quilt's seams cost, measured on the result alone (Zhou §IV-A, V_pq)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.patch.connectivity import Connectivity
from btfcore.patch.resample import look_up
from btfcore.quilt.grid import SampleGrid
from btfcore.quilt.state import QuiltState
from btfcore.types import I4


@dataclass(frozen=True)
class SeamMeasures:
    """Seam figures of a finished quilt.

    seam_edges: dense-mesh edges between two patches; fraction: of all edges; per_edge: mean
    of ½ V_pq over the sample's mean texel difference (1: a seam steps like two neighbouring
    texels); per_vertex: sum of ½ V_pq per vertex over the mean distance of random texels.
    """

    seam_edges: int
    fraction: float
    per_edge: float
    per_vertex: float


def measure_seams(net: Connectivity, state: QuiltState, grid: SampleGrid) -> SeamMeasures:
    """Seam measures of `state`, from coordinates and ghosts; norms accumulate in float64."""
    patch = state.patch
    tail = np.repeat(np.arange(len(net.indptr) - 1, dtype=np.int32), np.diff(net.indptr))
    head = net.indices
    seam = (patch[tail] != patch[head]) & (patch[tail] >= 0) & (patch[head] >= 0)
    # every seam edge has two half-edges i→j, and each holds what i's patch has at j
    slots = np.flatnonzero(seam)
    there = look_up(grid.cut, state.ghost[slots]).astype(np.float64)
    here = look_up(grid.cut, state.source[head[slots]]).astype(np.float64)
    costs = np.sqrt(((there - here) ** 2).sum(axis=1))
    edges = len(slots) // 2
    mean = float(costs.mean()) if edges else 0.0
    return SeamMeasures(
        seam_edges=edges,
        fraction=edges / max(len(head) // 2, 1),
        per_edge=mean / max(grid.texel_difference, 1e-12),
        per_vertex=mean * edges / max(len(patch), 1) / max(grid.random_difference, 1e-12),
    )


@njit(cache=True)
def seam_edges_around(
    indptr: I4,
    indices: I4,
    order: I4,
    inner: int,
    local: I4,
    fresh: NDArray[np.bool_],
    patch: I4,
) -> int:
    """Seam edges that a cut leaves at a patch's vertices, old seams included."""
    count = 0
    for here in range(inner):
        p = order[here]
        if patch[p] < 0 and not fresh[here]:
            continue
        for slot in range(indptr[p], indptr[p + 1]):
            q = indices[slot]
            other = local[q]
            inside = 0 <= other < inner
            if inside and other < here:
                continue
            new = inside and fresh[other]
            if not new and patch[q] < 0:
                continue
            if fresh[here] != new or (not fresh[here] and patch[p] != patch[q]):
                count += 1
    return count
