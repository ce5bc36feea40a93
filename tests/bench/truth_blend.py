"""What should be blended between directions: codes of radiance, or radiance itself?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from btfcore.btf.factor.encoding import decode, encode
from btfcore.btf.factor.stack import FactorStack
from btfcore.btf.sample import Encoding
from btfcore.render.material import RawMaterial, factor_material, raw_material
from btfcore.render.reference import light_gain, local_lights, local_views
from btfcore.types import F4, F8
from tests.bench.table import markdown
from tests.bench.truth import Subject, miss, plane_shots, render
from tests.bench.truth_scenes import Scene

CODES = (
    ("linear", False), ("linear", True), ("sqrt", False), ("sqrt", True), ("log", True),
    ("logluma", True),
)  # fmt: skip
HEAD = """Blended between directions as codes, then decoded, and as radiance; against the truth,
views and lights at 15–90 degrees. *images*: all that was baked; *factors*: their first ones.
A knee compresses what is brighter, so that with it even linear values are a code."""


def exactly(raw: RawMaterial, scene: Scene, light: F8, code: Encoding | None) -> F4:
    """Radiance (n, 3) of surfels at whole texels from images that hold `code`s, or radiance."""
    every = np.arange(len(scene.surfels))
    local = local_lights(scene.surfels, every, light)
    views = raw.views.node_weights(local_views(scene.surfels, every, scene.eye))
    lights = raw.lights.node_weights(local)
    column, row = np.rint(scene.surfels.source).astype(np.int64).T
    height, width = raw.shape
    out = np.zeros((len(every), 3))
    for a, alpha in zip(views[0].T, views[1].T, strict=True):
        for b, beta in zip(lights[0].T, lights[1].T, strict=True):
            out += (alpha * beta)[:, None] * raw.images[a, b, row % height, column % width]
    value = out if code is None else decode(out, code)
    return (value * light_gain(raw, local)[:, None]).astype(np.float32)


def coded(raw: RawMaterial, code: Encoding) -> RawMaterial:
    """The material with coded images; made-up nodes are means of codes, as in a table."""
    images = encode(raw.images, code)
    for axis, directions in ((0, raw.views), (1, raw.lights)):
        mix, turned = directions.mix, np.swapaxes(images, 0, axis)
        if len(mix) > len(directions.directions):
            turned[-1] = turned[np.flatnonzero(mix[-1])].mean(axis=0)
    return replace(raw, images=images)


def by_blend(subject: Subject, each: int) -> list[tuple]:
    """Errors against the truth when codes are blended, and when radiance is."""
    sample = subject.sample
    assert sample.factors is not None
    code = sample.factors.encoding
    shots = plane_shots(subject, each, seed=3)
    shots = [one for one in shots if one.view_bin and one.light_bin]
    truth = [shot.truth for shot in shots]
    raw = raw_material(sample)
    whole = coded(raw, code)
    own = raw_material(replace(sample, stack=FactorStack(sample.factors)))
    ways = {
        "images": ([exactly(whole, one.scene, one.light, code) for one in shots], raw),
        "factors": (render(shots, factor_material(sample)), own),
    }
    rows = []
    for what, (found, linear) in ways.items():
        plain = [exactly(linear, one.scene, one.light, None) for one in shots]
        one, two = miss(found, truth, shots), miss(plain, truth, shots)
        label = "none" if code.knee is None else f"{code.knee:.2g}"
        rows.append(
            (
                subject.name,
                code.name,
                label,
                what,
                one.L2,
                two.L2,
                one.RMSE,
                two.RMSE,
                one.SSIM,
                two.SSIM,
            )
        )
    return rows


def blend_table(subjects: list[Subject], each: int) -> str:
    """Errors of all, as Markdown."""
    rows = [row for one in subjects for row in by_blend(one, each)]
    columns = [f"{name} {way}" for name in ("L2", "RMSE", "SSIM") for way in ("codes", "radiance")]
    return HEAD + "\n\n" + markdown(["sample", "code", "knee", "of", *columns], rows)
