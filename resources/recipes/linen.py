"""Natural linen in plain weave, clean and with a spilt drink's stains."""

from __future__ import annotations

import numpy as np

from btfcore.btf.pbr import PbrSet
from btfcore.types import F8
from resources.recipes.blots import blots, satellites
from resources.recipes.canvas import Canvas
from resources.recipes.colours import palette, shade
from resources.recipes.noise import blur, hollow, mix, noise, step, wobble
from resources.recipes.tubes import Drawn, draw
from resources.recipes.yarn import Fibres, Yarn, hairs, spin

PITCH = 128 / 20  # texels a thread
FLAX = Yarn(radius=2.85, flat=0.5, plies=1, fibres=30, twist=0.0, spin=0.014, fibre=0.3, loose=0.16)
SHADES = "c0b190 cbbd9c b3a17d bbaa87 d6caae a8966f"
DEEP = -2.4
RELIEF = 0.5  # threads are pressed flat in finishing


def weave(canvas: Canvas) -> tuple[Fibres, np.ndarray]:
    """Fibres of all threads, and the thread (warp first, then weft) of each fibre."""
    threads = round(canvas.size / PITCH)
    strands, owner = [], []
    for way in (0, 1):
        for number in range(threads):
            path, closed, thick = _thread(canvas, way, number)
            strand = spin(
                canvas, f"thread {way} {number}", path, FLAX, closed=closed, thickness=thick
            )
            strands.append(strand)
            owner.append(np.full(int(strand.fibre.max()) + 1, way * threads + number))
    return Fibres.joined(strands), np.concatenate(owner)


def _thread(canvas: Canvas, way: int, number: int) -> tuple[F8, F8, F8]:
    """Path (m, 3), period (3,) and thickness (m,) of a warp (0) or weft (1) thread."""
    what = f"{way} {number}"
    rng = canvas.rng("size " + what)
    points = canvas.side * 2
    along = np.arange(points) / points * canvas.size
    fine = np.arange(points) / points * canvas.side
    place = np.arange(canvas.side + 1)

    def walk(kind: str, longest: float, shortest: float) -> F8:
        line = wobble(canvas, kind + what, longest, shortest)
        return np.interp(fine, place, np.append(line, line[0]))

    # Flax is spun unevenly: now and then a thread swells into a slub.
    slub = np.maximum(walk("slub", 50, 9) - 1.1, 0.0)
    thick = rng.normal(0.98, 0.09) + 0.06 * walk("thick", 30, 4) + 0.22 * slub
    thick = np.clip(thick, 0.68, 1.5)
    across = (number + 0.5) * PITCH + rng.normal(0, 0.3) + 0.28 * walk("sway", 60, 8)
    sign = 1.0 if (way + number) % 2 else -1.0
    level = sign * 1.2 * np.cos(np.pi * (along / PITCH - 0.5)) + 0.12 * walk("rise", 20, 5)
    zero = np.zeros(points)
    path = np.stack([zero + along, across, level] if way == 0 else [across, along, level], 1)
    closed = np.array([canvas.size, 0.0, 0.0] if way == 0 else [0.0, canvas.size, 0.0])
    return path, closed, thick


def cloth(canvas: Canvas) -> tuple[Drawn, F8, F8]:
    """What is drawn, its height and its colour, unstained."""
    flax, owner = weave(canvas)
    rng = canvas.rng("fuzz roots")
    upper = np.flatnonzero((flax.depth > 0.8) & (flax.places[:, 2] > 0.8))
    roots = flax.places[rng.choice(upper, int(0.012 * canvas.size**2))]
    fuzz = hairs(canvas, "fuzz", roots, length=4.0, radius=0.12, lift=1.2)
    flax = Fibres.joined([flax, fuzz])
    drawn = draw(canvas, flax.places, flax.radius, DEEP)
    height = 0.4 * drawn.height + 0.6 * blur(canvas, drawn.height, 0.45)
    tones = palette(SHADES)
    count = int(flax.fibre.max()) + 1
    fibre = flax.fibre[drawn.number]
    lone = count - len(owner)
    thread = np.concatenate([owner, rng.integers(0, owner.max() + 1, lone)])
    which = rng.integers(0, len(tones), count)
    own = rng.normal(1.0, 0.075, owner.max() + 1)[thread] * rng.normal(1.0, 0.07, count)
    tones_of_thread = tones[rng.integers(0, len(tones), owner.max() + 1)][thread]
    colours = mix(tones_of_thread, tones[which], 0.45) * own[:, None]
    albedo = colours[fibre]
    deep = step(0.1, 2.2, hollow(canvas, height, 1.6)) * 0.6
    deep = np.maximum(deep, step(0.2, -2.6, height) * 0.85)
    albedo = mix(albedo, albedo**1.3 * np.array([0.42, 0.36, 0.28]), deep)
    albedo = mix(albedo, palette("4a3d2b")[0], np.where(drawn.covered, 0.0, 0.9))
    # Fibres lift out of some threads more than out of others: pale, dry patches.
    albedo = shade(albedo, 1 + 0.03 * noise(canvas, "dry", 20, 3, slope=1))
    return drawn, RELIEF * height, albedo


def linen(canvas: Canvas) -> PbrSet:
    """Unbleached linen with slubs."""
    _, height, albedo = cloth(canvas)
    rough = np.full(height.shape, 0.85)
    return canvas.finish("linen", albedo=albedo, height=height, roughness=rough, texel_size=0.12)


def stained_linen(canvas: Canvas) -> PbrSet:
    """Linen on which coffee was spilt: a blot with dark rims, and drops."""
    drawn, height, albedo = cloth(canvas)
    inside = _spill(canvas)
    # What is dissolved travels to the edge of the wet and stays there when it dries.
    uneven = noise(canvas, "uneven", 22, 2, slope=1.1)
    soaked = step(-0.5, 0.9, inside)
    rim = np.exp(-np.maximum(inside, 0) / 1.4) * soaked
    tide = np.exp(-(((inside - 10.5 - 1.6 * uneven) / 1.3) ** 2)) * soaked
    dose = soaked * (0.46 + 0.12 * uneven) + 1.35 * rim + 0.3 * tide
    dose += 0.1 * step(-6, 0, inside)
    # Crests of the threads take up more than their flanks.
    crest = step(-0.5, 0.8, height)
    dose = np.maximum(dose * (0.78 + 0.34 * crest), 0.0)
    stained = albedo * np.exp(-dose[..., None] * np.array([0.72, 1.12, 1.55]))
    rough = 0.85 - 0.06 * np.clip(dose, 0, 1)
    return canvas.finish(
        "stained-linen",
        albedo=stained,
        height=height - 0.1 * soaked,
        roughness=rough,
        mask=step(-4.5, 0.5, inside),
        texel_size=0.12,
    )


def _spill(canvas: Canvas) -> F8:
    """Distance inside the wet region (texels, < 0 outside), ragged along the threads."""
    down = noise(canvas, "wick down", 14, 2.0, slope=1.0, stretch=(2.6, 0.6))
    right = noise(canvas, "wick right", 14, 2.0, slope=1.0, stretch=(0.6, 2.6))
    lobes = noise(canvas, "lobes", 52, 9, slope=1.3)
    spots = [(0.45, 0.44, 0.165), (0.54, 0.57, 0.12), (0.38, 0.57, 0.06), (0.6, 0.43, 0.07)]
    spots += satellites(canvas.rng("drops"), 14, (0.24, 0.36), (0.006, 0.03))
    ragged = 3.6 * lobes + 0.9 * down + 0.9 * right
    return blots(canvas, spots, melt=3.0, ragged=ragged)
