"""The whole fit: exact where it can be, its errors add up, blocks and threads change nothing."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf.colour import linear_to_srgb
from btfcore.btf.directions import Layout, layout
from btfcore.btf.harmonics import sweep
from btfcore.btf.harmonics.evaluate import HarmonicStack
from btfcore.btf.harmonics.fit import fit_harmonics
from btfcore.btf.sample import NORMAL, from_picture
from btfcore.btf.stack import ArrayStack
from btfcore.errors import Cancelled, InvalidParameter
from tests.btf.harmonics.scenes import banded, bumpy, few_views, sample, without

SMALL = few_views("12x5x12x5", 5)


@pytest.fixture(scope="module")
def scene():
    return bumpy(SMALL, 8)


def reconstructed(found, scene):
    """All images of the factors, unclipped errors included, in the order of the sample."""
    stack = HarmonicStack(found, scene.lights, scene.pairs())
    return stack.read(np.arange(scene.images)).astype(np.float64)


@pytest.mark.parametrize(
    "name, order, kind", [("12x8x12x8", 4, "spherical"), ("ubo151", 6, "hemispherical")]
)
@pytest.mark.parametrize("centred", [True, False])
@pytest.mark.parametrize("metric", ["radiance", "coefficients"])
def test_harmonics_on_few_axes_come_back(name, order, kind, centred, metric):
    scene, truth = banded(few_views(name), order, kind)
    knobs = {"kind": kind, "ridge": 0, "centred": centred, "metric": metric}
    found = fit_harmonics(scene, order=order, components=3 if centred else 4, **knobs)
    vectors = found.mean + np.einsum(
        "vijk,kmc->vijmc", found.weights.astype(np.float64), found.components
    )
    # the images are f4, which the smallest singular value magnifies
    np.testing.assert_allclose(vectors, truth.transpose(0, 2, 3, 1, 4), atol=2e-3)
    assert found.errors.total < 3e-6
    whole = scene.stack.read(np.arange(scene.images))
    np.testing.assert_allclose(reconstructed(found, scene), whole, rtol=2e-5)


def test_errors_add_up_and_are_those_of_the_images(scene):
    scene = replace(scene, stack=ArrayStack(scene.stack.images + np.float32(0.1)))
    found = fit_harmonics(scene, order=3, components=6, ridge=0)
    errors = found.errors
    assert errors.total**2 == pytest.approx(errors.truncation**2 + errors.pca**2, rel=1e-4)
    whole, again = scene.stack.read(np.arange(scene.images)), reconstructed(found, scene)
    assert (again > 0).all()  # so that nothing was cut
    relative = np.linalg.norm(again - whole) / np.linalg.norm(whole.astype(float))
    assert errors.total == pytest.approx(relative, rel=1e-5)
    coded = linear_to_srgb(again).astype(float) - linear_to_srgb(whole)
    images = np.sqrt((coded**2).mean(axis=(1, 2, 3)))
    assert errors.srgb == pytest.approx(images.mean(), rel=1e-3)
    assert errors.srgb_worst == pytest.approx(images.max(), rel=1e-3)
    assert errors.worst == tuple(scene.pairs()[images.argmax()])
    view = slice(60, 120)
    one = np.linalg.norm(again[view] - whole[view]) / np.linalg.norm(whole[view].astype(float))
    assert errors.per_view[1, 2] == pytest.approx(one, rel=1e-5)


def test_the_error_of_pca_is_the_sum_of_the_dropped_variances(scene):
    """In the metric of radiance: per texel and light, so that all of them make the L2 error."""
    found = fit_harmonics(scene, order=3, components=5)
    whole = scene.stack.read(np.arange(scene.images)).astype(float)
    dropped = found.variances[5:].sum() * scene.images * 64
    expected = np.sqrt(dropped / (whole**2).sum())
    assert found.errors.pca == pytest.approx(expected, rel=1e-4)


def test_more_components_and_higher_orders_fit_better(scene):
    by_rank = [fit_harmonics(scene, components=k).errors for k in (1, 2, 4, 8, 16)]
    assert (np.diff([e.pca for e in by_rank]) < 0).all()
    assert np.ptp([e.truncation for e in by_rank]) < 1e-12
    by_order = [fit_harmonics(scene, order=o).errors.truncation for o in (0, 1, 2, 3, 4)]
    assert (np.diff(by_order) < 0).all()


def test_the_metric_of_radiance_is_the_better_one_for_images(scene):
    for kind in ("spherical", "hemispherical"):
        one, two = (
            fit_harmonics(scene, kind=kind, components=6, metric=metric).errors.pca
            for metric in ("radiance", "coefficients")
        )
        assert one < two


def test_the_paper_taken_literally(scene):
    found = fit_harmonics(
        *(scene,), quadrature="cubemap", metric="coefficients", centred=False, samples=100
    )
    assert (found.mean == 0).all() and found.rank == 16
    plain = fit_harmonics(scene)
    assert plain.errors.total < found.errors.total < 0.4


def test_bands_memory_and_threads_change_nothing(scene, monkeypatch):
    once = fit_harmonics(scene, threads=1)
    threaded = fit_harmonics(scene, threads=3)
    for item in ("weights", "components", "mean", "variances"):
        np.testing.assert_array_equal(getattr(threaded, item), getattr(once, item))
    assert threaded.errors.total == once.errors.total
    monkeypatch.setattr(sweep, "TEXELS_AT_ONCE", 20)
    monkeypatch.setattr(sweep, "READ_MB", 0.002)
    banded_fit = fit_harmonics(scene)
    np.testing.assert_allclose(banded_fit.weights, once.weights, atol=1e-6)
    np.testing.assert_allclose(banded_fit.components, once.components, atol=1e-9)
    assert banded_fit.errors.total == pytest.approx(once.errors.total, rel=1e-9)


def test_little_memory_reads_in_pieces_and_maps_the_weights():
    scene = bumpy(Layout("few", SMALL.views[:2].copy(), SMALL.lights), 96)
    small, large = fit_harmonics(scene, memory_mb=2), fit_harmonics(scene)
    assert isinstance(small.weights, np.memmap) and not isinstance(large.weights, np.memmap)
    np.testing.assert_allclose(small.weights, large.weights, atol=1e-5)
    assert small.errors.total == pytest.approx(large.errors.total, rel=1e-6)
    assert not small.weights.flags.writeable


def test_half_weights_are_nearly_as_good_and_never_overflow(scene):
    for brightness in (1.0, 1e6, 1e-7):
        bright = replace(scene, stack=ArrayStack(scene.stack.images * np.float32(brightness)))
        full, half = fit_harmonics(bright), fit_harmonics(bright, half=True)
        assert half.weights.dtype == np.float16 and np.isfinite(half.weights).all()
        assert half.errors.total == pytest.approx(full.errors.total, rel=1e-3)


def test_sampled_vectors_give_nearly_the_same_axes(scene):
    full = fit_harmonics(scene, components=8)
    some = fit_harmonics(scene, components=8, samples=200, seed=3)
    again = fit_harmonics(scene, components=8, samples=200, seed=3)
    np.testing.assert_array_equal(some.weights, again.weights)
    assert full.errors.pca < some.errors.pca < 1.5 * full.errors.pca
    whole = fit_harmonics(scene, components=8, samples=10**6)
    np.testing.assert_array_equal(whole.weights, full.weights)


def test_missing_images_are_fitted_around(scene):
    pairs = [(0, 3), (2, 17), (2, 18)]
    found = fit_harmonics(without(scene, pairs))
    whole = fit_harmonics(scene)
    assert found.errors.total == pytest.approx(whole.errors.total, rel=0.05)
    assert any("3 images are missing" in note for note in found.notes)


def test_singular_combinations(scene):
    with pytest.raises(InvalidParameter, match="bumpy: .*order 5.*36.*60 lights.*up to 4"):
        fit_harmonics(scene, order=5)
    found = fit_harmonics(scene, order=5, singular="regularise")
    assert "order 5" in found.notes[0] and "regularised" in found.notes[0]
    assert found.errors.truncation < fit_harmonics(scene).errors.truncation * 1.01


def test_a_constant_sample_is_its_mean():
    lights = layout("12x5x12x5")
    scene = sample("flat", np.full((120, 2, 3, 3), 0.25), lights.views[:2].copy(), lights.lights)
    found = fit_harmonics(scene, components=9, ridge=0)
    assert found.rank == 1 and np.abs(found.weights).max() < 1e-9
    np.testing.assert_allclose(reconstructed(found, scene), 0.25, atol=1e-6)
    black = fit_harmonics(replace(scene, stack=ArrayStack(np.zeros((120, 2, 3, 3), np.float32))))
    assert black.errors.total == 0 and black.errors.srgb == 0 and (black.mean == 0).all()


def test_a_picture_is_order_zero():
    picture = np.random.default_rng(0).uniform(size=(5, 4, 3)).astype(np.float32)
    scene = from_picture("rug", picture)
    with pytest.raises(InvalidParameter, match="rug: .*only 1 of .*1 light "):
        fit_harmonics(scene)
    found = fit_harmonics(scene, order=0, ridge=0)
    assert found.rank == 3
    again = HarmonicStack(found, NORMAL).read([0])[0]
    np.testing.assert_allclose(again, picture, atol=1e-6)


def test_one_texel_and_saturated_highlights():
    scene = bumpy(SMALL, 1, shine=1e6)
    found = fit_harmonics(scene, ridge=0)
    assert found.rank == 4 and np.isfinite(found.weights).all()  # five vectors about their mean
    assert found.errors.pca < 1e-6


def test_images_that_are_no_radiance_are_read_as_mended():
    images = np.array(bumpy(SMALL, 3).stack.images)
    images[7, 1, 1, 0], images[9, 0, 0, 2], images[11, 2, 2, 1] = np.nan, np.inf, -4
    found = fit_harmonics(sample("flawed", images, SMALL.views, SMALL.lights))
    assert np.isfinite(found.weights).all() and np.isfinite(found.errors.total)


def test_progress_rises_to_one_and_cancels(scene):
    seen = []
    fit_harmonics(scene, progress=lambda fraction, label: seen.append(fraction))
    assert seen == sorted(seen) and seen[-1] == 1 and len(seen) > 20

    def stop(fraction, label):
        if fraction > 0.6:
            raise Cancelled

    with pytest.raises(Cancelled):
        fit_harmonics(scene, progress=stop)


def test_without_errors_the_fit_is_the_same(scene):
    bare, full = fit_harmonics(scene, errors=False), fit_harmonics(scene)
    assert bare.errors is None
    np.testing.assert_array_equal(bare.weights, full.weights)


@pytest.mark.parametrize(
    "knob",
    [
        {"components": 0},
        {"metric": "taste"},
        {"samples": 0},
        {"memory_mb": 0.5},
        {"threads": 0},
        {"order": 7},
        {"kind": "cubic"},
        {"singular": "perhaps"},
        {"quadrature": "cubemap", "side": 5},
    ],
)
def test_knobs_out_of_range(scene, knob):
    with pytest.raises(InvalidParameter, match=str(list(knob.values())[-1])):
        fit_harmonics(scene, **knob)
