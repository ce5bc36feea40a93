"""Laws of the definition of radiance, and of what samples are rendered from."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf.harmonics.basis import evaluate
from btfcore.btf.harmonics.fit import fit_harmonics
from btfcore.btf.interpolation.radiance import picture
from btfcore.btf.sample import from_picture
from btfcore.errors import InvalidBtf, InvalidParameter
from btfcore.render.lights import NONE, Lights, directional, joined
from btfcore.render.material import (
    bare_material,
    factor_material,
    harmonic_material,
    material,
    raw_material,
    truncated,
)
from btfcore.render.reference import quadrature, radiance
from btfcore.render.surfels import BARE, Surfels
from tests.render.shaded import factored, flat, pictured, rotations, scattered

ABOVE = np.array([0.0, 0.0, 1.0, 0.0])


def seen_from(direction):
    return np.append(np.asarray(direction, float), 0.0)


def unit(vector):
    return np.asarray(vector, float) / np.linalg.norm(vector)


@pytest.mark.parametrize("method", ["grid", "barycentric", "nearest4", "nearest"])
def test_raw_images_are_those_of_the_sample_s_own_interpolation(method):
    sample = pictured()
    shaped = raw_material(sample, method=method)
    for view, light in (([0.3, 0.1, 0.9], [-0.2, 0.4, 0.7]), ([0, 0, 1], [0.9, 0, 0.1])):
        view, light = unit(view), unit(light)
        found = radiance([shaped], flat(*sample.shape), seen_from(view), directional(light))
        expected = picture(sample, view, light, method=method, fade=True)
        np.testing.assert_allclose(found.reshape(expected.shape), expected, atol=2e-6)


@pytest.mark.parametrize("encoding", ["linear", "sqrt", "log", "logluma"])
def test_on_the_grid_factors_give_the_image_itself(encoding):
    sample = factored(encoding=encoding)
    from btfcore.btf.factor.stack import FactorStack

    own = replace(sample, stack=FactorStack(sample.factors))
    shaped = factor_material(sample)
    for view in (0, 7):
        for light in (1, 9):
            found = radiance(
                [shaped], flat(*sample.shape), seen_from(sample.views[view]),
                directional(sample.lights[light]),
            )  # fmt: skip
            expected = own.image(view, light).reshape(-1, 3)
            np.testing.assert_allclose(found, expected, atol=2e-5)


def test_a_picture_is_lambertian():
    colours = np.random.default_rng(0).random((3, 4, 3)).astype(np.float32)
    shaped = material(from_picture("wall", colours))
    for angle in (0, 30, 60, 89, 90, 120):
        light = [np.sin(np.radians(angle)), 0, np.cos(np.radians(angle))]
        found = radiance([shaped], flat(3, 4), ABOVE, directional(light))
        expected = colours.reshape(-1, 3) * max(np.cos(np.radians(angle)), 0)
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_lights_add_up_and_scale():
    sample = factored()
    where, eye = scattered(50), np.array([0.1, 0.2, 3.0, 1.0])
    one = directional([0.1, 0.3, 0.9], [1.0, 2.0, 0.5])
    two = directional([-0.6, 0.3, 0.4], 3.0)
    both = joined([one, two])
    shaped = [factor_material(sample)]
    parts = [radiance(shaped, where, eye, each).astype(float) for each in (one, two)]
    np.testing.assert_allclose(radiance(shaped, where, eye, both), sum(parts), rtol=1e-5, atol=1e-6)
    assert not radiance(shaped, where, eye, NONE).any()
    shade = np.stack([np.full(50, 0.25), np.zeros(50)]).astype(np.float32)
    found = radiance(shaped, where, eye, both, visible=shade)
    np.testing.assert_allclose(found, parts[0] * 0.25, rtol=1e-5, atol=1e-6)


def test_turning_everything_changes_nothing():
    sample, where = factored(), scattered(60)
    eye, light = np.array([0.4, -0.2, 2.5, 1.0]), unit([0.2, -0.5, 0.8])
    turn = rotations(1, seed=5)[0].astype(np.float64)
    moved = Surfels(
        (where.position @ turn.T).astype(np.float32),
        (where.frame.astype(np.float64) @ turn.T).astype(np.float32),
        where.source, where.sample,
    )  # fmt: skip
    shaped = [factor_material(sample)]
    before = radiance(shaped, where, eye, directional(light))
    eye_turned = np.append(turn @ eye[:3], 1.0)
    after = radiance(shaped, moved, eye_turned, directional(turn @ light))
    np.testing.assert_allclose(after, before, atol=2e-5)


def test_views_below_the_horizon_count_as_on_it_and_lights_there_give_nothing():
    sample = factored()
    shaped, where = [factor_material(sample)], flat(*sample.shape)
    light = directional([0.2, 0.1, 0.9])
    low = radiance(shaped, where, seen_from(unit([1, 0.5, -0.6])), light)
    edge = radiance(shaped, where, seen_from(unit([1, 0.5, 0.0])), light)
    np.testing.assert_array_equal(low, edge)
    behind = radiance(shaped, where, seen_from([0, 0, -1]), light)
    np.testing.assert_array_equal(behind, radiance(shaped, where, seen_from([1, 0, 0]), light))
    for z in (0.0, -1e-9, -1.0):
        assert not radiance(shaped, where, ABOVE, directional([0.3, 0.2, z])).any()


@pytest.mark.parametrize("cosine", [True, False])
@pytest.mark.parametrize("kind", ["factors", "raw", "harmonics"])
def test_radiance_goes_to_black_at_the_horizon_without_a_jump(kind, cosine):
    sample = replace(pictured(directions="6x3x6x3", cosine=cosine))
    shaped = (
        harmonic_material(fit_harmonics(sample, order=2, errors=False), sample)
        if kind == "harmonics" else material(sample, representation=kind)
    )  # fmt: skip
    heights = np.array([1e-2, 1e-3, 1e-4])
    found = [
        radiance([shaped], flat(*sample.shape), ABOVE, directional([0.7, 0.4, z])).max()
        for z in heights
    ]
    assert found[0] > 0
    np.testing.assert_allclose(found / found[0], heights / heights[0], rtol=0.02)


def test_missing_images_are_filled_by_the_nearest():
    sample = factored()
    index = sample.index.copy()
    gone = index[4, 3]
    keep = np.delete(np.arange(sample.images), gone)
    index[index > gone] -= 1
    index[4, 3] = -1
    factors = replace(
        sample.factors, basis=sample.factors.basis[keep], mean=sample.factors.mean[keep]
    )
    from btfcore.btf.stack import SubsetStack

    holed = replace(sample, stack=SubsetStack(sample.stack, keep), index=index, factors=factors)
    shaped = factor_material(holed)
    whole = factor_material(sample)
    other = np.abs(shaped.table - whole.table).reshape(*whole.table.shape[:2], -1).max(axis=2) > 0
    assert other[4, 3]
    pairs = [(4, light) for light in range(len(sample.lights)) if light != 3]
    pairs += [(view, 3) for view in range(len(sample.views)) if view != 4]
    assert any(np.array_equal(shaped.table[4, 3], whole.table[pair]) for pair in pairs)
    assert other[:-1, :-1].sum() == 1  # the last rows are the means around the normal


def test_truncation_keeps_the_first_factors():
    shaped = factor_material(factored(rank=5))
    short = truncated(shaped, 2)
    assert short.rank == 2
    np.testing.assert_array_equal(short.table[..., -1], shaped.table[..., -1])
    np.testing.assert_array_equal(short.weights, shaped.weights[..., :2])
    full = truncated(shaped, 5)
    where, light = scattered(30), directional([0.3, 0.2, 0.8])
    eye = np.array([0.0, 0.5, 3.0, 1.0])
    np.testing.assert_array_equal(
        radiance([full], where, eye, light), radiance([shaped], where, eye, light)
    )
    with pytest.raises(InvalidParameter, match="6 of 5"):
        truncated(shaped, 6)


def test_bare_surfels_are_grey_and_other_samples_keep_theirs():
    where = scattered(40, samples=2)
    sample = where.sample.copy()
    sample[::5] = BARE
    mixed = Surfels(where.position, where.frame, where.source, sample)
    shaped = [factor_material(factored(seed=1)), material(from_picture("x", np.ones((6, 7, 3))))]
    eye, light = np.array([0.0, 0.0, 3.0, 1.0]), directional([0.3, 0.2, 0.8])
    found = radiance(shaped, mixed, eye, light)
    for number, one in ((0, shaped[0]), (1, shaped[1]), (BARE, bare_material())):
        rows = np.flatnonzero(sample == number)
        only = Surfels(
            where.position[rows], where.frame[rows], where.source[rows],
            np.zeros(len(rows), np.uint16),
        )  # fmt: skip
        np.testing.assert_array_equal(found[rows], radiance([one], only, eye, light))
    with pytest.raises(InvalidParameter, match="sample 1, 1 are given"):
        radiance(shaped[:1], mixed, eye, light)


def test_quadrature_is_exact_up_to_its_degree():
    for degree in (0, 3, 6):
        points, weights = quadrature(degree)
        for order in range(degree // 2 + 1):
            gram = np.einsum(
                "qi,qj,q->ij", evaluate(points, order), evaluate(points, order), weights
            )
            np.testing.assert_allclose(gram, np.eye(len(gram)), atol=1e-12)


def test_an_environment_in_harmonics_is_the_sum_of_its_lights():
    """A band-limited environment, taken as coefficients or as many lights of an unclipped fit."""
    sample = pictured(directions="6x3x6x3")
    fitted = fit_harmonics(sample, order=2, errors=False)
    shaped = harmonic_material(fitted, sample)
    rng = np.random.default_rng(0)
    harmonics = rng.standard_normal((9, 3)) * 0.1
    harmonics[0] = 3.0
    where = scattered(5)
    sky = Lights(np.array([[0, 0, 1.0]]), np.ones((1, 3)), sampled=1, harmonics=harmonics)
    eye = np.array([0.0, 0.0, 3.0, 1.0])
    found = radiance([shaped], where, eye, sky)
    # by hand: many directions, the series at each of them in the surfels' own frames
    points, share = quadrature(24)
    light = np.einsum("qm,mc->qc", evaluate(points, 2), harmonics) * share[:, None] / np.pi
    lone = Lights(np.array([[0, 0, 1.0]]), np.zeros((1, 3)))
    from btfcore.render import reference

    total = np.zeros((5, 3))
    numbers = np.arange(5)
    views = shaped.views.node_weights(reference.local_views(where, numbers, eye))
    weights = reference._harmonic_weights(
        shaped, views, reference._corners(where.source.astype(float), shaped)
    )
    for point, value in zip(points, light, strict=True):
        basis = evaluate(reference.local_lights(where, numbers, point), 2)
        series = np.einsum("nk,kmc,nm->nc", weights, shaped.components.astype(float), basis)
        total += series * value
    np.testing.assert_allclose(found, np.maximum(total, 0), rtol=1e-4, atol=1e-5)
    assert not radiance([shaped], where, eye, lone).any()


def test_what_cannot_be_rendered_is_refused_by_name():
    sample = pictured()
    with pytest.raises(InvalidBtf, match="factorised"):
        factor_material(sample)
    with pytest.raises(InvalidParameter, match="need 0 MiB"):
        raw_material(sample, memory_mb=1e-6)
    with pytest.raises(InvalidParameter, match="representation 'neural'"):
        material(sample, representation="neural")
    assert material(sample).rank <= 40
