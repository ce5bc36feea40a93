"""Several samples in one space of channels, so that any two of their texels have a distance.

The factors of a BTF are coordinates in a space of its own. Samples under the same directions
are images in one and the same space, though, and a common orthonormal basis of that space
makes Euclidean distances of coordinates those of the coded images, across samples as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from btfcore.btf.appearance import frontal_colours, quilting_sample
from btfcore.btf.factor.stack import FactorStack
from btfcore.btf.factor.symmetric import add_gram, eigen, product, turned
from btfcore.btf.recode import recode
from btfcore.btf.resample import Blend, blend, expected_error, resample, same_images
from btfcore.btf.sample import BtfFactors, BtfSample, Encoding
from btfcore.errors import InvalidBtf, InvalidParameter
from btfcore.progress import Progress, between, silent
from btfcore.types import F4, F8, Sample

LEAST = 1e-3  # share of a sample's variance that a direction of its own must carry
_ROUNDING = 1e-10  # share of the greatest below which a squared length is rounding


@dataclass(frozen=True, eq=False)
class _Space:
    """What is spanned so far: basis (C, K) f8, orthonormal, and its origin (C,) f8."""

    basis: F8
    origin: F8


def common_channels(
    samples: Sequence[BtfSample],
    *,
    rank: int = 40,
    memory_mb: float = 2048,
    progress: Progress = silent,
) -> tuple[tuple[Sample, ...], tuple[str, ...]]:
    """Return `samples` with channels (H, W, K) f4 of one space, K the same for all, and notes.

    BTFs: the root mean square distance of the images in the first sample's code, as
    `btfcore.btf.appearance.quilting_sample` has it within one sample. The first sample's
    channels are those of `quilting_sample`. Every further one has its coordinates in the space
    so far (its mean image included), then those in an orthonormal basis of what is left of it,
    principal directions first; directions that carry less than 0.1 % of its variance are left
    out (nine samples of 28–40 factors: 90 channels, distances within 0.3–0.5 % in the mean and
    2 % at most). So a sample's channels are the same bits whatever comes after it, but for zeros
    behind them. Samples without factors are factorised with the encoding of the first that has
    some. Those of another encoding than the first are coded anew (`btfcore.btf.recode`), those
    of other directions are interpolated at the first one's (`btfcore.btf.resample`), with a note
    that says how good that is.

    Pictures: their colours. A mixture, or BTFs of which one does not reach the first one's
    directions, or differs in whether the light's cosine is included: for all of them the sRGB
    colours seen from above, and a note that says why. Raises `InvalidParameter` where there is
    no sample, `InvalidBtf` as `quilting_sample` does.
    """
    if len(samples) == 0:
        raise InvalidParameter("no sample to find common channels for")
    why, blends = _fits(samples)
    if why is None and not samples[0].is_image:
        ready = factorised(samples, rank, memory_mb, between(progress, 0.0, 0.5))
        found, notes = [], []
        for number, (sample, onto) in enumerate(zip(ready, blends, strict=True)):
            done = [0.5 + 0.5 * (number + k) / len(ready) for k in (0, 1)]
            factors, told = _alike(
                sample, ready[0], onto, rank, memory_mb, between(progress, *done)
            )
            found.append(factors)
            notes += told
        return _joint(ready, found), tuple(notes)
    alike = all(sample.is_image for sample in samples)
    plain = tuple(_coloured(sample) for sample in samples)
    note = f"{why}: samples are compared by their colours seen from above"
    return plain, () if alike else (note,)


def _fits(samples: Sequence[BtfSample]) -> tuple[str | None, list[Blend | None]]:
    """Why the samples' images cannot be compared, or None; how to mix each one's for that.

    None in place of a mixture: the images are the first sample's, one by one.
    """
    first = samples[0]
    onto: list[Blend | None] = [None] * len(samples)
    for number, other in enumerate(samples[1:], 1):
        if first.is_image != other.is_image:
            one, two = (first, other) if first.is_image else (other, first)
            return f"{one.name} is a picture, {two.name} a BTF", onto
        if first.cosine != other.cosine:
            why = f"only one of {first.name} and {other.name} includes the light's cosine"
            return why, onto
        if not first.is_image and not same_images(first, other):
            try:
                onto[number] = blend(other, first)
            except InvalidBtf as error:
                return str(error), onto
    return None, onto


def _alike(
    sample: BtfSample,
    first: BtfSample,
    onto: Blend | None,
    rank: int,
    memory_mb: float,
    progress: Progress,
) -> tuple[BtfFactors, list[str]]:
    """Factors of a sample's images under the directions and in the code of the first, and notes."""
    factors, notes = _factors(sample), []
    if onto is not None:
        off = expected_error(sample, onto)
        factors = resample(sample, onto)
        if not onto.exact:
            about = f"about {100 * off:.2g} %" if np.isfinite(off) else "an unknown part"
            notes.append(
                f"{sample.name} has other directions than {first.name}: it is compared by images"
                f" interpolated at these, which are off by {about} of its contrast"
            )
    code = _factors(first).encoding
    if _meaning(factors.encoding) != _meaning(code):
        seen = replace(
            first, name=sample.name, stack=FactorStack(factors), mask=None, factors=factors
        )
        factors = recode(seen, code, rank=rank, memory_mb=memory_mb, progress=progress)
    return factors, notes


def _meaning(encoding: Encoding) -> Encoding:
    """Encoding with what its codes do not depend on left out."""
    return replace(encoding, epsilon=1.0) if encoding.name in ("linear", "sqrt") else encoding


def _factors(sample: BtfSample) -> BtfFactors:
    assert sample.factors is not None
    return sample.factors


def factorised(
    samples: Sequence[BtfSample],
    rank: int = 40,
    memory_mb: float = 2048,
    progress: Progress = silent,
) -> list[BtfSample]:
    """BTFs with factors; those without get the encoding of the first that has some.

    Raises `InvalidBtf` for a sample that looks the same everywhere.
    """
    given = [sample.factors for sample in samples if sample.factors is not None]
    encoding: str | Encoding = given[0].encoding if given else "auto"
    ready = []
    for number, sample in enumerate(samples):
        if sample.factors is None:
            from btfcore.btf.factor.svd import factorize

            part = between(progress, number / len(samples), (number + 1) / len(samples))
            factors = factorize(
                sample, rank=rank, encoding=encoding, memory_mb=memory_mb, progress=part
            )
            sample = replace(sample, factors=factors)
            encoding = factors.encoding
        ready.append(sample)
        if _factors(sample).rank == 0:
            raise InvalidBtf(f"{sample.name}: it looks the same everywhere; there is no pattern")
    return ready


def _coloured(sample: BtfSample) -> Sample:
    colours = frontal_colours(sample)
    return Sample(sample.name, colours, colours, sample.tiles, sample.mask)


def _joint(samples: Sequence[BtfSample], found: Sequence[BtfFactors]) -> tuple[Sample, ...]:
    """Samples in one orthonormal space, by factors of the same images and encoding."""
    first, images = quilting_sample(samples[0]), samples[0].images
    columns = found[0].basis.reshape(-1, found[0].rank)
    space = _Space(columns.astype(np.float64), found[0].mean.reshape(-1).astype(np.float64))
    channels = [first.channels]
    pictures = [first]
    for sample, factors in zip(samples[1:], found[1:], strict=True):
        space, values = _added(space, factors, images)
        channels.append(values)
        pictures.append(_coloured(sample))
    most = space.basis.shape[1]
    out = []
    for picture, values in zip(pictures, channels, strict=True):
        padded = np.zeros((*values.shape[:2], most), np.float32)
        padded[..., : values.shape[2]] = values
        out.append(replace(picture, channels=padded))
    return tuple(out)


def _added(space: _Space, factors: BtfFactors, images: int) -> tuple[_Space, F4]:
    """Space that holds a further sample too, and the sample's channels (H, W, K) f4 in it.

    Coded images of a texel with factors w are B w + m. About the space's origin o and with
    M = (B, m - o), they are M (w, 1): Q Qᵀ M is what the space has, R = M - Q Qᵀ M what is
    left. An orthonormal basis of R's columns is turned to the principal directions of what
    the texels have in it (about o, so that a mean of its own is kept).
    """
    height, width, rank = factors.weights.shape
    own = factors.basis.reshape(-1, rank).astype(np.float64)
    offset = factors.mean.reshape(-1).astype(np.float64) - space.origin
    matrix = np.concatenate([own, offset[:, None]], axis=1)
    known = _crossed(space.basis, matrix)
    left = matrix - product(space.basis, known)
    # once more: what rounding left of the space in the rest
    again = _crossed(space.basis, left)
    known, left = known + again, left - product(space.basis, again)
    flat = np.ones((height * width, rank + 1), np.float32)
    flat[:, :rank] = factors.weights.reshape(-1, rank)
    moments = np.zeros((rank + 1, rank + 1))
    add_gram(flat, moments)
    moments /= len(flat)
    variance = float(np.diagonal(moments)[:rank].sum())
    rest = _principal(left, moments, LEAST * variance)
    basis = np.concatenate([space.basis, product(left, rest.directions)], axis=1)
    turn = np.concatenate([known, rest.coordinates]).T / np.sqrt(images)
    channels = np.empty((len(flat), turn.shape[1]), np.float32)
    turned(flat, np.ascontiguousarray(turn), channels)
    return _Space(basis, space.origin), channels.reshape(height, width, -1)


@dataclass(frozen=True, eq=False)
class _Rest:
    """directions (l, k): R times it is an orthonormal basis; coordinates (k, l): in it."""

    directions: F8
    coordinates: F8


def _principal(left: F8, moments: F8, least: float) -> _Rest:
    """Orthonormal basis of the columns of R = `left` (C, l) for the vectors R v.

    moments (l, l): mean of v vᵀ; directions whose mean square is at most `least` are left out.
    """
    gram = np.zeros((left.shape[1],) * 2)
    add_gram(np.ascontiguousarray(left), gram)
    squared, vectors = eigen(gram)
    kept = squared > _ROUNDING * max(float(squared[0]), 1.0)
    if not kept.any():
        return _Rest(np.zeros((left.shape[1], 0)), np.zeros((0, left.shape[1])))
    vectors, length = vectors[:, kept], np.sqrt(squared[kept])
    # N = R V / length is orthonormal, and R v = N (length Vᵀ v)
    inward = np.ascontiguousarray((vectors * length).T)
    energy = product(product(inward, moments), np.ascontiguousarray(inward.T))
    share, turn = eigen((energy + energy.T) / 2)
    turn = turn[:, share > least]
    if turn.shape[1]:
        peak = np.abs(turn).argmax(axis=0)
        turn = turn * np.where(turn[peak, np.arange(turn.shape[1])] < 0, -1.0, 1.0)
    turn = np.ascontiguousarray(turn)
    directions = product(np.ascontiguousarray(vectors / length), turn)
    return _Rest(directions, product(np.ascontiguousarray(turn.T), inward))


def _crossed(one: F8, two: F8) -> F8:
    """Transpose of `one` (C, k) times `two` (C, l)."""
    return product(np.ascontiguousarray(one.T), two)
