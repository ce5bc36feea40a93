"""Refinement: the worst seams are cut again with fresh placements (Kwatra et al. 2003, §4.1)."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.errors import InvalidParameter
from btfcore.patch.flatten import FlatPatch
from btfcore.patch.resample import look_up, work_image
from btfcore.progress import Progress, between, silent
from btfcore.quilt.extend import extensions
from btfcore.quilt.fitting import barred_places
from btfcore.quilt.lay import Lay, lay_along_field
from btfcore.quilt.matching import Matcher, Placement
from btfcore.quilt.patches import ON_COURSE
from btfcore.quilt.recut import recut
from btfcore.quilt.register import register
from btfcore.quilt.state import QuiltState
from btfcore.quilt.synthesize import Synthesizer
from btfcore.quilt.worst import WorstSeams
from btfcore.types import F4, F8, I4

SIZES = (1.0, 0.5, 1.5, 0.25)  # of r_w: what is placed anew, by how often that was in vain
RIM = 20  # levels around it in which the seam may run, as in `QuiltParameters.band`
MATCHED, EXTENDED = 2, 4  # placements found by matching, and by extending what is there
REACH, ROUNDS = 1.5, 6  # registration: texels that it may shift by, its steps
# What an angle to the field costs, per vertex and multiple of near_field, over the cost of
# random pairs: without it seams get cheaper at the field's expense.
ASTRAY, FARTHEST = 0.01, 6.0
OFF_COURSE = 4.0  # times as much while less than ON_COURSE of the quilt is within near_field
NEVER = 1e9  # bias of a vertex that must keep its value
WORTH = 0.01  # share of a patch's seam cost below which a try counts as in vain


@dataclass
class RefineStatistics:
    """What a refinement did.

    tries: places that were cut again; accepted: those that became cheaper; before, after:
    Σ ½ V_pq of the whole quilt per vertex, over the mean distance of random texels; seams
    between samples, which stay as they are, left out.
    """

    tries: int = 0
    accepted: int = 0
    before: float = 0.0
    after: float = 0.0


def check_budget(seconds: float | None, tries: int | None) -> None:
    """Raise `InvalidParameter` where a budget is negative or no number."""
    for name, budget in (("seconds", seconds), ("tries", tries)):
        if budget is not None and not budget >= 0:
            raise InvalidParameter(f"refinement for {budget:g} {name}; it must be 0 or more")


def refine(
    engine: Synthesizer,
    *,
    seconds: float | None = None,
    tries: int | None = None,
    progress: Progress = silent,
) -> RefineStatistics:
    """Cut the worst seams of `engine`'s quilt again, until a budget ends or nothing improves.

    `tries` patches are cut at most, for at most `seconds`; with both None, until every seam
    was tried in vain. The n-th try is the same in every run; how many of them fit into
    `seconds` is not, so give `tries` where the same bits are wanted. The seam cost never
    rises; bare vertices stay bare. `progress` may raise `Cancelled` between placements: the
    state is valid then. Raises `InvalidParameter` where a budget is negative or no number.

    Several samples are refined one after the other, each with its share of the budget; borders
    between them stay where they are.
    """
    check_budget(seconds, tries)
    found = RefineStatistics()
    count = len(engine.sheet.grids)
    sizes = np.bincount(engine.state.sample[engine.state.patch >= 0], minlength=count)
    done = 0.0
    for mine, size in enumerate(sizes.tolist()):
        share = size / max(int(sizes.sum()), 1)
        run = _Refiner(engine, mine, between(progress, done, done))
        found.before += run.energy()
        try:
            run.run(
                None if seconds is None else seconds * share,
                None if tries is None else round(tries * share),
                found, between(progress, done, done + share),
            )  # fmt: skip
        finally:
            run.finish()
        found.after += run.energy()
        done += share
    progress(1.0, "refining")
    return found


class _Refiner:
    """Places, matches and cuts; holds the seam costs of the quilt as it is."""

    def __init__(self, engine: Synthesizer, mine: int, progress: Progress) -> None:
        """Refine sample `mine` of the engine's quilt; `finish` hands the result back."""
        self.engine, self.net, self.mine = engine, engine.net, mine
        self.state, self.grid = engine.state, engine.sheet.grids[mine]
        self._rim = np.zeros(0, np.bool_)
        if len(engine.sheet.grids) > 1:
            whole = engine.state
            own = (whole.patch >= 0) & (whole.sample == mine)
            # vertices of other samples count as bare, those beside them keep what they have
            self._rim = _beside(self.net.indptr, self.net.indices, whole.patch >= 0, own)
            patch = np.where(own, whole.patch, np.int32(-1))
            self.state = QuiltState(whole.source, patch, whole.ghost, whole.angle, whole.patches)
        self.worst = WorstSeams(self.net, self.state, self.grid.cut, progress=progress)
        self._flattener = engine._flattener
        self._matcher = Matcher(self.grid)
        covered = self.state.patch >= 0
        self._placed = int(covered.sum())
        self._near = int((self._astray(self.state.angle[covered]) < 1).sum())

    def run(
        self, seconds: float | None, tries: int | None, found: RefineStatistics, progress: Progress
    ) -> None:
        """Cut the worst seams again until a budget ends or nothing improves."""
        began, tried = time.monotonic(), 0
        while tries is None or tried < tries:
            spent = time.monotonic() - began
            if seconds is not None and spent >= seconds:
                break
            vertex, failures = self.worst.pick()
            if vertex < 0:
                break
            done = tried / tries if tries else tried / (tried + 1000.0)
            share = min(max(done, spent / seconds if seconds else 0.0), 1.0)
            found.accepted += self.improve(vertex, failures, between(progress, share, share))
            tried += 1
            found.tries += 1

    def finish(self) -> None:
        """Hand the patches of one of several samples back to the engine's quilt."""
        whole = self.engine.state
        if self.state is not whole:
            own = self.state.patch >= 0
            whole.patch[own] = self.state.patch[own]
            whole.patches = self.state.patches

    def energy(self) -> float:
        """Seam cost per vertex over the random one, as `measure_seams` has it."""
        count, unit = max(len(self.state.patch), 1), max(self.grid.random_difference, 1e-12)
        return self.worst.total() / 2 / count / unit

    def improve(self, vertex: int, failures: int, progress: Progress) -> bool:
        """Try placements around `vertex`; True where the quilt became cheaper."""
        core = max(int(SIZES[failures % len(SIZES)] * self.engine.radii[self.mine]), 2)
        patch = self._flattener.flatten(vertex, core + RIM)
        near, gain = float(self.worst.cost[patch.order].sum()), 0.0
        try:
            lay, known = self._lay(patch)
            for at in self._placements(lay, known):
                progress(1.0, "refining")
                gain += self._expand(lay, at)
        finally:
            self._flattener.release(patch)
        if gain > WORTH * near:
            self.worst.improved(patch.order)
        else:
            levels = max(min(core, patch.radius) // 4, 1)
            self.worst.failed(patch.order[: patch.start[min(levels, len(patch.start) - 1)]])
        return gain > 0

    def _lay(self, patch: FlatPatch) -> tuple[Lay, NDArray[np.bool_]]:
        """Bend a patch along the field, as in synthesis; which of it (n,) is matched.

        Its middle is not, so that something else may come there.
        """
        knobs, order = self.engine.parameters, patch.order
        levels, last = max(patch.radius - RIM, patch.radius // 2, 1), len(patch.start) - 1
        core = int(patch.start[min(levels, last)])
        bend = 0.0 if knobs.literal else knobs.bend
        lay = lay_along_field(self.net, self._flattener.local, patch, bend=bend, core=core)
        known = self.state.patch[order] >= 0
        known[:core] = False
        known[int(patch.start[min(levels + knobs.match_band, last)]) :] = False
        return lay, known

    def _placements(self, lay: Lay, known: NDArray[np.bool_]) -> list[Placement]:
        """Placements that match around the middle, then those that extend old patches."""
        return [
            *self._matched(lay, known),
            *extensions(self.state, lay.patch.order, lay.plane / self.grid.unit, EXTENDED),
        ]

    def _matched(self, lay: Lay, known: NDArray[np.bool_]) -> list[Placement]:
        knobs, grid, net, order = self.engine.parameters, self.grid, self.net, lay.patch.order
        point = np.stack([lay.plane.real, -lay.plane.imag], axis=1) / grid.unit
        values = look_up(grid.match, self.state.source[order])
        reach, most = float(np.abs(point).max()), max(grid.cut.shape[:2])
        half = int(min(-(-(reach + 1) // 4) * 4, -(-most // 4) * 4))
        image, mask = work_image(
            net.faces, net.face_ptr, net.face_of, order, self._flattener.local, point, values,
            known, half,
        )  # fmt: skip
        if not mask.any():
            return []
        found = []
        for at in self._matcher.match(
            image, mask, most=MATCHED, overlap=knobs.overlap, margin=knobs.margin
        ):
            if knobs.literal or knobs.sway == 0.0:
                found.append(at)
                continue
            column, row, turn, cost = register(
                grid.match, point[known], values[known], (at.column, at.row, at.turn),
                REACH, np.radians(knobs.sway), ROUNDS,
            )  # fmt: skip
            found.append(Placement(column, row, cost, turn) if np.isfinite(cost) else at)
        return found

    def _expand(self, lay: Lay, at: Placement) -> float:
        """Give a placement what makes the quilt cheaper: an expansion move. Returns the gain."""
        state, net, patch = self.state, self.net, lay.patch
        spin = np.exp(1j * at.turn)
        spun = lay.plane * spin / self.grid.unit
        place = np.empty((len(spun), 2), np.float32)
        place[:, 0], place[:, 1] = at.column + spun.real, at.row - spun.imag
        angle = -np.angle(lay.turn * spin)
        unit = ASTRAY * self.grid.random_difference
        if self._near < ON_COURSE * self._placed:
            unit *= OFF_COURSE
        bias = self._astray(angle) - self._astray(state.angle[patch.order[: patch.inner]])
        if len(self._rim):
            bias[self._rim[patch.order[: patch.inner]]] = NEVER
        sheet = self.engine.sheet
        if len(sheet.barred):
            bias[barred_places(sheet.barred, sheet.frames[self.mine], place[: patch.inner])] = NEVER
        cut = recut(
            net.indptr, net.indices, patch.order, patch.inner, self._flattener.local, place,
            state.patch, state.source, state.ghost, self.grid.cut, unit * bias,
        )  # fmt: skip
        if cut.after < cut.before and cut.fresh.any():
            return self._accept(patch.order, cut.fresh, place, angle)
        return 0.0

    def _astray(self, angle: F4 | F8) -> F8:
        """Angles to the field in multiples of `near_field`, bounded."""
        near = np.radians(self.engine.parameters.near_field)
        return np.minimum(np.abs(angle.astype(np.float64)) / max(near, 1e-3), FARTHEST)

    def _accept(self, order: I4, fresh: NDArray[np.bool_], place: F4, angle: F8) -> float:
        """Take a cut if the seams recounted are cheaper, else leave every bit as it was."""
        state, net = self.state, self.net
        mine = order[: len(fresh)][fresh]
        slots = _slots(net.indptr, mine)
        kept = (
            state.source[mine], state.angle[mine], state.patch[mine], state.ghost[slots],
            state.patches,
        )  # fmt: skip
        state.accept(net, order, self._flattener.local, place, fresh, angle)
        gain = self.worst.update(mine)
        if not gain > 0:
            state.source[mine], state.angle[mine], state.patch[mine], state.ghost[slots] = kept[:4]
            state.patches = kept[4]
        else:
            self._near += int((self._astray(state.angle[mine]) < 1).sum())
            self._near -= int((self._astray(kept[1]) < 1).sum())
        return gain


def _slots(indptr: I4, vertices: I4) -> NDArray[np.int64]:
    """Slots of the half-edges that leave `vertices`, row by row."""
    length = (indptr[vertices + 1] - indptr[vertices]).astype(np.int64)
    first = np.cumsum(length) - length
    return np.arange(length.sum()) - np.repeat(first - indptr[vertices], length)


@njit(cache=True)
def _beside(indptr, indices, covered, own):  # type: ignore[no-untyped-def]
    """Which of the vertices `own` (N,) have a covered neighbour of another sample."""
    rim = np.zeros(len(own), np.bool_)
    for vertex in range(len(own)):
        if own[vertex]:
            for slot in range(indptr[vertex], indptr[vertex + 1]):
                if covered[indices[slot]] and not own[indices[slot]]:
                    rim[vertex] = True
    return rim
