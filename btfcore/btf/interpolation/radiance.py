"""Reference evaluation of a sample: radiance under any view and light, read from its images."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from btfcore.btf.interpolation.interpolator import DirectionInterpolator, prepare
from btfcore.btf.interpolation.pairs import Mixture, pair_weights, settled
from btfcore.btf.interpolation.texels import bilinear
from btfcore.btf.sample import BtfSample
from btfcore.btf.stack import ImageStack, block_size
from btfcore.errors import InvalidParameter
from btfcore.types import F4, F8, I4

_BLOCK_MB = 64.0


def picture(
    sample: BtfSample,
    view: ArrayLike,
    light: ArrayLike,
    *,
    method: str = "auto",
    fade: bool = False,
) -> F4:
    """Radiance (H, W, 3) f4 of the whole sample under one view (3,) and one light (3,).

    Black where either lies below the horizon. The cosine of the light's polar angle is
    included, whether the images hold it or not. method : see `prepare`. fade : lights beyond
    the sample's own dim as they near the horizon (see `DirectionInterpolator.fade`) instead of
    staying as bright as the last of them. Raises `InvalidParameter`.
    """
    views, lights = _vectors(view, "view"), _vectors(light, "light")
    if len(views) != 1 or len(lights) != 1:
        raise InvalidParameter(f"{len(views)} views and {len(lights)} lights, where one can be")
    image, weight = _mixtures(sample, views, lights, method)
    whole = blended(sample.stack, *settled(image[0], weight[0]))
    return whole * _gain(sample, lights, method, fade)[0]


def radiance(
    sample: BtfSample,
    rows: ArrayLike,
    columns: ArrayLike,
    view: ArrayLike,
    light: ArrayLike,
    *,
    method: str = "auto",
    fade: bool = False,
) -> F4:
    """Radiance (n, 3) f4 at texel positions under directions of their own.

    rows, columns : (n,) positions, whole numbers at texel centres; between them bilinear,
    outside periodic where the sample tiles, else that of the border. view, light : (n, 3) or
    (3,) for all. Otherwise as `picture`, whose values this has at whole positions.
    """
    where = np.stack(
        np.broadcast_arrays(np.asarray(columns, float), np.asarray(rows, float)), axis=-1
    )
    if where.ndim != 2:
        raise InvalidParameter(f"rows and columns of shape {where.shape[:-1]}, not (n,)")
    count = len(where)
    views = np.broadcast_to(_vectors(view, "view"), (count, 3))
    lights = np.broadcast_to(_vectors(light, "light"), (count, 3))
    image, weight = _mixtures(sample, views, lights, method)
    out = np.zeros((count, 3))
    used = np.unique(image[weight > 0])
    step = block_size(sample.stack, budget_mb=_BLOCK_MB)
    for start in range(0, len(used), step):
        numbers = used[start : start + step]
        images = sample.stack.read(numbers)
        place = np.searchsorted(numbers, image)
        here = (numbers[np.minimum(place, len(numbers) - 1)] == image) & (weight > 0)
        for k, slot in enumerate(here.T):
            chosen = np.flatnonzero(slot)
            for number in np.unique(place[chosen, k]):
                rows_of = chosen[place[chosen, k] == number]
                values = bilinear(images[number][None], where[rows_of], tiles=sample.tiles)[0]
                out[rows_of] += weight[rows_of, k, None] * values
    return (out * _gain(sample, lights, method, fade)[:, None]).astype(np.float32)


def prepared(
    sample: BtfSample, method: str = "auto"
) -> tuple[DirectionInterpolator, DirectionInterpolator]:
    """Interpolators of the sample's views and of its lights; raises `InvalidParameter`."""
    found = []
    for kind, directions in (("views", sample.views), ("lights", sample.lights)):
        try:
            found.append(prepare(directions, method))
        except InvalidParameter as error:
            raise InvalidParameter(f"{sample.name}: {kind}: {error}") from error
    return found[0], found[1]


def blended(stack: ImageStack, numbers: I4, weight: F8) -> F4:
    """Weighted sum (H, W, 3) f4 of images; black for none."""
    _, height, width = stack.shape
    if len(numbers) == 1 and weight[0] == 1:
        return stack.read(numbers)[0]
    out = np.zeros((height, width, 3))
    step = block_size(stack, budget_mb=_BLOCK_MB)
    for start in range(0, len(numbers), step):
        part = slice(start, start + step)
        for share, image in zip(weight[part], stack.read(numbers[part]), strict=True):
            out += share * image
    return out.astype(np.float32)


def _mixtures(sample: BtfSample, views: F8, lights: F8, method: str) -> Mixture:
    """Images and weights (n, m) of n pairs of directions."""
    view, light = prepared(sample, method)
    return pair_weights(sample, view.weights(views), light.weights(lights))


def _gain(sample: BtfSample, lights: F8, method: str, fade: bool) -> F4:
    """What the images lack (n,): the cosine of the light's polar angle, or its fading."""
    if not sample.cosine:
        length = np.maximum(np.linalg.norm(lights, axis=1), 1e-300)
        return np.maximum(lights[:, 2] / length, 0).astype(np.float32)
    if not fade:
        return np.ones(len(lights), np.float32)
    return prepared(sample, method)[1].fade(lights).astype(np.float32)


def _vectors(directions: ArrayLike, kind: str) -> F8:
    vectors = np.array(directions, np.float64)
    vectors = vectors.reshape(1, -1) if vectors.ndim == 1 else vectors
    if vectors.ndim != 2 or vectors.shape[1] != 3:
        raise InvalidParameter(f"{kind} directions of shape {vectors.shape}, not (n, 3)")
    return vectors
