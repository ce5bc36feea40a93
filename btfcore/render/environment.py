"""The light that comes from all around: a latitude–longitude map of radiance.

Scene coordinates have +y up. Column u ∈ [0, 1) (texel centres at (column + 1/2) / W) looks along
azimuth 2π (u - 1/2) from +x towards +z, row v ∈ [0, 1] along the polar angle πv from +y: the middle
of the picture looks along +x, its left edge along -x, and seen from inside it is not mirrored.
This is the convention of three.js (`equirectUv`) and, after glTF's turn of the axes, of Blender.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from btfcore.btf.colour import LUMINANCE
from btfcore.errors import InvalidParameter
from btfcore.render.lights import BRIGHTEST
from btfcore.types import F4, F8, Frozen


@dataclass(frozen=True, eq=False)
class Environment(Frozen):
    """A map of radiance around the scene.

    radiance (H, 2H, 3) f4: linear Rec. 709, finite and ≥ 0, laid out as this module says;
    rotation: degrees by which it is turned about +y, from +z towards +x like the azimuth of a
    camera on a turntable; intensity: factor on all of it.
    Raises `InvalidParameter` for another shape, and for numbers that no light can have.
    """

    radiance: F4
    rotation: float = 0.0
    intensity: float = 1.0

    def __post_init__(self) -> None:
        """Check everything once."""
        shape = self.radiance.shape
        if len(shape) != 3 or shape[2] != 3 or shape[0] < 1 or shape[1] != 2 * shape[0]:
            raise InvalidParameter(f"an environment of shape {shape}, where (H, 2H, 3) is needed")
        if self.radiance.dtype != np.float32:
            raise InvalidParameter(f"an environment of {self.radiance.dtype}, float32 is needed")
        if not np.isfinite(self.rotation):
            raise InvalidParameter(f"an environment turned by {self.rotation} degrees")
        if not 0 <= self.intensity < np.inf:
            raise InvalidParameter(f"an environment of intensity {self.intensity}")
        low, high = float(self.radiance.min()), float(self.radiance.max())
        if not (low >= 0 and high * max(self.intensity, 1.0) * 4 <= BRIGHTEST):
            raise InvalidParameter(
                f"an environment of radiances {low:g} to {high:g} times {self.intensity:g}, where"
                f" 0 to {BRIGHTEST / 4:g} can be"
            )
        super().__post_init__()

    def radiance_towards(self, directions: F8) -> F4:
        """Radiance (n, 3) f4 that arrives from `directions` (n, 3), of any length but 0.

        Bilinear between texel centres, around the back and over the poles too. A direction
        that is none (zero, not finite) sees black.
        """
        vectors = np.ascontiguousarray(directions, np.float64).reshape(-1, 3)
        out = np.empty((len(vectors), 3), np.float32)
        turn = np.radians(self.rotation % 360.0)
        _look(self.radiance, vectors, np.cos(turn), np.sin(turn), self.intensity, out)
        return out


def turned(vectors: F8, degrees: float) -> F8:
    """Vectors (…, 3) f8 turned about +y, from +z towards +x."""
    turn = np.radians(degrees % 360.0)
    c, s = np.cos(turn), np.sin(turn)
    x, y, z = np.moveaxis(np.asarray(vectors, np.float64), -1, 0)
    return np.stack([c * x + s * z, y, c * z - s * x], axis=-1)


def texel_directions(height: int) -> F8:
    """Unit directions (H, 2H, 3) f8 in which the texel centres of an unturned map look."""
    polar = np.pi * (np.arange(height) + 0.5) / height
    around = np.pi * ((np.arange(2 * height) + 0.5) / height - 1)
    across = np.sin(polar)[:, None]
    up = np.broadcast_to(np.cos(polar)[:, None], (height, 2 * height))
    return np.stack([across * np.cos(around), up, across * np.sin(around)], axis=-1)


def row_solid_angles(height: int) -> F8:
    """Solid angle (H,) f8 of one texel of each row, exact; over all texels they add up to 4π."""
    # cos a - cos b as a product, which keeps its digits at the poles
    middle = np.pi * (np.arange(height) + 0.5) / height
    return 2 * np.sin(middle) * np.sin(np.pi / (2 * height)) * np.pi / height


def total(environment: Environment) -> F8:
    """Integral (3,) f8 of the radiance over the sphere."""
    rows = environment.radiance.sum(axis=1, dtype=np.float64)
    share = row_solid_angles(len(rows))
    return np.einsum("hc,h->c", rows, share) * environment.intensity


def reduced(radiance: F4, height: int) -> F4:
    """Map (H, 2H, 3) of fewer rows, each texel the mean over its solid angle of what it covers.

    The integral over the sphere is kept. A map that has no more rows comes back as it is.
    """
    rows, columns = radiance.shape[:2]
    if height >= rows:
        return radiance
    # the area under a row's share of the polar axis is a difference of cosines
    middle = np.empty((height, columns, 3))
    edges = np.cos(np.pi * np.arange(rows + 1) / rows)
    for row in range(height):
        low, high = row * rows / height, (row + 1) * rows / height
        first, last = int(low), min(rows, int(np.ceil(high - 1e-9)))
        top = np.append(np.cos(np.pi * low / rows), edges[first + 1 : last])
        bottom = np.append(edges[first + 1 : last], np.cos(np.pi * high / rows))
        share = (top - bottom) / (top[0] - bottom[-1])
        middle[row] = np.einsum("r,rwc->wc", share, radiance[first:last].astype(np.float64))
    out = np.empty((height, 2 * height, 3))
    for column in range(2 * height):
        low, high = column * columns / (2 * height), (column + 1) * columns / (2 * height)
        first, last = int(low), min(columns, int(np.ceil(high - 1e-9)))
        places = np.arange(first, last)
        share = np.minimum(places + 1, high) - np.maximum(places, low)
        out[:, column] = np.einsum("w,hwc->hc", share / share.sum(), middle[:, first:last])
    return out.astype(np.float32)


def luminance(radiance: F4) -> F8:
    """Luminance (…) f8 of linear Rec. 709 radiance (…, 3)."""
    red, green, blue = LUMINANCE
    colours = radiance.astype(np.float64)
    return red * colours[..., 0] + green * colours[..., 1] + blue * colours[..., 2]


@njit(cache=True, nogil=True)
def _look(radiance, vectors, c, s, intensity, out):  # type: ignore[no-untyped-def]
    height, width = radiance.shape[0], radiance.shape[1]
    for n in range(len(vectors)):
        # the map is turned, so the direction turns back
        x = c * vectors[n, 0] - s * vectors[n, 2]
        z = c * vectors[n, 2] + s * vectors[n, 0]
        y = vectors[n, 1]
        out[n] = 0.0
        largest = max(abs(x), max(abs(y), abs(z)))
        if not 0.0 < largest < np.inf:
            continue
        x, y, z = x / largest, y / largest, z / largest
        column = (np.arctan2(z, x) / (2 * np.pi) + 0.5) * width - 0.5
        row = np.arctan2(np.sqrt(x * x + z * z), y) / np.pi * height - 0.5
        left, above = int(np.floor(column)), int(np.floor(row))
        right_share, below_share = column - left, row - above
        for i in range(2):
            here, shift = above + i, 0
            if here < 0:
                here, shift = 0, width // 2  # over the pole, and down its other side
            elif here >= height:
                here, shift = height - 1, width // 2
            for j in range(2):
                there = (left + j + shift) % width
                share = below_share if i else 1.0 - below_share
                share *= right_share if j else 1.0 - right_share
                for k in range(3):
                    out[n, k] += np.float32(share * intensity) * radiance[here, there, k]
