"""What the engine notes of every patch, and which patches of a finished quilt are the worst."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree

from btfcore.mesh.topology import edges
from btfcore.quilt.measure import seam_steps
from btfcore.types import F8, I4, DenseMesh, Field

if TYPE_CHECKING:
    from btfcore.quilt.synthesize import Synthesizer

FEW_EDGES = 12  # a patch with fewer seam edges left says little
HALF = 5  # of the worst ten, how many are listed for their seams rather than their size

REASONS = {
    "": "not reduced",
    "component": "its component of the mesh is smaller than the patch",
    "tear": "the surface there closes around a handle or another part and cannot be unrolled",
    "border": "it would enclose a border of the mesh, around which it cannot be unrolled",
    "distortion": "flattening it would change areas or lengths beyond the bound T_d",
    "field": "the orientation field turns too much",
    "singularity": "a singularity of the orientation field lies in it",
    "few": "few bare vertices were left",
    "seam": "its seam cost more than the bound T_c",
    "sample": "the sample is too small to fill it",
    "forced": "no placement of the sample reached there",
    "refined": "laid by the refinement, which has no size to keep",
    "earlier": "laid by the run that this one continued",
}


@dataclass(frozen=True)
class Entry:
    """One patch as it was laid.

    seed: dense vertex at its centre; wanted, radius: levels asked for and reached; kind: how
    it was flattened; gained: bare vertices covered; seam: cost of its cut per seam edge (half
    of V_pq, in texel differences); reason: key of `REASONS`.
    """

    seed: int
    wanted: int
    radius: int
    kind: str
    gained: int
    seam: float
    reason: str


def worst_patches(
    engine: Synthesizer, dense: DenseMesh, field: Field, *, most: int = 10
) -> list[dict[str, Any]]:
    """The patches to look at first, as plain JSON: dearest seams, then hardest shrunk.

    Seam costs are those of the quilt as it is now, per seam edge in mean texel differences; a
    patch that later ones have covered is left out.
    """
    patch, ledger = engine.state.patch, engine.ledger
    count = max(engine.state.patches, int(patch.max(initial=-1)) + 1)
    owned = np.bincount(patch[patch >= 0], minlength=count)
    number, cost = _seams(engine, count)
    per_edge = np.where(number >= FEW_EDGES, cost / np.maximum(number, 1), 0.0)
    chosen = [int(p) for p in np.argsort(-per_edge, kind="stable")[:HALF] if per_edge[p] > 0]
    reached = [
        (entry.radius / entry.wanted, -int(owned[p]), p)
        for p, entry in ledger.items()
        if owned[p] and entry.radius < entry.wanted and p not in chosen
    ]
    chosen += [p for _, _, p in sorted(reached)[: most - len(chosen)]]
    near = _Surroundings(dense, field)
    rows = []
    for p in chosen:
        entry = ledger.get(p)
        where = entry.seed if entry is not None else int(np.flatnonzero(patch == p)[0])
        row: dict[str, Any] = {
            "patch": p,
            "vertex": where,
            "position": dense.vertices[where].tolist(),
            "vertices": int(owned[p]),
            "seam_edges": int(number[p]),
            "seam_per_edge": float(cost[p] / max(number[p], 1)),
        }
        key = "earlier" if p < engine.continued else "refined"
        if entry is not None:
            key = near.closer(entry)
            row |= {
                "radius_wanted": entry.wanted,
                "radius": entry.radius,
                "flattened_by": entry.kind,
                "gained": entry.gained,
                "seam_when_laid": entry.seam,
            }
        rows.append(row | {"reason": REASONS[key]})
    return rows


def reductions(ledger: dict[int, Entry]) -> dict[str, int]:
    """How many patches were reduced for which reason (keys of `REASONS`)."""
    counts: dict[str, int] = {}
    for entry in ledger.values():
        if entry.reason:
            counts[entry.reason] = counts.get(entry.reason, 0) + 1
    return dict(sorted(counts.items()))


def _seams(engine: Synthesizer, count: int) -> tuple[I4, F8]:
    """Seam edges of every patch, (count,), and the sum of ½ V_pq there in texel differences."""
    _, tail, head, step = seam_steps(engine.net, engine.state, engine.sheet)
    mine, theirs = engine.state.patch[tail], engine.state.patch[head]
    number = np.bincount(mine, minlength=count).astype(np.int32)
    # half of V_pq from either end: what the patch has beyond its border, and what is there
    total = np.bincount(mine, step, count) + np.bincount(theirs, step, count)
    return number, total / 2


class _Surroundings:
    """Tells a border from a handle and a singularity from a turn, for the patches listed."""

    def __init__(self, dense: DenseMesh, field: Field) -> None:
        pairs, times = edges(dense.faces)
        rim = dense.vertices[np.unique(pairs[times == 1])]
        self._step, self._points = dense.step, dense.vertices
        self._rim = cKDTree(rim) if len(rim) else None
        self._poles = cKDTree(field.singularities) if len(field.singularities) else None

    def closer(self, entry: Entry) -> str:
        """Reason of an entry, made more exact by what lies within its radius."""
        tree, key = {"tear": (self._rim, "border"), "field": (self._poles, "singularity")}.get(
            entry.reason, (None, "")
        )
        if tree is None:
            return entry.reason
        away, _ = tree.query(self._points[entry.seed])
        return key if away <= entry.wanted * self._step else entry.reason
