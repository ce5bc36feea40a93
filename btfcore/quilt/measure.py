"""What a quilt's seams cost, measured on the result alone (Zhou §IV-A, V_pq)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.patch.connectivity import Connectivity
from btfcore.patch.resample import look_up
from btfcore.quilt.grid import SampleGrid, differences
from btfcore.quilt.sheet import Sheet
from btfcore.quilt.state import QuiltState
from btfcore.types import F4, F8, I4, I8


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


def measure_seams(net: Connectivity, state: QuiltState, grid: SampleGrid | Sheet) -> SeamMeasures:
    """Seam measures of `state`, from coordinates and ghosts; norms accumulate in float64.

    Of several samples each seam counts in its own sample's units, see `measure_by_sample`.
    """
    if isinstance(grid, Sheet) and len(grid.grids) > 1:
        parts, border = measure_by_sample(net, state, grid)
        share = np.bincount(state.sample[state.patch >= 0], minlength=len(parts))
        every = max(len(state.patch), 1)
        edges = sum(part.seam_edges for part in (*parts, border))
        steps = sum(part.seam_edges * part.per_edge for part in (*parts, border))
        whole = sum(part.per_vertex * int(n) for part, n in zip(parts, share, strict=True))
        return SeamMeasures(
            seam_edges=edges,
            fraction=edges / max(len(net.indices) // 2, 1),
            per_edge=steps / max(edges, 1),
            per_vertex=whole / every + border.per_vertex,
        )
    alone = grid.grids[0] if isinstance(grid, Sheet) else grid
    slots, _, head = _seams(net, state)
    # every seam edge has two half-edges i→j, and each holds what i's patch has at j
    there = look_up(alone.cut, state.ghost[slots])
    here = look_up(alone.cut, state.source[head])
    return _figures(
        _norms(there, here), len(net.indices) // 2, len(state.patch),
        alone.texel_difference, alone.random_difference,
    )  # fmt: skip


def measure_by_sample(
    net: Connectivity, state: QuiltState, sheet: Sheet
) -> tuple[tuple[SeamMeasures, ...], SeamMeasures]:
    """Seam measures within each sample, and of the soft borders between samples.

    Within a sample they are over its own edges and vertices, in its own differences; between
    samples over all of them, in colours: their differences are the means of the samples'.
    Hard borders are not in `net`, so they count nowhere.
    """
    _, tail, head, steps = seam_steps(net, state, sheet)
    one, two = state.sample[tail], state.sample[head]
    tails = np.repeat(np.arange(len(net.indptr) - 1, dtype=np.int32), np.diff(net.indptr))
    covered = state.patch >= 0
    within = state.sample[tails] == state.sample[net.indices]
    within &= covered[tails] & covered[net.indices]
    parts = []
    for index, grid in enumerate(sheet.grids):
        edges = int((within & (state.sample[tails] == index)).sum()) // 2
        vertices = int((covered & (state.sample == index)).sum())
        near, far = grid.texel_difference, grid.random_difference
        costs = steps[(one == index) & (two == index)] * near
        parts.append(_figures(costs, edges, vertices, near, far))
    near, far = colour_differences(sheet)
    border = steps[one != two] * near
    return tuple(parts), _figures(border, len(net.indices) // 2, len(state.patch), near, far)


def colour_differences(sheet: Sheet) -> tuple[float, float]:
    """Mean over the samples of the differences of neighbouring and of random colours."""
    if len(sheet.grids) == 1:
        return 0.0, 0.0
    both = [differences(sheet.colours(index)) for index in range(len(sheet.grids))]
    return float(np.mean([near for near, _ in both])), float(np.mean([far for _, far in both]))


def measure_sample(net: Connectivity, state: QuiltState, sheet: Sheet, index: int) -> SeamMeasures:
    """Seam measures within sample `index` alone."""
    if len(sheet.grids) == 1:
        return measure_seams(net, state, sheet)
    return measure_by_sample(net, state, sheet)[0][index]


def seam_steps(net: Connectivity, state: QuiltState, sheet: Sheet) -> tuple[I8, I4, I4, F8]:
    """Half-edges i→j between two patches, their ends, and what each costs at j.

    The steps (n,) are in texel differences of the sample, or of the samples' colours.
    """
    slots, tail, head = _seams(net, state)
    one, two = state.sample[tail], state.sample[head]
    steps = np.zeros(len(slots))
    there = np.zeros((len(slots), 3), np.float32)
    here = there.copy()
    for index, grid in enumerate(sheet.grids):
        mine = (one == index) & (two == index)
        costs = _norms(
            look_up(grid.cut, state.ghost[slots[mine]]),
            look_up(grid.cut, state.source[head[mine]]),
        )
        steps[mine] = costs / max(grid.texel_difference, 1e-12)
        if len(sheet.grids) > 1:
            colour = sheet.colours(index)
            there[one == index] = look_up(colour, state.ghost[slots[one == index]])
            here[two == index] = look_up(colour, state.source[head[two == index]])
    mixed = one != two
    if mixed.any():
        steps[mixed] = _norms(there[mixed], here[mixed]) / max(colour_differences(sheet)[0], 1e-12)
    return slots, tail, head, steps


def _seams(net: Connectivity, state: QuiltState) -> tuple[I8, I4, I4]:
    """Half-edges between two patches, and their two ends."""
    patch = state.patch
    tail = np.repeat(np.arange(len(net.indptr) - 1, dtype=np.int32), np.diff(net.indptr))
    head = net.indices
    seam = (patch[tail] != patch[head]) & (patch[tail] >= 0) & (patch[head] >= 0)
    slots = np.flatnonzero(seam)
    return slots, tail[slots], head[slots]


def _norms(there: F4, here: F4) -> F8:
    """Distances (n,) f8 of rows."""
    away = there.astype(np.float64) - here.astype(np.float64)
    return np.asarray(np.sqrt((away**2).sum(axis=1)))


def _figures(costs: F8, edges: int, vertices: int, step: float, random: float) -> SeamMeasures:
    """Put the costs of half-edges in relation to the counts of edges and vertices."""
    seams = len(costs) // 2
    mean = float(costs.mean()) if seams else 0.0
    return SeamMeasures(
        seam_edges=seams,
        fraction=seams / max(edges, 1),
        per_edge=mean / max(step, 1e-12),
        per_vertex=mean * seams / max(vertices, 1) / max(random, 1e-12),
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
