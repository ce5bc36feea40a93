"""Scattered points, cells about them, and distances, all on the periodic canvas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from btfcore.types import F8
from resources.recipes.canvas import Canvas


@dataclass(frozen=True, eq=False)
class Cells:
    """Worley cells: points (n, 2) (row, column) in texels; of every drawing sample the
    distances to its nearest and second nearest point, the nearest's number, and the offset
    (down, right) from it.
    """  # noqa: D205

    points: F8
    first: F8
    second: F8
    number: np.ndarray
    offset: tuple[F8, F8]

    @property
    def border(self) -> F8:
        """About the distance to the cell's border."""
        return (self.second - self.first) / 2


def scatter(canvas: Canvas, what: str, spacing: float, jitter: float = 0.9) -> F8:
    """Points (n, 2) about `spacing` texels apart: a jittered grid, rows shifted by halves."""
    count = max(2, 2 * round(canvas.size / spacing / 2))
    pitch = canvas.size / count
    rng = canvas.rng(what)
    row, column = np.indices((count, count), np.float64)
    column = column + 0.5 * (row % 2)
    places = np.stack([row.ravel(), column.ravel()], 1) + 0.25
    places += (rng.random(places.shape) - 0.5) * jitter
    return np.mod(places * pitch, canvas.size)


def cells(
    canvas: Canvas,
    points: F8,
    *,
    warped: tuple[F8, F8] | None = None,
    squash: tuple[float, float] = (1.0, 1.0),
) -> Cells:
    """Cells about points; `warped` moves the places looked up, `squash` weighs the axes."""
    rows, columns = canvas.grid()
    shape = (canvas.side, canvas.side)
    down, right = (np.zeros(shape), np.zeros(shape)) if warped is None else warped
    places = np.stack([rows + down, columns + right], -1).reshape(-1, 2)
    places = np.mod(places, canvas.size)
    box = np.asarray(squash) * canvas.size
    home = np.minimum(np.mod(points, canvas.size) * squash, np.nextafter(box, 0))
    look = np.minimum(places * squash, np.nextafter(box, 0))
    found = cKDTree(home, boxsize=box).query(look, k=2)
    far, nearest = np.asarray(found[0]), np.asarray(found[1])[:, 0]
    offset = places - points[nearest]
    offset -= np.round(offset / canvas.size) * canvas.size
    return Cells(
        points,
        far[:, 0].reshape(shape),
        far[:, 1].reshape(shape),
        nearest.reshape(shape),
        (offset[:, 0].reshape(shape), offset[:, 1].reshape(shape)),
    )


def distance(canvas: Canvas, inside: np.ndarray, reach: float) -> F8:
    """Distance in texels to the nearest True sample, exact up to `reach`."""
    edge = int(np.ceil(reach * canvas.fine)) + 1
    edge = min(edge, canvas.side)
    wide = np.pad(inside, edge, mode="wrap")
    far = ndimage.distance_transform_edt(~wide)[edge:-edge, edge:-edge]
    return np.minimum(far / canvas.fine, reach)


def signed(canvas: Canvas, inside: np.ndarray, reach: float) -> F8:
    """Distance in texels to the border of a region: > 0 inside, < 0 outside."""
    return distance(canvas, ~inside, reach) - distance(canvas, inside, reach)


def grown(canvas: Canvas, feature: F8, *, by: float, soft: float) -> F8:
    """Mask of a feature: everything above 0.5, grown by `by` texels, its edge `soft` wide."""
    far = distance(canvas, feature > 0.5, by + soft + 1)
    part = np.clip((by + soft / 2 - far) / soft, 0.0, 1.0)
    return part * part * (3 - 2 * part)
