"""Interpolation between measured directions: time a query, and error against the truth."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass, fields
from functools import partial

import numpy as np

from btfcore.btf.bake.build import bake
from btfcore.btf.colour import linear_to_srgb
from btfcore.btf.directions import from_angles, layout, to_angles
from btfcore.btf.image import read_image
from btfcore.btf.interpolation.interpolator import DirectionInterpolator, prepare
from btfcore.btf.interpolation.pairs import pair_weights
from btfcore.btf.pbr import PbrSet
from btfcore.btf.sample import BtfSample, full_index
from btfcore.btf.stack import ArrayStack
from btfcore.errors import InvalidParameter
from btfcore.types import F4, F8
from tests.bench.inputs import find
from tests.bench.table import machine, markdown, publish

SCHEMES = ("grid", "barycentric", "nearest4", "nearest")
LAYOUTS = ("12x8x12x8", "12x5x12x5", "ubo81", "ubo151")
CARPET = "carpet07_mean_std.bin"
NOTE = """*ns*: CPU nanoseconds a query of one direction, one core; *reads*: directions a query
mixes at a renderer's nodes (squared for an image of a view and a light). Errors are over all
texels of random pairs of views and lights evenly within 75 degrees, *beyond* with the light at
75 to 88 degrees, in linear radiance (relative L2) and after sRGB coding (RMSE); *faded* the same
when clamped lights dim with the cosine (`fade`). *bumps* is known
in closed form (Lambert and GGX on waves); the others are baked with shadows and parallax.
Left out: the named directions are predicted from the rest, as views and as lights; *carpet* is
the mean brightness of each of the 22,801 images of a measured one (UBO2014 carpet07), exp of the
three coded channels' sum. No grid is left where directions are taken out at random."""


@dataclass(frozen=True)
class Speed:
    """One scheme on one layout."""

    layout: str
    scheme: str
    reads: int
    prepare_ms: float
    ns: float


@dataclass(frozen=True)
class Error:
    """One scheme on one layout of a material that can be looked at from everywhere."""

    material: str
    layout: str
    scheme: str
    rel_L2: float
    sRGB_RMSE: float
    beyond_L2: float
    faded_L2: float


@dataclass(frozen=True)
class LeftOut:
    """One scheme on what was left out of the 151 directions."""

    material: str
    left_out: str
    scheme: str
    rel_L2: float
    sRGB_RMSE: float


def scattered(count: int, seed: int, low: float = 0.0, high: float = 75.0) -> F8:
    """Directions evenly at random between two polar angles in degrees."""
    rng = np.random.default_rng(seed)
    cosine = rng.uniform(np.cos(np.radians(high)), np.cos(np.radians(low)), count)
    return from_angles(np.arccos(cosine), rng.uniform(-np.pi, np.pi, count))


def schemes(directions: F8) -> Iterator[DirectionInterpolator]:
    """Every scheme that fits."""
    for scheme in SCHEMES:
        try:
            yield prepare(directions, scheme)
        except InvalidParameter:  # no grid
            continue


def speeds(count: int) -> list[Speed]:
    """Time `count` queries in single precision, warm."""
    queries = scattered(count, 1, high=90).astype(np.float32)
    rows = []
    for name in LAYOUTS:
        directions = layout(name).views
        for warm in schemes(directions):
            warm.node_weights(queries[:10])
            start = time.process_time()
            found = prepare(directions, warm.method)
            prepared = time.process_time()
            found.node_weights(queries)
            taken = time.process_time() - prepared
            rows.append(
                Speed(
                    name, found.method, found.nodes, (prepared - start) * 1e3, taken / count * 1e9
                )
            )
    return rows


def bumps(views: F8, lights: F8, size: int) -> BtfSample:
    """Waves of Lambert and GGX (alpha 0.3) in closed form, under all pairs."""
    row, column = np.mgrid[:size, :size] * (2 * np.pi / size)
    slope = np.stack([0.5 * np.cos(column + 0.5 * np.sin(2 * row)), 0.3 * np.cos(2 * row)], axis=-1)
    normal = np.concatenate([-slope, np.ones((size, size, 1))], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    images = np.empty((len(views) * len(lights), size, size, 3), np.float32)
    tint, square = np.array([0.5, 0.3, 0.15]), 0.09
    for place, view in enumerate(views):
        half = view + lights
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        lit, seen = np.maximum(normal @ lights.T, 0), np.maximum(normal @ view, 0.05)
        peak = np.maximum(normal @ half.T, 0) ** 2 * (square - 1) + 1
        lobe = 0.04 * square / peak**2 / (4 * seen[..., None] * (lit + 0.1))
        value = lit[..., None] * (tint + lobe[..., None])
        images[place * len(lights) : (place + 1) * len(lights)] = np.moveaxis(value, 2, 0)
    stack = ArrayStack(images, sound=True)
    return BtfSample("bumps", stack, views, lights, full_index(len(views), len(lights)))


def cobbles(size: int) -> PbrSet:
    """Domes with grooves between them, half of them glossy: shadows, parallax, highlights."""
    row, column = np.mgrid[:size, :size] / size
    across, down = (2 * column + (np.floor(2 * row) % 2) / 2) % 1 - 0.5, 2 * row % 1 - 0.5
    height = np.sqrt(np.maximum(0, 1 - 4 * np.maximum(np.abs(across), np.abs(down)) ** 2))
    tint = 0.5 + 0.3 * np.stack([height, 0.7 * height, 0.4 * np.cos(9 * column)], axis=-1)
    shine = np.where((np.floor(2 * column) + np.floor(2 * row)) % 2 == 0, 0.3, 0.8)
    maps = [part.astype(np.float32) for part in (tint, height, shine)]
    return PbrSet("cobbles", maps[0], height=maps[1], roughness=maps[2], depth=size / 12)


def bricks(size: int) -> PbrSet | None:
    """A window of a photographed set, where the data folder is present."""
    paths = [find(f"pbr_Bricks102/{part}.png") for part in ("Color", "Displacement")]
    if any(path is None for path in paths):
        return None
    colour, height = (read_image(path).colour[: 8 * size, : 8 * size] for path in paths if path)

    def small(values: F4) -> F4:
        return values.reshape(size, 8, size, 8, -1).mean(axis=(1, 3)).astype(np.float32)

    relief = np.ascontiguousarray(small(height)[:, :, 0])
    return PbrSet("bricks", small(colour**2.2), height=relief, depth=size / 10, tiles=False)


def materials(size: int) -> dict[str, Callable[[F8, F8], BtfSample]]:
    """Ways to see each material under any views and lights."""
    found: dict[str, Callable[[F8, F8], BtfSample]] = {"bumps": partial(bumps, size=size)}
    for pbr in (cobbles(size), bricks(size)):
        if pbr is not None:
            found[pbr.name] = partial(bake, pbr, threads=1)
    return found


def mixed(btf: BtfSample, scheme: str, views: F8, lights: F8) -> F4:
    """Images (n, H, W, 3) of all pairs of `views` and `lights`, lights fastest."""
    every = btf.stack.read(np.arange(btf.images)).reshape(btf.images, -1)
    light = prepare(btf.lights, scheme).weights(lights)
    view = prepare(btf.views, scheme).weights(views)
    out = np.empty((len(views), len(lights), every.shape[1]), np.float32)
    for k in range(len(views)):
        one = tuple(np.repeat(part[k : k + 1], len(lights), axis=0) for part in view)
        image, weight = pair_weights(btf, (one[0], one[1]), light)
        for place in range(len(lights)):
            out[k, place] = weight[place].astype(np.float32) @ every[image[place]]
    return out.reshape(-1, *btf.shape, 3)


def misses(found: F4 | F8, truth: F4 | F8) -> tuple[float, float]:
    """Relative L2 error, and root mean square error after sRGB coding."""
    wrong = np.asarray(found, np.float64) - truth
    relative = np.sqrt((wrong**2).sum() / (np.asarray(truth, np.float64) ** 2).sum())
    coded = linear_to_srgb(found).astype(np.float64) - linear_to_srgb(truth)
    return float(relative), float(np.sqrt((coded**2).mean()))


def errors(layouts: tuple[str, ...], size: int, count: int) -> list[Error]:
    """Measure every material, layout and scheme on count x count pairs."""
    rows = []
    views, lights = scattered(count, 2), scattered(count, 3)
    low = scattered(count, 4, 75, 88)
    for material, look in materials(size).items():
        everywhere = look(views, np.vstack([lights, low]))
        truth = everywhere.stack.read(np.arange(everywhere.images))
        truth = truth.reshape(count, 2, count, *everywhere.shape, 3)
        for name in layouts:
            table = layout(name)
            btf = look(table.views, table.lights)
            for scheme in (found.method for found in schemes(table.views)):
                inside = mixed(btf, scheme, views, lights).reshape(truth[:, 0].shape)
                beyond = mixed(btf, scheme, views, low).reshape(truth[:, 1].shape)
                figures = misses(inside, truth[:, 0])
                fade = prepare(table.lights, scheme).fade(low).astype(np.float32)
                faded = beyond * fade[:, None, None, None]
                both = (misses(guess, truth[:, 1])[0] for guess in (beyond, faded))
                rows.append(Error(material, name, scheme, *figures, *both))
    return rows


def left_out() -> dict[str, list[np.ndarray]]:
    """Which of the 151 directions to leave out: several ways, some in several folds."""
    theta = np.round(np.degrees(to_angles(layout("ubo151").views)[0]), 1)
    heights = np.unique(theta)
    place = np.concatenate([np.arange(np.sum(theta == one)) for one in heights])
    fold = np.random.default_rng(5).permutation(151) % 5
    fold[(theta == 0) | (theta == 75)] = -1  # the border would be extrapolated
    return {
        "every 2nd ring": [np.isin(theta, heights[1:-1:2])],
        "every 2nd azimuth": [(place % 2 == 1)],
        "a fifth at random": [fold == k for k in range(5)],
    }


def predicted(values: F8) -> Iterator[tuple[str, str, float, float]]:
    """Errors of every way and scheme for values (151, 151, C) at all pairs."""
    directions = layout("ubo151").views
    for way, folds in left_out().items():
        for scheme in SCHEMES:
            truth, guess = [], []
            for out in folds:
                try:
                    found = prepare(directions[~out], scheme)
                except InvalidParameter:
                    continue
                index, weight = found.weights(directions)
                full = np.zeros((151, int((~out).sum())))
                np.add.at(full, (np.arange(151)[:, None], index), weight)
                rest = values[np.ix_(~out, ~out)]
                made = np.einsum("vi,ijc,lj->vlc", full, rest, full, optimize=True)
                asked = out[:, None] | out[None, :]
                truth.append(values[asked])
                guess.append(made[asked])
            if truth:
                yield way, scheme, *misses(np.concatenate(guess), np.concatenate(truth))


def leave_out(size: int) -> list[LeftOut]:
    """Leave directions out of the bumps, and of the measured carpet where it is present."""
    directions = layout("ubo151").views
    known = bumps(directions, directions, size)
    sets = {"bumps": known.stack.read(np.arange(known.images)).reshape(151, 151, -1)}
    path = find(CARPET)
    if path is not None:
        mean = np.fromfile(path, "<f8").reshape(2, 151, 151)[0]  # the light runs fastest
        sets["carpet"] = np.exp(3 * mean)[:, :, None]
    return [
        LeftOut(material, *row)
        for material, values in sets.items()
        for row in predicted(values.astype(np.float64))
    ]


def main(*, write: bool = False, quick: bool = False) -> None:
    """Print the tables; `quick` takes fewer queries, texels and one layout."""
    parts = ["## Interpolation between directions", machine()]
    tables = [
        (Speed, speeds(20_000 if quick else 1_000_000)),
        (
            Error,
            errors(("12x5x12x5",) if quick else LAYOUTS, 8 if quick else 24, 6 if quick else 24),
        ),
        (LeftOut, leave_out(4 if quick else 12)),
    ]
    for kind, rows in tables:
        columns = [field.name.replace("_", " ") for field in fields(kind)]
        parts.append(markdown(columns, [astuple(row) for row in rows]))
    absent = "" if find(CARPET) else "The measured carpet and the photographed bricks are not here."
    publish(
        "interpolation", "\n\n".join(part for part in [*parts, NOTE, absent] if part), write=write
    )
