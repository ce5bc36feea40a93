"""Principal components of coefficient vectors, from moments that are gathered in blocks."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from btfcore.btf.harmonics.linear import gram, product, svd
from btfcore.types import F8, Frozen

_NOISE = 1e-14  # of the largest variance: what remains below is rounding


class Moments:
    """Mean and centred second moment of D-vectors, gathered block by block in f8.

    Blocks are merged by their means and centred sums (Chan, Golub, LeVeque 1979), so that a
    large common value costs no digits.
    """

    def __init__(self, size: int) -> None:
        """Begin with no vectors of `size` numbers."""
        self.count = 0
        self.mean = np.zeros(size)
        self.scatter = np.zeros((size, size))

    def add(self, columns: F8, *, pool: ThreadPoolExecutor | None = None) -> None:
        """Take in the columns of `columns` (D, n)."""
        number = columns.shape[1]
        if number == 0:
            return
        mean = columns.mean(axis=1)
        shift = mean - self.mean
        whole = self.count + number
        self.scatter += gram(columns - mean[:, None], pool=pool)
        self.scatter += np.outer(shift, shift) * (self.count * number / whole)
        self.mean += shift * (number / whole)
        self.count = whole


@dataclass(frozen=True, eq=False)
class Axes(Frozen):
    """Principal axes: vector ≈ mean + decode · encode · (vector - mean).

    mean (D,); encode (K, D), decode (D, K) f8; variances f8: mean squares along all axes,
    descending.
    """

    mean: F8
    encode: F8
    decode: F8
    variances: F8


def principal_axes(
    moments: Moments, rank: int, *, centred: bool = True, metric: F8 | None = None
) -> Axes:
    """Return the first `rank` principal axes, or as many as the vectors span, at least one.

    metric (R, D) : distances are those of metric · vector; None for the vectors' own. centred :
    whether the mean is taken off first (otherwise it is 0, as in Furukawa eq. 1). The mean
    squared distance that K axes leave is the sum of the other `variances`. The sign is such
    that the largest entry of each axis in the metric is positive.
    """
    size = len(moments.mean)
    spread = moments.scatter / moments.count
    if not centred:
        spread = spread + np.outer(moments.mean, moments.mean)
    turn = np.eye(size) if metric is None else metric
    back = np.eye(size)
    if metric is not None:
        left, singular, right = svd(metric)
        kept = singular > singular[0] * 1e-12
        back = product(right[:, kept] / singular[kept], np.ascontiguousarray(left[:, kept].T))
        spread = product(product(turn, spread), np.ascontiguousarray(turn.T))
        spread = (spread + spread.T) / 2
    _, variances, axes = svd(spread)
    spanned = int((variances > variances[0] * _NOISE).sum())
    number = max(1, min(rank, spanned, moments.count - centred))
    chosen = np.ascontiguousarray(axes[:, :number])
    return Axes(
        mean=moments.mean.copy() if centred else np.zeros(size),
        encode=product(np.ascontiguousarray(chosen.T), turn),
        decode=product(back, chosen),
        variances=variances,
    )
