"""A small picture of a decorated surface without a renderer, for lists of projects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from btfcore.render.texture import vertex_colours
from btfcore.types import DenseMesh, Quilt, Sample

_RIGHT = np.array([0.91, 0.0, -0.42])  # seen from the front, a little from the right and above
_UP = np.array([-0.13, 0.95, -0.28])
_TOWARDS = np.cross(_RIGHT, _UP)
_GROUND = 56
_MARGIN = 0.04


def thumbnail(
    dense: DenseMesh, quilt: Quilt, samples: Sequence[Sample], *, side: int = 256
) -> NDArray[np.uint8]:
    """Picture (side, side, 3) u8 of the surface's vertices as dots, the nearest in front."""
    points = dense.vertices - (dense.vertices.max(axis=0) + dense.vertices.min(axis=0)) / 2
    flat = np.stack([(points * axis).sum(axis=1) for axis in (_RIGHT, -_UP)], axis=1)
    extent = max(float(np.abs(flat).max()), 1e-300) * 2 * (1 + _MARGIN)
    dot = max(1, int(np.ceil(1.5 * dense.step / extent * side)))
    lit = np.clip((dense.normals * _TOWARDS.astype(np.float32)).sum(axis=1), 0, 1)
    colour = np.clip(vertex_colours(quilt, samples), 0, 1) * (0.35 + 0.65 * lit[:, None])
    place = np.clip((flat / extent + 0.5) * side, 0, side - 1).astype(np.int64)
    order = np.argsort((points * _TOWARDS).sum(axis=1), kind="stable")  # the farthest first
    shade = np.round(colour[order] * 255).astype(np.uint8)
    picture = np.full((side, side, 3), _GROUND, np.uint8)
    near = np.full((side, side), -1, np.int64)
    for down in range(dot):
        for right in range(dot):
            row = np.minimum(place[order, 1] + down, side - 1)
            column = np.minimum(place[order, 0] + right, side - 1)
            layer = np.full_like(near, -1)
            layer[row, column] = np.arange(len(order))  # of several the last one stays
            np.maximum(near, layer, out=near)
    hit = near >= 0
    picture[hit] = shade[near[hit]]
    return picture
