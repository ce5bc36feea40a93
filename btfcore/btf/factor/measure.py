"""Measures factors against images, block by block; what `errors` reports is made of this."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from btfcore.btf.factor.blocks import cores, images_within
from btfcore.btf.factor.compare import compare
from btfcore.btf.factor.encoding import knobs
from btfcore.btf.factor.mapped import release
from btfcore.btf.factor.ssim import ssim
from btfcore.btf.factor.stack import FactorStack
from btfcore.btf.sample import BtfFactors, BtfSample
from btfcore.errors import InvalidBtf
from btfcore.progress import Progress, silent
from btfcore.types import F8, I8

_READ_MB = 8.0
_GOLDEN = 0.6180339887498949


@dataclass(frozen=True)
class FactorErrors:
    """Errors over `images` images, those of `rank` factors.

    rel_l2 and rel_l2_coded: √(Σ error² / Σ value²) of linear and of coded radiance, the mean
    counted as value; srgb_rmse: mean over images of the root mean square error of sRGB-coded
    colours (0–1), srgb_rmse_worst of the worst image, worst its (view, light); ssim: mean over
    images on the luminance of sRGB-coded colours, ssim_worst the least; NaN where the texels
    measured form no picture.
    """

    rank: int
    images: int
    rel_l2: float
    rel_l2_coded: float
    srgb_rmse: float
    srgb_rmse_worst: float
    worst: tuple[int, int]
    ssim: float
    ssim_worst: float


def spread(count: int, wanted: int) -> I8:
    """About `wanted` of `count` numbers, ascending: all over them, and in step with no period."""
    if wanted >= count:
        return np.arange(count)
    return np.unique((np.arange(1, wanted + 1) * _GOLDEN % 1 * count).astype(np.int64))


def measured(
    sample: BtfSample,
    factors: BtfFactors,
    numbers: ArrayLike,
    *,
    pictures: bool = True,
    progress: Progress = silent,
) -> tuple[F8, F8]:
    """Sums (n, 5) of `compare` and SSIM (n,) of some images of a sample."""
    given, stack = FactorStack(factors), sample.stack
    if given.shape != stack.shape:
        raise InvalidBtf(
            f"{sample.name}: factors of {given.shape} images, rows, columns for {stack.shape}"
        )
    chosen = np.asarray(numbers, np.int64)
    height, width = stack.shape[1:]
    sums, similar = np.zeros((len(chosen), 5)), np.full(len(chosen), np.nan)
    step = images_within(stack, _READ_MB)
    code = knobs(factors.encoding)
    with ThreadPoolExecutor(cores()) as pool:
        for start in range(0, len(chosen), step):
            part = chosen[start : start + step]
            images = stack.read(part).reshape(len(part), -1, 3)

            def one(j: int) -> None:
                grey = np.empty((2, height * width), np.float32)
                planes = given.planes(int(part[j]))  # noqa: B023
                compare(images[j], planes, *code, sums[start + j], grey)  # noqa: B023
                if pictures:
                    similar[start + j] = ssim(*grey.reshape(2, height, width))  # noqa: B023

            for _ in pool.map(one, range(len(part))):
                pass
            release(stack)
            progress(min(start + step, len(chosen)) / len(chosen), "measuring errors")
    return sums, similar


def summary(sample: BtfSample, rank: int, numbers: I8, sums: F8, similar: F8) -> FactorErrors:
    """Put the sums of images `numbers` together."""
    texels = sample.shape[0] * sample.shape[1]
    rmse = np.sqrt(sums[:, 4] / (3 * texels))
    worst = int(np.argmax(rmse))
    view, light = sample.pairs()[numbers[worst]]
    whole = sums.sum(axis=0)
    return FactorErrors(
        rank=rank,
        images=len(numbers),
        rel_l2=_ratio(whole[1], whole[0]),
        rel_l2_coded=_ratio(whole[3], whole[2]),
        srgb_rmse=float(rmse.mean()),
        srgb_rmse_worst=float(rmse[worst]),
        worst=(int(view), int(light)),
        ssim=float(similar.mean()),
        ssim_worst=float(similar.min()),
    )


def _ratio(error: float, value: float) -> float:
    return float(np.sqrt(error / value)) if value > 0 else float(np.sqrt(error))
