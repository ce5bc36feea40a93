"""Small samples that many tests share, made from formulas."""

import numpy as np

from btfcore.btf.sample import BtfFactors, BtfSample, Encoding, full_index
from btfcore.btf.stack import ArrayStack


def ring(count, theta):
    """`count` directions at polar angle `theta` in degrees, (count, 3)."""
    phi = 2 * np.pi * np.arange(count) / count
    theta = np.radians(theta)
    return np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.full(count, np.cos(theta))],
        axis=1,
    )


def directions(*rings):
    """Directions of several (count, theta in degrees) rings."""
    return np.concatenate([ring(*each) for each in rings])


VIEWS = directions((1, 0), (4, 40))
LIGHTS = directions((1, 0), (5, 30), (6, 65))


def images(views=5, lights=12, height=6, width=8, *, seed=0):
    """Positive random radiance (V·L, H, W, 3) f4."""
    generator = np.random.default_rng(seed)
    return generator.gamma(2.0, 0.2, (views * lights, height, width, 3)).astype(np.float32)


def sample(name="random", **details):
    """A complete sample of 5 views x 12 lights, 6 x 8 texels."""
    stack = details.pop("stack", None) or ArrayStack(images(), sound=True)
    index = details.pop("index", None)
    index = full_index(5, 12) if index is None else index
    return BtfSample(name, stack, VIEWS.copy(), LIGHTS.copy(), index, **details)


def factors(count=60, height=6, width=8, rank=4, *, seed=1, encoding=None):
    """Factors with random weights and an orthonormal basis."""
    generator = np.random.default_rng(seed)
    basis = np.linalg.qr(generator.normal(size=(count * 3, rank)))[0].reshape(count, 3, rank)
    singular = np.sort(generator.uniform(1, 9, rank))[::-1].copy()
    weights = np.linalg.qr(generator.normal(size=(height * width, rank)))[0] * singular
    return BtfFactors(
        weights.reshape(height, width, rank).astype(np.float32),
        basis.astype(np.float32),
        generator.uniform(0.3, 0.6, (count, 3)).astype(np.float32),
        singular,
        encoding or Encoding("sqrt"),
        error=0.125,
    )
