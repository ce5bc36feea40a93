"""Periodic random fields and the handful of curves that shape them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft, ndimage, special

from btfcore.types import F8
from resources.recipes.canvas import Canvas


def noise(
    canvas: Canvas,
    what: str,
    longest: float,
    shortest: float = 0.5,
    *,
    slope: float = 1.5,
    stretch: tuple[float, float] = (1.0, 1.0),
) -> F8:
    """Gaussian noise (side, side) of mean 0 and deviation 1 between two wavelengths (texels).

    slope : amplitude falls with frequency to this power (1.5 is rock-like, 0 band noise).
    stretch : how much longer features are along rows' direction (down) and along columns'.
    """
    side = canvas.side
    white = canvas.rng(what).standard_normal((side, side))
    down = fft.fftfreq(side, 1 / canvas.fine)[:, None] * stretch[0]
    right = fft.rfftfreq(side, 1 / canvas.fine)[None, :] * stretch[1]
    wave = np.hypot(down, right)
    wave[0, 0] = 1.0
    gain = wave**-slope
    gain *= 1 / (1 + (1 / (longest * wave)) ** 6) / (1 + (shortest * wave) ** 6)
    gain[0, 0] = 0.0
    field = fft.irfft2(fft.rfft2(white) * gain, (side, side))
    return field / field.std()


def even(field: F8) -> F8:
    """Spread Gaussian noise of deviation 1 evenly over 0–1."""
    return special.ndtr(field)


def wobble(canvas: Canvas, what: str, longest: float, shortest: float = 1.0) -> F8:
    """Periodic noise (side,) along one axis, deviation 1."""
    side = canvas.side
    wave = fft.rfftfreq(side, 1 / canvas.fine)
    wave[0] = 1.0
    gain = wave**-1.0 / (1 + (1 / (longest * wave)) ** 6) / (1 + (shortest * wave) ** 6)
    gain[0] = 0.0
    line = fft.irfft(fft.rfft(canvas.rng(what).standard_normal(side)) * gain, side)
    return line / line.std()


def blur(canvas: Canvas, field: F8, sigma: float | tuple[float, float]) -> F8:
    """Gaussian blur, sigma in texels (down, right)."""
    wide = np.broadcast_to(np.asarray(sigma, np.float64) * canvas.fine, 2)
    if field.ndim == 3:
        wide = np.append(wide, 0.0)
    return ndimage.gaussian_filter(field, tuple(wide), mode="wrap")


def hollow(canvas: Canvas, height: F8, sigma: float) -> F8:
    """How far the height lies under its surroundings (texels): > 0 in cavities."""
    return blur(canvas, height, sigma) - height


def warp(canvas: Canvas, field: F8, down: ArrayLike, right: ArrayLike) -> F8:
    """Look up a field at places moved by (down, right) texels."""
    rows, columns = np.indices((canvas.side, canvas.side), np.float64)
    places = [
        rows + np.asarray(down) * canvas.fine,
        columns + np.asarray(right) * canvas.fine,
    ]
    return ndimage.map_coordinates(field, places, order=1, mode="grid-wrap")


def step(low: ArrayLike, high: ArrayLike, value: ArrayLike) -> F8:
    """Smooth step: 0 below `low`, 1 above `high` (or the reverse where high < low)."""
    start = np.asarray(low, np.float64)
    part = np.clip((np.asarray(value, np.float64) - start) / (np.asarray(high) - start), 0.0, 1.0)
    return part * part * (3 - 2 * part)


def mix(one: ArrayLike, other: ArrayLike, share: ArrayLike) -> F8:
    """Blend by `share`; a share of one number a place also blends colours."""
    first, second = np.asarray(one, np.float64), np.asarray(other, np.float64)
    part = np.asarray(share, np.float64)
    coloured = (3,) in (first.shape[-1:], second.shape[-1:])
    if coloured and part.ndim and part.shape[-1:] != (1,):
        part = part[..., None]
    return first + (second - first) * part


def smooth_max(one: F8, other: F8, soft: float) -> F8:
    """Larger of two heights, rounded where they meet over `soft` texels."""
    gap = np.maximum(soft - np.abs(one - other), 0.0) / soft
    return np.maximum(one, other) + gap**2 * soft / 4
