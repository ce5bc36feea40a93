"""Erase, repair and re-quilt: background patches where the artist does not like what is there.

The same constrained graphcut as for painting, with other wishes: vertices that must change
are tied to the new patch, and features are unwanted (erase) or wanted as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.errors import InvalidEdit
from btfcore.paint.compose import PLACEMENTS, Aim, Composer, Tally
from btfcore.paint.edits import Area, EraseEdit, RepairEdit, RequiltEdit
from btfcore.paint.engine import Engine, Result
from btfcore.paint.outcome import concluded
from btfcore.paint.region import constrain
from btfcore.paint.symmetry import area_images
from btfcore.paint.wanted import FEATURE, Before, foreign_of, mask_of, orphans, rings
from btfcore.patch.flatten import FlatPatch
from btfcore.patch.grow import grow, release
from btfcore.progress import Progress
from btfcore.quilt.recut import vertex_costs
from btfcore.types import F8, I4

AROUND = 2  # rings around an erased feature that are replaced with it
RADIUS = 24  # levels of a patch where the area does not ask for more
TRIES = 8  # patches that may be centred on one vertex, each smaller than the one before
SMALLER = 0.7
LEAST = 2
MORE = 4  # times as many placements from the third patch on
SOME = 256  # vertices among which the next centre is looked for
WEIGHT = 0.5  # λ: features that stay are held by as much as painted ones
KEPT = 4.0  # λ where only seams are to be won
SIZES = (1.0, 0.6, 1.3, 0.4)  # of `RADIUS`, of the patches that cut a seam again
CORE = 3  # levels around the worst seam that are not matched
DEAREST, SUMMED = 64, 6  # vertices compared, and rings over which their seams are added up


@dataclass(eq=False)
class _Filling:
    """Vertices `forced` (N,) that must be replaced, by patches of the background.

    kept: whether features elsewhere stay as they are, bit for bit.
    """

    engine: Engine
    forced: NDArray[np.bool_]
    target: Callable[[I4], F8]
    before: Before
    kept: bool

    def aim(self, patch: FlatPatch) -> Aim:
        """What is wanted of a patch."""
        engine, order, inner = self.engine, patch.order, patch.inner
        state = engine.state
        was = self.before.feature(order)
        forced = self.forced[order] & ~engine.recorder.written(order)
        present = engine.palette.feature_at(state.sample[order], state.source[order])
        frozen = _barred(engine, order[:inner], engine.home(int(order[0])))
        target, known = self.target(order), (state.patch[order] >= 0) & ~forced
        if self.kept:
            # a patch of background can neither replace nor continue them
            held = (was > FEATURE) & ~self.forced[order]
            frozen |= held[:inner]
            target[held], known[held] = 0.0, False
        return Aim(
            target, present.astype(np.float64), known, forced[:inner] & ~frozen, frozen,
            strict=True,
        )  # fmt: skip

    def run(self, composers: dict[int, Composer], progress: Progress, extend: bool) -> I4:
        """Replace all vertices that must be; returns those that no patch could replace."""
        engine = self.engine
        self.forced &= engine.state.patch >= 0
        vertices = np.flatnonzero(self.forced).astype(np.int32)
        tries = np.zeros(len(self.forced), np.uint8)
        while True:
            left = vertices[~engine.recorder.written(vertices)]
            progress(1.0 - len(left) / max(len(vertices), 1), "filling")
            left = left[tries[left] < TRIES]
            if not len(left):
                break
            vertex = self._next(left)
            home = engine.home(vertex)
            size, again = min(RADIUS, engine.largest(home)), int(tries[vertex])
            size = max(int(size * SMALLER**again), LEAST)
            composer = composers[home]
            composer.placements = PLACEMENTS if again < 2 else MORE * PLACEMENTS
            composer.patch(vertex, size, self.aim, extend=extend or again > 0)
            tries[vertex] += 1
        return vertices[~engine.recorder.written(vertices)]

    def _next(self, left: I4) -> int:
        """Vertex to replace next: beside what is settled, so that patches have what to match."""
        net = self.engine.net
        some = left[:: max(len(left) // SOME, 1)]
        settled = _outside(net.indptr, net.indices, some, mask_of(self.engine, left))
        return int(some[int(settled.argmax())])


def erase(engine: Engine, edit: EraseEdit, progress: Progress) -> Result:
    """Replace features in the area by background; raises `InvalidEdit` for an empty area.

    Features outside the area stay, but for the two rings around those inside. What a sample
    that is no background there put around its features goes with them.
    """
    area, notes = _area(engine, edit.area, edit)
    before = Before(engine)
    foreign = foreign_of(engine)
    shown = area[(before.feature(area) > FEATURE) | foreign[area]]
    unwanted = mask_of(engine, rings(engine, shown, AROUND) if len(shown) else shown)
    unwanted[orphans(engine, before, unwanted, foreign, RADIUS)] = True
    inside = mask_of(engine, area)

    def target(vertices: I4) -> F8:
        return np.where(inside[vertices] | unwanted[vertices], 0.0, before.feature(vertices))

    filling = _Filling(engine, unwanted, target, before, kept=True)
    composers = _composers(engine, None)
    left = filling.run(composers, progress, extend=True)
    if not len(shown):
        notes.append("there is no feature in the area")
    return _ended(engine, composers, target, area, left, notes)


def repair(engine: Engine, edit: RepairEdit, progress: Progress) -> Result:
    """Synthesise the area anew; features in it stay where they are protected."""
    area, notes = _area(engine, edit.area, edit)
    before = Before(engine)
    forced = mask_of(engine, area)
    if edit.protect:
        forced[area[before.feature(area) > FEATURE]] = False

    def target(vertices: I4) -> F8:
        was = before.feature(vertices)
        return was if edit.protect else np.where(forced[vertices], 0.0, was)

    filling = _Filling(engine, forced, target, before, kept=edit.protect)
    composers = _composers(engine, np.random.default_rng(edit.seed))
    left = filling.run(composers, progress, extend=False)
    return _ended(engine, composers, target, area, left, notes)


def requilt(engine: Engine, edit: RequiltEdit, progress: Progress) -> Result:
    """Cut the worst seams in the area again, each with fresh placements; E never rises.

    Patches are centred in the area and may change what lies around it.
    """
    area, notes = _area(engine, edit.area, edit)
    before = Before(engine)
    composers = _composers(engine, None, KEPT)
    failures = np.zeros(len(engine.state.patch), np.uint8)
    near = rings(engine, area, 1)
    engine.recorder.reads(near)
    for number in range(edit.tries):
        progress(number / edit.tries, "cutting seams again")
        vertex = _worst(engine, area, failures)
        if vertex < 0:
            break
        home = engine.home(vertex)
        size = int(min(RADIUS, engine.largest(home)) * SIZES[failures[vertex] % len(SIZES)])
        changed = composers[home].patch(
            vertex, max(size, LEAST), lambda patch: _around(engine, before, patch)
        )
        if not len(changed):
            close, _ = grow(
                engine.net.indptr, engine.net.indices, vertex, CORE, engine.flattener.local, 10**6
            )
            release(close, engine.flattener.local)
            failures[close] += 1
    left = np.zeros(0, np.int32)
    return _ended(engine, composers, before.feature, area, left, notes, KEPT)


def _around(engine: Engine, before: Before, patch: FlatPatch) -> Aim:
    """Aim of a patch over a seam: all may change, the features stay, the middle is open."""
    state, order, inner = engine.state, patch.order, patch.inner
    target = before.feature(order)
    present = engine.palette.feature_at(state.sample[order], state.source[order])
    known = state.patch[order] >= 0
    levels = min(max(patch.radius // 2, 1), len(patch.start) - 1)
    known[: int(patch.start[levels])] = False
    none = np.zeros(inner, np.bool_)
    barred = _barred(engine, order[:inner], engine.home(int(order[0])))
    return Aim(
        target, present.astype(np.float64), known, none, barred, strict=True, seams=True
    )  # fmt: skip


def _barred(engine: Engine, vertices: I4, home: int) -> NDArray[np.bool_]:
    """Which of `vertices` (n,) may not take background sample `home`: other regions' own."""
    allowed = engine.state.allowed(home)
    return np.zeros(len(vertices), np.bool_) if allowed is None else ~allowed[vertices]


def _worst(engine: Engine, area: I4, failures: NDArray[np.uint8]) -> int:
    """Vertex of the area amid the dearest seams that were not tried in vain too often; -1: none."""
    net, state = engine.net, engine.state
    costs = np.zeros(len(state.patch))
    costs[area] = vertex_costs(
        net.indptr, net.indices, area, state.patch, state.source, state.ghost,
        engine.palette.sheet, state.sample,
    )  # fmt: skip
    open_ = area[(costs[area] > 0) & (failures[area] < len(SIZES))]
    if not len(open_):
        return -1
    some = open_[np.argsort(-costs[open_], kind="stable")[:DEAREST]]
    sums = np.zeros(len(some))
    for at, vertex in enumerate(some):
        near, _ = grow(net.indptr, net.indices, int(vertex), SUMMED, engine.flattener.local, 10**6)
        release(near, engine.flattener.local)
        sums[at] = costs[near].sum()
    return int(some[int(sums.argmax())])


@njit(cache=True)
def _outside(indptr, indices, vertices, inside):  # type: ignore[no-untyped-def]
    """How many neighbours each of `vertices` (n,) has that are not `inside` (N,)."""
    found = np.zeros(len(vertices), np.int32)
    for index in range(len(vertices)):
        for slot in range(indptr[vertices[index]], indptr[vertices[index] + 1]):
            if not inside[indices[slot]]:
                found[index] += 1
    return found


def _area(
    engine: Engine, area: Area, edit: EraseEdit | RepairEdit | RequiltEdit
) -> tuple[I4, list[str]]:
    """Dense vertices of an edit's area, and what is to be said about it."""
    mesh = engine.prepared.mesh
    whole, missed = area_images(area, edit.symmetry, mesh, engine.locator)
    found = constrain(whole, mesh, engine.net, engine.locator)
    notes = [f"{missed} images of the symmetry lie beside the surface"] if missed else []
    if found.dabs.skipped:
        notes.append(f"{found.dabs.skipped} places of the brush lie beside the surface")
    vertices = found.vertices[found.target > 0.5]
    vertices = vertices[engine.state.patch[vertices] >= 0]
    if not len(vertices):
        raise InvalidEdit(f"{edit.name or 'the edit'}: nothing is synthesised yet in its area")
    engine.recorder.reads(vertices)
    return vertices, notes


def _composers(
    engine: Engine, pick: np.random.Generator | None, weight: float = WEIGHT
) -> dict[int, Composer]:
    """A composer for each background sample, all with one tally and one E."""
    layout = engine.layout
    count = 1 if layout is None else len(layout.allowed)
    tally, unit = Tally(), engine.unit(0)
    made = {}
    for sample in range(count):
        own = weight * unit / engine.unit(sample)
        made[sample] = Composer(engine, sample, own, placements=PLACEMENTS, pick=pick)
        made[sample].tally = tally
    return made


def _ended(
    engine: Engine,
    composers: dict[int, Composer],
    target: Callable[[I4], F8],
    area: I4,
    left: I4,
    notes: list[str],
    weight: float = WEIGHT,
) -> Result:
    if len(left):
        notes.append(f"{len(left)} vertices could not be replaced")

    def reached() -> int:
        state = engine.state
        found = engine.palette.feature_at(state.sample[area], state.source[area])
        return int((np.abs(found - target(area)) < 0.5).sum())

    return concluded(
        engine, composers[0].tally, 0, weight, target, area, reached, notes, any_sample=True
    )
