"""Images of strokes and stamps in mirrors and around an axis."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from btfcore.paint.edits import Area, StampEdit, Stroke, Symmetry
from btfcore.paint.locate import Locator
from btfcore.types import F8, Field, Mesh

SAME = 1e-4  # images nearer to each other than this share of the diagonal are one


def transforms(symmetry: Symmetry) -> tuple[F8, ...]:
    """Orthogonal matrices (3, 3) of all images about the symmetry's origin, identity first.

    All combinations of the mirrors, each in all radial copies; none twice.
    """
    mirrors = [
        np.diag([-1.0 if axis in chosen else 1.0 for axis in "xyz"])
        for count in range(len(symmetry.mirror) + 1)
        for chosen in combinations(symmetry.mirror, count)
    ]
    kept: list[F8] = []
    for copy in range(symmetry.radial):
        turn = _turn("xyz".index(symmetry.axis), copy / symmetry.radial)
        for mirror in mirrors:
            image = turn @ mirror
            if not any(np.allclose(image, other, atol=1e-9) for other in kept):
                kept.append(image)
    return tuple(kept)


def origin_of(symmetry: Symmetry, mesh: Mesh) -> F8:
    """Point (3,) through which mirrors and axis go: by default the bounding box's middle."""
    if symmetry.origin is not None:
        return np.array(symmetry.origin, np.float64)
    return np.asarray((mesh.vertices.max(axis=0) + mesh.vertices.min(axis=0)) / 2)


def stroke_images(
    strokes: tuple[Stroke, ...], symmetry: Symmetry, mesh: Mesh, locator: Locator
) -> tuple[tuple[Stroke, ...], int]:
    """Return strokes with their images, and how many images were left out.

    The strokes come first, then all of their first images, and so on; normals are mirrored
    along. An image that lies on its stroke or on another of its images is dropped, run through
    backwards or not. One of which no point lies near the surface is left out and counted.
    """
    if symmetry.plain:
        return strokes, 0
    origin, same = origin_of(symmetry, mesh), SAME * mesh.diagonal
    kept: list[Stroke] = list(strokes)
    known = [[stroke] for stroke in strokes]
    missed = 0
    for matrix in transforms(symmetry)[1:]:
        for stroke, images in zip(strokes, known, strict=True):
            normals = None if stroke.normals is None else _turned(stroke.normals, matrix)
            image = replace(
                stroke,
                points=origin + _turned(stroke.points - origin, matrix),
                normals=normals,
            )
            if any(_alike(image, other, same) for other in images):
                continue
            images.append(image)
            if (locator.nearest(image.points, normals).distance <= locator.tolerance).any():
                kept.append(image)
            else:
                missed += 1
    return tuple(kept), missed


def area_images(area: Area, symmetry: Symmetry, mesh: Mesh, locator: Locator) -> tuple[Area, int]:
    """Return an area with the images of its strokes, and how many images were left out.

    Faces, regions and vertices have no images.
    """
    strokes, missed = stroke_images(area.strokes, symmetry, mesh, locator)
    return (area if len(strokes) == len(area.strokes) else replace(area, strokes=strokes)), missed


def stamp_images(
    edit: StampEdit, mesh: Mesh, field: Field, locator: Locator
) -> tuple[tuple[StampEdit, ...], int]:
    """Return a stamp and its images as plain stamps, and how many images were left out.

    Point, normal and heading (the direction of the sample's +column axis) are mirrored; the
    sample is not: its -row axis stays to the left of the heading seen from outside, so writing
    remains readable. Rotations are given anew from the field at each image. Images on each
    other are dropped; those that find no surface that looks the mirrored way are left out and
    counted. Raises `InvalidEdit` where the stamp itself lies off the surface.
    """
    if edit.symmetry.plain:
        return (edit,), 0
    first = replace(edit, symmetry=Symmetry())
    origin, same = origin_of(edit.symmetry, mesh), SAME * mesh.diagonal
    point = np.array(edit.point, np.float64)
    normal = None if edit.normal is None else np.array(edit.normal, np.float64)
    here = int(locator.find(point, normal, what="the stamp").vertex[0])
    along, across, up = _frame(here, field, locator)
    angle = np.radians(edit.rotation)
    heading = np.cos(angle) * along + np.sin(angle) * across
    side = up if normal is None else normal
    kept, places, missed = [first], [(point, side)], 0
    for matrix in transforms(edit.symmetry)[1:]:
        there = origin + _turned(point - origin, matrix)
        facing = _turned(side, matrix)
        if any(
            np.linalg.norm(there - at) <= same and float((facing * look).sum()) > 0
            for at, look in places
        ):
            continue
        places.append((there, facing))
        feet = locator.nearest(there, facing)
        if not feet.distance[0] <= locator.tolerance:
            missed += 1
            continue
        along, across, _ = _frame(int(feet.vertex[0]), field, locator)
        wanted = _turned(heading, matrix)
        turned = np.degrees(np.arctan2((wanted * across).sum(), (wanted * along).sum()))
        kept.append(
            replace(
                first,
                point=_numbers(there),
                normal=_numbers(facing),
                rotation=float(turned),
            )
        )
    return tuple(kept), missed


def _turn(axis: int, share: float) -> F8:
    """Rotation by `share` of a full turn, counter-clockwise about a coordinate axis."""
    cos, sin = np.cos(2 * np.pi * share), np.sin(2 * np.pi * share)
    matrix = np.eye(3)
    one, two = (axis + 1) % 3, (axis + 2) % 3
    matrix[one, one] = matrix[two, two] = cos
    matrix[one, two], matrix[two, one] = -sin, sin
    return matrix


def _turned(vectors: F8, matrix: F8) -> F8:
    return np.einsum("ij,...j->...i", matrix, vectors)


def _alike(one: Stroke, two: Stroke, same: float) -> bool:
    """Whether two strokes cover the same, in the same or the opposite direction."""
    for order in (slice(None), slice(None, None, -1)):
        if (
            (np.linalg.norm(one.points - two.points[order], axis=1) <= same).all()
            and _near(one.pressure, two.pressure, order)
            and _near(one.normals, two.normals, order)
        ):
            return True
    return False


def _near(one: F8 | None, two: F8 | None, order: slice) -> bool:
    """Whether pressures are equal, or normals look the same way."""
    if one is None or two is None:
        return True
    if one.ndim == 1:
        return bool(np.allclose(one, two[order]))
    return bool(((one * two[order]).sum(axis=1) >= 0).all())


def _frame(vertex: int, field: Field, locator: Locator) -> tuple[F8, F8, F8]:
    """Field, its left and the normal at a dense vertex."""
    along = np.asarray(field.tangents[vertex], np.float64)
    up = np.asarray(locator.dense.normals[vertex], np.float64)
    return along, np.cross(up, along), up


def _numbers(vector: F8) -> tuple[float, float, float]:
    return float(vector[0]), float(vector[1]), float(vector[2])
