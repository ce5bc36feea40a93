"""Rough weathered stone with lichen, bare and mossy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.btf.pbr import PbrSet
from btfcore.types import F8
from resources.recipes.canvas import Canvas
from resources.recipes.cells import cells, scatter
from resources.recipes.colours import colour, palette, ramp, shade
from resources.recipes.noise import blur, hollow, mix, noise, step


@dataclass(frozen=True, eq=False)
class Rock:
    """Maps of bare stone, height in texels."""

    height: F8
    albedo: F8
    roughness: F8


def facets(canvas: Canvas, what: str, spacing: float, tilt: float, ragged: float) -> F8:
    """Broken faces: a random plane a cell, meeting in ridges and steps, deviation 1."""
    moved = (
        ragged * noise(canvas, what + " down", spacing * 1.5, 1.5, slope=1.3),
        ragged * noise(canvas, what + " right", spacing * 1.5, 1.5, slope=1.3),
    )
    broken = cells(canvas, scatter(canvas, what, spacing, 1.0), warped=moved)
    rng = canvas.rng(what + " planes")
    lean = rng.normal(0, tilt, (len(broken.points), 2))
    rise = rng.normal(0, tilt * spacing * 0.32, len(broken.points))
    number = broken.number
    plane = rise[number] + lean[number, 0] * broken.offset[0] + lean[number, 1] * broken.offset[1]
    return plane


def rock(canvas: Canvas) -> Rock:
    """Draw the bare stone."""
    rng = canvas.rng("rock")
    large = blur(canvas, facets(canvas, "large", 26, 0.095, 1.8), 1.1)
    middle = blur(canvas, facets(canvas, "middle", 11, 0.2, 1.2), 0.35)
    small = blur(canvas, facets(canvas, "small", 4.6, 0.2, 0.6), 0.15)
    sand = noise(canvas, "sand", 2.4, 0.6, slope=0.5)
    rough = 0.8 * large + 0.8 * middle + 0.5 * small + 0.045 * sand
    seam = noise(canvas, "seam", 60, 3, slope=1.5)
    crack = np.maximum(1 - np.abs(seam) / 0.035, 0.0)
    crack *= step(-0.2, 0.8, noise(canvas, "seamed", 34, 8))
    pits = cells(canvas, scatter(canvas, "pits", 5.0, 1.0))
    wide = rng.uniform(-2.2, 1.3, len(pits.points))[pits.number]
    pit = np.clip(wide - pits.first, 0.0, 0.8)
    height = 0.52 * rough - 0.7 * crack - 0.6 * pit
    tone = 0.5 + 0.16 * noise(canvas, "tone", 34, 4, slope=1.2) + 0.1 * small + 0.05 * middle
    albedo = ramp("5a574f 77726a 8d887d a39c8e b9b1a0", tone)
    iron = step(0.6, 2.2, noise(canvas, "iron", 30, 2.0, slope=1.2) + 0.5 * middle)
    albedo = mix(albedo, colour("97754c"), 0.55 * iron)
    grains = cells(canvas, scatter(canvas, "grains", 1.6, 1.0))
    kind = rng.random(len(grains.points))[grains.number]
    albedo = mix(albedo, colour("3c3a37"), (kind < 0.1) * 0.5)
    albedo = mix(albedo, colour("cfc8ba"), (kind > 0.88) * 0.45)
    albedo = shade(albedo, 1 + 0.06 * sand)
    crest = step(0.1, 1.1, -hollow(canvas, height, 1.6))
    albedo = mix(albedo, colour("c2bbab"), 0.35 * crest)
    dirt = step(0.1, 1.7, hollow(canvas, height, 2.2))
    albedo = mix(albedo, albedo * np.array([0.4, 0.38, 0.34]), 0.8 * dirt)
    lichen, spread = _lichen(canvas)
    spread = spread * step(1.4, 0.2, hollow(canvas, height, 2.2))
    albedo = mix(albedo, lichen, spread)
    return Rock(height + 0.12 * spread, albedo, 0.9 + 0.04 * spread)


def _lichen(canvas: Canvas) -> tuple[F8, F8]:
    """Colour and cover of crusts of lichen: scalloped discs with a paler rim."""
    rng = canvas.rng("lichen")
    moved = (
        1.1 * noise(canvas, "scallop down", 8, 0.8, slope=1.0),
        1.1 * noise(canvas, "scallop right", 8, 0.8, slope=1.0),
    )
    discs = cells(canvas, scatter(canvas, "lichen", 11, 1.0), warped=moved)
    size = rng.uniform(-9.0, 5.2, len(discs.points))[discs.number]
    inside = size - discs.first
    cover = step(0.0, 0.8, inside)
    cover *= step(-1.1, 0.1, noise(canvas, "crust", 3, 0.7, slope=0.6) + 0.5 * inside)
    kinds = palette("b9bda2 a9ae92 c4c3ad c29a45")
    tone = kinds[rng.choice(4, len(discs.points), p=[0.4, 0.3, 0.2, 0.1])][discs.number]
    rim = step(1.8, 0.3, inside)
    return shade(tone, 0.8 + 0.2 * rim), 0.8 * cover


def stone(canvas: Canvas) -> PbrSet:
    """Weathered grey stone."""
    bare = rock(canvas)
    return canvas.finish(
        "stone",
        albedo=bare.albedo,
        height=bare.height,
        roughness=bare.roughness,
        texel_size=2.0,
    )
