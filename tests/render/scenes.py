"""Random surfels and materials for the tests of rendering: small, and of every kind."""

from __future__ import annotations

import numpy as np

from btfcore.btf.directions import layout
from btfcore.btf.harmonics.basis import functions
from btfcore.btf.interpolation.interpolator import prepare
from btfcore.btf.sample import Encoding
from btfcore.render.material import FactorMaterial, HarmonicMaterial, RawMaterial
from btfcore.render.surfels import BARE, Surfels, turned_frames
from btfcore.types import F4, F8

EYE = np.array([0.3, 0.2, 2.6, 1.0])
FAR = np.array([0.3, -0.9, 0.4, 0.0])  # at infinity


def ball(count: int, *, samples: int = 1, bare: bool = False, seed: int = 0) -> Surfels:
    """Surfels all over a sphere, with frames and places in the sample at random."""
    rng = np.random.default_rng(seed)
    up = rng.normal(size=(count, 3))
    up /= np.linalg.norm(up, axis=1)[:, None]
    frame = turned_frames(
        up.astype(np.float32), rng.normal(size=(count, 3)).astype(np.float32), 6 * rng.random(count)
    )
    source = rng.uniform(-3, 12, (count, 2)).astype(np.float32)
    sample = rng.integers(0, samples, count).astype(np.uint16)
    if bare:
        sample[rng.random(count) < 0.2] = BARE
    return Surfels((0.8 * up).astype(np.float32), frame, source, sample)


def factors(
    *,
    method: str = "grid",
    directions: str = "6x3x5x4",
    encoding: Encoding | None = None,
    rank: int = 5,
    tiles: bool = False,
    cosine: bool = True,
    seed: int = 0,
) -> FactorMaterial:
    """Material of random factors whose codes lie where radiance has its codes."""
    rng = np.random.default_rng(seed)
    views, lights = _both(directions, method)
    weights = rng.normal(size=(7, 9, rank)).astype(np.float32)
    shape = (len(views.mix), len(lights.mix), 3, rank + 1)
    table = (0.1 * rng.normal(size=shape)).astype(np.float32)
    encoding = encoding or Encoding("sqrt")
    table[..., -1] += -1.0 if encoding.name in ("log", "logluma") else 0.6
    if encoding.name == "logluma":
        table[:, :, 1:, -1] += 2.0
    return FactorMaterial(
        "random", weights, table, views, lights, encoding, tiles=tiles, cosine=cosine
    )


def images(
    *, method: str = "grid", tiles: bool = False, cosine: bool = True, seed: int = 0
) -> RawMaterial:
    """Material of random images."""
    rng = np.random.default_rng(seed)
    views, lights = _both("6x2x5x2", method)
    shape = (len(views.mix), len(lights.mix), 7, 9, 3)
    values = rng.random(shape, dtype=np.float32)
    return RawMaterial("random", values, views, lights, tiles=tiles, cosine=cosine)


def harmonics(
    *,
    method: str = "grid",
    order: int = 3,
    kind: str = "spherical",
    rank: int = 5,
    horizon: float = 0.26,
    tiles: bool = False,
    seed: int = 0,
) -> HarmonicMaterial:
    """Material of random harmonics, mostly positive."""
    rng = np.random.default_rng(seed)
    views, _ = _both("6x3x5x4", method)
    weights = rng.normal(size=(len(views.mix), 7, 9, rank)).astype(np.float32)
    components = (0.1 * rng.normal(size=(rank + 1, functions(order), 3))).astype(np.float32)
    components[-1, 0] += 1.5
    return HarmonicMaterial("random", weights, components, views, order, kind, horizon, tiles=tiles)


def gap(one: F4, two: F4) -> tuple[float, float]:
    """Mean and greatest difference of radiance as sRGB shows it."""
    from btfcore.btf.colour import linear_to_srgb

    apart: F8 = np.abs(linear_to_srgb(one).astype(np.float64) - linear_to_srgb(two))
    return float(apart.mean()), float(apart.max())


def _both(directions: str, method: str):  # type: ignore[no-untyped-def]
    wanted = layout(directions)
    return prepare(wanted.views, method), prepare(wanted.lights, method)
