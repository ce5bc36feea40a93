"""A rendered sample against the relief that it was baked from."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf.bake.build import bake
from btfcore.btf.bake.relief import relief
from btfcore.btf.directions import layout
from btfcore.btf.factor.errors import factor_errors
from btfcore.btf.factor.svd import factorize
from btfcore.btf.pbr import PbrSet
from btfcore.render.material import factor_material, raw_material, truncated
from tests.bench.interpolation import cobbles
from tests.bench.traced import traced
from tests.bench.truth import Shot, Subject, by_elevation, miss, on_grid, plane_shots, render
from tests.bench.truth_blend import by_blend, coded, exactly
from tests.bench.truth_scenes import plane, seen_straight, slope, sphere, towards

SIZE, DIRECTIONS, RANK = 16, "6x3x6x3", 20
SHARES = ["grid", "barycentric", "nearest4", "nearest"]


@pytest.fixture(scope="module")
def subject():
    pbr, wanted = cobbles(SIZE), layout(DIRECTIONS)
    sample = bake(pbr, wanted.views, wanted.lights, threads=1)
    factors = factorize(sample, rank=RANK, encoding="sqrt")
    return Subject(pbr.name, relief(pbr), replace(sample, factors=factors))


def texels():
    row, column = np.mgrid[:SIZE, :SIZE].reshape(2, -1)
    return np.stack([column, row], axis=1).astype(float)


@pytest.mark.parametrize("tiles", [True, False])
def test_what_is_traced_one_by_one_is_what_is_baked(tiles):
    pbr, wanted = replace(cobbles(SIZE), tiles=tiles), layout(DIRECTIONS)
    sample = bake(pbr, wanted.views, wanted.lights, threads=1)
    for view, light in ((0, 3), (9, 17), (17, 0), (12, 12)):
        found = traced(
            relief(pbr), texels(), np.tile(wanted.views[view], (SIZE**2, 1)),
            np.tile(wanted.lights[light], (SIZE**2, 1)),
        )  # fmt: skip
        np.testing.assert_array_equal(found.reshape(SIZE, SIZE, 3), sample.image(view, light))


def test_between_texels_a_relief_shifted_by_that_much_is_traced():
    """Half a texel along a relief that is linear between its texels, under its own shading."""
    rng = np.random.default_rng(0)
    coarse = rng.random((SIZE, SIZE)).astype(np.float32)
    flat = PbrSet("flat", np.full((SIZE, SIZE, 3), 0.5, np.float32), height=coarse, depth=2.0)
    found = relief(flat)
    moved = replace(
        found, height=np.roll(found.height, 3, axis=1), ceiling=np.roll(found.ceiling, 3, axis=1),
        maps=np.roll(found.maps, 3, axis=1),
    )  # fmt: skip
    at = rng.random((200, 2)) * SIZE
    view, light = (np.tile(towards(elevation, 20), (200, 1)) for elevation in (35, 50))
    here = traced(found, at, view, light)
    there = traced(moved, at + [3, 0], view, light)
    np.testing.assert_allclose(there, here, atol=1e-4)
    assert here.std() > 0.01


def test_below_the_horizon_nothing_is_traced(subject):
    down = np.array([[0.6, 0, -0.8]])
    up = np.array([[0.0, 0, 1]])
    for view, light in ((down, up), (up, down)):
        assert not traced(subject.relief, np.zeros((1, 2)), view, light).any()
    assert traced(subject.relief, np.zeros((1, 2)), up, up).any()


@pytest.mark.parametrize("method", SHARES)
def test_on_the_grid_images_are_the_truth_and_the_rendering(subject, method):
    sample = subject.sample
    material = raw_material(sample, method=method)
    for view, light in ((0, 0), (5, 11), (17, 2)):
        scene = seen_straight(sample.shape, sample.views[view])
        wanted = sample.image(view, light).reshape(-1, 3)
        found = scene.rendered(material, sample.lights[light])
        # a frame in single precision turns directions by 1e-7, and a highlight feels that
        np.testing.assert_allclose(found, wanted, rtol=2e-5, atol=2e-5)
        np.testing.assert_allclose(
            scene.truth(subject.relief, sample.lights[light]), wanted, rtol=1e-3, atol=1e-4
        )


@pytest.mark.parametrize("method", SHARES)
def test_on_the_grid_the_error_is_that_of_the_factors(subject, method):
    """Over every pair of directions, against what the factorisation reports of itself."""
    sample = subject.sample
    material = factor_material(sample, method=method)
    every = sample.pairs()
    wanted = [sample.image(view, light).reshape(-1, 3) for view, light in every]
    shots = [
        Shot(seen_straight(sample.shape, sample.views[view]), sample.lights[light], image)
        for (view, light), image in zip(every, wanted, strict=True)
    ]
    own = factor_errors(sample, sample.factors)
    found = miss(render(shots, material), wanted, shots)
    assert found.L2 == pytest.approx(own.rel_l2, rel=1e-4)
    assert found.SSIM == pytest.approx(own.ssim, abs=1e-4)


def test_fewer_factors_err_more_on_the_grid_by_what_they_err_themselves(subject):
    rows = on_grid(subject, (2, 5, 10, 20), count=60)
    rendered, own = (np.array([row[k] for row in rows]) for k in (2, 3))
    np.testing.assert_allclose(rendered, own, rtol=1e-4)
    assert (np.diff(rendered) < 0).all()


def test_off_the_grid_the_error_falls_with_factors_and_stays_bounded(subject):
    shots = [one for one in plane_shots(subject, 1) if one.view_bin > 1 and one.light_bin > 1]
    truth = [shot.truth for shot in shots]
    full = factor_material(subject.sample)
    off = [miss(render(shots, truncated(full, rank)), truth, shots).RMSE for rank in (0, 5, 20)]
    assert off[0] > off[1] > off[2]
    assert off[2] < 0.1


def test_a_smooth_matt_relief_on_a_sphere_is_rendered_almost_as_traced():
    """Nothing narrow between directions: waves, Lambert only, 12 azimuths."""
    row, column = np.mgrid[:SIZE, :SIZE] * (2 * np.pi / SIZE)
    height = (0.5 + 0.25 * np.cos(row) + 0.25 * np.sin(column)).astype(np.float32)
    tint = np.stack([height, 1 - height, 0 * height + 0.4], axis=-1)
    pbr, wanted = PbrSet("waves", tint, height=height, depth=1.0), layout("12x8x12x8")
    sample = bake(pbr, wanted.views, wanted.lights, threads=1, reflectance=0.0)
    scene = sphere(48, 12.0, whole=True)
    matt = relief(pbr, reflectance=0.0)
    for light in (towards(90, 0), towards(55, 40)):
        truth = scene.truth(matt, light)
        shot = Shot(scene, light, truth)
        found = miss([scene.rendered(raw_material(sample), light)], [truth], [shot])
        assert found.L2 < 0.03
        assert found.SSIM > 0.98


def test_spheres_and_planes_keep_the_symmetry_of_what_lies_on_them():
    """A sample that is its own mirror image, lit in the mirror's plane, renders one."""
    row, column = np.mgrid[:SIZE, :SIZE] * (2 * np.pi / SIZE)
    height = (0.5 + 0.25 * np.cos(row) + 0.25 * np.cos(column)).astype(np.float32)
    tint = np.stack([height, 0.5 * height, 1 - height], axis=-1)
    pbr, wanted = PbrSet("even", tint, height=height, depth=2.0), layout("12x5x12x5")
    sample = bake(pbr, wanted.views, wanted.lights, threads=1)
    # at 8, no pair of factors that are each other's mirror images is cut apart
    sample = replace(sample, factors=factorize(sample, rank=8))
    material = factor_material(sample)
    ball = sphere(40, 10.0)
    for light in (towards(90, 0), towards(40, 90)):  # in the plane x = 0
        for found in (ball.rendered(material, light), ball.truth(relief(pbr), light)):
            image = ball.picture(found)
            assert image.max() > 0.2
            np.testing.assert_allclose(image, image[:, ::-1], atol=1e-5)
    flat = plane((SIZE, SIZE), 50, 90)  # the axis lies at column 0, half a texel beside
    picture = flat.picture(replace_eye(flat).rendered(material, towards(60, -90)))
    inside = picture[:, 1:]
    np.testing.assert_allclose(inside, inside[:, ::-1], atol=1e-5)


def replace_eye(scene):
    """The same scene, seen from infinity, so that every texel has one view."""
    return replace(scene, eye=np.append(scene.eye[:3] / np.linalg.norm(scene.eye[:3]), 0.0))


def test_a_slope_recedes_and_a_sphere_shows_no_back():
    scene = slope(30, 20.0, 20)
    where = scene.surfels.position[:, 1]
    assert scene.shown.any(axis=1).sum() > 10
    rows = np.flatnonzero(scene.shown[:, 15])
    depth = [scene.picture(np.repeat(where[:, None], 3, axis=1))[row, 15, 0] for row in rows]
    assert (np.diff(depth) < 0).all()
    ball = sphere(30, 10.0)
    assert (ball.surfels.frame[:, 2, 2] > 0).all()
    product = np.einsum("nij,nkj->nik", ball.surfels.frame, ball.surfels.frame)
    np.testing.assert_allclose(product, np.tile(np.eye(3), (len(product), 1, 1)), atol=1e-6)
    assert (np.linalg.det(ball.surfels.frame) > 0.999).all()


def test_blending_codes_by_hand_is_what_rendering_does(subject):
    """A table of all images as factors (one a texel) blends what `exactly` blends."""
    sample = subject.sample
    code = sample.factors.encoding
    raw = raw_material(sample)
    whole = coded(raw, code)
    height, width = sample.shape
    count = height * width
    table = whole.images.reshape(*whole.images.shape[:2], count, 3).swapaxes(2, 3)
    table = np.concatenate([table, np.zeros((*table.shape[:3], 1), np.float32)], axis=3)
    full = replace(
        factor_material(sample), weights=np.eye(count, dtype=np.float32).reshape(*sample.shape, -1),
        table=np.ascontiguousarray(table),
    )  # fmt: skip
    scene, light = plane(sample.shape, 40, 70), towards(50, 200)
    np.testing.assert_allclose(
        exactly(whole, scene, light, code), scene.rendered(full, light), rtol=1e-4, atol=1e-5
    )
    np.testing.assert_allclose(
        exactly(raw, scene, light, None), scene.rendered(raw, light), rtol=1e-4, atol=1e-5
    )


def test_blended_codes_are_nearer_to_the_truth_where_lobes_are_narrow(subject):
    for row in by_blend(subject, 1):
        codes, radiance = row[6], row[7]  # RMSE of sRGB
        assert codes < radiance


def test_tables_of_elevation_hold_every_bin(subject):
    rows = by_elevation(subject, 1)
    assert len(rows) == 14
    values = np.array([row[3:] for row in rows])
    assert np.isfinite(values).all()
    assert (values > 0).all()
    steep, low = rows[5], rows[0]  # of the light: 75–90 and 0–15 degrees
    assert steep[5] < low[5]
