"""The varnished board, scratched."""

from __future__ import annotations

import numpy as np

from btfcore.btf.pbr import PbrSet
from btfcore.types import F8
from resources.recipes.canvas import Canvas
from resources.recipes.cells import distance, grown
from resources.recipes.colours import colour, shade
from resources.recipes.noise import blur, mix, noise, step
from resources.recipes.paths import stroke
from resources.recipes.tubes import draw
from resources.recipes.wood import board

HEADING = 0.62  # radians from the grain


def scratched_varnish(canvas: Canvas) -> PbrSet:
    """Oak whose varnish was scratched through, with hairlines about the deep ones."""
    sound = board(canvas)
    deep = _gouges(canvas)
    fine = _hairlines(canvas)
    torn = noise(canvas, "torn", 3, 0.6, slope=0.8, stretch=(0.7, 2.5))
    cut = step(0.0, 0.42, deep + 0.12 * torn * (deep > 0))
    near = distance(canvas, deep > 0.05, 5.0)
    # Varnish splinters beside a deep scratch and turns white where it came loose.
    splinter = np.exp(-near / 0.75) * step(-0.3, 0.8, noise(canvas, "splinter", 4.5, 0.8) + torn)
    splinter = splinter * (1 - cut)
    burr = np.exp(-near / 0.45) * (1 - cut)
    height = sound.height - 0.62 * deep * (1 + 0.25 * torn) - 0.14 * fine
    height = height + 0.16 * burr - 0.1 * splinter
    raw = shade(colour("d9b483") * np.ones((*deep.shape, 1)), 1 + 0.09 * torn - 0.3 * sound.late)
    raw = mix(raw, colour("5a3a22"), 0.45 * step(0.75, 1.2, deep))
    albedo = mix(sound.albedo, raw, 0.92 * cut)
    albedo = mix(albedo, colour("e6d9c0"), 0.62 * splinter)
    albedo = mix(albedo, colour("d9c29c"), 0.4 * step(0.05, 0.3, fine))
    rough = sound.roughness + 0.28 * step(0.02, 0.3, fine) + 0.4 * splinter
    rough = mix(rough, np.full(deep.shape, 0.82), cut)
    feature = np.maximum(cut, step(0.012, 0.04, blur(canvas, fine, 0.8)))
    return canvas.finish(
        "scratched-varnish",
        albedo=albedo,
        height=height,
        roughness=np.clip(rough, 0, 1),
        mask=grown(canvas, feature, by=4.0, soft=4.0),
        texel_size=0.5,
    )


def _swept(canvas: Canvas, paths: list[F8], radius: list[F8]) -> F8:
    """Depth profile of strokes (texels), 0 outside."""
    places = np.concatenate(paths)
    places = np.concatenate([places, np.zeros((len(places), 1))], 1)
    drawn = draw(canvas, places, np.concatenate(radius), 0.0)
    return np.maximum(drawn.height, 0.0)


def _gouges(canvas: Canvas) -> F8:
    rng = canvas.rng("gouges")
    spacing = 0.35 / canvas.fine
    paths, radius = [], []
    for across, along, length, wide in (
        (-13, -6, 92, 0.95),
        (-8, 10, 66, 0.6),
        (3, -4, 100, 1.3),
        (9, 8, 78, 0.75),
        (19, -2, 56, 0.9),
    ):
        heading = HEADING + rng.normal(0, 0.05)
        ahead = np.array([-np.sin(HEADING), np.cos(HEADING)])
        aside = np.array([np.cos(HEADING), np.sin(HEADING)])
        middle = canvas.size / 2 + along * ahead + across * aside
        path = stroke(rng, middle, heading, length, rng.normal(0, 0.16), spacing)
        share = np.linspace(0, 1, len(path))
        press = np.sin(np.pi * share**0.75) ** 0.6
        chatter = np.interp(share * 60, np.arange(61), rng.normal(1, 0.13, 61))
        skip = np.interp(share * 14, np.arange(15), rng.random(15)) > 0.14
        paths.append(path)
        radius.append(np.maximum(wide * press * chatter * skip, 0.12))
    return _swept(canvas, paths, radius)


def _hairlines(canvas: Canvas) -> F8:
    rng = canvas.rng("hairlines")
    spacing = 0.5 / canvas.fine
    paths, radius = [], []
    for _ in range(95):
        middle = canvas.size / 2 + np.clip(rng.normal(0, 0.095, 2), -0.2, 0.2) * canvas.size
        crossing = rng.random() < 0.22
        heading = (HEADING + 1.1 if crossing else HEADING) + rng.normal(0, 0.16)
        length = rng.uniform(10, 48)
        path = stroke(rng, middle, heading, length, rng.normal(0, 0.25), spacing)
        share = np.linspace(0, 1, len(path))
        paths.append(path)
        radius.append(rng.uniform(0.14, 0.34) * np.sin(np.pi * share) ** 0.5 + 0.05)
    return _swept(canvas, paths, radius)
