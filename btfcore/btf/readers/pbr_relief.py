"""What height and normal map say about each other: which is upside down.

"Depth" maps may be white in the pits, and normal maps come with green pointing up
(OpenGL) or down (DirectX); names often do not say. The slopes of the two maps do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.types import F4, F8

CERTAIN = 0.15  # |correlation| from which on the slopes' word counts
_CURL = 0.9  # ratio of the better to the worse curl below which integrability's word counts


@dataclass(frozen=True)
class Relief:
    """across : correlation of height and normal slopes along columns; up : along rows."""

    across: float
    up: float

    @property
    def inverted(self) -> bool | None:
        """Whether the height map is white in the pits; None where that cannot be told."""
        return self.across < 0 if abs(self.across) >= CERTAIN else None

    @property
    def flipped(self) -> bool | None:
        """Whether the normal map's green points down; None where that cannot be told."""
        if min(abs(self.across), abs(self.up)) < CERTAIN:
            return None
        return (self.across < 0) != (self.up < 0)


def compared(height: F4, normal: F4) -> Relief:
    """Correlate the slopes of a height map (H, W) with those of a normal map (H, W, 3)."""
    across, up = _gradient(height.astype(np.float64))
    p, q = slopes(normal)
    return Relief(_correlation(across, p), _correlation(up, q))


def curled(normal: F4) -> bool | None:
    """Whether a normal map's green points down, by itself; None where that cannot be told.

    Slopes of a surface are free of curl, ∂p/∂y = ∂q/∂x; with green the wrong way round they
    are not.
    """
    p, q = slopes(normal)
    one, other = _gradient(p)[1], _gradient(q)[0]
    right, wrong = float(((one - other) ** 2).mean()), float(((one + other) ** 2).mean())
    if min(right, wrong) >= _CURL * max(right, wrong):
        return None
    return wrong < right


@dataclass(frozen=True, eq=False)
class Settled:
    """Height, white nearest to the viewer, and normals, green up, and what was decided."""

    height: F4 | None
    normal: F4 | None
    notes: tuple[str, ...]


def settled(
    height: F4 | None, normal: F4 | None, *, green_down: bool | None, sure: bool, depth: bool
) -> Settled:
    """Turn height (H, W) and normals (H, W, 3), either may be None, the right way up.

    green_down : what the name says about the normal map, None where it says nothing; sure :
    whether that holds against what the slopes say. depth : the height map is called a depth.
    """
    notes: list[str] = []
    if normal is not None:
        seen = None if height is None else compared(height, normal).flipped
        ground = "its slopes and those of the height map"
        if seen is None:
            seen, ground = curled(normal), "its curl"
        down = green_down if sure or seen is None else seen
        if down != seen and seen is not None:
            notes.append(f"kept the normal map's green as its name says, though {ground} differ")
        elif down and green_down:
            notes.append("turned the normal map's green, which its name says points down")
        elif down:
            notes.append(f"turned the normal map's green, which by {ground} points down (DirectX)")
        elif green_down:
            notes.append(f"took the normal map's green to point up, by {ground}")
        if down:
            normal = normal * np.array([1, -1, 1], np.float32)
    if height is not None:
        inverted = None if normal is None else compared(height, normal).inverted
        if inverted is None:
            inverted = depth
            if depth:
                notes.append("inverted the depth map: by its name it is white in the pits")
        elif inverted:
            notes.append("inverted the height map: its slopes run against the normal map's")
        elif depth:
            notes.append("took the depth map as heights: its slopes agree with the normal map's")
        if inverted:
            height = 1 - height
    return Settled(height, normal, tuple(notes))


def slopes(normal: F4) -> tuple[F8, F8]:
    """Slopes ∂h/∂x along columns and ∂h/∂y up the picture that unit normals (H, W, 3) state."""
    z = np.maximum(normal[..., 2].astype(np.float64), 0.1)
    return -normal[..., 0] / z, -normal[..., 1] / z


def _gradient(values: F8) -> tuple[F8, F8]:
    """Central differences to the right and up, borders wrapped."""
    across = (np.roll(values, -1, 1) - np.roll(values, 1, 1)) / 2
    up = (np.roll(values, 1, 0) - np.roll(values, -1, 0)) / 2
    return across, up


def _correlation(one: F8, other: F8) -> float:
    one, other = one - one.mean(), other - other.mean()
    size = float(np.sqrt((one**2).sum() * (other**2).sum()))
    return float((one * other).sum()) / size if size > 1e-12 else 0.0
