"""Chunky wool stockinette, whole and with a pulled thread that left a hole."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

from btfcore.btf.pbr import PbrSet
from btfcore.types import F8
from resources.recipes.canvas import Canvas
from resources.recipes.cells import grown
from resources.recipes.colours import palette, shade
from resources.recipes.noise import blur, hollow, mix, noise, step
from resources.recipes.paths import dense
from resources.recipes.tubes import draw
from resources.recipes.yarn import Fibres, Yarn, hairs, spin

PITCH = (128 / 12, 128 / 8)  # texels a course (down) and a wale (right)
WOOL = Yarn(radius=3.7, plies=3, fibres=18, twist=0.028, spin=-0.03, fibre=0.42, loose=0.2)
SHADES = "3f6579 2f5268 4f7b8e 24455b 6b97a6 36677e 9db4b8 4d6a8c"
DEEP = -5.0
RELIEF = 0.55  # knits are seen stretched a little flat

Bend = Callable[[F8, F8, F8, F8, int], tuple[F8, F8, F8]]


def course(canvas: Canvas, number: int, bend: Bend) -> tuple[F8, F8]:
    """Path (m, 3) of one course of loops across the canvas, and its period (3,)."""
    high, wide = PITCH
    loops = round(canvas.size / wide)
    rng = canvas.rng(f"course {number}")
    points = int(loops * wide * 3.1 * canvas.fine * 2)
    t = np.arange(points) / points * loops * 2 * np.pi
    size = _smooth(rng, loops, t, 0.05)
    shift = _smooth(rng, loops, t, 0.35)
    column = wide * (t / (2 * np.pi) + 0.27 * np.sin(2 * t)) + _smooth(rng, loops, t, 0.3)
    row = (number + 0.5) * high + 0.6 * shift - 0.92 * high * np.cos(t) * (1 + size)
    level = -2.6 * np.cos(2 * t) + _smooth(rng, loops, t, 0.25)
    row, column, level = bend(row, column, level, t, number)
    return np.stack([row, column, level], 1), np.array([0.0, canvas.size, 0.0])


def _smooth(rng: np.random.Generator, loops: int, t: F8, size: float) -> F8:
    knots = rng.normal(0, size, 2 * loops)
    at = t / np.pi
    low = at.astype(np.int64)
    part = at - low
    part = part * part * (3 - 2 * part)
    return knots[low % (2 * loops)] * (1 - part) + knots[(low + 1) % (2 * loops)] * part


def flat(row: F8, column: F8, level: F8, t: F8, number: int) -> tuple[F8, F8, F8]:
    """Leave a course as it is."""
    return row, column, level


def dress(canvas: Canvas, name: str, wool: Fibres, mask: F8 | None = None) -> PbrSet:
    """Draw fibres and colour them."""
    rng = canvas.rng("colour")
    drawn = draw(canvas, wool.places, wool.radius, DEEP)
    # Wool is no hard surface: light softens what single fibres would show.
    height = 0.35 * drawn.height + 0.65 * blur(canvas, drawn.height, 0.55)
    tones = palette(SHADES)
    fibre = wool.fibre[drawn.number]
    which = rng.integers(0, len(tones), int(wool.fibre.max()) + 1)
    bright = rng.normal(1.0, 0.1, int(wool.fibre.max()) + 1)
    albedo = shade(tones[which[fibre]], bright[fibre])
    # Light that enters wool comes out of its flanks: hollows are dark, but never grey.
    deep = step(0.2, 4.5, hollow(canvas, height, 2.2)) * 0.75
    deep = np.maximum(deep, step(-1.0, -5.5, height) * 0.9)
    warm = albedo**1.25 * np.array([0.34, 0.27, 0.2])
    albedo = mix(albedo, warm, deep)
    albedo = mix(albedo, palette("0d0a08")[0], np.where(drawn.covered, 0.0, 1.0))
    tint = noise(canvas, "dye", 40, 6, slope=1)
    albedo = shade(albedo, 1 + 0.035 * tint)
    rough = np.full(height.shape, 0.92)
    return canvas.finish(
        name,
        albedo=albedo,
        height=RELIEF * height,
        roughness=rough,
        mask=mask,
        texel_size=0.45,
    )


def fuzz(canvas: Canvas, wool: Fibres, count: float) -> Fibres:
    """Hairs rooted on the upper fibres, `count` a texel."""
    rng = canvas.rng("fuzz roots")
    upper = np.flatnonzero((wool.depth > 0.85) & (wool.places[:, 2] > 0.5))
    roots = wool.places[rng.choice(upper, int(count * canvas.size**2))]
    return hairs(canvas, "fuzz", roots, length=4.5, radius=0.13, lift=1.6)


def wool_knit(canvas: Canvas) -> PbrSet:
    """Stockinette of three-ply oatmeal wool."""
    rows = round(canvas.size / PITCH[0])
    strands = []
    for number in range(rows):
        path, closed = course(canvas, number, flat)
        strands.append(spin(canvas, f"yarn {number}", path, WOOL, closed=closed))
    wool = Fibres.joined(strands)
    wool = Fibres.joined([wool, fuzz(canvas, wool, 0.05)])
    return dress(canvas, "knit", wool)


HOLE = 0.5  # place of the hole, as a share of the sample's edge
REACH = 17.0  # texels from its middle to where the broken yarn still holds


def pulled_knit(canvas: Canvas) -> PbrSet:
    """Stockinette whose yarn broke: a hole, slack loops about it, two loose ends."""
    rows = round(canvas.size / PITCH[0])
    broken = rows // 2
    middle = np.array([(broken + 0.5) * PITCH[0], HOLE * canvas.size])

    def bend(row: F8, column: F8, level: F8, t: F8, number: int) -> tuple[F8, F8, F8]:
        return _slacken(canvas, middle, broken, (row, column, level), t, number)

    strands = []
    for number in range(rows):
        path, closed = course(canvas, number, bend)
        strand = spin(canvas, f"yarn {number}", path, WOOL, closed=closed)
        if number == broken:
            gone = np.abs(strand.places[:, 1] - middle[1]) < REACH
            strand = Fibres(*(part[~gone] for part in _parts(strand)))
        strands.append(strand)
    strands += _ends(canvas, middle)
    wool = Fibres.joined(strands)
    wool = Fibres.joined([wool, fuzz(canvas, wool, 0.05)])
    return dress(canvas, "pulled-knit", wool, _damage(canvas, middle, strands[-2:]))


def _parts(strand: Fibres) -> tuple[F8, F8, np.ndarray, F8]:
    return strand.places, strand.radius, strand.fibre, strand.depth


def _slacken(
    canvas: Canvas, middle: F8, broken: int, path: tuple[F8, F8, F8], t: F8, number: int
) -> tuple[F8, F8, F8]:
    """Part the courses about the hole; tighten the loops of the broken one beside it."""
    row, column, level = path
    aside = column - middle[1]
    near = np.exp(-((aside / 19.0) ** 2))
    if number == broken:
        # Where the yarn was dragged its loops shrank.
        tight = np.exp(-((np.maximum(np.abs(aside) - 12, 0) / 24) ** 2)) * (np.abs(aside) > 5)
        row = row + 0.45 * tight * (middle[0] - row)
        level = level - 0.6 * tight
    away = row - middle[0]
    side = -1.0 if number < broken else 1.0
    far = np.exp(-((np.abs(number - broken) - 1) / 1.5))
    push = 7.6 * side * near * np.where(number == broken, 0.0, far)
    gather = -2.2 * np.tanh(aside / 8) * np.exp(-((aside / 26) ** 2)) * np.exp(-np.abs(away) / 12)
    drag = 2.0 * np.exp(-((aside / 44) ** 2)) * np.exp(-((away / 9) ** 2)) * np.sign(-away)
    slack = near * np.where(np.abs(number - broken) == 1, 1.0, 0.0)
    rng = canvas.rng(f"slack {number}")
    loops = round(canvas.size / PITCH[1])
    return (
        row + push + drag * (number != broken) * (1 - near) + slack * _smooth(rng, loops, t, 0.9),
        column + gather * (number != broken) + slack * _smooth(rng, loops, t, 0.8),
        level + slack * 0.8,
    )


def _ends(canvas: Canvas, middle: F8) -> list[Fibres]:
    """Two loose ends of the broken yarn that lie curled on the fabric."""
    ends = []
    for name, knots in (
        (
            "left",
            [(0, -19, -2), (-1, -14, 1), (-6, -9, 4), (-14, -12, 5.8), (-20, -21, 5.9),
             (-16, -30, 5.7), (-8, -31, 5.6), (-4, -25, 6)],
        ),
        (
            "right",
            [(0, 19, -2), (1, 14, 1), (5, 8, 4), (13, 6, 5.7), (21, 11, 5.9), (27, 21, 5.8),
             (24, 31, 5.7), (17, 33, 5.6)],
        ),
    ):  # fmt: skip
        path = dense(_curve(np.array(knots, np.float64)), 0.45 / canvas.fine)
        path = path + np.append(middle, 0.0)
        share = np.linspace(0, 1, len(path))
        # The end unravels: plies part and the strand fans out.
        open_ = 1 + 0.75 * step(0.82, 1.0, share)
        ends.append(spin(canvas, name, path, WOOL, thickness=open_ * 0.92))
    return ends


def _curve(knots: F8) -> F8:
    at = np.arange(len(knots))
    return CubicSpline(at, knots)(np.linspace(0, len(knots) - 1, 60 * len(knots)))


def _damage(canvas: Canvas, middle: F8, ends: list[Fibres]) -> F8:
    """Mask: the hole with its slack loops, the tightened course and the loose ends."""
    rows, columns = canvas.grid()
    down, right = rows - middle[0], columns - middle[1]
    hole = (down / 17.0) ** 2 + (right / 28.0) ** 2 < 1
    tight = (np.abs(down) < 5.0) & (np.abs(right) < 40)
    loose = np.zeros((canvas.side, canvas.side), bool)
    for each in ends:
        at = (each.places[:, :2] * canvas.fine).astype(np.int64) % canvas.side
        loose[at[:, 0], at[:, 1]] = True
    feature = (hole | tight | loose).astype(np.float64)
    return grown(canvas, feature, by=2.5, soft=5.0)
