"""Rasteriser of a triangle mesh: which point of which face every sample of a picture shows.

Pixels have a regular grid of samples each. Corners are rounded to 1/256 of a sample, and edge
functions are integers with the top-left rule: a sample on an edge belongs to one of two faces,
never to both or neither. What lies on a face is found from its unrounded corners (Olano and
Greer 1997, "Triangle scan conversion using 2D homogeneous coordinates", §4), so barycentric
coordinates are right in perspective and need no interpolation through clipping.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from btfcore.errors import InvalidParameter
from btfcore.render.camera import Turntable, focal_length
from btfcore.types import F4, F8, I4, I8, Frozen

NEAREST = 1e-3  # depth in scene units in front of which nothing is drawn
LARGEST_SIDE = 16384  # pixels
LARGEST_PIXELS = 1 << 27
MOST_SAMPLES = 8  # along each side of a pixel
_STEPS = 256  # of rounded corners in a sample
_GUARD = float(1 << 20)  # samples from the picture's middle beyond which faces are cut off
_BAND = 1 << 19  # samples in a band


@dataclass(frozen=True, eq=False)
class GBuffer(Frozen):
    """What the samples of some rows show.

    face (h, w) i4, -1 where nothing is; bary (h, w, 2) f4: shares of the face's second and third
    corner; depth (h, w) f4 scene units along the camera's axis, infinite where nothing is.
    """

    face: I4
    bary: F4
    depth: F4


@dataclass(frozen=True, eq=False)
class Raster(Frozen):
    """A mesh as one camera sees it; rows of samples are drawn by `gbuffer`, in any order.

    points (n, 3) f8 camera coordinates; faces (m, 3) i4; corner (k, 3, 2) i8 rounded positions of
    what is left of the faces, all wound alike, and number (k,) i4 of which; focal: in samples.
    """

    points: F8
    faces: I4
    corner: I8
    number: I4
    size: tuple[int, int]
    samples: int
    focal: float

    @property
    def grid(self) -> tuple[int, int]:
        """Columns and rows of samples."""
        return self.size[0] * self.samples, self.size[1] * self.samples

    def bands(self) -> list[tuple[int, int]]:
        """Rows of pixels (first, last + 1) that are drawn at once; the same on every machine."""
        tall = max(1, _BAND // (self.size[0] * self.samples**2))
        height = self.size[1]
        return [(top, min(top + tall, height)) for top in range(0, height, tall)]


def check_size(size: tuple[int, int], samples: int) -> None:
    """Raise `InvalidParameter` for a picture that is too small or large to be drawn."""
    width, height = size
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        raise InvalidParameter(
            f"a picture of {width} x {height} pixels, each side may have 1 to {LARGEST_SIDE}"
        )
    if width * height > LARGEST_PIXELS:
        raise InvalidParameter(
            f"a picture of {width} x {height} pixels, at most {LARGEST_PIXELS:,} can be drawn"
        )
    if not 1 <= samples <= MOST_SAMPLES:
        raise InvalidParameter(
            f"{samples} samples along a pixel's side, 1 to {MOST_SAMPLES} can be"
        )


def raster(
    positions: F8,
    faces: I4,
    camera: Turntable,
    *,
    size: tuple[int, int],
    samples: int = 4,
    both_sides: bool = True,
) -> Raster:
    """Prepare a mesh, positions (n, 3) in scene coordinates, to be drawn.

    size : width and height in pixels. samples : along each side of a pixel. both_sides : draw
    faces that are seen from behind, needed where a mesh is open. Parts nearer than `NEAREST` are
    cut off. Raises `InvalidParameter` for sizes and positions.
    """
    check_size(size, samples)
    if not np.isfinite(positions).all():
        raise InvalidParameter(f"{int((~np.isfinite(positions)).sum())} positions are not finite")
    points = np.ascontiguousarray(camera.local(positions))
    wanted = np.ascontiguousarray(faces, np.int32)
    focal = focal_length(size[1] * samples)
    half = np.array([size[0] * samples / 2, size[1] * samples / 2])
    count = _project(points, wanted, focal, half, both_sides, np.empty((0, 3, 2), np.int64),
                     np.empty(0, np.int32))  # fmt: skip
    corner, number = np.empty((count, 3, 2), np.int64), np.empty(count, np.int32)
    _project(points, wanted, focal, half, both_sides, corner, number)
    return Raster(points, wanted, corner, number, size, samples, focal)


def gbuffer(drawn: Raster, first: int = 0, last: int | None = None) -> GBuffer:
    """Draw rows `first` … `last` - 1 of pixels, by default all; each has `samples` rows."""
    last = drawn.size[1] if last is None else last
    columns, rows = drawn.grid[0], (last - first) * drawn.samples
    face = np.full((rows, columns), -1, np.int32)
    bary = np.zeros((rows, columns, 2), np.float32)
    depth = np.full((rows, columns), np.inf)
    centre = np.array([drawn.grid[0] / 2, drawn.grid[1] / 2])
    _draw(
        drawn.corner, drawn.number, drawn.points, drawn.faces, drawn.focal, centre,
        first * drawn.samples, face, bary, depth,
    )  # fmt: skip
    return GBuffer(face, bary, depth.astype(np.float32))


# --- inside


@njit(cache=True, nogil=True)
def _side(point, plane, focal):  # type: ignore[no-untyped-def]
    """How far a point in camera coordinates is inside a plane: the near one, four far aside."""
    if plane == 0:
        return point[2] - NEAREST
    axis = 0 if plane < 3 else 1
    sign = 1.0 if plane % 2 == 1 else -1.0
    return _GUARD * point[2] - sign * focal * point[axis]


@njit(cache=True, nogil=True)
def _clip(polygon, count, other, focal):  # type: ignore[no-untyped-def]
    """Cut a polygon with all planes, in place; returns its number of corners (or 0)."""
    for plane in range(5):
        kept = 0
        outside = 0
        for index in range(count):
            if _side(polygon[index], plane, focal) < 0.0:
                outside += 1
        if outside == 0:
            continue
        if outside == count:
            return 0
        for index in range(count):
            here, ahead = polygon[index], polygon[(index + 1) % count]
            one, two = _side(here, plane, focal), _side(ahead, plane, focal)
            if one >= 0.0:
                other[kept] = here
                kept += 1
            if (one >= 0.0) != (two >= 0.0):
                # from inside outwards, so that neighbours find the same point to the last bit
                if one >= 0.0:
                    other[kept] = here + (ahead - here) * (one / (one - two))
                else:
                    other[kept] = ahead + (here - ahead) * (two / (two - one))
                kept += 1
        polygon[:kept] = other[:kept]
        count = kept
    return count


@njit(cache=True, nogil=True)
def _project(points, faces, focal, half, both_sides, corner, number):  # type: ignore[no-untyped-def]
    """Round the corners of what is visible of all faces; returns how many triangles that are.

    `corner` and `number` are filled as far as they reach: call once to count.
    """
    polygon, other = np.empty((9, 3)), np.empty((9, 3))
    flat = np.empty((9, 2), np.int64)
    total = 0
    for face in range(len(faces)):
        for k in range(3):
            polygon[k] = points[faces[face, k]]
        count = _clip(polygon, 3, other, focal)
        for k in range(count):
            scale = focal / polygon[k, 2] * _STEPS
            flat[k, 0] = np.int64(np.floor(half[0] * _STEPS + polygon[k, 0] * scale + 0.5))
            flat[k, 1] = np.int64(np.floor(half[1] * _STEPS - polygon[k, 1] * scale + 0.5))
        for k in range(1, count - 1):
            ax, ay = flat[0]
            bx, by = flat[k]
            cx, cy = flat[k + 1]
            area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
            if area == 0 or (area > 0 and not both_sides):  # rows run down: outside is negative
                continue
            if min(ax, bx, cx) > 2 * half[0] * _STEPS or max(ax, bx, cx) < 0:
                continue
            if min(ay, by, cy) > 2 * half[1] * _STEPS or max(ay, by, cy) < 0:
                continue
            if total < len(number):
                second, third = (k, k + 1) if area > 0 else (k + 1, k)
                corner[total, 0] = flat[0]
                corner[total, 1] = flat[second]
                corner[total, 2] = flat[third]
                number[total] = face
            total += 1
    return total


@njit(cache=True, nogil=True)
def _span(corner, row, columns):  # type: ignore[no-untyped-def]
    """First and last column of the samples of a row inside a triangle of positive area."""
    low, high = 0, columns - 1
    half = _STEPS // 2
    y = row * _STEPS + half
    for k in range(3):
        ax, ay = corner[k]
        bx, by = corner[(k + 1) % 3]
        dx, dy = bx - ax, by - ay
        value = dx * (y - ay) - dy * (half - ax)  # at the first column's sample
        least = 0 if dy < 0 or (dy == 0 and dx > 0) else 1  # top and left edges are inside
        step = -dy * _STEPS
        if step > 0:
            low = max(low, -((value - least) // step))
        elif step < 0:
            high = min(high, (value - least) // -step)
        elif value < least:
            return 1, 0
    return low, high


@njit(cache=True, nogil=True)
def _draw(corner, number, points, faces, focal, centre, top, face, bary, depth):  # type: ignore[no-untyped-def]
    rows, columns = face.shape
    for each in range(len(number)):
        highest = min(corner[each, 0, 1], corner[each, 1, 1], corner[each, 2, 1])
        lowest = max(corner[each, 0, 1], corner[each, 1, 1], corner[each, 2, 1])
        first = max(top, (highest - _STEPS // 2) // _STEPS)
        last = min(top + rows - 1, (lowest + _STEPS // 2) // _STEPS)
        if first > last:
            continue
        which = number[each]
        a, b, c = points[faces[which, 0]], points[faces[which, 1]], points[faces[which, 2]]
        one, two, three = _cross(b, c), _cross(c, a), _cross(a, b)
        solid = a[0] * one[0] + a[1] * one[1] + a[2] * one[2]
        near, far = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
        near = max(near, NEAREST)
        for row in range(first, last + 1):
            low, high = _span(corner[each], row, columns)
            y = (centre[1] - (row + 0.5)) / focal
            for column in range(low, high + 1):
                x = (column + 0.5 - centre[0]) / focal
                e1 = x * one[0] + y * one[1] + one[2]
                e2 = x * two[0] + y * two[1] + two[2]
                e3 = x * three[0] + y * three[1] + three[2]
                total = e1 + e2 + e3
                z = solid / total if total != 0.0 else near
                if not z >= near:  # rounding moved the sample off a face seen from its edge
                    z = near
                elif z > far:
                    z = far
                if z < depth[row - top, column]:
                    depth[row - top, column] = z
                    face[row - top, column] = which
                    if total < 0.0:
                        e1, e2, e3 = -e1, -e2, -e3
                    e1, e2, e3 = max(e1, 0.0), max(e2, 0.0), max(e3, 0.0)
                    total = e1 + e2 + e3
                    share = 1.0 / total if total > 0.0 else 0.0
                    bary[row - top, column, 0] = e2 * share
                    bary[row - top, column, 1] = e3 * share


@njit(cache=True, nogil=True)
def _cross(a, b):  # type: ignore[no-untyped-def]
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )
