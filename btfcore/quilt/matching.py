"""Patch matching: where in the sample the work image fits best (Zhou §III-B, Kwatra 2003).

SSD(t) = Σ m‖I‖² − 2 Σ m I·S + Σ m‖S‖² over the overlap, divided by the overlap's size; the
sums that contain the sample come from one real inverse FFT, those that do not from summed
areas. Never toroidal: parts of the work image that leave the sample do not count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numba import njit

from btfcore.quilt.grid import SampleGrid
from btfcore.types import C8, F4, F8

LARGE = 320  # samples wider than this are matched on block means first, then refined
RELAXED = ((0.4, 16.0), (0.2, 4.0), (0.02, 2.0), (0.0, 0.0))


@dataclass(frozen=True)
class Placement:
    """Where the patch's centre lands: (column, row) in grid texels, and the mean SSD there.

    turn: radians that the patch is turned by first; warp: the rest of `register.warped`.
    """

    column: float
    row: float
    cost: float
    turn: float = 0.0
    warp: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)


class Matcher:
    """Answers many matchings against one sample; its spectra are computed once per size."""

    def __init__(self, grid: SampleGrid, *, workers: int = 1, factor: int | None = None) -> None:
        """Prepare for `grid`; `workers` threads transform the channels of one image.

        factor: side in texels of the reduced grid's pixels, None: by the sample's size.
        """
        self.grid = grid
        self.workers = workers
        self.factor = factor or natural_factor(grid)
        self._match = _reduced(grid.match, self.factor)
        self._spectra: dict[tuple[int, int], tuple[C8, C8]] = {}

    def _sample_spectra(self, shape: tuple[int, int]) -> tuple[C8, C8]:
        if shape not in self._spectra:
            if len(self._spectra) > 24:  # one per patch size; bounded all the same
                self._spectra.clear()
            match = np.moveaxis(self._match, -1, 0)
            power = (match.astype(np.float64) ** 2).sum(axis=0).astype(np.float32)
            self._spectra[shape] = (
                scipy.fft.rfft2(match, shape, workers=self.workers),
                scipy.fft.rfft2(power, shape, workers=self.workers),
            )
        return self._spectra[shape]

    def costs(self, image: F4, mask: F4) -> tuple[F8, F8]:
        """Mean SSD and overlap count for the patch's centre at every texel of the sample.

        image (k, w, w) f4; mask (w, w) f4: weight of every pixel, 0 where unknown. On the
        reduced grid where the sample is large. Returns two (h, w') f8 arrays.
        """
        height, width = self._match.shape[:2]
        half = mask.shape[0] // 2
        shape = (
            scipy.fft.next_fast_len(height + half, real=True),
            scipy.fft.next_fast_len(width + half, real=True),
        )
        spectra, power = self._sample_spectra(shape)
        image_hat = scipy.fft.rfft2(image * mask, shape, workers=self.workers)
        mask_hat = scipy.fft.rfft2(mask, shape, workers=self.workers)
        mixed = np.conj(mask_hat) * power - 2 * (np.conj(image_hat) * spectra).sum(axis=0)
        crossed = scipy.fft.irfft2(mixed, shape, workers=self.workers)
        rows = (np.arange(height) - half) % shape[0]
        columns = (np.arange(width) - half) % shape[1]
        ssd = crossed[np.ix_(rows, columns)].astype(np.float64)
        count = _window_sums(mask, height, width)
        power_here = (image.astype(np.float64) ** 2).sum(axis=0) * mask
        ssd += _window_sums(power_here, height, width)
        return np.maximum(ssd, 0.0) / np.maximum(count, 1e-3), count

    def reduced(self, image: F4, mask: F4) -> tuple[F4, F4]:
        """Work image (k, w, w) and mask (w, w) on the reduced grid, as `costs` wants them."""
        return (image, mask) if self.factor == 1 else _reduced_image(image, mask, self.factor)

    def match(
        self,
        image: F4,
        mask: F4,
        *,
        most: int,
        overlap: float,
        margin: float,
        penalty: F8 | None = None,
    ) -> list[Placement]:
        """The `most` best local minima of the mean SSD, cheapest first.

        `penalty` (h, w) f8 is added to the mean SSD at every texel of the sample.

        A placement must cover the share `overlap` of the mask and keep the centre `margin`
        texels inside the sample; where none can, both are relaxed step by step.
        """
        factor = self.factor
        small, weight = self.reduced(image, mask)
        costs, count = self.costs(small, weight)
        total = float(weight.sum())
        height, width = costs.shape
        if penalty is not None:
            costs = costs + penalty[::factor, ::factor][:height, :width]
        # a bound that any texel of a small sample can meet
        room = 0.4 * (min(height, width) - 1)
        for share, inside in ((overlap, margin), *RELAXED):
            edge = int(min(inside / factor, room))
            allowed = count >= max(share * total, min(1.0, total))
            allowed[:edge], allowed[:, :edge] = False, False
            allowed[height - edge :], allowed[:, width - edge :] = False, False
            found = local_minima(costs, allowed, most)
            if len(found) and factor > 1:
                found, exact = refine(self.grid.match, image, mask, found * factor, factor)
                return [
                    Placement(float(c), float(r), float(e))
                    for (r, c), e in sorted(
                        zip(found.tolist(), exact, strict=True), key=lambda pair: pair[1]
                    )
                ]
            if len(found):
                return [Placement(float(c), float(r), float(costs[r, c])) for r, c in found]
        return []


def natural_factor(grid: SampleGrid) -> int:
    """Texels a side of the pixels on which a sample is searched first: 1 for small samples."""
    side = min(grid.match.shape[:2])
    return 1 if side <= LARGE else 2 if side <= 2 * LARGE else 4


def _reduced(values: F4, factor: int) -> F4:
    """Means of factor × factor blocks of (h, w, k); an incomplete last block is left out."""
    if factor == 1:
        return values
    height, width = values.shape[0] // factor, values.shape[1] // factor
    blocks = values[: height * factor, : width * factor].reshape(
        height, factor, width, factor, values.shape[2]
    )
    return np.ascontiguousarray(blocks.mean(axis=(1, 3), dtype=np.float64), np.float32)


def _reduced_image(image: F4, mask: F4, factor: int) -> tuple[F4, F4]:
    """Block means of the known pixels, and how many pixels each block knows."""
    pad = -mask.shape[0] % factor
    weight = np.pad(mask, (0, pad))
    known = np.pad(image, ((0, 0), (0, pad), (0, pad))) * weight
    side = weight.shape[0] // factor
    count = weight.reshape(side, factor, side, factor).sum(axis=(1, 3))
    total = known.reshape(len(image), side, factor, side, factor).sum(axis=(2, 4))
    return (total / np.maximum(count, 1.0)).astype(np.float32), count.astype(np.float32)


@njit(cache=True)
def refine(match, image, mask, centres, reach):  # type: ignore[no-untyped-def]
    """Best centre (row, column) within `reach` of each of `centres`, and its mean SSD."""
    height, width, channels = match.shape
    half = mask.shape[0] // 2
    rows, columns = np.nonzero(mask)
    stride = max(len(rows) // 3000, 1)  # the ranking of near placements needs no more pixels
    best = centres.copy()
    cost = np.full(len(centres), np.inf)
    for index in range(len(centres)):
        for row in range(centres[index, 0] - reach, centres[index, 0] + reach + 1):
            for column in range(centres[index, 1] - reach, centres[index, 1] + reach + 1):
                if row < 0 or column < 0 or row >= height or column >= width:
                    continue
                total, count = 0.0, 0
                for pixel in range(0, len(rows), stride):
                    r = row + rows[pixel] - half
                    c = column + columns[pixel] - half
                    if r < 0 or c < 0 or r >= height or c >= width:
                        continue
                    for k in range(channels):
                        total += (image[k, rows[pixel], columns[pixel]] - match[r, c, k]) ** 2
                    count += 1
                if count > 0 and total / count < cost[index]:
                    cost[index] = total / count
                    best[index, 0], best[index, 1] = row, column
    return best, cost


def _window_sums(values: F4 | F8, height: int, width: int) -> F8:
    """Sum of `values` (w, w) over the part that falls inside the sample, per centre."""
    side = values.shape[0]
    half = side // 2
    table = np.zeros((side + 1, side + 1))
    np.cumsum(np.cumsum(values, axis=0, dtype=np.float64), axis=1, out=table[1:, 1:])
    top = np.clip(half - np.arange(height), 0, side)
    bottom = np.clip(height + half - np.arange(height), 0, side)
    left = np.clip(half - np.arange(width), 0, side)
    right = np.clip(width + half - np.arange(width), 0, side)
    upper, lower = table[top], table[bottom]
    return np.asarray(lower[:, right] - lower[:, left] - upper[:, right] + upper[:, left])


@njit(cache=True)
def local_minima(costs, allowed, most):  # type: ignore[no-untyped-def]
    """(row, column) of the `most` smallest allowed local minima (8 neighbours), ascending."""
    height, width = costs.shape
    best = np.full(most, np.inf)
    where = np.full((most, 2), -1, np.int64)
    for row in range(height):
        for column in range(width):
            cost = costs[row, column]
            if not allowed[row, column] or cost >= best[most - 1]:
                continue
            lowest = True
            for dr in range(-1, 2):
                for dc in range(-1, 2):
                    r, c = row + dr, column + dc
                    if 0 <= r < height and 0 <= c < width and allowed[r, c]:
                        other = costs[r, c]
                        earlier = dr < 0 or (dr == 0 and dc < 0)
                        if other < cost or (other == cost and earlier):
                            lowest = False
            if not lowest:
                continue
            place = most - 1
            while place > 0 and best[place - 1] > cost:
                best[place] = best[place - 1]
                where[place] = where[place - 1]
                place -= 1
            best[place] = cost
            where[place, 0], where[place, 1] = row, column
    found = 0
    while found < most and where[found, 0] >= 0:
        found += 1
    return where[:found]
