"""The factors of a BTF under another sample's directions.

Its functions of view and light are interpolated in the codes that they are in; the texels'
weights stay what they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from btfcore.btf.directions import angle_between
from btfcore.btf.factor.principal import principal
from btfcore.btf.factor.symmetric import add_gram, eigen
from btfcore.btf.interpolation.interpolator import prepare
from btfcore.btf.interpolation.pairs import Mixture, pair_weights
from btfcore.btf.sample import BtfFactors, BtfSample
from btfcore.errors import InvalidBtf
from btfcore.types import F8

SAME = 1e-3  # radians; directions nearer than that are one and the same
REACH = np.radians(5.0)  # beyond the outermost directions, where the nearest covered point counts
_ASKED = 32  # directions that are left out one by one, at most


@dataclass(frozen=True, eq=False)
class Blend:
    """Images of one sample as mixtures (image (J, m) i4, weight (J, m)) of another's.

    spread: of views and of lights, how far what is mixed lies from what is wanted: the mean over
    directions of Σ w |x - q|², squared; 0 where the images are the other's own.
    """

    mixture: Mixture
    spread: tuple[float, float]

    @property
    def exact(self) -> bool:
        """Whether each image is one of the other's, within `SAME`."""
        return max(self.spread) <= SAME**4


def same_images(one: BtfSample, two: BtfSample) -> bool:
    """Whether two samples have the same images: directions within 1e-3 radians, in one order."""
    pairs = ((one.views, two.views), (one.lights, two.lights))
    if any(a.shape != b.shape or bool((angle_between(a, b) > SAME).any()) for a, b in pairs):
        return False
    return np.array_equal(one.index, two.index)


def blend(sample: BtfSample, like: BtfSample) -> Blend:
    """Return the images of `like`, mixed from those of `sample`, as `pair_weights` mixes them.

    Raises `InvalidBtf` where directions of `like` lie more than 5 degrees beyond those of
    `sample`, or where all images are lacking that one would be mixed from.
    """
    view = _asked(sample, "view", sample.views, like.views)
    light = _asked(sample, "light", sample.lights, like.lights)
    pairs = like.pairs()
    views, lights = pairs[:, 0], pairs[:, 1]
    image, weight = pair_weights(
        sample, (view[0][views], view[1][views]), (light[0][lights], light[1][lights]),
        substitute=False,
    )  # fmt: skip
    lost = int((weight.sum(axis=1) == 0).sum())
    if lost:
        raise InvalidBtf(f"{sample.name} lacks the images near {lost} of {like.name}'s")
    spread = (
        float((_spread(sample.views, view, like.views) ** 2).mean()),
        float((_spread(sample.lights, light, like.lights) ** 2).mean()),
    )
    return Blend((image, weight), spread)


def resample(sample: BtfSample, onto: Blend) -> BtfFactors:
    """Return the factors of the images that `onto` mixes from those of `sample.factors`."""
    given = _factors(sample)
    image, weight = onto.mixture
    basis = np.zeros((len(image), 3, given.rank))
    mean = np.zeros((len(image), 3))
    for slot in np.flatnonzero(weight.any(axis=0)):
        share = weight[:, slot].astype(np.float64)
        basis += share[:, None, None] * given.basis[image[:, slot]]
        mean += share[:, None] * given.mean[image[:, slot]]
    flat = given.weights.reshape(-1, given.rank)
    weights, functions, singular = principal(flat, basis.reshape(-1, given.rank))
    return replace(
        given,
        weights=weights.reshape(*given.weights.shape[:2], -1),
        basis=functions.reshape(len(image), 3, -1),
        mean=mean.astype(np.float32),
        singular=singular,
        error=float("nan"),
    )


def expected_error(sample: BtfSample, onto: Blend) -> float:
    """Estimate how far the coded images of `resample` are off, RMS over that of the contrast.

    Directions are left out one by one and interpolated from the others. To second order the
    error of a mixture goes with Σ w |x - q|², by which it is carried over to those of `onto`.
    It says too little where highlights are narrower than the directions are apart. NaN where
    no direction can be left out.
    """
    if onto.exact:
        return 0.0
    given = _factors(sample)
    moments = np.zeros((given.rank,) * 2)
    add_gram(given.weights.reshape(-1, given.rank), moments)
    squared, vectors = eigen(moments)
    turn = vectors * np.sqrt(np.maximum(squared, 0))
    # images (J, 3 K) whose squared length is the contrast that a sample has in them
    rows = np.einsum("jck,kl->jcl", given.basis, turn).reshape(sample.images, -1)
    total = 0.0
    for at, wanted in enumerate(onto.spread):
        if wanted > 0:
            error, spread = _left_out(sample, rows, at)
            total += min(error * wanted / spread, error) if spread > 0 else float("nan")
    contrast = float((rows**2).sum()) / sample.images
    return float(np.sqrt(total / contrast)) if contrast > 0 else 0.0


def _left_out(sample: BtfSample, rows: F8, axis: int) -> tuple[float, float]:
    """Mean square error of images mixed from their neighbours', and of these' variance."""
    directions = (sample.views, sample.lights)[axis]
    index = sample.index if axis == 0 else sample.index.T
    errors, spreads, count = 0.0, 0.0, 0
    step = -(-len(directions) // _ASKED)
    for one in range(0, len(directions), step):
        others = np.delete(np.arange(len(directions)), one)
        if len(others) < 3:
            break
        net = prepare(directions[others])
        query = directions[one : one + 1]
        if net.clamped(query)[0]:
            continue
        mixture = net.weights(query)
        place, weight = mixture[0][0], mixture[1][0]
        used = index[others[place]]  # (m, L)
        known = (index[one] >= 0) & (used[weight > 0] >= 0).all(axis=0)
        guess = np.zeros((int(known.sum()), rows.shape[1]))
        for share, numbers in zip(weight, used, strict=True):
            if share > 0:
                guess += share * rows[numbers[known]]
        errors += float(((guess - rows[index[one][known]]) ** 2).sum())
        spread = float(_spread(directions[others], mixture, query)[0])
        spreads += spread**2 * len(guess)
        count += len(guess)
    return errors / max(count, 1), spreads / max(count, 1)


def _asked(sample: BtfSample, kind: str, own: F8, wanted: F8) -> Mixture:
    """Directions (n, m) of a sample that the wanted ones (n, 3) mix, and how much of each."""
    net = prepare(own)
    index, weight = net.weights(wanted)
    mixed = np.einsum("nm,nmc->nc", weight, own[index])
    mixed /= np.maximum(np.linalg.norm(mixed, axis=1, keepdims=True), 1e-12)
    beyond = np.where(net.clamped(wanted), angle_between(wanted, mixed), 0.0)
    if (beyond > REACH).any():
        raise InvalidBtf(
            f"{int((beyond > REACH).sum())} of {len(wanted)} {kind} directions lie up to"
            f" {np.degrees(beyond.max()):.0f} degrees beyond those of {sample.name}"
        )
    return index, weight


def _spread(directions: F8, mixture: Mixture, query: F8) -> F8:
    """How far (n,) the directions of mixtures lie from the queries (n, 3), in the mean square."""
    index, weight = mixture
    return np.einsum("nm,nmc->n", weight, (directions[index] - query[:, None]) ** 2)


def _factors(sample: BtfSample) -> BtfFactors:
    assert sample.factors is not None
    return sample.factors
