"""The paper's quadrature: light samples rendered to a cube map and summed (Furukawa §2)."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from btfcore.btf.harmonics.basis import check_basis, evaluate, functions
from btfcore.btf.interpolation.barycentric import barycentric_weights
from btfcore.btf.interpolation.triangulation import triangulate
from btfcore.errors import InvalidParameter
from btfcore.types import F8, I4

BELOW = ("black", "mirrored")


def cube_texels(side: int) -> tuple[F8, F8]:
    """Unit directions (T, 3) and solid angles (T,) of the upper texels of a cube map.

    T = 3 side²: the upper face and the upper halves of the four around it. The solid angles
    are exact and sum to 2π. Raises `InvalidParameter` unless `side` is even (so that no texel
    straddles the horizon) and in 2 … 512.
    """
    if side % 2 or not 2 <= side <= 512:
        raise InvalidParameter(f"a cube map of side {side}, where an even one in 2 … 512 is needed")
    edge = np.linspace(-1, 1, side + 1)
    x, y = np.meshgrid(edge, edge)
    corner = np.arctan2(x * y, np.sqrt(x * x + y * y + 1))
    angle = np.diff(np.diff(corner, axis=0), axis=1)
    middle = (edge[:-1] + edge[1:]) / 2
    u, v = np.meshgrid(middle, middle)
    top = np.stack([u, v, np.ones_like(u)], axis=2).reshape(-1, 3)
    half = v > 0
    ahead = np.stack([np.ones_like(u[half]), u[half], v[half]], axis=1)
    faces, angles = [top], [angle.ravel()]
    for cosine, sine in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        turned = ahead.copy()
        turned[:, 0] = cosine * ahead[:, 0] - sine * ahead[:, 1]
        turned[:, 1] = sine * ahead[:, 0] + cosine * ahead[:, 1]
        faces.append(turned)
        angles.append(angle[half])
    directions = np.concatenate(faces)
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return directions, np.concatenate(angles)


def light_angles(lights: F8, *, side: int = 64) -> F8:
    """Solid angle (L,) of the upper directions nearest to each light; they sum to 2π."""
    directions, angles = cube_texels(side)
    _, nearest = cKDTree(lights).query(directions)
    out = np.zeros(len(lights))
    np.add.at(out, nearest, angles)
    return out


def smooth_shading(lights: F8, directions: F8) -> tuple[I4, F8]:
    """Three lights and their weights (n, 3), summing to 1, for each upper direction.

    As a mesh with the lights for vertices would shade it: barycentric in their triangulation
    (`btfcore.btf.interpolation`), and on to the horizon from the nearest point of its border.
    """
    net = triangulate(lights, np.arange(len(lights), dtype=np.int32))
    index, weights = np.empty((len(directions), 3), np.int32), np.empty((len(directions), 3))
    barycentric_weights(net, directions, index, weights, np.empty(len(directions), np.bool_))
    return index, weights


def quadrature(
    lights: F8, order: int, kind: str = "spherical", *, side: int = 32, below: str = "black"
) -> F8:
    """Linear map (M, L) from values under `lights` (L, 3) to coefficients (Furukawa §2).

    The values are shaded smoothly over a cube map of `side`; texel values, basis functions and
    the texels' solid angles are multiplied and summed. below : directions under the horizon,
    which the paper's renderer leaves at the background, are "black" or "mirrored" from above;
    hemispherical functions end at the horizon, so that it is of no matter to them.
    Raises `InvalidParameter` for parameters out of range.
    """
    check_basis(order, kind)
    if below not in BELOW:
        raise InvalidParameter(f"below={below!r}; there are {' and '.join(BELOW)}")
    directions, angles = cube_texels(side)
    values = evaluate(directions, order, kind)
    if kind == "spherical" and below == "mirrored":
        values = values + evaluate(directions * (1, 1, -1), order, kind)
    values *= angles[:, None]
    index, weights = smooth_shading(lights, directions)
    out = np.zeros((len(lights), functions(order)))
    for corner in range(3):
        np.add.at(out, index[:, corner], values * weights[:, corner, None])
    return out.T.copy()
