"""The images of a factorised BTF, as a stack."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from btfcore.btf.factor.elementary import decode_rows
from btfcore.btf.factor.encoding import checked, knobs
from btfcore.btf.factor.kernels import combine
from btfcore.btf.sample import BtfFactors
from btfcore.errors import InvalidBtf, InvalidParameter
from btfcore.types import F4

_RUN = 1024  # texels at once, so that a factor's row stays in the cache


class FactorStack:
    """An `ImageStack` of what factors give: decoded weights · basis[j] + mean[j].

    Raises `InvalidBtf` where the factors' shapes contradict each other, `InvalidParameter` for
    an unknown encoding.
    """

    def __init__(self, factors: BtfFactors) -> None:
        """Prepare to read the images of `factors`."""
        height, width, rank = factors.weights.shape
        count = len(factors.basis)
        if factors.basis.shape != (count, 3, rank) or factors.mean.shape != (count, 3):
            raise InvalidBtf(
                f"factors with weights {factors.weights.shape}, basis {factors.basis.shape} and"
                f" mean {factors.mean.shape}"
            )
        checked(factors.encoding)
        self.factors = factors
        self._shape = (count, height, width)
        maps = factors.weights.reshape(height * width, rank).T
        # the mean as one factor more, whose map is 1 everywhere
        self._rows = np.ones((rank + 1, height * width), np.float32)
        self._rows[:rank] = maps

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of images, rows, columns."""
        return self._shape

    @property
    def dear(self) -> bool:
        """Reading multiplies and decodes."""
        return True

    def read(self, numbers: ArrayLike) -> F4:
        """Images `numbers` (n,) as (n, H, W, 3) f4 linear radiance."""
        chosen = np.asarray(numbers, np.int64)
        _, height, width = self._shape
        out = np.empty((len(chosen), height, width, 3), np.float32)
        kind, epsilon, knee = knobs(self.factors.encoding)
        for place, number in enumerate(chosen):
            planes = self.planes(int(number))
            decode_rows(planes[0], planes[1], planes[2], kind, epsilon, knee)
            out[place] = planes.T.reshape(height, width, 3)
        return out

    def planes(self, number: int, *, rank: int | None = None) -> F4:
        """Coded colours (3, H·W) f4 of one image, of the first `rank` factors only."""
        factors = self.factors
        count = factors.rank if rank is None else min(rank, factors.rank)
        coefficients = np.empty((3, count + 1), np.float32)
        coefficients[:, 0] = factors.mean[number]
        coefficients[:, 1:] = factors.basis[number, :, :count]
        coefficients = np.roll(coefficients, -1, axis=1)
        texels = self._rows.shape[1]
        rows = self._rows if count == factors.rank else None
        out = np.empty((3, texels), np.float32)
        for start in range(0, texels, _RUN):
            run = slice(start, start + _RUN)
            if rows is not None:
                combine(coefficients, rows[:, run], out[:, run])
            else:
                part = np.concatenate([self._rows[:count, run], self._rows[-1:, run]])
                combine(coefficients, part, out[:, run])
        return out


def truncated(factors: BtfFactors, rank: int) -> BtfFactors:
    """Keep the first `rank` factors: the best approximation of that rank.

    The error grows by what the others held. Raises `InvalidParameter` for a rank below 1 or
    above that of the factors.
    """
    if not 1 <= rank <= factors.rank:
        raise InvalidParameter(f"rank {rank} of {factors.rank} factors")
    lost = float((factors.singular[rank:] ** 2).sum())
    total = _energy(factors)
    return replace(
        factors,
        weights=np.ascontiguousarray(factors.weights[:, :, :rank]),
        basis=np.ascontiguousarray(factors.basis[:, :, :rank]),
        singular=factors.singular[:rank].copy(),
        error=float(np.sqrt(factors.error**2 + lost / total)) if total > 0 else factors.error,
    )


def _energy(factors: BtfFactors) -> float:
    """Sum of squares of the coded BTF, from what the factors keep of it and their error."""
    texels = factors.weights.shape[0] * factors.weights.shape[1]
    mean = factors.mean.astype(np.float64)
    kept = float((mean**2).sum()) * texels + float((factors.singular**2).sum())
    rest = 1 - factors.error**2
    return kept / rest if 0 < rest <= 1 else float("nan")
