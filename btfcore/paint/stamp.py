"""Verbatim copy of a feature (Zhou §IV-B; Kwatra et al. 2003, §4.4, "interactive merging").

The exponential map at the point carries the feature over as it is; the preview shows it
there. Merging is one constrained graphcut in which the feature's vertices must turn new and
those around them may.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from btfcore.errors import InvalidEdit
from btfcore.paint.compose import Aim, Composer
from btfcore.paint.delta import slots_of
from btfcore.paint.edits import StampEdit
from btfcore.paint.engine import Engine, Result
from btfcore.paint.outcome import concluded
from btfcore.paint.parts import SHOWN, Part, alpha_at
from btfcore.paint.symmetry import stamp_images
from btfcore.paint.wanted import Before
from btfcore.patch.flatten import FlatPatch
from btfcore.patch.grow import near_levels
from btfcore.progress import Progress
from btfcore.quilt.lay import Lay, lay_along_field
from btfcore.quilt.matching import Placement
from btfcore.quilt.register import warped
from btfcore.types import F4, F8, I4

RIM = 14  # levels around the feature in which the seam may run
SLACK = 1.25  # levels of a patch per step of the feature's radius
HELD = 12  # flattened places that are remembered
CREASED, MANY = 1.4, 0.05  # a warning where more than this share of edges is stretched more


@dataclass(frozen=True, eq=False)
class Preview:
    """A feature projected onto the surface, not yet merged.

    vertices (n,) i4; source (n, 2) f4: positions on the sample's grid; alpha (n,) f4: m_S.
    """

    vertices: I4
    source: F4
    alpha: F4


class Stamper:
    """Projects and merges stamps; flattened places are remembered while it lives."""

    def __init__(self, engine: Engine) -> None:
        """Work on `engine`'s quilt."""
        self.engine = engine
        self._lays: dict[tuple[int, int], Lay] = {}

    def preview(self, edit: StampEdit) -> tuple[Preview, ...]:
        """Where the feature would lie, for the stamp and each image of its symmetry."""
        part = self.engine.part(edit.sample, edit.feature)
        shown = []
        for image in self._images(edit)[0]:
            lay, vertex, offset = self._at(image, part)
            place = self._placed(lay, edit.sample, self._placement(lay, image, part, offset))
            alpha = alpha_at(part.alpha, place)
            inside = alpha > SHOWN
            shown.append(Preview(lay.patch.order[inside], place[inside], alpha[inside]))
        return tuple(shown)

    def merge(self, edit: StampEdit, progress: Progress) -> Result:
        """Merge a stamp and its images into the quilt; the engine must be recording it."""
        engine = self.engine
        part = engine.part(edit.sample, edit.feature)
        composer = Composer(engine, edit.sample, edit.weight)
        before = Before(engine)
        wanted = np.zeros(len(engine.state.patch), np.float32)
        images, missed = self._images(edit)
        notes = [f"{missed} images of the symmetry lie beside the surface"] if missed else []
        if part.cut:
            notes.append("the feature touches the sample's border and ends there as if cut off")
        for at, image in enumerate(images):
            progress(at / len(images), "stamping")
            lay, _, offset = self._at(image, part)
            if _creased(engine, lay):
                notes.append("the surface under the stamp is creased: the feature is distorted")
            placement = self._placement(lay, image, part, offset)
            place = self._placed(lay, edit.sample, placement)
            alpha = alpha_at(part.alpha, place)
            near = _trimmed(engine, lay, alpha > SHOWN)
            if near is None:
                raise InvalidEdit(
                    f"{edit.name or 'the stamp'}: nothing of the feature lies on the surface"
                )
            order = near.patch.order
            shown = alpha[_positions(lay.patch.order, order)]
            wanted[order] = np.maximum(wanted[order], shown)
            composer.place(near, self._aim(edit, before, shown), placement)
        area = np.flatnonzero(wanted > 0.5).astype(np.int32)

        def target(vertices: I4) -> F8:
            return np.maximum(wanted[vertices], before.feature(vertices))

        def reached() -> int:
            state = engine.state
            found = engine.palette.feature_at(state.sample[area], state.source[area])
            return int(((found >= 0.5) & (state.sample[area] == edit.sample)).sum())

        return concluded(
            engine, composer.tally, edit.sample, edit.weight, target, area, reached, notes
        )

    def _images(self, edit: StampEdit) -> tuple[tuple[StampEdit, ...], int]:
        prepared = self.engine.prepared
        return stamp_images(edit, prepared.mesh, prepared.field, self.engine.locator)

    def _at(self, edit: StampEdit, part: Part) -> tuple[Lay, int, complex]:
        """Flattened surface around a stamp, its centre vertex, and the point in that plane."""
        engine = self.engine
        normal = None if edit.normal is None else np.array(edit.normal, np.float64)
        foot = engine.locator.find(np.array(edit.point), normal, what="the stamp")
        vertex = int(foot.vertex[0])
        unit = engine.palette.grids[edit.sample].unit * edit.scale
        radius = int(np.ceil(SLACK * (part.radius * unit + 1))) + RIM
        key = (vertex, radius)
        if key not in self._lays:
            flat = engine.flattener.whole(vertex, radius)
            lay = lay_along_field(engine.net, engine.flattener.local, flat, bend=0.0)
            engine.flattener.release(flat)
            while len(self._lays) >= HELD:
                self._lays.pop(next(iter(self._lays)))
            self._lays[key] = lay
        lay = self._lays[key]
        corner = foot.corner[0]
        local = _positions(lay.patch.order, corner)
        if (local < 0).any():
            return lay, vertex, 0j
        return lay, vertex, complex((foot.bary[0] * lay.plane[local]).sum())

    def _placement(self, lay: Lay, edit: StampEdit, part: Part, offset: complex) -> Placement:
        """Placement that puts the part's centre on the point, turned and scaled as asked."""
        turn = -np.radians(edit.rotation) - float(np.angle(lay.turn[0]))
        unit = self.engine.palette.grids[edit.sample].unit
        shift = np.exp(1j * turn) * offset / (unit * edit.scale)
        column, row = part.centre
        warp = (1.0 / edit.scale - 1.0, 0.0, 0.0, 0.0, 0.0)
        return Placement(column - shift.real, row + shift.imag, 0.0, turn, warp)

    def _placed(self, lay: Lay, sample: int, at: Placement) -> F4:
        points = lay.points(self.engine.palette.grids[sample].unit)
        place, _ = warped(points, np.array([at.column, at.row, at.turn, *at.warp]), 1.0)
        return np.asarray(place.astype(np.float32))

    def _aim(self, edit: StampEdit, before: Before, alpha: F4) -> Callable[[FlatPatch], Aim]:
        def aim(patch: FlatPatch) -> Aim:
            engine, order, inner = self.engine, patch.order, patch.inner
            state = engine.state
            kept = before.feature(order)
            target = np.maximum(alpha.astype(np.float64), kept if edit.protect else 0.0)
            present = engine.palette.feature_at(state.sample[order], state.source[order])
            forced = near_levels(
                engine.net.indptr, engine.net.indices, order, engine.flattener.local,
                alpha > 0.5, 1,
            )[:inner]  # fmt: skip
            frozen = np.zeros(inner, np.bool_)
            if edit.protect:
                frozen = (kept[:inner] > 0.5) & ~forced
            known = np.zeros(len(order), np.bool_)
            return Aim(target, present.astype(np.float64), known, forced, frozen, strict=True)

        return aim


def _trimmed(engine: Engine, lay: Lay, inside: NDArray[np.bool_]) -> Lay | None:
    """Part of a patch within `RIM` levels of the vertices `inside` (n,), and its ring."""
    if not inside.any():
        return None
    net, flattener, patch = engine.net, engine.flattener, lay.patch
    flattener.hold(patch)
    try:
        near = near_levels(net.indptr, net.indices, patch.order, flattener.local, inside, RIM)
        near[patch.inner :] = False
        ring = near_levels(net.indptr, net.indices, patch.order, flattener.local, near, 1) & ~near
    finally:
        flattener.release(patch)
    proper = np.flatnonzero(near)
    at = np.concatenate([proper, np.flatnonzero(ring)])
    start = np.array([0, len(proper), len(at)], np.int32)
    part = FlatPatch(
        patch.order[at], start, len(proper), patch.plane[at], patch.kind, patch.radius, 0
    )
    return Lay(part, lay.plane[at], lay.turn[proper], lay.mean)


def _positions(order: I4, vertices: I4) -> NDArray[np.intp]:
    """Position of each of `vertices` in `order`, -1 where it is not there."""
    rank = np.argsort(order, kind="stable")
    at = np.searchsorted(order[rank], vertices)
    at = np.minimum(at, len(order) - 1)
    found = rank[at]
    return np.where(order[found] == vertices, found, -1)


def _creased(engine: Engine, lay: Lay) -> bool:
    """Whether the map under a stamp stretches many edges."""
    net, order, flattener = engine.net, lay.patch.order, engine.flattener
    tails = order[: lay.patch.inner]
    flattener.hold(lay.patch)
    try:
        rows = net.indptr[tails + 1] - net.indptr[tails]
        slots = slots_of(net.indptr, tails)
        here = np.repeat(np.arange(lay.patch.inner), rows)
        there = flattener.local[net.indices[slots]]
    finally:
        flattener.release(lay.patch)
    drawn = np.abs(lay.plane[there] - lay.plane[here])
    length = np.sqrt((net.edge[slots].astype(np.float64) ** 2).sum(axis=1))
    ratio = np.maximum(drawn, 1e-12) / np.maximum(length, 1e-12)
    return float(((ratio > CREASED) | (ratio < 1 / CREASED)).mean()) > MANY
