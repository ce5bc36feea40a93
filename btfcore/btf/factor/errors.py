"""How far factors are from the BTF that they were made from."""

from __future__ import annotations

from btfcore.btf.factor.heldout import held_out_errors
from btfcore.btf.factor.measure import FactorErrors, measured, spread, summary
from btfcore.btf.factor.stack import truncated
from btfcore.btf.sample import BtfFactors, BtfSample
from btfcore.errors import InvalidParameter
from btfcore.progress import Progress, silent

__all__ = ["FactorErrors", "factor_errors", "held_out_errors"]


def factor_errors(
    sample: BtfSample,
    factors: BtfFactors,
    *,
    rank: int | None = None,
    every: int = 1,
    pictures: bool = True,
    progress: Progress = silent,
) -> FactorErrors:
    """Compare factors, or the first `rank` of them, with a sample's images, read in blocks.

    every : measure about one image in `every`, spread evenly over views and lights. pictures :
    measure SSIM too, else it is NaN. Raises `InvalidBtf` where sizes differ and
    `InvalidParameter` for knobs out of range.
    """
    if every < 1:
        raise InvalidParameter(f"{sample.name}: one image in {every} to measure")
    used = factors if rank is None or rank == factors.rank else truncated(factors, rank)
    numbers = spread(sample.images, -(-sample.images // every))
    sums, similar = measured(sample, used, numbers, pictures=pictures, progress=progress)
    return summary(sample, used.rank, numbers, sums, similar)
