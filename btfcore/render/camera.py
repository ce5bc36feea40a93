"""A camera on a turntable, and how it brings points into a picture.

Camera coordinates are right, up and depth (along the axis, positive in front). Pictures have
continuous pixel coordinates (column, row) from their upper left corner: the centre of the first
pixel is (½, ½).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from btfcore.types import F8

ANGLE = 28.0  # vertical field of view in degrees: long enough to leave proportions alone
STEEPEST = 89.0


@dataclass(frozen=True)
class Turntable:
    """Where the camera stands.

    azimuth, elevation : degrees, 0/0 looks from +z, azimuth turns towards +x; +y is up.
    focus : point looked at; distance : from there to the camera; both in world units.
    """

    azimuth: float = 30.0
    elevation: float = 18.0
    focus: tuple[float, float, float] = (0.0, 0.0, 0.0)
    distance: float = 5.0

    def axes(self) -> F8:
        """Rows: right, up and backwards (towards the camera), unit: (3, 3)."""
        a, e = np.radians(self.azimuth), np.radians(self.elevation)
        back = np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
        right = np.array([np.cos(a), 0.0, -np.sin(a)])
        return np.stack([right, np.cross(back, right), back])

    @property
    def position(self) -> F8:
        """Where the camera is."""
        return np.asarray(self.focus) + self.distance * self.axes()[2]

    @property
    def eye(self) -> F8:
        """Where the camera is in homogeneous coordinates: (4,) f8 with w = 1."""
        return np.append(self.position, 1.0)

    def local(self, points: F8) -> F8:
        """Camera coordinates (…, 3) f8 of points (…, 3): right, up and depth."""
        moved = np.asarray(points, np.float64) - self.position
        flipped = self.axes() * np.array([[1.0], [1.0], [-1.0]])
        return np.einsum("...j,ij->...i", moved, flipped)

    def pixels(self, points: F8, size: tuple[int, int]) -> F8:
        """Column, row and depth (…, 3) f8 of points in a picture of `size` (width, height).

        A point at a depth of 0 or less has no place: column and row are NaN.
        """
        local = self.local(points)
        focal = focal_length(size[1])
        depth = np.where(local[..., 2] > 0, local[..., 2], np.nan)
        column = size[0] / 2 + focal * local[..., 0] / depth
        row = size[1] / 2 - focal * local[..., 1] / depth
        return np.stack([column, row, local[..., 2]], axis=-1)

    def rays(self, places: F8, size: tuple[int, int]) -> F8:
        """Unit directions (…, 3) f8 in which the camera sees places (…, 2): column and row."""
        x = (places[..., 0] - size[0] / 2) / focal_length(size[1])
        y = (size[1] / 2 - places[..., 1]) / focal_length(size[1])
        local = np.stack([x, y, -np.ones_like(x)], axis=-1)
        away = np.einsum("...i,ij->...j", local, self.axes())
        return away / np.linalg.norm(away, axis=-1, keepdims=True)

    def orbited(self, right: float, up: float) -> Turntable:
        """Turn the object by degrees to the right and upwards, never over the top."""
        elevation = float(np.clip(self.elevation - up, -STEEPEST, STEEPEST))
        return replace(self, azimuth=(self.azimuth - right) % 360.0, elevation=elevation)

    def panned(self, right: float, up: float) -> Turntable:
        """Shift the picture by fractions of its height."""
        reach = 2 * self.distance * np.tan(np.radians(ANGLE / 2))
        x, y, _ = self.axes()
        focus = np.asarray(self.focus) - reach * (right * x + up * y)
        return replace(self, focus=_triple(focus))

    def zoomed(self, factor: float, *, nearest: float = 0.01, farthest: float = 100.0) -> Turntable:
        """Enlarge the picture by `factor`."""
        return replace(self, distance=float(np.clip(self.distance / factor, nearest, farthest)))

    def framing(self, points: F8, *, aspect: float, margin: float = 0.06) -> Turntable:
        """Look at `points` (n, 3) from the same side, filling a picture of width/height `aspect`.

        Exact: each of the four sides of the view pyramid is pushed until it touches a point;
        `margin` is the share of the picture left free at every side.
        """
        local = np.asarray(points, np.float64) @ self.axes().T
        x, y, z = local.T
        slope_y = np.tan(np.radians(ANGLE / 2)) * (1 - 2 * margin)
        slope_x = slope_y * aspect
        right, left = (x + slope_x * z).max(), (slope_x * z - x).max()
        above, below = (y + slope_y * z).max(), (slope_y * z - y).max()
        eye = max((right + left) / (2 * slope_x), (above + below) / (2 * slope_y))
        middle = (z.max() + z.min()) / 2
        focus = np.array([(right - left) / 2, (above - below) / 2, middle]) @ self.axes()
        distance = max(float(eye - middle), 1e-3)
        return replace(self, focus=_triple(focus), distance=distance)


def focal_length(height: int) -> float:
    """Distance in pixels of a picture `height` pixels tall from the eye."""
    return float(height / (2 * np.tan(np.radians(ANGLE / 2))))


def _triple(point: F8) -> tuple[float, float, float]:
    return float(point[0]), float(point[1]), float(point[2])
