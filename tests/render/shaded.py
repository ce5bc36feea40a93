"""Small samples and surfels for tests of rendering."""

import numpy as np

from btfcore.btf.directions import layout
from btfcore.btf.sample import BtfFactors, BtfSample, Encoding, full_index
from btfcore.btf.stack import ArrayStack
from btfcore.render.surfels import Surfels


def factored(
    rank=5, height=6, width=7, directions="6x2x5x2", encoding="sqrt", *, tiles=False,
    cosine=True, knee=None, epsilon=0.01, seed=0,
):  # fmt: skip
    """A BTF of random factors whose radiance is positive and of order 1."""
    rng = np.random.default_rng(seed)
    wanted = layout(directions)
    count = len(wanted.views) * len(wanted.lights)
    basis = rng.standard_normal((count, 3, rank)).astype(np.float32) * np.float32(0.1)
    factors = BtfFactors(
        rng.standard_normal((height, width, rank)).astype(np.float32),
        basis,
        rng.uniform(0.3, 0.9, (count, 3)).astype(np.float32),
        np.arange(rank, 0, -1.0),
        Encoding(encoding, epsilon, knee),
        0.0,
    )
    stack = ArrayStack(np.full((count, height, width, 3), 0.5, np.float32))
    return BtfSample(
        "random", stack, wanted.views, wanted.lights,
        full_index(len(wanted.views), len(wanted.lights)), factors=factors, tiles=tiles,
        cosine=cosine,
    )  # fmt: skip


def pictured(height=6, width=7, directions="6x2x5x2", *, tiles=False, cosine=True, seed=0):
    """A BTF of random images."""
    rng = np.random.default_rng(seed)
    wanted = layout(directions)
    count = len(wanted.views) * len(wanted.lights)
    stack = ArrayStack(rng.random((count, height, width, 3)).astype(np.float32), sound=True)
    return BtfSample(
        "random images", stack, wanted.views, wanted.lights,
        full_index(len(wanted.views), len(wanted.lights)), tiles=tiles, cosine=cosine,
    )  # fmt: skip


def rotations(count, seed=0):
    """Random rotation matrices (n, 3, 3) f4."""
    rng = np.random.default_rng(seed)
    q, _ = np.linalg.qr(rng.standard_normal((count, 3, 3)))
    q[np.linalg.det(q) < 0, 0] *= -1
    return q.astype(np.float32)


def scattered(count, samples=1, height=6, width=7, seed=0):
    """Surfels anywhere, in any frame, of any texel; some a little beyond the sample."""
    rng = np.random.default_rng(seed)
    return Surfels(
        rng.uniform(-0.5, 0.5, (count, 3)).astype(np.float32),
        rotations(count, seed),
        (rng.random((count, 2)) * (width + 1, height + 1) - 1).astype(np.float32),
        rng.integers(0, samples, count).astype(np.uint16),
    )


def flat(height, width, frame=None):
    """One surfel per texel of a sample that lies flat: n = +z, s = +x."""
    row, column = np.mgrid[:height, :width]
    count = height * width
    axes = np.eye(3, dtype=np.float32) if frame is None else np.asarray(frame, np.float32)
    return Surfels(
        np.zeros((count, 3), np.float32),
        np.tile(axes, (count, 1, 1)),
        np.stack([column, row], axis=-1).reshape(-1, 2).astype(np.float32),
        np.zeros(count, np.uint16),
    )
