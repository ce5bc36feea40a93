"""Which places of the sample were taken already, so that a pattern does not show its repeats."""

from __future__ import annotations

import numpy as np

from btfcore.types import F8

WIDTH = 8.0  # texels within which a placement counts as taken again


class Reuse:
    """A map of earlier placements, and what repeating one shall cost in matching.

    A place's cost is `weight` times the usual difference between the best match and the last
    of those kept: where placements are all alike, repeating one is dear to no picture.
    """

    def __init__(self, height: int, width: int, weight: float) -> None:
        """Begin with nothing taken of a sample of height × width texels."""
        self._taken = np.zeros((height, width))
        self._weight = weight
        self._spread, self._seen = 0.0, 0

    def penalty(self) -> F8:
        """Return what is added to the mean SSD at every texel (h, w)."""
        return self._taken * (self._weight * self._spread)

    def matched(self, best: float, last: float) -> None:
        """Tell the mean SSD of the best and of the last placement kept."""
        self._seen += 1
        self._spread += (last - best - self._spread) / self._seen

    def taken(self, column: float, row: float) -> None:
        """Tell where a patch's centre was placed."""
        height, width = self._taken.shape
        down = np.exp(-0.5 * ((np.arange(height) - row) / WIDTH) ** 2)
        across = np.exp(-0.5 * ((np.arange(width) - column) / WIDTH) ** 2)
        self._taken += down[:, None] * across
