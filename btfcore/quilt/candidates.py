"""Placements of the sample on a work patch, and the cheapest cut among them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from btfcore.patch.connectivity import Connectivity
from btfcore.patch.distortion import field_directions
from btfcore.patch.flatten import FlatPatch, Flattener
from btfcore.patch.resample import look_up, work_image
from btfcore.quilt.appearance import appearance
from btfcore.quilt.background import Room
from btfcore.quilt.colour_matching import ColourMatcher
from btfcore.quilt.extend import extensions
from btfcore.quilt.fitting import Cut, barred_places, fit, near_bare
from btfcore.quilt.literal import RotatedMatcher
from btfcore.quilt.matching import Matcher, Placement
from btfcore.quilt.measure import seam_edges_around
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.patches import median_direction
from btfcore.quilt.register import fit_warp, warped
from btfcore.quilt.reuse import Reuse
from btfcore.quilt.sheet import Sheet
from btfcore.quilt.state import QuiltState
from btfcore.types import F4, F8

C16 = NDArray[np.complex128]
DEAR = 3.0  # times the mean cost, above which a small patch searches the sample all the same
REACH = 1.5  # texels that registration may shift a placement by
ROUNDS = 6  # its Gauss-Newton steps, most placements stopping after three


@dataclass(eq=False)
class Candidate:
    """A placement on a patch, and its cut.

    place (n, 2) f4: grid coordinates of the patch's vertices; angle (inner,) f8: from the
    field to the sample's +column axis; seam: cost per seam edge in texel differences.
    """

    patch: FlatPatch
    cut: Cut
    place: F4
    angle: F8
    score: float
    seam: float


@dataclass(frozen=True, eq=False)
class _Lay:
    """A patch about its centre, the field's median along +x.

    points (n,) complex: its vertices in grid texels, y up; radius: the largest distance;
    direction (inner,) complex: the field's unit directions.
    """

    patch: FlatPatch
    points: C16
    radius: float
    direction: C16


class CandidateFinder:
    """Matches and cuts; its spectra of the sample serve a whole run."""

    def __init__(
        self,
        net: Connectivity,
        sheet: Sheet,
        state: QuiltState,
        flattener: Flattener,
        parameters: QuiltParameters,
    ) -> None:
        """Prepare for a run; `flattener` holds the patch that is asked about."""
        self.net, self.sheet, self.state, self.parameters = net, sheet, state, parameters
        self.cuts = 0
        self._flattener = flattener
        self._matchers = [(Matcher(grid), RotatedMatcher(grid)) for grid in sheet.grids]
        self._colours = ColourMatcher(net, sheet, state, parameters)
        if parameters.literal:
            for _, rotated in self._matchers:
                rotated.precompute()
        self._cut = sheet
        if parameters.beside:
            seen = [appearance(grid.match, parameters.beside) for grid in sheet.grids]
            self._cut = sheet.compared_by(seen)
        self._reuses: list[Reuse | None] = [None] * len(sheet.grids)
        if parameters.reuse > 0.0:
            sizes = [grid.cut.shape[:2] for grid in sheet.grids]
            self._reuses = [Reuse(high, wide, parameters.reuse) for high, wide in sizes]
        self.rooms: list[Room | None] = [None] * len(sheet.grids)
        for index, grid in enumerate(sheet.grids):
            if len(sheet.barred) and sheet.barred_of(index).any():
                self.rooms[index] = Room(sheet.barred_of(index), grid.random_difference**2)
        self._take(0)
        self._random = np.random.default_rng(parameters.seed)

    def _take(self, mine: int) -> None:
        """Place sample `mine` from now on."""
        self.mine, self.grid = mine, self.sheet.grids[mine]
        self._matcher, self._rotated = self._matchers[mine]
        self._reuse, self._room = self._reuses[mine], self.rooms[mine]

    def best(self, patch: FlatPatch, running: float) -> Candidate:
        """Match and cut; the cheapest of the placements tried.

        `running`: cost that each bare vertex which a placement misses is counted at.
        """
        net, local = self.net, self._flattener.local
        self._take(self.state.home(int(patch.order[0])))
        turn = field_directions(
            net.indptr, net.indices, net.edge, patch.order, patch.inner, local, patch.plane
        )
        direction = turn[:, 0] + 1j * turn[:, 1]
        bare = self.state.bare_for(patch.order[: patch.inner])
        mean = median_direction(direction[bare], direction[0])
        plane = (patch.plane[:, 0] + 1j * patch.plane[:, 1]) * mean.conjugate()
        points = plane / self.grid.unit
        lay = _Lay(patch, points, _radius(points), direction * mean.conjugate())
        heading = float(np.angle(mean))
        best: Candidate | None = None
        if not self.parameters.literal and len(patch.order) <= self.parameters.carry_on:
            for placement in self._extended(patch, plane):
                best = self._cheaper(best, lay, placement, running)
        stopped = self._room is not None and best is not None and best.cut.missed > 0
        if best is None or stopped or best.score > DEAR * running * int(bare.sum()):
            placements = self._placements(patch, plane, heading)
            if self.state.layout is not None and not self.parameters.literal:
                placements += self._beside_others(patch, plane)
            for placement in placements:
                best = self._cheaper(best, lay, placement, running)
        assert best is not None
        if self._reuse is not None:
            self._reuse.taken(*best.place[0].tolist())
        if self.parameters.max_seam is not None:
            edges = seam_edges_around(
                net.indptr, net.indices, patch.order, patch.inner, local, best.cut.fresh,
                self.state.patch,
            )  # fmt: skip
            unit = 2 * max(self.grid.texel_difference, 1e-12)
            best.seam = best.cut.flow / max(edges, 1) / unit
        return best

    def _cheaper(
        self, best: Candidate | None, lay: _Lay, placement: Placement, running: float
    ) -> Candidate:
        """Cut a placement; return it, or `best` where that is cheaper."""
        patch = lay.patch
        warp = np.array([placement.column, placement.row, placement.turn, *placement.warp])
        at, rotation = warped(lay.points, warp, lay.radius)
        place = at.astype(np.float32)
        cut = fit(
            self.net.indptr, self.net.indices, patch.order, patch.inner, self._flattener.local,
            place, self.state.patch, self.state.source, self.state.ghost, self._cut,
            # the paper cuts the whole overlap
            patch.radius * 2 if self.parameters.literal else self.parameters.band,
            owner=self.state.sample, mine=self.mine, allowed=self.state.allowed(self.mine),
        )  # fmt: skip
        self.cuts += 1
        score = cut.flow + running * cut.missed
        if self._room is not None and cut.missed:
            # what is missed beside a feature is a hole, whose rim is a seam sooner or later;
            # covering nothing at no cost would only leave it to be filled by force
            rim = np.sqrt(4 * np.pi * cut.missed) if cut.gained else np.inf
            score += 2 * self.grid.texel_difference * float(rim)
        if best is not None and score >= best.score:
            return best
        angle = -np.angle(lay.direction * rotation[: patch.inner])
        return Candidate(patch, cut, place, angle, score, 0.0)

    def _placements(self, patch: FlatPatch, plane: C16, heading: float) -> list[Placement]:
        """Candidate placements of the patch's centre, cheapest first.

        `plane` has the field along +x already; `heading` is the angle it was turned back by.
        """
        knobs = self.parameters
        found: list[Placement] = []
        known, values = self._known(patch)
        if known.any():
            if knobs.literal:
                image, mask = self._work_image(patch, plane * np.exp(1j * heading), known, values)
                for at in self._rotated.match(
                    image, mask, turn=-heading, overlap=knobs.overlap, margin=knobs.margin
                ):
                    found.append(Placement(at.column, at.row, at.cost, at.turn + heading))
            else:
                for angle in np.radians(knobs.swing):
                    image, mask = self._work_image(patch, plane * np.exp(1j * angle), known, values)
                    for at in self._matcher.match(
                        image, mask, most=knobs.placements, overlap=knobs.overlap,
                        margin=knobs.margin, penalty=self._penalty(plane),
                    ):  # fmt: skip
                        found.append(Placement(at.column, at.row, at.cost, float(angle)))
        if not found:
            height, width = self.grid.cut.shape[:2]
            if self._room is not None:
                return [Placement(*self._room.start(float(self._random.random())), 0.0)]
            x, y = 0.35 + 0.3 * self._random.random(2)
            # whole texels: what is copied verbatim stays as sharp as the sample
            return [Placement(float(round(x * (width - 1))), float(round(y * (height - 1))), 0.0)]
        found.sort(key=lambda placement: placement.cost)
        found = found[: knobs.placements]
        if self._reuse is not None:
            self._reuse.matched(found[0].cost, found[-1].cost)
        if knobs.literal or knobs.sway == 0.0:
            return found
        points = plane / self.grid.unit
        radius = _radius(points)
        points, values = points[known], values[known]
        return [self._registered(points, radius, values, placement) for placement in found]

    def _penalty(self, plane: C16) -> F8 | None:
        """What makes a place of the sample dear (h, w), besides how the patch fits there."""
        penalty = None if self._reuse is None else self._reuse.penalty()
        if self._room is None:
            return penalty
        barred = self._room_penalty(plane)
        return barred if penalty is None else penalty + barred

    def _room_penalty(self, plane: C16) -> F8:
        """What makes a place dear (h, w) where features leave the patch little room."""
        assert self._room is not None
        # half of the patch lies within 0.7 of its radius, about the half side of the square
        return self._room.penalty(0.7 * _radius(plane / self.grid.unit))

    def _extended(self, patch: FlatPatch, plane: C16) -> list[Placement]:
        """Placements that carry on the patches around, centred inside the sample."""
        mine = self.state.known_to(patch.order)
        height, width = self.grid.cut.shape[:2]
        found = extensions(
            self.state, patch.order[mine], plane[mine] / self.grid.unit, self.parameters.placements
        )
        return [at for at in found if 0 <= at.column <= width - 1 and 0 <= at.row <= height - 1]

    def _beside_others(self, patch: FlatPatch, plane: C16) -> list[Placement]:
        point = np.stack([plane.real, -plane.imag], axis=1) / self.grid.unit
        half = self._half(point[: patch.inner])
        barred = None if self._room is None else self._room_penalty(plane)
        return self._colours.match(patch, self._flattener.local, point, half, barred)

    def _registered(self, points: C16, radius: float, values: F4, at: Placement) -> Placement:
        """Shift, turn and slightly warp a placement to where it fits best."""
        start = np.array([at.column, at.row, at.turn, *at.warp])
        knobs = self.parameters
        if self._room is not None:
            # what falls on a feature is not taken, so need not fit
            there = warped(points, start, radius)[0].astype(np.float32)
            free = ~barred_places(self.sheet.barred, self.sheet.frames[self.mine], there)
            points, values = points[free], values[free]
        warp, cost = fit_warp(
            self.grid.match, points, values, start, radius, REACH, np.radians(knobs.sway),
            knobs.give, ROUNDS,
        )  # fmt: skip
        if not np.isfinite(cost):
            return at
        column, row, turn, *rest = warp.tolist()
        return Placement(column, row, float(cost), turn, tuple(rest))

    def _known(self, patch: FlatPatch) -> tuple[NDArray[np.bool_], F4]:
        """Which vertices (n,) of a patch are matched, and values (n, k) of all in that space."""
        net, state = self.net, self.state
        values = look_up(self.grid.match, state.source[patch.order])
        known = state.known_to(patch.order)
        if not self.parameters.literal:
            known &= near_bare(
                net.indptr, net.indices, patch.order, self._flattener.local, state.patch,
                self.parameters.match_band,
            )  # fmt: skip
        return known, values

    def _work_image(
        self, patch: FlatPatch, spun: C16, known: NDArray[np.bool_], values: F4
    ) -> tuple[F4, F4]:
        net = self.net
        point = np.stack([spun.real, -spun.imag], axis=1) / self.grid.unit
        return work_image(
            net.faces, net.face_ptr, net.face_of, patch.order, self._flattener.local, point,
            values, known, self._half(point[: patch.inner]),
        )  # fmt: skip

    def _half(self, point: F8) -> int:
        """Half the side of a work image that holds the patch, in steps of 4 texels."""
        reach = float(np.abs(point).max()) if len(point) else 0.0
        most = max(self.grid.cut.shape[:2])
        return int(min(-(-(reach + 1) // 4) * 4, -(-most // 4) * 4))


def _radius(points: C16) -> float:
    """Unit of a patch's bend: the largest distance from its centre, at least one texel."""
    return max(float(np.abs(points).max()), 1.0)
