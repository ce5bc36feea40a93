"""What the kernels of `btfcore.render.lookup` find directions in: rings, triangles or points."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.interpolation.interpolator import DirectionInterpolator
from btfcore.btf.interpolation.rings import Rings
from btfcore.btf.interpolation.triangulation import chart
from btfcore.render.rows import locked
from btfcore.types import F4, F8, I4

_SAME, _WIDEST = 1e-6, 64  # radians, azimuths: rings that are searched by comparing with all
_FINEST = 4096  # bins of angles: so narrow that one holds a border at most, where that is enough


class Lookup(NamedTuple):
    """A `DirectionInterpolator` as kernels take it.

    way : 0 on rings, 1 in triangles, 2 by nearness. held : cosine of the outermost direction's
    polar angle. Rings: theta (R + 1,) f4, the last beyond all; ring (T,) i4: ring at the lower
    end of each of T even bins of the polar angle, `steep` of them a radian. phi (P,), inverse,
    member list each ring's azimuths from `origin` (R,) on and end with the first one again;
    at (A,) i4: place in them at the lower end of even bins of the azimuth, ring k having those
    from first_bin[k] on, pace[k] of them a radian. Where all rings have the same S azimuths,
    grid (R, S + 1) i4 holds them side by side, else it is (0, 1). Triangles: as in
    `Triangulation`, and the nodes' chart points. Nearness: points, own.
    """

    way: int
    held: np.float32
    theta: F4
    gap: F4
    ring: I4
    steep: np.float32
    origin: F4
    first_bin: I4
    pace: F4
    at: I4
    phi: F4
    inverse: F4
    member: I4
    grid: I4
    triangles: I4
    affine: F8
    edges: I4
    segment: F8
    low: F8
    scale: float
    side: int
    first: I4
    candidates: I4
    chart: F8
    points: F8
    own: I4
    slots: int


def lookup(directions: DirectionInterpolator) -> Lookup:
    """Return the interpolator's rings, triangles or points, laid out for the kernels."""
    net, rings = directions._net, directions._rings
    way = 1 if net is not None else 0 if rings is not None else 2
    none4, none8 = np.zeros((1, 3), np.int32), np.zeros((1, 6))
    around = _around(rings) if way == 0 and rings is not None else _around(_POLE)
    triangles: tuple[Any, ...] = (
        *(none4, none8, none4, none8, np.zeros(2), 1.0, 1, none4[0], none4[0]),
    )
    if net is not None:
        triangles = (
            *(net.triangles, net.affine, net.edges, net.segment),
            *(net.low, net.scale, net.side, net.first, net.candidates),
        )
    fields: list[Any] = [
        way,
        np.float32(max(np.cos(directions._limit), 1e-9)),
        *around,
        *triangles,
        chart(directions.directions),
        directions.directions[directions._own],
        directions._own,
        directions.nodes,
    ]
    return Lookup._make(locked(f) if isinstance(f, np.ndarray) else f for f in fields)


_POLE = Rings(
    np.zeros(1), np.array([0, 1], np.int32), np.zeros(1), np.zeros(1, np.int32), 1
)  # stands in where there are no rings


def _around(rings: Rings) -> tuple[Any, ...]:
    """Rings as the kernels take them: theta … member of `Lookup`."""
    theta = np.append(rings.theta, 8.0)
    ring, steep = _bins(theta, np.pi)
    origin, pace, first_bin = [], [], [0]
    phi: list[F8] = []
    inverse: list[F8] = []
    member: list[NDArray[Any]] = []
    place: list[NDArray[Any]] = []
    for one, two in zip(rings.start[:-1], rings.start[1:], strict=True):
        ends = np.append(rings.phi[one:two] - rings.phi[one], 2 * np.pi)
        bins, rate = _bins(np.append(ends[:-1], 8.0), 2 * np.pi)
        place.append(bins + sum(map(len, phi)))
        first_bin.append(first_bin[-1] + len(bins))
        inverse.append(np.append(1 / np.diff(ends) if two - one > 1 else [0.0], 0.0))
        member.append(np.append(rings.member[one:two], rings.member[one]))
        # the end of a ring is never walked past: nothing reaches its last border
        phi.append(np.append(ends[:-1], 8.0))
        origin.append(rings.phi[one])
        pace.append(rate)
    return (
        theta.astype(np.float32),
        (1 / np.diff(theta)).astype(np.float32),
        ring,
        np.float32(steep),
        np.array(origin, np.float32),
        np.array(first_bin[:-1], np.int32),
        np.array(pace, np.float32),
        np.concatenate(place).astype(np.int32),
        np.concatenate(phi).astype(np.float32),
        np.concatenate(inverse).astype(np.float32),
        np.concatenate(member).astype(np.int32),
        _grid(rings, member),
    )


def _grid(rings: Rings, member: list[NDArray[Any]]) -> I4:
    """Members of all rings as a grid where their azimuths agree, else (0, 1)."""
    around = [rings.phi[a:b] for a, b in zip(rings.start[1:-1], rings.start[2:], strict=True)]
    if not rings.aligned or not around or len(around[0]) > _WIDEST:
        return np.zeros((0, 1), np.int32)
    if max(np.abs(phi - around[0]).max() for phi in around) > _SAME:
        return np.zeros((0, 1), np.int32)
    pole = np.repeat(member[0][:1], len(around[0]) + 1)
    return np.array([pole, *member[1:]], np.int32)


def _bins(borders: F8, end: float) -> tuple[I4, float]:
    """Segment at the lower end of even bins over 0 … `end`, and how many bins a unit has."""
    least = float(np.diff(borders[:-1]).min(initial=end))
    count = int(min(np.ceil(1.05 * end / least), _FINEST))
    # one more than needed, as rounding may reach past the end
    lower = np.arange(count + 1) * (end / count) * (1 - 1e-6) - 1e-6
    found = np.searchsorted(borders, lower, side="right") - 1
    return np.maximum(found, 0).astype(np.int32), count / end
