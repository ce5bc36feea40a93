"""Laws of the recipes that the shipped samples are baked from."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from btfcore.btf.bake.build import baked
from btfcore.btf.factor.stack import FactorStack
from btfcore.btf.pbr import PbrSet
from btfcore.btf.sample import BtfSample, full_index
from btfcore.btf.stack import ArrayStack
from btfcore.files.package.read import read_package
from resources.recipes.binned import BinnedStack, binned
from resources.recipes.blots import blots
from resources.recipes.book import RECIPES
from resources.recipes.canvas import Canvas
from resources.recipes.cells import cells, distance, grown, scatter, signed
from resources.recipes.emphasis import RepeatedStack, emphasised
from resources.recipes.make import SAMPLES
from resources.recipes.noise import mix, noise, step, warp
from resources.recipes.paths import dense, weakest
from resources.recipes.sheet import looks, write_sheet
from resources.recipes.tubes import draw
from resources.recipes.yarn import Yarn, spin

NAMES = tuple(RECIPES)
FLAWED = tuple(name for name in NAMES if RECIPES[name].base)
SOUND = tuple(name for name in NAMES if not RECIPES[name].base)
CHEAP = ("painted-metal", "linen", "scratched-varnish", "cracked-brick")
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@cache
def maps(name: str) -> PbrSet:
    recipe = RECIPES[name]
    return recipe.draw(Canvas(recipe.size, recipe.seed, fine=2))


def arrays(pbr: PbrSet) -> dict[str, np.ndarray]:
    names = ("albedo", "height", "roughness", "metallic", "mask")
    return {each: getattr(pbr, each) for each in names if getattr(pbr, each) is not None}


def test_there_are_six_backgrounds_and_six_imperfections_of_them():
    assert len(SOUND) >= 6
    assert len(FLAWED) >= 6
    assert {RECIPES[name].base for name in FLAWED} <= set(SOUND)
    assert len({(each.draw, each.seed) for each in RECIPES.values()}) == len(RECIPES)
    assert all(RECIPES[name].size <= 192 for name in NAMES)


@pytest.mark.parametrize("name", CHEAP)
def test_a_recipe_gives_the_same_bits_again_and_others_for_another_seed(name):
    recipe = RECIPES[name]
    one, other = (recipe.draw(Canvas(recipe.size, recipe.seed, fine=1)) for _ in range(2))
    for kind, values in arrays(one).items():
        assert np.array_equal(values, arrays(other)[kind]), kind
    third = recipe.draw(Canvas(recipe.size, recipe.seed + 1, fine=1))
    assert not np.array_equal(one.albedo, third.albedo)
    assert not np.array_equal(one.height, third.height)


@pytest.mark.parametrize("name", NAMES)
def test_maps_lie_in_their_ranges(name):
    pbr = maps(name)
    assert pbr.shape == (RECIPES[name].size,) * 2
    assert pbr.name == name
    assert pbr.licence == "CC0"
    assert name in pbr.origin
    assert 0.002 < pbr.albedo.min() and pbr.albedo.max() <= 0.95
    assert 0.04 < (pbr.albedo @ LUMINANCE).mean() < 0.7
    assert (pbr.height.min(), pbr.height.max()) == pytest.approx((0, 1), abs=1e-6)
    assert 0.2 < pbr.depth < pbr.shape[0] / 8
    # highlights narrower than the layout's 15 degrees would flicker between its lights
    assert 0.35 < pbr.roughness.min() and pbr.roughness.max() <= 1
    assert 0.05 < pbr.texel_size < 10


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("name", NAMES)
def test_opposite_borders_fit(name, axis):
    pbr = maps(name)
    for field in (pbr.albedo, pbr.height):
        jump = np.abs(np.diff(field, axis=axis)).mean(
            axis=tuple({0, 1, 2} - {axis})[: field.ndim - 1]
        )
        across = np.abs(np.take(field, 0, axis) - np.take(field, -1, axis)).mean()
        assert across <= 1.25 * jump.max()


@pytest.mark.parametrize("name", SOUND)
def test_a_background_is_even(name):
    pbr = maps(name)
    assert pbr.mask is None
    light = pbr.albedo @ LUMINANCE
    half = pbr.shape[0] // 2
    parts = [light[r : r + half, c : c + half].mean() for r in (0, half) for c in (0, half)]
    assert max(parts) / min(parts) < 1.2


@pytest.mark.parametrize("name", FLAWED)
def test_an_imperfection_lies_inside_a_plain_surrounding(name):
    mask = maps(name).mask
    rim = mask.shape[0] // 24
    border = np.ones(mask.shape, bool)
    border[rim:-rim, rim:-rim] = False
    assert mask[border].max() == 0
    assert (mask < 0.02).mean() > 0.25
    assert 0.04 < (mask > 0.5).mean() < 0.45
    assert mask.max() > 0.9
    assert ((mask > 0.1) & (mask < 0.9)).mean() > 0.01  # its edge is soft


@pytest.mark.parametrize("name", FLAWED)
def test_what_surrounds_an_imperfection_is_the_background(name):
    pbr, base = maps(name), maps(RECIPES[name].base)
    plain = pbr.mask < 0.01
    assert pbr.texel_size == base.texel_size
    assert np.abs(pbr.albedo[plain].mean(0) - base.albedo.mean((0, 1))).max() < 0.05
    assert np.abs(pbr.albedo[plain].std(0) - base.albedo.std((0, 1))).max() < 0.04
    assert pbr.roughness[plain].mean() == pytest.approx(base.roughness.mean(), abs=0.03)
    own, other = (pbr.height * pbr.depth)[plain].std(), base.height.std() * base.depth
    assert own == pytest.approx(other, rel=0.25)


@pytest.mark.parametrize("name", FLAWED)
def test_an_imperfection_differs_from_its_surrounding(name):
    pbr = maps(name)
    inside, plain = pbr.mask > 0.9, pbr.mask < 0.01
    kinds = (pbr.albedo @ LUMINANCE, pbr.roughness, pbr.height * pbr.depth)
    gap = [abs(each[inside].mean() - each[plain].mean()) / each[plain].std() for each in kinds]
    spread = [each[inside].std() / each[plain].std() for each in kinds]
    assert max(gap) > 0.5 or max(spread) > 1.5


@pytest.mark.parametrize("name", ["painted-metal", "scratched-varnish"])
def test_finer_maps_average_to_the_coarse_ones(name):
    recipe = RECIPES[name]
    coarse = recipe.draw(Canvas(recipe.size, recipe.seed, fine=2))
    fine = recipe.draw(Canvas(recipe.size, recipe.seed, fine=2, detail=2))
    size = recipe.size
    mean = fine.albedo.astype(np.float64).reshape(size, 2, size, 2, 3).mean((1, 3))
    np.testing.assert_allclose(mean, coarse.albedo, atol=1e-3)
    assert fine.texel_size == coarse.texel_size / 2
    rise = (fine.height.astype(np.float64) * fine.depth).reshape(size, 2, size, 2).mean((1, 3)) / 2
    low = coarse.height * coarse.depth
    np.testing.assert_allclose(rise - rise.mean(), low - low.mean(), atol=1e-4)


def test_binned_images_are_means_and_bake_the_same_light():
    images = np.random.default_rng(1).random((5, 8, 12, 3)).astype(np.float32)
    stack = BinnedStack(ArrayStack(images), 2)
    assert stack.shape == (5, 4, 6)
    wanted = images.reshape(5, 4, 2, 6, 2, 3).mean((2, 4))
    np.testing.assert_allclose(stack.read([4, 0]), wanted[[4, 0]], rtol=1e-6)
    up = np.array([[0.0, 0.0, 1.0]])
    sample = baked(maps("rusty-paint"), up, up)
    small = binned(sample, 2)
    assert small.shape == (96, 96)
    assert small.texel_size == sample.texel_size * 2
    assert small.mask.mean() == pytest.approx(sample.mask.mean(), rel=1e-5)
    assert small.image(0, 0).mean() == pytest.approx(sample.image(0, 0).mean(), rel=1e-5)
    assert binned(sample, 1) is sample


def test_repeated_texels_stand_below_the_picture():
    images = np.random.default_rng(2).random((3, 4, 6, 3)).astype(np.float32)
    texels = np.array([3, 7, 23, 3, 7, 23])
    stack = RepeatedStack(ArrayStack(images), texels)
    assert stack.shape == (3, 5, 6)
    read = stack.read([2, 0])
    np.testing.assert_array_equal(read[:, :4], images[[2, 0]])
    np.testing.assert_array_equal(read[:, 4], images.reshape(3, 24, 3)[[2, 0]][:, texels])


def test_emphasis_serves_the_feature_at_the_cost_of_the_plain_texels():
    rng = np.random.default_rng(3)
    images = rng.random((20, 16, 16, 3)).astype(np.float32)
    mask = np.zeros((16, 16), np.float32)
    mask[5:9, 6:10] = 1
    up = np.array([[0.0, 0.0, 1.0]])
    around = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    lights = np.stack([0.6 * np.cos(around), 0.6 * np.sin(around), np.full(20, 0.8)], 1)
    sample = BtfSample("s", ArrayStack(images), up, lights, full_index(1, 20), mask=mask)

    def errors(factors):
        gap = (FactorStack(factors).read(np.arange(20)) - images) ** 2
        return gap[:, mask > 0.5].mean(), gap[:, mask <= 0.5].mean()

    plain = errors(emphasised(sample, rank=6, times=0))
    strong = errors(emphasised(sample, rank=6, times=5))
    assert strong[0] < 0.8 * plain[0]
    assert plain[1] < strong[1] < 1.3 * plain[1]
    bare = errors(emphasised(replace(sample, mask=None), rank=6))
    assert bare == plain


def test_noise_is_normal_and_keeps_to_its_wavelengths():
    canvas = Canvas(64, 3, fine=2)
    field = noise(canvas, "a", 16, 4, slope=0.5)
    assert abs(field.mean()) < 1e-12
    assert field.std() == pytest.approx(1)
    power = np.abs(np.fft.fft2(field)) ** 2
    wave = np.hypot(*np.meshgrid(np.fft.fftfreq(128, 0.5), np.fft.fftfreq(128, 0.5)))
    outside = (wave < 1 / 32) | (wave > 1 / 2)
    assert power[outside].sum() < 0.01 * power.sum()
    assert not np.array_equal(field, noise(canvas, "b", 16, 4, slope=0.5))
    rolled = warp(canvas, field, 3.0, -2.0)
    np.testing.assert_allclose(rolled, np.roll(field, (-6, 4), (0, 1)), atol=1e-9)


def test_distances_grow_and_wrap_around():
    canvas = Canvas(32, 0, fine=1)
    inside = np.zeros((32, 32), bool)
    inside[1, 1] = True
    far = distance(canvas, inside, 12.0)
    assert far[30, 1] == 3
    assert far[16, 16] == 12
    assert signed(canvas, inside, 5.0)[1, 1] > 0
    mask = grown(canvas, inside.astype(float), by=5.0, soft=2.0)
    assert (mask[far <= 4] == 1).all()
    assert (mask[far >= 6] == 0).all()
    assert 0 < mask[1, 6] < 1


def test_cells_belong_to_their_nearest_point_across_the_border():
    canvas = Canvas(16, 4, fine=1)
    points = scatter(canvas, "p", 4.0)
    assert ((points >= 0) & (points < 16)).all()
    found = cells(canvas, points)
    rows, columns = canvas.grid()
    gap = np.stack(np.broadcast_arrays(rows, columns), -1)[:, :, None] - points
    gap -= np.round(gap / 16) * 16
    every = np.sort(np.hypot(gap[..., 0], gap[..., 1]), axis=2)
    np.testing.assert_allclose(found.first, every[..., 0], atol=1e-9)
    np.testing.assert_allclose(found.second, every[..., 1], atol=1e-9)
    np.testing.assert_allclose(np.hypot(*found.offset), found.first, atol=1e-9)


def test_spheres_are_drawn_round_on_top_of_each_other_and_around_the_border():
    canvas = Canvas(16, 0, fine=4)
    places = np.array([[8.125, 8.125, 0.0], [8.125, 8.125, 3.0], [0.125, 15.875, 1.0]])
    drawn = draw(canvas, places, np.array([4.0, 1.5, 2.0]), -9.0)
    assert drawn.height[32, 32] == pytest.approx(4.5, abs=1e-3)
    assert drawn.number[32, 32] == 1
    assert drawn.height[32, 44] == pytest.approx(np.sqrt(16 - 9), abs=1e-3)
    assert drawn.number[32, 44] == 0
    assert drawn.number[2, 2] == drawn.number[-3, -3] == 2
    assert drawn.height[~drawn.covered].max() == -9


def test_yarn_without_ends_closes_and_keeps_within_its_radius():
    canvas = Canvas(32, 1, fine=2)
    line = np.arange(400) / 400 * 32
    path = np.stack([np.full(400, 8.0), line, np.zeros(400)], 1)
    yarn = Yarn(radius=3.0, loose=0.0)
    strand = spin(canvas, "y", path, yarn, closed=np.array([0.0, 32.0, 0.0]))
    away = np.hypot(strand.places[:, 0] - 8, strand.places[:, 2])
    assert away.max() <= 3.0 * 1.06
    places = strand.places.reshape(-1, 400, 3)
    jump = places[:, 0] + [0, 32.0, 0] - places[:, -1]
    pace = np.linalg.norm(np.diff(places, axis=1), axis=2).max()
    assert np.linalg.norm(jump, axis=1).max() < 1.5 * pace


def test_a_crack_takes_the_weakest_way():
    cost = np.ones((20, 20))
    cost[10, :15] = cost[:11, 14] = 0.01
    way, short = weakest(cost, (10, 0), [(0, 14), (10, 4)])
    assert {tuple(each) for each in way.astype(int)} <= set(zip(*np.nonzero(cost < 1), strict=True))
    assert tuple(way[-1]) == (0, 14)
    assert len(short) == 5
    fine = dense(way, 0.25)
    pace = np.linalg.norm(np.diff(fine, axis=0), axis=1)
    assert pace.max() <= 0.25 + 1e-9


def test_blots_are_discs_that_melt_together():
    canvas = Canvas(32, 0, fine=1)
    one = blots(canvas, [(0.5, 0.5, 0.2)], melt=1.0, ragged=0.0)
    rows, columns = canvas.grid()
    np.testing.assert_allclose(one, 6.4 - np.hypot(rows - 16, columns - 16), atol=1e-6)
    two = blots(canvas, [(0.5, 0.4, 0.1), (0.5, 0.6, 0.1)], melt=2.0, ragged=0.0)
    assert two[16, 16] > 3.2 - 3.3 + 1.0


def test_curves_end_where_they_should():
    assert step(1, 3, [0, 1, 2, 3, 4]) == pytest.approx([0, 0, 0.5, 1, 1])
    assert step(3, 1, [0, 2, 4]) == pytest.approx([1, 0.5, 0])
    share = np.array([[0.0, 1.0], [0.5, 0.25]])
    mixed = mix(np.zeros(3), np.ones(3), share)
    assert mixed.shape == (2, 2, 3)
    np.testing.assert_allclose(mixed[..., 1], share)


def test_a_sheet_shows_every_row(tmp_path):
    up = np.array([[0.0, 0.0, 1.0], [0.0, 0.6, 0.8]])
    sample = baked(maps("painted-metal"), up, up)
    path = write_sheet(tmp_path / "a" / "sheet.jpg", [("one", looks(sample))] * 3, side=32)
    assert path.read_bytes()[:2] == b"\xff\xd8"
    assert path.stat().st_size <= 400_000


def test_shipped_samples_are_those_of_the_recipes():
    files = {path.stem: path for path in SAMPLES.glob("*.btfz")}
    if not files:
        pytest.skip("no samples were baked here; make samples does that")
    assert set(files) == set(NAMES)
    assert sum(path.stat().st_size for path in files.values()) <= 40e6
    for name, path in files.items():
        sample = read_package(path)
        assert sample.shape == (RECIPES[name].size,) * 2
        assert sample.factors is not None
        assert sample.tiles
        assert sample.licence == "CC0"
        assert (sample.mask is not None) == bool(RECIPES[name].base)
