"""The workspace of a document: its quilt, its samples in one space, and their tables.

What an edit computes may depend on the edit and on the quilt's values where it looked, and on
nothing else: so a delta can be used again wherever these are the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from btfcore.errors import InvalidEdit, InvalidParameter
from btfcore.paint.constrained import unit_of
from btfcore.paint.delta import Delta, Recorder
from btfcore.paint.isotropy import ORDERED, spread_of_orientations
from btfcore.paint.locate import Locator
from btfcore.paint.matching import JointMatcher
from btfcore.paint.palette import Palette, palette_of
from btfcore.paint.parts import Part, parts_of
from btfcore.patch.connectivity import Connectivity
from btfcore.patch.flatten import Flattener
from btfcore.quilt.layout import Layout
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.state import QuiltState
from btfcore.quilt.synthesize import LARGEST, Synthesizer
from btfcore.types import F4, I4, Prepared, Quilt, Sample

FIRST_ID = 1 << 20  # patch ids of edits begin here; the background's are below
IDS = 1 << 16  # patch ids of one edit
MOST_EDITS = (2**31 - FIRST_ID) // IDS


@dataclass(frozen=True)
class Report:
    """What an edit did, in numbers.

    patches: placed and kept; tries: placed in all; area: vertices that it was asked for;
    reached: of them, those that are as wanted; constraint, smooth: Σ D_p and Σ V_pq / u over
    the vertices that it looked at, as it left them, and before; weight: λ, so that
    E = weight · constraint + smooth; seam: mean of ½ V_pq over the edges between two patches
    there, in the sample's texel differences, and before.
    """

    patches: int = 0
    tries: int = 0
    area: int = 0
    reached: int = 0
    weight: float = 0.0
    constraint: float = 0.0
    constraint_before: float = 0.0
    smooth: float = 0.0
    smooth_before: float = 0.0
    seam: float = 0.0
    seam_before: float = 0.0
    notes: tuple[str, ...] = field(default=())


@dataclass(frozen=True, eq=False)
class Result:
    """An edit's delta and its figures."""

    delta: Delta
    report: Report


class Engine:
    """One document's quilt and everything needed to change it."""

    def __init__(
        self,
        prepared: Prepared,
        samples: Sequence[Sample],
        net: Connectivity,
        state: QuiltState,
        parameters: QuiltParameters,
        *,
        layout: Layout | None = None,
        scales: Sequence[float] | None = None,
    ) -> None:
        """Work on `state`, the background; `samples` begin with those that it names.

        Their channels share one space (see `btfcore.btf.joint`); scales: of each sample, times
        the parameters' common one.
        """
        if state.patches > FIRST_ID:
            raise InvalidParameter(f"a background of {state.patches} patches, most is {FIRST_ID}")
        self.prepared, self.net, self.state = prepared, net, state
        self.parameters, self.layout = parameters, layout
        self.samples: tuple[Sample, ...] = ()
        self.scales: tuple[float, ...] = ()
        self.writer: I4 = np.full(len(state.patch), -1, np.int32)  # token of the last delta
        self.locator = Locator(prepared.dense)
        self.flattener = Flattener(
            prepared.dense, prepared.field, net, max_distortion=parameters.max_distortion
        )
        self.tokens = 0  # deltas made so far: each has a number of its own
        self._recorder: Recorder | None = None
        self.take_samples(samples, scales or [1.0] * len(samples))

    @classmethod
    def over(
        cls,
        prepared: Prepared,
        samples: Sequence[Sample],
        made: Synthesizer,
        *,
        scales: Sequence[float] | None = None,
    ) -> Engine:
        """Paint over what a synthesis made; its quilt is copied."""
        return cls(
            prepared, samples, made.net, copied(made.state), made.parameters,
            layout=made.state.layout, scales=scales,
        )  # fmt: skip

    def take_samples(self, samples: Sequence[Sample], scales: Sequence[float]) -> None:
        """Use other samples from now on; those that were there must stay first."""
        self.samples, self.scales = tuple(samples), tuple(scales)
        self.palette: Palette = palette_of(
            self.samples, [self.parameters.scale * each for each in self.scales],
            match_channels=self.parameters.match_channels,
        )  # fmt: skip
        self._matchers: dict[int, JointMatcher] = {}
        self._parts: dict[int, tuple[Part, ...]] = {}
        self._isotropic: dict[int, bool] = {}
        self._units: dict[int, float] = {}

    # --- tables

    @cached_property
    def step(self) -> float:
        """Dense-mesh step in world units."""
        return self.prepared.dense.step or 1.0

    def matcher(self, sample: int) -> JointMatcher:
        """Joint matcher of a sample; its spectra serve all edits."""
        if sample not in self._matchers:
            self._matchers[sample] = JointMatcher(self.palette, sample, unit=self.unit(sample))
        return self._matchers[sample]

    def parts(self, sample: int) -> tuple[Part, ...]:
        """The parts of a sample's feature by falling area, and last all of them together."""
        if sample not in self._parts:
            feature = self.palette.feature_of(sample)
            self._parts[sample] = parts_of(feature, self.samples[sample].name)
        return self._parts[sample]

    def part(self, sample: int, index: int | None) -> Part:
        """One part of a sample's feature, None: all of it; raises `InvalidEdit`."""
        parts = self.parts(sample)
        if index is not None and index >= len(parts) - 1:
            raise InvalidEdit(
                f"feature {index} of sample {self.samples[sample].name!r}, which has"
                f" {len(parts) - 1}"
            )
        return parts[-1 if index is None else index]

    def unit(self, sample: int) -> float:
        """U of a sample painted over this document's background (`constrained.unit_of`)."""
        if sample not in self._units:
            grounds = range(1 if self.layout is None else len(self.layout.allowed))
            self._units[sample] = unit_of(self.palette, sample, grounds)
        return self._units[sample]

    def isotropic(self, sample: int) -> bool:
        """Whether a sample's background may be turned as one likes."""
        if sample not in self._isotropic:
            background = self.palette.feature_of(sample) < 0.5
            values = self.palette.match(sample).grid.match
            self._isotropic[sample] = spread_of_orientations(values, background) < ORDERED
        return self._isotropic[sample]

    def largest(self, sample: int) -> int:
        """Largest work patch of a sample in levels, as in synthesis."""
        grid = self.palette.grids[sample]
        high, wide = grid.cut.shape[:2]
        return int(np.clip(round(0.375 * min(high, wide) * grid.unit), 4, LARGEST))

    def home(self, vertex: int) -> int:
        """Background sample of a vertex."""
        return self.state.home(vertex)

    # --- deltas

    @property
    def recorder(self) -> Recorder:
        """What the running edit reads and writes."""
        assert self._recorder is not None
        return self._recorder

    @property
    def busy(self) -> bool:
        """Whether an edit is being computed, or a stroke drawn."""
        return self._recorder is not None

    @contextmanager
    def recording(self, uid: int) -> Iterator[Recorder]:
        """Compute edit `uid` inside; whatever interrupts that, the quilt is as it was before."""
        self.start(uid)
        try:
            yield self.recorder
        except BaseException:
            self.cancel()
            raise

    def start(self, uid: int) -> None:
        """Begin to compute edit `uid`; end by `finish` or `cancel`."""
        if self._recorder is not None:
            raise InvalidEdit("another edit is being painted; finish or cancel it first")
        if not 0 <= uid < MOST_EDITS:
            raise InvalidEdit(f"edit number {uid}, outside 0 … {MOST_EDITS - 1}")
        self._recorder = Recorder(self.net, self.state, self.writer)
        self.state.patches = FIRST_ID + uid * IDS
        self._last_id = self.state.patches + IDS - 1
        self.flattener.restart()

    def claim_patch(self) -> None:
        """Make sure that the running edit may lay one more patch."""
        if self.state.patches >= self._last_id:
            raise InvalidEdit(f"the edit needs more than {IDS - 1} patches; divide it")

    def finish(self, wanted: F4 | None = None) -> Delta:
        """Return what the running edit did; wanted: m_0 at the vertices that it looked at."""
        self.tokens += 1
        delta = self.recorder.finish(self.tokens, wanted)
        self._recorder = None
        return delta

    def cancel(self) -> None:
        """Take back what the running edit did."""
        if self._recorder is not None:
            self._recorder.undo()
            self._recorder = None
            self.flattener.local[:] = -1  # a patch may have been interrupted

    def fits(self, result: Result) -> bool:
        """Whether computing the result's edit now would give the same."""
        return result.delta.fits(self.writer)

    def put_on(self, result: Result) -> None:
        """Write a result onto the quilt."""
        result.delta.put_on(self.net, self.state, self.writer)

    def take_off(self, result: Result) -> None:
        """Take the topmost result off the quilt."""
        result.delta.take_off(self.net, self.state, self.writer)

    # --- the quilt

    def quilt(self) -> Quilt:
        """Frozen copy of the quilt, patches numbered without gaps."""
        plain = self.state.quilt(self.palette.sheet)
        ids = np.unique(plain.patch[plain.patch >= 0])
        patch = np.searchsorted(ids, plain.patch).astype(np.int32)
        patch[plain.patch < 0] = -1
        return Quilt(plain.source.copy(), plain.angle.copy(), plain.sample.copy(), patch)

    def part_of_quilt(self, vertices: I4) -> Quilt:
        """The quilt at `vertices` (n,) only, also while an edit is computed.

        Patches have the numbers that they have at work, those of `quilt` being others.
        """
        state = self.state
        some = QuiltState(
            state.source[vertices], state.patch[vertices], np.zeros((0, 2), np.float32),
            state.angle[vertices], state.patches, state.sample[vertices],
        )  # fmt: skip
        return some.quilt(self.palette.sheet)

    def copy(self) -> QuiltState:
        """Copy of the quilt as it is."""
        return copied(self.state)

    def differences(self, other: QuiltState) -> I4:
        """Vertices (n,) i4 at which the quilt differs from `other` in any bit."""
        state = self.state
        differs = (state.source != other.source).any(axis=1) | (state.angle != other.angle)
        differs |= (state.sample != other.sample) | (state.patch != other.patch)
        slots = np.flatnonzero((state.ghost != other.ghost).any(axis=1))
        differs[np.searchsorted(self.net.indptr, slots, side="right") - 1] = True
        return np.flatnonzero(differs).astype(np.int32)


def copied(state: QuiltState) -> QuiltState:
    """Copy of a quilt under construction; the layout is shared."""
    return QuiltState(
        state.source.copy(), state.patch.copy(), state.ghost.copy(), state.angle.copy(),
        state.patches, state.sample.copy(), state.layout,
    )  # fmt: skip
