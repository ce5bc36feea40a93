"""BTFs made from formulas: bumpy ones, and ones that are harmonics to begin with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from btfcore.btf.directions import Layout, layout
from btfcore.btf.harmonics.basis import evaluate, functions
from btfcore.btf.sample import BtfSample, full_index
from btfcore.btf.stack import ArrayStack, SubsetStack


def bumpy(chosen: Layout, size: int = 8, *, shine: float = 0.3, seed: int = 0) -> BtfSample:
    """Lambert and a shiny lobe on a smooth tiling relief; no cast shadows."""
    rng = np.random.default_rng(seed)
    grid = 2 * np.pi * np.arange(size) / size
    waves = zip(
        rng.normal(0, 0.25, 12), rng.integers(-3, 4, (12, 2)), rng.uniform(0, 6, 12), strict=True
    )
    height = sum(a * np.sin(i * grid[:, None] + j * grid[None] + p) for a, (i, j), p in waves)
    normal = np.stack(
        [
            (np.roll(height, 1, 1) - np.roll(height, -1, 1)) * size / 64,
            (np.roll(height, -1, 0) - np.roll(height, 1, 0)) * size / 64,
            np.ones((size, size)),
        ],
        axis=2,
    )
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    stripes = 1 + 0.5 * np.sin(2 * grid)[None, :, None] * np.sin(3 * grid)[:, None, None]
    albedo = np.array([0.6, 0.4, 0.2]) * stripes
    lit = np.clip(np.einsum("ijc,lc->lij", normal, chosen.lights), 0, None)
    images = []
    for view in chosen.views:
        half = view + chosen.lights
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        lobe = np.clip(np.einsum("ijc,lc->lij", normal, half), 0, None) ** 20
        images.append(lit[..., None] * (albedo + shine * lobe[..., None]))
    return sample("bumpy", np.concatenate(images), chosen.views, chosen.lights)


def sample(name: str, images: np.ndarray, views: np.ndarray, lights: np.ndarray) -> BtfSample:
    """BTF of images (V·L, H, W, 3), the light running fastest."""
    stack = ArrayStack(np.asarray(images, np.float32))
    return BtfSample(name, stack, views, lights, full_index(len(views), len(lights)))


def banded(
    chosen: Layout,
    order: int,
    kind: str = "spherical",
    *,
    size: int = 4,
    rank: int = 3,
    seed: int = 1,
) -> tuple[BtfSample, np.ndarray]:
    """BTF whose light dependence is harmonics of `order`, and its coefficients (V, M, H, W, 3).

    The coefficient vectors lie on `rank` axes about a mean, and radiance is positive.
    """
    rng = np.random.default_rng(seed)
    count, views = functions(order), len(chosen.views)
    axes = rng.normal(0, 0.05, (rank, count, 3)) / (1 + np.arange(count))[:, None]
    weights = rng.normal(size=(views, size, size, rank))
    truth = np.einsum("vijk,kmc->vmijc", weights, axes)
    truth[:, 0] += 4
    values = evaluate(chosen.lights, order, kind)
    images = np.einsum("lm,vmijc->vlijc", values, truth)
    assert images.min() > 0
    return sample("banded", images.reshape(-1, size, size, 3), chosen.views, chosen.lights), truth


def without(sample, pairs):
    """Return the sample with some (view, light) images missing."""
    index = sample.index.copy()
    index[tuple(np.transpose(pairs))] = -1
    kept = index[index >= 0]
    index[index >= 0] = np.arange(len(kept))
    return replace(sample, index=index, stack=SubsetStack(sample.stack, kept))


def few_views(name: str, views: int = 3) -> Layout:
    """Lights of a layout with only some of its views."""
    whole = layout(name)
    return Layout(whole.name, whole.views[:views].copy(), whole.lights)


def carpet(data: Path, views: np.ndarray | None = None) -> BtfSample:
    """The measured mean colours of carpet07 (UBO2014) as a BTF of one texel.

    Of each of the 151 × 151 images the file has the mean of all its logarithmic Y, U and V;
    the mean chroma comes from the sparse coefficients, so that the mean Y follows. What is
    exponentiated here is the mean of logarithms: the geometric mean colour of the image.
    """
    folder = data / "btf"
    some = np.arange(151) if views is None else np.asarray(views)
    raw = np.fromfile(folder / "sparsebtf_carpet07" / "carpet07_mean_std.bin", "<f8")
    mean, deviation = raw.reshape(2, 151, 151)[:, some]
    u, v = (_chroma(folder, channel, some) * deviation + mean for channel in "UV")
    y = 3 * mean - u - v
    log = np.stack([y + 1.13983 * v, y - 0.39465 * u - 0.5806 * v, y + 2.03211 * u], axis=-1)
    images = (np.exp(log) - 1e-5).reshape(-1, 1, 1, 3)
    directions = layout("ubo151").lights
    return sample("carpet07", images, directions[some], directions.copy())


def _chroma(folder: Path, channel: str, views: np.ndarray) -> np.ndarray:
    """Mean standardised chroma (views, 151 lights) of the sparse 4-D representation."""
    atoms, patches = 64, 1600
    raw = np.fromfile(
        folder / "sparsebtf_carpet07" / f"Coeffs_BTF_carpet07_1e-05_{channel}.bin", "<u2"
    )[4:]
    index, raw = raw[: 4 * atoms * patches].reshape(patches, atoms, 4), raw[4 * atoms * patches :]
    member = raw[:patches].astype(int)[:, None]
    weight = raw[2 * patches :].view("<f2").astype(np.float32).reshape(patches, atoms)
    book = np.fromfile(folder / "sparsebtf_common" / f"DictEnsOrth4D{channel}.bin", "<f2")
    members = book.size // (200 + 2 * 151 * 151)
    parts, start = [], 0
    for size in (10, 10, 151, 151):
        part = book[start : start + size * size * members].astype(np.float32)
        parts.append(part.reshape(members, size, size))
        start += part.size
    for axis in (0, 1):
        weight = weight * parts[axis].mean(axis=2)[member, index[:, :, axis]]
    light = parts[2][member, index[:, :, 2]].reshape(-1, 151) * weight.reshape(-1, 1)
    view = parts[3][member, index[:, :, 3]].reshape(-1, 151)[:, views]
    return (view.T @ light).astype(np.float64) / patches
