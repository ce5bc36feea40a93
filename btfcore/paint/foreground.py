"""Foreground synthesis: a sample's feature over what strokes or an area ask for (Zhou §IV).

Patches are placed along a stroke while it is drawn, one work-patch radius apart, each as soon
as the brush is half a radius past it; what is left is filled when the stroke has ended. All of
this follows from the stroke's points alone, so replaying an edit gives the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from btfcore.paint.brush import BrushField, Dabs
from btfcore.paint.compose import Aim, Composer
from btfcore.paint.constrained import feature_of
from btfcore.paint.edits import PaintEdit, Stroke
from btfcore.paint.engine import Engine
from btfcore.paint.region import constrain, target, zone
from btfcore.paint.symmetry import origin_of, transforms
from btfcore.paint.wanted import Before
from btfcore.patch.flatten import FlatPatch
from btfcore.patch.grow import grow, release
from btfcore.progress import Progress, silent
from btfcore.quilt.lay import Lay
from btfcore.quilt.recut import vertex_costs
from btfcore.types import F4, F8, I4

SEARCHED = 24  # orientations tried where the sample has none of its own
LEAST, SLIM = 8, 18  # levels of a patch: at least, and beside the brush
FIRST_AHEAD = 0.0  # of the first patch, which shall appear at once
RETRY = 0.25  # radii from one patch to the next while none was kept
SPACING, AHEAD = 1.0, 0.5  # between patches along a stroke, and the brush's lead; in radii
TRIES = 2  # patches that may be centred near a place, the second smaller
SMALLER = 0.7
ENOUGH = 0.97  # share of the area that must be as wanted
POLISH = 0.5  # patches that mend seams, of those placed before
SEAM, DEAR = 0.4, 0.6  # radii of a place that is mended, and V/u per step of it that is worth it
MOST_CELLS = 64  # along an axis, in which places are looked for
WORTH = 0.04  # vertices lacking, per square of a patch's radius, that are worth another patch
TURNS = {"field": (0.0,), "search": tuple(2 * np.pi * np.arange(SEARCHED) / SEARCHED)}


@dataclass(eq=False)
class _Track:
    """One image of the stroke that is being drawn."""

    brush: BrushField
    zone: float
    radius: int
    dabs: list[tuple[int, float, F8]] = field(default_factory=list)
    at: int = 0  # dabs whose turn to be a patch's centre is over
    due: float = 0.0
    shown: bool = False  # whether a patch was kept


class Painter:
    """Paints one edit; `engine` must be recording it."""

    def __init__(self, engine: Engine, edit: PaintEdit) -> None:
        """Prepare; an area's faces, region and vertices are taken at once."""
        self.engine, self.edit = engine, edit
        sample, palette = edit.sample, engine.palette
        natural = palette.half_width(sample) * palette.grids[sample].unit
        self.width = natural if edit.transition is None else edit.transition / engine.step
        self.composer = Composer(engine, sample, edit.weight)
        self._orientation: str = edit.orientation
        if edit.orientation == "auto":
            self._orientation = "search" if engine.isotropic(sample) else "field"
        self.before = Before(engine)
        self.wanted: F4 = np.zeros(len(engine.state.patch), np.float32)
        mesh = engine.prepared.mesh
        self._images = transforms(edit.symmetry)
        self._origin = origin_of(edit.symmetry, mesh)
        self._tracks: list[_Track] = []
        self._largest, self._skipped, self._weightless = 0, 0, 0
        area = edit.area
        if area.faces is not None or area.region or area.everywhere or area.vertices is not None:
            found = constrain(
                replace(area, strokes=()), mesh, engine.net, engine.locator,
                width=self.width * engine.step,
            )  # fmt: skip
            self.wanted[found.vertices] = found.target
            self._largest = engine.largest(sample)

    # --- strokes

    def begin(self, stroke: Stroke) -> None:
        """Begin a stroke of the radius and hardness of `stroke`, without its points."""
        reach = stroke.radius / self.engine.step
        # a zone wider than the brush would leave nothing that is wanted wholly
        width = min(self.width, reach) if self.edit.transition is None else self.width
        wide = zone(reach, stroke.hardness, width)
        size = self._size(reach)
        self._largest = max(self._largest, size)
        self._tracks = []
        for _ in self._images:
            brush = BrushField(self.engine.net, self.engine.locator, reach=wide / 2)
            brush.begin(stroke.radius)
            self._tracks.append(_Track(brush, wide, size))

    def extend(self, points: F8, normals: F8 | None, pressure: F8 | None) -> list[I4]:
        """Go on with the stroke, point by point; returns what each patch changed."""
        changed: list[I4] = []
        for at in range(len(points)):
            one = slice(at, at + 1)
            for matrix, track in zip(self._images, self._tracks, strict=True):
                place = self._origin + _turned(points[one] - self._origin, matrix)
                side = None if normals is None else _turned(normals[one], matrix)
                force = None if pressure is None else pressure[one]
                self._take(track, track.brush.extend(place, side, force))
                changed += self._patches(
                    track, FIRST_AHEAD if track.due == 0 else AHEAD * track.radius
                )
        return changed

    def end(self) -> list[I4]:
        """End the stroke; returns what its last patches changed."""
        changed: list[I4] = []
        for track in self._tracks:
            self._take(track, track.brush.finish())
            changed += self._patches(track, 0.0)
        self._tracks = []
        return changed

    def _take(self, track: _Track, dabs: Dabs) -> None:
        """Note what new dabs ask for."""
        self._skipped += dabs.skipped
        self._weightless += dabs.weightless
        lowered = dabs.lowered
        asked = target(track.brush.value[lowered], track.zone)
        self.wanted[lowered] = np.maximum(self.wanted[lowered], asked)
        track.dabs += zip(dabs.vertex.tolist(), dabs.arc.tolist(), dabs.direction, strict=True)

    def _patches(self, track: _Track, lead: float) -> list[I4]:
        """Place the patches that are due where the brush is `lead` steps past them."""
        changed = []
        while track.at < len(track.dabs):
            vertex, arc, direction = track.dabs[track.at]
            if arc >= track.due:
                if track.dabs[-1][1] < arc + lead:
                    break
                changed.append(self._patch(vertex, track.radius, direction))
                track.shown |= len(changed[-1]) > 0
                # where a stroke has only begun, too little may be wanted for a patch to pay
                track.due = arc + (SPACING if track.shown else RETRY) * track.radius
            track.at += 1
        return changed

    # --- what strokes leave

    def fill(self, *, progress: Progress = silent) -> list[I4]:
        """Place patches where most is not as wanted yet, until nothing more helps."""
        engine = self.engine
        area = self.area
        area = area[engine.state.patch[area] >= 0]
        engine.recorder.reads(area)  # what is there decides where patches go
        tries = np.zeros(len(self.wanted), np.uint8)
        lacking = np.zeros(len(self.wanted), np.bool_)
        lacking[area] = self._present(area) < 0.5
        changed: list[I4] = []
        while len(area):
            done = 1.0 - float(lacking[area].mean())
            progress(min(done, 1.0), "painting")
            if done >= ENOUGH:
                break
            vertex, count = self._densest(area[lacking[area] & (tries[area] < TRIES)])
            if count < WORTH * self._largest**2:
                break
            size = self._largest if tries[vertex] == 0 else int(SMALLER * self._largest)
            fresh = self._patch(vertex, max(size, LEAST), None)
            lacking[fresh] = (self.wanted[fresh] > 0.5) & (self._present(fresh) < 0.5)
            changed.append(fresh)
            near, _ = grow(
                engine.net.indptr, engine.net.indices, vertex, max(size // 2, 1),
                engine.flattener.local, 10**9,
            )  # fmt: skip
            release(near, engine.flattener.local)
            tries[near] += 1
        return changed

    def polish(self, *, progress: Progress = silent) -> list[I4]:
        """Cut the dearest seams that the edit left again, while that is worth it."""
        engine, state, net = self.engine, self.engine.state, self.engine.net
        changed: list[I4] = []
        rest = np.zeros(len(self.wanted), np.bool_)
        tries = round(POLISH * self.composer.tally.tries)
        for at in range(tries):
            progress(at / tries, "mending seams")
            mine = engine.recorder.changed
            mine = np.sort(mine[~rest[mine]])
            costs = vertex_costs(
                net.indptr, net.indices, mine, state.patch, state.source, state.ghost,
                engine.palette.sheet, state.sample,
            ) / engine.unit(self.edit.sample)  # fmt: skip
            vertex, total = self._densest(mine, costs, SEAM * self._largest)
            if total < DEAR * SEAM * self._largest:
                break
            fresh = self.composer.patch(
                vertex, self._largest, self._open_aim, turns=TURNS.get(self._orientation, (0.0,))
            )
            changed.append(fresh)
            near, _ = grow(
                net.indptr, net.indices, vertex, max(int(SEAM * self._largest), 1),
                engine.flattener.local, 10**9,
            )  # fmt: skip
            release(near, engine.flattener.local)
            rest[near] = True
        return changed

    def _open_aim(self, patch: FlatPatch) -> Aim:
        """As `_aim`, but what lies in the middle need not be continued."""
        aim = self._aim(patch)
        levels = min(max(patch.radius // 3, 1), len(patch.start) - 1)
        known = aim.known.copy()
        known[: int(patch.start[levels])] = False
        return replace(aim, known=known, seams=True)

    def _densest(
        self, open_: I4, weight: F8 | None = None, side: float | None = None
    ) -> tuple[int, float]:
        """Vertex amid the place where most of `open_` lie together, and how many these are.

        weight (n,): what each counts, None: 1; side: of a place in steps, None: of a patch.
        """
        if not len(open_):
            return -1, 0.0
        weight = np.ones(len(open_)) if weight is None else weight
        points = self.engine.prepared.dense.vertices[open_]
        low = points.min(axis=0)
        # cells no smaller than keeps their number bounded
        side = max(
            max(self._largest if side is None else side, 1.0) * self.engine.step,
            float((points.max(axis=0) - low).max()) / MOST_CELLS,
        )
        cell = ((points - low) / side).astype(np.int64)
        key = (cell[:, 0] * (MOST_CELLS + 1) + cell[:, 1]) * (MOST_CELLS + 1) + cell[:, 2]
        counts = np.bincount(key, weight)
        most = int(counts.argmax())
        if not counts[most] > 0:
            return -1, 0.0
        inside = np.flatnonzero(key == most)
        middle = np.average(points[inside], axis=0, weights=weight[inside])
        nearest = inside[int(((points[inside] - middle) ** 2).sum(axis=1).argmin())]
        return int(open_[nearest]), float(counts[most])

    @property
    def area(self) -> I4:
        """Vertices (n,) i4 of F: where the feature is wanted more than not."""
        return np.flatnonzero(self.wanted > 0.5).astype(np.int32)

    @property
    def off_surface(self) -> int:
        """Dabs that met no surface."""
        return self._skipped

    def asked(self, vertices: I4) -> F8:
        """m_0 (n,) f8 of the edit's own area alone."""
        return self.wanted[vertices].astype(np.float64)

    def target(self, vertices: I4) -> F8:
        """m_0 (n,) f8, features that are there already included where they are protected."""
        asked = self.asked(vertices)
        if self.edit.protect:
            np.maximum(asked, self.before.feature(vertices), out=asked)
        return asked

    def _present(self, vertices: I4) -> F8:
        engine = self.engine
        return feature_of(
            engine.state, engine.palette, self.edit.sample, vertices, self.asked(vertices)
        )

    def _aim(self, patch: FlatPatch) -> Aim:
        order, inner = patch.order, patch.inner
        wanted = self.target(order)
        present = self._present(order)
        none = np.zeros(inner, np.bool_)
        covered = self.engine.state.patch[order] >= 0
        return Aim(wanted, present, covered & (np.abs(present - wanted) < 0.5), none, none)

    def _size(self, brush: float) -> int:
        """Levels of a work patch for a brush of `brush` steps."""
        if self.edit.work_patch is not None:
            return self.edit.work_patch
        unit = self.engine.palette.grids[self.edit.sample].unit
        most = self.engine.largest(self.edit.sample)
        return int(np.clip(round(1.2 * brush + SLIM * min(unit, 2.0)), min(LEAST, most), most))

    def _patch(self, vertex: int, radius: int, direction: F8 | None) -> I4:
        turns: Sequence[float] | None = TURNS.get(self._orientation)
        if turns is not None:
            return self.composer.patch(vertex, radius, self._aim, turns=turns)
        if direction is None or not direction.any():
            return self.composer.patch(vertex, radius, self._aim)
        return self.composer.patch(
            vertex, radius, self._aim, turns_of=lambda lay: self._along(lay, direction)
        )

    def _along(self, lay: Lay, direction: F8) -> tuple[float, ...]:
        """Turns that lay the feature's main axis along the stroke."""
        prepared, vertex = self.engine.prepared, int(lay.patch.order[0])
        along = np.asarray(prepared.field.tangents[vertex], np.float64)
        up = np.asarray(prepared.dense.normals[vertex], np.float64)
        across = np.cross(up, along)
        heading = float(np.arctan2((direction * across).sum(), (direction * along).sum()))
        turn = self.engine.palette.axis(self.edit.sample) - heading - float(np.angle(lay.turn[0]))
        return turn, turn + np.pi


def _turned(vectors: F8, matrix: F8) -> F8:
    return np.einsum("ij,...j->...i", matrix, np.asarray(vectors, np.float64))
