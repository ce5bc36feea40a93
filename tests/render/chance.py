"""Samples by chance, every node and texel another, so that no wrong one goes unseen."""

import numpy as np

from btfcore.btf.directions import layout as layout_of
from btfcore.btf.factor.encoding import encode
from btfcore.btf.interpolation.interpolator import prepare
from btfcore.btf.sample import Encoding
from btfcore.render.material import FactorMaterial, HarmonicMaterial


def factor_sample(
    name="random", *, layout="12x8x12x8", rank=6, shape=(12, 10), encoding=None, method="auto",
    seed=0, **details,
):  # fmt: skip
    """Factors by chance, every node another, of radiances around a half."""
    random = np.random.default_rng(seed)
    directions = _directions(layout) if isinstance(layout, str) else layout
    views, lights = (prepare(each, method) for each in directions)
    encoding = encoding or Encoding("sqrt")
    spread = {"linear": 0.3, "sqrt": 0.25, "log": 0.8}.get(encoding.name)
    nodes = len(views.mix), len(lights.mix)
    table = random.normal(size=(*nodes, 3, rank + 1))
    mean = np.array([0.5, 0.4, 0.3]) * random.uniform(0.4, 1.5, size=(*nodes, 1))
    if spread is None:  # log-luminance and shares of red and blue
        table *= np.array([0.8, 0.15, 0.15])[:, None]
    else:
        table *= spread
    table[..., rank] = encode(mean, encoding)
    weights = random.normal(size=(*shape, rank)) / np.sqrt(rank)
    return FactorMaterial(
        name, weights.astype(np.float32), table.astype(np.float32), views, lights, encoding,
        **details,
    )  # fmt: skip


def harmonic_sample(*, order=4, kind="spherical", rank=5, shape=(9, 11), seed=0, **details):
    """Harmonics by chance around a mean that is constant."""
    random = np.random.default_rng(seed)
    views = prepare(_directions("12x5x12x5")[0])
    components = 0.15 * random.normal(size=(rank + 1, (order + 1) ** 2, 3))
    components[rank, 0] = 1.4
    weights = random.normal(size=(len(views.mix), *shape, rank)) / np.sqrt(rank)
    return HarmonicMaterial(
        "harmonic", weights.astype(np.float32), components.astype(np.float32), views, order, kind,
        np.cos(np.radians(75)), **details,
    )  # fmt: skip


def _directions(name):
    made = layout_of(name)
    return made.views, made.lights
