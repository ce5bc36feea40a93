"""A small BTF that is known in closed form: Lambert and a soft lobe on a relief of waves."""

import numpy as np

from btfcore.btf.sample import BtfSample, full_index
from btfcore.btf.stack import ArrayStack

WAVES = ((0.9, 0.5, 1.1), (-0.4, 1.3, 0.7))  # slope, direction in radians, radians a texel


def normals(x, y, turn=0.0):
    """Unit normals at offsets (x, y) (right, up) from the middle of a relief turned by `turn`."""
    slope = np.zeros((*np.shape(x), 2))
    for steep, along, rate in WAVES:
        axis = np.array([np.cos(along + turn), np.sin(along + turn)])
        slope += steep * 0.4 * np.cos(0.35 * rate * (x * axis[0] + y * axis[1]))[..., None] * axis
    out = np.concatenate([-slope, np.ones((*np.shape(x), 1))], axis=-1)
    return out / np.linalg.norm(out, axis=-1, keepdims=True)


def shaded(normal, view, light):
    """Radiance (…, 3) of normals under one view and one light."""
    half = (view + light) / np.linalg.norm(view + light)
    diffuse = np.maximum(normal @ light, 0)[..., None] * np.array([0.6, 0.4, 0.2])
    return diffuse + 0.5 * np.maximum(normal @ half, 0)[..., None] ** 8 * light[2]


def offsets(shape):
    """Offsets (x, y) (right, up) of the texels from the middle of an image."""
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return columns - (shape[1] - 1) / 2, (shape[0] - 1) / 2 - rows


def relief(shape, views, lights, *, turn=0.0, name="relief"):
    """Return the relief, turned by `turn` about its middle, seen and lit from given directions."""
    normal = normals(*offsets(shape), turn)
    images = np.array([shaded(normal, v, one) for v in views for one in lights], np.float32)
    index = full_index(len(views), len(lights))
    return BtfSample(name, ArrayStack(images), views.copy(), lights.copy(), index)
