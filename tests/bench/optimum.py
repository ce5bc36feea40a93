"""Small cases whose best placement is known because all of them are tried.

While a small plane is quilted, every pick of the engine is compared with the optimum over all
texels × the orientations of a set, each cut optimally: what matching, ranking and the bounds
on placements cost together.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from btfcore.patch.distortion import field_directions
from btfcore.patch.flatten import FlatPatch
from btfcore.quilt.candidates import Candidate
from btfcore.quilt.fitting import fit
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.patches import median_direction
from btfcore.quilt.recut import vertex_costs
from btfcore.quilt.state import QuiltState
from btfcore.quilt.synthesize import Synthesizer
from btfcore.types import F4, Sample
from tests.surfaces import constant_field, plane

TURNS = (-10.0, -5.0, 0.0, 5.0, 10.0)  # degrees
WORK_PATCH = 5  # about 90 vertices
Change = Callable[[Synthesizer], None]


def untouched(engine: Synthesizer) -> None:
    """Leave the engine as it is."""


@dataclass(frozen=True)
class Pick:
    """Seam cost about a patch once laid, old seams included: as chosen, and at the least.

    least: among the placements that cover at least as many bare vertices as the chosen one;
    infinite where the chosen one lies between those tried and is alone in covering so many.
    """

    chosen: float
    least: float
    vertices: int


class _Audited(Synthesizer):
    """Notes the optimum beside every pick."""

    turns: tuple[float, ...] = TURNS

    def audit(self) -> list[Pick]:
        """Run to the end; one `Pick` for every patch that had something to continue."""
        picks: list[Pick] = []
        choose = self._finder.best

        def best(patch: FlatPatch, running: float) -> Candidate:
            found = choose(patch, running)
            if (self.state.patch[patch.order] >= 0).any():
                chosen = self._cost(patch, found.place, found.cut.fresh)
                picks.append(Pick(chosen, self._least(patch, found.cut.missed), patch.inner))
            return found

        self._finder.best = best  # type: ignore[method-assign]
        self.run()
        return picks

    def _cost(self, patch: FlatPatch, place: F4, fresh: NDArray[np.bool_]) -> float:
        """Cost of all seams about the patch once it is laid, measured as they then are."""
        state, net = self.state, self.net
        trial = QuiltState(
            state.source.copy(), state.patch.copy(), state.ghost.copy(), state.angle.copy(),
            state.patches,
        )  # fmt: skip
        angle = np.zeros(patch.inner)
        trial.accept(net, patch.order, self._flattener.local, place, fresh, angle)
        cost = vertex_costs(
            net.indptr, net.indices, patch.order, trial.patch, trial.source, trial.ghost,
            self.grid.cut,
        )  # fmt: skip
        return float(cost.sum())

    def _least(self, patch: FlatPatch, missed: int) -> float:
        net, state, grid, local = self.net, self.state, self.grid, self._flattener.local
        turn = field_directions(
            net.indptr, net.indices, net.edge, patch.order, patch.inner, local, patch.plane
        )
        direction = turn[:, 0] + 1j * turn[:, 1]
        mean = median_direction(
            direction[state.patch[patch.order[: patch.inner]] < 0], direction[0]
        )
        flat = (patch.plane[:, 0] + 1j * patch.plane[:, 1]) * mean.conjugate()
        band = patch.radius * 2 if self.parameters.literal else self.parameters.band
        least = np.inf
        height, width = grid.cut.shape[:2]
        for angle in np.radians(self.turns):
            spun = flat * np.exp(1j * angle) / grid.unit
            around = np.stack([spun.real, -spun.imag], axis=1)
            for row in range(height):
                for column in range(width):
                    place = (around + (column, row)).astype(np.float32)
                    cut = fit(
                        net.indptr, net.indices, patch.order, patch.inner, local, place,
                        state.patch, state.source, state.ghost, grid.cut, band,
                    )  # fmt: skip
                    if cut.missed <= missed:
                        least = min(least, self._cost(patch, place, cut.fresh))
        return float(least)


def audited(
    sample: Sample,
    parameters: QuiltParameters,
    *,
    side: int = 14,
    turns: tuple[float, ...] = TURNS,
    change: Change = untouched,
) -> list[Pick]:
    """Quilt a plane of `side`² vertices with work patches of about 90; every pick compared.

    `change` is done to the engine before it runs.
    """
    dense = plane(side, side, one_chart=False)
    knobs = replace(parameters, work_patch=WORK_PATCH)
    engine = _Audited(dense, constant_field(dense), sample, knobs)
    engine.turns = turns
    change(engine)
    return engine.audit()


def crop(sample: Sample, side: int) -> Sample:
    """The middle side × side texels of a sample."""
    row, column = (max((size - side) // 2, 0) for size in sample.colour.shape[:2])
    part = np.s_[row : row + side, column : column + side]
    return Sample(
        f"{sample.name} {side}²",
        np.ascontiguousarray(sample.colour[part]),
        np.ascontiguousarray(sample.channels[part]),
    )


def excess(picks: list[Pick]) -> float:
    """Σ cost chosen / Σ least cost, never below 1: a pick between those tried may be better."""
    chosen = sum(pick.chosen for pick in picks)
    return chosen / max(sum(min(pick.least, pick.chosen) for pick in picks), 1e-12)
