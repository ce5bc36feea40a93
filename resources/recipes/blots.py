"""Outlines of what spreads over a surface: rust, moss, wet."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from btfcore.types import F8
from resources.recipes.canvas import Canvas

Spot = tuple[float, float, float]  # row, column and radius as shares of the canvas's edge


def satellites(
    rng: np.random.Generator, count: int, far: tuple[float, float], size: tuple[float, float]
) -> list[Spot]:
    """Small spots about the middle of the canvas, most of them tiny."""
    angle = rng.uniform(0, 2 * np.pi, count)
    away = rng.uniform(*far, count)
    radius = size[0] + (size[1] - size[0]) * rng.random(count) ** 2
    places = 0.5 + away * np.sin(angle), 0.5 + away * np.cos(angle), radius
    return [(float(row), float(column), float(wide)) for row, column, wide in zip(*places)]  # noqa: B905


def blots(canvas: Canvas, spots: list[Spot], *, melt: float, ragged: ArrayLike) -> F8:
    """Distance in texels inside spots that run into each other over `melt` texels, < 0 outside.

    ragged : what moves the outline (side, side), less so for spots that are small themselves.
    """
    rows, columns = canvas.grid()
    total = np.zeros((canvas.side, canvas.side))
    for row, column, radius in spots:
        far = np.hypot(rows - row * canvas.size, columns - column * canvas.size)
        inside = radius * canvas.size - far + np.asarray(ragged) * min(1.0, radius * 11)
        total += np.exp(np.clip(inside / melt, -60, 60))
    return melt * np.log(total + 1e-26)
