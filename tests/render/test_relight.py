"""The progressive evaluation: exact at rest, honest while moving, idle where nothing changed."""

import numpy as np
import pytest

from btfcore.btf.stack import ArrayStack
from btfcore.errors import InvalidParameter
from btfcore.pipeline import prepare
from btfcore.render.lights import Lights, directional, joined
from btfcore.render.material import factor_material
from btfcore.render.reference import radiance
from btfcore.render.relight import Quality, Relighter
from btfcore.render.tonemap import develop
from btfcore.types import Mesh, Quilt
from tests.app.fakes import torus
from tests.btf.bricks import factors, images, sample

EYE = np.array([0.4, 0.7, 3.5, 1.0])
LIGHT = directional((0.3, 0.6, 0.8))


@pytest.fixture(scope="module")
def decorated():
    """(prepared, quilt, materials) of a small ring in two materials."""
    mesh = torus(coarse=20)[0]
    prepared = prepare(Mesh(mesh.vertices, mesh.faces), rate=64)
    row, column = prepared.dense.texel.T
    count = len(row)
    source = np.stack([column % 39, row % 39], axis=-1).astype(np.float32)
    patch = (row // 16 * 4 + column // 16).astype(np.int32)
    quilt = Quilt(source, np.sin(patch).astype(np.float32), (patch % 2).astype(np.uint16), patch)
    bricks = sample(
        factors=factors(height=40, width=40), stack=ArrayStack(images(5, 12, 40, 40), sound=True)
    )
    other = sample(
        factors=factors(height=40, width=40, seed=5),
        stack=ArrayStack(images(5, 12, 40, 40), sound=True),
    )
    assert count > 1000
    return prepared, quilt, (factor_material(bricks), factor_material(other))


@pytest.fixture
def relighter(decorated):
    made = Relighter(*decorated)
    made.look(EYE)
    made.light(LIGHT)
    return made


def truth(relighter, decorated, lights=LIGHT, eye=EYE, exposure=0.0, curve="clip"):
    """Codes (n, 3) of every surfel that counts, by the reference."""
    chosen = relighter.visible
    found = radiance(decorated[2], relighter.surfels, eye, lights, chosen=chosen)
    return develop(found, exposure, curve)


def held(relighter, decorated):
    """Codes (n, 3) that the image shows at the texels of those surfels."""
    row, column = decorated[0].dense.texel[relighter.visible].T
    return relighter.image[row, column]


def test_at_rest_the_image_is_the_reference(relighter, decorated):
    relighter.draw(mode="control")
    slices = 0
    while not relighter.refine(0.0):
        slices += 1
    assert relighter.show() and relighter.finished
    wrong = np.abs(held(relighter, decorated).astype(int) - truth(relighter, decorated))
    assert wrong.max() <= 1 and (wrong > 0).mean() < 0.01
    assert relighter.quality() == Quality("full", 0.0, 1, 1.0)


def test_refining_works_by_slices_and_never_past_its_budget(relighter, monkeypatch):
    monkeypatch.setattr("btfcore.render.relight._SLICE", 1)  # then 1024 surfels a slice
    relighter.draw(mode="half")
    steps = 0
    while not relighter.refine(0.0):
        steps += 1
        assert 0 < relighter.quality().done < 1
    assert steps == -(-len(relighter.visible) // 1024) - 1


def test_the_error_of_a_mode_is_that_of_the_whole_image(relighter, decorated):
    errors = {}
    for mode in relighter.modes:
        relighter.draw(mode=mode)
        wrong = held(relighter, decorated).astype(float) - truth(relighter, decorated)
        errors[mode] = np.sqrt(((wrong / 255) ** 2).mean())
        assert relighter.quality().mode == mode
        assert relighter.quality().error == pytest.approx(errors[mode], rel=0.15, abs=0.002)
    assert relighter.modes == ("full", "midpoints", "control", "half")
    assert errors["full"] < 0.002 < errors["midpoints"] <= errors["control"]


def test_what_did_not_change_is_not_evaluated(relighter, decorated, monkeypatch):
    calls = []
    inner = relighter._backing.radiance
    monkeypatch.setattr(
        relighter._backing, "radiance", lambda *a, **k: (calls.append(a[0]), inner(*a, **k))[1]
    )
    assert relighter.draw(mode="full") and len(calls) == 1
    relighter.look(EYE.copy())
    relighter.light(directional((0.3, 0.6, 0.8)))
    assert not relighter.draw() and not relighter.draw(mode="full") and len(calls) == 1
    relighter.expose(1.0, "filmic")
    assert relighter.draw() and len(calls) == 1, "exposure evaluates nothing"
    found = held(relighter, decorated).astype(int)
    assert np.abs(found - truth(relighter, decorated, exposure=1.0, curve="filmic")).max() <= 1
    relighter.light(directional((0.3, 0.6, -0.8)))
    assert relighter.draw(mode="full") and len(calls) == 2
    assert relighter.refine(1.0) and len(calls) == 2, "full already"


def test_the_cheapest_needed_mode_is_taken(relighter):
    relighter._cost = {"full": 1e-3, "midpoints": 1e-4, "control": 1e-5, "half": 9e-6}
    count = len(relighter.visible)
    for budget, mode in ((2e-3, "full"), (2e-4, "midpoints"), (2e-5, "control"), (0, "control")):
        assert relighter._affordable(budget * count + 1e-3) == mode, budget
    relighter._cost["half"] = 1e-6
    assert relighter._affordable(0) == "half"


def test_unseen_texels_keep_what_they_had_and_everything_lights_them(relighter, decorated):
    relighter.finish()
    unseen = np.setdiff1d(np.arange(len(relighter.surfels)), relighter.visible)
    assert 0.1 < len(unseen) / len(relighter.surfels) < 0.7
    row, column = decorated[0].dense.texel[unseen].T
    assert not relighter.image[row, column].any()
    relighter.everything(True)
    relighter.finish()
    assert len(relighter.visible) == len(relighter.surfels)
    wrong = held(relighter, decorated).astype(int) - truth(relighter, decorated)
    assert np.abs(wrong).max() <= 1 and relighter.image[row, column].any()


def test_fewer_lights_while_moving_and_all_of_them_at_rest(relighter, decorated):
    many = directional(np.random.default_rng(0).normal(size=(12, 3)), 0.1)
    sky = Lights(many.direction, many.intensity, sampled=12)
    few = Lights(many.direction[:2].copy(), many.intensity[:2] * 6, sampled=2)
    relighter.light(joined([LIGHT, sky]), moving=joined([LIGHT, few]))
    relighter.draw(mode="control")
    assert relighter.quality().lights == 3 and relighter.quality().error > 0
    relighter.finish()
    wrong = held(relighter, decorated).astype(int) - truth(
        relighter, decorated, joined([LIGHT, sky])
    )
    assert relighter.quality().lights == 13 and np.abs(wrong).max() <= 1


def test_cast_shadows_only_darken_and_are_there_at_rest(relighter, decorated):
    low = directional((0.9, 0.1, 0.35))
    relighter.light(low)
    bright = relighter.finish().astype(int).copy()
    relighter.light(low, shadows=True)
    dark = relighter.finish().astype(int)
    assert (dark <= bright).all()
    assert (dark < bright).any(axis=-1).sum() > 20, "the ring shades itself"


def test_the_same_bits_with_any_threads(decorated):
    from concurrent.futures import ThreadPoolExecutor

    pictures = []
    for count in (1, 3):
        with ThreadPoolExecutor(count) as pool:
            made = Relighter(*decorated, pool=pool)
            made.look(EYE)
            made.light(LIGHT)
            for mode in made.modes:
                made.draw(mode=mode)
                pictures.append((mode, made.image.copy()))
    half = len(pictures) // 2
    for (mode, one), (_, two) in zip(pictures[:half], pictures[half:], strict=True):
        assert np.array_equal(one, two), mode


def test_warming_up_leaves_it_ready(relighter, decorated):
    relighter.warm_up(LIGHT)
    assert not relighter.finished and relighter.draw(mode="full")
    assert np.abs(held(relighter, decorated).astype(int) - truth(relighter, decorated)).max() <= 1


def test_nonsense_is_named(relighter):
    with pytest.raises(InvalidParameter, match="nan"):
        relighter.look(np.array([0, 0, np.nan, 1]))
    with pytest.raises(InvalidParameter, match="'best'"):
        relighter.draw(mode="best")
    with pytest.raises(InvalidParameter, match="curve"):
        relighter.expose(0.0, "vivid")
    relighter.light(Lights(np.zeros((0, 3)), np.zeros((0, 3))))
    assert not relighter.finish().any(), "no light, no radiance"
