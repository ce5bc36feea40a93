"""Oak under satin varnish, sound and scratched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.btf.pbr import PbrSet
from btfcore.types import F8
from resources.recipes.canvas import Canvas
from resources.recipes.colours import colour, ramp, shade
from resources.recipes.noise import mix, noise, step

RING = 128 / 9  # texels from one year ring to the next, on average


@dataclass(frozen=True, eq=False)
class Board:
    """Maps of a board, grain along the columns; height in texels."""

    height: F8
    albedo: F8
    roughness: F8
    late: F8


def board(canvas: Canvas) -> Board:
    """Draw the sound board: year rings, open pores, ray flecks, varnish that sinks in."""
    rows, _ = canvas.grid()
    rings = round(canvas.size / RING)
    # Rings wander along the grain and crowd in dry years.
    wander = 0.3 * noise(canvas, "wander", 100, 14, slope=1.7, stretch=(0.4, 3.0))
    ripple = 0.02 * noise(canvas, "ripple", 9, 2, slope=1.0, stretch=(0.5, 3.5))
    phase = rows / canvas.size * rings + wander + ripple
    year = phase - np.floor(phase)
    # Growth starts pale and porous, darkens slowly, and ends at a sharp line.
    late = year**1.7 * step(1.0, 0.93, year)
    fibre = noise(canvas, "fibre", 3.2, 0.5, slope=0.5, stretch=(0.55, 11.0))
    streak = noise(canvas, "streak", 26, 2, slope=1.1, stretch=(0.7, 7.0))
    early = step(0.5, 0.06, year) * step(0.0, 0.06, year)
    pore = _pores(canvas, "pores", early)
    pore = np.maximum(pore, 0.7 * _pores(canvas, "small pores", 0.25 + 0.3 * late))
    rays = noise(canvas, "rays", 7, 0.8, slope=0.8, stretch=(1.0, 3.0))
    fleck = step(1.5, 2.4, rays) * step(0.2, 1.0, noise(canvas, "flecked", 40, 10))
    tone = 0.42 + 0.36 * late + 0.1 * streak + 0.085 * fibre
    albedo = ramp("e0ac6a c98d4b b0733a 8f5729 6b3c1c", tone)
    albedo = mix(albedo, colour("e3b87f"), 0.35 * fleck)
    albedo = mix(albedo, colour("472612"), 0.8 * pore)
    albedo = shade(albedo, 1 + 0.05 * noise(canvas, "blotch", 40, 8, slope=1))
    height = -0.09 * pore + 0.05 * late + 0.014 * fibre + 0.02 * streak
    height = height + 0.06 * noise(canvas, "film", 18, 5, slope=0.8, stretch=(0.8, 1.6))
    roughness = np.maximum(0.42 + 0.12 * pore + 0.015 * fibre + 0.02 * streak, 0.38)
    return Board(height, albedo, roughness, late)


def _pores(canvas: Canvas, what: str, density: F8) -> F8:
    """Share of open pore (0–1): short dashes along the grain."""
    dash = noise(canvas, what, 2.2, 0.7, slope=0.2, stretch=(1.0, 9.0))
    need = 2.25 - 1.5 * density
    return step(need, need + 0.6, dash)


def varnished_wood(canvas: Canvas) -> PbrSet:
    """Honey-coloured oak under satin varnish."""
    sound = board(canvas)
    return canvas.finish(
        "varnished-wood",
        albedo=sound.albedo,
        height=sound.height,
        roughness=sound.roughness,
        texel_size=0.5,
    )
