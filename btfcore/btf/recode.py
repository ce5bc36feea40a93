"""The factors of a BTF in another code of radiance, found from parts of its images.

Decoding and coding again is no linear map, so that the new images have factors of their own.
The images are made by factors themselves, though, and so are known wherever wanted. A share of
the texels, under all images, tells which functions of view and light there are; a share of the
images, for all texels, tells how much of each a texel has. Never are all values made.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from btfcore.btf.factor.blocks import BLOCK_MB, CodedBlocks, cores, images_within, share
from btfcore.btf.factor.encoding import checked
from btfcore.btf.factor.kernels import LANES, up
from btfcore.btf.factor.principal import principal
from btfcore.btf.factor.stack import FactorStack
from btfcore.btf.factor.svd import factorize
from btfcore.btf.factor.symmetric import add_gram, eigen, product, turned
from btfcore.btf.sample import BtfFactors, BtfSample, Encoding
from btfcore.btf.stack import SubsetStack
from btfcore.errors import InvalidBtf, InvalidParameter
from btfcore.progress import Progress, between, silent
from btfcore.types import F4, F8, I4

TEXELS = 1536  # that the functions of view and light are found from
IMAGES = 768  # that the texels' shares of them are found from
_OVERSAMPLE = 24
_LEAST = 1e-9  # of the greatest eigenvalue; below it two functions are one on these images


def recode(
    sample: BtfSample,
    encoding: Encoding,
    *,
    rank: int = 40,
    memory_mb: float = 2048,
    progress: Progress = silent,
) -> BtfFactors:
    """Return factors of the images that `sample.factors` give, coded as `encoding`.

    At most `rank` of them; the sample's own images are not read. The functions of view and
    light are the leading ones of up to 1536 texels, the texels' weights the best ones in the
    sense of least squares over up to 768 images (the rows that count most are the likelier to
    be chosen: Drineas, Mahoney, Muthukrishnan 2008, §3). So a sample of no more texels has the
    factors that `factorize` finds. The result's `error`, relative to the decoded images coded
    anew, is that of the chosen texels. The same arguments give the same bits, whatever the
    number of threads.

    Raises `InvalidParameter` for a sample without factors, for an encoding that is of no use,
    or where memory does not do for the chosen texels; `InvalidBtf` where all texels look the
    same.
    """
    given = sample.factors
    if given is None:
        raise InvalidParameter(f"{sample.name}: it has no factors to code anew")
    checked(encoding)
    height, width, count = given.weights.shape
    flat = given.weights.reshape(-1, 1, count)
    few, _ = _drawn((flat.astype(np.float64) ** 2).sum(axis=(1, 2)), TEXELS)
    part = replace(
        sample, stack=FactorStack(replace(given, weights=flat[few])), factors=None, mask=None
    )
    found = factorize(
        part, rank=rank, encoding=encoding, oversample=_OVERSAMPLE, memory_mb=memory_mb,
        progress=between(progress, 0.0, 0.5),
    )  # fmt: skip
    if found.rank == 0:
        raise InvalidBtf(
            f"{sample.name}: coded as {encoding.name} it looks the same everywhere; there is no"
            " pattern"
        )
    if len(few) == len(flat):
        weights = found.weights.reshape(height, width, found.rank)
        return replace(found, weights=weights, notes=given.notes)
    tall, middle = _weights(given, found, between(progress, 0.5, 1.0))
    basis = found.basis.reshape(-1, found.rank)
    shift = np.empty((len(basis), 1), np.float32)
    turned(basis, np.ascontiguousarray(middle[:, None]), shift)
    weights, basis, singular = principal(tall, basis)
    return replace(
        found,
        weights=weights.reshape(height, width, -1),
        basis=basis.reshape(len(found.basis), 3, -1),
        mean=found.mean + shift.reshape(-1, 3),
        singular=singular,
        notes=given.notes,
    )


def _drawn(share: F8, most: int) -> tuple[I4, F8]:
    """Up to `most` places, rising, and how much each counts so that sums are kept.

    All, where there are no more. Else half of the choice is even and half goes by `share`, so
    that the few which hold a highlight or a small feature are among them; one at random from
    each of as many equal runs, as evenly repeated patterns would hide from an even choice.
    """
    count = len(share)
    if count <= most:
        return np.arange(count, dtype=np.int32), np.ones(count)
    chance = 0.5 / count + 0.5 * share / max(float(share.sum()), 1e-300)
    ends = np.cumsum(chance)
    places = (np.arange(most) + np.random.default_rng(0).random(most)) / most
    drawn = np.minimum(np.searchsorted(ends, places * ends[-1]), count - 1)
    chosen, times = np.unique(drawn, return_counts=True)
    return chosen.astype(np.int32), times / (most * chance[chosen])


def _weights(given: BtfFactors, found: BtfFactors, progress: Progress) -> tuple[F8, F8]:
    """Weights (N, K) f8 of all texels, less their mean, and that mean (K,), by least squares.

    For chosen rows of x = U w + m they are (Uᵀ S U)⁻¹ Uᵀ S (x - m), S being how much each counts.
    """
    leverage = (found.basis.astype(np.float64) ** 2).sum(axis=(1, 2))
    chosen, counts = _drawn(leverage, IMAGES)
    rows = found.basis[chosen].reshape(-1, found.rank).astype(np.float64)
    counted = rows * np.repeat(counts, 3)[:, None]
    stack = FactorStack(given)
    texels = stack.shape[1] * stack.shape[2]
    at_once = images_within(stack, BLOCK_MB)
    tall = np.zeros((-(-texels // LANES) * LANES, found.rank))
    mean = np.empty((len(chosen), 3))
    with ThreadPoolExecutor(cores()) as pool:
        for first in range(0, len(chosen), at_once):
            numbers = chosen[first : first + at_once]
            part = SubsetStack(stack, numbers)
            (block,) = CodedBlocks(part, found.encoding, pool, images=len(numbers), keep=True)
            right = np.zeros((block.tiles.shape[1], found.rank), np.float32)
            right[: 3 * len(numbers)] = counted[3 * first : 3 * (first + len(numbers))]

            def some(start: int, stop: int, tiles: F4 = block.tiles, right: F4 = right) -> None:
                up(tiles, right, start, stop, tall)

            share(pool, some, len(block.tiles), 1)
            mean[first : first + len(numbers)] = block.mean[: 3 * len(numbers)].reshape(-1, 3)
            progress((first + len(numbers)) / len(chosen), "factorising")
    gram = np.zeros((found.rank,) * 2)
    add_gram(rows * np.repeat(np.sqrt(counts), 3)[:, None], gram)
    squared, vectors = eigen(gram)
    kept = squared > _LEAST * squared[0]
    half = np.ascontiguousarray(vectors[:, kept] / np.sqrt(squared[kept]))
    inverse = product(half, half.T)
    off = (mean - found.mean[chosen]).reshape(1, -1)
    middle = product(product(off, counted), inverse)[0]
    return product(tall[:texels], inverse), middle
