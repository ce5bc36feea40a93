"""Truncated singular value decompositions of a sample's channels, read block by block.

Plain on purpose: it serves the DFMF writer. Each channel is a matrix of images × texels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from btfcore.btf.bonn.one_thread import one_thread
from btfcore.progress import Progress
from btfcore.types import F4, F8, Frozen

MOST_GRAM = 4096  # side of a matrix of inner products
_MOST_PAIRS = 16  # blocks of images that are multiplied with each other, read again each time
_MORE = 16  # columns drawn beyond the rank
_POWERS = 2

Block = tuple[slice, F4]
Read = Callable[[slice], F4]


@dataclass(frozen=True, eq=False)
class Factors(Frozen):
    """left (J, K) and right (H·W, K) f8 with A ≈ left · rightᵀ, right including the singular (K,).

    left's columns are orthonormal (or 0 where the singular value is), their largest entries
    positive. error : ‖A - left · rightᵀ‖ / ‖A‖ by what the singular values leave out.
    """

    left: F8
    right: F8
    singular: F8
    error: float


@dataclass(frozen=True)
class Matrices:
    """Channels' matrices (J, H·W) behind `read(slice of images) -> (n, H·W, channels) f4`."""

    read: Read
    images: int
    texels: int
    ranks: Sequence[int]
    step: int

    def passes(self, progress: Progress, start: float, stop: float) -> Iterator[Block]:
        """Go through the images in blocks of at most `step`."""
        for block in self.blocks():
            yield block, self.read(block)
            progress(start + (stop - start) * block.stop / self.images, "factorising")

    def blocks(self) -> list[slice]:
        """Return the blocks of images."""
        stops = range(self.step, self.images + self.step, self.step)
        return [slice(stop - self.step, min(stop, self.images)) for stop in stops]


def factorise(matrices: Matrices, *, seed: int, progress: Progress) -> list[Factors]:
    """Decompose all channels at once.

    By the inner products of texels or of images where there are at most 4096 of them (of
    images: and at most 16 blocks), which is exact; else by a randomised range finder with two
    power passes, drawn from `seed`, whose error is within a per cent of the optimum as a rule.
    With OpenBLAS the bits do not depend on the number of threads.
    """
    with one_thread():
        return _factorise(matrices, seed, progress)


def _factorise(matrices: Matrices, seed: int, progress: Progress) -> list[Factors]:
    if matrices.texels <= min(MOST_GRAM, matrices.images):
        return _by_texels(matrices, progress)
    if matrices.images <= MOST_GRAM and len(matrices.blocks()) <= _MOST_PAIRS:
        return _by_images(matrices, progress)
    return _randomised(matrices, seed, progress)


def _by_texels(matrices: Matrices, progress: Progress) -> list[Factors]:
    ranks, texels = matrices.ranks, matrices.texels
    gram = np.zeros((len(ranks), texels, texels))
    for _, block in matrices.passes(progress, 0, 0.5):
        for channel in range(len(ranks)):
            part = block[..., channel].astype(np.float64)
            gram[channel] += part.T @ part
    sides = [_eigen(product, rank) for product, rank in zip(gram, ranks, strict=True)]
    left = [np.empty((matrices.images, len(singular))) for _, singular in sides]
    for where, block in matrices.passes(progress, 0.5, 1):
        for channel, (vectors, singular) in enumerate(sides):
            product = block[..., channel].astype(np.float64) @ vectors
            left[channel][where] = product * _inverse(singular)
    return [
        _factors(left[channel], vectors, singular, float(np.trace(gram[channel])))
        for channel, (vectors, singular) in enumerate(sides)
    ]


def _by_images(matrices: Matrices, progress: Progress) -> list[Factors]:
    ranks, images = matrices.ranks, matrices.images
    gram = np.zeros((len(ranks), images, images))
    for row, block in matrices.passes(progress, 0, 0.5):
        for column in matrices.blocks():
            if column.start > row.start:
                break
            other = block if column == row else matrices.read(column)
            for channel in range(len(ranks)):
                product = _products(block[..., channel], other[..., channel])
                gram[channel, row, column] = product
                gram[channel, column, row] = product.T
    sides = [_eigen(product, rank) for product, rank in zip(gram, ranks, strict=True)]
    right = _transposed(matrices, [vectors for vectors, _ in sides], progress, 0.5, 1)
    found = []
    for channel, (vectors, singular) in enumerate(sides):
        unit = right[channel] * _inverse(singular)
        found.append(_factors(vectors, unit, singular, float(np.trace(gram[channel]))))
    return found


def _randomised(matrices: Matrices, seed: int, progress: Progress) -> list[Factors]:
    images, texels = matrices.images, matrices.texels
    widths = [min(rank + _MORE, images, texels) for rank in matrices.ranks]
    draws = np.random.default_rng(seed)
    share = 1 / (2 * _POWERS + 2)
    bases = [draws.standard_normal((texels, width)) for width in widths]
    spans, energy = _forward(matrices, bases, progress, 0, share)
    for power in range(1, _POWERS + 1):
        begin = (2 * power - 1) * share
        across = _transposed(matrices, spans, progress, begin, begin + share)
        bases = [np.linalg.qr(product)[0] for product in across]
        spans, _ = _forward(matrices, bases, progress, begin + share, begin + 2 * share)
    across = _transposed(matrices, spans, progress, 1 - share, 1)
    found = []
    for channel, rank in enumerate(matrices.ranks):
        right, singular, turn = np.linalg.svd(across[channel], full_matrices=False)
        left = spans[channel] @ turn.T[:, :rank]
        found.append(_factors(left, right[:, :rank], singular[:rank], float(energy[channel])))
    return found


def _forward(
    matrices: Matrices, bases: Sequence[F8], progress: Progress, start: float, stop: float
) -> tuple[list[F8], F8]:
    """Orthonormal bases (J, k) f8 of each channel's A · basis, and ‖A‖² of the channels."""
    sums = [np.empty((matrices.images, basis.shape[1])) for basis in bases]
    thin = [basis.astype(np.float32) for basis in bases]
    energy = np.zeros(len(bases))
    for where, block in matrices.passes(progress, start, stop):
        for channel, basis in enumerate(thin):
            part = block[..., channel]
            sums[channel][where] = part @ basis
            energy[channel] += float(np.square(part, dtype=np.float64).sum())
    return [np.linalg.qr(product)[0] for product in sums], energy


def _transposed(
    matrices: Matrices, lefts: Sequence[F8], progress: Progress, start: float, stop: float
) -> list[F8]:
    """Aᵀ · left of each channel, (H·W, k) f8."""
    sums = [np.zeros((matrices.texels, left.shape[1])) for left in lefts]
    for where, block in matrices.passes(progress, start, stop):
        for channel, left in enumerate(lefts):
            sums[channel] += block[..., channel].T.astype(np.float64) @ left[where]
    return sums


def _products(one: F4, other: F4) -> F8:
    """Inner products (n, m) f8 of rows, summed up in f8 over runs of texels."""
    total = np.zeros((len(one), len(other)))
    for start in range(0, one.shape[1], MOST_GRAM):
        run = slice(start, start + MOST_GRAM)
        total += one[:, run].astype(np.float64) @ other[:, run].astype(np.float64).T
    return total


def _eigen(product: F8, rank: int) -> tuple[F8, F8]:
    """Largest eigenvectors (n, k) of inner products, and singular values (k,)."""
    values, vectors = np.linalg.eigh(product)
    rank = min(rank, len(values))
    return vectors[:, ::-1][:, :rank], np.sqrt(np.maximum(values[::-1][:rank], 0))


def _inverse(singular: F8) -> F8:
    """1 / singular, but 0 for values that are rounding errors of the largest."""
    sound = singular > singular[0] * 1e-7
    return np.where(sound, 1 / np.where(sound, singular, 1), 0)


def _factors(left: F8, right: F8, singular: F8, energy: float) -> Factors:
    peak = left[np.abs(left).argmax(axis=0), np.arange(left.shape[1])]
    sign = np.where(peak < 0, -1.0, 1.0)
    rest = max(0.0, energy - float(np.square(singular).sum()))
    error = float(np.sqrt(rest / energy)) if energy else 0.0
    return Factors(left * sign, right * (singular * sign), singular, error)
