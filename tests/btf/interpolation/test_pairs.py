"""Pairs: the product of both weights, and what happens where images are missing."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf.directions import layout
from btfcore.btf.interpolation.pairs import pair_weights, settled
from btfcore.btf.interpolation.radiance import prepared
from btfcore.btf.sample import BtfSample, full_index
from btfcore.btf.stack import ArrayStack
from tests.btf.interpolation.sets import dense, scattered

LAYOUT = layout("6x3x8x2")
VIEWS, LIGHTS = scattered(300, 1), scattered(300, 2)


def sample(missing=()):
    """One texel an image, some images missing."""
    index = full_index(18, 16)
    keep = np.ones(18 * 16, bool)
    keep[list(missing)] = False
    index = np.where(keep, np.cumsum(keep) - 1, -1).astype(np.int32).reshape(18, 16)
    images = np.arange(keep.sum(), dtype=np.float32)[:, None, None, None] * np.ones(3, np.float32)
    return BtfSample("s", ArrayStack(images), LAYOUT.views, LAYOUT.lights, index)


def mixtures(btf, method="auto"):
    view, light = prepared(btf, method)
    return view.weights(VIEWS), light.weights(LIGHTS)


@pytest.mark.parametrize("method", ["grid", "barycentric", "nearest4", "nearest"])
def test_the_weight_of_an_image_is_that_of_its_view_times_that_of_its_light(method):
    btf = sample()
    view, light = mixtures(btf, method)
    found = dense(pair_weights(btf, view, light), btf.images)
    want = dense(view, 18)[:, :, None] * dense(light, 16)[:, None, :]
    np.testing.assert_allclose(found, want.reshape(300, -1), atol=1e-15)


def test_missing_images_are_made_up_for_by_the_others():
    rng = np.random.default_rng(4)
    missing = np.flatnonzero(rng.random(288) < 0.2)
    btf, whole = sample(missing), sample()
    view, light = mixtures(btf)
    found = dense(pair_weights(btf, view, light, substitute=False), btf.images)
    full = np.delete(dense(pair_weights(whole, view, light), 288), missing, axis=1)
    total = full.sum(axis=1, keepdims=True)
    want = np.divide(full, total, out=np.zeros_like(full), where=total > 0)
    np.testing.assert_allclose(found, want, atol=1e-14)
    assert (total < 1).any()


def test_where_all_are_missing_the_nearest_pair_stands_in():
    present = [3 * 16 + 5, 17 * 16 + 1]
    btf = sample(np.setdiff1d(np.arange(288), present))
    view, light = mixtures(btf, "nearest")
    assert (pair_weights(btf, view, light, substitute=False)[1] == 0).sum() > 250
    image, weight = pair_weights(btf, view, light)
    assert (weight.sum(axis=1) == 1).all()
    one, two = view[0][:, 0], light[0][:, 0]
    far = [
        np.arccos(np.clip(LAYOUT.views[one] @ LAYOUT.views[v], -1, 1)) ** 2
        + np.arccos(np.clip(LAYOUT.lights[two] @ LAYOUT.lights[k], -1, 1)) ** 2
        for v, k in ((3, 5), (17, 1))
    ]
    np.testing.assert_array_equal(image[:, 0], (far[1] < far[0] - 1e-12).astype(int))


def test_a_view_or_light_below_the_horizon_stays_black():
    for btf in (sample(), sample(range(287))):
        view, light = mixtures(btf)
        dark = (view[0], np.zeros_like(view[1]))
        assert (pair_weights(btf, dark, light)[1] == 0).all()
        assert (pair_weights(btf, light=(light[0], 0 * light[1]), view=view)[1] == 0).all()


def test_settled_weights_join_doubles_and_drop_specks():
    image = np.array([7, 2, 7, 4, 0], np.int32)
    numbers, weight = settled(image, np.array([0.25, 0.5, 0.25, 1e-9, 0.0]))
    assert numbers.tolist() == [2, 7]
    np.testing.assert_allclose(weight, [0.5, 0.5])
    assert settled(image, np.zeros(5))[0].size == 0


def test_the_kind_of_float_is_kept():
    btf = replace(sample(), name="other")
    view, light = prepared(btf)
    single = pair_weights(
        btf, view.weights(VIEWS.astype(np.float32)), light.weights(LIGHTS.astype(np.float32))
    )
    assert single[1].dtype == np.float32
