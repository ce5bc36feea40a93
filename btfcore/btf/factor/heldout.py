"""Errors on texels that had no part in the factorisation: what the basis cannot express."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from btfcore.btf.factor.blocks import images_within
from btfcore.btf.factor.encoding import encode
from btfcore.btf.factor.measure import FactorErrors, measured, summary
from btfcore.btf.factor.svd import DEFAULT_RANK, factorize
from btfcore.btf.factor.symmetric import turned
from btfcore.btf.materialize import materialize
from btfcore.btf.sample import BtfFactors, BtfSample, Encoding
from btfcore.btf.stack import ImageStack
from btfcore.errors import InvalidBtf, InvalidParameter
from btfcore.progress import Progress, between, silent
from btfcore.types import F4, I8

EDGE = 8  # texels of a block that is held out: farther than neighbours are alike


class TexelStack:
    """Some texels (n,) of another stack's images, flat row by row, as images of one row."""

    def __init__(self, stack: ImageStack, texels: I8) -> None:
        """Look at `texels` of `stack` only."""
        self._stack, self._texels = stack, texels

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of images, 1, number of texels."""
        return self._stack.shape[0], 1, len(self._texels)

    @property
    def dear(self) -> bool:
        """As dear as what is behind it."""
        return self._stack.dear

    def read(self, numbers: ArrayLike) -> F4:
        """Images `numbers` (n,) as (n, 1, texels, 3) f4 linear radiance."""
        chosen = np.asarray(numbers, np.int64)
        whole = self._stack.read(chosen).reshape(len(chosen), -1, 3)
        return whole[:, self._texels][:, None]


def held_out(shape: tuple[int, int], *, share: float, seed: int) -> tuple[I8, I8]:
    """Texels that stay and texels held out, flat: whole blocks of 8 × 8, chosen at random.

    Raises `InvalidParameter` where either would be empty.
    """
    rows, columns = -(-shape[0] // EDGE), -(-shape[1] // EDGE)
    count = round(share * rows * columns)
    if not 0 < count < rows * columns:
        raise InvalidParameter(
            f"a share of {share} of {rows * columns} blocks of {EDGE} x {EDGE} texels to hold out"
        )
    chosen = np.zeros(rows * columns, bool)
    chosen[np.random.default_rng(seed).permutation(rows * columns)[:count]] = True
    mask = np.repeat(np.repeat(chosen.reshape(rows, columns), EDGE, 0), EDGE, 1)
    flat = mask[: shape[0], : shape[1]].ravel()
    return np.flatnonzero(~flat), np.flatnonzero(flat)


def held_out_errors(
    sample: BtfSample,
    *,
    rank: int = DEFAULT_RANK,
    encoding: str | Encoding = "auto",
    share: float = 0.25,
    seed: int = 0,
    memory_mb: float = 2048.0,
    progress: Progress = silent,
) -> FactorErrors:
    """Errors on a share of the texels, of factors that the others gave.

    Their weights are the projection on that basis, so that what is measured is how well it
    stands for texels that it has not seen. SSIM is NaN: they form no picture. Raises
    `InvalidBtf` for one image, `InvalidParameter` for knobs out of range.
    """
    if sample.is_image:
        raise InvalidBtf(f"{sample.name}: one image has nothing to factorise")
    stay, out = held_out(sample.shape, share=share, seed=seed)
    room = memory_mb / 2 if sample.stack.dear else memory_mb
    sample = materialize(sample, memory_mb=memory_mb / 2, progress=between(progress, 0, 0.2))
    factors = factorize(
        _only(sample, stay), rank=rank, encoding=encoding, seed=seed, memory_mb=room,
        progress=between(progress, 0.2, 0.6),
    )  # fmt: skip
    apart = _only(sample, out)
    seen = projected(apart, factors, progress=between(progress, 0.6, 0.8))
    numbers = np.arange(sample.images)
    sums, similar = measured(
        apart, seen, numbers, pictures=False, progress=between(progress, 0.8, 1)
    )
    return summary(apart, seen.rank, numbers, sums, similar)


def projected(sample: BtfSample, factors: BtfFactors, *, progress: Progress = silent) -> BtfFactors:
    """Factors of a sample's own texels on the basis of others: weights = (coded - mean)ᵀ basis."""
    height, width = sample.shape
    weights = np.zeros((height * width, factors.rank))
    part = np.empty_like(weights)
    step = images_within(sample.stack, 8.0)
    for first in range(0, sample.images, step):
        numbers = np.arange(first, min(first + step, sample.images))
        coded = encode(sample.stack.read(numbers), factors.encoding)
        coded = coded.reshape(len(numbers), -1, 3) - factors.mean[numbers, None]
        flat = np.ascontiguousarray(coded.transpose(1, 0, 2)).reshape(height * width, -1)
        basis = factors.basis[numbers].reshape(3 * len(numbers), factors.rank).astype(np.float64)
        turned(flat, basis, part)
        weights += part
        progress((numbers[-1] + 1) / sample.images, "projecting")
    return replace(
        factors,
        weights=weights.astype(np.float32).reshape(height, width, factors.rank),
        error=float("nan"),
    )


def _only(sample: BtfSample, texels: I8) -> BtfSample:
    return replace(
        sample, stack=TexelStack(sample.stack, texels), mask=None, factors=None, tiles=False
    )
