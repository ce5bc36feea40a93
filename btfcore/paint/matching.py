"""Joint patch matching over texture and constraint channel (Zhou §IV-A, last paragraph).

Cost of a placement = Σ_known ‖I − S‖² / (u/2)² + μ Σ_all (m_0 − m_S)², per vertex inside the
sample: what is already as wanted must be continued, and the feature must lie where it is
wanted. The whole sample is searched on a coarse grid by FFT, in every orientation asked for;
the best places are then looked at closely, at the patch's own vertices.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.paint.constrained import unit_of
from btfcore.paint.palette import Palette
from btfcore.paint.search import CoarseSearch
from btfcore.quilt.lay import Lay
from btfcore.quilt.matching import Placement, local_minima
from btfcore.quilt.state import QuiltState
from btfcore.types import F4, F8, I4

CONSTRAINT = 4.0  # μ, of the constraint's SSD against the texture's
RELAXED = (0.6, 0.35, 0.1, 0.0)  # share of the patch that must lie inside the sample
SMALL, LARGE = 64, 400  # sides of samples searched texel by texel, and on every fourth texel
LOOKED_AT = 3  # places that are looked at closely, for each that is wanted
VERTICES = 1500  # of a patch that are compared when a place is looked at closely
APART = 2.0  # texels and degrees: nearer places are one


class JointMatcher:
    """Answers joint matchings against one sample; spectra are computed once per size."""

    def __init__(self, palette: Palette, sample: int, *, unit: float | None = None) -> None:
        """Prepare for `sample` of the palette; unit: u, None: that of the sample alone."""
        space = palette.match(sample)
        self.values, self.grid = space.values, space.grid
        self._palette = palette
        self._scale = ((unit_of(palette, sample) if unit is None else unit) / 2) ** 2
        self._feature = np.ascontiguousarray(palette.feature_of(sample))
        self._searches: dict[int, CoarseSearch] = {}

    def find(
        self,
        lay: Lay,
        state: QuiltState,
        known: NDArray[np.bool_],
        target: F8,
        *,
        turns: Sequence[float],
        most: int,
    ) -> list[Placement]:
        """The `most` cheapest placements, cheapest first.

        state: the quilt, whose values are continued at the vertices `known` (n,); target (n,)
        f8: m_0; turns: radians by which the patch may be turned against the field.
        """
        order = lay.patch.order
        exact = self.values_of(state, order)
        points = lay.points(self.grid.unit)
        search = self._search(len(turns))
        factor = search.factor
        costs, count, area = search.costs(points, turns, exact, known, target)
        places: list[tuple[float, int, int, int]] = []
        for index in range(len(turns)):
            for row, column in _minima(costs[index], count[index], area[index], LOOKED_AT * most):
                places.append((float(costs[index, row, column]), index, int(row), int(column)))
        places.sort()
        del places[LOOKED_AT * most :]
        stride = max(len(order) // VERTICES, 1)
        some = slice(None, None, stride)
        middle = (factor - 1) / 2
        found = []
        for _, index, row, column in places:
            turn = turns[index]
            column_, row_, cost = look_closely(
                self.grid.match, self._feature, points[some] * np.exp(1j * turn), exact[some],
                known[some], target[some], column * factor + middle, row * factor + middle,
                factor, self._scale, CONSTRAINT,
            )  # fmt: skip
            found.append(Placement(column_, row_, cost, float(turn)))
        found.sort(key=lambda placement: placement.cost)
        return _apart(found, most)

    def values_of(self, state: QuiltState, order: I4) -> F4:
        """What vertices (n,) show, (n, k) f4 in the sample's match space."""
        return self._palette.values_at(self.values, state.sample[order], state.source[order])

    def _search(self, turns: int) -> CoarseSearch:
        """Search on a grid that is the coarser, the larger the sample and the more turns."""
        side = min(self.grid.match.shape[:2])
        factor = 4 if side > LARGE or (turns > 1 and side >= 2 * SMALL) else 2
        if side < SMALL:
            factor = 1
        if factor not in self._searches:
            self._searches[factor] = CoarseSearch(
                self.grid.match, self._feature, factor, self._scale, CONSTRAINT
            )
        return self._searches[factor]


@njit(cache=True)
def look_closely(  # type: ignore[no-untyped-def]
    match, feature, points, values, known, target, column, row, reach, scale, constraint
):
    """Best (column, row) within `reach` texels of a place, and its joint cost per vertex.

    match (h, w, k), feature (h, w); points (n,) complex: the patch's vertices about its
    centre, y up, in texels; values (n, k): what they show; known (n,); target (n,): m_0.
    Nearest texels are compared; the step is halved from `reach` down to one texel.
    """
    best = joint_cost(match, feature, points, values, known, target, column, row, scale, constraint)
    step = max(reach // 2, 1)
    while True:
        centre_column, centre_row = column, row
        for down in range(-1, 2):
            for across in range(-1, 2):
                if down == 0 and across == 0:
                    continue
                x, y = centre_column + step * across, centre_row + step * down
                if x < 0 or y < 0 or x > feature.shape[1] - 1 or y > feature.shape[0] - 1:
                    continue  # the centre itself must be covered
                cost = joint_cost(
                    match, feature, points, values, known, target, x, y, scale, constraint
                )
                if cost < best:
                    best, column, row = cost, x, y
        if step == 1:
            break
        step //= 2
    return column, row, best


@njit(cache=True)
def joint_cost(  # type: ignore[no-untyped-def]
    match, feature, points, values, known, target, column, row, scale, constraint
):
    """Joint cost per vertex inside the sample of a patch centred at (column, row)."""
    height, width, channels = match.shape
    total, inside = 0.0, 0
    for index in range(len(points)):
        x = int(np.floor(column + points[index].real + 0.5))
        y = int(np.floor(row - points[index].imag + 0.5))
        if x < 0 or y < 0 or x >= width or y >= height:
            continue
        inside += 1
        total += constraint * (target[index] - feature[y, x]) ** 2
        if known[index]:
            ssd = 0.0
            for k in range(channels):
                ssd += (values[index, k] - match[y, x, k]) ** 2
            total += ssd / scale
    return total / inside if inside > 0 else np.inf


def _minima(costs: F8, count: F8, area: float, most: int) -> NDArray[np.int64]:
    """(row, column) of local minima where enough of the patch lies inside the sample."""
    for share in RELAXED:
        allowed = count >= max(share * area, min(1.0, area))
        found = local_minima(costs, allowed, most)
        if len(found):
            return np.asarray(found)
    return np.zeros((0, 2), np.int64)


def _apart(found: Sequence[Placement], most: int) -> list[Placement]:
    """The first `most` of `found` that are not nearly the same as one before."""
    kept: list[Placement] = []
    for at in found:
        if len(kept) == most:
            break
        if not any(
            abs(at.column - other.column) < APART
            and abs(at.row - other.row) < APART
            and abs(at.turn - other.turn) < np.radians(APART)
            for other in kept
        ):
            kept.append(at)
    return kept
