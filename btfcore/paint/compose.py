"""One patch of an edit: flatten, match, cut under the constraint, keep what is cheapest.

Every vertex of the patch may take the new value or keep its old one (Zhou §IV-A, Fig. 8, on
the whole patch instead of an overlap). All-old is one of the labellings, so E never rises.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from btfcore.paint.engine import Engine
from btfcore.patch.flatten import FlatPatch
from btfcore.quilt.extend import extensions
from btfcore.quilt.lay import Lay, lay_along_field
from btfcore.quilt.matching import Placement
from btfcore.quilt.recut import Recut, recut
from btfcore.quilt.register import fit_warp, warped
from btfcore.types import F4, F8, I4

PLACEMENTS = 3  # local minima that are cut
EXTENDED = 2  # patches of the same sample that a new one may carry on
REACH, ROUNDS = 1.5, 6  # registration: texels that it may shift by, its steps
REGISTERED = 1200  # vertices that a registration looks at, about
FORCE = 1e5  # of the normaliser: what it costs to leave a vertex that must change
BACKGROUND = 0.05  # m_S up to which a texel counts as background
IDLE = 0.02  # of m: nothing is wanted where it is off by no more anywhere
LEAST_GAIN = 1e-7  # of the energy: less is rounding


@dataclass(frozen=True, eq=False)
class Aim:
    """What is wanted of a patch's vertices.

    target (n,) f8: m_0; present (n,) f8: m_σ as it is; known (n,) bool: where what is there
    is to be continued; forced (inner,) bool: vertices that must take the new value; frozen
    (inner,) bool: those that must keep theirs; strict: no new feature where target is 0;
    seams: cut even where all is as wanted, for the seams' sake.
    """

    target: F8
    present: F8
    known: NDArray[np.bool_]
    forced: NDArray[np.bool_]
    frozen: NDArray[np.bool_]
    strict: bool = False
    seams: bool = False


@dataclass
class Tally:
    """What the patches of an edit came to."""

    tries: int = 0
    kept: int = 0
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class _Choice:
    cut: Recut
    place: F4
    angle: F8


AimOf = Callable[[FlatPatch], Aim]


class Composer:
    """Places patches of one sample for the edit that `engine` is recording."""

    def __init__(
        self,
        engine: Engine,
        sample: int,
        weight: float,
        *,
        placements: int | None = None,
        pick: np.random.Generator | None = None,
    ) -> None:
        """Use λ = `weight`; pick: choose among the placements at random instead of the best."""
        self.engine, self.sample, self.weight = engine, sample, weight
        self.placements, self.tally = placements or PLACEMENTS, Tally()
        self._pick = pick
        self._grid = engine.palette.grids[sample]
        self._unit = engine.unit(sample)

    def patch(
        self,
        vertex: int,
        radius: int,
        aim_of: AimOf,
        *,
        turns: Sequence[float] = (0.0,),
        turns_of: Callable[[Lay], Sequence[float]] | None = None,
        extend: bool = True,
    ) -> I4:
        """Place one patch around `vertex`; returns the vertices (n,) that changed.

        turns: against the field that are tried, or turns_of, which sees the patch; extend:
        also try to carry on patches that are there.
        """
        engine = self.engine
        flat = engine.flattener.flatten(vertex, radius)
        try:
            engine.recorder.reads(flat.order)
            lay = lay_along_field(
                engine.net, engine.flattener.local, flat, bend=engine.parameters.bend
            )
            aim = aim_of(flat)
            idle = not aim.forced.any() and not aim.seams
            if idle and np.abs(aim.present - aim.target).max() <= IDLE:
                return np.zeros(0, np.int32)
            found = self._matched(lay, aim, turns if turns_of is None else turns_of(lay))
            if extend:
                found += self._extended(lay)
            return self._cheapest(lay, aim, found)
        finally:
            engine.flattener.release(flat)

    def place(self, lay: Lay, aim_of: AimOf, at: Placement) -> I4:
        """Cut one given placement into the quilt; returns the vertices (n,) that changed."""
        engine = self.engine
        engine.flattener.hold(lay.patch)
        try:
            engine.recorder.reads(lay.patch.order)
            return self._cheapest(lay, aim_of(lay.patch), [at])
        finally:
            engine.flattener.release(lay.patch)

    def _cheapest(self, lay: Lay, aim: Aim, found: Sequence[Placement]) -> I4:
        self.tally.tries += 1
        best = self._best(lay, aim, found)
        return np.zeros(0, np.int32) if best is None else self._keep(lay, best)

    def _matched(self, lay: Lay, aim: Aim, turns: Sequence[float]) -> list[Placement]:
        """Placements by joint matching, registered where something is to be continued."""
        engine, state, order = self.engine, self.engine.state, lay.patch.order
        matcher = engine.matcher(self.sample)
        found = matcher.find(
            lay, state, aim.known, aim.target, turns=turns, most=self.placements,
        )  # fmt: skip
        if self._pick is not None and found:
            found = [found[int(self._pick.integers(len(found)))]]
        knobs = engine.parameters
        if knobs.sway == 0.0 or not aim.known.any():
            return found
        points = lay.points(self._grid.unit)
        radius, some = _reach(points), np.flatnonzero(aim.known)
        some = some[:: max(len(some) // REGISTERED, 1)]
        points, values = points[some], matcher.values_of(state, order[some])
        better = []
        for at in found:
            start = np.array([at.column, at.row, at.turn, *at.warp])
            warp, cost = fit_warp(
                matcher.grid.match, points, values, start, radius, REACH, np.radians(knobs.sway),
                knobs.give, ROUNDS,
            )  # fmt: skip
            if np.isfinite(cost):
                column, row, turn, *rest = warp.tolist()
                at = Placement(column, row, at.cost, turn, tuple(rest))
            better.append(at)
        return better

    def _extended(self, lay: Lay) -> list[Placement]:
        """Placements that carry on patches of the same sample."""
        state, order = self.engine.state, lay.patch.order
        mine = (state.patch[order] >= 0) & (state.sample[order] == self.sample)
        return extensions(state, order[mine], lay.points(self._grid.unit)[mine], EXTENDED)

    def _best(self, lay: Lay, aim: Aim, found: Sequence[Placement]) -> _Choice | None:
        """Cut all placements; the one that leaves least energy, None where none gains."""
        points = lay.points(self._grid.unit)
        radius = _reach(points)
        best: _Choice | None = None
        for at in found:
            warp = np.array([at.column, at.row, at.turn, *at.warp])
            where, rotation = warped(points, warp, radius)
            place = where.astype(np.float32)
            cut = self._cut(lay.patch, aim, place)
            gain = cut.before - cut.after
            if not gain > LEAST_GAIN * cut.before or not cut.fresh.any():
                continue
            if best is None or gain > best.cut.before - best.cut.after:
                best = _Choice(cut, place, lay.angles(rotation))
        return best

    def _cut(self, patch: FlatPatch, aim: Aim, place: F4) -> Recut:
        """Constrained graphcut of one placement (Zhou §IV-A), in units of V."""
        engine, state, inner = self.engine, self.engine.state, patch.inner
        net, palette = engine.net, engine.palette
        target, present = aim.target[:inner], aim.present[:inner]
        owner = np.full(inner, self.sample, np.uint16)
        new = palette.feature_at(owner, place[:inner]).astype(np.float64)
        bias = self.weight * (np.abs(new - target) - np.abs(present - target))
        bias[aim.forced] -= FORCE
        if aim.strict:
            bias[(new > BACKGROUND) & (target < BACKGROUND)] = 10 * FORCE
        bias[aim.frozen] = 10 * FORCE
        return recut(
            net.indptr, net.indices, patch.order, inner, engine.flattener.local, place,
            state.patch, state.source, state.ghost, palette.sheet, bias * self._unit,
            owner=state.sample, mine=self.sample,
        )  # fmt: skip

    def _keep(self, lay: Lay, choice: _Choice) -> I4:
        engine, order = self.engine, lay.patch.order
        vertices = order[: lay.patch.inner][choice.cut.fresh]
        engine.claim_patch()
        engine.recorder.writes(vertices)
        engine.state.accept(
            engine.net, order, engine.flattener.local, choice.place, choice.cut.fresh,
            choice.angle, self.sample,
        )  # fmt: skip
        self.tally.kept += 1
        return vertices


def _reach(points: NDArray[np.complex128]) -> float:
    """Unit of a patch's bend: the largest distance from its centre, at least one texel."""
    return max(float(np.abs(points).max()), 1.0)
