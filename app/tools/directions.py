"""From a line drawn on the surface to directions of the field, and what of a field is shown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from btfcore.types import F8, DenseMesh, Field, Frozen

SHOWN = 160  # arrows of a field
LENGTH = 0.6  # of their distance
LEAST = 12  # vertices from which curvature is told
CLEAR = 0.2  # difference of the principal curvatures, over the larger, below which none is told


@dataclass(frozen=True, eq=False)
class Shown(Frozen):
    """Some of a field: arrows from tails (n, 3) to heads (n, 3), and singularities (S, 3)."""

    tails: F8
    heads: F8
    singularities: F8


def shown_of(dense: DenseMesh, field: Field, most: int = SHOWN) -> Shown:
    """About `most` arrows of a field, evenly spread over the surface."""
    points = np.asarray(dense.vertices, np.float64)
    gap = max(dense.step * np.sqrt(len(points) / most), 1e-300)
    chosen = spread(points, gap)
    while len(chosen) > 2 * most:  # many thin sheets
        gap *= 1.4
        chosen = spread(points, gap)
    tails = points[chosen] + 0.02 * gap * dense.normals[chosen]
    heads = tails + LENGTH * gap * field.tangents[chosen]
    return Shown(tails, heads, np.array(field.singularities, np.float64))


def spread(points: F8, gap: float) -> NDArray[np.intp]:
    """Numbers of points (N, 3), one in each occupied cell of a grid of cells `gap` wide."""
    cell = np.floor((points - points.min(axis=0)) / gap).astype(np.int64)
    width = cell.max(axis=0) + 1
    key = (cell[:, 0] * width[1] + cell[:, 1]) * width[2] + cell[:, 2]
    _, first = np.unique(key, return_index=True)
    return np.asarray(first)


def along(points: F8, normals: F8, gap: float) -> tuple[F8, F8]:
    """Places (k, 3) about `gap` apart on a line through points (n, 3), and its directions there.

    Directions (k, 3) are unit tangents of the surface with normals (n, 3). A line without length
    has none: k = 0.
    """
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    arc = np.concatenate([[0.0], np.cumsum(steps)])
    if not arc[-1] > 0:
        return np.zeros((0, 3)), np.zeros((0, 3))
    count = max(int(round(arc[-1] / max(gap, 1e-300))), 1)
    middle = (np.arange(count) + 0.5) / count * arc[-1]
    half = arc[-1] / count / 2
    ends = [
        np.stack([np.interp(middle + way, arc, points[:, k]) for k in range(3)], axis=1)
        for way in (-half, half)
    ]
    place = np.stack([np.interp(middle, arc, points[:, k]) for k in range(3)], axis=1)
    side = np.stack([np.interp(middle, arc, normals[:, k]) for k in range(3)], axis=1)
    flat, good = _tangent(ends[1] - ends[0], side)
    return place[good], flat[good]


def snapped(dense: DenseMesh, places: F8, directions: F8, reach: float) -> F8:
    """Directions (k, 3) turned to the nearer principal direction of curvature at each place.

    The shape operator is fitted to the normals within `reach` (least squares of dn = S dx in the
    tangent plane). Where both curvatures are alike, the direction stays.
    """
    out = np.array(directions, np.float64)
    points = np.asarray(dense.vertices, np.float64)
    for number, (place, wanted) in enumerate(zip(places, out, strict=True)):
        near = np.flatnonzero(((points - place) ** 2).sum(axis=1) < reach**2)
        if len(near) < LEAST:
            continue
        normals = dense.normals[near].astype(np.float64)
        middle = normals[((points[near] - place) ** 2).sum(axis=1).argmin()]
        same = (normals * middle).sum(axis=1) > 0.2  # not the other side of a thin sheet
        near, normals = near[same], normals[same]
        if len(near) < LEAST:
            continue
        one, good = _tangent(wanted[None], middle[None])
        if not good[0]:
            continue
        frame = np.stack([one[0], np.cross(middle, one[0])])
        x, y = np.einsum("kj,nj->kn", frame, points[near] - place)
        dn = np.einsum("kj,nj->kn", frame, normals - middle)
        # S = [[a, b], [b, c]]: both rows of dn at once
        zero = np.zeros(len(x))
        rows = np.concatenate([np.stack([x, y, zero], 1), np.stack([zero, x, y], 1)])
        (a, b, c), *_ = np.linalg.lstsq(rows, dn.reshape(-1), rcond=None)
        value, vector = np.linalg.eigh([[a, b], [b, c]])
        if abs(value[1] - value[0]) < CLEAR * np.abs(value).max():
            continue
        best = vector[:, np.abs(vector[0]).argmax()]
        best = best if best[0] > 0 else -best
        out[number] = best[0] * frame[0] + best[1] * frame[1]
    return out


def _tangent(vectors: F8, normals: F8) -> tuple[F8, NDArray[np.bool_]]:
    """Unit tangential parts (n, 3), and which of them have a direction."""
    unit = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    flat = vectors - unit * (vectors * unit).sum(axis=1, keepdims=True)
    length = np.linalg.norm(flat, axis=1, keepdims=True)
    good = length[:, 0] > 1e-9 * np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)
    return flat / np.maximum(length, 1e-300), good
