"""What a BTF looks like as one picture, and what the quilting compares it by."""

from __future__ import annotations

import numpy as np

from btfcore.btf.colour import linear_to_srgb
from btfcore.btf.sample import BtfFactors, BtfSample
from btfcore.btf.weights import Weights, direction_weights
from btfcore.errors import InvalidBtf, InvalidParameter
from btfcore.progress import Progress, silent
from btfcore.types import F4, F8, Sample

# Light for pictures: from the upper left, 40 degrees off the normal.
_THETA, _PHI = np.radians(40), np.radians(135)
OBLIQUE = np.array([np.sin(_THETA) * np.cos(_PHI), np.sin(_THETA) * np.sin(_PHI), np.cos(_THETA)])

_LEAST = 1e-12  # squared lengths below this share of the greatest are rounding


def nearest_pair(sample: BtfSample, view: F8, light: F8) -> tuple[int, int]:
    """View and light of the image nearest to a pair of directions (3,), missing ones left out."""
    near = np.arccos(np.clip(sample.views @ view, -1, 1))[:, None]
    lit = np.arccos(np.clip(sample.lights @ light, -1, 1))[None, :]
    # the view decides first: a picture from aside is no picture from above
    distance = np.where(sample.index >= 0, near * 4 + lit, np.inf)
    place = int(np.argmin(distance))
    return place // len(sample.lights), place % len(sample.lights)


def frontal_colours(sample: BtfSample, *, light: F8 = OBLIQUE) -> F4:
    """sRGB-coded colours (H, W, 3) f4 of the sample seen from above under one light."""
    view, lit = nearest_pair(sample, np.array([0.0, 0.0, 1.0]), light)
    return linear_to_srgb(sample.image(view, lit))


def quilting_sample(
    sample: BtfSample,
    *,
    rank: int = 40,
    view_weights: Weights = None,
    light_weights: Weights = None,
    memory_mb: float = 2048,
    progress: Progress = silent,
) -> Sample:
    """Return what the quilting needs of a BTF: a picture, and channels to compare.

    The channels are the geometry maps times their singular values, so that distances are
    those of the (coded) BTF itself (Zhou §III-B). A sample that came factorised is not
    factorised again; an ordinary picture keeps its three colours. The mask is handed on.

    view_weights, light_weights : how much each direction counts in the distances, see
    `btfcore.btf.weights.direction_weights`; the square of a distance is then the mean over the
    images, weighted by their view's times their light's. Raises `InvalidParameter` for weights
    that cannot be used, `InvalidBtf` where nothing but a uniform colour is left to compare.
    """
    views = direction_weights(view_weights, sample.views, name=sample.name, kind="view")
    lights = direction_weights(light_weights, sample.lights, name=sample.name, kind="light")
    colours = frontal_colours(sample)
    if sample.is_image:
        return Sample(sample.name, colours, colours, sample.tiles, sample.mask)
    factors = sample.factors
    if factors is None:
        from btfcore.btf.factor.svd import factorize

        factors = factorize(sample, rank=rank, memory_mb=memory_mb, progress=progress)
    if factors.rank == 0:
        raise InvalidBtf(f"{sample.name}: it looks the same everywhere; there is no pattern")
    if views is None and lights is None:
        # per image, so that seams cost about what they cost in a picture's colours
        channels = factors.weights * np.float32(1 / np.sqrt(sample.images))
    else:
        channels = _weighted(sample, factors, views, lights)
    return Sample(sample.name, colours, channels, sample.tiles, sample.mask)


def _weighted(sample: BtfSample, factors: BtfFactors, views: F8 | None, lights: F8 | None) -> F4:
    """Channels (H, W, k) f4 whose distances are those of the weighted images, k ≤ K.

    Images differ between two texels by B times the difference of their factors (the mean is
    the same for both), so the squared distance is a form of Σ_j w_j B_jᵀ B_j =: V Λ Vᵀ, and the
    channels are the factors times V √Λ.
    """
    from btfcore.btf.factor.symmetric import add_gram, eigen, turned

    view, light = sample.pairs().T
    weight = np.ones(sample.images)
    for values, number in ((views, view), (lights, light)):
        if values is not None:
            weight *= values[number]
    total = float(weight.sum())
    if not total > 0:
        raise InvalidParameter(
            f"{sample.name}: view and light weights are 0 for all of its {sample.images} images"
        )
    rows = factors.basis.astype(np.float64) * np.sqrt(weight / total)[:, None, None]
    gram = np.zeros((factors.rank,) * 2)
    add_gram(rows.reshape(-1, factors.rank), gram)
    values, vectors = eigen(gram)
    kept = values > _LEAST * max(values[0], 0.0)
    if not kept.any():
        raise InvalidBtf(f"{sample.name}: under these weights it looks the same everywhere")
    vectors = vectors[:, kept]
    peak = np.abs(vectors).argmax(axis=0)
    signs = np.where(vectors[peak, np.arange(vectors.shape[1])] < 0, -1.0, 1.0)
    turn = np.ascontiguousarray(vectors * (signs * np.sqrt(values[kept])))
    flat = np.ascontiguousarray(factors.weights.reshape(-1, factors.rank))
    channels = np.empty((len(flat), turn.shape[1]), np.float32)
    turned(flat, turn, channels)
    return channels.reshape(*factors.weights.shape[:2], -1)
