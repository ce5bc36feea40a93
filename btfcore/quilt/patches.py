"""Where the next work patch lies and how large it is (Zhou §III-B, Fig. 4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.patch.bend import bent, fit_bend
from btfcore.patch.connectivity import Connectivity, turning_rate
from btfcore.patch.distortion import field_directions
from btfcore.patch.flatten import SHRINK, FlatPatch, Flattener
from btfcore.progress import Progress, silent
from btfcore.quilt.frontier import Frontier
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.state import QuiltState
from btfcore.types import F8, I4

SLACK = 1.25
ON_COURSE = 0.51
LEAST_BENT = 8  # a patch is not made smaller than this for a turning field
FEW_BARE = 60  # where fewer bare vertices are near, a small patch fills them


class PatchChooser:
    """Chooses work patches and keeps the texture near the field in the median."""

    def __init__(
        self,
        net: Connectivity,
        flattener: Flattener,
        frontier: Frontier,
        state: QuiltState,
        parameters: QuiltParameters,
        radii: Sequence[int],
        *,
        progress: Progress = silent,
    ) -> None:
        """Choose patches of at most as many levels as `radii` has for each sample."""
        self.net, self.state, self.parameters = net, state, parameters
        self.radii = radii
        self.shrinks = 0
        self._flattener, self._frontier = flattener, frontier
        self._rate = turning_rate(
            net.indptr, net.indices, net.edge, net.turn, 16, progress=progress
        )
        self._placed = self._near_field = 0

    def accepted(self, angle: F8) -> None:
        """Tell the angles to the field of vertices just synthesised."""
        self._placed += len(angle)
        near = np.abs(angle) < np.radians(self.parameters.near_field)
        self._near_field += int(near.sum())

    def choose(self, vertex: int) -> FlatPatch:
        """Return the work patch that is to cover `vertex`, bent along the field."""
        patch = self._choose(vertex)
        if self.parameters.literal or self.parameters.bend == 0.0:
            return patch
        direction, bare = self._directions(patch.order, patch.inner, patch.plane)
        bend, _ = fit_bend(direction, patch.plane, bare, patch.inner, self.parameters.bend)
        patch.plane = bent(patch.plane, bend)
        return patch

    def _directions(
        self, order: I4, inner: int, plane: F8
    ) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
        """Field directions in the plane at a patch's first `inner` vertices, and which are bare."""
        net = self.net
        turn = field_directions(
            net.indptr, net.indices, net.edge, order, inner, self._flattener.local, plane
        )
        return turn[:, 0] + 1j * turn[:, 1], self.state.bare_for(order[:inner])

    def _choose(self, vertex: int) -> FlatPatch:
        """Return the flattened patch, seeded ahead of the frontier.

        A patch that had to shrink is seeded anew, nearer, lest it lose touch with the part
        that it must continue.
        """
        if self.parameters.literal:
            return self._flattener.flatten(vertex, self._most(vertex))
        ahead = self.parameters.ahead
        ahead = self._most(vertex) // 2 if ahead is None else ahead
        seed, depth, near = self._frontier.ahead(vertex, ahead)
        if near < FEW_BARE:
            patch = self._flattener.flatten(vertex, min(self._most(vertex), 12))
            patch.reason = patch.reason or "few"
            return patch
        patch = self._flattener.flatten(seed, self._reach(seed), self._straight)
        if depth > 0 and patch.radius < min(self._most(seed), depth + 4):
            self._flattener.release(patch)
            seed, _, _ = self._frontier.ahead(vertex, min(ahead, patch.radius // 2))
            patch = self._flattener.flatten(seed, self._reach(seed), self._straight)
        return patch

    def _reach(self, seed: int) -> int:
        """Radius worth flattening: a quarter more than the field's turning there allows.

        The median distance from a diameter of the unit disk is 0.4.
        """
        allowed = (self._bend() / 0.4 + self.parameters.bend) / max(self._rate[seed], 1e-4)
        most = self._most(seed)
        return int(np.clip(SLACK * allowed, min(LEAST_BENT, most), most))

    def _most(self, vertex: int) -> int:
        """Largest radius of a patch around `vertex`."""
        return self.radii[self.state.home(vertex)]

    def _bend(self) -> float:
        """Bound in radians on a patch's median angle to the field.

        `max_bend` while more than half of the texture so far lies within `near_field` of the
        field, no more than `near_field` otherwise: the median stays below that at the least
        cost in seams.
        """
        on_course = self._near_field >= ON_COURSE * self._placed
        most = self.parameters.max_bend
        return float(np.radians(most if on_course else min(most, self.parameters.near_field)))

    def _straight(self, order: I4, start: I4, plane: F8, radius: int) -> int:
        """Largest radius at which the field does not turn too much for one piece of texture."""
        bound = self._bend()
        inner = int(start[min(radius + 1, len(start) - 1)])
        direction, bare = self._directions(order, inner, plane)
        while radius > LEAST_BENT:
            count = int(start[min(radius + 1, len(start) - 1)])
            _, left = fit_bend(direction, plane, bare, count, self.parameters.bend)
            if left <= bound:
                break
            radius = max(int(radius * SHRINK), LEAST_BENT)
            self.shrinks += 1
        return radius


@njit(cache=True)
def median_direction(directions, fallback):  # type: ignore[no-untyped-def]
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
