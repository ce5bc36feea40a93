"""Moss on the weathered stone: cushions of small shoots."""

from __future__ import annotations

import numpy as np

from btfcore.btf.pbr import PbrSet
from btfcore.types import F8
from resources.recipes.blots import blots, satellites
from resources.recipes.canvas import Canvas
from resources.recipes.cells import cells, grown, scatter
from resources.recipes.colours import ramp
from resources.recipes.noise import blur, hollow, mix, noise, step
from resources.recipes.stone import rock
from resources.recipes.tubes import draw

GREENS = "1e2a0c 33450f 4f6517 76892a a9b24a"
DRY = "3a3115 5d4f22 86753a"


def mossy_stone(canvas: Canvas) -> PbrSet:
    """Stone with cushion moss in the lee of its hollows."""
    bare = rock(canvas)
    deep = _spread(canvas, bare.height)
    ground, cushion = _cushions(canvas, bare.height, deep)
    places, radius, shoot, along = _shoots(canvas, ground, deep)
    drawn = draw(canvas, places, radius, -200.0)
    leaf = drawn.covered & (drawn.height > bare.height)
    height = np.where(leaf, drawn.height, np.maximum(bare.height, ground - 1.2))
    covered = leaf | (ground - 1.2 > bare.height)
    # Shoots let light through: their relief is softer than their outlines.
    soft = step(0.2, 0.8, blur(canvas, covered.astype(np.float64), 0.4))
    height = mix(height, blur(canvas, height, 0.7), 0.85 * soft)
    rng = canvas.rng("green")
    count = int(shoot.max()) + 1
    own = rng.normal(0, 0.13, count)
    tone = 0.22 + 0.5 * along + own[shoot]
    tone = tone[drawn.number] + 0.14 * noise(canvas, "vigour", 14, 3, slope=1.1)
    green = ramp(GREENS, tone)
    thin = step(5.5, 0.5, deep + 1.6 * noise(canvas, "thin", 9, 2, slope=1))
    green = mix(green, ramp(DRY, tone), 0.6 * thin)
    mat = ramp("14180a 232a10", 0.5 + 0.2 * noise(canvas, "mat", 3, 0.6))
    moss = np.where(leaf[..., None], green, mat)
    pit = step(0.2, 2.4, hollow(canvas, height, 1.2)) * 0.6
    moss = mix(moss, moss * np.array([0.4, 0.42, 0.36]), pit)
    # Stone beside moss stays damp and green with algae.
    damp = step(-7, 1.0, deep + 1.5 * noise(canvas, "damp", 10, 1.5)) * 0.55
    stone = mix(bare.albedo, bare.albedo * np.array([0.55, 0.6, 0.4]), damp)
    albedo = mix(stone, moss, covered.astype(np.float64))
    rough = np.where(covered, 0.82, bare.roughness - 0.12 * damp)
    cover = blur(canvas, covered.astype(np.float64), 0.8)
    return canvas.finish(
        "mossy-stone",
        albedo=albedo,
        height=height,
        roughness=rough,
        mask=grown(canvas, cover, by=1.5, soft=4.0),
        texel_size=2.0,
        notes=(f"cushions up to {cushion:.1f} texels high",),
    )


def _spread(canvas: Canvas, height: F8) -> F8:
    """How far inside the mossy region a place lies (texels); hollows draw it outward."""
    ragged = 5.0 * noise(canvas, "moss edge", 44, 4, slope=1.2)
    lee = np.clip(hollow(canvas, blur(canvas, height, 1.0), 6.0), -3, 3) * 2.0
    spots = [(0.44, 0.43, 0.15), (0.55, 0.56, 0.125), (0.39, 0.6, 0.07), (0.61, 0.4, 0.06)]
    spots += satellites(canvas.rng("moss"), 14, (0.22, 0.35), (0.01, 0.045))
    return blots(canvas, spots, melt=3.0, ragged=ragged + lee)


def _cushions(canvas: Canvas, height: F8, deep: F8) -> tuple[F8, float]:
    """Surface that the shoots stand on, and the cushions' greatest thickness (texels)."""
    rng = canvas.rng("cushions")
    moved = (
        0.8 * noise(canvas, "cushion down", 9, 2, slope=1.2),
        0.8 * noise(canvas, "cushion right", 9, 2, slope=1.2),
    )
    domes = cells(canvas, scatter(canvas, "cushions", 9.5, 1.0), warped=moved)
    lush = rng.uniform(0.6, 1.25, len(domes.points))[domes.number]
    bulge = np.sqrt(np.clip(domes.border / 4.2, 0, 1)) * 1.9 * lush
    thick = step(-0.5, 9.0, deep) * 0.9 + bulge * step(-0.5, 4.0, deep)
    base = blur(canvas, height, 2.0)
    # Moss fills hollows: its top stays near the stone's, whose relief it hides.
    ground = np.where(deep > -0.5, base + thick - 0.3, -100.0)
    return ground, float(thick.max())


def _shoots(canvas: Canvas, ground: F8, deep: F8) -> tuple[F8, F8, np.ndarray, F8]:
    """Spheres of all shoots: places, radii, the shoot of each and how far along it lies."""
    rng = canvas.rng("shoots")
    roots = scatter(canvas, "shoots", 1.15, 1.0)
    at = (roots * canvas.fine).astype(np.int64) % canvas.side
    inside = deep[at[:, 0], at[:, 1]]
    roots = roots[inside > rng.uniform(-0.6, 1.0, len(roots))]
    at = (roots * canvas.fine).astype(np.int64) % canvas.side
    level = ground[at[:, 0], at[:, 1]]
    down, right = canvas.slopes(np.where(ground < -50, level.min(), blur(canvas, ground, 1.0)))
    lean = np.stack([-down[at[:, 0], at[:, 1]], -right[at[:, 0], at[:, 1]]], 1)
    lean = np.clip(lean, -1, 1) * 0.5
    steps = 14
    share = np.linspace(0, 1, steps)
    count = len(roots)
    heading = rng.uniform(0, 2 * np.pi, count)
    tilt = rng.uniform(0.25, 1.0, count)
    length = rng.uniform(1.7, 3.4, count)
    flat = np.stack([np.sin(heading), np.cos(heading)], 1) * tilt[:, None] + lean
    path = roots[:, None] + flat[:, None] * (share**1.3)[None, :, None] * length[:, None, None]
    rise = 0.8 * length[:, None] * (share - 0.45 * tilt[:, None] * share**2)
    up = level[:, None] - 1.0 + rise
    places = np.concatenate([path, up[..., None]], -1).reshape(-1, 3)
    thick = 0.42 * (0.55 + 0.9 * share) * np.where(share > 0.75, 1 - (share - 0.75) * 2.4, 1)
    radius = np.tile(thick, count)
    return places, radius, np.repeat(np.arange(count), steps), np.tile(share, count)
