"""Distances of weighted views and lights are those of the weighted images themselves."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import SphericalVoronoi

from btfcore.btf.appearance import quilting_sample
from btfcore.btf.directions import from_angles, layout
from btfcore.btf.factor.svd import factorize
from btfcore.btf.sample import BtfSample, from_picture
from btfcore.btf.solid_angle import solid_angles
from btfcore.btf.stack import ArrayStack
from btfcore.btf.weights import PRESETS, direction_weights, read_weights
from btfcore.errors import InvalidBtf, InvalidParameter
from btfcore.files.package.write import write_package
from btfcore.library import meshes
from btfcore.pipeline import decorate, load_sample, load_sample_notes

HEIGHT, WIDTH, RANK = 9, 11, 12


@pytest.fixture(scope="module")
def sample():
    """Random images under 7 views and 6 lights, a few of which are missing, with factors."""
    rng = np.random.default_rng(3)
    views = from_angles(np.radians([0, 20, 40, 40, 60, 75, 75]), np.radians([0, 1, 2, 4, 5, 6, 3]))
    lights = from_angles(np.radians([5, 30, 30, 50, 70, 75]), np.radians([10, 80, 200, 5, 99, 300]))
    index = np.full((7, 6), -1, np.int32)
    there = rng.random((7, 6)) < 0.8
    index[there] = rng.permutation(int(there.sum()))
    parts = rng.random((5, HEIGHT, WIDTH, 3))
    share = rng.random((int(there.sum()), 5)) ** 3
    images = np.einsum("jp,phwc->jhwc", share, parts).astype(np.float32)
    bare = BtfSample("mixed", ArrayStack(images), views, lights, index)
    return replace(bare, factors=factorize(bare, rank=RANK, encoding="sqrt"))


def coded(sample):
    """All coded images (J, H, W, 3) as the factors know them, in float64."""
    factors = sample.factors
    parts = factors.weights.astype(np.float64), factors.basis.astype(np.float64)
    return factors.mean[:, None, None].astype(np.float64) + np.einsum("hwk,jck->jhwc", *parts)


def brute(sample, views, lights, one, two):
    """Distance of texels: root of the images' weighted mean of squared differences."""
    images = coded(sample)
    pairs = sample.pairs()
    weight = np.asarray(views)[pairs[:, 0]] * np.asarray(lights)[pairs[:, 1]]
    apart = ((images[:, *one] - images[:, *two]) ** 2).sum(axis=-1)
    return np.sqrt((weight[:, None] * apart).sum(axis=0) / weight.sum())


def distances(ready, one, two):
    values = ready.channels.astype(np.float64)
    return np.sqrt(((values[*one] - values[*two]) ** 2).sum(axis=-1))


@pytest.fixture(scope="module")
def pairs():
    rng = np.random.default_rng(0)
    rows, columns = rng.integers(0, HEIGHT, (2, 200)), rng.integers(0, WIDTH, (2, 200))
    return (rows[0], columns[0]), (rows[1], columns[1])


@pytest.mark.parametrize(
    ("views", "lights"),
    [
        ("solid-angle", None),
        (None, "frontal"),
        ("frontal", "solid-angle"),
        ([1, 2, 3, 0, 5, 0, 1e-3], [0.5, 0, 2, 1, 0, 9]),
        ([1e9] * 7, [1e-9] * 5 + [0]),
    ],
)
def test_channels_keep_the_weighted_distances_of_the_images(sample, pairs, views, lights):
    ready = quilting_sample(sample, view_weights=views, light_weights=lights)
    assert ready.channels.shape[2] <= RANK and ready.channels.dtype == np.float32
    v = direction_weights(views, sample.views, name="", kind="view")
    w = direction_weights(lights, sample.lights, name="", kind="light")
    wanted = brute(sample, np.ones(7) if v is None else v, np.ones(6) if w is None else w, *pairs)
    assert np.allclose(distances(ready, *pairs), wanted, rtol=2e-5, atol=1e-7)


def test_equal_weights_keep_the_distances_of_no_weights(sample, pairs):
    plain = quilting_sample(sample)
    equal = quilting_sample(sample, view_weights=np.full(7, 0.3), light_weights=[2.0] * 6)
    assert np.allclose(distances(plain, *pairs), distances(equal, *pairs), rtol=2e-5, atol=1e-7)


def test_uniform_is_no_weights_to_the_bit(sample):
    plain = quilting_sample(sample)
    named = quilting_sample(sample, view_weights="uniform", light_weights="uniform")
    assert np.array_equal(plain.channels, named.channels)
    scale = np.float32(1 / np.sqrt(sample.images))
    assert np.array_equal(plain.channels, sample.factors.weights * scale)


def test_one_image_leaves_its_three_colours(sample, pairs):
    view, light = sample.pairs()[4]
    ready = quilting_sample(sample, view_weights=np.eye(7)[view], light_weights=np.eye(6)[light])
    assert ready.channels.shape[2] == 3
    image = coded(sample)[4]
    wanted = np.sqrt(((image[*pairs[0]] - image[*pairs[1]]) ** 2).sum(axis=-1))
    assert np.allclose(distances(ready, *pairs), wanted, rtol=2e-5, atol=1e-7)


def test_weights_on_what_is_missing_or_uniform_are_refused(sample):
    view, light = np.argwhere(sample.index < 0)[0]
    with pytest.raises(InvalidParameter, match="0 for all of its"):
        quilting_sample(sample, view_weights=np.eye(7)[view], light_weights=np.eye(6)[light])
    factors = sample.factors
    basis = factors.basis.copy()
    view, light = sample.pairs()[0]
    basis[0] = 0
    flat = replace(sample, factors=replace(factors, basis=basis))
    with pytest.raises(InvalidBtf, match="the same everywhere"):
        quilting_sample(flat, view_weights=np.eye(7)[view], light_weights=np.eye(6)[light])


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ([1.0] * 6, "6 numbers of shape .* for 7 views"),
        ([[1.0] * 7], "for 7 views"),
        ([1, 1, -2, 1, 1, -1, 1], "number 2 is -2, and 2 of 7 are negative"),
        ([1, 1, 1, np.nan, 1, 1, 1], "number 3 is nan, and 1 of 7 are not finite"),
        ([0.0] * 7, "all 7 are 0"),
        ("solid_angle", "neither one of uniform, solid-angle, frontal nor a .csv"),
        ("nowhere.csv", "nowhere.csv: the weights cannot be read"),
    ],
)
def test_bad_weights_are_named(sample, wrong, says):
    with pytest.raises(InvalidParameter, match=says):
        quilting_sample(sample, view_weights=wrong)


def test_files_of_weights_are_read(tmp_path):
    wanted = [1.0, 0.5, 0.25, 3e-2]
    texts = {
        "one.json": json.dumps(wanted),
        "lines.csv": "weight\n# ours\n1\n0.5\n\n.25\n3e-2\n",
        "row.csv": "\ufeff1, 0.5; .25 3e-2",
        "plain.txt": "1\r\n0.5\r\n0.25\r\n0.03\r\n",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
        assert read_weights(tmp_path / name).tolist() == wanted


@pytest.mark.parametrize(
    ("name", "raw", "says"),
    [
        ("a.json", b"{}", "a list of numbers is needed, not dict"),
        ("a.json", b"[1, true]", "entry 1 is 'True', not a number"),
        ("a.json", b"[1, [2]]", "entry 1"),
        ("a.json", b"[1, 1" + b"0" * 400 + b"]", "too large"),
        ("a.json", b"[" * 100_000, "no JSON"),
        ("a.csv", b"1\n2\nthree\n", "line 3: 'three' is not a number"),
        ("a.csv", b"1\n\xff\n", "byte 2 is no UTF-8 text"),
        ("a.csv", b"1\n" * (1 << 20), "at most 1,048,576 bytes"),
        ("a.npy", b"", "nor a .csv"),
    ],
)
def test_broken_files_of_weights_are_named(tmp_path, name, raw, says):
    (tmp_path / name).write_bytes(raw)
    with pytest.raises(InvalidParameter, match=says):
        read_weights(tmp_path / name)


def test_an_ordinary_picture_has_one_view_and_one_light():
    picture = from_picture("p", np.random.default_rng(0).random((4, 5, 3)))
    plain = quilting_sample(picture)
    for preset in PRESETS:
        ready = quilting_sample(picture, view_weights=preset, light_weights=preset)
        assert np.array_equal(ready.channels, plain.channels)
    with pytest.raises(InvalidParameter, match="for 1 views"):
        quilting_sample(picture, view_weights=[1.0, 2.0])


@pytest.mark.parametrize("name", ["12x8x12x8", "ubo81", "ubo151"])
def test_solid_angles_are_voronoi_areas_of_the_hemisphere(name):
    views = layout(name).views
    areas = solid_angles(views)
    assert areas.sum() == pytest.approx(2 * np.pi, rel=1e-9)
    # mirrored at the horizon, the sphere's cells end where the hemisphere does
    whole = np.concatenate([views, views * [1, 1, -1]])
    twin = SphericalVoronoi(whole).calculate_areas()[: len(views)]
    assert np.allclose(areas, twin, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("count", [1, 2, 3, 200])
def test_solid_angles_of_few_and_of_lopsided_directions(count):
    rng = np.random.default_rng(count)
    directions = rng.standard_normal((count, 3))
    directions[:, 2] = np.abs(directions[:, 2])
    directions[0] = [1.0, 0.0, 0.0]  # on the horizon
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    areas = solid_angles(directions)
    assert (areas > 0).all() and areas.sum() == pytest.approx(2 * np.pi, rel=1e-9)
    points = rng.standard_normal((80_000, 3))
    points[:, 2] = np.abs(points[:, 2])
    points /= np.linalg.norm(points, axis=1)[:, None]
    nearest = np.einsum("pk,dk->pd", points, directions).argmax(axis=1)
    drawn = np.bincount(nearest, minlength=count) * 2 * np.pi / 80_000
    assert np.abs(drawn - areas).max() < 0.04


def test_files_of_samples_are_opened_with_weights(sample, tmp_path):
    path = write_package(tmp_path / "mixed.btfz", sample, full_floats=True)
    plain = load_sample(path)
    ready, _ = load_sample_notes(path, view_weights="frontal", light_weights="solid-angle")
    wanted = quilting_sample(sample, view_weights="frontal", light_weights="solid-angle")
    assert np.allclose(ready.channels, wanted.channels, atol=1e-5)
    assert not np.allclose(ready.channels, plain.channels, atol=1e-3)
    with pytest.raises(InvalidParameter, match="light weights: 7 numbers"):
        load_sample_notes(path, light_weights=[1.0] * 7)


def test_decorating_hands_the_weights_on(sample, tmp_path):
    path = write_package(tmp_path / "mixed.btfz", sample, full_floats=True)
    weights = tmp_path / "views.csv"
    weights.write_text("weight\n" + "\n".join("1200500"), encoding="utf-8")
    sphere = next(each for each in meshes() if each.stem == "sphere")
    done = decorate(sphere, path, rate=32, view_weights=weights, light_weights="frontal")
    wanted, _ = load_sample_notes(path, view_weights=[1, 2, 0, 0, 5, 0, 0], light_weights="frontal")
    assert np.array_equal(done.sample.channels, wanted.channels)
    assert (done.quilt.patch >= 0).all()
