"""The paper's way of matching: 72 rotated copies of the sample (Zhou §III-B).

Kept as the reference that Patina's own way is measured against: the work image stays as it
is, the sample is turned by the nearest multiple of five degrees.
"""

from __future__ import annotations

import numpy as np
import scipy.fft
from scipy.ndimage import map_coordinates

from btfcore.quilt.grid import SampleGrid
from btfcore.quilt.matching import RELAXED, Placement, local_minima
from btfcore.types import C8, F4

COPIES = 72


class RotatedMatcher:
    """Matches against rotated copies of a sample, made when first needed."""

    def __init__(self, grid: SampleGrid) -> None:
        """Prepare for `grid`; nothing is computed before `precompute` or a first match."""
        self.grid = grid
        self._copies: dict[int, tuple[F4, F4]] = {}
        self._spectra: dict[tuple[int, int], tuple[C8, C8, C8]] = {}

    def precompute(self) -> None:
        """Make all copies, as the paper does before it starts."""
        for index in range(COPIES):
            self.copy(index)

    def copy(self, index: int) -> tuple[F4, F4]:
        """Copy number `index` of the sample: (channels (k, s, s), valid (s, s)) f4."""
        if index not in self._copies:
            match = self.grid.match
            height, width = match.shape[:2]
            side = int(np.ceil(np.hypot(height, width)))
            up, right = np.meshgrid(
                (side - 1) / 2 - np.arange(side), np.arange(side) - (side - 1) / 2, indexing="ij"
            )
            turned = (right + 1j * up) * np.exp(2j * np.pi * index / COPIES)
            column, row = turned.real + (width - 1) / 2, (height - 1) / 2 - turned.imag
            inside = (column >= 0) & (column <= width - 1) & (row >= 0) & (row <= height - 1)
            valid = inside.astype(np.float32)
            layers = [
                map_coordinates(match[..., k], [row, column], order=1, mode="nearest") * valid
                for k in range(match.shape[2])
            ]
            self._copies[index] = (np.stack(layers).astype(np.float32), valid)
        return self._copies[index]

    def match(
        self, image: F4, mask: F4, *, turn: float, overlap: float, margin: float
    ) -> list[Placement]:
        """The best placement among those of the copy nearest to a turn of `turn` radians.

        The work image lies in the patch's own plane; the placement's `turn` takes that plane
        to the sample.
        """
        index = round(turn * COPIES / (2 * np.pi)) % COPIES
        _, valid = self.copy(index)
        side, half = valid.shape[0], mask.shape[0] // 2
        length = scipy.fft.next_fast_len(side + half, real=True)
        samples, power, area = self._sample_spectra(index, length)
        energy = (image * image).sum(axis=0)
        image_hat = np.conj(scipy.fft.rfft2(image, (length, length)))
        mask_hat = np.conj(scipy.fft.rfft2(mask, (length, length)))
        energy_hat = np.conj(scipy.fft.rfft2(energy, (length, length)))
        mixed = mask_hat * power + energy_hat * area - 2 * (image_hat * samples).sum(axis=0)
        where = np.ix_(*(2 * [(np.arange(side) - half) % length]))
        ssd = scipy.fft.irfft2(mixed, (length, length))[where].astype(np.float64)
        count = scipy.fft.irfft2(mask_hat * area, (length, length))[where].astype(np.float64)
        costs = np.maximum(ssd, 0.0) / np.maximum(count, 1.0)
        height, width = self.grid.match.shape[:2]
        spin = np.exp(2j * np.pi * index / COPIES)
        up, right = np.meshgrid(
            (side - 1) / 2 - np.arange(side), np.arange(side) - (side - 1) / 2, indexing="ij"
        )
        home = (right + 1j * up) * spin
        column, row = home.real + (width - 1) / 2, (height - 1) / 2 - home.imag
        room = 0.4 * (min(height, width) - 1)
        for share, inside in ((overlap, margin), *RELAXED):
            edge = min(inside, room)
            allowed = (count >= max(share * float(mask.sum()), 1.0)) & (column >= edge)
            allowed &= (column <= width - 1 - edge) & (row >= edge) & (row <= height - 1 - edge)
            found = local_minima(costs, allowed, 1)
            if len(found):
                r, c = found[0]
                angle = float(np.angle(spin))
                return [Placement(float(column[r, c]), float(row[r, c]), float(costs[r, c]), angle)]
        return []

    def _sample_spectra(self, index: int, length: int) -> tuple[C8, C8, C8]:
        key = (index, length)
        if key not in self._spectra:
            if len(self._spectra) > 2 * COPIES:
                self._spectra.clear()
            channels, valid = self.copy(index)
            shape = (length, length)
            self._spectra[key] = (
                scipy.fft.rfft2(channels, shape),
                scipy.fft.rfft2((channels * channels).sum(axis=0), shape),
                scipy.fft.rfft2(valid, shape),
            )
        return self._spectra[key]
