"""From linear radiance to what a display shows: exposure, a curve, sRGB coding.

Curves, by channel and monotone; x is radiance times 2^exposure:

- "clip": x up to 1. A sample seen at intensity 1 and exposure 0 keeps its own sRGB colours.
- "reinhard": x (1 + x / w²) / (1 + x), which reaches 1 at the white point w (Reinhard, Stark,
  Shirley, Ferwerda, "Photographic tone reproduction for digital images", SIGGRAPH 2002, eq. 4).
- "filmic": x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14), the fit of Narkowicz ("ACES filmic tone
  mapping curve", 2015) to the ACES reference transform; deep shadows get darker.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.btf.colour import linear_to_srgb
from btfcore.errors import InvalidParameter
from btfcore.types import F4, F8

CURVES = ("clip", "reinhard", "filmic")
WHITE = 4.0
_MOST_STOPS = 120.0  # beyond, 2^exposure is no float32; all is black or white long before

_TILE = 3 << 8

U1 = NDArray[np.uint8]


def develop(
    radiance: NDArray[Any],
    exposure: float = 0.0,
    curve: str = "clip",
    *,
    white: float = WHITE,
    out: U1 | None = None,
) -> U1:
    """8-bit sRGB codes of linear radiance (…, 3) f4.

    The code nearest to 255 `displayed(…)` of every value, found in a table, whatever the
    curve. NaN and what is negative become 0, infinity white. exposure : stops. white : where
    "reinhard" reaches white, > 0. out : filled and returned where given, of the same shape,
    or (…, 4), whose last channel is left alone; slices of it may be filled by threads.
    Raises `InvalidParameter`.
    """
    factor = _factor(exposure, curve, white)
    values = np.asarray(radiance, np.float32)
    if values.ndim < 2 or values.shape[-1] != 3:
        raise InvalidParameter(f"radiance of shape {values.shape}, where (…, 3) is needed")
    if out is None:
        out = np.empty(values.shape, np.uint8)
    wanted = (values.shape, (*values.shape[:-1], 4))
    if out.dtype != np.uint8 or out.shape not in wanted or not out.flags.c_contiguous:
        raise InvalidParameter(f"codes of {values.shape} do not fit {out.dtype} {out.shape}")
    rows = np.ascontiguousarray(values).reshape(-1)
    table = _table(curve, float(white) if curve == "reinhard" else WHITE)
    _develop(rows, factor, *table, out.reshape(-1, out.shape[-1]))
    return out


def displayed(
    radiance: NDArray[Any], exposure: float = 0.0, curve: str = "clip", *, white: float = WHITE
) -> F4:
    """sRGB-coded values (…) f4 in 0–1 of linear radiance (…): what `develop` rounds."""
    factor = _factor(exposure, curve, white)
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = np.asarray(radiance, np.float32) * factor
    return linear_to_srgb(toned(scaled, curve, white=white))


def toned(radiance: NDArray[Any], curve: str = "clip", *, white: float = WHITE) -> F8:
    """Linear display values (…) f8 in 0–1 of exposed linear radiance (…), before sRGB."""
    _factor(0.0, curve, white)
    x = np.nan_to_num(np.asarray(radiance, np.float64), nan=0.0, posinf=1e30, neginf=0.0)
    x = np.clip(x, 0.0, 1e30)
    if curve == "reinhard":
        x = x / (1 + x) * (1 + (x / white) / white)
    elif curve == "filmic":
        # over x², which may be huge
        inverse = 1 / np.maximum(x, 1e-30)
        fit = (2.51 + 0.03 * inverse) / (2.43 + (0.59 + 0.14 * inverse) * inverse)
        x = np.where(x > 0, fit, 0.0)
    return np.minimum(x, 1.0)


def _factor(exposure: float, curve: str, white: float) -> np.float32:
    """2^exposure; checks the knobs."""
    if curve not in CURVES:
        raise InvalidParameter(f"curve {curve!r}; there are {', '.join(CURVES)}")
    if not np.isfinite(exposure):
        raise InvalidParameter(f"an exposure of {exposure} stops")
    if not 1e-3 <= white <= 1e9:
        raise InvalidParameter(f"a white point of {white:g}, 0.001 to 1e9 can be")
    return np.float32(2.0 ** np.clip(exposure, -_MOST_STOPS, _MOST_STOPS))


@lru_cache(maxsize=16)
def _table(curve: str, white: float) -> tuple[U1, F4, np.float32, np.float32, int]:
    """Codes by the upper bits of a float: `code` at a bucket's begin, one more from `limit` on.

    A float's bits, read as an integer, grow with it, and their upper part is a piecewise linear
    logarithm: as fine where it is dark as where it is bright. Returns code and limit (n,), the
    first and the last bucket's begin, which hold beyond, and by how many bits to shift.
    """
    limits = _limits(curve, white)
    bits = limits.view(np.int32)
    for shift in range(16, 8, -1):
        bucket = bits >> shift
        if len(np.unique(bucket)) == len(bucket):
            break
    else:  # pragma: no cover - no curve is that steep
        raise InvalidParameter(f"curve {curve!r} with white {white:g} is too steep for a table")
    lowest, highest = int(bucket[0]), int(bucket[-1]) + 1  # the last for all that is brighter
    begin = (np.arange(lowest, highest + 1, dtype=np.int32) << shift).view(np.float32)
    code = np.searchsorted(limits, begin, side="right").astype(np.uint8)
    limit = np.full(len(begin), np.nan, np.float32)  # which even infinity does not reach
    inside = code < 255
    limit[inside] = limits[code[inside]]
    return code, limit, begin[0], begin[-1], shift


def _limits(curve: str, white: float) -> F4:
    """Least radiances (255,) f4 that get the codes 1 … 255, by bisection over all floats."""
    wanted = np.arange(1, 256) - 0.5
    low, high = np.zeros(255, np.int64), np.full(255, np.float32(3e38).view(np.int32), np.int64)
    while (high - low > 1).any():
        middle = (low + high) // 2
        value = middle.astype(np.int32).view(np.float32)
        reached = _srgb(toned(value, curve, white=white)) * 255 >= wanted
        low, high = np.where(reached, low, middle), np.where(reached, middle, high)
    return high.astype(np.int32).view(np.float32)


def _srgb(linear: F8) -> F8:
    """Double-precision sRGB coding, free of the noise of float32 powers."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


@njit(cache=True, nogil=True)
def _develop(values, factor, code, limit, least, most, shift, out):  # type: ignore[no-untyped-def]
    """Fill `out` (n, 3 or 4) from values (3n,), whose bits are clamped to those of the table."""
    scaled = np.empty(_TILE, np.float32)
    number = scaled.view(np.int32)
    first = np.empty(1, np.float32)
    first[0] = least
    lowest = first.view(np.int32)[0] >> shift
    for low in range(0, len(values), _TILE):
        wide = min(_TILE, len(values) - low)
        # without a branch, so that noisy pictures are as fast as smooth ones; NaN is no more
        # than `least`
        for n in range(wide):
            value = values[low + n] * factor
            value = value if value > least else least
            scaled[n] = value if value < most else most
        row = low // 3
        for n in range(wide // 3):
            for k in range(3):
                place = (number[3 * n + k] >> shift) - lowest
                out[row + n, k] = code[place] + np.uint8(scaled[3 * n + k] >= limit[place])
