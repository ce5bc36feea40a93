"""A slow move of light or view changes a picture slowly: no flicker beyond the data's own.

Light and view move by 0.05 degrees a frame over great circles through the normal and along
rings, over every border between rings, triangles and hemisphere. The bound comes from the data:
where nodes whose values lie within D of each other blend over a distance h between them, a step
δ changes the coded value by at most 2 D δ / h, and radiance by the decoding's slope times
that.
"""

from dataclasses import dataclass

import numpy as np
import pytest

from btfcore.btf.factor.encoding import decode
from btfcore.btf.harmonics.fit import fit_harmonics
from btfcore.btf.sample import Encoding
from btfcore.render import evaluate, reference
from btfcore.render.material import factor_material, harmonic_material, raw_material
from tests.render.arranged import AT_ORIGIN, UP, arranged
from tests.render.shaded import factored, pictured

BACKENDS = {"reference": reference.radiance, "compiled": evaluate.radiance}
STEP = np.radians(0.05)
TEXELS = ((2, 3), (5, 0))  # (column, row)
SETS = ("6x2x5x2", "12x8x12x8", "ubo151")
FIXED = np.array([0.5, -0.3, 0.81]) / np.linalg.norm([0.5, -0.3, 0.81])


@pytest.fixture(params=list(BACKENDS))
def backend(request):
    return BACKENDS[request.param]


def meridian(azimuth):
    """From 2 degrees below the horizon over the normal to 2 degrees below on the other side."""
    angle = np.arange(-np.pi / 2 - 40 * STEP, np.pi / 2 + 40.5 * STEP, STEP)
    way = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    return np.sin(angle)[:, None] * way + np.cos(angle)[:, None] * [0, 0, 1.0]


def parallel(polar):
    """Once around the normal, in steps of 0.05 degrees on the sphere."""
    across = np.sin(polar)
    azimuth = np.linspace(-np.pi, np.pi, int(2 * np.pi * across / STEP) + 2)
    height = np.full(len(azimuth), np.cos(polar))
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), height], axis=1)


def sweeps(directions):
    """Paths (n, 3) that meet every border."""
    polar = np.unique(np.round(np.arccos(directions[:, 2]), 6))
    azimuth = np.arctan2(directions[-1, 1], directions[-1, 0])
    yield from (meridian(azimuth + turn) for turn in (0.0, 0.123, np.pi / 12, np.pi / 2))
    inside = polar[polar > 0]
    for each in (inside[0] / 3, inside[0], inside[-1], np.radians(83), np.pi / 2 - 1e-3):
        yield parallel(each)


@dataclass(frozen=True)
class Slopes:
    """What bounds a sweep: largest difference met, least distance, largest coded value."""

    spread: np.ndarray
    apart: float
    most: float


def nodes_of(interpolator):
    """Directions of all nodes; the made-up one stands on the normal."""
    made_up = len(interpolator.mix) - len(interpolator.directions)
    return np.concatenate([interpolator.directions, np.tile([[0, 0, 1.0]], (made_up, 1))])


def slopes(interpolator, values, path):
    """Over the nodes (values (N, 3)) that a path's queries mix."""
    index, weight = interpolator.node_weights(path)
    used = weight > 0
    shown = values[index]
    high = np.where(used[..., None], shown, -np.inf).max(axis=1)
    low = np.where(used[..., None], shown, np.inf).min(axis=1)
    any_ = used.any(axis=1)
    where = nodes_of(interpolator)
    apart = spacing(where, index, used)
    return Slopes((high - low)[any_].max(axis=0), apart, float(high[any_].max()))


def spacing(where, index, used):
    """Least altitude of the triangles, or length of the edges, among nodes that are mixed."""
    least = np.inf
    for row in np.unique(np.where(used, index, -1), axis=0):
        corner = where[row[row >= 0]]
        if len(corner) < 2:
            continue
        edges = [np.linalg.norm(a - b) for k, a in enumerate(corner) for b in corner[:k]]
        least = min(least, min(edges))
        if len(corner) == 3:
            area = np.linalg.norm(np.cross(corner[1] - corner[0], corner[2] - corner[0]))
            least = min(least, area / max(edges))
    return least


def steepest(encoding, most):
    """Largest slope of the decoding up to a coded value, and the radiance there."""
    at = np.linspace(min(0.0, most) - 6, most, 20000)
    grey = decode(np.repeat(at[:, None], 3, axis=1), encoding)[:, 0].astype(float)
    return float(np.diff(grey).max() / (at[1] - at[0])), float(grey[-1])


def coded_nodes(material, path_is_light, fixed, texel):
    """Coded values (N, 3) of every node on the swept side, the other side being fixed."""
    column, row = texel
    other = material.views if path_is_light else material.lights
    index, weight = other.node_weights(fixed[None])
    if hasattr(material, "table"):
        every = material.table.astype(float)
        values = every[..., :-1] @ material.weights[row, column].astype(float) + every[..., -1]
    else:
        values = material.images[:, :, row, column].astype(float)
    values = values if path_is_light else np.swapaxes(values, 0, 1)
    return np.einsum("k,knc->nc", weight[0].astype(float), values[index[0]])


def changes(backend, material, path, moving, texel):
    """Largest change (3,) between adjacent frames of a sweep of light or view."""
    fixed = np.broadcast_to(FIXED, path.shape)
    views, lights = (fixed, path) if moving == "light" else (path, fixed)
    values = backend([material], arranged(views, lights, texel), AT_ORIGIN, UP)
    assert np.isfinite(values).all()
    return np.abs(np.diff(values.astype(float), axis=0)).max(axis=0)


def bound(material, path, moving, texel, encoding):
    """What the data allows a step to change, per channel."""
    lit = moving == "light"
    nodes = coded_nodes(material, lit, FIXED, texel)
    found = slopes(material.lights if lit else material.views, nodes, path)
    slope, brightest = steepest(encoding, found.most)
    fading = brightest / material.lights.directions[:, 2].min() if lit else 0.0
    rounding = 2e-5 * max(1.0, brightest)  # frames and values are single floats
    return slope * 2 * found.spread * STEP / found.apart + fading * STEP + rounding


@pytest.mark.parametrize("moving", ["light", "view"])
@pytest.mark.parametrize("method", ["grid", "barycentric"])
@pytest.mark.parametrize("directions", SETS)
@pytest.mark.parametrize("encoding", ["sqrt", "log", "linear"])
def test_radiance_of_factors_changes_no_faster_than_the_data(
    backend, directions, method, moving, encoding
):
    sample = factored(directions=directions, encoding=encoding, rank=3, height=4, width=6)
    material = factor_material(sample, method=method)
    for path in sweeps(material.lights.directions):
        for texel in TEXELS:
            most = changes(backend, material, path, moving, texel)
            allowed = bound(material, path, moving, texel, sample.factors.encoding)
            assert (most <= allowed).all(), (most, allowed)


@pytest.mark.parametrize("moving", ["light", "view"])
@pytest.mark.parametrize("method", ["grid", "barycentric"])
@pytest.mark.parametrize("cosine", [True, False])
def test_radiance_of_images_changes_no_faster_than_the_data(backend, method, moving, cosine):
    sample = pictured(directions="6x2x5x2", height=4, width=6, cosine=cosine)
    material = raw_material(sample, method=method)
    for path in sweeps(material.lights.directions):
        most = changes(backend, material, path, moving, TEXELS[0])
        allowed = bound(material, path, moving, TEXELS[0], Encoding("linear"))
        if not cosine:  # the cosine itself changes by a step, all over the hemisphere
            allowed = allowed + STEP
        assert (most <= allowed).all(), (most, allowed)


def test_the_nearest_directions_jump_by_more_than_the_data(backend):
    """What the documentation says of them, and that the bound is tight enough to tell."""
    sample = factored(directions="12x8x12x8", rank=3, height=4, width=6)
    for method in ("nearest4", "nearest"):
        material = factor_material(sample, method=method)
        path = meridian(0.123)
        for moving in ("light", "view"):
            most = changes(backend, material, path, moving, TEXELS[0])
            allowed = bound(material, path, moving, TEXELS[0], sample.factors.encoding)
            assert (most > 1.5 * allowed).any()


def test_harmonics_change_no_faster_than_their_series(backend):
    """|∇Σ c Y|² ≤ Σ_l |c_l|² · Σ_l l (l + 1)(2 l + 1) / 4π, by the addition theorem."""
    sample = pictured(directions="6x3x6x3", height=4, width=6)
    fitted = fit_harmonics(sample, order=2, errors=False)
    material = harmonic_material(fitted, sample)
    column, row = TEXELS[0]
    index, weight = material.views.node_weights(FIXED[None])
    mixed = np.einsum("k,kw->w", weight[0], material.weights[index[0], row, column].astype(float))
    series = np.einsum("k,kmc->mc", np.append(mixed, 1.0), material.components.astype(float))
    order = np.floor(np.sqrt(np.arange(len(series))))
    gain = np.arange(material.order + 1)
    gain = np.sqrt(gain * (gain + 1) * (2 * gain + 1) / (4 * np.pi))
    size = np.stack([np.sqrt((series[order == k] ** 2).sum(axis=0)) for k in range(len(gain))])
    slope = np.einsum("k,kc->c", gain, size)
    brightest = 0.0
    for path in sweeps(sample.lights):
        fixed = np.broadcast_to(FIXED, path.shape)
        where = arranged(fixed, path, TEXELS[0])
        values = backend([material], where, AT_ORIGIN, UP).astype(float)
        most = np.abs(np.diff(values, axis=0)).max(axis=0)
        fading = values.max() / material.horizon * STEP
        assert (most <= slope * STEP + fading + 2e-5).all()
        brightest = max(brightest, float(values.max()))
    assert brightest > 0.1


def test_bounds_come_from_what_is_met():
    """The spread is that of the nodes met, the distance that of the closest of them."""
    material = factor_material(factored(directions="6x2x5x2"))
    values = np.zeros((len(material.lights.mix), 3))
    values[0] = 1.0
    found = slopes(material.lights, values, meridian(0.0))
    np.testing.assert_array_equal(found.spread, 1.0)
    around = material.lights.directions
    assert 0 < found.apart <= np.linalg.norm(around[0] - around[1]) + 1e-9
    square = Encoding("sqrt")
    slope, brightest = steepest(square, 2.0)
    assert slope == pytest.approx(4.0, rel=1e-3)
    assert brightest == pytest.approx(4.0)
