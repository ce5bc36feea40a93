"""Radiance of a decorated surface: the definition that every backend is tested against.

The radiance of a surfel towards the eye is Σ_j E_j f(x, v, l_j) over directional lights, f being
that of its sample at its texel x for view and light in its own frame (Tong §6, Furukawa §4):

- A view below the surfel's horizon counts as lying on it: smooth normals leave no holes at
  silhouettes. Straight from behind it is s.
- A light at or below the horizon gives nothing (attached shadow). Beyond the sample's outermost
  lights the nearest direction that they cover counts, dimmed by the ratio of the cosines; a
  sample without the cosine is multiplied by it. So nothing jumps at the horizon.
- Maps over texels are read bilinearly: factors, images, weights of harmonics.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.factor.encoding import decode
from btfcore.btf.harmonics.basis import evaluate
from btfcore.errors import InvalidParameter
from btfcore.render.lights import Lights
from btfcore.render.material import (
    FactorMaterial,
    HarmonicMaterial,
    Material,
    RawMaterial,
    bare_material,
)
from btfcore.render.surfels import BARE, Surfels
from btfcore.types import F4, F8, I8

Nodes = tuple[NDArray[np.integer], NDArray[np.floating]]  # numbers and their shares, (n, m) each
_BLOCK = 1 << 14


def radiance(
    materials: Sequence[Material],
    surfels: Surfels,
    eye: F8,
    lights: Lights,
    *,
    chosen: NDArray[np.integer] | None = None,
    position: F8 | None = None,
    visible: F4 | None = None,
) -> F4:
    """Linear radiance (n, 3) f4 ≥ 0, finite, of surfels towards `eye`.

    materials : by sample number. eye (4,) f8: homogeneous scene coordinates, a point (w = 1) or
    the direction towards an eye at infinity (w = 0). chosen (n,): numbers of the surfels, None:
    all. position (n, 3): where each is looked at instead of at its own place, for pixels that
    show a part of a surfel. visible (L, n) f4 in 0–1: share of each light that arrives; None: 1.
    Raises `InvalidParameter` where a surfel names a sample that is not there.
    """
    numbers = np.arange(len(surfels)) if chosen is None else np.asarray(chosen, np.int64)
    check_samples(materials, surfels, numbers)
    out = np.zeros((len(numbers), 3), np.float32)
    bare = bare_material()
    sample = surfels.sample[numbers]
    for which in np.unique(sample):
        mine = np.flatnonzero(sample == which)
        one = bare if which == BARE else materials[which]
        for start in range(0, len(mine), _BLOCK):
            rows = mine[start : start + _BLOCK]
            place = None if position is None else position[rows]
            shown = None if visible is None else visible[:, rows]
            out[rows] = _shaded(one, surfels, numbers[rows], eye, lights, place, shown)
    return out


def check_samples(materials: Sequence[Material], surfels: Surfels, numbers: I8) -> None:
    """Raise `InvalidParameter` where one of the surfels names a sample that is not there."""
    named = surfels.sample[numbers]
    highest = int(named[named != BARE].max(initial=0))
    if len(named) and highest >= len(materials) and (named != BARE).any():
        raise InvalidParameter(f"a surfel names sample {highest}, {len(materials)} are given")


def local_views(surfels: Surfels, chosen: I8, eye: F8, position: F8 | None = None) -> F8:
    """Unit directions (n, 3) f8 towards the eye in the surfels' frames, none below the horizon."""
    place = surfels.position[chosen] if position is None else position
    away = eye[:3] - eye[3] * place.astype(np.float64)
    local = _local(surfels.frame[chosen], away)
    local[:, 2] = np.maximum(local[:, 2], 0.0)
    return _unit(local)


def local_lights(surfels: Surfels, chosen: I8, direction: F8) -> F8:
    """Unit directions (n, 3) f8 towards a light in the surfels' frames."""
    return _local(surfels.frame[chosen], np.broadcast_to(direction, (len(chosen), 3)))


def light_gain(material: FactorMaterial | RawMaterial, local: F8) -> F8:
    """What a light loses (n,): all of it below the horizon, and its cosine or fading above."""
    above = local[:, 2] > 0
    if not material.cosine:
        return np.where(above, local[:, 2], 0.0)
    gain = np.zeros(len(local))
    gain[above] = material.lights.fade(local[above])
    return gain


# --- inside


def _shaded(
    material: Material,
    surfels: Surfels,
    chosen: I8,
    eye: F8,
    lights: Lights,
    position: F8 | None,
    visible: F4 | None,
) -> F4:
    views = material.views.node_weights(local_views(surfels, chosen, eye, position))
    texels = _corners(surfels.source[chosen].astype(np.float64), material)
    out = np.zeros((len(chosen), 3))
    count = len(lights)
    if isinstance(material, HarmonicMaterial):
        weights = _harmonic_weights(material, views, texels)
        if lights.harmonics is not None:
            count -= lights.sampled
            basis = _environment(material, surfels.frame[chosen], lights.harmonics)
            out += _contracted(material, weights, basis)
    for light in range(count):
        local = local_lights(surfels, chosen, lights.direction[light])
        if isinstance(material, HarmonicMaterial):
            found = _harmonic(material, weights, local)
        else:
            nodes = material.lights.node_weights(local)
            found = _blended(material, views, nodes, texels) * light_gain(material, local)[:, None]
        if visible is not None:
            found = found * visible[light][:, None]
        out += found * lights.intensity[light]
    with np.errstate(over="ignore", invalid="ignore"):
        sound = np.nan_to_num(out, nan=0.0, posinf=3e38, neginf=0.0)
        return np.clip(sound, 0.0, 3e38).astype(np.float32)


def _blended(
    material: FactorMaterial | RawMaterial, views: Nodes, lights: Nodes, texels: Nodes
) -> F8:
    if isinstance(material, FactorMaterial):
        return _factors(material, views, lights, texels)
    return _raw(material, views, lights, texels)


def _factors(material: FactorMaterial, views: Nodes, lights: Nodes, texels: Nodes) -> F8:
    height, width = material.shape
    weights = _bilinear(material.weights.reshape(height * width, material.rank), texels)
    coded = np.zeros((len(weights), 3))
    for a, alpha in zip(views[0].T, views[1].T, strict=True):
        for b, beta in zip(lights[0].T, lights[1].T, strict=True):
            rows = material.table[a, b].astype(np.float64)
            value = np.einsum("nck,nk->nc", rows[..., :-1], weights) + rows[..., -1]
            coded += (alpha * beta)[:, None] * value
    return decode(coded, material.encoding).astype(np.float64)


def _raw(material: RawMaterial, views: Nodes, lights: Nodes, texels: Nodes) -> F8:
    height, width = material.shape
    flat = material.images.reshape(*material.images.shape[:2], height * width, 3)
    out = np.zeros((len(texels[0]), 3))
    for a, alpha in zip(views[0].T, views[1].T, strict=True):
        for b, beta in zip(lights[0].T, lights[1].T, strict=True):
            for corner, share in zip(texels[0].T, texels[1].T, strict=True):
                out += (alpha * beta * share)[:, None] * flat[a, b, corner]
    return out


def _harmonic_weights(material: HarmonicMaterial, views: Nodes, texels: Nodes) -> F8:
    """Weights (n, K + 1) between views and texels; the last is 1, that of the mean."""
    height, width = material.shape
    flat = material.weights.reshape(len(material.weights), height * width, material.rank)
    out = np.ones((len(texels[0]), material.rank + 1))
    out[:, :-1] = 0
    for a, alpha in zip(views[0].T, views[1].T, strict=True):
        for corner, share in zip(texels[0].T, texels[1].T, strict=True):
            out[:, :-1] += (alpha * share)[:, None] * flat[a, corner]
    return out


def _harmonic(material: HarmonicMaterial, weights: F8, local: F8) -> F8:
    """Radiance under one light each; beyond the outermost light that dims to the horizon."""
    height = np.maximum(local[:, 2], 0.0)
    gain = np.minimum(height / material.horizon, 1.0)
    across = np.hypot(local[:, 0], local[:, 1])
    least = np.sqrt(1 - min(material.horizon, 1.0) ** 2)
    held = local.copy()
    low = height < material.horizon
    held[low, :2] *= (least / np.maximum(across[low], 1e-30))[:, None]
    held[low, 2] = material.horizon
    basis = evaluate(held, material.order, material.kind)
    value = _contracted(material, weights, np.repeat(basis[:, :, None], 3, axis=2))
    return np.maximum(value, 0.0) * gain[:, None]


def _contracted(material: HarmonicMaterial, weights: F8, basis: F8) -> F8:
    """Radiance (n, 3) of weights (n, K + 1) under coefficients (n, M, 3) of the lighting."""
    components = material.components.astype(np.float64)
    return np.einsum("nk,kmc,nmc->nc", weights, components, basis, optimize=False)


def _environment(material: HarmonicMaterial, frames: F4, harmonics: F8) -> F8:
    """Coefficients (n, M, 3) of an environment over π in each local frame, up to the order.

    Exact: the environment is a polynomial on the sphere, so that its product with a basis
    function is integrated by a quadrature of the sum of their degrees.
    """
    order = int(np.sqrt(len(harmonics))) - 1
    points, share = quadrature(order + material.order)
    light = np.einsum("qm,mc->qc", evaluate(points, order), harmonics) * share[:, None] / np.pi
    out = np.empty((len(frames), (material.order + 1) ** 2, 3))
    for row, frame in enumerate(frames.astype(np.float64)):
        local = np.einsum("ij,qj->qi", frame, points)
        local /= np.linalg.norm(local, axis=1, keepdims=True)
        basis = evaluate(local, material.order, material.kind)
        if material.kind != "spherical":
            basis = basis * (local[:, 2] > 0)[:, None]  # its functions live above the horizon
        out[row] = np.einsum("qm,qc->mc", basis, light)
    return out


def quadrature(degree: int) -> tuple[F8, F8]:
    """Points (Q, 3) f8 and weights (Q,) that integrate polynomials of `degree` over the sphere."""
    height, weight = np.polynomial.legendre.leggauss(degree // 2 + 1)
    around = degree + 1
    phi = 2 * np.pi * np.arange(around) / around
    across = np.sqrt(1 - height**2)[:, None]
    x, y = across * np.cos(phi), across * np.sin(phi)
    z = np.broadcast_to(height[:, None], x.shape)
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return points, np.repeat(weight * 2 * np.pi / around, around)


def _corners(source: F8, material: Material) -> Nodes:
    """Flat texel numbers (n, 4) around each position (column, row), and their shares."""
    height, width = material.shape
    left, right, x = _between(source[:, 0], width, material.tiles)
    above, below, y = _between(source[:, 1], height, material.tiles)
    texel = np.stack(
        [above * width + left, above * width + right, below * width + left, below * width + right],
        axis=1,
    )
    return texel, np.stack([(1 - y) * (1 - x), (1 - y) * x, y * (1 - x), y * x], axis=1)


def _between(place: F8, size: int, tiles: bool) -> tuple[I8, I8, F8]:
    inside = place % size if tiles else np.clip(place, 0, size - 1)
    before = np.minimum(np.floor(inside).astype(np.int64), size - 1)
    after = (before + 1) % size if tiles else np.minimum(before + 1, size - 1)
    return before, after, inside - before


def _bilinear(flat: F4, texels: Nodes) -> F8:
    """Values (n, K) of a map (texels, K) at corners with shares."""
    out = np.zeros((len(texels[0]), flat.shape[1]))
    for corner, share in zip(texels[0].T, texels[1].T, strict=True):
        out += share[:, None] * flat[corner]
    return out


def _local(frame: F4, vectors: F8) -> F8:
    """Unit vectors in frames (n, 3, 3)."""
    return _unit(np.einsum("nij,nj->ni", frame.astype(np.float64), vectors))


def _unit(vectors: F8) -> F8:
    """Normalise (n, 3); what has no length becomes +s."""
    length = np.linalg.norm(vectors, axis=1)
    lost = ~((length > 0) & (length < np.inf))
    out = vectors / np.where(lost, 1.0, length)[:, None]
    out[lost] = (1.0, 0.0, 0.0)
    return out
