"""Turquoise enamel on sheet steel, sound and rusting through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.btf.pbr import PbrSet
from btfcore.types import F8
from resources.recipes.canvas import Canvas
from resources.recipes.cells import cells, scatter
from resources.recipes.colours import colour, ramp, shade
from resources.recipes.noise import mix, noise, step

ENAMEL = "2c6f70 3a8583 4c9892"


@dataclass(frozen=True, eq=False)
class Coat:
    """Maps of a coat of paint, height in texels above the steel."""

    height: F8
    albedo: F8
    roughness: F8


def coat(canvas: Canvas) -> Coat:
    """Draw the sound coat: roller stipple, dust nibs, chalking where the sun was."""
    rng = canvas.rng("nibs")
    peel = noise(canvas, "peel", 12.0, 6.0, slope=0.2)
    sag = noise(canvas, "sag", 34, 9, slope=1.2)
    nibs = cells(canvas, scatter(canvas, "nibs", 7.0, 1.0))
    size = rng.uniform(-5.0, 1.3, len(nibs.points))[nibs.number]
    nib = np.sqrt(np.maximum(size**2 * (size > 0) - nibs.first**2, 0.0))
    # Stipple is lens-shaped: crests are round, the hollows between them sharper.
    height = 0.15 * np.where(peel > 0, peel, 0.7 * peel) + 0.14 * sag + 0.17 * nib
    chalk = step(-0.4, 2.2, noise(canvas, "chalk", 40, 9, slope=1.3) + 0.2 * peel)
    tone = 0.5 + 0.14 * noise(canvas, "tone", 44, 12, slope=1.0) + 0.03 * peel
    albedo = ramp(ENAMEL, tone)
    albedo = mix(albedo, colour("86b3ab"), 0.2 * chalk)
    dust = step(0.5, 2.2, -peel + 0.7 * noise(canvas, "dust", 18, 2, slope=1)) * 0.1
    albedo = mix(albedo, colour("8f8b78"), dust)
    albedo = shade(albedo, 1 + 0.025 * noise(canvas, "pigment", 1.6, 0.6, slope=0.2))
    roughness = 0.4 + 0.09 * chalk + 0.22 * dust
    return Coat(height, albedo, roughness)


def painted_metal(canvas: Canvas) -> PbrSet:
    """Rolled turquoise enamel."""
    sound = coat(canvas)
    return canvas.finish(
        "painted-metal",
        albedo=sound.albedo,
        height=sound.height,
        roughness=sound.roughness,
        texel_size=0.4,
    )
