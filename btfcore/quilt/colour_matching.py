"""Placements beside another sample: where its colours continue those of the neighbour."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from btfcore.patch.connectivity import Connectivity
from btfcore.patch.flatten import FlatPatch
from btfcore.patch.resample import look_up, work_image
from btfcore.quilt.fitting import near_bare
from btfcore.quilt.matching import Matcher, Placement
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.sheet import Sheet
from btfcore.quilt.state import QuiltState
from btfcore.types import F4, F8, I4


class ColourMatcher:
    """Matches patches that overlap other samples, by the colours that all samples have."""

    def __init__(
        self, net: Connectivity, sheet: Sheet, state: QuiltState, parameters: QuiltParameters
    ) -> None:
        """Prepare for a run; spectra are made when a border is first reached."""
        self.net, self.sheet, self.state, self.parameters = net, sheet, state, parameters
        self._matchers: dict[int, tuple[Matcher, F4]] = {}

    def match(
        self, patch: FlatPatch, local: I4, point: F8, half: int, penalty: F8 | None = None
    ) -> list[Placement]:
        """Candidate placements where the patch may replace vertices of another sample.

        point (n, 2) f8: the patch's vertices (column, row) about its centre in grid texels;
        half: half the side of the work image; penalty (h, w): see `Matcher.match`. Only the
        overlap near bare vertices in which the patch's sample is allowed is matched, all
        samples alike. Empty where no other sample is there.
        """
        state, net, order = self.state, self.net, patch.order
        mine = state.home(int(order[0]))
        allowed = state.allowed(mine)
        if allowed is None or not state.beside(order):
            return []
        known = (state.patch[order] >= 0) & allowed[order]
        known &= near_bare(
            net.indptr, net.indices, order, local, state.patch, self.parameters.match_band
        )
        if not (known & ~state.known_to(order)).any():
            return []
        matcher, mean = self._matcher(mine)
        values = np.zeros((len(order), self.sheet.colour.shape[2]), np.float32)
        for index in range(len(self.sheet.grids)):
            here = known & (state.sample[order] == index)
            values[here] = look_up(self.sheet.colours(index), state.source[order[here]]) - mean
        image, mask = work_image(
            net.faces, net.face_ptr, net.face_of, order, local, point, values, known, half
        )
        knobs = self.parameters
        return matcher.match(
            image, mask, most=knobs.placements, overlap=knobs.overlap, margin=knobs.margin,
            penalty=penalty,
        )  # fmt: skip

    def _matcher(self, mine: int) -> tuple[Matcher, F4]:
        """Matcher on a sample's colours, and their mean, which matching leaves out."""
        if mine not in self._matchers:
            colour = self.sheet.colours(mine)
            mean = colour.mean(axis=(0, 1), dtype=np.float64)
            grid = replace(self.sheet.grids[mine], match=(colour - mean).astype(np.float32))
            self._matchers[mine] = (Matcher(grid), mean.astype(np.float32))
        return self._matchers[mine]
