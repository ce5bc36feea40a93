"""An environment map as a few directional lights that together give all of its light.

The sphere is cut into regions and each becomes one light. The cuts halve what the lights get wrong
most: always the region with the greatest spread Σ w |d - c|² of its light is cut next, by the
plane across its longest axis (its first principal one) that leaves the least spread: the criterion
of Viriyothai and Debevec, "Variance minimization light probe sampling" (SIGGRAPH 2009 posters),
with free planes instead of straight ones in the picture. A small bright sun so takes one light,
where cuts into halves of equal energy (Debevec, "A median cut algorithm for light probe sampling",
2005) spend most of their lights on it. Nothing is random.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from btfcore.btf.harmonics.basis import LARGEST_ORDER, check_basis, functions
from btfcore.errors import InvalidParameter
from btfcore.render.env_harmonics import environment_harmonics, rotated_about_y
from btfcore.render.environment import (
    Environment,
    luminance,
    reduced,
    row_solid_angles,
    texel_directions,
    turned,
)
from btfcore.render.lights import NONE, Lights
from btfcore.types import F4, F8, I8, Frozen

MOST_LIGHTS = 4096
_WORKING_ROWS = 256  # of the map that is cut; 0.7 degrees each
_SWEEPS = 64


@dataclass(frozen=True, eq=False)
class LightTree(Frozen):
    """The regions that a map was cut into, coarse and fine: any number of lights from one tree.

    direction (T, 3) f8 unit, of the unturned map; energy (T, 3) f8: ∫ E dω of the region, for
    intensity 1; born, split (T,) i8: a region is one of the n lights where born < n ≤ split.
    radiance (H, 2H, 3) f4: the map, reduced for cutting.
    """

    direction: F8
    energy: F8
    born: I8
    split: I8
    radiance: F4

    @cached_property
    def harmonics(self) -> F8:
        """Coefficients (49, 3) of the map up to order 6; made when they are first asked for."""
        return environment_harmonics(Environment(self.radiance), LARGEST_ORDER)

    @property
    def most(self) -> int:
        """Greatest number of lights that it can give."""
        return int(self.born.max(initial=-1)) + 1

    def lights(
        self, count: int, *, rotation: float = 0.0, intensity: float = 1.0, order: int | None = None
    ) -> Lights:
        """`count` lights, or `most` where that is fewer; none for a black map.

        Their intensities add up to ∫ E dω / π whatever the count. order : of harmonics that go
        along, 0 … 6, None: none. Takes a millisecond, so that a moving scene can take few and
        one at rest many. Raises `InvalidParameter`.
        """
        if not 1 <= count <= MOST_LIGHTS:
            raise InvalidParameter(f"{count} lights for an environment; 1 to {MOST_LIGHTS} can be")
        taken = min(count, self.most)
        if taken == 0:
            return NONE
        chosen = (self.born < taken) & (taken <= self.split)
        direction = turned(self.direction[chosen], rotation)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        strength = self.energy[chosen] * (intensity / np.pi)
        if order is None:
            return Lights(direction, strength, sampled=taken)
        check_basis(order, "spherical")
        series = rotated_about_y(self.harmonics[: functions(order)] * intensity, rotation)
        return Lights(direction, strength, sampled=taken, harmonics=series)


def light_tree(environment: Environment, most: int = 1024) -> LightTree:
    """Cut a map, of whatever rotation and intensity, for up to `most` lights.

    Maps of more than 256 rows are reduced to these first, with their energy. Raises
    `InvalidParameter`.
    """
    if not 1 <= most <= MOST_LIGHTS:
        raise InvalidParameter(f"{most} lights for an environment; 1 to {MOST_LIGHTS} can be")
    radiance = reduced(environment.radiance, _WORKING_ROWS)
    height = len(radiance)
    angle = np.broadcast_to(row_solid_angles(height)[:, None], (height, 2 * height))
    weight = (luminance(radiance) * angle).ravel()
    lit = np.flatnonzero(weight > 0)
    directions = np.ascontiguousarray(texel_directions(height).reshape(-1, 3)[lit])
    energy = radiance.reshape(-1, 3)[lit] * angle.ravel()[lit, None]
    largest = weight.max(initial=0.0) or 1.0  # so that squares of faint light do not vanish
    direction, sums, born, split = _cut(directions, weight[lit] / largest, energy, most)
    return LightTree(direction, sums, born, split, radiance)


def environment_lights(environment: Environment, count: int, *, order: int | None = 4) -> Lights:
    """`count` directional lights in place of an environment (fewer for a map of fewer texels).

    order : of the map's harmonics that go along for what is rendered from harmonics; None:
    none. The same map gives the same bits; no seed is needed. Raises `InvalidParameter`.
    """
    return light_tree(environment, count).lights(
        count, rotation=environment.rotation, intensity=environment.intensity, order=order
    )


@njit(cache=True, nogil=True)
def _cut(directions, weight, energy, most):  # type: ignore[no-untyped-def]
    """Cut all texels into `most` regions; returns the fields of the tree."""
    texels = len(weight)
    slots = 2 * min(most, texels) - 1 if texels else 0
    direction, sums = np.zeros((slots, 3)), np.zeros((slots, 3))
    born = np.zeros(slots, np.int64)
    split = np.full(slots, np.int64(1) << 40, np.int64)
    begin, end = np.zeros(slots, np.int64), np.zeros(slots, np.int64)
    spread = np.full(slots, -1.0)
    order = np.arange(texels)
    keys, spare = np.empty(texels), np.empty(texels, np.int64)
    if slots:
        end[0] = texels
        spread[0] = _region(order, directions, weight, energy, 0, texels, direction[0], sums[0])
    made = 1
    for count in range(1, min(most, texels)):
        worst = 0
        for k in range(made):
            if split[k] > count and spread[k] > spread[worst]:
                worst = k
        if spread[worst] < 0.0:
            break
        low, high = begin[worst], end[worst]
        middle = _divide(order, directions, weight, low, high, direction[worst], keys, spare)
        split[worst] = count
        spread[worst] = -1.0
        for part in range(2):
            begin[made] = middle if part else low
            end[made] = high if part else middle
            born[made] = count
            spread[made] = _region(
                order, directions, weight, energy, begin[made], end[made],
                direction[made], sums[made],
            )  # fmt: skip
            made += 1
    return direction[:made], sums[:made], born[:made], split[:made]


@njit(cache=True, nogil=True)
def _region(order, directions, weight, energy, low, high, direction, sums):  # type: ignore[no-untyped-def]
    """Set mean direction and energy; return the spread, or -1 where nothing is left to cut."""
    mean, mass = np.zeros(3), 0.0
    for place in range(low, high):
        at = order[place]
        mass += weight[at]
        for k in range(3):
            mean[k] += weight[at] * directions[at, k]
            sums[k] += energy[at, k]
    length = np.sqrt((mean * mean).sum())
    if length > 1e-9 * mass:
        direction[:] = mean / length
    else:  # light from all sides alike: any of its directions
        direction[:] = directions[order[low]]
    if high - low < 2:
        return -1.0
    # Σ w |d - c|² = Σ w - |Σ w d|² / Σ w for unit directions
    return max(mass - length * length / mass, 0.0)


@njit(cache=True, nogil=True)
def _divide(order, directions, weight, low, high, middle, keys, spare):  # type: ignore[no-untyped-def]
    """Sort the texels of a region along its longest axis and return where to cut it."""
    mass, mean, moment = 0.0, np.zeros(3), np.zeros((3, 3))
    for place in range(low, high):
        at = order[place]
        mass += weight[at]
        for i in range(3):
            mean[i] += weight[at] * (directions[at, i] - middle[i])
    mean /= mass
    for place in range(low, high):
        at = order[place]
        for i in range(3):
            for j in range(3):
                moment[i, j] += (
                    weight[at]
                    * (directions[at, i] - middle[i] - mean[i])
                    * (directions[at, j] - middle[j] - mean[j])
                )
    axis = _longest(moment)
    for place in range(low, high):
        at = order[place]
        keys[place - low] = (
            directions[at, 0] * axis[0] + directions[at, 1] * axis[1] + directions[at, 2] * axis[2]
        )
    ranks = np.argsort(keys[: high - low], kind="mergesort")
    for place in range(high - low):
        spare[place] = order[low + ranks[place]]
    order[low:high] = spare[: high - low]
    # least spread is greatest |Σ w d|² / Σ w, summed over both sides
    whole, whole_mass = np.zeros(3), 0.0
    for place in range(low, high):
        whole += weight[order[place]] * directions[order[place]]
        whole_mass += weight[order[place]]
    left, left_mass = np.zeros(3), 0.0
    best, found = -1.0, low + 1
    for place in range(low, high - 1):
        at = order[place]
        left += weight[at] * directions[at]
        left_mass += weight[at]
        right_mass = whole_mass - left_mass
        if not right_mass > 0.0:
            break
        gain = 0.0
        for k in range(3):
            gain += left[k] ** 2 / left_mass + (whole[k] - left[k]) ** 2 / right_mass
        if gain > best:
            best, found = gain, place + 1
    return found


@njit(cache=True, nogil=True)
def _longest(moment):  # type: ignore[no-untyped-def]
    """First principal axis of a symmetric (3, 3), by squaring it until one axis is left."""
    power = moment.copy()
    for _ in range(_SWEEPS):
        scale = power[0, 0] + power[1, 1] + power[2, 2]
        if not scale > 0.0:
            break
        power /= scale
        squared = np.zeros((3, 3))
        for i in range(3):
            for j in range(3):
                for k in range(3):
                    squared[i, j] += power[i, k] * power[k, j]
        power = squared
    best, axis = -1.0, np.array([1.0, 0.0, 0.0])
    for j in range(3):
        length = np.sqrt((power[:, j] ** 2).sum())
        if length > best and length > 0.0:
            best, axis = length, power[:, j] / length
    return axis
