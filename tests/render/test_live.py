"""Pictures and light that follow a quilt that is being painted are those made of it anew."""

import numpy as np
import pytest

from btfcore.btf.stack import ArrayStack
from btfcore.errors import InvalidParameter
from btfcore.patch.connectivity import adjacency
from btfcore.render.gutter import gutter_source
from btfcore.render.lights import directional
from btfcore.render.live import TINT, LiveTexture
from btfcore.render.material import factor_material
from btfcore.render.modes import seam_colours
from btfcore.render.relight import Relighter
from btfcore.render.surfels import placement, rewrite, surfels
from btfcore.render.texture import atlas_texture, vertex_colours
from btfcore.types import Prepared, Quilt
from tests.app.fakes import quilt, torus
from tests.btf.bricks import factors, images, sample
from tests.surfaces import blobs


@pytest.fixture(scope="module")
def ring():
    mesh, atlas, dense, field = torus(size=48)
    return Prepared(mesh, atlas, dense, field)


def edited(made, share, seed=0, samples=1):
    """A quilt some vertices of which are others, those vertices, and their values."""
    rng = np.random.default_rng(seed)
    at = np.sort(rng.permutation(len(made.patch))[: int(share * len(made.patch))]).astype(np.int32)
    source, angle = made.source.copy(), made.angle.copy()
    number, patch = made.sample.copy(), made.patch.copy()
    source[at] = rng.uniform(1, 20, (len(at), 2))
    angle[at] = rng.uniform(-3, 3, len(at))
    number[at] = rng.integers(0, samples, len(at))
    patch[at] = rng.integers(-1, 40, len(at))
    part = Quilt(source[at], angle[at], number[at], patch[at])
    return Quilt(source, angle, number, patch), at, part


@pytest.mark.parametrize("share", [0.0, 0.001, 0.2, 1.0])
def test_pictures_after_updates_are_those_of_the_quilt(ring, share):
    samples = (blobs(40, 40), blobs(30, 50))
    dense, made = ring.dense, quilt(ring.dense, samples[0])
    gutter = gutter_source(dense)
    indptr, indices = adjacency(dense.faces, len(dense.vertices))
    live = LiveTexture(gutter, indptr, indices, samples, made)
    for seed in range(3):
        made, at, part = edited(made, share, seed, samples=2)
        live.update(at, part, samples)
    colours = vertex_colours(made, samples)
    assert np.array_equal(live.image(), atlas_texture(dense, colours, source=gutter))
    seams = seam_colours(dense, made, colours)
    assert np.array_equal(live.seams(), atlas_texture(dense, seams, source=gutter))


def test_tint_and_overlay_touch_only_what_they_say(ring):
    made = quilt(ring.dense, blobs(40, 40))
    gutter = gutter_source(ring.dense)
    indptr, indices = adjacency(ring.dense.faces, len(ring.dense.vertices))
    live = LiveTexture(gutter, indptr, indices, [blobs(40, 40)], made)
    plain = live.image().astype(int)
    wanted = np.zeros(len(made.patch), np.float32)
    wanted[100:200] = 1.0
    tinted = live.tinted(wanted, np.arange(150, 170, dtype=np.int32)).astype(int)
    expected = np.isin(gutter, np.r_[100:150, 170:200])
    assert np.array_equal((tinted != plain).any(axis=2) | ~expected, np.ones_like(expected))
    assert (tinted[~expected] == plain[~expected]).all()
    nearer = np.abs(tinted - TINT).sum(axis=2) < np.abs(plain - TINT).sum(axis=2)
    assert nearer[expected].all()
    at = np.arange(10, 20)
    red = np.tile(np.float32([1, 0, 0]), (10, 1))
    over = live.overlaid(at, red, np.ones(10, np.float32))
    assert (over[np.isin(gutter, at)] == (255, 0, 0)).all()
    assert (over[~np.isin(gutter, at)] == plain[~np.isin(gutter, at)]).all()
    assert np.array_equal(live.image(), plain), "nothing stays"
    with pytest.raises(InvalidParameter, match="3 values for 4"):
        live.update(np.arange(4), edited(made, 1.0)[2].__class__(*(
            each[:3] for each in (made.source, made.angle, made.sample, made.patch)
        )), [blobs(40, 40)])  # fmt: skip


def test_surfels_that_are_rewritten_are_those_of_the_quilt(ring):
    made = quilt(ring.dense, blobs(40, 40))
    place = placement(ring.mesh.vertices)
    there = surfels(ring.dense, ring.field, made, place)
    changed, at, part = edited(made, 0.3)
    rewrite(there, at, part, ring.dense.normals[at], ring.field.tangents[at])
    anew = surfels(ring.dense, ring.field, changed, place)
    for name in ("position", "frame", "source", "sample"):
        assert np.array_equal(getattr(there, name), getattr(anew, name)), name
        assert not getattr(there, name).flags.writeable


@pytest.mark.parametrize("shadows", [False, True])
def test_light_follows_an_edit(ring, shadows):
    bricks = sample(
        factors=factors(height=40, width=40), stack=ArrayStack(images(5, 12, 40, 40), sound=True)
    )
    materials = (factor_material(bricks), factor_material(bricks))
    made = quilt(ring.dense, blobs(40, 40))
    light = directional((0.3, 0.5, 0.8))

    def asked(relighter):
        relighter.look(np.array([0.2, 0.4, 1.0, 0.0]))
        relighter.light(light, shadows=shadows)
        return relighter

    relighter = asked(Relighter(ring, made, materials))
    relighter.warm_up(light)
    asked(relighter).finish()
    for seed in range(2):
        made, at, part = edited(made, 0.1, seed, samples=2)
        relighter.update(at, part)
        assert not relighter.finished
        relighter.draw()
        anew = asked(Relighter(ring, made, materials))
        assert np.array_equal(relighter.image, anew.finish()), "only what changed was evaluated"
        relighter.follow(relighter.followed(made))
        for mode in relighter.modes:
            relighter._lit = False
            relighter.draw(mode=mode)
            anew._lit = False
            anew.draw(mode=mode)
            assert np.array_equal(relighter.image, anew.image), mode
        asked(relighter).finish()
    alien = Quilt(*(each[:1] for each in (made.source, made.angle)), np.uint16([2]), np.int32([0]))
    with pytest.raises(InvalidParameter, match="sample 2"):
        relighter.update(np.array([0]), alien)
