"""Prepared interpolation between measured directions: which ones a query mixes, and how much."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from btfcore.btf.directions import HORIZON, repeated, to_angles
from btfcore.btf.interpolation.barycentric import barycentric_weights
from btfcore.btf.interpolation.grid import grid_weights, spread_pole
from btfcore.btf.interpolation.nearest import nearest_weights
from btfcore.btf.interpolation.rings import find_rings
from btfcore.btf.interpolation.triangulation import chart, triangulate
from btfcore.errors import InvalidParameter
from btfcore.types import F8, I4

METHODS = ("auto", "grid", "barycentric", "nearest4", "nearest")
_BEYOND = 1e-6  # radians past the outermost direction that are not worth a word


def prepare(directions: ArrayLike, method: str = "auto") -> DirectionInterpolator:
    """Prepare interpolation between unit vectors (D, 3) above the horizon.

    method : "grid" for directions on rings with evenly spaced azimuths (linear along and
    between the rings; continuous), "barycentric" for any (linear in a triangulated
    stereographic chart; continuous), "nearest4" (the papers' four nearest, weighted by
    1/angle²; jumps), "nearest" (one; jumps), or "auto": the grid where all rings have the same
    azimuths, else barycentric, which errs less where they differ (by 5 to 20 % on Bonn's 151
    directions) and more where they do not (by 7 to 20 % on 12 x 8). Of repeated directions
    the first counts. Raises `InvalidParameter`.
    """
    return DirectionInterpolator(directions, method)


class DirectionInterpolator:
    """Rings or triangles of a set of directions, found once and asked often.

    method : the one in use, never "auto". slots : how many directions `weights` names a query,
    nodes : how many `node_weights` does. Asking is safe from several threads at once.
    """

    def __init__(self, directions: ArrayLike, method: str = "auto") -> None:
        """See `prepare`."""
        given = np.array(directions, np.float64)
        _check(given, method)
        self.directions = given / np.linalg.norm(given, axis=1, keepdims=True)
        self.directions.flags.writeable = False
        again = {two for _, two in repeated(self.directions)}
        self._own = np.array([k for k in range(len(self.directions)) if k not in again], np.int32)
        self._rings = self._net = None
        if method in ("auto", "grid"):
            rings = find_rings(self.directions, self._own)
            if method == "grid" and isinstance(rings, str):
                raise InvalidParameter(f"these directions form no grid: {rings}")
            if isinstance(rings, str) or not (method == "grid" or rings.aligned):
                method = "barycentric"
            else:
                self._rings, method = rings, "grid"
        if method == "barycentric":
            self._net = triangulate(self.directions, self._own)
        self.method = method
        most = {"grid": 4, "barycentric": 3, "nearest4": 4, "nearest": 1}[method]
        self.nodes = min(most, len(self._own)) if method == "nearest4" else most
        made_up = self._rings is not None and not self._rings.pole
        self._pole = self._rings if made_up else None
        self.slots = max(4, len(self._pole.innermost)) if self._pole else self.nodes
        self._limit = float(to_angles(self.directions)[0].max()) + _BEYOND

    @property
    def mix(self) -> F8:
        """Nodes as mixtures of the directions, (D or D + 1, D) f8: see `node_weights`."""
        count = len(self.directions)
        if self._pole is None:
            return np.eye(count)
        mean = np.zeros(count)
        mean[self._pole.innermost] = 1 / len(self._pole.innermost)
        return np.vstack([np.eye(count), mean])

    def weights(self, query: ArrayLike) -> tuple[I4, NDArray[Any]]:
        """Directions (n, slots) i4 that each query (n, 3) mixes, and how much of each.

        The weights have the query's type if that is f4, else f8; they are at least 0 and sum
        to 1, or are all 0 below the horizon (z < -1e-4) and for what is no direction (zero,
        NaN); a query need not have length 1. Unused slots have weight 0 and name any direction.
        Beyond the outermost directions the nearest point of the covered part counts.
        """
        index, weight = self.node_weights(query)
        if self._pole is not None:
            return spread_pole(self._pole, index, weight)
        return index, weight

    def node_weights(self, query: ArrayLike) -> tuple[I4, NDArray[Any]]:
        """Like `weights`, for tables that were prepared: `mix` @ values at the directions.

        Nodes (n, nodes) i4 are the directions, and D where a grid without a direction on the
        normal needs one there: the first ring's mean. So a renderer reads 4 nodes a query,
        where `weights` has as many slots as the first ring has directions.
        """
        return self._asked(_vectors(query))[:2]

    def clamped(self, query: ArrayLike) -> NDArray[np.bool_]:
        """Whether each query (n, 3) lies above the horizon, but beyond the directions."""
        vectors = _vectors(query)
        _, weight, outside = self._asked(vectors)
        if self._net is None:  # rings and nearest directions part at the outermost angle
            outside = to_angles(vectors)[0] > self._limit
        return outside & (weight.sum(axis=1) > 0)

    def fade(self, query: ArrayLike) -> F8:
        """What the light of each query (n, 3) loses by lying beyond the directions, 0–1, f8.

        The cosine of its polar angle over that of the nearest covered point, which is read in
        its stead; 1 where nothing is clamped. Values that include the light's cosine, times
        this, go on continuously to black at the horizon.
        """
        vectors = _vectors(query)
        index, weight, _ = self._asked(vectors)
        beyond = self.clamped(vectors)
        held = np.full(len(vectors), np.cos(self._limit))
        if self._net is not None:  # its mixtures reproduce the chart
            place = np.einsum("nk,nkc->nc", weight, chart(self.directions)[index])
            squared = (place**2).sum(axis=1)
            held = (1 - squared) / (1 + squared)
        cosine = vectors[:, 2] / np.maximum(np.linalg.norm(vectors, axis=1), 1e-30)
        share = np.clip(cosine / np.maximum(held, 1e-9), 0, 1)
        return np.where(beyond, share, 1.0).astype(np.float64)

    def _asked(self, vectors: NDArray[Any]) -> tuple[I4, NDArray[Any], NDArray[np.bool_]]:
        index = np.empty((len(vectors), self.nodes), np.int32)
        weight = np.empty((len(vectors), self.nodes), vectors.dtype)
        outside = np.empty(len(vectors), bool)
        if self._net is not None:
            barycentric_weights(self._net, vectors, index, weight, outside)
        elif self._rings is not None:
            grid_weights(self._rings, vectors, index, weight)
        else:
            nearest_weights(self.directions, self._own, vectors, index, weight)
        return index, weight, outside


def _vectors(query: ArrayLike) -> NDArray[Any]:
    vectors = np.asarray(query)
    single = vectors.dtype == np.float32
    vectors = np.ascontiguousarray(vectors, np.float32 if single else np.float64)
    if vectors.ndim != 2 or vectors.shape[1] != 3:
        raise InvalidParameter(f"queries of shape {vectors.shape}, where (n, 3) is needed")
    return vectors


def _check(directions: F8, method: str) -> None:
    if method not in METHODS:
        raise InvalidParameter(
            f"there is no interpolation {method!r}; there are {', '.join(METHODS)}"
        )
    if directions.ndim != 2 or directions.shape[1] != 3 or len(directions) == 0:
        raise InvalidParameter(f"directions of shape {directions.shape}, where (D, 3) is needed")
    wrong = ~(np.abs(np.linalg.norm(directions, axis=1) - 1) < 1e-4)
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        raise InvalidParameter(f"direction {first}, {directions[first]}, is no unit vector")
    if (directions[:, 2] < HORIZON).any():
        first = int(np.argmin(directions[:, 2]))
        raise InvalidParameter(
            f"direction {first} lies below the horizon (z = {directions[first, 2]:.4f})"
        )
