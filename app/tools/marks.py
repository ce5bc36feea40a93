"""What a tool wants drawn over the view: values in world units, apart from how they are drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.types import F8, Frozen

Colour = tuple[int, int, int]  # 0–255
LIGHT: Colour = (255, 255, 255)


@dataclass(frozen=True, eq=False)
class Ring(Frozen):
    """A brush on the surface: a circle in its tangent plane.

    point (3,), normal (3,) unit, radius in world units. hardness : 0–1, share of the radius
    within which the brush is at full strength, drawn as a second ring where it is below 1.
    """

    point: F8
    normal: F8
    radius: float
    hardness: float = 1.0
    colour: Colour = LIGHT

    def circle(self, share: float = 1.0, corners: int = 64) -> F8:
        """Corners (n, 3) of the circle at a share of the radius; the first is repeated."""
        least = np.zeros(3)
        least[np.argmin(np.abs(self.normal))] = 1.0
        one = np.cross(self.normal, least)
        one /= max(float(np.linalg.norm(one)), 1e-300)
        two = np.cross(self.normal, one)
        angle = np.linspace(0, 2 * np.pi, corners + 1)[:, None]
        reach = share * self.radius
        return np.asarray(self.point + reach * (np.cos(angle) * one + np.sin(angle) * two))


@dataclass(frozen=True, eq=False)
class Line(Frozen):
    """A polyline (n, 3) in world units; `dashed`, and thick (in pixels) as asked."""

    points: F8
    colour: Colour = LIGHT
    dashed: bool = False
    thickness: float = 1.5


@dataclass(frozen=True, eq=False)
class Dots(Frozen):
    """Small discs at world positions (n, 3), `size` pixels across."""

    points: F8
    colour: Colour = LIGHT
    size: float = 8.0


@dataclass(frozen=True, eq=False)
class Arrows(Frozen):
    """Arrows from world positions `tails` (n, 3) to `heads` (n, 3)."""

    tails: F8
    heads: F8
    colour: Colour = LIGHT


@dataclass(frozen=True, eq=False)
class Label(Frozen):
    """A text beside a world position (3,)."""

    point: F8
    text: str


Mark = Ring | Line | Dots | Arrows | Label
Marks = tuple[Mark, ...]  # the first is drawn first


def points_of(mark: Mark) -> F8:
    """World positions (n, 3) that are drawn for a mark, without its thickness."""
    if isinstance(mark, Ring):
        return mark.circle()
    if isinstance(mark, Arrows):
        return np.concatenate([mark.tails, mark.heads]).reshape(-1, 3)
    return np.asarray(mark.point if isinstance(mark, Label) else mark.points).reshape(-1, 3)
