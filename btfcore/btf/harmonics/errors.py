"""Errors of the harmonic fit, gathered band by band in f8."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from btfcore.btf.colour import linear_to_srgb
from btfcore.btf.harmonics.kernels import add_errors
from btfcore.btf.harmonics.linear import product, shared
from btfcore.btf.harmonics.sweep import LIGHTS_AT_ONCE, Band
from btfcore.btf.harmonics.values import HarmonicErrors
from btfcore.btf.sample import BtfSample
from btfcore.types import F8

# sRGB coding over the square root of radiance, where straight pieces are good to 1e-6
TABLE = linear_to_srgb(np.linspace(0, 1, 4097) ** 2).astype(np.float64)


class ErrorSums:
    """Sums of squares (J, 6) of every image, see `kernels.add_errors`."""

    def __init__(self, sample: BtfSample) -> None:
        """Begin with nothing seen of `sample`."""
        self._pairs = sample.pairs()
        self._values = int(np.prod(sample.shape)) * 3
        self._sums = np.zeros((sample.images, 6))

    def add(self, band: Band, kept: F8, pool: ThreadPoolExecutor | None) -> None:
        """Compare a band's radiance with its coefficients and with `kept` (M, 3n) of PCA."""
        images, design = band.operator.images, band.operator.design
        for low in range(0, len(images), LIGHTS_AT_ONCE):
            some = slice(low, low + LIGHTS_AT_ONCE)
            band.progress(low / len(images), "measuring errors")
            series = product(design[some], band.coefficients, pool=pool)
            final = product(design[some], kept, pool=pool)

            def work(number: int, low: int = low, series: F8 = series, final: F8 = final) -> None:
                truth = band.radiance[low + number]
                sums = self._sums[images[low + number]]
                add_errors(truth, series[number], final[number], TABLE, sums)

            shared(pool, work, len(series))

    def result(self) -> HarmonicErrors:
        """Return the errors of all that was added."""
        views = int(self._pairs[:, 0].max()) + 1
        by_view = np.zeros((views, 4))
        np.add.at(by_view, self._pairs[:, 0], self._sums[:, :4])
        whole = by_view.sum(axis=0)
        coded = np.sqrt(self._sums[:, 4:] / self._values)
        worst = int(coded[:, 1].argmax())
        truncation, pca, total = (float(_ratio(part, whole[0])) for part in whole[1:])
        return HarmonicErrors(
            truncation=truncation,
            pca=pca,
            total=total,
            srgb_truncation=float(coded[:, 0].mean()),
            srgb=float(coded[:, 1].mean()),
            srgb_worst=float(coded[worst, 1]),
            worst=(int(self._pairs[worst, 0]), int(self._pairs[worst, 1])),
            per_view=_ratio(by_view[:, 1:], by_view[:, :1]),
        )


def _ratio(error: F8, truth: F8) -> F8:
    """Root of error over truth; 0 where both are 0, inf where only the truth is."""
    error, truth = np.broadcast_arrays(error, truth)
    safe = np.where(truth > 0, truth, 1)
    return np.where(truth > 0, np.sqrt(error / safe), np.where(error > 0, np.inf, 0.0))
