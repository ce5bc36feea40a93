"""Colour spaces at the edges of the program; inside, radiance is linear Rec. 709."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.types import F4

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_XYZ_TO_RGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)


def srgb_to_linear(coded: NDArray[Any]) -> F4:
    """Linear values of sRGB-coded ones (IEC 61966-2-1): u1, u2, or floats in 0–1; f4."""
    if coded.dtype == np.uint8:
        return _TABLE[coded]
    if coded.dtype == np.uint16:
        return _linear(coded.astype(np.float32) / np.float32(65535))
    return _linear(coded.astype(np.float32))


def linear_to_srgb(linear: NDArray[Any]) -> F4:
    """sRGB-coded values of linear ones, clipped to 0–1; f4."""
    value = np.clip(linear, 0, 1).astype(np.float32)
    high = np.float32(1.055) * np.power(value, np.float32(1 / 2.4)) - np.float32(0.055)
    return np.where(value <= np.float32(0.0031308), value * np.float32(12.92), high)


def xyz_to_linear(xyz: NDArray[Any]) -> F4:
    """Linear Rec. 709 colours (…, 3) of CIE XYZ ones under D65; may be negative."""
    return (xyz.astype(np.float64) @ _XYZ_TO_RGB.T).astype(np.float32)


def _linear(value: F4) -> F4:
    high = np.power((value + np.float32(0.055)) / np.float32(1.055), np.float32(2.4))
    return np.where(value <= np.float32(0.04045), value / np.float32(12.92), high)


_TABLE = _linear(np.arange(256, dtype=np.float32) / np.float32(255))
