"""Whether a sample's background looks the same in every orientation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, gaussian_filter

from btfcore.types import F4

BINS = 24  # of gradient orientations over half a turn
SCALES = (1.0, 2.0)  # standard deviations in texels of the blur before gradients are taken
ORDERED = 0.3  # spread of the histogram from which a pattern has orientations of its own
AWAY = 5  # texels from a feature that a gradient must lie


def spread_of_orientations(values: F4, background: NDArray[np.bool_]) -> float:
    """How unequally gradient energy is spread over orientations: 0 for an isotropic pattern.

    values (h, w, k) f4; background (h, w): texels that count. The standard deviation of the
    histogram over its mean, the larger of two scales. On pictures: gravel, concrete, asphalt,
    rust and moss .05–.27, cloth .3–.5, bark, wood and brick .6–2.
    """
    inside = binary_erosion(background, iterations=AWAY, border_value=1)
    if not inside.any():
        inside = background
    most = 0.0
    for scale in SCALES:
        histogram = np.zeros(BINS)
        for k in range(values.shape[2]):
            layer = values[..., k].astype(np.float64)
            across = gaussian_filter(layer, scale, order=(0, 1), mode="nearest")[inside]
            down = gaussian_filter(layer, scale, order=(1, 0), mode="nearest")[inside]
            place = (np.arctan2(down, across) % np.pi) / np.pi * BINS
            histogram += np.bincount(
                place.astype(np.int64) % BINS, weights=across**2 + down**2, minlength=BINS
            )
        smooth = (np.roll(histogram, 1) + 2 * histogram + np.roll(histogram, -1)) / 4
        most = max(most, float(smooth.std() / max(smooth.mean(), 1e-300)))
    return most
