"""Room for patches in what is background of a sample, where features are not synthesised."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, uniform_filter

from btfcore.quilt.sheet import roomy
from btfcore.types import F8

STEP = 1.5  # patches whose radii differ by less share one penalty
AMPLE = 0.7  # of the greatest room in the sample, which is enough for the first patch


class Room:
    """Where in one sample a patch finds background; answers many questions about one mask."""

    def __init__(self, barred: NDArray[np.bool_], weight: float) -> None:
        """Prepare for barred texels (h, w).

        weight: mean SSD that a placement must save to be tried although all of it is barred.
        """
        self._barred, self._weight = barred, weight
        self._penalties: dict[int, F8] = {}
        self.reach = 2 if roomy(barred, 2).any() else 1
        _, self._near = distance_transform_edt(~roomy(barred, self.reach), return_indices=True)

    def penalty(self, radius: float) -> F8:
        """What to add to the mean SSD (h, w) for a patch of `radius` texels at every texel.

        The weight times the barred share of the texels around, and the weight once more where
        the patch's centre would be barred.
        """
        size = int(np.log(max(radius, 1.0)) / np.log(STEP))
        if size not in self._penalties:
            side = 2 * round(STEP**size) + 1
            share = uniform_filter(self._barred.astype(np.float64), side, mode="nearest")
            self._penalties[size] = self._weight * (share + self._barred)
        return self._penalties[size]

    def start(self, share: float) -> tuple[float, float]:
        """(column, row) of a texel with ample room around it; `share` in 0–1 chooses which."""
        inner = np.pad(~self._barred, 1)
        room = np.asarray(distance_transform_edt(inner))[1:-1, 1:-1]
        row, column = np.nonzero(room >= AMPLE * room.max())
        chosen = min(int(share * len(row)), len(row) - 1)
        return float(column[chosen]), float(row[chosen])

    def nearest(self, at: F8) -> F8:
        """Nearest texel to `at` (column, row) with nothing barred within `reach` texels."""
        height, width = self._barred.shape
        column = min(max(round(float(at[0])), 0), width - 1)
        row = min(max(round(float(at[1])), 0), height - 1)
        return self._near[::-1, row, column].astype(np.float64)
