"""The energy of constrained graphcut (Zhou §IV-A), as it is, apart from how it is minimised.

E = λ Σ_p |m_σ(p) − m_0(p)| + Σ_(p,q) V_pq / u. The cuts themselves are `btfcore.quilt.recut`
with the data term as its bias: t-links D_p, n-links V_pq, a seam node per old seam.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from btfcore.paint.delta import slots_of
from btfcore.paint.palette import PAIRS, Palette
from btfcore.patch.connectivity import Connectivity
from btfcore.quilt.recut import vertex_costs
from btfcore.quilt.state import QuiltState
from btfcore.types import F8, I4


@dataclass(frozen=True)
class Energy:
    """Parts of E over some vertices: constraint Σ D_p, smooth Σ V_pq / u, and how many seams.

    Each V_pq is shared by its two ends, so the energies of disjoint sets of vertices add up.
    """

    constraint: float
    smooth: float
    seam_edges: float

    def total(self, weight: float) -> float:
        """E for λ = `weight`."""
        return weight * self.constraint + self.smooth


def energy(
    net: Connectivity,
    state: QuiltState,
    palette: Palette,
    sample: int,
    target: F8,
    vertices: I4 | None = None,
    *,
    any_sample: bool = False,
    asked: F8 | None = None,
    unit: float | None = None,
) -> Energy:
    """Energy of a quilt for the constraint `target` (n,) m_0 at `vertices` (n,), None: all.

    Only features of `sample` satisfy the constraint (F shall be textured by S_f alone, Zhou
    §IV-A); those of other samples count as background where they are asked for, and as what
    they are elsewhere. With `any_sample` all count as what they are, for where features that
    are there shall stay; with `asked` (n,) those do where it is below ½, whatever m_0 is. Bare
    vertices cost nothing.
    """
    if vertices is None:
        vertices = np.arange(len(state.patch), dtype=np.int32)
    covered = state.patch[vertices] >= 0
    if asked is None:
        asked = np.zeros(len(target)) if any_sample else target
    shown = feature_of(state, palette, sample, vertices, asked)
    constraint = float(np.abs(shown - target)[covered].sum())
    costs = vertex_costs(
        net.indptr, net.indices, vertices, state.patch, state.source, state.ghost,
        palette.sheet, state.sample,
    )  # fmt: skip
    return Energy(
        constraint,
        float(costs.sum()) / (unit_of(palette, sample) if unit is None else unit),
        seam_count(net, state.patch, vertices) / 2,
    )


def unit_of(palette: Palette, sample: int, grounds: Sequence[int] = ()) -> float:
    """u, by which V_pq is divided: twice the mean distance of a feature to its background.

    The sample's own normaliser, or random pairs' where it has no feature. grounds: background
    samples that it is painted over; where the feature differs more from one of these, that
    difference counts, lest nothing of a feature can be painted over another material.
    """
    if not (palette.feature_of(sample) > 0.5).any():
        return 2 * max(palette.grids[sample].random_difference, 1e-12)
    others = [ground for ground in grounds if ground != sample]
    own = palette.normaliser(sample)
    return max([own, *(2 * _contrast(palette, sample, ground) for ground in others)])


def _contrast(palette: Palette, sample: int, ground: int) -> float:
    """Mean distance of random feature texels of a sample to background texels of another."""
    random = np.random.default_rng(0)
    values = []
    for index, inside in (
        (sample, palette.feature_of(sample) > 0.5), (ground, palette.feature_of(ground) <= 0.5),
    ):  # fmt: skip
        row, column = np.nonzero(inside)
        if not len(row):
            return 0.0
        at = random.integers(0, len(row), PAIRS)
        top = int(palette.sheet.frames[index, 0])
        values.append(palette.sheet.cut[top + row[at], column[at]].astype(np.float64))
    return float(np.sqrt(((values[0] - values[1]) ** 2).sum(axis=1)).mean())


def feature_of(state: QuiltState, palette: Palette, sample: int, vertices: I4, target: F8) -> F8:
    """m_σ (n,) f8 that the constraint sees at `vertices`; see `energy`."""
    owner = state.sample[vertices]
    found = palette.feature_at(owner, state.source[vertices]).astype(np.float64)
    found[state.patch[vertices] < 0] = 0.0
    found[(owner != sample) & (target >= 0.5)] = 0.0
    return found


def seam_count(net: Connectivity, patch: I4, vertices: I4) -> int:
    """How many half-edges leave `vertices` for another patch."""
    rows = net.indptr[vertices + 1] - net.indptr[vertices]
    slots = slots_of(net.indptr, vertices)
    own = np.repeat(patch[vertices], rows)
    other = patch[net.indices[slots]]
    apart: NDArray[np.bool_] = (own >= 0) & (other >= 0) & (own != other)
    return int(apart.sum())
