"""Orders images by the view and light that they were taken under."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from btfcore.btf import directions
from btfcore.errors import InvalidBtf
from btfcore.types import F8, I4, I8, Frozen

_SAME = 2e-5  # radians; what `BtfSample` takes as one direction, and a margin


@dataclass(frozen=True, eq=False)
class Conditions(Frozen):
    """views (V, 3) and lights (L, 3) f8, rings outwards, each by azimuth; index (V, L) i4.

    order (J,) i8: which of the images given is number j; missing: pairs without one.
    """

    views: F8
    lights: F8
    index: I4
    order: I8

    @property
    def missing(self) -> int:
        """Pairs of view and light without an image."""
        return int((self.index < 0).sum())


def from_angles(theta: ArrayLike, phi: ArrayLike) -> F8:
    """Unit vectors (n, 3) of polar angles and azimuths in degrees (from +column towards up)."""
    return directions.from_angles(np.radians(theta), np.radians(phi))


def to_angles(vectors: F8) -> F8:
    """Polar angle 0–180 and azimuth 0–360 in degrees, (n, 2), of unit vectors (n, 3)."""
    polar, azimuth = directions.to_angles(vectors)
    phi = np.degrees(azimuth) % 360
    return np.stack(
        [np.degrees(polar), np.where((polar < _SAME) | (phi > 360 - 1e-6), 0.0, phi)], axis=1
    )


def arrange(views: F8, lights: F8, names: Sequence[str]) -> Conditions:
    """Order images by conditions: views, lights (J, 3) f8 unit vectors and name of each.

    Directions closer than 2e-5 rad are one. Raises `InvalidBtf` where two images show the
    same view and light, naming both.
    """
    view_list, view = distinct(views)
    light_list, light = distinct(lights)
    index = np.full((len(view_list), len(light_list)), -1, np.int64)
    place = np.full_like(index, -1)
    for number, pair in enumerate(zip(view.tolist(), light.tolist(), strict=True)):
        if place[pair] >= 0:
            repeated = len(names) - len(set(zip(view.tolist(), light.tolist(), strict=True)))
            raise InvalidBtf(
                f"{names[number]} and {names[place[pair]]} show the same condition, view"
                f" {said(view_list[pair[0]])} and light {said(light_list[pair[1]])};"
                f" {repeated} images in all repeat another's"
            )
        place[pair] = number
    return renumbered(view_list, light_list, place)


def renumbered(views: F8, lights: F8, place: NDArray[np.int64]) -> Conditions:
    """Conditions from a table (V, L) of the images given, -1 where there is none."""
    index = np.full(place.shape, -1, np.int32)
    there = place >= 0
    index[there] = np.arange(there.sum())
    return Conditions(views, lights, index, place[there])


def distinct(vectors: F8) -> tuple[F8, I8]:
    """Directions without repetitions, rings outwards, and which of them each one is."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    exact, back = np.unique(vectors, axis=0, return_inverse=True)
    pairs = cKDTree(exact).query_pairs(_SAME, output_type="ndarray")
    size = (len(exact), len(exact))
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=size)
    count, label = connected_components(graph, directed=False)
    first = np.zeros(count, np.int64)
    first[label[::-1]] = np.arange(len(exact))[::-1]
    kept = exact[first]
    angles = np.round(to_angles(kept), 4)
    rank = np.lexsort((angles[:, 1], angles[:, 0]))
    place = np.empty(count, np.int64)
    place[rank] = np.arange(count)
    return kept[rank], place[label[back.reshape(-1)]]


def said(direction: F8) -> str:
    """A direction in a user's words."""
    theta, phi = to_angles(direction[None])[0]
    return f"θ={theta:.4g}° φ={phi:.4g}°"


def missing_note(conditions: Conditions) -> tuple[str, ...]:
    """Say how many conditions have no image, and which are the first."""
    if not conditions.missing:
        return ()
    view, light = np.nonzero(conditions.index < 0)
    some = [
        f"view {said(conditions.views[v])} light {said(conditions.lights[at])}"
        for v, at in zip(view[:3], light[:3], strict=True)
    ]
    more = ", …" if conditions.missing > len(some) else ""
    total = conditions.index.size
    return (f"{conditions.missing} of {total} conditions have no image: {'; '.join(some)}{more}",)
