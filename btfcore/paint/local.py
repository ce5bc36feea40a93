"""Erase, repair and re-quilt: background patches where the artist does not like what is there.

The same constrained graphcut as for painting, with other wishes: vertices that must change
are tied to the new patch, and features are unwanted (erase) or wanted as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from btfcore.errors import InvalidEdit
from btfcore.paint.compose import PLACEMENTS, Aim, Composer, Tally
from btfcore.paint.edits import Area, EraseEdit, RepairEdit, RequiltEdit
from btfcore.paint.engine import Engine, Result
from btfcore.paint.outcome import concluded
from btfcore.paint.region import constrain
from btfcore.paint.symmetry import area_images
from btfcore.paint.wanted import FEATURE, Before, mask_of, rings
from btfcore.patch.flatten import FlatPatch
from btfcore.patch.grow import grow, release
from btfcore.progress import Progress
from btfcore.quilt.recut import vertex_costs
from btfcore.types import F8, I4

AROUND = 2  # rings around an erased feature that are replaced with it
RADIUS = 24  # levels of a patch where the area does not ask for more
TRIES = 4  # patches that may be centred on one vertex, each smaller than the one before
SMALLER = 0.7
LEAST = 4
WEIGHT = 0.5  # λ: features that stay are held by as much as painted ones
SIZES = (1.0, 0.6, 1.3, 0.4)  # of `RADIUS`, of the patches that cut a seam again
CORE = 3  # levels around the worst seam that are not matched
SUMMED = 6  # rings over which seam costs are added up


@dataclass(eq=False)
class _Filling:
    """Vertices that must be replaced, by patches of the background."""

    engine: Engine
    forced: NDArray[np.bool_]
    target: Callable[[I4], F8]
    before: Before
    frozen: NDArray[np.bool_] | None = None

    def aim(self, patch: FlatPatch) -> Aim:
        """What is wanted of a patch."""
        engine, order, inner = self.engine, patch.order, patch.inner
        state = engine.state
        self.before.feature(order)
        forced = self.forced[order] & ~engine.recorder.written(order)
        present = engine.palette.feature_at(state.sample[order], state.source[order])
        frozen = np.zeros(inner, np.bool_)
        if self.frozen is not None:
            frozen = self.frozen[order[:inner]]
        known = (state.patch[order] >= 0) & ~forced
        return Aim(
            self.target(order), present.astype(np.float64), known, forced[:inner] & ~frozen,
            frozen, strict=True,
        )  # fmt: skip

    def run(self, composers: dict[int, Composer], progress: Progress, extend: bool) -> I4:
        """Replace all vertices that must be; returns those that no patch could replace."""
        engine = self.engine
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
            size = min(RADIUS, engine.largest(home))
            size = max(int(size * SMALLER ** int(tries[vertex])), LEAST)
            composers[home].patch(vertex, size, self.aim, extend=extend)
            tries[vertex] += 1
        return vertices[~engine.recorder.written(vertices)]

    def _next(self, left: I4) -> int:
        """Vertex to replace next: beside what is settled, so that patches have what to match."""
        net = self.engine.net
        waiting = mask_of(self.engine, left)
        settled = np.array(
            [
                int((~waiting[net.indices[net.indptr[v] : net.indptr[v + 1]]]).sum())
                for v in left[:: max(len(left) // 256, 1)]
            ]
        )
        return int(left[:: max(len(left) // 256, 1)][int(settled.argmax())])


def erase(engine: Engine, edit: EraseEdit, progress: Progress) -> Result:
    """Replace features in the area by background; raises `InvalidEdit` for an empty area."""
    area, notes = _area(engine, edit.area, edit)
    before = Before(engine)
    shown = area[before.feature(area) > FEATURE]
    unwanted = mask_of(engine, rings(engine, shown, AROUND) if len(shown) else shown)
    inside = mask_of(engine, area)

    def target(vertices: I4) -> F8:
        return np.where(inside[vertices] | unwanted[vertices], 0.0, before.feature(vertices))

    filling = _Filling(engine, unwanted, target, before)
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
    frozen = None
    if edit.protect:
        kept = area[before.feature(area) > FEATURE]
        frozen = mask_of(engine, kept)
        forced &= ~frozen

    def target(vertices: I4) -> F8:
        was = before.feature(vertices)
        return was if edit.protect else np.where(forced[vertices], 0.0, was)

    filling = _Filling(engine, forced, target, before, frozen)
    composers = _composers(engine, np.random.default_rng(edit.seed))
    left = filling.run(composers, progress, extend=False)
    return _ended(engine, composers, target, area, left, notes)


def requilt(engine: Engine, edit: RequiltEdit, progress: Progress) -> Result:
    """Cut the worst seams in the area again, each with fresh placements; E never rises."""
    area, notes = _area(engine, edit.area, edit)
    before = Before(engine)
    composers = _composers(engine, None)
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
    return _ended(engine, composers, before.feature, area, np.zeros(0, np.int32), notes)


def _around(engine: Engine, before: Before, patch: FlatPatch) -> Aim:
    """Aim of a patch over a seam: all may change, the features stay, the middle is open."""
    state, order, inner = engine.state, patch.order, patch.inner
    target = before.feature(order)
    present = engine.palette.feature_at(state.sample[order], state.source[order])
    known = state.patch[order] >= 0
    levels = min(max(patch.radius // 2, 1), len(patch.start) - 1)
    known[: int(patch.start[levels])] = False
    none = np.zeros(inner, np.bool_)
    return Aim(target, present.astype(np.float64), known, none, none, strict=True)


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
    some = open_[np.argsort(-costs[open_], kind="stable")[:64]]
    sums = [float(costs[rings(engine, some[at : at + 1], SUMMED)].sum()) for at in range(len(some))]
    return int(some[int(np.argmax(sums))])


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


def _composers(engine: Engine, pick: np.random.Generator | None) -> dict[int, Composer]:
    """A composer for each background sample, all with one tally."""
    layout = engine.layout
    count = 1 if layout is None else len(layout.allowed)
    tally = Tally()
    made = {}
    for sample in range(count):
        made[sample] = Composer(engine, sample, WEIGHT, placements=PLACEMENTS, pick=pick)
        made[sample].tally = tally
    return made


def _ended(
    engine: Engine,
    composers: dict[int, Composer],
    target: Callable[[I4], F8],
    area: I4,
    left: I4,
    notes: list[str],
) -> Result:
    if len(left):
        notes.append(f"{len(left)} vertices could not be replaced")

    def reached() -> int:
        state = engine.state
        found = engine.palette.feature_at(state.sample[area], state.source[area])
        return int((np.abs(found - target(area)) < 0.5).sum())

    return concluded(engine, composers[0].tally, 0, WEIGHT, target, area, reached, notes)
