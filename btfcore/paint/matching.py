"""Joint patch matching over texture and constraint channel (Zhou §IV-A, last paragraph).

Cost of a placement = Σ_known ‖I − S‖² / (u/2)² + μ Σ_all (m_0 − m_S)², over the patch's
pixels inside the sample: what is already as wanted must be continued, and the feature must
lie where it is wanted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from btfcore.paint.constrained import unit_of
from btfcore.paint.palette import Palette
from btfcore.patch.connectivity import Connectivity
from btfcore.patch.resample import work_image
from btfcore.quilt.lay import Lay
from btfcore.quilt.matching import Matcher, Placement, local_minima, natural_factor
from btfcore.types import F4, F8, I4

CONSTRAINT = 4.0  # μ, of the constraint's SSD against the texture's
INSIDE = 0.6  # share of the patch that must lie inside the sample
RELAXED = (INSIDE, 0.35, 0.1, 0.0)
KEEP_TURNS = 3  # orientations that are looked at closely, of those tried on a coarse grid
COARSE = 4.0  # texels a side of its pixels, at most


class JointMatcher:
    """Answers joint matchings against one sample; spectra are computed once per size."""

    def __init__(self, palette: Palette, sample: int) -> None:
        """Prepare for `sample` of the palette."""
        space = palette.match(sample)
        self.values, self.grid = space.values, space.grid
        self.frames = palette.sheet.frames
        self._scale = (unit_of(palette, sample) / 2) ** 2
        feature = palette.feature_of(sample)[..., None]
        self._fine = self._pair(feature, natural_factor(self.grid))
        self._coarse: tuple[Matcher, Matcher] | None = None
        self._feature = feature

    def _pair(self, feature: F4, factor: int) -> tuple[Matcher, Matcher]:
        """Matchers of the texture and of the constraint channel."""
        constraint = np.ascontiguousarray(feature, np.float32)
        return (
            Matcher(self.grid, factor=factor),
            Matcher(replace(self.grid, match=constraint), factor=factor),
        )

    def find(
        self,
        net: Connectivity,
        local: I4,
        lay: Lay,
        values: F4,
        known: NDArray[np.bool_],
        target: F8,
        *,
        turns: Sequence[float],
        most: int,
    ) -> list[Placement]:
        """The `most` cheapest placements (local minima), cheapest first.

        values (n, k) f4: what the patch's vertices show, in the sample's match space; known
        (n,): where that is to be continued; target (n,) f8: m_0; turns: radians by which the
        patch may be turned against the field. Several turns are tried on a coarse grid first.
        """
        if len(turns) > 1:
            turns = self._best_turns(net, local, lay, values, known, target, turns)
        found = []
        for turn in turns:
            image, weight = self._image(net, local, lay, values, known, target, turn)
            costs, count, area = self._costs(self._fine, image, weight)
            for at in _minima(costs, count, area, most):
                row, column = int(at[0]), int(at[1])
                factor = self._fine[0].factor
                cost = float(costs[row, column])
                found.append(Placement(float(column * factor), float(row * factor), cost, turn))
        found.sort(key=lambda placement: placement.cost)
        return found[:most]

    def _best_turns(
        self,
        net: Connectivity,
        local: I4,
        lay: Lay,
        values: F4,
        known: NDArray[np.bool_],
        target: F8,
        turns: Sequence[float],
    ) -> list[float]:
        """The turns whose best placement on a coarse grid is cheapest."""
        if self._coarse is None:
            side = min(self.grid.match.shape[:2])
            factor = int(np.clip(side // 32, 1, COARSE)) * self._fine[0].factor
            self._coarse = self._pair(self._feature, factor)
        best = []
        for index, turn in enumerate(turns):
            image, weight = self._image(net, local, lay, values, known, target, turn)
            costs, count, area = self._costs(self._coarse, image, weight)
            lowest = np.where(count >= INSIDE * area, costs, np.inf).min()
            best.append((float(lowest), index))
        best.sort()
        return [turns[index] for _, index in best[:KEEP_TURNS]]

    def _image(
        self,
        net: Connectivity,
        local: I4,
        lay: Lay,
        values: F4,
        known: NDArray[np.bool_],
        target: F8,
        turn: float,
    ) -> tuple[F4, F4]:
        """Work image (k + 2, side, side) with target and known as last channels, and its mask."""
        order = lay.patch.order
        spun = lay.points(self.grid.unit) * np.exp(1j * turn)
        point = np.stack([spun.real, -spun.imag], axis=1)
        layers = np.concatenate([values, target[:, None], known[:, None]], axis=1, dtype=np.float32)
        reach = float(np.abs(point[: lay.patch.inner]).max()) if lay.patch.inner else 0.0
        most = max(self.grid.cut.shape[:2])
        half = int(min(-(-(reach + 1) // 4) * 4, -(-most // 4) * 4))
        everywhere = np.ones(len(order), np.bool_)
        return work_image(
            net.faces, net.face_ptr, net.face_of, order, local, point, layers, everywhere, half
        )

    def _costs(self, pair: tuple[Matcher, Matcher], image: F4, mask: F4) -> tuple[F8, F8, float]:
        """Joint cost at every centre, pixels of the patch inside the sample, and all of them."""
        texture, constraint = pair
        known = np.where(image[-1] > 0.999, mask, np.float32(0.0))
        wanted, everywhere = constraint.reduced(image[-2:-1], mask)
        feature, count = constraint.costs(wanted, everywhere)
        total = CONSTRAINT * feature * count
        if known.any():
            shown, weight = texture.reduced(image[:-2], known)
            ssd, seen = texture.costs(shown, weight)
            total = total + ssd * seen / self._scale
        return total / np.maximum(count, 1e-3), count, float(everywhere.sum())


def _minima(costs: F8, count: F8, area: float, most: int) -> NDArray[np.int64]:
    """(row, column) of local minima where enough of the patch lies inside the sample."""
    for share in RELAXED:
        allowed = count >= max(share * area, min(1.0, area))
        found = local_minima(costs, allowed, most)
        if len(found):
            return np.asarray(found)
    return np.zeros((0, 2), np.int64)
