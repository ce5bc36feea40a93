"""Whole samples: symmetries, where shadows fall and what leans where, streaming, threads."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf.bake.build import bake, baked
from btfcore.btf.bake.lamps import lamps
from btfcore.btf.bake.relief import relief
from btfcore.btf.bake.slopes import normals_of_slopes, slopes_of_height
from btfcore.btf.bake.stack import BakedStack
from btfcore.btf.directions import layout
from btfcore.btf.sample import subset
from btfcore.btf.stack import ImageStack
from btfcore.errors import Cancelled, InvalidBtf, InvalidParameter
from tests.btf.bake import fields, reference
from tests.btf.bake.fields import direction

UP = direction(0, 0)
SOME = np.array([direction(5, 17), direction(45, 100), direction(75, 210)])
MAPS = ("albedo", "height", "normal", "roughness", "metallic", "ao", "mask")


def all_images(sample):
    return sample.stack.read(np.arange(sample.images))


def post():
    """A square post in the middle of a plain, 3 high, its top white."""
    height = np.zeros((33, 33), np.float32)
    height[14:19, 14:19] = 1
    made = fields.plain(height, depth=6.0)
    albedo = made.albedo.copy()
    albedo[14:19, 14:19] = 1
    return replace(made, albedo=albedo)


def turned(pbr):
    """The set, turned by 90 degrees counter-clockwise."""
    maps = {name: np.rot90(getattr(pbr, name)).copy() for name in MAPS}
    x, y, z = np.moveaxis(maps["normal"], 2, 0)
    return replace(pbr, **maps | {"normal": np.stack([-y, x, z], axis=2)})


def flipped(pbr):
    """The set in a mirror: left and right exchanged."""
    maps = {name: getattr(pbr, name)[:, ::-1].copy() for name in MAPS}
    return replace(pbr, **maps | {"normal": maps["normal"] * np.array([-1, 1, 1], np.float32)})


def same(one, other):
    """Equal but for rounding, which may move the edge of a shadow over a texel."""
    close = np.isclose(one, other, rtol=2e-3, atol=1e-4)
    return close.mean() > 0.995


def test_the_sample_carries_what_the_set_knows():
    made = fields.colourful(licence="CC0", citation="us", origin="here", texel_size=0.2)
    made = replace(made, notes=("first",))
    sample = baked(made, SOME, [UP, *SOME])
    assert isinstance(sample.stack, ImageStack) and sample.stack.dear
    assert sample.stack.shape == (12, 24, 32) and sample.index[2, 3] == 11
    assert (sample.licence, sample.citation, sample.origin) == ("CC0", "us", "here")
    assert sample.tiles and sample.cosine and sample.texel_size == 0.2
    assert sample.mask is made.mask and sample.notes[0] == "first"


def test_single_precision_and_exact_tracing_agree_with_small_steps_in_double():
    made = fields.colourful()
    sample = baked(made, SOME, SOME)
    field = relief(made)
    for v, view in enumerate(SOME):
        for k, light in enumerate(SOME):
            wanted, close = reference.rendered(field, view, light, 1 / 16)
            found = sample.image(v, k)
            good = np.isclose(found, wanted, rtol=5e-3, atol=1e-3).all(axis=2)
            assert good[~close].mean() > 0.995
            assert found.mean() == pytest.approx(wanted.mean(), rel=0.02)


def test_shadows_fall_away_from_the_light():
    sample = baked(post(), [UP], [direction(60, phi) for phi in (0, 90, 180, 270)])
    right, up, left, down = (sample.image(0, k)[..., 0] for k in range(4))
    # columns before 14 lie left of the post, rows before 14 above it in the picture
    assert (right[14:19, 8:13] == 0).all() and (right[14:19, 20:26] > 0).all()
    assert (left[14:19, 20:25] == 0).all() and (left[14:19, 8:13] > 0).all()
    assert (up[20:25, 14:19] == 0).all() and (up[8:13, 14:19] > 0).all()
    assert (down[8:13, 14:19] == 0).all() and (down[20:25, 14:19] > 0).all()
    dark = np.flatnonzero(right[16] == 0)
    assert 14 - dark.min() == pytest.approx(6 * np.tan(np.radians(60)), abs=1.5)


def test_what_stands_out_leans_away_from_the_viewer():
    made = post()
    views = [direction(45, phi) for phi in (0, 90, 180, 270)]
    sample = baked(made, [UP, *views], [UP], reflectance=0)
    rows, columns = np.mgrid[:33, :33]

    def middle(image):
        top = image[..., 0] > 0.95
        return columns[top].mean(), rows[top].mean()

    assert middle(sample.image(0, 0)) == pytest.approx((16, 16))
    shift = 6 - (made.height * 6).mean()  # tan 45° times the height above the mean plane
    wanted = [(16 - shift, 16), (16, 16 + shift), (16 + shift, 16), (16, 16 - shift)]
    for k, place in enumerate(wanted, start=1):
        assert middle(sample.image(k, 0)) == pytest.approx(place, abs=0.6)
    top = baked(made, views, [UP], reflectance=0, plane="top")
    assert middle(top.image(0, 0)) == pytest.approx((16, 16), abs=0.6)


def test_turning_the_set_turns_the_sample():
    made = fields.colourful()
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    found = all_images(baked(turned(made), SOME @ quarter.T, SOME @ quarter.T, bounce=True))
    wanted = np.rot90(all_images(baked(made, SOME, SOME, bounce=True)), axes=(1, 2))
    assert same(found, wanted)


def test_a_mirrored_set_is_the_mirrored_sample():
    made = fields.colourful()
    over = SOME * [-1, 1, 1]
    found = all_images(baked(flipped(made), over, over, bounce=True))
    assert same(found, all_images(baked(made, SOME, SOME, bounce=True))[:, :, ::-1])


def test_shifting_a_set_that_tiles_shifts_the_sample():
    made = fields.colourful()
    maps = {name: np.roll(getattr(made, name), (5, -9), (0, 1)) for name in MAPS}
    found = all_images(baked(replace(made, **maps), SOME, SOME, bounce=True))
    wanted = np.roll(all_images(baked(made, SOME, SOME, bounce=True)), (5, -9), (1, 2))
    assert same(found, wanted)


def test_a_set_that_does_not_tile_meets_its_mirror_image():
    made = replace(fields.colourful(), tiles=False)
    wide = {name: np.concatenate([getattr(made, name), flipped_map], axis=1)
            for name, flipped_map in ((n, getattr(flipped(made), n)) for n in MAPS)}  # fmt: skip
    wide["normal"] = np.concatenate([made.normal, flipped(made).normal], axis=1)
    tall = {name: np.concatenate([each, each[::-1]], axis=0) for name, each in wide.items()}
    tall["normal"][24:] *= np.array([1, -1, 1], np.float32)
    tiling = replace(made, **tall, tiles=True)
    wanted = all_images(baked(tiling, SOME, SOME, bounce=True))[:, :24, :32]
    assert np.array_equal(all_images(baked(made, SOME, SOME, bounce=True)), wanted)


def test_knobs_switch_off_what_they_name():
    made = replace(fields.colourful(), height=fields.blocks(32)[:24], depth=5.0, normal=None)
    full = all_images(baked(made, [UP, *SOME], SOME))
    bright = all_images(baked(made, [UP, *SOME], SOME, shadows=False))
    assert (bright >= full).all() and (full == 0).mean() > (bright == 0).mean()
    still = all_images(baked(made, [UP, *SOME], SOME, parallax=False))
    assert np.array_equal(still[:3], full[:3]) and not np.array_equal(still[3:], full[3:])
    matt = fields.plain(made.height, depth=5.0)
    still = all_images(baked(matt, SOME, SOME, parallax=False, reflectance=0)).reshape(3, 3, -1)
    assert np.array_equal(still[0], still[1])  # what is matt looks the same from everywhere


def test_no_depth_is_a_flat_set():
    made = fields.colourful(ao=None)
    flat = all_images(baked(replace(made, height=None), SOME, SOME))
    assert np.array_equal(all_images(baked(made, SOME, SOME, depth=0)), flat)
    level = replace(made, height=np.full(made.shape, 0.7, np.float32))
    assert np.array_equal(all_images(baked(level, SOME, SOME)), flat)


def test_normals_from_the_heights_are_the_default():
    made = fields.plain(fields.bumps(24, 24), depth=4.0)
    normal = normals_of_slopes(slopes_of_height(made.height * 4, tiles=True)).astype(np.float32)
    with_map = all_images(baked(replace(made, normal=normal), SOME, SOME))
    assert np.allclose(all_images(baked(made, SOME, SOME)), with_map, atol=1e-4)


def test_a_bounce_adds_light_where_there_is_something_to_see():
    made = fields.plain(fields.blocks(24), depth=5.0, albedo=0.7)
    direct = all_images(baked(made, SOME, SOME))
    both = all_images(baked(made, SOME, SOME, bounce=True))
    assert (both >= direct).all()
    assert 0.01 < (both - direct).mean() / direct.mean() < 0.5
    assert (both[direct == 0] > 0).mean() > 0.8  # it reaches most shadows
    for none in (replace(made, albedo=made.albedo * 0), replace(made, height=made.height * 0)):
        plain = all_images(baked(none, SOME, SOME))
        assert np.allclose(all_images(baked(none, SOME, SOME, bounce=True)), plain)


def test_a_bounce_takes_the_colour_of_what_it_comes_from():
    height = np.zeros((16, 16), np.float32)
    height[:, 8:] = 1
    made = fields.plain(height, depth=8.0)
    albedo = np.ones_like(made.albedo)
    albedo[:, 8:] = (1, 0, 0)
    made = replace(made, albedo=albedo)
    views, lights = [UP], [direction(40, 180)]
    extra = all_images(baked(made, views, lights, bounce=True)) - all_images(
        baked(made, views, lights)
    )
    beside = extra[0, 8, 4:7]
    assert (beside[:, 0] > beside[:, 1] * 1.2).all()


def test_reading_in_any_order_gives_the_same_bits():
    made = fields.colourful(70, 66)  # more than one band
    sample = baked(made, SOME, SOME, bounce=True)
    whole = all_images(sample)
    for numbers in ([3], [8, 0, 4, 4], [5, 1, 2], [], np.arange(9)[::-1], [-1]):
        assert np.array_equal(sample.stack.read(numbers), whole[np.array(numbers, int)])
    fewer = subset(baked(made, SOME, SOME, bounce=True), [2, 0], [1])
    assert np.array_equal(all_images(fewer), whole[[7, 1]])
    with pytest.raises(IndexError):
        sample.stack.read([9])


def test_threads_do_not_change_a_bit():
    made = fields.colourful(70, 66)
    one = bake(made, SOME, SOME, bounce=True, threads=1)
    for threads in (2, 5):
        many = bake(made, SOME, SOME, bounce=True, threads=threads)
        assert np.array_equal(all_images(one), all_images(many))


def test_baking_keeps_what_reading_makes():
    made = fields.colourful()
    lazy, kept = baked(made, SOME, SOME), bake(made, SOME, SOME)
    assert not kept.stack.dear and kept.notes == lazy.notes
    assert np.array_equal(all_images(kept), all_images(lazy))
    small = bake(made, SOME, SOME, memory_mb=0.02)
    assert np.allclose(all_images(small), all_images(lazy), rtol=1e-3, atol=1e-6)


def test_progress_comes_out_and_cancelling_goes_in():
    made = fields.colourful()
    seen = []
    bake(made, SOME, SOME, bounce=True, progress=lambda fraction, label: seen.append(fraction))
    assert seen == sorted(seen) and seen[-1] == 1

    def stop(fraction, label):
        raise Cancelled

    with pytest.raises(Cancelled):
        bake(made, SOME, SOME, progress=stop)


def test_lights_of_one_azimuth_share_a_horizon():
    grid = lamps(layout("12x8x12x8").lights)
    assert len(grid.steps) == 12 and np.bincount(grid.way).tolist() == [8] * 12
    assert (grid.reach[:, 0] < grid.tangent.min() + 1e-6).all()
    across = lamps(np.array([[0, 0, 1.0], *fields.ring(30, 3), *fields.ring(60, 3, 120)]))
    assert len(across.steps) == 3  # straight down needs none of its own
    assert np.isfinite(across.tangent).all()


SIZES = [(1, 1), (1, 7), (5, 1), (7, 3), (2, 2)]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("tiles", [True, False])
def test_small_odd_and_extreme_reliefs_are_sound(size, tiles):
    random = np.random.default_rng(0)
    views = np.array([UP, direction(45, 45), direction(85, 100), direction(90, 0)])
    for depth in (0.0, 2.0, 10.0 * max(size)):
        made = replace(fields.plain(random.random(size, np.float32), depth=depth), tiles=tiles)
        found = all_images(baked(made, views, views, bounce=True))
        assert found.shape == (16, *size, 3)
        assert np.isfinite(found).all() and (found >= 0).all()


def test_spikes_and_view_along_the_light():
    height = np.zeros((24, 24), np.float32)
    height[::6, ::6] = 1
    made = fields.plain(height, depth=40.0)
    views = np.array([direction(theta, 33) for theta in (0, 30, 60, 85)])
    found = all_images(baked(made, views, views)).reshape(4, 4, 24, 24, 3)
    assert np.isfinite(found).all()
    # with the light in the viewer's eye no cast shadow is seen
    bright = all_images(baked(made, views, views, shadows=False)).reshape(found.shape)
    for k in range(4):
        assert (found[k, k] == bright[k, k]).mean() > 0.98


def test_wrong_calls_are_refused():
    made = fields.colourful()
    for wrong in (UP, np.zeros((2, 2)), [[np.nan, 0, 1]]):
        with pytest.raises(InvalidParameter, match="colourful: views"):
            baked(made, wrong, [UP])
    with pytest.raises(InvalidBtf, match="light 0 is no unit vector"):
        baked(made, [UP], [[0, 0, 2]])
    with pytest.raises(InvalidBtf, match="light 1 lies below"):
        baked(made, [UP], [UP, [0, 0, -1]])
    with pytest.raises(InvalidParameter, match="0 threads"):
        baked(made, [UP], [UP], threads=0)


def test_what_is_kept_between_reads_is_one_view():
    made = relief(fields.colourful())
    stack = BakedStack(made, SOME, SOME)
    stack.read([0, 1, 8])
    assert {view for view, _ in stack._kept} == {2}
