"""Texture quilting on the dense mesh (Zhou §III-B, Fig. 4; literal variant included)."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from btfcore.errors import InvalidParameter
from btfcore.patch.connectivity import Connectivity, connect
from btfcore.patch.distortion import field_directions
from btfcore.patch.flatten import SHRINK, SMALLEST, FlatPatch, Flattener
from btfcore.progress import Progress, between, silent
from btfcore.quilt.candidates import Candidate, CandidateFinder
from btfcore.quilt.fitting import barred_places
from btfcore.quilt.frontier import Frontier
from btfcore.quilt.grid import SampleGrid
from btfcore.quilt.layout import Layout
from btfcore.quilt.ledger import Entry
from btfcore.quilt.measure import measure_sample, seam_edges_around
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.patches import PatchChooser
from btfcore.quilt.sheet import sheet_of
from btfcore.quilt.state import QuiltState
from btfcore.types import DenseMesh, Field, Quilt, Sample

UPDATE_S = 0.1  # how often a partial quilt is shown
LARGEST = 48  # levels; beyond, more time buys little


@dataclass
class QuiltStatistics:
    """What happened.

    kinds: patches by how they were flattened; shrinks: for distortion or a seam above T_c;
    trims: for a turning field; cuts: placements that were cut; covered: share of vertices.
    """

    patches: int = 0
    kinds: dict[str, int] = field(
        default_factory=lambda: {"chart": 0, "expmap": 0, "relaxed": 0, "lscm": 0}
    )
    shrinks: int = 0
    trims: int = 0
    cuts: int = 0
    covered: float = 0.0


class Synthesizer:
    """One run of the quilting over one dense mesh; holds its quilt and its tables."""

    def __init__(
        self,
        dense: DenseMesh,
        orientation: Field,
        sample: Sample | Sequence[Sample],
        parameters: QuiltParameters,
        *,
        net: Connectivity | None = None,
        layout: Layout | None = None,
        scales: Sequence[float] | None = None,
        start: Quilt | None = None,
        progress: Progress = silent,
    ) -> None:
        """Prepare tables; `net` may be passed in where it was computed before.

        `start`: a partly bare quilt of this dense mesh, field and sample that is to be
        continued (see `QuiltState.from_quilt`, whose errors it raises).

        Several samples need a `layout`, which says where each goes; `scales` multiply the
        common one, sample by sample.
        """
        samples = (sample,) if isinstance(sample, Sample) else tuple(sample)
        if len(samples) != (1 if layout is None else len(layout.allowed)):
            raise InvalidParameter(f"{len(samples)} samples do not fit the layout")
        self.parameters = parameters
        if layout is not None:
            net = layout.net
        if net is None:
            net = connect(dense, orientation, progress=between(progress, 0.0, 0.6))
        self.net = net
        progress(0.6, "preparing the sample")
        self.sheet = sheet_of(
            samples,
            [parameters.scale * each for each in scales or [1.0] * len(samples)],
            match_channels=None if parameters.literal else parameters.match_channels,
            features=parameters.features,
        )
        progress(0.8, "preparing the quilt")
        self.state = (
            QuiltState.bare(self.net, layout)
            if start is None
            else QuiltState.from_quilt(self.net, self.sheet, start, layout)
        )
        self.statistics = QuiltStatistics()
        self.ledger: dict[int, Entry] = {}  # by patch number
        self.continued = self.state.patches  # patches of the quilt that is continued
        self._flattener = Flattener(
            dense,
            orientation,
            self.net,
            max_distortion=parameters.max_distortion,
            literal=parameters.literal,
        )
        self._frontier = Frontier(
            self.net.indptr, self.net.indices, self.state.patch, parameters.seed
        )
        self.radii = [parameters.work_patch or self._radius(grid) for grid in self.sheet.grids]
        self._chooser = PatchChooser(
            self.net, self._flattener, self._frontier, self.state, parameters, self.radii,
            progress=between(progress, 0.8, 1.0),
        )  # fmt: skip
        self._finder = CandidateFinder(
            self.net, self.sheet, self.state, self._flattener, parameters
        )
        self._flow = [0.0] * len(samples)
        self._gained = [0] * len(samples)
        if start is not None:
            done = self.state.patch >= 0
            self._chooser.accepted(self.state.angle[done].astype(np.float64))
            for mine, grid in enumerate(self.sheet.grids):
                seams = measure_sample(self.net, self.state, self.sheet, mine)
                self._flow[mine] = 2 * seams.per_edge * grid.texel_difference * seams.seam_edges
                self._gained[mine] = int((done & (self.state.sample == mine)).sum())

    @property
    def grid(self) -> SampleGrid:
        """The first sample, for runs of one."""
        return self.sheet.grids[0]

    @property
    def radius(self) -> int:
        """Radius r_w of the first sample's patches."""
        return self.radii[0]

    def _radius(self, grid: SampleGrid) -> int:
        """r_w tied to the sample's size: 48 levels for 128 texels, 32 in the paper's way."""
        if self.parameters.literal:
            return 32
        height, width = grid.cut.shape[:2]
        return int(np.clip(round(0.375 * min(height, width) * grid.unit), 4, LARGEST))

    def run(
        self, *, progress: Progress = silent, on_update: Callable[[Quilt], None] | None = None
    ) -> Quilt:
        """Cover every bare vertex and return the quilt.

        `progress` may raise `Cancelled` between patches; what was covered so far stays in
        `state`, and another `run` goes on from there to the same bits as if nothing had
        happened. `on_update` gets frozen partial quilts about ten times a second.
        """
        count = len(self.state.patch)
        done = int((self.state.patch >= 0).sum())
        shown = time.monotonic()
        while True:
            vertex = self._frontier.pick()
            if vertex < 0:
                break
            done += self._patch_at(vertex) or self._force(vertex)
            progress(done / count, "quilting")
            if on_update is not None and time.monotonic() - shown > UPDATE_S:
                shown = time.monotonic()
                on_update(self.state.quilt(self.sheet))
        self.statistics.covered = done / count
        return self.state.quilt(self.sheet)

    def _patch_at(self, vertex: int) -> int:
        """Synthesise one patch near `vertex`; returns how many bare vertices it covered."""
        best = self._best(self._chooser.choose(vertex))
        patch, fresh = best.patch, best.cut.fresh
        self.ledger[self.state.patches] = self._entry(best)
        was_bare = self.state.accept(
            self.net, patch.order, self._flattener.local, best.place, fresh, best.angle
        )
        self._flattener.release(patch)
        self._frontier.add(was_bare)
        self._chooser.accepted(best.angle[fresh])
        mine = self.state.home(int(patch.order[0]))
        self._flow[mine] += best.cut.flow
        self._gained[mine] += best.cut.gained
        counts = self.statistics
        counts.patches += 1
        counts.kinds[patch.kind] += 1
        counts.shrinks += patch.shrinks
        counts.cuts, counts.trims = self._finder.cuts, self._chooser.shrinks
        return len(was_bare)

    def _force(self, vertex: int) -> int:
        """Cover `vertex` and its neighbours after a patch that covered nothing; see `_patch_at`.

        They continue a neighbour's patch as far as the sample goes, so that every run ends.
        """
        net, state = self.net, self.state
        patch, mine = self._flattener.flatten(vertex, 1), state.home(vertex)
        grid = self.sheet.grids[mine]
        height, width = grid.cut.shape[:2]
        at, angle = np.array([(width - 1) / 2, (height - 1) / 2]), 0.0
        for other in net.indices[net.indptr[vertex] : net.indptr[vertex + 1]]:
            row = slice(net.indptr[other], net.indptr[other + 1])
            if state.patch[other] >= 0 and state.sample[other] == mine:
                at = state.ghost[row][net.indices[row] == vertex][0].astype(np.float64)
                angle = float(state.angle[other])
                break
        local, edge = self._flattener.local, net.edge
        turn = field_directions(net.indptr, net.indices, edge, patch.order, 1, local, patch.plane)
        spin = np.exp(-1j * angle) * complex(turn[0, 0], -turn[0, 1]) / grid.unit
        plane = (patch.plane[:, 0] + 1j * patch.plane[:, 1]) * spin
        offset, room = np.stack([plane.real, -plane.imag], axis=1), self._finder.rooms[mine]
        place = (at + offset).astype(np.float32)
        frame = self.sheet.frames[mine]
        if room is not None and barred_places(self.sheet.barred, frame, place).any():
            place = np.clip(offset, -room.reach, room.reach) + room.nearest(at)
            place = place.astype(np.float32)
        place = np.clip(place, np.float32(0), np.array([width - 1, height - 1], np.float32))
        fresh = state.bare_for(patch.order[: patch.inner])
        self.ledger[state.patches] = Entry(
            vertex, self.radii[mine], patch.radius, patch.kind, int(fresh.sum()), 0.0, "forced"
        )
        was_bare = state.accept(net, patch.order, local, place, fresh, np.full(patch.inner, angle))
        self._flattener.release(patch)
        self._frontier.add(was_bare)
        self.statistics.patches += 1
        self.statistics.kinds[patch.kind] += 1
        return len(was_bare)

    def _entry(self, best: Candidate) -> Entry:
        """Note of a patch that is about to be laid; the flattener holds it."""
        patch, net = best.patch, self.net
        mine = self.state.home(int(patch.order[0]))
        edges = seam_edges_around(
            net.indptr, net.indices, patch.order, patch.inner, self._flattener.local,
            best.cut.fresh, self.state.patch,
        )  # fmt: skip
        reason = patch.reason or ("field" if patch.radius < self.radii[mine] else "")
        if best.cut.missed and not reason:
            reason = "sample"
        step = max(self.sheet.grids[mine].texel_difference, 1e-12)
        seam = best.cut.flow / max(edges, 1) / (2 * step)
        return Entry(
            int(patch.order[0]), self.radii[mine], patch.radius, patch.kind, best.cut.gained,
            seam, reason,
        )  # fmt: skip

    def _best(self, patch: FlatPatch) -> Candidate:
        """Return the cheapest candidate; with a bound T_c, from the first size that meets it.

        Where no size does, the best one seen: a strict bound would shatter the surface. The
        flattener holds the candidate's patch on return.
        """
        mine = self.state.home(int(patch.order[0]))
        running = self._flow[mine] / max(self._gained[mine], 1)
        best = candidate = self._finder.best(patch, running)
        bound = self.parameters.max_seam
        while bound is not None and candidate.seam > bound and patch.radius > SMALLEST:
            self._flattener.release(patch)
            smaller = max(int(patch.radius * SHRINK), SMALLEST)
            patch = self._flattener.flatten(int(patch.order[0]), smaller)
            patch.reason = patch.reason or "seam"
            self.statistics.shrinks += 1
            candidate = self._finder.best(patch, running)
            if candidate.seam < best.seam:
                best = candidate
        if best.patch is not patch:
            self._flattener.release(patch)
            self._flattener.hold(best.patch)
        return best


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
