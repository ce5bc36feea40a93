"""Hand-made bricks in lime mortar, sound and cracked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.btf.pbr import PbrSet
from btfcore.types import F8
from resources.recipes.canvas import Canvas
from resources.recipes.cells import cells, scatter
from resources.recipes.colours import colour, palette, shade
from resources.recipes.noise import hollow, mix, noise, step, warp

COURSE = 64 / 3  # texels from bed joint to bed joint
LENGTH = 64.0  # a stretcher with its joint; headers are half of it
JOINT = 2.7
CLAY = "a4533a b0603f 964833 8a4334 b86d49 7c3d33 a95a44 9d4f36"
BURNT = "5f3a36 6a4038 54373a"
LIME = "b9ab92"


@dataclass(frozen=True, eq=False)
class Wall:
    """Maps of a wall, height in texels; face: distance inside a brick's outline (texels, < 0 in
    the joints); brick: number of the nearest brick.
    """  # noqa: D205

    height: F8
    albedo: F8
    roughness: F8
    face: F8
    brick: np.ndarray


@dataclass(frozen=True)
class Brick:
    """One brick: centre, half its length and height, turn (radians), in texels."""

    row: float
    column: float
    long: float
    high: float
    turn: float


def bond(canvas: Canvas) -> list[Brick]:
    """Courses of stretchers with a header here and there, as old walls have them."""
    rng = canvas.rng("bond")
    courses = round(canvas.size / COURSE)
    beds = np.arange(courses) * COURSE + rng.normal(0, 0.35, courses)
    bricks = []
    before: list[float] = []
    first: list[float] = []
    for number in range(courses):
        top, bottom = beds[number], beds[(number + 1) % courses]
        bottom += canvas.size if number == courses - 1 else 0.0
        last = number == courses - 1
        ends = _joints(canvas, rng, before, first if last else [])
        before, first = ends, first or ends
        for left, right in zip(ends, [*ends[1:], ends[0] + canvas.size], strict=True):
            gap = JOINT * rng.uniform(0.8, 1.25, 2)
            bricks.append(
                Brick(
                    row=(top + bottom) / 2 + rng.normal(0, 0.22),
                    column=(left + right) / 2 + rng.normal(0, 0.3),
                    long=(right - left - gap[0]) / 2,
                    high=(bottom - top - gap[1]) / 2,
                    turn=rng.normal(0, 0.008),
                )
            )
    return bricks


def _joints(
    canvas: Canvas, rng: np.random.Generator, above: list[float], below: list[float]
) -> list[float]:
    """Columns of a course's joints that keep clear of the neighbours' joints."""
    halves = round(canvas.size / LENGTH * 2)
    best: tuple[float, list[float]] | None = None
    for _ in range(200):
        parts = [2] * (halves // 2) + [1] * (halves % 2)
        if rng.random() < 0.35 and parts[0] == 2:
            parts = [*parts[1:], 1, 1]
        lengths = rng.permutation(parts) * LENGTH / 2 * rng.normal(1, 0.035, len(parts))
        lengths *= canvas.size / lengths.sum()
        ends = list(np.cumsum(lengths) - lengths + rng.uniform(0, canvas.size))
        others = np.array(above + below)
        clear = np.inf
        if len(others):
            gaps = np.array(ends)[:, None] - others
            clear = float(np.abs(gaps - np.round(gaps / canvas.size) * canvas.size).min())
        if best is None or clear > best[0]:
            best = clear, ends
    assert best is not None
    return best[1]


def outline(canvas: Canvas, bricks: list[Brick]) -> tuple[F8, np.ndarray, F8, F8]:
    """Distance inside the nearest brick's worn outline, its number, and the place (down, right)
    relative to its centre, all (side, side) in texels.
    """  # noqa: D205
    rows, columns = canvas.grid()
    shape = (canvas.side, canvas.side)
    # Edges are worn unevenly: the whole outline is pushed about, finely and coarsely.
    down = 0.42 * noise(canvas, "worn rows", 14, 1.5, slope=1.3)
    right = 0.42 * noise(canvas, "worn columns", 14, 1.5, slope=1.3)
    best = np.full(shape, -np.inf)
    which = np.zeros(shape, np.int64)
    place = [np.zeros(shape), np.zeros(shape)]
    for number, each in enumerate(bricks):
        y = rows - each.row + down
        x = columns - each.column + right
        y = y - np.round(y / canvas.size) * canvas.size
        x = x - np.round(x / canvas.size) * canvas.size
        y, x = y - each.turn * x, x + each.turn * y
        round_off = 1.7
        far_y = np.abs(y) - each.high + round_off
        far_x = np.abs(x) - each.long + round_off
        outside = np.hypot(np.maximum(far_y, 0), np.maximum(far_x, 0))
        inside = round_off - outside - np.minimum(np.maximum(far_y, far_x), 0)
        near = inside > best
        best = np.where(near, inside, best)
        which = np.where(near, number, which)
        place = [np.where(near, y, place[0]), np.where(near, x, place[1])]
    return best, which, place[0], place[1]


def wall(canvas: Canvas) -> Wall:
    """Draw the sound wall."""
    bricks = bond(canvas)
    face, brick, down, right = outline(canvas, bricks)
    face = face - _chips(canvas, face)
    clay_height, clay, soot = _clay(canvas, bricks, brick, down, right, face)
    lime_height, lime = _mortar(canvas, face)
    share = step(-0.45, 0.4, face)
    height = mix(lime_height, clay_height, share)
    albedo = mix(lime, clay, share)
    # Lime smeared over the edges when the joint was struck.
    smear = step(2.6, 0.0, face + 1.3 * noise(canvas, "smear", 12, 1.5, slope=1.2)) * share
    smear = smear * step(0.1, 1.2, noise(canvas, "smear where", 40, 8, slope=1)) * 0.7
    albedo = mix(albedo, colour(LIME) * 0.85, smear)
    dirt = step(0.1, 1.6, hollow(canvas, height, 1.5)) * 0.5
    albedo = mix(albedo, albedo * np.array([0.5, 0.45, 0.41]), dirt)
    rough = mix(np.full(height.shape, 0.95), 0.86 - 0.14 * soot, share)
    return Wall(height, albedo, rough, face, brick)


def _chips(canvas: Canvas, face: F8) -> F8:
    """How much is broken off the edges, in texels."""
    lumps = cells(canvas, scatter(canvas, "chips", 7.5, 1.0))
    size = canvas.rng("chip size").uniform(-6.0, 2.6, len(lumps.points))[lumps.number]
    bite = np.maximum(size - lumps.first + 0.5 * noise(canvas, "chip rim", 5, 1), 0.0)
    return bite * step(3.4, 0.6, face)


def _clay(
    canvas: Canvas, bricks: list[Brick], brick: np.ndarray, down: F8, right: F8, face: F8
) -> tuple[F8, F8, F8]:
    rng = canvas.rng("clay")
    count = len(bricks)
    tones = palette(CLAY)[rng.permutation(np.arange(count) % len(CLAY.split()))]
    tones = tones * rng.normal(1.0, 0.09, (count, 1))
    scorched = rng.random(count) < 0.12
    tones[scorched] = palette(BURNT)[rng.integers(0, 3, int(scorched.sum()))]
    proud = rng.normal(0.0, 0.28, count)
    tilt = rng.normal(0.0, 0.012, (count, 2))
    # Sand-struck faces: folds along the brick, drag marks, burnt-out voids, coarse sand.
    shift = rng.uniform(0, canvas.size, (count, 2))[brick]
    fold = noise(canvas, "fold", 26, 2.2, slope=1.2, stretch=(0.8, 2.6))
    fold = warp(canvas, fold, shift[..., 0], shift[..., 1])
    crease = np.maximum(1 - np.abs(fold + 0.2) / 0.16, 0.0) * step(
        0.0, 1.0, noise(canvas, "creased", 22, 5)
    )
    sand = noise(canvas, "sand", 2.2, 0.7, slope=0.3)
    voids = cells(canvas, scatter(canvas, "voids", 4.2, 1.0))
    hole = rng.uniform(-1.6, 1.15, len(voids.points))[voids.number]
    pit = np.maximum(hole - voids.first * (1 + 0.25 * sand), 0.0)
    pit = np.minimum(pit, 0.6)
    edge = 1.4 * (1 - np.exp(-np.maximum(face, 0.0) / 0.75))
    height = 1.0 + edge + proud[brick] + tilt[brick, 0] * down + tilt[brick, 1] * right
    height += 0.14 * fold - 0.32 * crease + 0.055 * sand - 0.7 * pit
    albedo = tones[brick]
    # The fire reached ends and edges unevenly.
    flash = noise(canvas, "flash", 44, 7, slope=1.4)
    soot = step(0.7, 2.1, flash + 0.5 * fold)
    albedo = mix(albedo, albedo * np.array([0.58, 0.56, 0.62]), 0.75 * soot)
    pale = step(0.5, 1.9, noise(canvas, "pale", 18, 2, slope=1.1)) * 0.45
    albedo = mix(albedo, albedo * 0.55 + colour("c98a62") * 0.5, pale)
    bloom = step(0.9, 2.4, noise(canvas, "bloom", 30, 1.2, slope=1.2)) * 0.4
    albedo = mix(albedo, colour("b7a293"), bloom)
    grit = cells(canvas, scatter(canvas, "grit", 2.0, 1.0))
    speck = rng.random(len(grit.points))[grit.number]
    dot = step(0.75, 0.35, grit.first)
    albedo = mix(albedo, colour("3b2723"), dot * (speck < 0.06) * 0.6)
    albedo = mix(albedo, colour("d8b48c"), dot * (speck > 0.955) * 0.4)
    albedo = shade(albedo, 1 + 0.06 * sand + 0.05 * fold - 0.25 * crease - 0.6 * pit)
    return height, albedo, soot


def _mortar(canvas: Canvas, face: F8) -> tuple[F8, F8]:
    rng = canvas.rng("lime")
    grains = cells(canvas, scatter(canvas, "grains", 1.7, 1.0))
    size = rng.uniform(0.25, 1.0, len(grains.points))[grains.number]
    bead = np.sqrt(np.maximum(size**2 - grains.first**2, 0.0))
    uneven = noise(canvas, "joint", 16, 1.2, slope=1.3)
    height = 0.42 + 0.3 * uneven + 0.24 * bead + 0.25 * step(-1.4, 0.0, face)
    tint = noise(canvas, "lime tint", 24, 3, slope=1)
    albedo = shade(np.broadcast_to(colour(LIME), (*face.shape, 3)), 1 + 0.08 * tint)
    kinds = palette("8d7a62 d9cfba 6e6257 b08e68 a79b86")
    grain = kinds[rng.integers(0, len(kinds), len(grains.points))][grains.number]
    return height, mix(albedo, grain, step(0.05, 0.4, bead) * 0.7)


def brick(canvas: Canvas) -> PbrSet:
    """Old red bricks."""
    sound = wall(canvas)
    return canvas.finish(
        "brick",
        albedo=sound.albedo,
        height=sound.height,
        roughness=sound.roughness,
        texel_size=3.5,
    )
