"""Coarse search of a whole sample in many orientations at once, by FFT.

A patch's vertices are averaged into the pixels of a coarse grid, one image per orientation;
all costs come from one batch of transforms. Never toroidal: what leaves the sample does not
count.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.fft
from numba import njit
from numpy.typing import NDArray

from btfcore.types import F4, F8

MOST_SIZES = 16  # sizes of transforms whose spectra are kept


class CoarseSearch:
    """Joint costs of placing patches on one sample, reduced by a factor."""

    def __init__(
        self, match: F4, feature: F4, factor: int, scale: float, constraint: float
    ) -> None:
        """Reduce `match` (h, w, k) and `feature` (h, w) to means of factor × factor texels.

        scale: what texture SSDs are divided by; constraint: μ, what the feature's are
        multiplied by.
        """
        self.factor = factor
        height, width = match.shape[0] // factor, match.shape[1] // factor
        layers = np.concatenate([match, feature[..., None]], axis=2, dtype=np.float32)
        blocks = layers[: height * factor, : width * factor].reshape(
            height, factor, width, factor, -1
        )
        small = blocks.mean(axis=(1, 3), dtype=np.float64).astype(np.float32)
        # weighted once here, so that one inverse transform serves texture and constraint
        self._texture = np.ascontiguousarray(np.moveaxis(small[..., :-1], 2, 0)) / scale
        self._power = (small[..., :-1].astype(np.float64) ** 2).sum(axis=2) / scale
        self._feature = constraint * small[..., -1]
        self._square = constraint * small[..., -1].astype(np.float64) ** 2
        self._scale, self._constraint = scale, constraint
        self.shape = (height, width)
        self._spectra: dict[tuple[int, int], tuple[Any, ...]] = {}

    def costs(
        self,
        points: NDArray[np.complex128],
        turns: Sequence[float],
        values: F4,
        known: NDArray[np.bool_],
        target: F8,
    ) -> tuple[F8, F8, F8]:
        """Joint cost per pixel for the patch's centre at every coarse texel, for each turn.

        points (n,) complex: vertices about the centre in texels, y up; values (n, k) f4;
        known (n,); target (n,) f8. Returns costs (T, h, w) f8, pixels of the patch inside the
        sample (T, h, w) f8, and of the whole patch (T,) f8.
        """
        height, width = self.shape
        reach = float(np.abs(points).max(initial=0.0)) / self.factor
        half = min(int(np.ceil(reach)) + 1, max(self.shape))
        spins = np.exp(1j * np.asarray(turns, np.float64)) / self.factor
        image, seen, wanted, mask = splat(
            points, spins, values, known, np.ascontiguousarray(target, np.float64), half
        )
        size = (
            scipy.fft.next_fast_len(height + half, real=True),
            scipy.fft.next_fast_len(width + half, real=True),
        )
        texture, power, feature, square = self._transforms(size)
        mixed = np.conj(scipy.fft.rfft2(mask, size)) * square
        mixed -= 2 * np.conj(scipy.fft.rfft2(wanted * mask, size)) * feature
        ours = (image.astype(np.float64) ** 2).sum(axis=1) * seen / self._scale
        if known.any():
            mixed += np.conj(scipy.fft.rfft2(seen, size)) * power
            shown = scipy.fft.rfft2(image * seen[:, None], size)
            for k in range(len(texture)):
                mixed -= 2 * np.conj(shown[:, k]) * texture[k]
        crossed = scipy.fft.irfft2(mixed, size)
        rows, columns = (np.arange(n) - half for n in (height, width))
        total = crossed[:, rows[:, None] % size[0], columns % size[1]].astype(np.float64)
        ours += self._constraint * wanted.astype(np.float64) ** 2 * mask
        total += window_sums(ours, height, width)
        count = window_sums(mask, height, width)
        area = mask.sum(axis=(1, 2), dtype=np.float64)
        return np.maximum(total, 0.0) / np.maximum(count, 1e-3), count, area

    def _transforms(self, size: tuple[int, int]) -> tuple[Any, ...]:
        """Spectra of texture, its power, the feature and its square."""
        if size not in self._spectra:
            if len(self._spectra) >= MOST_SIZES:
                self._spectra.clear()
            self._spectra[size] = (
                scipy.fft.rfft2(self._texture.astype(np.float32), size),
                scipy.fft.rfft2(self._power.astype(np.float32), size),
                scipy.fft.rfft2(self._feature.astype(np.float32), size),
                scipy.fft.rfft2(self._square.astype(np.float32), size),
            )
        return self._spectra[size]


@njit(cache=True)
def splat(  # type: ignore[no-untyped-def]
    points, spins, values, known, target, half
):
    """Average vertices into pixels, for each of the turns `spins` (T,) complex.

    Returns image (T, k, s, s) f4 of the known vertices' values, seen (T, s, s) f4: share of a
    pixel's vertices that are known, wanted (T, s, s) f4: m_0, and mask (T, s, s) f4 of 0 and
    1; s = 2·half + 1, the patch's centre in the middle.
    """
    turns, side, channels = len(spins), 2 * half + 1, values.shape[1]
    image = np.zeros((turns, channels, side, side), np.float32)
    seen = np.zeros((turns, side, side), np.float32)
    wanted = np.zeros((turns, side, side), np.float32)
    mask = np.zeros((turns, side, side), np.float32)
    for turn in range(turns):
        for index in range(len(points)):
            at = points[index] * spins[turn]
            x = int(np.floor(at.real + 0.5)) + half
            y = int(np.floor(0.5 - at.imag)) + half
            if x < 0 or y < 0 or x >= side or y >= side:
                continue
            mask[turn, y, x] += 1
            wanted[turn, y, x] += target[index]
            if known[index]:
                seen[turn, y, x] += 1
                for k in range(channels):
                    image[turn, k, y, x] += values[index, k]
        for y in range(side):
            for x in range(side):
                count = mask[turn, y, x]
                if count == 0:
                    continue
                wanted[turn, y, x] /= count
                if seen[turn, y, x] > 0:
                    for k in range(channels):
                        image[turn, k, y, x] /= seen[turn, y, x]
                seen[turn, y, x] /= count
                mask[turn, y, x] = 1
    return image, seen, wanted, mask


def window_sums(values: F4 | F8, height: int, width: int) -> F8:
    """Sums of `values` (T, s, s) over the part inside a sample, for the centre at every texel."""
    turns, side = values.shape[:2]
    half = side // 2
    table = np.zeros((turns, side + 1, side + 1))
    np.cumsum(np.cumsum(values, axis=1, dtype=np.float64), axis=2, out=table[:, 1:, 1:])
    top = np.clip(half - np.arange(height), 0, side)
    bottom = np.clip(height + half - np.arange(height), 0, side)
    left = np.clip(half - np.arange(width), 0, side)
    right = np.clip(width + half - np.arange(width), 0, side)
    upper, lower = table[:, top], table[:, bottom]
    return np.asarray(lower[..., right] - lower[..., left] - upper[..., right] + upper[..., left])
