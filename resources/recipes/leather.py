"""Cognac leather with its grain."""

from __future__ import annotations

import numpy as np

from btfcore.btf.pbr import PbrSet
from resources.recipes.canvas import Canvas
from resources.recipes.cells import cells, scatter
from resources.recipes.colours import colour, ramp, shade
from resources.recipes.noise import mix, noise, step


def leather(canvas: Canvas) -> PbrSet:
    """Pebbled full-grain leather, satin on the crests."""
    rng = canvas.rng("leather")
    moved = (
        0.8 * noise(canvas, "grain down", 12, 2, slope=1.3),
        0.8 * noise(canvas, "grain right", 12, 2, slope=1.3),
    )
    pebble = cells(canvas, scatter(canvas, "pebbles", 6.2, 1.0), warped=moved)
    fine = cells(canvas, scatter(canvas, "fine", 2.3, 1.0), warped=moved)
    swell = rng.normal(0, 0.16, len(pebble.points))[pebble.number]
    dome = 1 - np.exp(-pebble.border / 0.8)
    minor = 1 - np.exp(-fine.border / 0.35)
    fold = noise(canvas, "fold", 40, 7, slope=1.4, stretch=(0.8, 1.5))
    crease = np.maximum(1 - np.abs(fold - 0.25) / 0.09, 0.0) * step(
        -0.3, 0.9, noise(canvas, "creased", 36, 12)
    )
    pores = cells(canvas, scatter(canvas, "pores", 3.4, 1.0))
    open_ = rng.uniform(-0.5, 0.5, len(pores.points))[pores.number]
    pore = step(0.0, 0.35, open_ - pores.first)
    height = dome * (0.72 + swell) + 0.07 * minor - 0.45 * crease - 0.25 * pore + 0.25 * fold
    valley = 1 - dome * (0.85 + 0.15 * minor)
    tone = 0.5 + 0.13 * noise(canvas, "tan", 34, 5, slope=1) + 0.3 * swell
    tone = tone + 0.05 * noise(canvas, "mottle", 3, 0.8, slope=0.7)
    albedo = ramp("6e371a 8d4b24 a65f30 b87440", tone)
    albedo = mix(albedo, colour("35180c"), np.clip(0.78 * valley + 0.4 * crease, 0, 0.9))
    albedo = mix(albedo, colour("2b140a"), 0.7 * pore)
    albedo = shade(albedo, 1 + 0.03 * noise(canvas, "dye", 1.4, 0.6, slope=0.2))
    worn = 0.03 * noise(canvas, "wear", 20, 3)
    roughness = np.maximum(0.42 + 0.26 * valley + 0.1 * crease + worn, 0.38)
    return canvas.finish(
        "leather", albedo=albedo, height=height, roughness=roughness, texel_size=0.2
    )
