"""What a surface is lit by: directions and intensities in scene coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from btfcore.errors import InvalidParameter
from btfcore.types import F8, Frozen

BRIGHTEST = 1e30


@dataclass(frozen=True, eq=False)
class Lights(Frozen):
    """Directional lights, and what some of them stand for.

    direction (L, 3) f8: unit, towards the light; intensity (L, 3) f8 ≥ 0, linear Rec. 709. A
    light of intensity 1 gives the sample's own radiance: white diffuse facing it has radiance 1.
    sampled : the last so many stand for an environment of radiance E, with intensity E Δω / π
    for the solid angle Δω. harmonics (M, 3) f8: coefficients of that E over real spherical
    harmonics (`btfcore.btf.harmonics.basis.evaluate`, M = (order + 1)²), taken in their stead
    by what is given in harmonics itself; None: there are none.
    Raises `InvalidParameter` for wrong shapes, lengths and intensities.
    """

    direction: F8
    intensity: F8
    sampled: int = 0
    harmonics: F8 | None = None

    def __post_init__(self) -> None:
        """Check everything once."""
        count = len(self.direction)
        if self.direction.shape != (count, 3) or self.intensity.shape != (count, 3):
            raise InvalidParameter(
                f"lights of shapes {self.direction.shape} and {self.intensity.shape}, where (L, 3)"
                " is needed"
            )
        length = np.linalg.norm(self.direction, axis=1)
        wrong = ~(np.abs(length - 1) < 1e-6)
        if wrong.any():
            first = int(np.flatnonzero(wrong)[0])
            raise InvalidParameter(f"light {first}: a direction of length {length[first]:.6g}")
        bad = ~((self.intensity >= 0) & (self.intensity <= BRIGHTEST)).all(axis=1)
        if bad.any():
            first = int(np.flatnonzero(bad)[0])
            raise InvalidParameter(
                f"light {first}: intensity {self.intensity[first].tolist()}, where 0 to"
                f" {BRIGHTEST:g} can be"
            )
        if not 0 <= self.sampled <= count:
            raise InvalidParameter(f"{self.sampled} of {count} lights stand for an environment")
        if self.harmonics is not None:
            shape = self.harmonics.shape
            if len(shape) != 2 or shape[1] != 3 or int(np.sqrt(shape[0])) ** 2 != shape[0]:
                raise InvalidParameter(f"coefficients of an environment of shape {shape}")
        super().__post_init__()

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.direction)


NONE = Lights(np.zeros((0, 3)), np.zeros((0, 3)))


def directional(directions: ArrayLike, intensity: ArrayLike = 1.0) -> Lights:
    """Lights from directions (3,) or (L, 3) of any length but 0; `intensity` is broadcast.

    Raises `InvalidParameter`.
    """
    vectors = np.atleast_2d(np.asarray(directions, np.float64))
    largest = np.abs(vectors).max(axis=-1, keepdims=True)
    if not ((largest > 0) & (largest < np.inf)).all():
        raise InvalidParameter(f"lights {vectors.tolist()}: one of them has no direction")
    vectors = vectors / largest
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    strength = np.asarray(intensity, np.float64)
    if strength.ndim == 1 and len(strength) == len(vectors) and len(strength) != 3:
        strength = strength[:, None]  # one number a light
    return Lights(vectors, np.broadcast_to(strength, vectors.shape).copy())


def joined(lights: Sequence[Lights]) -> Lights:
    """All of several lights; only the last may hold an environment."""
    if not lights:
        return NONE
    *rest, last = lights
    if any(each.sampled or each.harmonics is not None for each in rest):
        raise InvalidParameter("only the last of several lights may be an environment")
    return Lights(
        np.concatenate([each.direction for each in lights]),
        np.concatenate([each.intensity for each in lights]),
        last.sampled,
        None if last.harmonics is None else last.harmonics.copy(),
    )


def alike(one: Lights, two: Lights) -> bool:
    """Whether two sets of lights are the same in all that counts."""
    if one is two:
        return True
    if one.harmonics is None or two.harmonics is None:
        if one.harmonics is not two.harmonics:
            return False
    elif not np.array_equal(one.harmonics, two.harmonics):
        return False
    pairs = ((one.direction, two.direction), (one.intensity, two.intensity))
    return one.sampled == two.sampled and all(np.array_equal(*pair) for pair in pairs)
