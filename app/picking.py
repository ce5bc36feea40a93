"""From places in the picture to places on the surface.

Pixels are logical ones of the view, as Qt hands them out: (column, row) from its upper left
corner, the middle of the first pixel being (½, ½).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from btfcore.errors import InvalidParameter
from btfcore.mesh.pick import first_crossings
from btfcore.mesh.rays import ray_tree
from btfcore.render.camera import Turntable, focal_length
from btfcore.render.surfels import Placement, placement
from btfcore.types import F8, I4, DenseMesh, Frozen

if TYPE_CHECKING:
    from btfcore.files.surface import ExportSurface

NEAR = 0.004  # depth in the scene below which nothing is drawn
SEEN = 3e-3  # of the unit ball: a point no deeper than this below the surface is seen
_DIAGONALS = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], indexing="ij"), axis=-1).reshape(-1, 2)


@dataclass(frozen=True)
class View:
    """What the user sees: a camera in scene coordinates, and width and height in pixels."""

    camera: Turntable
    size: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Hits(Frozen):
    """What n places of the picture show of the surface.

    face (n,) i4: triangle of the surface, -1 where there is none; bary (n, 3) f8 in it;
    position (n, 3) f8 in world units and normal (n, 3) f8, smooth, unit, outward: NaN where
    there is none; front (n,) bool: seen from the side to which the normal points; depth (n,)
    f8 in scene units, inf where there is none.
    """

    face: I4
    bary: F8
    position: F8
    normal: F8
    front: NDArray[np.bool_]
    depth: F8

    def __len__(self) -> int:
        """Return how many places were asked for."""
        return len(self.face)

    @property
    def on(self) -> NDArray[np.bool_]:
        """Whether the surface is there: (n,) bool."""
        return self.face >= 0

    def take(self, index: NDArray[np.integer]) -> Hits:
        """Those of some places."""
        return Hits(
            self.face[index], self.bary[index], self.position[index], self.normal[index],
            self.front[index], self.depth[index],
        )  # fmt: skip


class Picker:
    """Finds what is seen at places of the picture; made once per surface, in any thread.

    On a closed surface the inside, seen by a camera within, is no hit; it hides what is behind.
    Both sides of an open one are hit.
    """

    def __init__(
        self,
        surface: ExportSurface,
        *,
        place: Placement | None = None,
        dense: DenseMesh | None = None,
    ) -> None:
        """Prepare for `surface`; `place` is where the scene has it (None: its `placement`).

        dense : of the same atlas, where dense vertices will be asked for.
        """
        self.surface, self._dense = surface, dense
        self.place = placement(surface.positions) if place is None else place
        self._tree = ray_tree(self.place.to_scene(surface.positions), surface.faces)

    def pick(self, view: View, pixels: F8) -> Hits:
        """Return what is seen at `pixels` (n, 2)."""
        places = np.asarray(pixels, np.float64).reshape(-1, 2)
        camera = view.camera
        rays = camera.rays(places, view.size)
        # cosine of the angle to the camera's axis: depths are counted along the axis
        straight = np.maximum(-np.einsum("nj,j->n", rays, camera.axes()[2]), 1e-9)
        found = first_crossings(self._tree, camera.position, rays, nearest=NEAR / straight)
        on = found.face >= 0
        corner = self.surface.faces[found.face]
        position = np.full((len(places), 3), np.nan)
        normal, front = position.copy(), np.zeros(len(places), np.bool_)
        at = self.surface.positions[corner[on]]
        weight = found.bary[on]
        position[on] = np.einsum("nk,nkj->nj", weight, at)
        # in the scene, where neither size nor distance from the origin spoils them
        flat = self.place.to_scene(at)
        across = _unit(np.cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]))
        smooth = np.einsum("nk,nkj->nj", weight, self.surface.normals[corner[on]])
        length = np.linalg.norm(smooth, axis=1, keepdims=True)
        normal[on] = np.where(length > 1e-6, smooth / np.maximum(length, 1e-300), across)
        front[on] = np.einsum("nj,nj->n", across, rays[on]) < 0
        face = found.face.copy()
        if self.surface.closed:
            inside = on & ~front
            face[inside], position[inside], normal[inside] = -1, np.nan, np.nan
        depth = np.where(face >= 0, found.distance * straight, np.inf)
        bary = np.where((face >= 0)[:, None], found.bary, 0.0)
        return Hits(face, bary, position, normal, front, depth)

    def pixels(self, view: View, points: F8) -> F8:
        """Column, row and depth (…, 3) of world positions; NaN behind the camera."""
        return view.camera.pixels(self.place.to_scene(points), view.size)

    def visible(self, view: View, points: F8) -> NDArray[np.bool_]:
        """Whether nothing lies between the camera and each of the world positions (n, 3)."""
        away = self.place.to_scene(np.asarray(points).reshape(-1, 3)) - view.camera.position
        length = np.linalg.norm(away, axis=1)
        rays = away / np.maximum(length, 1e-300)[:, None]
        straight = -np.einsum("nj,j->n", rays, view.camera.axes()[2])
        near = NEAR / np.maximum(straight, 1e-9)
        found = first_crossings(self._tree, view.camera.position, rays, nearest=near)
        return (straight > 0) & (found.distance >= length - SEEN)

    def pixel_size(self, view: View, depth: float) -> float:
        """Edge of a pixel in world units where it faces the camera at a depth of the scene."""
        return depth / focal_length(view.size[1]) / self.place.scale

    def texels(self, hits: Hits, size: int) -> F8:
        """Place (n, 2) f8, column and row, in an atlas image of `size` texels; NaN off it."""
        corner = self.surface.faces[hits.face]
        uv = np.einsum("nk,nkj->nj", hits.bary, self.surface.uv[corner].astype(np.float64))
        return np.where(hits.on[:, None], uv * size - 0.5, np.nan)

    def vertices(self, hits: Hits) -> I4:
        """Nearest dense vertex (n,) among the texels around each hit, -1 where there is none.

        Raises `InvalidParameter` where the picker knows no dense mesh.
        """
        if self._dense is None:
            raise InvalidParameter("dense vertices of a surface that has no dense mesh yet")
        dense, on = self._dense, hits.on
        found = np.full(len(hits), -1, np.int32)
        middle = np.rint(self.texels(hits, dense.size)[on])[:, None, ::-1].astype(np.int64)
        around = np.clip(middle + _DIAGONALS, 0, dense.size - 1)
        some = self._number[around[..., 0], around[..., 1]]
        away = np.linalg.norm(dense.vertices[some] - hits.position[on][:, None], axis=2)
        away[some < 0] = np.inf
        best = np.take_along_axis(some, away.argmin(axis=1)[:, None], axis=1)[:, 0]
        found[on] = best
        return found

    @cached_property
    def _number(self) -> I4:
        """Dense vertex of each texel (size, size), -1 where there is none."""
        assert self._dense is not None
        size = self._dense.size
        number = np.full((size, size), -1, np.int32)
        row, column = self._dense.texel.T
        number[row, column] = np.arange(len(row), dtype=np.int32)
        return number


def _unit(vectors: F8) -> F8:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.maximum(length, 1e-300))
