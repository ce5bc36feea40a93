"""Surfels whose truth can be traced: a sample laid on a plane, and round a sphere.

No quilting is involved. Rendering and truth look at the same positions of the sample, under
the same directions in the same frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.bake.relief import Relief
from btfcore.btf.directions import from_angles
from btfcore.render.lights import directional
from btfcore.render.material import Material
from btfcore.render.reference import local_lights, local_views, radiance
from btfcore.render.surfels import Surfels
from btfcore.types import F4, F8
from tests.bench.traced import traced


@dataclass(frozen=True, eq=False)
class Scene:
    """Surfels (n) that fill the pixels `shown` (rows, columns), seen from `eye` (4,) f8."""

    surfels: Surfels
    eye: F8
    shown: NDArray[np.bool_]

    def truth(self, relief: Relief, light: F8, corner: tuple[int, int] = (0, 0)) -> F4:
        """Radiance (n, 3) traced; `corner`: the relief's row and column of the sample's first."""
        every = np.arange(len(self.surfels))
        return traced(
            relief,
            self.surfels.source.astype(np.float64) + corner[::-1],
            local_views(self.surfels, every, self.eye),
            local_lights(self.surfels, every, light),
        )

    def rendered(self, material: Material, light: F8) -> F4:
        """Radiance (n, 3) by the reference."""
        return radiance([material], self.surfels, self.eye, directional(light))

    def picture(self, values: F4) -> F4:
        """Values (n, 3) in their pixels (rows, columns, 3), black around."""
        out = np.zeros((*self.shown.shape, 3), np.float32)
        out[self.shown] = values
        return out


def towards(elevation: float, azimuth: float) -> F8:
    """Unit vector (3,) of an elevation above the plane and an azimuth, in degrees."""
    return from_angles(np.radians(90 - elevation), np.radians(azimuth))


def seen_straight(shape: tuple[int, int], view: F8) -> Scene:
    """A sample flat on z = 0, one surfel a texel, all seen from the direction `view` (3,)."""
    scene = plane(shape, 90, 0)
    return Scene(scene.surfels, np.append(view, 0.0), scene.shown)


def plane(shape: tuple[int, int], elevation: float, azimuth: float) -> Scene:
    """A sample flat on z = 0, one surfel a texel, its longer edge 1 long.

    The eye stands above the middle's horizon by `elevation` at `azimuth` (degrees), 3 away, so
    that directions differ from texel to texel.
    """
    rows, columns = shape
    row, column = np.mgrid[:rows, :columns].reshape(2, -1).astype(np.float64)
    pitch = 1 / max(shape)
    position = np.stack([(column - columns / 2) * pitch, (rows / 2 - row) * pitch, 0 * row], axis=1)
    eye = np.append(towards(elevation, azimuth) * 3, 1.0)
    source = np.stack([column, row], axis=1)
    return Scene(_surfels(position, np.eye(3)[None], source), eye, np.ones(shape, bool))


def sphere(size: int, texels: float, *, whole: bool = False) -> Scene:
    """A ball of radius 1 seen from +z at infinity, as a picture of size × size pixels.

    One surfel a pixel. The sample runs round it by azimuth and up it by elevation, `texels` a
    radian; whole : every surfel takes the nearest texel's middle, so that nothing is
    interpolated between texels. The poles lie on the y axis.
    """
    row, column = np.mgrid[:size, :size].astype(np.float64)
    x, y = (column + 0.5) * 2 / size - 1, 1 - (row + 0.5) * 2 / size
    # the outermost thousandth of the radius belongs to pixels that the ball covers in part
    shown = x * x + y * y < 0.999**2
    x, y = x[shown], y[shown]
    z = np.sqrt(1 - x * x - y * y)
    normal = np.stack([x, y, z], axis=1)
    along = np.stack([z, 0 * z, -x], axis=1)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    frame = np.stack([along, np.cross(normal, along), normal], axis=1)
    source = np.stack([np.arctan2(x, z), -np.arcsin(y)], axis=1) * texels
    if whole:
        source = np.rint(source)
    return Scene(_surfels(normal, frame, source), np.array([0.0, 0.0, 1.0, 0.0]), shown)


def slope(size: int, texels: float, elevation: float) -> Scene:
    """The plane z = 0 in perspective, as a picture of size × size pixels.

    The eye looks at the origin from `elevation` degrees above −y; `texels` of the sample are a
    unit, of which about 1.2 are across the picture's middle.
    """
    away = towards(elevation, -90)
    eye = 2.5 * away
    right = np.array([1.0, 0.0, 0.0])
    up = np.cross(away, right)
    row, column = np.mgrid[:size, :size].astype(np.float64)
    x, y = ((column + 0.5) * 2 / size - 1) * 0.25, (1 - (row + 0.5) * 2 / size) * 0.25
    ray = x[..., None] * right + y[..., None] * up - away
    far = eye[2] / np.maximum(-ray[..., 2], 1e-9)
    point = eye + far[..., None] * ray
    shown = (ray[..., 2] < 0) & (np.abs(point[..., 1]) < 4)
    here = point[shown]
    source = here[:, :2] * [texels, -texels]
    return Scene(_surfels(here, np.eye(3)[None], source), np.append(eye, 1.0), shown)


def _surfels(position: F8, frame: F8, source: F8) -> Surfels:
    count = len(position)
    return Surfels(
        position.astype(np.float32),
        np.broadcast_to(frame, (count, 3, 3)).astype(np.float32),
        source.astype(np.float32),
        np.zeros(count, np.uint16),
    )
