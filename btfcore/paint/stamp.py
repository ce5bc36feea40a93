"""Verbatim copy of a feature (Zhou §IV-B; Kwatra et al. 2003, §4.4, "interactive merging").

The exponential map at the point carries the feature over as it is; the preview shows it
there. Merging is one constrained graphcut in which the feature's vertices must turn new and
those around them may. The rim in which the seam may run is mapped when the stamp is merged;
the disc under the feature keeps its coordinates, so the merged feature is the preview's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.errors import InvalidEdit
from btfcore.paint.compose import Aim, Composer
from btfcore.paint.edits import StampEdit
from btfcore.paint.engine import Engine, Result
from btfcore.paint.outcome import concluded
from btfcore.paint.parts import SHOWN, Part, alpha_at
from btfcore.paint.symmetry import stamp_images
from btfcore.paint.wanted import Before
from btfcore.patch.disc import Disc, disc, grown
from btfcore.patch.distortion import field_directions
from btfcore.patch.flatten import FlatPatch
from btfcore.patch.grow import near_levels
from btfcore.progress import Progress
from btfcore.quilt.lay import Lay
from btfcore.quilt.matching import Placement
from btfcore.quilt.register import warped
from btfcore.types import F4, F8, I4

RIM = 14  # levels around the feature in which the seam may run
ROUND = 4  # steps; radii of discs are multiples of it, so that they serve many scales
LIMIT = 250_000  # vertices under a stamp
HELD = 12  # discs that are remembered
CREASED, MANY = 1.4, 0.05  # a warning where more than this share of edges is stretched more
SMEARED, SHORT = 1.6, 0.3  # background is not copied where an edge, no shorter, is stretched more
FOLDED = 2.0  # way along edges over the distance in the plane, where the map leads back
WHOLE = 0.9  # share of the feature's area that should lie on the surface


@dataclass(frozen=True, eq=False)
class Preview:
    """A feature projected onto the surface, not yet merged.

    vertices (n,) i4; source (n, 2) f4: positions on the sample's grid; alpha (n,) f4: m_S.
    """

    vertices: I4
    source: F4
    alpha: F4


@dataclass(frozen=True, eq=False)
class _Print:
    """Where one image of a stamp lies: its disc, how it is placed, and m_S (n,) there."""

    disc: Disc
    radius: int
    at: Placement
    place: F4
    alpha: F4


class Stamper:
    """Projects and merges stamps; discs are remembered while it lives."""

    def __init__(self, engine: Engine) -> None:
        """Work on `engine`'s quilt."""
        self.engine = engine
        self._discs: dict[tuple[int, int], Disc] = {}

    def preview(self, edit: StampEdit) -> tuple[Preview, ...]:
        """Where the feature would lie, for the stamp and each image of its symmetry.

        Raises `InvalidEdit` as `merge` does.
        """
        part = self.engine.part(edit.sample, edit.feature)
        shown = []
        for image in self._images(edit)[0]:
            found = self._print(image, part)
            inside = found.alpha > SHOWN
            shown.append(
                Preview(found.disc.order[inside], found.place[inside], found.alpha[inside])
            )
        return tuple(shown)

    def merge(self, edit: StampEdit, progress: Progress) -> Result:
        """Merge a stamp and its images into the quilt; the engine must be recording it.

        Raises `InvalidEdit` where the point is off the surface, where nothing of the feature
        lies on what is synthesised, or where it covers too much.
        """
        engine = self.engine
        part = engine.part(edit.sample, edit.feature)
        composer = Composer(engine, edit.sample, edit.weight)
        before = Before(engine)
        wanted = np.zeros(len(engine.state.patch), np.float32)
        images, missed = self._images(edit)
        notes = []
        if part.cut:
            notes.append("the feature touches the sample's border and ends there as if cut off")
        for at, image in enumerate(images):
            progress(at / len(images), "stamping")
            found = self._print(image, part)
            order, inside = found.disc.order, found.alpha > SHOWN
            engine.recorder.reads(order[inside])
            if not (engine.state.patch[order[inside]] >= 0).any():
                missed += 1
                continue
            notes += self._warnings(found, part, edit)
            wanted[order] = np.maximum(wanted[order], found.alpha)
            near, way = self._rim(found)
            place = self._placed(near.plane, edit.sample, found.at)
            target = _alpha(part, place, near.plane, way)
            composer.place(near, self._aim(edit, before, target), found.at)
        if not wanted.any():
            raise InvalidEdit(
                f"{edit.name or 'the stamp'}: its feature meets nothing that is synthesised"
            )
        if missed:
            notes.append(f"{missed} images of the symmetry lie beside what is synthesised")
        area = np.flatnonzero(wanted > 0.5).astype(np.int32)

        def target_of(vertices: I4) -> F8:
            return np.maximum(wanted[vertices], before.feature(vertices))

        def reached() -> int:
            state = engine.state
            shown = engine.palette.feature_at(state.sample[area], state.source[area])
            return int(((shown >= 0.5) & (state.sample[area] == edit.sample)).sum())

        return concluded(
            engine, composer.tally, edit.sample, edit.weight, target_of, area, reached,
            list(dict.fromkeys(notes)),
        )  # fmt: skip

    def _images(self, edit: StampEdit) -> tuple[tuple[StampEdit, ...], int]:
        prepared = self.engine.prepared
        return stamp_images(edit, prepared.mesh, prepared.field, self.engine.locator)

    def _print(self, edit: StampEdit, part: Part) -> _Print:
        """Map the surface under a plain stamp and lay the part's centre on its point."""
        engine = self.engine
        normal = None if edit.normal is None else np.array(edit.normal, np.float64)
        foot = engine.locator.find(np.array(edit.point), normal, what="the stamp")
        vertex, away = int(foot.vertex[0]), float(foot.start[0].min())
        size = engine.palette.grids[edit.sample].unit * edit.scale
        radius = int(-(-(part.radius * size + size + away) // ROUND) * ROUND)
        found = self._disc(vertex, radius)
        if found.full and found.open.any():
            raise InvalidEdit(
                f"{edit.name or 'the stamp'}: its feature spans {2 * part.radius * size:.0f} steps"
                f" of the dense mesh, more than {LIMIT:,} vertices; make it smaller"
            )
        # the triangle's corners are the centre and two of its neighbours, first in the order
        first = found.order[:64]
        offset = 0j
        for corner, share in zip(foot.corner[0], foot.bary[0], strict=True):
            here = np.flatnonzero(first == corner)
            if len(here):
                offset += share * complex(*found.plane[here[0]])
        turn = -float(np.radians(edit.rotation))
        shift = np.exp(1j * turn) * offset / size
        column, row = part.centre
        warp = (1.0 / edit.scale - 1.0, 0.0, 0.0, 0.0, 0.0)
        at = Placement(column - shift.real, row + shift.imag, 0.0, turn, warp)
        plane = found.plane[:, 0] + 1j * found.plane[:, 1]
        place = self._placed(plane, edit.sample, at)
        return _Print(found, radius, at, place, _alpha(part, place, plane, found.way))

    def _disc(self, vertex: int, radius: int) -> Disc:
        """Disc in the frame of its centre, +x along the field there."""
        key = (vertex, radius)
        if key not in self._discs:
            engine = self.engine
            while len(self._discs) >= HELD:
                self._discs.pop(next(iter(self._discs)))
            self._discs[key] = disc(engine.net, engine.flattener.local, vertex, radius, LIMIT)
        return self._discs[key]

    def _placed(self, plane: NDArray[np.complex128], sample: int, at: Placement) -> F4:
        """Positions (n, 2) f4 on the sample's grid of points in the disc's plane."""
        points = plane / self.engine.palette.grids[sample].unit
        place, _ = warped(points, np.array([at.column, at.row, at.turn, *at.warp]), 1.0)
        return np.asarray(place.astype(np.float32))

    def _rim(self, found: _Print) -> tuple[Lay, F8]:
        """Patch of the vertices within `RIM` levels of the feature, and the ways (n,) to them."""
        engine = self.engine
        net, local = engine.net, engine.flattener.local
        wide = grown(net, local, found.disc, found.radius + RIM, 2 * LIMIT)
        inside = np.zeros(len(wide.order), np.bool_)
        inside[: len(found.alpha)] = found.alpha > SHOWN
        local[wide.order] = np.arange(len(wide.order), dtype=np.int32)
        near = near_levels(net.indptr, net.indices, wide.order, local, inside, RIM) & ~wide.open
        ring = near_levels(net.indptr, net.indices, wide.order, local, near, 1) & ~near
        local[wide.order] = -1
        proper = np.flatnonzero(near)
        at = np.concatenate([proper, np.flatnonzero(ring)])
        start = np.array([0, len(proper), len(at)], np.int32)
        patch = FlatPatch(
            wide.order[at], start, len(proper), wide.plane[at], "expmap", found.radius, 0
        )
        local[patch.order] = np.arange(len(at), dtype=np.int32)
        turn = field_directions(
            net.indptr, net.indices, net.edge, patch.order, patch.inner, local, patch.plane
        )
        local[patch.order] = -1
        plane = patch.plane[:, 0] + 1j * patch.plane[:, 1]
        return Lay(patch, plane, turn[:, 0] + 1j * turn[:, 1], 1.0 + 0j), wide.way[at]

    def _aim(self, edit: StampEdit, before: Before, alpha: F4) -> Callable[[FlatPatch], Aim]:
        def aim(patch: FlatPatch) -> Aim:
            engine, order, inner = self.engine, patch.order, patch.inner
            net, state = engine.net, engine.state
            kept = before.feature(order)
            target = np.maximum(alpha.astype(np.float64), kept if edit.protect else 0.0)
            present = engine.palette.feature_at(state.sample[order], state.source[order])
            forced = near_levels(
                net.indptr, net.indices, order, engine.flattener.local, alpha > 0.5, 1
            )[:inner]
            frozen = _smeared(
                net.indptr, net.indices, net.edge, order, inner, patch.plane,
                engine.flattener.local,
            )  # fmt: skip
            if edit.protect:
                frozen |= kept[:inner] > 0.5
            frozen &= ~forced
            known = np.zeros(len(order), np.bool_)
            return Aim(target, present.astype(np.float64), known, forced, frozen, strict=True)

        return aim

    def _warnings(self, found: _Print, part: Part, edit: StampEdit) -> list[str]:
        """What is not as in the sample: distorted, or partly beside the surface."""
        net = self.engine.net
        order, shown = found.disc.order, found.alpha > SHOWN
        scale = self.engine.palette.grids[edit.sample].unit * edit.scale
        stretched, area = _on_surface(
            net.indptr, net.indices, net.edge, net.face_ptr, net.face_of, net.area, order, shown,
            found.alpha > 0.5, found.disc.plane, self.engine.flattener.local,
        )  # fmt: skip
        notes = []
        if stretched > MANY:
            notes.append("the surface under the stamp is creased: the feature is distorted")
        share = area / max(float((part.alpha > 0.5).sum()) * scale**2, 1e-9)
        if share < WHOLE:
            notes.append(f"only {share:.0%} of the feature lies on the surface")
        return notes


def _alpha(part: Part, place: F4, plane: NDArray[np.complex128], way: F8) -> F4:
    """m_S (n,) of a part, 0 where the surface is so folded that the map leads back."""
    alpha = alpha_at(part.alpha, place)
    alpha[way > FOLDED * np.abs(plane) + ROUND] = 0.0
    return alpha


@njit(cache=True)
def _smeared(indptr, indices, edge, order, inner, plane, local):  # type: ignore[no-untyped-def]
    """Proper vertices (inner,) with an edge that the map makes much longer or shorter."""
    found = np.zeros(inner, np.bool_)
    for here in range(inner):
        vertex = order[here]
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            there = local[indices[slot]]
            x, y = plane[there, 0] - plane[here, 0], plane[there, 1] - plane[here, 1]
            s, t = np.float64(edge[slot, 0]), np.float64(edge[slot, 1])
            drawn, length = np.sqrt(x * x + y * y), np.sqrt(s * s + t * t)
            if length > SHORT and (drawn > SMEARED * length or drawn * SMEARED < length):
                found[here] = True
    return found


@njit(cache=True)
def _on_surface(  # type: ignore[no-untyped-def]
    indptr, indices, edge, face_ptr, face_of, area, order, shown, inside, plane, local
):
    """Share of the edges among `shown` that are stretched, and area of `inside` in steps²."""
    for here in range(len(order)):
        local[order[here]] = here
    edges = stretched = 0
    total = 0.0
    for here in range(len(order)):
        vertex = order[here]
        if inside[here]:
            for slot in range(face_ptr[vertex], face_ptr[vertex + 1]):
                total += area[face_of[slot]] / 3
        if not shown[here]:
            continue
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            there = local[indices[slot]]
            if there < 0 or not shown[there]:
                continue
            x, y = plane[there, 0] - plane[here, 0], plane[there, 1] - plane[here, 1]
            s, t = np.float64(edge[slot, 0]), np.float64(edge[slot, 1])
            drawn, length = np.sqrt(x * x + y * y), np.sqrt(s * s + t * t)
            edges += 1
            if drawn > CREASED * length or drawn * CREASED < length:
                stretched += 1
    for here in range(len(order)):
        local[order[here]] = -1
    return stretched / max(edges, 1), total
