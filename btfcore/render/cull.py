"""Which surfels can be in a picture at all, so that no others need to be evaluated.

A picture draws the faces of the input mesh and reads the atlas bilinearly. So a surfel can show
only if one of the four texels around a point of a face that is seen holds it. Which faces touch
which surfels is found once; a frame then looks at faces only. What is left out cannot have been
seen: a texel may be read in no other way as long as there are no mip levels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.errors import InvalidParameter
from btfcore.render.surfels import Placement
from btfcore.types import F8, I4, I8, Atlas, Frozen

EDGE_ON = 1e-4  # sine below which a face that looks away still counts: pictures round
_REACH = 1.0 + 1e-3  # texels that bilinear reading reaches from a point, rounding included


@dataclass(frozen=True, eq=False)
class CullTable(Frozen):
    """Faces in scene coordinates and the surfels that a picture of each may read.

    vertices (V, 3) f8; faces (F, 3) i4; normal (F, 3) f8: unit, zero where a face has none;
    face k touches the surfels surfel[start[k]:start[k + 1]] (start (F + 1,) i8, surfel (T,) i4),
    of `count` in all.
    """

    vertices: F8
    faces: I4
    normal: F8
    start: I8
    surfel: I4
    count: int


def cull_table(atlas: Atlas, source: I4, place: Placement) -> CullTable:
    """Find the surfels of every face of `atlas.mesh`.

    source (size, size) i4: the surfel that each texel of the image shows
    (`btfcore.render.gutter.gutter_source`). Raises `InvalidParameter` for another size.
    """
    if source.shape != (atlas.size, atlas.size):
        raise InvalidParameter(
            f"a gutter of shape {source.shape} for an atlas of {atlas.size} x {atlas.size} texels"
        )
    points = place.to_scene(atlas.mesh.vertices)
    faces = np.ascontiguousarray(atlas.mesh.faces, np.int32)
    uv = np.ascontiguousarray(atlas.uv, np.float64)
    count = int(source.max()) + 1
    last = np.full(count, -1, np.int32)
    start = np.zeros(len(faces) + 1, np.int64)
    _touch(uv, source, last, start, np.zeros(0, np.int32))
    start = np.cumsum(start)
    surfel = np.empty(start[-1], np.int32)
    last[:] = -1
    _touch(uv, source, last, start, surfel)
    corner = points[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0, length, 1.0)[:, None]
    return CullTable(points, faces, normal, start, surfel, count)


def seen_faces(
    table: CullTable, eye: F8, *, two_sided: bool = False, projection: F8 | None = None
) -> NDArray[np.bool_]:
    """Which faces (F,) a picture from `eye` (4,) may show.

    two_sided : backs are seen too, as of open meshes, from inside, or where a near plane cuts.
    projection (4, 4) f8: scene to clip coordinates (a point is seen where no |coordinate|
    exceeds w, OpenGL); faces on the far side of one of the four sides of the picture are out.
    """
    eye = np.asarray(eye, np.float64)
    seen = np.ones(len(table.faces), bool)
    if not two_sided:
        _facing(table.vertices, table.faces, table.normal, eye, seen)
    if projection is not None:
        _inside(table.vertices, table.faces, np.asarray(projection, np.float64), seen)
    return seen


def seen_surfels(
    table: CullTable, eye: F8, *, two_sided: bool = False, projection: F8 | None = None
) -> I4:
    """Surfels (n,) i4, ascending, that a picture from `eye` may read; see `seen_faces`."""
    faces = seen_faces(table, eye, two_sided=two_sided, projection=projection)
    marks = np.zeros(table.count, np.uint8)
    out = np.empty(table.count, np.int32)
    found = _collect(faces, table.start, table.surfel, marks, out)
    return out[:found]


# --- kernels


@njit(cache=True, nogil=True)
def _touch(uv, source, last, start, surfel):  # type: ignore[no-untyped-def]
    """Count each face's surfels into start[face + 1], or list them where `surfel` has room.

    last (count,) i4, -1 at first: the face that named a surfel last.
    """
    height, width = source.shape
    for face in range(len(uv)):
        low_x, high_x = uv[face, :, 0].min() - _REACH, uv[face, :, 0].max() + _REACH
        low_y, high_y = uv[face, :, 1].min() - _REACH, uv[face, :, 1].max() + _REACH
        place = start[face]
        # clamped, as reading beyond the border takes the border's texels
        left, right = min(max(int(np.ceil(low_x)), 0), width - 1), min(int(high_x), width - 1)
        top, bottom = min(max(int(np.ceil(low_y)), 0), height - 1), min(int(high_y), height - 1)
        for row in range(top, max(bottom, top) + 1):
            for column in range(left, max(right, left) + 1):
                inner = 0 < row < height - 1 and 0 < column < width - 1
                if inner and _apart(uv, face, float(column), float(row)):
                    continue
                number = source[row, column]
                if last[number] == face:
                    continue
                last[number] = face
                if len(surfel):
                    surfel[place] = number
                    place += 1
                else:
                    start[face + 1] += 1


@njit(cache=True, nogil=True)
def _apart(uv, face, x, y):  # type: ignore[no-untyped-def]
    """Whether a line along an edge parts a face from the square that a texel is read in."""
    ax, ay = uv[face, 1, 0] - uv[face, 0, 0], uv[face, 1, 1] - uv[face, 0, 1]
    bx, by = uv[face, 2, 0] - uv[face, 0, 0], uv[face, 2, 1] - uv[face, 0, 1]
    turn = 1.0 if ax * by - ay * bx >= 0 else -1.0
    for k in range(3):
        px, py = uv[face, k, 0], uv[face, k, 1]
        dx, dy = uv[face, (k + 1) % 3, 0] - px, uv[face, (k + 1) % 3, 1] - py
        away = turn * (dx * (y - py) - dy * (x - px))
        if away < -_REACH * (abs(dx) + abs(dy)):
            return True
    return False


@njit(cache=True, nogil=True)
def _facing(vertices, faces, normal, eye, seen):  # type: ignore[no-untyped-def]
    for face in range(len(faces)):
        corner = faces[face, 0]
        x = eye[0] - eye[3] * vertices[corner, 0]
        y = eye[1] - eye[3] * vertices[corner, 1]
        z = eye[2] - eye[3] * vertices[corner, 2]
        along = normal[face, 0] * x + normal[face, 1] * y + normal[face, 2] * z
        away = along < -EDGE_ON * np.sqrt(x * x + y * y + z * z)
        if away:
            seen[face] = False


@njit(cache=True, nogil=True)
def _inside(vertices, faces, projection, seen):  # type: ignore[no-untyped-def]
    sides = np.zeros(len(vertices), np.uint8)
    for k in range(len(vertices)):
        x, y, z = vertices[k, 0], vertices[k, 1], vertices[k, 2]
        across = projection[0, 0] * x + projection[0, 1] * y + projection[0, 2] * z
        up = projection[1, 0] * x + projection[1, 1] * y + projection[1, 2] * z
        w = projection[3, 0] * x + projection[3, 1] * y + projection[3, 2] * z
        across, up, w = across + projection[0, 3], up + projection[1, 3], w + projection[3, 3]
        bits = 0
        if across < -w:
            bits |= 1
        if across > w:
            bits |= 2
        if up < -w:
            bits |= 4
        if up > w:
            bits |= 8
        sides[k] = bits
    for face in range(len(faces)):
        if sides[faces[face, 0]] & sides[faces[face, 1]] & sides[faces[face, 2]]:
            seen[face] = False


@njit(cache=True, nogil=True)
def _collect(seen, start, surfel, marks, out):  # type: ignore[no-untyped-def]
    for face in range(len(seen)):
        if seen[face]:
            for place in range(start[face], start[face + 1]):
                marks[surfel[place]] = 1
    found = 0
    for number in range(len(marks)):
        out[found] = number  # written always, kept where marked: no branch to guess
        found += marks[number]
    return found
