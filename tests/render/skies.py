"""Made-up environment maps for tests: a low sun in a clear sky, and a studio with softboxes."""

import numpy as np

from btfcore.render.environment import texel_directions


def sun_and_sky(height=128, radius=3.0):
    """A sun of `radius` degrees that gives most of the light, a blue sky, a brown ground."""
    d = texel_directions(height)
    sun = np.array([0.55, 0.6, 0.58])
    sun /= np.linalg.norm(sun)
    near = np.einsum("hwc,c->hw", d, sun)
    up = np.clip(d[..., 1], 0, 1)[..., None]
    sky = np.array([0.35, 0.5, 0.9]) * up + np.array([1.0, 0.9, 0.75]) * (1 - up) ** 4
    sky = sky + np.array([1.5, 1.2, 0.8]) * np.clip(near, 0, 1)[..., None] ** 30
    ground = np.array([0.16, 0.12, 0.08]) * np.ones_like(d)
    out = np.where(d[..., 1:2] > 0, sky, ground)
    disc = near > np.cos(np.radians(radius))
    out[disc] += np.array([900.0, 800.0, 650.0])
    return out.astype(np.float32)


def studio(height=128):
    """A dark room, three softboxes of different colours and a lit ceiling."""
    d = texel_directions(height)
    out = 0.02 + 0.3 * np.clip(d[..., 1:2], 0, 1) ** 6 * np.ones(3)
    for at, size, colour in (
        ((1.0, 0.5, 0.3), 0.35, (12.0, 11.0, 10.0)),
        ((-0.6, 0.2, 0.8), 0.25, (2.0, 3.0, 6.0)),
        ((0.1, 0.3, -1.0), 0.5, (3.0, 1.6, 0.8)),
    ):
        front = np.array(at) / np.linalg.norm(at)
        right = np.cross(front, [0, 1, 0])
        right /= np.linalg.norm(right)
        up = np.cross(right, front)
        depth = np.einsum("hwc,c->hw", d, front)
        far = np.maximum(depth, 1e-6)
        x = np.einsum("hwc,c->hw", d, right) / far
        y = np.einsum("hwc,c->hw", d, up) / far
        box = (depth > 0) & (np.abs(x) < size) & (np.abs(y) < 1.4 * size)
        out[box] = colour
    return out.astype(np.float32)


def band_limited(height, order, seed=0):
    """Map (H, 2H, 3) f4 > 0 of random harmonics up to `order`, and its coefficients (M, 3)."""
    from btfcore.btf.harmonics.basis import evaluate, functions

    coefficients = np.random.default_rng(seed).normal(0, 0.1, (functions(order), 3))
    coefficients[0] = 8.0, 9.0, 10.0
    d = texel_directions(height)
    values = np.einsum("nm,mc->nc", evaluate(d.reshape(-1, 3), order), coefficients)
    assert values.min() > 0
    return values.reshape(height, 2 * height, 3).astype(np.float32), coefficients


def normals(count=300):
    """Unit vectors (n, 3), evenly over the sphere (a Fibonacci spiral)."""
    n = np.arange(count) + 0.5
    y = 1 - 2 * n / count
    turn = n * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - y * y)
    return np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=1)


def irradiance(radiance, at):
    """Lambertian radiance (n, 3) of white at normals (n, 3) under a map, by its texels."""
    from btfcore.render.environment import row_solid_angles

    d = texel_directions(len(radiance))
    angle = np.broadcast_to(row_solid_angles(len(radiance))[:, None], d.shape[:2]).ravel()
    light = radiance.reshape(-1, 3).astype(np.float64) * angle[:, None] / np.pi
    out = np.empty((len(at), 3))
    for row, normal in enumerate(at):
        out[row] = np.maximum(d.reshape(-1, 3) @ normal, 0) @ light
    return out
