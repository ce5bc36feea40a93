"""River gravel: pebbles that lie on each other."""

from __future__ import annotations

import numpy as np

from btfcore.btf.pbr import PbrSet
from btfcore.types import F8
from resources.recipes.canvas import Canvas
from resources.recipes.cells import cells, scatter
from resources.recipes.colours import colour, palette, shade
from resources.recipes.noise import hollow, mix, noise, step

STONES = (
    "8c8880 77746e 9d978b a79a84 64625f b5a88f 8f7f6b 9a8466 d8d0c0 4e4d4c 7a6a5c a5785a"
    " 858a88 6d7472"
)
RELIEF = 0.48
SIZES = ((13.0, 6.4), (9.0, 4.3), (6.0, 2.7), (3.6, 1.6))  # spacing, mean half length


def gravel(canvas: Canvas) -> PbrSet:
    """Rounded pebbles of many rocks."""
    rng = canvas.rng("pebbles")
    soil = noise(canvas, "soil", 6, 0.6, slope=0.9)
    height = 0.25 * soil
    stone = np.full(height.shape, -1)
    rise = np.zeros(height.shape)
    count = 0
    for spacing, half in SIZES[::-1] + SIZES[1:2] + SIZES[2:3]:
        points = scatter(canvas, f"pebbles {spacing} {count}", spacing, 1.0)
        for place in rng.permutation(points):
            if rng.random() < 0.22:
                continue
            count += 1
            _lay(canvas, rng, place, half, (height, rise, stone), count)
    count += 1
    return _dress(canvas, rng, height, stone, rise, count)


def _lay(
    canvas: Canvas,
    rng: np.random.Generator,
    place: F8,
    half: float,
    sheets: tuple[F8, F8, np.ndarray],
    number: int,
) -> None:
    """Drop a pebble onto what lies there already."""
    height, rise, stone = sheets
    long = half * rng.uniform(0.75, 1.3)
    short = long * rng.uniform(0.6, 0.95)
    thick = short * rng.uniform(0.5, 0.8)
    turn = rng.uniform(0, np.pi)
    power = rng.uniform(2.0, 2.7)
    reach = int(np.ceil(long * 1.15 * canvas.fine)) + 1
    middle = np.round(place * canvas.fine).astype(np.int64)
    line = np.arange(-reach, reach + 1)
    y, x = np.meshgrid(line / canvas.fine, line / canvas.fine, indexing="ij")
    u, v = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    # Three dents make an outline that no ellipse has.
    angle = np.arctan2(v / short, u / long)
    bulge = sum(
        rng.normal(0, 0.035) * np.cos(k * angle + rng.uniform(0, 2 * np.pi)) for k in (2, 3, 5)
    )
    far = (np.abs(u / long) ** power + np.abs(v / short) ** power) ** (1 / power) * (1 + bulge)
    lean = rng.normal(0, 0.14, 2)
    body = np.sqrt(np.clip(1 - far**2, 0, None)) ** 0.85 * thick + lean[0] * y + lean[1] * x
    rows = (middle[0] + line) % canvas.side
    columns = (middle[1] + line) % canvas.side
    window = np.ix_(rows, columns)
    inside = far < 1
    bed = float(np.quantile(height[window][inside], 0.55))
    top = bed - 0.25 * thick + body
    wins = inside & (top > height[window])
    for sheet, value in ((height, top), (rise, 1 - far), (stone, np.full(far.shape, number))):
        part = sheet[window]
        part[wins] = value[wins]
        sheet[window] = part


def _dress(
    canvas: Canvas, rng: np.random.Generator, height: F8, stone: np.ndarray, rise: F8, count: int
) -> PbrSet:
    tones = palette(STONES)
    weights = np.array([3, 3, 3, 3, 2, 2, 2, 2, 1, 1.5, 2, 1, 2, 2.0])
    kind = rng.choice(len(tones), count + 1, p=weights / weights.sum())
    base = tones[kind] * rng.normal(1, 0.12, (count + 1, 1))
    sand = noise(canvas, "sand", 2.0, 0.5, slope=0.3)
    shift = rng.integers(0, canvas.side, (count + 1, 2))[stone]
    rows, columns = np.indices(height.shape)
    rows = (rows + shift[..., 0]) % canvas.side
    columns = (columns + shift[..., 1]) % canvas.side
    vein = noise(canvas, "vein", 14, 1.0, slope=1.2, stretch=(0.6, 1.8))[rows, columns]
    grains = cells(canvas, scatter(canvas, "grains", 1.4, 1.0))
    speck = rng.random(len(grains.points))[grains.number][rows, columns]
    grainy = (rng.random(count + 1) < 0.4)[stone]
    veined = (rng.random(count + 1) < 0.22)[stone]
    albedo = base[stone]
    albedo = shade(albedo, 1 + 0.09 * vein + 0.05 * sand)
    albedo = mix(albedo, albedo * 0.45, grainy * (speck < 0.16) * 0.7)
    albedo = mix(albedo, colour("dcd6c9"), grainy * (speck > 0.86) * 0.5)
    albedo = mix(albedo, colour("e3ddd0"), veined * step(0.14, 0.04, np.abs(vein - 0.3)) * 0.75)
    # Fine dust lies on the flanks; crests are rubbed clean.
    dusty = step(0.5, 0.05, rise) * 0.35
    albedo = mix(albedo, colour("9d8f78"), dusty)
    ground = mix(colour("4d4234"), colour("7b6b54"), step(-1.2, 1.4, sand))
    bare = stone < 0
    albedo = np.where(bare[..., None], ground, albedo)
    deep = step(0.4, 3.5, hollow(canvas, height, 2.6)) * 0.7
    albedo = mix(albedo, albedo * np.array([0.32, 0.29, 0.26]), deep)
    rough_of = rng.uniform(0.55, 0.85, count + 1)[stone]
    roughness = np.where(bare, 0.95, rough_of)
    height = RELIEF * height + np.where(bare, 0.2, 0.03) * sand + np.where(bare, 0, 0.05 * vein)
    return canvas.finish(
        "gravel", albedo=albedo, height=height, roughness=roughness, texel_size=1.2
    )
