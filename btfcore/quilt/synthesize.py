"""Texture quilting on the dense mesh (Zhou §III-B, Fig. 4; literal variant included)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.patch.connectivity import Connectivity, connect, turning_rate
from btfcore.patch.distortion import field_directions
from btfcore.patch.flatten import SHRINK, SMALLEST, FlatPatch, Flattener
from btfcore.patch.resample import look_up, work_image
from btfcore.progress import Progress, silent
from btfcore.quilt.fitting import Cut, fit, near_bare
from btfcore.quilt.frontier import Frontier
from btfcore.quilt.grid import SampleGrid, sample_grid
from btfcore.quilt.literal import RotatedMatcher
from btfcore.quilt.matching import Matcher, Placement
from btfcore.quilt.measure import seam_edges_around
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.state import QuiltState
from btfcore.types import F4, F8, I4, DenseMesh, Field, Quilt, Sample

C16 = NDArray[np.complex128]
UPDATE_S = 0.1  # how often a partial quilt is shown
LARGEST = 48  # levels; beyond, more time buys little
SLACK = 1.5
ON_COURSE = 0.52
LEAST_BENT = 12  # a patch is not made smaller than this for a turning field
FEW_BARE = 60  # where fewer bare vertices are near, a small patch fills them


@dataclass
class QuiltStatistics:
    """What happened: patches by how they were flattened, shrinks, cuts and their seams."""

    patches: int = 0
    kinds: dict[str, int] = field(
        default_factory=lambda: {"chart": 0, "expmap": 0, "relaxed": 0, "lscm": 0}
    )
    shrinks: int = 0
    cuts: int = 0
    covered: float = 0.0


@dataclass(eq=False)
class _Candidate:
    """A placement that was cut."""

    cut: Cut
    place: F4
    angle: F8
    score: float
    seam: float


class Synthesizer:
    """One run of the quilting over one dense mesh; holds its quilt and its tables."""

    def __init__(
        self,
        dense: DenseMesh,
        orientation: Field,
        sample: Sample,
        parameters: QuiltParameters,
        *,
        net: Connectivity | None = None,
    ) -> None:
        """Prepare tables; `net` may be passed in where it was computed before."""
        self.parameters = parameters
        self.net = net if net is not None else connect(dense, orientation)
        all_channels = sample.channels.shape[2]
        self.grid: SampleGrid = sample_grid(
            sample,
            scale=parameters.scale,
            match_channels=all_channels if parameters.literal else parameters.match_channels,
        )
        self.state = QuiltState.bare(self.net)
        self.statistics = QuiltStatistics()
        self._flattener = Flattener(
            dense,
            orientation,
            self.net,
            max_distortion=parameters.max_distortion,
            literal=parameters.literal,
        )
        self._matcher = Matcher(self.grid)
        self._rotated = RotatedMatcher(self.grid)
        if parameters.literal:
            self._rotated.precompute()
        self._frontier = Frontier(
            self.net.indptr, self.net.indices, self.state.patch, parameters.seed
        )
        net = self.net
        self._rate = turning_rate(net.indptr, net.indices, net.edge, net.turn, 40)
        self._random = np.random.default_rng(parameters.seed)
        self.radius = parameters.work_patch or self._default_radius()
        self._flow = 0.0
        self._placed = self._near_field = 0
        self._gained = 0

    def _default_radius(self) -> int:
        """r_w tied to the sample's size: 40 levels for 128 texels, 32 in the paper's way."""
        if self.parameters.literal:
            return 32
        height, width = self.grid.cut.shape[:2]
        return int(np.clip(round(0.3125 * min(height, width) * self.grid.unit), 4, LARGEST))

    def run(
        self, *, progress: Progress = silent, on_update: Callable[[Quilt], None] | None = None
    ) -> Quilt:
        """Cover every bare vertex and return the quilt.

        `progress` may raise `Cancelled` between patches; what was covered so far stays in
        `state`. `on_update` gets frozen partial quilts about ten times a second.
        """
        count = len(self.state.patch)
        done = int((self.state.patch >= 0).sum())
        shown = time.monotonic()
        while True:
            vertex = self._frontier.pick()
            if vertex < 0:
                break
            done += self._patch_at(vertex)
            progress(done / count, "quilting")
            if on_update is not None and time.monotonic() - shown > UPDATE_S:
                shown = time.monotonic()
                on_update(self.state.quilt(self.grid))
        self.statistics.covered = done / count
        return self.state.quilt(self.grid)

    def _patch_at(self, vertex: int) -> int:
        """Synthesise one patch near `vertex`; returns how many bare vertices it covered."""
        best: _Candidate | None = None
        patch = self._first_patch(vertex)
        seed = int(patch.order[0])
        while True:
            candidate = self._best_candidate(patch)
            bound = self.parameters.max_seam
            enough = bound is None or candidate.seam <= bound or patch.radius <= SMALLEST
            if best is None or candidate.seam < best.seam:
                best, best_radius = candidate, patch.radius
            if enough:
                break
            self._flattener.release(patch)
            patch = self._flattener.flatten(seed, max(int(patch.radius * SHRINK), SMALLEST))
            self.statistics.shrinks += 1
        if best is not candidate:  # no size met T_c: take the best one seen
            self._flattener.release(patch)
            patch = self._flattener.flatten(seed, best_radius)
        was_bare = self.state.accept(
            self.net, patch.order, self._flattener.local, best.place, best.cut.fresh, best.angle
        )
        self._flattener.release(patch)
        self._frontier.add(was_bare)
        self._flow += best.cut.flow
        turned = np.abs(best.angle[best.cut.fresh])
        self._placed += len(turned)
        self._near_field += int((turned < np.radians(self.parameters.near_field)).sum())
        self._gained += best.cut.gained
        self.statistics.patches += 1
        self.statistics.kinds[patch.kind] += 1
        self.statistics.shrinks += patch.shrinks
        return len(was_bare)

    def _first_patch(self, vertex: int) -> FlatPatch:
        """The work patch that is to cover `vertex`, seeded ahead of the frontier.

        A patch that had to shrink is seeded anew, nearer, lest it lose touch with the part
        that it must continue.
        """
        if self.parameters.literal:
            return self._flattener.flatten(vertex, self.radius)
        ahead = self.parameters.ahead
        ahead = self.radius // 2 if ahead is None else ahead
        seed, depth, near = self._frontier.ahead(vertex, ahead)
        if near < FEW_BARE:
            return self._flattener.flatten(vertex, min(self.radius, 12))
        patch = self._flattener.flatten(seed, self._reach(seed), self._straight)
        if depth > 0 and patch.radius < min(self.radius, depth + 4):
            self._flattener.release(patch)
            seed, _, _ = self._frontier.ahead(vertex, min(ahead, patch.radius // 2))
            patch = self._flattener.flatten(seed, self._reach(seed), self._straight)
        return patch

    def _reach(self, seed: int) -> int:
        """Radius worth flattening: half as much again as the field's turning there allows.

        The median distance from a diameter of the unit disk is 0.4.
        """
        allowed = self._bend() / (0.4 * max(self._rate[seed], 1e-4))
        return int(np.clip(SLACK * allowed, min(LEAST_BENT, self.radius), self.radius))

    def _bend(self) -> float:
        """Bound in radians on a patch's median angle to the field.

        `max_bend` while more than half of the texture so far lies within `near_field` of the
        field, half of it otherwise: the median stays below that at the least cost in seams.
        """
        on_course = self._near_field >= ON_COURSE * self._placed
        return float(np.radians(self.parameters.max_bend * (1.0 if on_course else 0.5)))

    def _straight(self, order: I4, start: I4, plane: F8, radius: int) -> int:
        """Largest radius at which the field does not turn too much for one piece of texture."""
        net, bound = self.net, self._bend()
        inner = int(start[min(radius + 1, len(start) - 1)])
        turn = field_directions(
            net.indptr, net.indices, net.edge, order, inner, self._flattener.local, plane
        )
        direction = turn[:, 0] + 1j * turn[:, 1]
        bare = self.state.patch[order[:inner]] < 0
        while radius > LEAST_BENT:
            count = int(start[min(radius + 1, len(start) - 1)])
            mine = direction[:count][bare[:count]]
            if len(mine) == 0:
                break
            mean = _median_direction(mine, mine[0])
            if np.median(np.abs(np.angle(mine * mean.conjugate()))) <= bound:
                break
            radius = max(int(radius * SHRINK), LEAST_BENT)
            self.statistics.shrinks += 1
        return radius

    def _best_candidate(self, patch: FlatPatch) -> _Candidate:
        """Match and cut; the cheapest of the placements tried."""
        net, local = self.net, self._flattener.local
        turn = field_directions(
            net.indptr, net.indices, net.edge, patch.order, patch.inner, local, patch.plane
        )
        direction = turn[:, 0] + 1j * turn[:, 1]
        bare = self.state.patch[patch.order[: patch.inner]] < 0
        mean = _median_direction(direction[bare], direction[0])
        plane = (patch.plane[:, 0] + 1j * patch.plane[:, 1]) * mean.conjugate()
        heading = float(np.angle(mean))
        best: _Candidate | None = None
        running = self._flow / max(self._gained, 1)
        for placement in self._placements(patch, plane, heading):
            spun = plane * np.exp(1j * placement.turn) / self.grid.unit
            place = np.empty((len(plane), 2), np.float32)
            place[:, 0] = placement.column + spun.real
            place[:, 1] = placement.row - spun.imag
            cut = fit(
                net.indptr, net.indices, patch.order, patch.inner, local, place,
                self.state.patch, self.state.source, self.state.ghost, self.grid.cut,
                # the paper cuts the whole overlap
                patch.radius * 2 if self.parameters.literal else self.parameters.band,
            )  # fmt: skip
            self.statistics.cuts += 1
            score = cut.flow + running * cut.missed
            if best is None or score < best.score:
                angle = -np.angle(direction * (mean.conjugate() * np.exp(1j * placement.turn)))
                best = _Candidate(cut, place, angle, score, 0.0)
        assert best is not None
        if self.parameters.max_seam is not None:
            edges = seam_edges_around(
                net.indptr, net.indices, patch.order, patch.inner, local, best.cut.fresh,
                self.state.patch,
            )  # fmt: skip
            unit = 2 * max(self.grid.texel_difference, 1e-12)
            best.seam = best.cut.flow / max(edges, 1) / unit
        return best

    def _placements(self, patch: FlatPatch, plane: C16, heading: float) -> list[Placement]:
        """Candidate placements of the patch's centre, cheapest first.

        `plane` has the field along +x already; `heading` is the angle it was turned back by.
        """
        knobs = self.parameters
        found: list[Placement] = []
        if (self.state.patch[patch.order] >= 0).any():
            if knobs.literal:
                image, mask = self._work_image(patch, plane * np.exp(1j * heading))
                for at in self._rotated.match(
                    image, mask, turn=-heading, overlap=knobs.overlap, margin=knobs.margin
                ):
                    found.append(Placement(at.column, at.row, at.cost, at.turn + heading))
            else:
                for angle in np.radians(knobs.swing):
                    image, mask = self._work_image(patch, plane * np.exp(1j * angle))
                    for at in self._matcher.match(
                        image, mask, most=knobs.placements, overlap=knobs.overlap,
                        margin=knobs.margin,
                    ):  # fmt: skip
                        found.append(Placement(at.column, at.row, at.cost, float(angle)))
        if not found:
            height, width = self.grid.cut.shape[:2]
            x, y = 0.35 + 0.3 * self._random.random(2)
            return [Placement(float(x * (width - 1)), float(y * (height - 1)), 0.0)]
        found.sort(key=lambda placement: placement.cost)
        return found[: knobs.placements]

    def _work_image(self, patch: FlatPatch, spun: C16) -> tuple[F4, F4]:
        net, state = self.net, self.state
        point = np.stack([spun.real, -spun.imag], axis=1) / self.grid.unit
        values = look_up(self.grid.match, state.source[patch.order])
        known = state.patch[patch.order] >= 0
        if not self.parameters.literal:
            known &= near_bare(
                net.indptr, net.indices, patch.order, self._flattener.local, state.patch,
                self.parameters.match_band,
            )  # fmt: skip
        return work_image(
            net.faces, net.face_ptr, net.face_of, patch.order, self._flattener.local, point,
            values, known, self._half(point[: patch.inner]),
        )  # fmt: skip

    def _half(self, point: F8) -> int:
        """Half the side of a work image that holds the patch, in steps of 4 texels."""
        reach = float(np.abs(point).max()) if len(point) else 0.0
        most = max(self.grid.cut.shape[:2])
        return int(min(-(-(reach + 1) // 4) * 4, -(-most // 4) * 4))


@njit(cache=True)
def _median_direction(directions, fallback):  # type: ignore[no-untyped-def]
    """Unit direction with the least mean angle to `directions` (Weiszfeld's iteration).

    The field's turns inside a patch are what its texture must ignore; their median leaves
    more vertices near their own direction than the mean does.
    """
    mean = 0j
    for direction in directions:
        mean += direction
    if abs(mean) < 1e-9:
        return fallback
    mean /= abs(mean)
    for _ in range(4):
        shifted = 0j
        for direction in directions:
            turned = direction * mean.conjugate()
            shifted += direction / max(abs(np.arctan2(turned.imag, turned.real)), 0.02)
        if abs(shifted) < 1e-9:
            break
        mean = shifted / abs(shifted)
    return mean


def synthesize(
    dense: DenseMesh,
    orientation: Field,
    sample: Sample,
    parameters: QuiltParameters | None = None,
    *,
    progress: Progress = silent,
    on_update: Callable[[Quilt], None] | None = None,
) -> tuple[Quilt, QuiltStatistics]:
    """Cover `dense` with `sample`; see `Synthesizer` and `QuiltParameters`."""
    engine = Synthesizer(dense, orientation, sample, parameters or QuiltParameters())
    quilt = engine.run(progress=progress, on_update=on_update)
    return quilt, engine.statistics
