"""Images back from harmonics and components: for one view, between views, as a stack."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from btfcore.btf.directions import HORIZON
from btfcore.btf.harmonics.basis import evaluate, unit_directions
from btfcore.btf.harmonics.kernels import shade
from btfcore.btf.harmonics.values import HarmonicFactors
from btfcore.errors import InvalidParameter
from btfcore.types import F4, F8, I4


def harmonic_radiance(factors: HarmonicFactors, view: int, lights: ArrayLike) -> F4:
    """Radiance (n, H, W, 3) f4 ≥ 0 of view number `view` under unit `lights` (n, 3).

    A light below the horizon gives black. Raises `InvalidParameter` for a view that is not
    there and for lights that are no unit vectors.
    """
    return blended_radiance(factors, [view], [1.0], lights)


def blended_weights(factors: HarmonicFactors, views: ArrayLike, shares: ArrayLike) -> F4:
    """Weights W (H, W, K) f4 of a direction between views: Σ share_i W(view_i) (Furukawa §2).

    The function is linear in its weights, so that this is the paper's weighted sum of equation
    (1) for three views. views (n,) numbers, shares (n,) ≥ 0 that sum to 1 (to 1e-6). Raises
    `InvalidParameter` for others.
    """
    numbers, share = np.atleast_1d(np.asarray(views)), np.atleast_1d(np.asarray(shares, float))
    count = len(factors.weights)
    if numbers.shape != share.shape or numbers.ndim != 1:
        raise InvalidParameter(f"{factors.name}: {numbers.shape} views with {share.shape} shares")
    if not ((numbers >= 0) & (numbers < count)).all():
        raise InvalidParameter(f"{factors.name}: views {numbers.tolist()} out of 0 … {count - 1}")
    if not ((share >= 0).all() and abs(share.sum() - 1) < 1e-6):
        raise InvalidParameter(
            f"{factors.name}: shares {share.tolist()}, where some ≥ 0 that sum to 1 are needed"
        )
    out = np.zeros(factors.weights.shape[1:], np.float32)
    for number, part in zip(numbers, share, strict=True):
        out += np.float32(part) * factors.weights[number].astype(np.float32)
    return out


def blended_radiance(
    factors: HarmonicFactors, views: ArrayLike, shares: ArrayLike, lights: ArrayLike
) -> F4:
    """Radiance (n, H, W, 3) f4 ≥ 0 between views under unit `lights` (n, 3).

    Raises `InvalidParameter` as `blended_weights` and `harmonic_radiance` do.
    """
    directions = unit_directions(factors.name, lights)
    weights = blended_weights(factors, views, shares)
    return _images(factors, weights, directions)


class HarmonicStack:
    """Images of harmonic factors, made when they are read (`btfcore.btf.stack.ImageStack`).

    Image j is that of view pairs[j, 0] under lights[pairs[j, 1]].
    """

    def __init__(
        self, factors: HarmonicFactors, lights: ArrayLike, pairs: I4 | None = None
    ) -> None:
        """Hold `factors` for unit `lights` (L, 3); all pairs, light fastest, without `pairs`.

        Raises `InvalidParameter` for lights that are no unit vectors or pairs out of range.
        """
        self._factors = factors
        self._lights = unit_directions(factors.name, lights)
        count = (len(factors.weights), len(self._lights))
        self._pairs = np.indices(count).reshape(2, -1).T if pairs is None else np.asarray(pairs)
        if ((self._pairs < 0) | (self._pairs >= count)).any():
            raise InvalidParameter(
                f"{factors.name}: pairs out of {count[0]} views and {count[1]} lights"
            )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of images, rows, columns."""
        return len(self._pairs), *self._factors.shape

    @property
    def dear(self) -> bool:
        """Every image is computed anew."""
        return True

    def read(self, numbers: ArrayLike) -> F4:
        """Images `numbers` (n,) as (n, H, W, 3) f4 linear radiance."""
        pairs = self._pairs[np.asarray(numbers, np.int64)]
        out = np.empty((len(pairs), *self._factors.shape, 3), np.float32)
        for view in np.unique(pairs[:, 0]):
            here = np.flatnonzero(pairs[:, 0] == view)
            weights = self._factors.weights[view].astype(np.float32)
            out[here] = _images(self._factors, weights, self._lights[pairs[here, 1]])
        return out


def _images(factors: HarmonicFactors, weights: F4, lights: F8) -> F4:
    values = evaluate(lights, factors.order, factors.kind)
    values[lights[:, 2] < HORIZON] = 0
    colours = np.einsum("nm,kmc->nkc", values, factors.components)
    means = np.einsum("nm,mc->nc", values, factors.mean)
    flat = np.ascontiguousarray(weights.reshape(-1, factors.rank))
    out = np.empty((len(lights), len(flat), 3), np.float32)
    for number in range(len(lights)):
        shade(flat, colours[number], means[number], out[number])
    return out.reshape(len(lights), *factors.shape, 3)
