"""Colours as artists write them (hexadecimal sRGB), mixed in linear light."""

from __future__ import annotations

import numpy as np

from btfcore.btf.colour import srgb_to_linear
from btfcore.types import F8


def colour(code: str) -> F8:
    """Linear colour (3,) of a code such as "b0563c"."""
    parts = np.array([int(code[at : at + 2], 16) for at in (0, 2, 4)], np.uint8)
    return srgb_to_linear(parts).astype(np.float64)


def palette(codes: str) -> F8:
    """Linear colours (n, 3) of codes parted by blanks."""
    return np.stack([colour(code) for code in codes.split()])


def ramp(codes: str, value: F8) -> F8:
    """Colours (…, 3) along evenly spaced stops, value in 0–1; blended by perceived tone."""
    stops = np.cbrt(palette(codes))
    place = np.clip(value, 0.0, 1.0) * (len(stops) - 1)
    low = np.minimum(place.astype(np.int64), len(stops) - 2)
    part = (place - low)[..., None]
    return (stops[low] * (1 - part) + stops[low + 1] * part) ** 3


def shade(albedo: F8, factor: F8) -> F8:
    """Scale colours (…, 3) by a factor a place."""
    return albedo * factor[..., None]
