"""Rendering against ground truth: a baked sample, traced anew for every surfel.

Three errors are told apart. *Factors*: factors against the images they were made from, under the
same interpolation. *Between*: images against the traced relief, which is what interpolation
between directions loses. *Both*: factors against the traced relief, what a picture shows.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields, replace

import numpy as np

from btfcore.btf.bake.build import bake, baked
from btfcore.btf.bake.relief import Relief, relief
from btfcore.btf.colour import LUMINANCE, linear_to_srgb
from btfcore.btf.directions import layout
from btfcore.btf.factor.measure import measured, spread
from btfcore.btf.factor.ssim import ssim
from btfcore.btf.factor.stack import truncated as shortened
from btfcore.btf.factor.svd import factorize
from btfcore.btf.sample import BtfSample, cropped
from btfcore.errors import InvalidParameter
from btfcore.render.evaluate import Evaluator
from btfcore.render.lights import directional
from btfcore.render.material import Material, factor_material, raw_material, truncated
from btfcore.types import F4, F8
from tests.bench.interpolation import cobbles
from tests.bench.table import markdown
from tests.bench.truth_scenes import Scene, plane, seen_straight, sphere, towards
from tests.bench.woven import woven_btf, woven_maps

SCHEMES = ("grid", "barycentric", "nearest4", "nearest")
LAYOUTS = ("12x8x12x8", "ubo81", "ubo151")
RANKS = (8, 16, 24, 32, 40)
BINS = tuple((low, low + 15) for low in range(0, 90, 15))
WINDOW = slice(40, 88)  # rows and columns of the woven sample whose raw images are held
NOTE = """Truth: radiance traced in the relief for each surfel's own view and light, at the same
texel. *factors*: factors against raw images, both interpolated; *between*: raw images against the
truth; *both*: factors against the truth. L2 relative in linear radiance, RMSE and SSIM after sRGB
coding. Plane: one surfel a texel, an eye at 3 times its edge; views and lights at random within
bins of 15 degrees of elevation, evenly many in each; L2 is ruled by a few glancing highlights, the
more so below 15 degrees, where the sample's outermost ring stands. Sphere: seen from one side under
lights at 0 to 75 degrees from the eye, *whole* at texels' middles, else between them too.

![truth, rendering, 4 times their difference: woven, 40 factors, two lights](gallery/truth.jpg)"""


@dataclass(frozen=True, eq=False)
class Subject:
    """A sample with images and factors, and the relief that it was baked from."""

    name: str
    relief: Relief
    sample: BtfSample
    corner: tuple[int, int] = (0, 0)  # of the sample's window in the relief


@dataclass(frozen=True)
class Miss:
    """How far a rendering is from what it should be."""

    L2: float
    RMSE: float
    SSIM: float


@dataclass(frozen=True, eq=False)
class Shot:
    """A scene under a light, and what is true of it."""

    scene: Scene
    light: F8
    truth: F4
    view_bin: int = 0
    light_bin: int = 0


# --- what is rendered


def cobbled(
    size: int, directions: str, *, rank: int = 40, code: str = "auto", bent: bool = True
) -> Subject:
    """Domes with grooves (size, size), baked and factorised here; `bent`: with a knee."""
    pbr, wanted = cobbles(size), layout(directions)
    sample = bake(pbr, wanted.views, wanted.lights, threads=1)
    factors = factorize(sample, rank=rank, encoding=code, knee="auto" if bent else None)
    return Subject(pbr.name, relief(pbr), replace(sample, factors=factors))


def weave() -> Subject:
    """A window of the woven sample: K = 40 factors of all of it, and raw images to compare."""
    factored, maps = woven_btf(), woven_maps()
    images = baked(maps, factored.views, factored.lights)
    one = cropped(replace(images, factors=factored.factors), WINDOW, WINDOW)
    return Subject("woven", relief(maps), one, (WINDOW.start, WINDOW.start))


# --- errors


def plane_shots(subject: Subject, each: int, seed: int = 1) -> list[Shot]:
    """`each` random views and lights in every pair of bins of elevation, with their truth."""
    rng = np.random.default_rng(seed)
    shots = []
    for view, (view_low, view_high) in enumerate(BINS):
        for lamp, (light_low, light_high) in enumerate(BINS):
            for _ in range(each):
                scene = plane(
                    subject.sample.shape, rng.uniform(view_low, view_high), rng.uniform(0, 360)
                )
                light = towards(rng.uniform(light_low, light_high), rng.uniform(0, 360))
                truth = scene.truth(subject.relief, light, subject.corner)
                shots.append(Shot(scene, light, truth, view, lamp))
    return shots


def sphere_shots(subject: Subject, size: int, *, whole: bool) -> list[Shot]:
    """The sample round a sphere, under lights from beside the eye to the side."""
    scene = sphere(size, size / 3, whole=whole)
    lights = [towards(90 - away, 35 + 70 * k) for k, away in enumerate((0, 25, 50, 75))]
    return [Shot(scene, one, scene.truth(subject.relief, one)) for one in lights]


def render(shots: list[Shot], material: Material) -> list[F4]:
    """Radiance of every shot, by the compiled backend."""
    evaluator = Evaluator([material])
    return [
        evaluator.radiance(shot.scene.surfels, shot.scene.eye, directional(shot.light))
        for shot in shots
    ]


def miss(found: list[F4], wanted: list[F4], shots: list[Shot]) -> Miss:
    """Errors over all shots together; SSIM is their mean."""
    wrong = square = coded = 0.0
    texels = 0
    similar = []
    for one, two, shot in zip(found, wanted, shots, strict=True):
        wrong += float(((one.astype(np.float64) - two) ** 2).sum())
        square += float((two.astype(np.float64) ** 2).sum())
        pair = [linear_to_srgb(shot.scene.picture(part)) for part in (one, two)]
        coded += float(((pair[0].astype(np.float64) - pair[1]) ** 2).sum())
        texels += one.size
        grey = [np.einsum("ijc,c->ij", part, LUMINANCE).astype(np.float32) for part in pair]
        similar.append(ssim(grey[0], grey[1]))
    return Miss(np.sqrt(wrong / square), np.sqrt(coded / texels), float(np.mean(similar)))


def part(values: list, chosen: list[int]) -> list:
    """Some of a list."""
    return [values[k] for k in chosen]


def on_grid(subject: Subject, ranks: tuple[int, ...], count: int = 40) -> list[tuple]:
    """Rendering of the sample's own directions against its images, and the factors' own error."""
    sample = subject.sample
    assert sample.factors is not None
    full, pairs = factor_material(sample), sample.pairs()[spread(sample.images, count)]
    wanted = [sample.image(view, light).reshape(-1, 3) for view, light in pairs]
    rows = []
    for rank in ranks:
        material = truncated(full, rank)
        shots = [
            Shot(seen_straight(sample.shape, sample.views[view]), sample.lights[light], image)
            for (view, light), image in zip(pairs, wanted, strict=True)
        ]
        found = miss(render(shots, material), wanted, shots)
        few = sample.factors if rank == full.rank else shortened(sample.factors, rank)
        sums, similar = measured(sample, few, spread(sample.images, count))
        own = np.sqrt(sums[:, 1].sum() / sums[:, 0].sum())
        rows.append((subject.name, rank, found.L2, float(own), found.SSIM, float(similar.mean())))
    return rows


def by_elevation(subject: Subject, each: int) -> list[tuple]:
    """Errors of raw images and of factors in bins of elevation of light, and of view."""
    shots = plane_shots(subject, each)
    raw = render(shots, raw_material(subject.sample))
    own = render(shots, factor_material(subject.sample))
    truth = [shot.truth for shot in shots]
    groups: list[tuple[str, str, list[int]]] = []
    for of, which in (("light", "light_bin"), ("view", "view_bin")):
        for number, (low, high) in enumerate(BINS):
            inside = [k for k, shot in enumerate(shots) if getattr(shot, which) == number]
            groups.append((of, f"{low}–{high}", inside))
    covered = [k for k, shot in enumerate(shots) if shot.view_bin and shot.light_bin]
    groups += [("each", "15–90", covered), ("each", "0–90", list(range(len(shots))))]
    rows = []
    for of, degrees, inside in groups:
        mine = part(shots, inside)
        own_, raw_, true = (part(values, inside) for values in (own, raw, truth))
        factors, between, both = (
            miss(one, two, mine) for one, two in ((own_, raw_), (raw_, true), (own_, true))
        )
        rows.append(
            (subject.name, of, degrees, factors.L2, between.L2, *astuple(both), between.SSIM)
        )
    return rows


def by_way(subject: Subject, directions: str, each: int, ranks: tuple[int, ...]) -> list[tuple]:
    """Errors of every interpolation that fits at the most factors, and of fewer at the best."""
    shots = [one for one in plane_shots(subject, each, seed=2) if one.view_bin and one.light_bin]
    truth = [shot.truth for shot in shots]
    rows = []
    for scheme in (*SCHEMES, "auto"):
        try:
            full = factor_material(subject.sample, method=scheme)
        except InvalidParameter:  # no grid
            continue
        raw = render(shots, raw_material(subject.sample, method=scheme))
        between = miss(raw, truth, shots)
        for rank in ranks if scheme == "auto" else (full.rank,):
            if scheme == "auto" and rank == full.rank:
                continue
            own = render(shots, truncated(full, rank))
            factors, both = miss(own, raw, shots), miss(own, truth, shots)
            rows.append(
                (subject.name, directions, full.views.method, rank, factors.L2, between.L2,
                 *astuple(both))
            )  # fmt: skip
    return rows


# --- tables


def by_light(subject: Subject, size: int) -> list[tuple]:
    """Errors of factors on a sphere, light by light, at texels' middles and between them."""
    material = factor_material(subject.sample)
    rows = []
    for middle in (True, False):
        shots = sphere_shots(subject, size, whole=middle)
        found = render(shots, material)
        for away, one, shot in zip((0, 25, 50, 75), found, shots, strict=True):
            both = miss([one], [shot.truth], [shot])
            rows.append((subject.name, "whole" if middle else "any", away, *astuple(both)))
    return rows


def tables(*, quick: bool) -> str:
    """All tables of truth, as Markdown."""
    from tests.bench.truth_blend import CODES, blend_table  # it needs what is above

    size, layouts, each = (16, ("6x3x6x3",), 1) if quick else (32, LAYOUTS, 12)
    rank = 20 if quick else 40
    ranks = tuple(value for value in RANKS if value <= rank)
    errors = [field.name for field in fields(Miss)]
    first = cobbled(size, layouts[0], rank=rank)
    shown = [first] if quick else [weave(), first]
    parts = ["### Against ground truth"]
    rows = [row for one in shown for row in on_grid(one, tuple(sorted({*ranks, rank})))]
    columns = ["on the grid", "factors", "rendered L2", "factors' L2"]
    parts.append(markdown([*columns, "rendered SSIM", "factors' SSIM"], rows))
    rows = [row for one in shown for row in by_elevation(one, each)]
    columns = ["sample", "elevation of", "degrees", "factors L2", "between L2"]
    parts.append(markdown([*columns, *(f"both {name}" for name in errors), "between SSIM"], rows))
    rows = []
    for name in layouts:
        one = first if name == layouts[0] else cobbled(size, name, rank=rank)
        rows += by_way(one, name, each, ranks)
    columns = ["sample", "directions", "interpolation", "factors", "factors L2", "between L2"]
    parts.append(markdown([*columns, *(f"both {name}" for name in errors)], rows))
    blended = [cobbled(size, layouts[0], rank=rank, code=code, bent=bent) for code, bent in CODES]
    parts.append(blend_table(blended if quick else [shown[0], *blended], max(1, each // 2)))
    full = first if quick else Subject("woven", relief(woven_maps()), woven_btf())
    columns = ["sphere of", "texels", "light off the eye", *errors]
    parts.append(markdown(columns, by_light(full, 64 if quick else 200)))
    return "\n\n".join([*parts, NOTE])
