"""The brick wall, cracked by settlement."""

from __future__ import annotations

import numpy as np

from btfcore.btf.pbr import PbrSet
from btfcore.types import F8
from resources.recipes.brick import LIME, Wall, wall
from resources.recipes.canvas import Canvas
from resources.recipes.cells import cells, distance, grown, scatter
from resources.recipes.colours import colour, ramp, shade
from resources.recipes.noise import mix, noise, step
from resources.recipes.paths import dense, weakest
from resources.recipes.stone import facets
from resources.recipes.tubes import draw


def cracked_brick(canvas: Canvas) -> PbrSet:
    """Old bricks with a crack that takes joints where it can and bricks where it must."""
    sound = wall(canvas)
    gap, open_ = _crack(canvas, sound)
    near = distance(canvas, open_ > 0, 16.0)
    core, lost = _spall(canvas, sound, near)
    clay = sound.face > 0
    fresh = _fresh(canvas, core, clay)
    height = sound.height - lost * (1.15 + 0.9 * clay) + core * lost
    albedo = mix(sound.albedo, fresh, step(0.15, 0.6, lost))
    # Hairline shadows and brick dust gather along the crack.
    dust = step(4.0, 0.3, near) * step(-0.6, 1.2, noise(canvas, "dust", 9, 1.2)) * 0.4
    albedo = mix(albedo, colour("c08a6a"), dust * (open_ <= 0))
    depth = step(0.0, 0.9, open_)
    height = height - depth * (4.2 + 1.2 * gap)
    inner = albedo * np.array([0.28, 0.22, 0.19])
    albedo = mix(albedo, inner, 0.9 * step(0.0, 0.7, open_))
    feature = np.maximum(step(-0.2, 0.2, open_), step(0.3, 0.5, lost))
    return canvas.finish(
        "cracked-brick",
        albedo=albedo,
        height=height,
        roughness=mix(sound.roughness, np.full(near.shape, 0.96), lost),
        mask=grown(canvas, feature, by=5.0, soft=4.0),
        texel_size=3.5,
    )


def _crack(canvas: Canvas, sound: Wall) -> tuple[F8, F8]:
    """Local half width of the crack, and how far inside it a place lies, in texels."""
    rng = canvas.rng("crack")
    coarse = min(2, canvas.fine)
    every = canvas.fine // coarse
    brittle = noise(canvas, "brittle", 14, 1.0, slope=0.9)
    cost = np.exp(0.55 * brittle) * mix(np.full(brittle.shape, 0.5), 1.0, step(-1, 1, sound.face))
    cost = cost[::every, ::every]
    size = canvas.size * coarse
    start = (0.5 * size, 0.5 * size)
    ends = [(0.2, 0.37), (0.8, 0.66), (0.36, 0.74), (0.68, 0.3)]
    ways = weakest(cost, start, [(row * size, column * size) for row, column in ends])
    places, radius = [], []
    for number, way in enumerate(ways):
        path = dense(way / coarse, 0.4 / canvas.fine, smooth=0)
        path = dense(path, 0.4 / canvas.fine, smooth=4.0)
        path = path + _kinks(rng, len(path), 0.4 / canvas.fine)
        share = np.linspace(0, 1, len(path))
        uneven = np.interp(share * 40, np.arange(41), rng.normal(1, 0.28, 41))
        widest = (1.35, 1.35, 0.75, 0.6)[number]
        # Branches begin as wide as they are, not as the trunk is.
        places.append(np.concatenate([path, np.zeros((len(path), 1))], 1))
        radius.append(np.maximum(widest * uneven * (1 - share**1.5) + 0.16, 0.16))
    drawn = draw(canvas, np.concatenate(places), np.concatenate(radius), -1.0)
    sizes = np.concatenate(radius)
    gap = np.where(drawn.covered, sizes[drawn.number], 0.0)
    return gap, np.where(drawn.covered, drawn.height, 0.0)


def _kinks(rng: np.random.Generator, count: int, spacing: float) -> F8:
    """Offsets (count, 2) that make a line angular, as brittle things break."""
    out = np.zeros((count, 2))
    at = np.arange(count) * spacing
    for every, size in ((3.2, 0.55), (1.4, 0.22)):
        knots = int(at[-1] / every) + 3
        places = (np.arange(knots) + rng.uniform(-0.3, 0.3, knots)) * every
        for axis in (0, 1):
            out[:, axis] += np.interp(at, places, rng.normal(0, size, knots))
    fade = np.minimum(at / 2.0, 1.0)
    return out * fade[:, None]


def _spall(canvas: Canvas, sound: Wall, near: F8) -> tuple[F8, F8]:
    """Relief of the broken core (texels) and where flakes are lost (0–1)."""
    rng = canvas.rng("spall")
    moved = (0.5 * noise(canvas, "flake down", 5, 0.8), 0.5 * noise(canvas, "flake right", 5, 0.8))
    flakes = cells(canvas, scatter(canvas, "flakes", 5.0, 1.0), warped=moved)
    count = len(flakes.points)
    at = (flakes.points * canvas.fine).astype(np.int64) % canvas.side
    close = near[at[:, 0], at[:, 1]]
    gone = (rng.random(count) < np.exp(-((close / 4.0) ** 1.5)) * 0.62) & (close < 9)
    lost = gone[flakes.number] * step(0.0, 0.55, flakes.border + 0.25 * ~gone[flakes.number])
    inner = gone[flakes.number].astype(np.float64)
    edge = distance(canvas, inner < 0.5, 2.0)
    lost = step(0.0, 0.9, edge + 0.2 * noise(canvas, "flake rim", 3, 0.7)) * inner
    core = 0.5 * facets(canvas, "core", 4.0, 0.3, 0.6) + 0.12 * noise(canvas, "core sand", 2, 0.6)
    return core, lost


def _fresh(canvas: Canvas, core: F8, clay: np.ndarray) -> F8:
    """Colour of broken brick and broken mortar."""
    tone = 0.5 + 0.35 * core + 0.12 * noise(canvas, "fresh", 6, 0.7, slope=0.8)
    inside = ramp("a4573a bd6c47 cf8259", tone)
    lime = shade(np.broadcast_to(colour(LIME), inside.shape), 0.7 + 0.2 * tone)
    return mix(lime, inside, clay.astype(np.float64))
