"""Logarithm, exponential and sRGB curve on f4 arrays, in place, as loops that vectorise.

The C library's functions are called value by value; these polynomials run ten times as fast,
are right to two units in the last place, and give the same bits whatever library is installed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.btf.colour import LUMINANCE

_LN2_HIGH, _LN2_LOW = np.float32(0.693359375), np.float32(-2.12194440e-4)
_LOG2_E = np.float32(1.44269504)
_ONE, _TWO, _HALF = np.float32(1), np.float32(2), np.float32(0.5)
_C3, _C5, _C7, _C9 = (np.float32(2 / k) for k in (3, 5, 7, 9))
_E2, _E3, _E4, _E5, _E6 = (np.float32(1 / k) for k in (2, 6, 24, 120, 720))
_RED, _GREEN, _BLUE = (np.float32(weight) for weight in LUMINANCE)
_GREATEST, _ROOT = np.float32(3e38), np.float32(1.7e19)  # the root of about that
_BRIGHTEST, _SHARE = np.float32(85), np.float32(16)  # of codes: their product is still finite
_FLOOR, _CEILING = np.float32(-87), np.float32(88.3)
_MANTISSA, _LEAST = np.int32(0x007FFFFF), np.int32(0x3F2AAAAB)  # 2/3


@njit(inline="always", error_model="numpy")
def _log(x):  # type: ignore[no-untyped-def]
    # x = 2^e m with m in 2/3 … 4/3, and log m = 2 artanh((m - 1) / (m + 1)). Numba widens
    # every integer to 64 bits unless it is told otherwise, and then nothing vectorises
    bits = np.int32(np.float32(x).view(np.int32) - _LEAST)
    exponent = np.int32(bits >> np.int32(23))
    m = np.int32(np.int32(bits & _MANTISSA) + _LEAST).view(np.float32)
    e = np.float32(exponent)
    s = (m - _ONE) / (m + _ONE)
    t = s * s
    tail = s * t * (_C3 + t * (_C5 + t * (_C7 + t * _C9)))
    return e * _LN2_HIGH + (_TWO * s + (tail + e * _LN2_LOW))


@njit(inline="always", error_model="numpy")
def _exp(x):  # type: ignore[no-untyped-def]
    x = min(max(x, _FLOOR), _CEILING)
    n = np.float32(np.floor(x * _LOG2_E + _HALF))
    r = (x - n * _LN2_HIGH) - n * _LN2_LOW
    value = _ONE + (r + r * r * (_E2 + r * (_E3 + r * (_E4 + r * (_E5 + r * _E6)))))
    scale = np.int32(np.int32(np.int32(n) + np.int32(127)) << np.int32(23)).view(np.float32)
    return value * scale


@njit(cache=True, nogil=True, error_model="numpy")
def log_into(values, out):  # type: ignore[no-untyped-def]
    """Write the logarithm of positive normal f4 `values` (n,) into `out` (n,)."""
    for i in range(len(values)):
        out[i] = _log(values[i])


@njit(cache=True, nogil=True, error_model="numpy")
def exp_into(values, out):  # type: ignore[no-untyped-def]
    """Write the exponential of f4 `values` (n,), clipped to -87 … 88.3, into `out` (n,)."""
    for i in range(len(values)):
        out[i] = _exp(values[i])


@njit(cache=True, nogil=True, error_model="numpy")
def srgb_in_place(values):  # type: ignore[no-untyped-def]
    """Turn linear f4 `values` (n,) into sRGB-coded ones, clipped to 0–1 (IEC 61966-2-1)."""
    gamma = np.float32(1 / 2.4)
    for i in range(len(values)):
        x = min(max(values[i], np.float32(0)), _ONE)
        high = np.float32(1.055) * _exp(_log(max(x, np.float32(1e-30))) * gamma)
        low = x * np.float32(12.92)
        values[i] = low if x <= np.float32(0.0031308) else high - np.float32(0.055)


@njit(cache=True, nogil=True, error_model="numpy")
def code_rows(red, green, blue, kind, epsilon, knee):  # type: ignore[no-untyped-def]
    """Code radiance (n,) f4 of three colours in place; see `encoding.encode`.

    kind: index into `encoding.NAMES`; knee: radiance, or 0 for none.
    """
    if knee > 0:
        for row in (red, green, blue):
            for i in range(len(row)):
                x = row[i]
                row[i] = knee * (_ONE + _log(x / knee)) if x > knee else x
    if kind == 1:
        for row in (red, green, blue):
            for i in range(len(row)):
                row[i] = np.sqrt(row[i])
    elif kind == 2:
        for row in (red, green, blue):
            for i in range(len(row)):
                row[i] = _log(row[i] + epsilon)
    elif kind == 3:
        for i in range(len(red)):
            r, b = red[i] + epsilon, blue[i] + epsilon
            luminance = _RED * r + _GREEN * (green[i] + epsilon) + _BLUE * b
            red[i] = _log(luminance)
            green[i] = r / luminance
            blue[i] = b / luminance


@njit(cache=True, nogil=True, error_model="numpy")
def decode_rows(red, green, blue, kind, epsilon, knee):  # type: ignore[no-untyped-def]
    """Undo `code_rows` in place; what no radiance has as its code is taken as the nearest."""
    zero = np.float32(0)
    if kind == 1:
        for row in (red, green, blue):
            for i in range(len(row)):
                x = min(max(row[i], zero), _ROOT)
                row[i] = x * x
    elif kind == 2:
        for row in (red, green, blue):
            for i in range(len(row)):
                row[i] = max(_exp(row[i]) - epsilon, zero)
    elif kind == 3:
        for i in range(len(red)):
            luminance = _exp(min(red[i], _BRIGHTEST))
            r = min(max(green[i], zero), _SHARE) * luminance
            b = min(max(blue[i], zero), _SHARE) * luminance
            red[i] = max(r - epsilon, zero)
            green[i] = max((luminance - _RED * r - _BLUE * b) / _GREEN - epsilon, zero)
            blue[i] = max(b - epsilon, zero)
    else:
        for row in (red, green, blue):
            for i in range(len(row)):
                row[i] = min(max(row[i], zero), _GREATEST)
    if knee > 0:
        for row in (red, green, blue):
            for i in range(len(row)):
                x = row[i]
                row[i] = min(knee * _exp(x / knee - _ONE), _GREATEST) if x > knee else x
