"""Lights, grouped so that those of one azimuth share a horizon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.btf.bake.shade import LOWEST
from btfcore.types import F4, F8, I8, Frozen

_SAME = 1e-6  # radians between azimuths that are one


@dataclass(frozen=True, eq=False)
class Lamps(Frozen):
    """Lights (L, 3) f4, grouped by azimuth.

    way (L,) i8: group of each; steps (A, 2) f8: a unit step towards each group in columns and
    rows; tangent (L,) f4: of the elevation, whose sine is floored at 0.05; reach (A, 2) f8:
    from just below the least tangent of a group to the greatest.
    """

    lights: F4
    way: I8
    steps: F8
    tangent: F4
    reach: F8


def lamps(lights: F8) -> Lamps:
    """Group unit vectors (L, 3)."""
    flat = np.hypot(lights[:, 0], lights[:, 1])
    azimuth = np.where(flat < _SAME, 0, np.arctan2(lights[:, 1], lights[:, 0]))
    _, first, way = np.unique(
        np.rint(azimuth / _SAME).astype(np.int64), return_index=True, return_inverse=True
    )
    steps = np.stack([np.cos(azimuth[first]), -np.sin(azimuth[first])], axis=1)
    tangent = np.maximum(lights[:, 2], LOWEST) / np.maximum(flat, _SAME)
    reach = np.full((len(first), 2), [np.inf, 0.0])
    np.minimum.at(reach[:, 0], way, tangent)
    np.maximum.at(reach[:, 1], way, tangent)
    reach[:, 0] *= 1 - 1e-6  # at this horizon all lights of the group still shine
    single = lights.astype(np.float32)
    return Lamps(single, way.astype(np.int64), steps, tangent.astype(np.float32), reach)
