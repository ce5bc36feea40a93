"""Spherical harmonics and PCA: error and time over orders, kinds, layouts, ways to integrate, K."""

from __future__ import annotations

import time
from dataclasses import astuple, dataclass, fields
from typing import Any

import numpy as np

from btfcore.btf.bake.build import bake
from btfcore.btf.directions import Layout, layout, rings
from btfcore.btf.harmonics.conditioning import conditioning
from btfcore.btf.harmonics.evaluate import HarmonicStack
from btfcore.btf.harmonics.fit import fit_harmonics
from btfcore.btf.harmonics.values import HarmonicFactors
from btfcore.btf.readers.pbr_files import read_pbr
from btfcore.btf.readers.ptm import read_ptm
from btfcore.btf.sample import BtfSample, cropped, subset
from tests.bench.inputs import FOLDERS, find
from tests.bench.table import machine, markdown, publish
from tests.btf.harmonics.scenes import bumpy, carpet

LAYOUTS = ("12x5x12x5", "12x8x12x8", "ubo81", "ubo151")
ORDERS = (2, 3, 4, 5, 6)
KINDS = ("spherical", "hemispherical")
MATERIAL = "pbr_Bricks102"
HELD_OUT = rings([(20, 8, 7), (40, 8, 22), (60, 8, 13)])  # lights of no layout
NOTE = """*condition*: of the matrix of function values under the lights; where it is over 1e4
the fit is refused unless asked to regularise, as it was here. *truncation*: relative L2 error
of the series, *total*: with PCA too (K = 16), of linear radiance; *sRGB*: mean of the images'
RMSE, *worst*: the worst image's; *unseen*: relative L2 error under 24 lights that were not
fitted. Seconds are CPU seconds of one fit, the measuring of its errors included."""


@dataclass(frozen=True)
class Row:
    """One fit."""

    sample: str
    fit: str
    condition: float
    truncation: float
    total: float
    srgb: float
    worst: float
    unseen: str
    cpu_s: float


@dataclass(frozen=True)
class Scene:
    """A sample under the lights of a layout, and under lights to be predicted."""

    name: str
    fitted: BtfSample
    unseen: BtfSample | None = None


def scene(name: str, *, size: int, every: int) -> Scene:
    """Bricks, or bumps where those are not here, seen from every so many views of a layout."""
    chosen = layout(name)
    lights = np.concatenate([chosen.lights, HELD_OUT])
    views = chosen.views[::every].copy()
    folder = find(MATERIAL)
    if folder is None:
        whole = bumpy(Layout(name, views, lights), size)
    else:
        whole = bake(read_pbr(folder, size=size), views, lights)
    seen, count = np.arange(len(views)), len(chosen.lights)
    return Scene(
        name,
        subset(whole, seen, np.arange(count)),
        subset(whole, seen, np.arange(count, len(lights))),
    )


def fitted(of: Scene, label: str, **knobs: Any) -> Row:
    """Fit once, and say how well and how fast."""
    start = time.process_time()
    found = fit_harmonics(of.fitted, singular="regularise", **knobs)
    seconds = time.process_time() - start
    errors = found.errors
    assert errors is not None
    return Row(
        sample=of.name,
        fit=label,
        condition=conditioning(of.fitted.lights, found.order, found.kind).condition,
        truncation=errors.truncation,
        total=errors.total,
        srgb=errors.srgb,
        worst=errors.srgb_worst,
        unseen="" if of.unseen is None else f"{predicted(found, of.unseen):.3g}",
        cpu_s=seconds,
    )


def predicted(found: HarmonicFactors, truth: BtfSample) -> float:
    """Relative L2 error of the factors under the lights of `truth`."""
    stack = HarmonicStack(found, truth.lights, truth.pairs())
    wrong = whole = 0.0
    for numbers in np.array_split(np.arange(truth.images), max(1, truth.images // 64)):
        images = truth.stack.read(numbers).astype(np.float64)
        wrong += float(((stack.read(numbers) - images) ** 2).sum())
        whole += float((images**2).sum())
    return float(np.sqrt(wrong / whole))


def orders(scenes: list[Scene], chosen: tuple[int, ...]) -> list[Row]:
    """Every order of both kinds."""
    return [
        fitted(of, f"{kind} {order}", order=order, kind=kind)
        for of in scenes
        for kind in KINDS
        for order in chosen
    ]


def ways(of: Scene, sides: tuple[int, ...]) -> list[Row]:
    """Least squares against the paper's cube map, and the ridge."""
    rows = [
        fitted(of, f"least squares, ridge {ridge:g}", ridge=ridge) for ridge in (0, 1e-5, 1e-3, 0.1)
    ]
    rows.append(fitted(of, "least squares by solid angle", weighting="solid_angle"))
    for below in ("black", "mirrored"):
        for side in sides:
            knobs = {"quadrature": "cubemap", "side": side, "below": below}
            rows.append(fitted(of, f"cube map {side}, {below} below", **knobs))
    knobs = {"quadrature": "cubemap", "kind": "hemispherical", "side": sides[-1]}
    rows.append(fitted(of, f"cube map {sides[-1]}, hemispherical", **knobs))
    return rows


def components(of: Scene, counts: tuple[int, ...]) -> list[Row]:
    """Numbers of components in both metrics, and the paper's few vectors."""
    rows = [
        fitted(of, f"K = {count}, {metric}", components=count, metric=metric)
        for metric in ("radiance", "coefficients")
        for count in counts
    ]
    rows += [
        fitted(of, f"K = 16, from {count} vectors", samples=count) for count in (100, 1000, 10000)
    ]
    rows.append(fitted(of, "K = 16, no mean", centred=False))
    rows.append(fitted(of, "K = 16, half weights", half=True))
    return rows


def measured(quick: bool) -> list[Scene]:
    """The carpet's mean colours and a crop of the leaf, where they are here."""
    data = FOLDERS[1]
    out = []
    if (data / "btf" / "sparsebtf_carpet07").is_dir():
        out.append(Scene("carpet07", carpet(data, np.arange(0, 151, 15 if quick else 1))))
    leaf = data / "btf" / "rti_leaf_lrgb_ptm_512"
    if leaf.is_dir() and not quick:
        whole = read_ptm(leaf, lights=layout("ubo151").lights, colour="linear")
        out.append(Scene("leaf", cropped(whole, slice(128, 384), slice(128, 384))))
    return out


def main(*, write: bool = False, quick: bool = False) -> None:
    """Print the tables; `quick` keeps to small pictures, few views and few fits."""
    fit_harmonics(bumpy(layout("2x2x4x2"), 4), order=1)  # compiles the kernels
    size, every = (24, 24) if quick else (64, 6)
    names = LAYOUTS[1:2] if quick else LAYOUTS
    scenes = [scene(name, size=size, every=every) for name in names]
    middle = scenes[0] if quick else scenes[1]
    tables = [
        ("Orders", orders(scenes, (2, 4, 6) if quick else ORDERS)),
        ("Ways to find coefficients (order 4)", ways(middle, (16,) if quick else (8, 16, 32, 64))),
        ("Components (order 4)", components(middle, (4, 16) if quick else (4, 8, 16, 32, 64))),
        ("Measured light", orders(measured(quick), (2, 4, 6) if quick else ORDERS)),
    ]
    columns = [field.name.replace("_s", " s").replace("srgb", "sRGB") for field in fields(Row)]
    absent = "" if find(MATERIAL) else f"{MATERIAL} is not here; bumps from a formula stand in."
    material = f"Baked from {MATERIAL}, {size} × {size} texels, every {every}th view of a layout."
    parts = ["## Spherical harmonics and PCA", machine(), absent or material]
    for title, rows in tables:
        if rows:
            parts.append(f"**{title}**\n\n" + markdown(columns, [astuple(row) for row in rows]))
    parts.append(NOTE)
    publish("harmonics", "\n\n".join(parts), write=write)
