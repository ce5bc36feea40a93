"""Baking once more, by small steps and textbook formulas in double precision; slow and plain."""

import numpy as np
from scipy.ndimage import map_coordinates

from btfcore.btf.bake.relief import ALPHA, DIFFUSE, EDGE, MIRROR, NORMAL, OPEN

LEAST = 0.05  # floor of cosines, as documented


def height_at(height, x, y):
    """Bilinear height of a tiling field at columns x and rows y of any shape."""
    return map_coordinates(height.astype(np.float64), [y, x], order=1, mode="grid-wrap")


def run_of(direction):
    """Columns and rows by which a line moves per unit of height."""
    return direction[:2] * [1, -1] / max(direction[2], LEAST)


def marched(relief, view, step=1 / 32):
    """Columns and rows (H * W,) seen through the texels, by fixed steps and bisection."""
    plane, top, bottom = relief.level
    run = run_of(view)
    row, column = np.divmod(np.arange(relief.shape[0] * relief.shape[1]), relief.shape[1])
    count = max(1, int(np.ceil(np.hypot(*run) * (top - bottom) / step)))

    def above(z):
        x, y = column + run[0] * (z - plane), row + run[1] * (z - plane)
        return z - height_at(relief.height, x, y)

    high = np.full(len(row), top)
    low = np.full(len(row), bottom)
    done = above(high) <= 0
    low[done] = top
    for k in range(1, count + 1):
        z = top + (bottom - top) * k / count
        under = (above(np.full(len(row), z)) <= 0) & ~done
        low[under] = z
        done |= under
        high[~done] = z
    for _ in range(50):
        middle = (low + high) / 2
        under = above(middle) <= 0
        low, high = np.where(under, middle, low), np.where(under, high, middle)
    return column + run[0] * (high - plane), row + run[1] * (high - plane)


def horizon(relief, x, y, light, step=1 / 32):
    """Tangent of the horizon (n,) towards a light, as far as fixed steps see it."""
    z = height_at(relief.height, x, y)
    flat = np.hypot(light[0], light[1])
    if flat < 1e-9:
        return np.full(len(x), -np.inf)
    along = light[:2] * [1, -1] / flat
    tangent = max(light[2], LEAST) / flat
    far = (relief.level[1] - z.min()) / tangent
    best = np.full(len(x), -np.inf)
    near = [1e-5, 1e-3, step / 4]  # the point's own slope
    for s in [*near, *(np.arange(1, max(1, int(np.ceil(far / step))) + 1) * step)]:
        there = height_at(relief.height, x + along[0] * s, y + along[1] * s)
        best = np.maximum(best, (there - z) / s)
    return best


def seen(relief, x, y):
    """Channels (n, 12) of the material at points, with unit normals."""
    parts = [
        map_coordinates(part.astype(np.float64), [y, x], order=1, mode="grid-wrap")
        for part in np.moveaxis(relief.maps, 2, 0)
    ]
    out = np.stack(parts, axis=1)
    out[:, :3] /= np.linalg.norm(out[:, :3], axis=1, keepdims=True)
    return out


def radiance(material, view, light, visible, coat):
    """Radiance (n, 3) of points under a light of irradiance π: Cook-Torrance over Lambert.

    D is GGX, G = 1 / (1 + Λ(v) + Λ(l)) with Smith's Λ, F is Schlick's. Lambert's law gets
    what the surface, `coat`, lets in and out, over the mean that it lets out.
    """
    normal = material[:, NORMAL : NORMAL + 3]
    alpha = material[:, ALPHA]
    half = light + view
    half = half / np.linalg.norm(half)
    nl, nh = np.maximum(normal @ light, 0), np.maximum(normal @ half, 0)
    nv = np.maximum(normal @ view, LEAST)
    slope = alpha**2 * nh**2 + (1 - nh**2)
    d = alpha**2 / (np.pi * slope**2)

    def smith(cosine):
        square = np.maximum(cosine, 1e-9) ** 2
        return (np.sqrt(1 + alpha**2 * (1 - square) / square) - 1) / 2

    g = 1 / (1 + smith(nv) + smith(nl))
    mirror, edge = material[:, MIRROR : MIRROR + 3], material[:, EDGE, None]
    f = mirror + (edge - mirror) * (1 - half @ view) ** 5
    gloss = (d * g / (4 * np.maximum(nl, 1e-9) * nv))[:, None] * f

    def kept(cosine):
        return 1 - coat[0] - (coat[1] - coat[0]) * (1 - cosine) ** 5

    c = (np.arange(2000) + 0.5) / 2000
    matt = kept(nl) * kept(nv) / (2 * kept(c) * c).mean()
    matt = matt[:, None] * material[:, DIFFUSE : DIFFUSE + 3] / np.pi
    irradiance = np.pi * nl * visible * material[:, OPEN]
    return (matt + gloss) * irradiance[:, None]


def rendered(relief, view, light, step=1 / 32):
    """Image (H, W, 3) f8 of a relief, and where its shadow is too close to call."""
    x, y = marched(relief, view, step)
    limit = horizon(relief, x, y, light, step)
    tangent = max(light[2], LEAST) / max(np.hypot(light[0], light[1]), 1e-9)
    image = radiance(seen(relief, x, y), view, light, tangent > limit, relief.coat)
    close = np.abs(tangent - limit) < 0.02
    return image.reshape(*relief.shape, 3), close.reshape(relief.shape)
