"""Factorises a BTF by a streamed randomised SVD (Zhou §III-B, "Handling BTF Values").

With texels as rows and images × colours as columns, the coded BTF A, less each column's mean,
is approximated by its leading singular vectors: a sparse random sketch of its columns, then
subspace iteration with both products of a pass taken while a block is in memory (Halko,
Martinsson, Tropp 2011, §4.5). The last pass gives Z = AᵀQ and AZ: with V an orthonormal basis
of Z, A V is known without reading A again, and its SVD is the result (half a step more than
the projection on Q, and one reading less).
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Literal

import numpy as np

from btfcore.btf.factor.blocks import CodedBlocks, cores, share
from btfcore.btf.factor.encoding import EPSILON, checked, encode
from btfcore.btf.factor.kernels import LANES, down, sketch, up
from btfcore.btf.factor.knee import choose_knee
from btfcore.btf.factor.plan import plan
from btfcore.btf.factor.symmetric import add_gram, product, turned, whitening
from btfcore.btf.materialize import materialize
from btfcore.btf.sample import BtfFactors, BtfSample, Encoding
from btfcore.errors import InvalidParameter
from btfcore.progress import Progress, between, silent
from btfcore.types import F4, F8

DEFAULT_RANK = 40
CAP = 120  # factors that rank="auto" may take
_SPARSE = 4  # columns of the sketch that each row goes to
_LEAST = 1e-6  # singular values below this share of the greatest are rounding


def factorize(
    sample: BtfSample,
    *,
    rank: int | Literal["auto"] | str = DEFAULT_RANK,
    encoding: str | Encoding = "auto",
    knee: float | Literal["auto"] | str | None = "auto",
    oversample: int = 40,
    passes: int = 2,
    memory_mb: float = 2048.0,
    seed: int = 0,
    rmse: float = 0.02,
    progress: Progress = silent,
) -> BtfFactors:
    """Return the best factors of a sample's coded images, to within about 0.2 % of the error.

    rank : number of factors, or "auto": the fewest whose mean sRGB RMSE is at most `rmse`; a
    note of the result says so where even `CAP` do not reach it. There are fewer where the BTF
    has no more (none for one that is the same everywhere); one image comes back exactly, as its
    three colours. encoding : a name of `encoding.NAMES`, an `Encoding`, or "auto": "log" where
    highlights carry much of the energy (`choose_knee`), else "sqrt". knee : see `Encoding`;
    "auto" asks `choose_knee`, but for the logarithms, which need none; ignored with an `Encoding`.
    oversample : further columns that the iteration works on. passes : iterations; the images
    are read one time more. memory_mb : MiB that may be used beyond what is used already; a
    sample whose coded images fit is read only once. The same seed and memory give the
    same bits, whatever the number of threads. The result's `error` is a difference of sums of
    squares: below 1e-4 it says no more than that.

    Raises `InvalidParameter` for knobs out of range, or where the factors need more memory.
    """
    if rank != "auto" and (not isinstance(rank, (int, np.integer)) or rank < 1):
        raise InvalidParameter(f"{sample.name}: rank {rank}, where 1 or more, or auto, is needed")
    if oversample < 0 or passes < 1 or not rmse > 0:
        raise InvalidParameter(
            f"{sample.name}: {oversample} columns oversampled, {passes} passes and an RMSE of"
            f" {rmse}; at least 0, 1 and above 0 are needed"
        )
    if seed < 0:
        raise InvalidParameter(f"{sample.name}: a seed of {seed}, where 0 or more is needed")
    code = resolved(sample, encoding, knee)
    if sample.is_image:
        return _image(sample, code)
    if rank != "auto":
        return _factors(sample, code, int(rank), oversample, passes, memory_mb, seed, progress)
    from btfcore.btf.factor.rank import fewest

    dear = sample.stack.dear  # ranks are tried on images that are read again and again
    sample = materialize(sample, memory_mb=memory_mb / 2, progress=between(progress, 0, 0.3))
    room = memory_mb / 2 if dear else memory_mb
    ahead = between(progress, 0.3, 0.8)
    factors = _factors(sample, code, CAP, oversample, passes, room, seed, ahead)
    return fewest(sample, factors, rmse=rmse, progress=between(progress, 0.8, 1))


def resolved(
    sample: BtfSample, encoding: str | Encoding, knee: float | str | None = "auto"
) -> Encoding:
    """Return the encoding that names and numbers stand for; raises `InvalidParameter`."""
    if isinstance(encoding, Encoding):
        return checked(encoding)
    if isinstance(knee, str) and knee != "auto":
        raise InvalidParameter(f"{sample.name}: knee {knee!r}, not a number, auto or none")
    if encoding != "auto":
        checked(Encoding(encoding))
    if knee == "auto":
        bends = encoding in ("log", "logluma")  # and a knee would only make overshoots worse
        knee = None if bends else choose_knee(sample.stack).knee
        if encoding == "auto" and knee is not None:
            encoding, knee = "log", None
    name = "sqrt" if encoding == "auto" else encoding
    assert not isinstance(knee, str)
    return checked(Encoding(name, EPSILON, knee))


def _image(sample: BtfSample, encoding: Encoding) -> BtfFactors:
    """One image has nothing to factorise: its coded colours, greatest first, are the factors."""
    coded = encode(sample.stack.read([0])[0], encoding)
    mean = coded.mean(axis=(0, 1), dtype=np.float64).astype(np.float32)
    weights = coded - mean
    length = np.sqrt((weights.astype(np.float64) ** 2).sum(axis=(0, 1)))
    order = np.argsort(-length, kind="stable")
    basis = np.eye(3, dtype=np.float32)[None, :, order]
    return BtfFactors(
        np.ascontiguousarray(weights[:, :, order]), np.ascontiguousarray(basis), mean[None],
        length[order], encoding, error=0.0,
    )  # fmt: skip


def _factors(
    sample: BtfSample,
    encoding: Encoding,
    rank: int,
    oversample: int,
    passes: int,
    memory_mb: float,
    seed: int,
    progress: Progress,
) -> BtfFactors:
    images, height, width = sample.stack.shape
    texels, columns = height * width, images * 3
    small = min(texels, columns)
    taken = rank + oversample
    if small <= 2 * taken:  # then the whole of the smaller side costs no more
        taken = small
    rank = min(rank, small)
    of = plan(sample.name, sample.stack, width=taken, rank=rank, memory_mb=memory_mb)
    with ThreadPoolExecutor(cores()) as pool:
        blocks = CodedBlocks(sample.stack, encoding, pool, images=of.images, keep=of.keep)
        work = _Passes(blocks, pool, (images, texels), taken, seed)
        if taken == columns:
            steps: list[Callable[[Progress], None]] = [work.copy]
        else:
            first = work.identity if taken == texels else work.sketch
            iterations = 1 if taken == texels else passes
            steps = [first, *([work.iterate] * iterations)]
        for number, step in enumerate(steps):
            step(between(progress, number / len(steps), (number + 1) / len(steps)))
        weights, basis, singular = work.result(rank)
    total, centred = work.energy
    lost = max(centred - float((singular**2).sum()), 0.0)
    error = float(np.sqrt(lost / total)) if total > 0 else 0.0
    return BtfFactors(
        weights.reshape(height, width, len(singular)),
        basis.reshape(images, 3, len(singular)),
        work.mean,
        singular,
        encoding,
        error=error,
    )


class _Passes:
    """The tall factors of a streamed SVD, and what is known of A after each pass."""

    def __init__(
        self,
        blocks: CodedBlocks,
        pool: ThreadPoolExecutor,
        size: tuple[int, int],
        width: int,
        seed: int,
    ) -> None:
        """size: images and texels; width: columns l that are worked on."""
        self._blocks, self._pool, self._size, self._width = blocks, pool, size, width
        self._seed = seed
        self._tall = np.zeros((-(-size[1] // LANES) * LANES, width), np.float64)
        self._range: F4 | None = None
        self._right: F4 | None = None  # Z, whose product with A is in `_tall`; None: identity
        self._gram = np.eye(width)  # of Z
        self.mean = np.zeros((size[0], 3), np.float32)
        self.energy = (0.0, 0.0)

    def copy(self, progress: Progress) -> None:
        """Take all of A, which has no more columns than are worked on."""
        total = np.zeros(2)
        for block in self._blocks:
            rows = slice(3 * block.first, 3 * (block.first + block.count))
            flat = np.moveaxis(block.tiles[:, : 3 * block.count], 1, 2)
            self._tall[:, rows] = flat.reshape(len(self._tall), -1)
            self._see(block.first, block.count, block.mean)
            total += block.energy
            progress((block.first + block.count) / self._size[0], "factorising")
        self.energy = (float(total[0]), float(total[1]))

    def identity(self, progress: Progress) -> None:
        """Work on all texels, which are no more than the columns."""
        self._range = np.zeros(self._tall.shape, np.float32)
        np.fill_diagonal(self._range, 1)
        progress(1.0, "factorising")

    def sketch(self, progress: Progress) -> None:
        """First pass: A times a sparse matrix of signs."""
        images = self._size[0]
        generator = np.random.default_rng(self._seed)
        columns = generator.integers(0, self._width, (3 * images, _SPARSE), dtype=np.int32)
        signs = generator.integers(0, 2, columns.shape, dtype=np.int8)
        for block in self._blocks:
            rows = slice(3 * block.first, 3 * (block.first + block.count))
            goals, sign = columns[rows], (2 * signs[rows] - 1).astype(np.float32)
            tiles = block.tiles

            def some(start: int, stop: int) -> None:
                sketch(tiles, goals, sign, start, stop, self._tall)  # noqa: B023

            share(self._pool, some, len(tiles), 1)
            progress((block.first + block.count) / images, "sketching")
        self._orthonormalize(np.eye(self._width))

    def iterate(self, progress: Progress) -> None:
        """One pass: Z = AᵀQ and A Z, blockwise; then, if another is to follow, the next Q."""
        images = self._size[0]
        if self._right is not None:
            self._orthonormalize(whitening(self._gram, least=_LEAST)[1])
        assert self._range is not None
        width = self._range.shape[1]
        self._right = np.zeros((3 * images, width), np.float32)
        self._gram = np.zeros((width, width))
        self._tall = np.zeros((len(self._tall), width))
        total = np.zeros(2)
        for block in self._blocks:
            tiles, tall = block.tiles, self._range
            wide = np.empty((tiles.shape[1], width))

            def rows(start: int, stop: int) -> None:
                down(tiles, tall, start, stop, wide)  # noqa: B023

            share(self._pool, rows, tiles.shape[1], 4)
            right = wide.astype(np.float32)

            def columns(start: int, stop: int) -> None:
                up(tiles, right, start, stop, self._tall)  # noqa: B023

            share(self._pool, columns, len(tiles), 1)
            add_gram(right, self._gram)
            place = slice(3 * block.first, 3 * (block.first + block.count))
            self._right[place] = right[: 3 * block.count]
            self._see(block.first, block.count, block.mean)
            total += block.energy
            progress((block.first + block.count) / images, "factorising")
        self.energy = (float(total[0]), float(total[1]))

    def result(self, rank: int) -> tuple[F4, F4, F8]:
        """Weights (N, K), basis (C, K) and singular values of the best rank-K approximation."""
        matrix = np.eye(self._width)
        if self._right is not None:
            matrix = whitening(self._gram, least=_LEAST)[1]
        rotated = np.empty((len(self._tall), matrix.shape[1]))
        turned(self._tall, matrix, rotated)
        gram = np.zeros((matrix.shape[1],) * 2)
        add_gram(rotated, gram)
        singular, vectors = whitening(gram, least=_LEAST)
        count = min(rank, len(singular))
        singular = singular[:count].copy()
        # of orthonormal left vectors times singular values: V F = V (W F / s) s
        turn = vectors[:, :count] * singular
        left = np.empty((len(self._tall), count), np.float32)
        turned(self._tall, product(matrix, turn), left)
        left = left[: self._size[1]]
        if self._right is None:
            right = turn.astype(np.float32)
        else:
            right = np.empty((len(self._right), count), np.float32)
            turned(self._right, product(matrix, turn), right)
        peak = np.argmax(np.abs(left), axis=0)
        sign = np.where(left[peak, np.arange(count)] < 0, -1, 1).astype(np.float32)
        return left * sign, right * sign, singular

    def _orthonormalize(self, matrix: F8) -> None:
        """Q: orthonormal columns that span those of `_tall` times `matrix`."""
        gram = np.zeros((self._tall.shape[1],) * 2)
        add_gram(self._tall, gram)
        gram = product(matrix.T, product(gram, matrix))
        matrix = product(matrix, whitening(gram, least=_LEAST)[1])
        self._range = np.empty((len(self._tall), matrix.shape[1]), np.float32)
        turned(self._tall, matrix, self._range)

    def _see(self, first: int, count: int, mean: F4) -> None:
        self.mean[first : first + count] = mean[: 3 * count].reshape(count, 3)
