"""Remembered shadows are the caster's, and no ray is sent twice."""

import numpy as np
import pytest

from btfcore.pipeline import prepare
from btfcore.render.cast import caster
from btfcore.render.lights import Lights, directional, joined
from btfcore.render.shadow_cache import ShadowCache
from btfcore.render.surfels import placement, surfels
from btfcore.types import Mesh, Quilt
from tests.app.fakes import torus

ONE, TWO = directional((0.9, 0.1, 0.35)), directional((-0.5, 0.8, -0.2))


@pytest.fixture(scope="module")
def ring():
    """A caster of a small ring's surfels."""
    mesh = torus(coarse=20)[0]
    prepared = prepare(Mesh(mesh.vertices, mesh.faces), rate=64)
    dense, count = prepared.dense, len(prepared.dense.texel)
    quilt = Quilt(
        np.zeros((count, 2), np.float32), np.zeros(count, np.float32),
        np.zeros(count, np.uint16), np.zeros(count, np.int32),
    )  # fmt: skip
    place = placement(mesh.vertices)
    elements = surfels(dense, prepared.field, quilt, place)
    points = place.to_scene(prepared.mesh.vertices)
    return caster(points, prepared.mesh.faces, elements, face=dense.face, bary=dense.bary)


@pytest.fixture
def cache(ring, monkeypatch):
    """A cache of nothing yet that counts its rays."""
    made = ShadowCache(ring)
    made.rays = 0
    inner = made._cast

    def count(direction, chosen):
        made.rays += len(chosen)
        return inner(direction, chosen)

    monkeypatch.setattr(made, "_cast", count)
    return made


def test_they_are_the_casters(cache, ring):
    lights = joined([ONE, TWO])
    chosen = np.arange(5, len(ring.origins), 3, dtype=np.int32)
    found = cache.shade(lights, chosen)
    assert np.array_equal(found, ring.visibility(lights, chosen))
    assert 0 < found.mean() < 1 and cache.rays == 2 * len(chosen)
    assert np.array_equal(cache.everywhere(lights), ring.visibility(lights))


def test_no_ray_is_sent_twice_until_the_light_is_another(cache, ring):
    some, more = np.arange(300, dtype=np.int32), np.arange(500, dtype=np.int32)
    cache.shade(ONE, some)
    assert cache.seconds(ONE, some) == 0 < cache.seconds(ONE, more)
    cache.shade(ONE, more)
    cache.shade(Lights(ONE.direction.copy(), ONE.intensity * 2), more)
    assert cache.rays == 500
    cache.shade(TWO, some)
    cache.shade(ONE, some)
    assert cache.rays == 1100, "only lights of the present are remembered"


def test_slices_come_to_the_end(cache, ring):
    count = len(ring.origins)
    assert count > 2000 and cache.share(ONE) == 0
    slices = 1
    while not cache.complete(ONE, 0.0) and slices < count:
        assert 0 < cache.share(ONE) < 1
        slices += 1
    assert slices >= 3 and cache.rays == count and cache.share(ONE) == 1
    assert np.array_equal(cache.everywhere(ONE), ring.visibility(ONE))
    assert cache.rays == count


def test_lights_of_an_environment_cast_none(cache):
    sky = Lights(TWO.direction, TWO.intensity, sampled=1)
    found = cache.shade(joined([ONE, sky]), np.arange(50, dtype=np.int32))
    assert (found[1] == 1).all() and cache.rays == 50
    assert len(cache.everywhere(joined([ONE, sky]))) == 1
    assert cache.complete(sky, 0.0) and cache.share(sky) == 1
