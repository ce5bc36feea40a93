"""Cast shadows between parts of a mesh: which lights reach which surfels.

Exact rays, one a surfel and light: no bias to choose and no map to fit, as a shadow map would need.
Surfels lie on flat faces but have smooth normals: a light that the normal still sees may be below
the face, which would then shade itself with the outline of its triangles. So rays begin on the
curved surface that the normals describe (Hanika, "Hacking the shadow terminator", Ray Tracing Gems
II, 2021, chapter 4).
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.errors import InvalidParameter
from btfcore.mesh.distance import nearest_face
from btfcore.mesh.rays import RayTree, any_hit, ray_tree, stack_size
from btfcore.mesh.topology import vertex_normals
from btfcore.render.lights import Lights
from btfcore.render.pool import in_slices
from btfcore.render.surfels import Surfels
from btfcore.types import F4, F8, I4, Frozen

OFFSET = 2e-4  # of the scene's radius, along the normal: beyond rounding, below a texel
HIGHEST = 0.35  # greatest lift in lengths of the face's shortest edge
CURVED, CREASED = 0.8, 0.6  # cosines of normal and face: the whole lift, and none at an edge
MOST_RAYS = 64


@dataclass(frozen=True, eq=False)
class Caster(Frozen):
    """A surface that shades itself: its tree, and origins and normals (N, 3) f4 of its surfels."""

    tree: RayTree
    origins: F4
    normals: F4

    def visibility(
        self,
        lights: Lights,
        chosen: NDArray[np.integer] | None = None,
        *,
        environment: bool = True,
        radius: float = 0.0,
        rays: int = 1,
        pool: Executor | None = None,
    ) -> F4:
        """Share (L, n) f4 of each light that reaches each of the surfels; see `visibility`.

        environment : whether the lights that stand for an environment cast shadows too; else
        they reach all.
        """
        return visibility(
            self.tree, self.origins, self.normals, lights, chosen=chosen,
            free=0 if environment else lights.sampled, radius=radius, rays=rays, pool=pool,
        )  # fmt: skip


def caster(
    vertices: F8,
    faces: I4,
    surfels: Surfels,
    *,
    face: NDArray[np.integer] | None = None,
    bary: NDArray[np.floating] | None = None,
) -> Caster:
    """Prepare shadows of the mesh that surfels lie on.

    vertices (V, 3) f8 in scene coordinates, faces (F, 3); vertices at one place count as one,
    however textures split them. face (n,), bary (n, 3): where the surfels lie (those of
    `DenseMesh`); None: at the nearest point of the mesh. Raises `InvalidMesh`.
    """
    points, number = np.unique(vertices + 0.0, axis=0, return_inverse=True)  # -0 is 0
    joined = number.reshape(-1)[faces].astype(np.int32)
    normals = np.ascontiguousarray(surfels.frame[:, 2])
    tree = ray_tree(points, joined)
    if len(joined) == 0:
        return Caster(tree, surfels.position.copy(), normals)
    if face is None or bary is None:
        place = surfels.position.astype(np.float64)
        face = nearest_face(place, points[joined])
        bary = _shares(place, points[joined[face]])
    return Caster(tree, ray_origins(points, joined, face, bary, normals), normals)


def ray_origins(
    vertices: F8, faces: I4, face: NDArray[np.integer], bary: NDArray[np.floating], normals: F4
) -> F4:
    """Where the rays of surfels begin (n, 3) f4, in the coordinates of `vertices`.

    vertices (V, 3), faces (F, 3) of the input mesh in scene coordinates; face (n,), bary (n, 3):
    where on it the surfels lie (`DenseMesh`); normals (n, 3) unit. Each corner's tangent plane
    lifts the point that lies below it, by the corner's share. Corners whose normals lean far
    from the face are of sharp edges, where no curved surface is meant: they lift less, or not
    at all. Depends on no light.
    """
    corner_normals = vertex_normals(vertices, faces)
    corners = faces[face]
    share = np.asarray(bary, np.float64)
    place = np.einsum("nk,nkc->nc", share, vertices[corners])
    one, two = (vertices[corners[:, k]] - vertices[corners[:, 0]] for k in (1, 2))
    flat = np.cross(one, two)
    flat /= np.maximum(np.linalg.norm(flat, axis=1), 1e-300)[:, None]
    lift = np.zeros_like(place)
    for k in range(3):
        normal = corner_normals[corners[:, k]]
        below = np.einsum("nc,nc->n", vertices[corners[:, k]] - place, normal)
        smooth = (np.einsum("nc,nc->n", normal, flat) - CREASED) / (CURVED - CREASED)
        amount = share[:, k] * np.maximum(below, 0) * np.clip(smooth, 0, 1)
        lift += amount[:, None] * normal
    edges = np.linalg.norm(vertices[corners] - vertices[np.roll(corners, 1, axis=1)], axis=2)
    most = HIGHEST * edges.min(axis=1)
    length = np.linalg.norm(lift, axis=1)
    lift *= np.minimum(1.0, most / np.maximum(length, 1e-30))[:, None]
    return (place + lift + OFFSET * normals.astype(np.float64)).astype(np.float32)


def visibility(
    tree: RayTree,
    origins: F4,
    normals: F4,
    lights: Lights,
    *,
    chosen: NDArray[np.integer] | None = None,
    free: int = 0,
    radius: float = 0.0,
    rays: int = 1,
    pool: Executor | None = None,
) -> F4:
    """Share (L, n) f4 in 0–1 of each light that reaches each surfel.

    tree : of the mesh (`btfcore.mesh.rays.ray_tree`), in the coordinates of origins (N, 3); see
    `ray_origins`. normals (N, 3) unit. chosen (n,): numbers of the surfels, None: all. Lights
    below a surfel's horizon give 0. free : so many of the last lights reach all. radius : of a
    light's disc in degrees, 0: a point, whose shadow has a hard edge; else the mean of `rays`
    rays over the disc, the same ones for all surfels. The same bits with any `pool`. Raises
    `InvalidParameter`.
    """
    if not (0 <= radius <= 45 and 1 <= rays <= MOST_RAYS):
        raise InvalidParameter(
            f"{rays} rays to a light of {radius:g} degrees; 1 to {MOST_RAYS} and 0 to 45 can be"
        )
    numbers = np.arange(len(origins)) if chosen is None else np.asarray(chosen, np.int64)
    out = np.ones((len(lights), len(numbers)), np.float32)
    for light in range(max(len(lights) - free, 0)):
        aims = disc(lights.direction[light], radius, rays if radius > 0 else 1)

        def work(begin: int, end: int, light: int = light, aims: F8 = aims) -> None:
            _visible(
                tree.box, tree.child, tree.count, tree.triangle, origins, normals,
                numbers, lights.direction[light], aims, out[light], begin, end, stack_size(),
            )  # fmt: skip

        in_slices(work, len(numbers), pool)
    return out


def disc(direction: F8, radius: float, count: int) -> F8:
    """Unit directions (count, 3) f8 over a disc of `radius` degrees, each for the same area.

    A sunflower (Vogel 1979): point k at √(k + 1/2), turned by the golden angle.
    """
    if count == 1:
        return direction[None].copy()
    k = np.arange(count)
    away = np.sin(np.radians(radius)) * np.sqrt((k + 0.5) / count)
    turn = k * np.pi * (3 - np.sqrt(5))
    least = np.eye(3)[int(np.argmin(np.abs(direction)))]
    x = np.cross(direction, least)
    x /= np.linalg.norm(x)
    y = np.cross(direction, x)
    aims = (
        np.sqrt(1 - away**2)[:, None] * direction
        + (away * np.cos(turn))[:, None] * x
        + (away * np.sin(turn))[:, None] * y
    )
    unit: F8 = aims / np.linalg.norm(aims, axis=1, keepdims=True)
    return unit


def _shares(points: F8, corners: F8) -> F8:
    """Barycentric coordinates (n, 3) of points (n, 3) in triangles (n, 3, 3), kept inside."""
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    away = points - corners[:, 0]
    a, b, c = (np.einsum("nc,nc->n", p, q) for p, q in ((one, one), (one, two), (two, two)))
    d, e = (np.einsum("nc,nc->n", away, p) for p in (one, two))
    area = np.maximum(a * c - b * b, 1e-300)
    u, v = (c * d - b * e) / area, (a * e - b * d) / area
    shares = np.clip(np.stack([1 - u - v, u, v], axis=1), 0, 1)
    out: F8 = shares / np.maximum(shares.sum(axis=1), 1e-300)[:, None]
    return out


@njit(cache=True, nogil=True)
def _visible(  # type: ignore[no-untyped-def]
    box, child, count, triangle, origins, normals, numbers, direction, aims, out, begin, end, size
):
    stack = np.empty(size, np.int64)
    last = np.zeros(len(aims), np.int64)
    share = np.float32(1.0) / np.float32(len(aims))
    for n in range(begin, end):
        at = numbers[n]
        facing = 0.0
        for k in range(3):
            facing += normals[at, k] * direction[k]
        out[n] = 0.0
        if not facing > 0.0:
            continue
        reached = 0
        for j in range(len(aims)):
            found = any_hit(box, child, count, triangle, origins[at], aims[j], last[j], stack)
            if found < 0:
                reached += 1
            else:
                last[j] = found
        out[n] = reached * share
