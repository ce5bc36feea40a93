"""BTFs with known factors, and one that shines, shades and casts shadows like a material."""

import numpy as np

from btfcore.btf.sample import BtfSample, full_index
from btfcore.btf.stack import ArrayStack
from tests.btf.bricks import directions


def sample_of(images, name="made", *, views=None, sound=True, **details):
    """A BTF of images (J, H, W, 3) under `views` (or one) views and J / views lights."""
    views = views or 1
    lights = len(images) // views
    assert views * lights == len(images)
    index = details.pop("index", None)
    return BtfSample(
        name,
        ArrayStack(np.asarray(images), sound=sound),
        spiral(views),
        spiral(lights),
        full_index(views, lights) if index is None else index,
        **details,
    )


def spiral(count):
    """`count` different directions above the horizon."""
    z = np.linspace(1, 0.2, count)
    phi = np.arange(count) * 2.399963
    return np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z], 1)


def low_rank(rank, images=40, height=12, width=10, *, seed=0, noise=0.0, decay=0.6):
    """Positive radiance (J, H, W, 3) whose deviation from the mean has a given rank."""
    generator = np.random.default_rng(seed)
    maps = generator.standard_normal((rank, height * width))
    maps -= maps.mean(axis=1, keepdims=True)
    angular = generator.standard_normal((images * 3, rank)) * decay ** np.arange(rank)
    values = angular @ maps
    values += noise * generator.standard_normal(values.shape)
    values = 0.5 + 0.4 * values / np.abs(values).max()
    return np.ascontiguousarray(
        values.reshape(images, 3, height, width).transpose(0, 2, 3, 1).astype(np.float32)
    )


def material(size=16, *, shine=1.0, roughness=0.25, views=None, lights=None):
    """A bumpy, spotted BTF: Lambert and a microfacet lobe, and shadows of the bumps."""
    views = directions((1, 0), (6, 35), (6, 65)) if views is None else views
    lights = directions((6, 20), (8, 50), (8, 70)) if lights is None else lights
    row, column = np.mgrid[:size, :size] * (2 * np.pi / size)
    height = np.sin(3 * column) * np.cos(2 * row) + 0.4 * np.sin(7 * row + 3 * column)
    down, along = np.gradient(height)
    normal = np.stack([-along, down, np.full_like(height, 1.2)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    albedo = 0.4 + 0.3 * np.stack([np.sin(row), np.sin(column + 1), np.cos(2 * row)], axis=-1)
    out = np.empty((len(views), len(lights), size, size, 3), np.float32)
    for v, view in enumerate(views):
        for k, light in enumerate(lights):
            cosine = np.maximum(normal @ light, 0)
            half = (view + light) / np.linalg.norm(view + light)
            facing = np.maximum(normal @ half, 0)
            square = roughness**4
            lobe = square / (np.pi * (facing**2 * (square - 1) + 1) ** 2)
            lit = height > np.roll(height, 2, axis=1) - 2.5 * light[2] / np.hypot(*light[:2])
            radiance = (albedo + shine * 0.05 * lobe[..., None]) * (cosine * lit)[..., None]
            out[v, k] = radiance
    sample = BtfSample(
        "material",
        ArrayStack(out.reshape(-1, size, size, 3), sound=True),
        views,
        lights,
        full_index(len(views), len(lights)),
    )
    return sample


def rebuilt(factors):
    """Coded values (J, 3, N) f8 that factors give."""
    height, width, rank = factors.weights.shape
    weights = factors.weights.reshape(height * width, rank).astype(np.float64)
    return (
        np.einsum("jck,xk->jcx", factors.basis.astype(np.float64), weights)
        + (factors.mean.astype(np.float64)[:, :, None])
    )
