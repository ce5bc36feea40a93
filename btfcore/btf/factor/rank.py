"""Finds how many factors a wanted error takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from btfcore.btf.factor.measure import measured, spread
from btfcore.btf.factor.stack import truncated
from btfcore.btf.sample import BtfFactors, BtfSample
from btfcore.progress import Progress, silent
from btfcore.types import I8

SUBSET = 256  # images on which ranks are tried


def fewest(
    sample: BtfSample, factors: BtfFactors, *, rmse: float, progress: Progress = silent
) -> BtfFactors:
    """Keep as many factors as bring the mean sRGB RMSE down to `rmse`, and no more.

    Ranks are tried by bisection on some images, spread evenly; the answer is then checked on
    all of them, and mended where these differ. Where all factors do not suffice they are
    returned with a note that says what they reach.
    """
    if factors.rank == 0:
        return factors
    everything = np.arange(sample.images)
    some = spread(sample.images, SUBSET)
    tried: dict[tuple[int, bool], float] = {}

    def error(rank: int, numbers: I8) -> float:
        key = (rank, len(numbers) == sample.images)
        if key not in tried:
            tried[key] = _error(sample, truncated(factors, rank), numbers, progress)
        return tried[key]

    least = error(factors.rank, everything)
    if least > rmse:
        note = (
            f"{factors.rank} factors reach a mean sRGB RMSE of {least:.4f}, not the {rmse:g} that"
            " was asked for"
        )
        return replace(factors, notes=(*factors.notes, note))
    # all images may be better or worse than some of them: correct the goal by the ratio
    rank = _bisect(lambda n: error(n, some), 1, factors.rank, rmse)
    for _ in range(4):
        ratio = error(rank, some) / max(error(rank, everything), 1e-12)
        better = _bisect(lambda n: error(n, some), 1, factors.rank, rmse * ratio)  # noqa: B023
        if better == rank:
            break
        rank = better
    while error(rank, everything) > rmse:
        rank += 1
    while rank > 1 and error(rank - 1, everything) <= rmse:
        rank -= 1
    return truncated(factors, rank) if rank < factors.rank else factors


def _bisect(error, low: int, high: int, goal: float) -> int:  # type: ignore[no-untyped-def]
    """Least rank in low … high whose error is at most `goal`; `high` where there is none."""
    while low < high:
        middle = (low + high) // 2
        if error(middle) <= goal:
            high = middle
        else:
            low = middle + 1
    return low


def _error(sample: BtfSample, factors: BtfFactors, numbers: I8, progress: Progress) -> float:
    def tick(fraction: float, label: str) -> None:
        progress(0.5, "choosing the rank")  # how many trials follow is not known

    sums, _ = measured(sample, factors, numbers, pictures=False, progress=tick)
    height, width = sample.shape
    return float(np.sqrt(sums[:, 4] / (3 * height * width)).mean())
