"""Images that a view and a light mix: the product of their weights (Tong §5, "4 x 4")."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.directions import angle_between
from btfcore.btf.sample import BtfSample
from btfcore.types import I4

Mixture = tuple[I4, NDArray[Any]]


def pair_weights(
    sample: BtfSample, view: Mixture, light: Mixture, *, substitute: bool = True
) -> Mixture:
    """Images (n, a * b) i4 and weights (n, a * b) of n queries, lights running fastest.

    view (n, a), light (n, b) : what `DirectionInterpolator.weights` returned for the sample's
    views and for its lights; where either is black (all 0), so is the result. Images that the
    sample lacks get weight 0, and the others are raised so that the sum is 1 again. Where all
    are lacking, `substitute` takes the image that is nearest to the heaviest pair (least sum of
    the squared angles between the views and between the lights, the lowest number of equals)
    and without it all weights are 0. Renormalised and substituted values are not continuous.
    """
    count = len(view[0])
    image = sample.index[view[0][:, :, None], light[0][:, None, :]].reshape(count, -1)
    full = (view[1][:, :, None] * light[1][:, None, :]).reshape(count, -1)
    lit = full.sum(axis=1) > 0
    if sample.missing:
        weight = np.where(image >= 0, full, full.dtype.type(0))
        image = np.maximum(image, 0)
        total = weight.sum(axis=1, keepdims=True)
        weight = np.divide(weight, total, out=np.zeros_like(weight), where=total > 0)
        lost = np.flatnonzero(lit & (total[:, 0] == 0))
        if substitute and len(lost):
            near = nearest_images(sample, _heaviest(view, lost), _heaviest(light, lost))
            image[lost, 0] = near
            weight[lost, 0] = 1
        return image, weight
    return image, full


def _heaviest(mixture: Mixture, rows: NDArray[Any]) -> I4:
    """Direction of the greatest weight of each of the queries `rows`."""
    index, weight = mixture
    most = weight[rows].argmax(axis=1)[:, None]
    return np.asarray(np.take_along_axis(index[rows], most, axis=1)[:, 0], np.int32)


def nearest_images(sample: BtfSample, views: NDArray[Any], lights: NDArray[Any]) -> I4:
    """Image (n,) i4 nearest to each pair of numbers `views` (n,) and `lights` (n,).

    Least sum of the squared angles between the views and between the lights, the lowest number
    of equals.
    """
    wanted, back = np.unique(np.stack([views, lights], axis=1), axis=0, return_inverse=True)
    pairs = sample.pairs()
    found = np.empty(len(wanted), np.int32)
    for place, (one, two) in enumerate(wanted):
        apart = (
            angle_between(sample.views, sample.views[one])[pairs[:, 0]] ** 2
            + angle_between(sample.lights, sample.lights[two])[pairs[:, 1]] ** 2
        )
        found[place] = apart.argmin()
    return found[back.reshape(-1)]


def settled(image: I4, weight: NDArray[Any], *, least: float = 1e-7) -> Mixture:
    """Used images (m,) i4, rising, and weights (m,) f8 of one query: specks below `least` gone."""
    used, place = np.unique(image, return_inverse=True)
    total = np.bincount(place.reshape(-1), weight, len(used))
    kept = total > least
    return used[kept], total[kept] / max(total[kept].sum(), 1e-300)
