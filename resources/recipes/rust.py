"""Rust that breaks through the enamel, lifts it and runs down."""

from __future__ import annotations

import numpy as np

from btfcore.btf.pbr import PbrSet
from btfcore.types import F8
from resources.recipes.blots import blots, satellites
from resources.recipes.canvas import Canvas
from resources.recipes.cells import cells, grown, scatter, signed
from resources.recipes.colours import colour, ramp, shade
from resources.recipes.noise import blur, hollow, mix, noise, step, wobble
from resources.recipes.paint import coat
from resources.recipes.stone import facets


def rusty_paint(canvas: Canvas) -> PbrSet:
    """Enamel with a patch of scaly rust, lifted edges, blisters and streaks."""
    sound = coat(canvas)
    spread = _spread(canvas)
    bare = _flaked(canvas, spread)
    inside = signed(canvas, bare, 9.0)
    lift = _lift(canvas, inside, spread)
    run = _run(canvas, bare)
    plates = blur(canvas, facets(canvas, "plates", 9.0, 0.2, 1.4), 0.6)
    scale = 0.6 * plates + 0.45 * blur(canvas, facets(canvas, "scale", 4.0, 0.24, 0.8), 0.4)
    scale += 0.12 * noise(canvas, "rust grain", 2.4, 0.7, slope=0.5)
    swell = 0.5 * step(0, 6, inside) + 0.3 * noise(canvas, "swell", 16, 4, slope=1.2)
    rust_height = -0.1 + 0.5 * scale + 0.6 * swell
    share = step(-0.45, 0.45, inside)
    height = mix(sound.height + 0.25 + lift, rust_height, share)
    rust = _oxide(canvas, scale, swell, inside)
    primer = step(-0.1, 0.15, inside) * step(1.0, 0.35, inside)
    primer = primer * step(-0.1, 0.6, noise(canvas, "primer", 9, 1.5))
    rust = mix(rust, colour("9b8f7c"), 0.65 * primer)
    albedo = _bleed(canvas, sound.albedo, inside, run, spread)
    albedo = mix(albedo, rust, share)
    dirt = step(0.05, 0.9, hollow(canvas, height, 1.3)) * 0.55
    albedo = mix(albedo, albedo * np.array([0.42, 0.34, 0.3]), dirt)
    stained = np.maximum(run, step(-4, 0, inside))
    roughness = mix(sound.roughness + 0.2 * stained, 0.88 - 0.06 * primer, share)
    feature = np.maximum(share, step(0.16, 0.45, np.maximum(run, 0.5 * lift)))
    return canvas.finish(
        "rusty-paint",
        albedo=albedo,
        height=height,
        roughness=roughness,
        mask=grown(canvas, feature, by=2.5, soft=4.0),
        texel_size=0.4,
    )


def _spread(canvas: Canvas) -> F8:
    """How far rust has crept under the paint (texels, < 0 where it has not)."""
    ragged = 4.4 * noise(canvas, "ragged", 44, 3.0, slope=1.25)
    spots = [(0.4, 0.43, 0.125), (0.46, 0.58, 0.095), (0.34, 0.57, 0.06), (0.52, 0.38, 0.06)]
    spots += satellites(canvas.rng("spread"), 16, (0.18, 0.28), (0.004, 0.032))
    return blots(canvas, spots, melt=3.0, ragged=ragged)


def _flaked(canvas: Canvas, spread: F8) -> np.ndarray:
    """Where the paint is gone: it breaks off in flakes."""
    rng = canvas.rng("flaked")
    moved = (
        0.45 * noise(canvas, "flake down", 4, 0.7, slope=0.8),
        0.45 * noise(canvas, "flake right", 4, 0.7, slope=0.8),
    )
    flakes = cells(canvas, scatter(canvas, "flakes", 3.1, 1.0), warped=moved)
    at = (flakes.points * canvas.fine).astype(np.int64) % canvas.side
    gone = spread[at[:, 0], at[:, 1]] + rng.normal(0, 1.1, len(flakes.points)) > 0.6
    return gone[flakes.number]


def _lift(canvas: Canvas, inside: F8, spread: F8) -> F8:
    """Rise of the paint (texels): curled up at the break, blistered where rust creeps."""
    rng = canvas.rng("lift")
    curl = 0.38 * np.exp(-np.maximum(-inside, 0) / 1.5)
    curl *= step(-0.8, 0.9, noise(canvas, "curl", 7, 1.5, slope=1.0))
    domes = cells(canvas, scatter(canvas, "domes", 10.0, 1.0))
    size = rng.uniform(2.4, 5.5, len(domes.points))
    at = (domes.points * canvas.fine).astype(np.int64) % canvas.side
    close = spread[at[:, 0], at[:, 1]]
    there = (close > -6.0) & (close < 1.5) & (rng.random(len(size)) < 0.7)
    radius = (size * there)[domes.number]
    share = domes.first / np.maximum(radius, 1e-6)
    dome = np.where(share < 1, (1 - np.minimum(share, 1) ** 2) ** 1.6, 0) * radius * 0.24
    return curl + dome


def _run(canvas: Canvas, bare: np.ndarray) -> F8:
    """Streaks that water washed out of the rust, 0–1, downwards."""
    wet = blur(canvas, bare.astype(np.float64), 0.6)
    length = np.exp(0.7 * wobble(canvas, "streaks", 26, 2.4)) * 13.0
    keep = np.exp(-1 / (length * canvas.fine))
    run = np.zeros(wet.shape)
    carried = np.zeros(canvas.side)
    for row in range(canvas.side):
        carried = np.maximum(wet[row], carried * keep)
        run[row] = carried
    run = blur(canvas, run, (0.5, 0.8))
    run *= 0.72 + 0.22 * noise(canvas, "washed", 14, 1.5, slope=1, stretch=(4.0, 0.6))
    rows, _ = canvas.grid()
    return np.clip(run * step(0.9, 0.74, rows / canvas.size), 0, 1)


def _oxide(canvas: Canvas, scale: F8, swell: F8, inside: F8) -> F8:
    # Old rust in the middle is dark and scaly, fresh rust at the edge orange and powdery.
    age = noise(canvas, "age", 26, 3.0, slope=1.3)
    tone = 0.5 - 0.3 * step(0.5, 9, inside) + 0.13 * age + 0.16 * np.clip(scale, -1.5, 1.5)
    albedo = ramp("271712 43241a 6a3519 934e20 b56c2e", tone)
    powder = step(0.2, 2.4, 0.9 * noise(canvas, "powder", 18, 1.2, slope=1.1) - 0.5 * age)
    powder = np.maximum(powder, 0.6 * step(4.5, 0.5, inside) * step(-1, 1, age))
    albedo = mix(albedo, colour("b87034"), 0.4 * powder)
    scab = step(0.7, 1.6, noise(canvas, "scab", 14, 2.0, slope=1.2) + 0.3 * scale)
    albedo = mix(albedo, colour("35241f"), 0.75 * scab)
    return shade(albedo, 1 + 0.08 * noise(canvas, "oxide grain", 1.8, 0.6, slope=0.2))


def _bleed(canvas: Canvas, paint: F8, inside: F8, run: F8, spread: F8) -> F8:
    halo = np.exp(-np.maximum(-inside, 0) / 2.2) * (inside > -8.9)
    creep = step(-5.0, 0.5, spread + 1.2 * noise(canvas, "creep", 7, 1.2)) * 0.3
    tint = np.clip(0.55 * halo + 0.9 * run**0.8 * step(1, -0.5, inside) + creep, 0, 0.88)
    tint *= 0.85 + 0.12 * noise(canvas, "tint", 6, 1, slope=0.8)
    tone = 0.5 + 0.25 * noise(canvas, "stain", 10, 1.5, slope=1)
    # A stain is a glaze: it takes the blue and leaves the paint's light and dark.
    glaze = ramp("7b3f1a 9a5726 b87a40", tone)
    return mix(paint, 0.35 * paint * np.array([1.6, 0.75, 0.35]) + 0.72 * glaze, tint)
