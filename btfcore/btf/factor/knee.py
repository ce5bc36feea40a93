"""Chooses above which radiance highlights are compressed, from a sketch of the values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.btf.factor.blocks import images_within
from btfcore.btf.factor.mapped import release
from btfcore.btf.factor.measure import spread
from btfcore.btf.stack import ImageStack
from btfcore.types import F4

WHITE = 1.0  # a white, diffuse texel that faces the light: what is brighter shines
HEAVY = 0.05  # share of the energy in what shines from which on it is compressed
_VALUES = 2_000_000  # looked at, at most
_READ_MB = 4.0


@dataclass(frozen=True)
class Highlights:
    """What lies above `above`: shares of the values and of their energy (sum of squares).

    knee: where to compress, or None where the highlights carry little. values_seen: how many
    values this rests on; peak: the greatest of them.
    """

    knee: float | None
    above: float
    values: float
    energy: float
    peak: float
    values_seen: int


def choose_knee(
    stack: ImageStack, *, above: float | None = None, heavy: float = HEAVY
) -> Highlights:
    """Look at values spread over images and texels and say whether highlights are heavy.

    above : radiance from which a value counts as highlight; None: 1, or the 99.5 % quantile
    where that is greater. heavy : least share of the energy that calls for a knee, at `above`.
    """
    values = _sketch(stack)
    if above is None:
        above = max(WHITE, float(np.quantile(values, 0.995)))
    squares = values.astype(np.float64) ** 2
    bright = values > above
    total = float(squares.sum())
    energy = float(squares[bright].sum()) / total if total > 0 else 0.0
    return Highlights(
        knee=above if energy > heavy else None,
        above=above,
        values=float(bright.mean()),
        energy=energy,
        peak=float(values.max()),
        values_seen=len(values),
    )


def _sketch(stack: ImageStack) -> F4:
    """About two million values at most, from images and texels all over the stack."""
    count, height, width = stack.shape
    texels = height * width
    images = spread(count, min(count, max(64, _VALUES // (3 * texels))))
    kept = spread(texels, max(1, _VALUES // (3 * len(images))))
    step = images_within(stack, _READ_MB)
    parts = []
    for start in range(0, len(images), step):
        block = stack.read(images[start : start + step])
        parts.append(block.reshape(len(block), texels, 3)[:, kept].ravel())
        release(stack)
    return np.concatenate(parts)
