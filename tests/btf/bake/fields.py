"""Reliefs and PBR sets made by formula, and directions, for the tests of baking."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter

from btfcore.btf.pbr import PbrSet


def direction(theta, phi):
    """Unit vector at `theta`, `phi` in degrees."""
    theta, phi = np.radians(theta), np.radians(phi)
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def ring(theta, count, first=0.0):
    """Directions (count, 3) at one polar angle in degrees."""
    return np.array([direction(theta, first + 360 * k / count) for k in range(count)])


def bumps(rows=32, columns=32, width=3.0, seed=0):
    """Smooth tiling heights (rows, columns) f4 that fill 0–1."""
    noise = np.random.default_rng(seed).normal(size=(rows, columns))
    height = gaussian_filter(noise, width, mode="wrap")
    height -= height.min()
    return (height / height.max()).astype(np.float32)


def blocks(size=32):
    """Steep-walled blocks of three heights that tile, (size, size) f4."""
    height = np.zeros((size, size), np.float32)
    height[size // 8 : size // 2, size // 8 : size // 2] = 1
    height[size // 2 + 2 : size - 4, size // 3 : size - 3] = 0.6
    height[2 : size // 3, size - 9 : size - 5] = 0.3
    return height


def plain(height, *, albedo=0.5, depth=4.0, name="test", **maps):
    """PBR set of one colour over a height map (H, W), or over a size (H, W)."""
    if isinstance(height, tuple):
        return PbrSet(name, np.full((*height, 3), albedo, np.float32), **maps)
    colours = np.full((*height.shape, 3), albedo, np.float32)
    return PbrSet(name, colours, height=height.astype(np.float32), depth=depth, **maps)


def colourful(rows=24, columns=32, seed=1, **changes):
    """PBR set with every map, all of them tiling."""
    maps = [bumps(rows, columns, 2.0, seed + k) for k in range(8)]
    slopes = np.random.default_rng(seed).normal(scale=0.2, size=(rows, columns, 2))
    normal = np.concatenate([slopes, np.ones((rows, columns, 1))], axis=2)
    normal = (normal / np.linalg.norm(normal, axis=2, keepdims=True)).astype(np.float32)
    made = PbrSet(
        "colourful",
        np.stack(maps[:3], axis=2),
        height=maps[3],
        normal=normal,
        roughness=np.clip(maps[4], 0.15, 1),
        metallic=maps[5],
        ao=maps[6],
        mask=maps[7],
        depth=3.0,
    )
    return replace(made, **changes)
