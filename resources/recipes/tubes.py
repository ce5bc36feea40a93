"""Fibres and stems: swept spheres drawn into a height map from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.types import F8
from resources.recipes.canvas import Canvas

_STEPS = 4096  # heights are compared in this part of a texel
_LIFT = 256.0  # so that heights down to -256 texels stay positive
_BITS = 26  # for the number of the sphere


@dataclass(frozen=True, eq=False)
class Drawn:
    """What is seen from above: height (texels) and number of the topmost sphere, -1 for none."""

    height: F8
    number: np.ndarray

    @property
    def covered(self) -> np.ndarray:
        """Where anything was drawn."""
        return self.number >= 0


def draw(canvas: Canvas, places: F8, radius: F8, floor: float) -> Drawn:
    """Draw spheres at `places` (n, 3) (row, column, height) of `radius` (n,), in texels.

    Periodic; where nothing is, the height is `floor`. A row of spheres less than half a
    drawing sample apart reads as a smooth tube.
    """
    side, fine = canvas.side, canvas.fine
    at = places[:, :2] * fine - 0.5
    near = np.round(at).astype(np.int64)
    rest = near - at
    key = np.full(side * side, -1, np.int64)
    reach = int(np.ceil(radius.max() * fine)) + 1
    size = radius * fine
    order = np.arange(len(places), dtype=np.int64)
    for down in range(-reach, reach + 1):
        for right in range(-reach, reach + 1):
            far = (rest[:, 0] + down) ** 2 + (rest[:, 1] + right) ** 2
            hit = np.flatnonzero(far < size**2)
            if not len(hit):
                continue
            top = places[hit, 2] + np.sqrt(size[hit] ** 2 - far[hit]) / fine
            level = ((top + _LIFT) * _STEPS).astype(np.int64)
            pixel = (near[hit, 0] + down) % side * side + (near[hit, 1] + right) % side
            np.maximum.at(key, pixel, (level << _BITS) | order[hit])
    number = np.where(key < 0, -1, key & ((1 << _BITS) - 1))
    height = np.where(key < 0, floor, (key >> _BITS) / _STEPS - _LIFT)
    return Drawn(height.reshape(side, side), number.reshape(side, side))


def frame(path: F8, closed: F8) -> tuple[F8, F8, F8]:
    """Tangent and two normals (m, 3) along paths (m, 3) of one strand, the last normal upward.

    closed : (3,) what is added to the path from its end back to its start (one period).
    """
    ahead = np.concatenate([path[1:], path[:1] + closed])
    behind = np.concatenate([path[-1:] - closed, path[:-1]])
    along = ahead - behind
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, [0.0, 0.0, 1.0])
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
    return along, side, np.cross(side, along)
