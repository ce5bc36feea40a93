"""Slopes of a relief: from heights, from normals, and back."""

from __future__ import annotations

import numpy as np
from scipy import fft

from btfcore.types import F4, F8

_STEEPEST = 0.05  # normals leaning further than to this z are taken as leaning this far


def slopes_of_height(height: F4 | F8, *, tiles: bool) -> F8:
    """Slopes (H, W, 2) f8 along s and t of a height field in texels, by central differences."""
    out = np.empty((*height.shape, 2))
    around = np.pad(height.astype(np.float64), 1, mode="wrap" if tiles else "symmetric")
    out[..., 0] = (around[1:-1, 2:] - around[1:-1, :-2]) / 2
    out[..., 1] = (around[:-2, 1:-1] - around[2:, 1:-1]) / 2  # t points up, rows go down
    return out


def slopes_of_normals(normal: F4) -> F8:
    """Slopes (H, W, 2) f8 along s and t of the surface with these normals (H, W, 3)."""
    long = normal.astype(np.float64)
    length = np.linalg.norm(long, axis=2, keepdims=True)
    long = np.where(length > 1e-6, long / np.maximum(length, 1e-6), [0.0, 0.0, 1.0])
    return -long[..., :2] / np.maximum(long[..., 2:], _STEEPEST)


def normals_of_slopes(slopes: F8) -> F8:
    """Unit normals (H, W, 3) f8 of a surface with these slopes along s and t."""
    up = np.ones((*slopes.shape[:2], 1))
    normal = np.concatenate([-slopes, up], axis=2)
    return normal / np.linalg.norm(normal, axis=2, keepdims=True)


def mirrored(slopes: F8) -> F8:
    """Slopes (2H, 2W, 2) of a relief continued by its mirror images, which then tiles."""
    wide = np.concatenate([slopes, slopes[:, ::-1] * [-1.0, 1.0]], axis=1)
    return np.concatenate([wide, wide[::-1] * [1.0, -1.0]], axis=0)


def integrated(slopes: F8, *, tiles: bool) -> F8:
    """Height (H, W) f8 in texels, with mean 0, whose slopes come nearest to those given.

    Least squares in the frequency domain (Frankot and Chellappa 1988), for slopes as central
    differences see them; where those hardly see anything, towards waves of two texels, their
    response is taken to rise on instead of falling, so that noise does not become stripes. An
    overall tilt is dropped. Fields that do not tile are continued by their mirror images.
    """
    rows, columns = slopes.shape[:2]
    if not tiles:
        slopes = mirrored(slopes)
    along, up = (_response(count) for count in (slopes.shape[1], slopes.shape[0]))
    square = along[None] ** 2 + up[:, None] ** 2
    square[0, 0] = 1
    for response in (along, up):
        if len(response) % 2 == 0:
            response[len(response) // 2] = 0  # the sign of the shortest wave is unknown
    spectrum = along[None] * fft.fft2(slopes[..., 0]) - up[:, None] * fft.fft2(slopes[..., 1])
    return fft.ifft2(-1j * spectrum / square).real[:rows, :columns]


def _response(count: int) -> F8:
    """Slope that a wave of height 1 has, for the frequencies of a transform of `count` values."""
    wave = 2 * np.pi * fft.fftfreq(count)
    rising = np.sign(wave) * (1 + np.abs(wave) - np.pi / 2)
    return np.where(np.abs(wave) <= np.pi / 2, np.sin(wave), rising)
