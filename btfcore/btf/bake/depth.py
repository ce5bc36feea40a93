"""How deep a height map is: the steps of its 8 bits taken out, its depth told by the normals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.ndimage import gaussian_filter

from btfcore.btf.bake.slopes import slopes_of_height, slopes_of_normals
from btfcore.types import F4

AGREES = 0.3  # correlation of slopes from which on two maps are taken to show one relief
LEVEL = 1 / 255  # step between the values of an 8-bit map
_FEWEST = 16  # distinct levels below which a map is meant to have steps
_WIDTHS = (0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0)  # texels, of the smoothing Gaussians
_AGREE = 0.9  # share of a neighbourhood that a Gaussian must fit before it is used there
_SOFT = 1.0  # texels, of the Gaussian that both maps are blurred by before they are compared


@dataclass(frozen=True)
class DepthFit:
    """Depth in texels that fits a normal map best, and how well.

    correlation : of the two maps' slopes along s and along t, -1 … 1. A negative one along t
    alone means that green points down ("DirectX"), two negative ones that white is deep.
    """

    depth: float
    correlation: tuple[float, float]

    @property
    def match(self) -> float:
        """The better correlation, whatever its sign."""
        return max(abs(self.correlation[0]), abs(self.correlation[1]))

    @property
    def note(self) -> str:
        """What was done, for a user."""
        return (
            f"depth {self.depth:.2f} texels, fitted to the normal map"
            f" (correlation {self.match:.2f})"
        )


def dequantized(height: F4, *, tiles: bool) -> F4:
    """Return a height map (H, W) in 0–1 without the steps of its 8 bits.

    Every texel takes the widest Gaussian mean that stays within half a level of the map all
    around it, so slopes that one level covers for many texels become smooth while whatever
    is larger than a level stays as it was. No value moves by more than half a level. Maps that
    are no multiples of 1/255, or have fewer than 16 levels, are returned as they are.
    """
    levels = height.astype(np.float64) * 255
    if np.abs(levels - np.rint(levels)).max() > 1e-3 or len(np.unique(height)) < _FEWEST:
        return height
    mode: Literal["wrap", "reflect"] = "wrap" if tiles else "reflect"
    exact = height.astype(np.float64)
    smooth = exact
    share = np.ones(height.shape)
    fine = share
    for width in _WIDTHS:
        mean = gaussian_filter(exact, width, mode=mode, truncate=3)
        fits = (np.abs(mean - exact) <= LEVEL / 2).astype(np.float64)
        fits = gaussian_filter(fits, width, mode=mode, truncate=3)
        share = np.minimum(share, np.clip((fits - _AGREE) / (1 - _AGREE), 0, 1))
        smooth = smooth + share * (mean - smooth)
        fine = share if width < 1.5 else fine
    blurred = gaussian_filter(smooth, 1.0, mode=mode)  # over the seams between widths
    smooth = smooth + fine * (blurred - smooth)
    return np.clip(smooth, exact - LEVEL / 2, exact + LEVEL / 2).astype(np.float32)


def fitted_depth(height: F4, normal: F4, *, tiles: bool) -> DepthFit:
    """Depth at which a height map's slopes fit a normal map's best, by least squares.

    height (H, W) in 0–1, normal (H, W, 3). Both kinds of slope are blurred alike before, since
    single texels say more about how the maps were stored than about the relief. Signs do not
    count for the depth, so maps that are upside down tell it too; where one of the maps is flat
    depth and correlation are 0.
    """
    mode: Literal["wrap", "reflect"] = "wrap" if tiles else "reflect"
    shape = slopes_of_height(height, tiles=tiles)
    wanted = slopes_of_normals(normal)
    for slopes in (shape, wanted):
        for axis in range(2):
            slopes[..., axis] = gaussian_filter(slopes[..., axis], _SOFT, mode=mode)
            slopes[..., axis] -= slopes[..., axis].mean()
    product = (shape * wanted).sum(axis=(0, 1))
    square, other = (shape**2).sum(axis=(0, 1)), (wanted**2).sum(axis=(0, 1))
    if square.sum() < 1e-12 or other.sum() < 1e-12:
        return DepthFit(0.0, (0.0, 0.0))
    along, up = product / np.sqrt(np.maximum(square * other, 1e-30))
    return DepthFit(float(np.abs(product).sum() / square.sum()), (float(along), float(up)))
