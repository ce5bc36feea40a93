"""Nothing that is looked at, lit or stored badly gives a pixel that is no colour."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf.colour import linear_to_srgb
from btfcore.pipeline import load_mesh, prepare
from btfcore.render import evaluate, reference
from btfcore.render.lights import BRIGHTEST, NONE, Lights, directional, joined
from btfcore.render.material import FactorMaterial, HarmonicMaterial, RawMaterial, factor_material
from btfcore.render.surfels import BARE, Surfels, placement, surfels, turned_frames
from btfcore.render.tonemap import develop
from btfcore.types import Quilt
from tests.bench.inputs import found
from tests.render.arranged import AT_ORIGIN, UP, arranged, every_material
from tests.render.shaded import factored, scattered

BACKENDS = {"reference": reference.radiance, "compiled": evaluate.radiance}
MATERIALS = dict(every_material())
SOURCE = (2.4, 3.3)


@pytest.fixture(params=list(BACKENDS))
def backend(request):
    return BACKENDS[request.param]


@pytest.fixture(params=list(MATERIALS))
def material(request):
    return MATERIALS[request.param]


def sound(values):
    """The values, which must be colours: finite and not negative."""
    assert values.dtype == np.float32
    assert np.isfinite(values).all()
    assert (values >= 0).all()
    return values


def around(azimuths, height):
    """Unit vectors at exact heights z over azimuths."""
    across = np.sqrt(max(1 - height * height, 0.0))
    return np.stack(
        [across * np.cos(azimuths), across * np.sin(azimuths), height + 0 * azimuths], axis=1
    )


def awkward(directions):
    """Local directions where something may go wrong: poles, horizon, wrap, nodes."""
    azimuths = np.array([0, np.pi, -np.pi, np.nextafter(np.pi, 0), np.pi / 2, 1e-12, -1e-12, 2.0])
    rows = [np.eye(3), -np.eye(3), directions]
    for height in (0.0, 1e-30, 1e-9, -1e-9, 1e-4, -1e-4, 1e-2, -1e-2, 0.5, 1 - 1e-9, 1e-3 - 1):
        rows.append(around(azimuths, height))
    # between neighbours, and a hair beside directions of the sample
    rows += [directions + [1e-9, 0, 0], directions * [-1, -1, 1], directions * [1, 1, -1]]
    vectors = np.concatenate(rows)
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def pairs(material):
    views = awkward(material.views.directions)
    lamps = material.views if isinstance(material, HarmonicMaterial) else material.lights
    lights = awkward(lamps.directions)
    v, l_ = np.meshgrid(np.arange(len(views)), np.arange(len(lights)), indexing="ij")
    return views[v.ravel()], lights[l_.ravel()]


def test_directions_are_met_as_arranged():
    views, lights = (np.concatenate([awkward(np.eye(3)), -np.eye(3)]) for _ in range(2))
    lights = np.roll(lights, 7, axis=0)
    where = arranged(views, lights, SOURCE)
    every = np.arange(len(where))
    assert np.linalg.det(where.frame) == pytest.approx(1.0, abs=1e-5)
    found = reference.local_lights(where, every, UP.direction[0])
    np.testing.assert_allclose(found, lights, atol=1e-6)
    above = views[:, 2] > 1e-3
    found = reference.local_views(where, every, AT_ORIGIN)
    np.testing.assert_allclose(found[above], views[above], atol=1e-6)


def test_every_pair_of_awkward_directions_gives_a_colour(backend, material):
    views, lights = pairs(material)
    values = sound(backend([material], arranged(views, lights, SOURCE), AT_ORIGIN, UP))
    assert not values[lights[:, 2] < -1e-6].any()
    assert values.max() < 100


def test_both_backends_agree_at_awkward_directions(material):
    views, lights = pairs(material)
    # a jump between nearest directions, or of a view from straight behind, may fall either way
    clear = (views[:, 2] > -0.99) & (np.abs(lights[:, 2]) > 1e-6)
    where = arranged(views[clear], lights[clear], SOURCE)
    one, two = (call([material], where, AT_ORIGIN, UP) for call in BACKENDS.values())
    off = np.abs(linear_to_srgb(one) - linear_to_srgb(two)).max(axis=1)
    if material.views.method in ("nearest", "nearest4"):
        # a tie is broken by rounding: jumps are allowed, but few
        assert (off > 2e-3).mean() < 0.35
    else:
        assert off.max() < 4 / 255
        assert off.mean() < 0.2 / 255


@pytest.mark.parametrize("place", ["anywhere", "beyond"])
def test_texels_beside_the_sample_are_its_border_or_its_repetition(backend, material, place):
    where = scattered(50, seed=3)
    far = 1e7 if place == "beyond" else 20.0
    source = (where.source * far).astype(np.float32)
    moved = Surfels(where.position, where.frame, source, where.sample)
    sound(backend([material], moved, np.array([0, 0, 3.0, 1]), UP))


@pytest.mark.parametrize("mesh", ["cat.obj", "spot.obj"])
def test_frames_at_the_field_s_singularities_are_frames(backend, mesh):
    """A real mesh with its field: all frames sound, all surfels rendered, seen from inside too."""
    made = prepare(load_mesh(found(mesh))[0], rate=96)
    dense, field = made.dense, made.field
    assert len(field.singularities) > 0
    count = len(dense.vertices)
    rng = np.random.default_rng(0)
    quilt = Quilt(
        (rng.random((count, 2)) * 6).astype(np.float32),
        rng.uniform(-np.pi, np.pi, count).astype(np.float32),
        np.zeros(count, np.uint16), np.zeros(count, np.int32),
    )  # fmt: skip
    where = surfels(dense, field, quilt, placement(dense.vertices))
    product = np.einsum("nij,nkj->nik", where.frame, where.frame)
    assert np.abs(product - np.eye(3)).max() < 1e-5
    assert np.linalg.det(where.frame).min() > 0.999
    shaped = [factor_material(factored(tiles=True))]
    lights = joined([directional([0.3, 0.5, 0.8]), directional([-1, 0, 0])])
    for eye in ([0, 0, 3.0, 1], [0, 0, 0, 1.0], [0.0, 1, 0, 0], [*where.position[7], 1.0]):
        values = sound(backend(shaped, where, np.array(eye, float), lights))
        lit = (np.einsum("nj,lj->nl", where.frame[:, 2], lights.direction) > 0.05).any(axis=1)
        assert (values[lit].max(axis=1) > 0).all()


def test_degenerate_normals_and_tangents_become_frames(backend):
    bad = np.array([[0, 0, 0], [np.nan, 0, 1], [np.inf, 0, 0], [1e-30, 0, 0], [0, 0, 1e30]])
    normals, tangents = (part.reshape(-1, 3) for part in np.broadcast_arrays(
        bad[:, None], np.concatenate([bad, [[0, 0, 1], [1, 0, 0]]])[None]
    ))  # fmt: skip
    frame = turned_frames(
        normals.astype(np.float32), tangents.astype(np.float32), np.full(len(normals), 0.3)
    )
    product = np.einsum("nij,nkj->nik", frame, frame)
    np.testing.assert_allclose(product, np.tile(np.eye(3), (len(product), 1, 1)), atol=1e-5)
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf, 1e-30, 1e30])
def test_frames_that_are_none_are_black_or_a_colour(backend, material, value):
    """What `surfels` never makes, but a file may hold."""
    where = scattered(40, seed=1)
    frame = where.frame.copy()
    frame[::3] = value
    frame[1::3, 2] = value
    hostile = Surfels(where.position, frame, where.source, where.sample)
    for eye in ([0, 0, 3.0, 1.0], [0, 0, 1.0, 0.0]):
        sound(backend([material], hostile, np.array(eye), UP))
    good = Surfels(*(part[2::3] for part in (where.position, frame, where.source, where.sample)))
    np.testing.assert_array_equal(
        backend([material], hostile, AT_ORIGIN, UP)[2::3], backend([material], good, AT_ORIGIN, UP)
    )


def test_eyes_at_a_surfel_far_away_and_nowhere_see_colours(backend, material):
    where = scattered(60, seed=2)
    eyes = [
        [*where.position[5], 1.0], [0, 0, 0, 1.0], [1e-38, 0, 0, 1.0], [1e30, -1e30, 1e30, 1.0],
        [1e8, 0, 0, 1.0], [0, 0, 0, 0.0], [1e-30, 0, 0, 0.0], [0, 1e30, 0, 0.0],
        [np.inf, 0, 0, 1.0], [np.nan, 0, 0, 1.0], [0, 0, 2.0, 1e-12],
    ]  # fmt: skip
    for eye in eyes:
        sound(backend([material], where, np.array(eye, float), UP))


def test_a_distant_eye_is_one_at_infinity(backend, material):
    where, away = scattered(60, seed=2), np.array([0.36, 0.48, 0.8])
    near = backend([material], where, np.append(away * 1e7, 1.0), UP)
    far = backend([material], where, np.append(away, 0.0), UP)
    same = np.isclose(near, far, rtol=1e-3, atol=1e-4).all(axis=1)
    # the nearest direction may jump by the least change of view, at few surfels
    assert same.mean() >= (0.9 if material.views.method.startswith("nearest") else 1.0)


def test_no_light_and_lights_without_intensity_are_black(backend, material):
    where, eye = scattered(60), np.array([0, 0, 3.0, 1])
    assert not sound(backend([material], where, eye, NONE)).any()
    assert not sound(backend([material], where, eye, directional([0, 0, 1.0], 0.0))).any()
    shade = np.zeros((1, 60), np.float32)
    assert not sound(backend([material], where, eye, UP, visible=shade)).any()


@pytest.mark.parametrize("strength", [1e-30, 1e10, BRIGHTEST])
def test_any_intensity_gives_a_colour_and_scales(backend, material, strength):
    where, eye = scattered(60), np.array([0, 0, 3.0, 1])
    found = sound(backend([material], where, eye, directional([0, 0, 1.0], strength)))
    plain = backend([material], where, eye, UP)
    np.testing.assert_allclose(found / np.float32(strength), plain, rtol=1e-4, atol=1e-6)
    many = Lights(np.tile([[0, 0, 1.0]], (9, 1)), np.full((9, 3), BRIGHTEST))
    sound(backend([material], where, eye, many))


@pytest.mark.parametrize("curve", ["clip", "reinhard", "filmic"])
@pytest.mark.parametrize("stops", [-100.0, -1.0, 0.0, 1.0, 100.0])
def test_any_exposure_of_any_radiance_is_a_picture(stops, curve):
    values = np.float32([0, 1e-38, 1e-30, 1e-3, 0.5, 1, 7, 1e10, 1e30, 3e38, np.nan, np.inf, -1])
    radiance = np.repeat(values[None, :, None], 3, axis=2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        shown = develop(radiance, stops, curve)
    assert shown.dtype == np.uint8
    rising = shown[0, :10, 0].astype(int)
    assert (np.diff(rising) >= 0).all()
    assert rising[0] == shown[0, 10, 0] == shown[0, 12, 0] == 0
    assert shown[0, 11, 0] == 255
    if stops == 100.0:
        assert rising[3] >= 250  # a thousandth, 1e30 times as bright
    if stops == -100.0:
        assert rising[6] == 0


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e38, -1e38])
def test_samples_that_hold_no_numbers_give_colours_all_the_same(backend, material, value):
    """Weights, tables and images with some values that are none; the others stay what they are."""
    name = {FactorMaterial: "weights", RawMaterial: "images", HarmonicMaterial: "weights"}
    changed = getattr(material, name[type(material)]).copy()
    spoilt = (slice(None),) * (changed.ndim - 3) + (2,)  # a row of texels
    changed[spoilt] = value
    bad = replace(material, **{name[type(material)]: changed})
    where, eye = scattered(80, seed=4), np.array([0, 0, 3.0, 1])
    found = sound(backend([bad], where, eye, UP))
    row = where.source[:, 1]
    aside = (row > 3.01) | ((row > 0) & (row < 0.99))
    assert aside.sum() > 20
    np.testing.assert_array_equal(found[aside], backend([material], where, eye, UP)[aside])


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_tables_that_hold_no_numbers_give_colours_all_the_same(backend, value):
    shaped = factor_material(factored())
    table = shaped.table.copy()
    table[3, 2], table[:, 5, 1, 2] = value, value
    bad = replace(shaped, table=table)
    where = scattered(200, seed=4)
    sound(backend([bad], where, np.array([0, 0, 3.0, 1]), UP))


def test_bare_surfels_are_lit_wherever_they_are_seen_from(backend):
    views, lights = pairs(MATERIALS["sqrt grid"])
    where = arranged(views, lights, SOURCE)
    bare = replace(where, sample=np.full(len(where), BARE, np.uint16))
    values = sound(backend([], bare, AT_ORIGIN, UP))
    up = np.maximum(lights[:, 2], 0)
    np.testing.assert_allclose(values[:, 0], values[:, 0].max() * up, atol=2e-3)
