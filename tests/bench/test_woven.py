"""The benchmarks' woven sample is the same everywhere, and it is a weave."""

import numpy as np
import pytest

from btfcore.quilt.grid import sample_grid
from tests.bench.inputs import quilting_sample
from tests.bench.woven import PITCH, RANK, SIZE, woven_btf, woven_maps, woven_sample

FEW = "6x2x6x2"  # directions; the full set takes a quarter of a minute


@pytest.fixture(scope="module")
def btf(tmp_path_factory):
    return woven_btf(directions=FEW, folder=tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="module")
def maps():
    return woven_maps()


def redness(maps):
    """Deviation of red less blue, (128, 128)."""
    value = maps.albedo[..., 0].astype(np.float64) - maps.albedo[..., 2]
    return value - value.mean()


def alike(field, rows, columns):
    """Correlation of a field with itself, moved around."""
    return float((field * np.roll(field, (rows, columns), (0, 1))).mean() / (field**2).mean())


def test_the_same_seed_draws_the_same_bits_and_another_does_not(maps):
    again, other = woven_maps(), woven_maps(seed=5)
    for name in ("albedo", "height", "normal", "roughness"):
        assert np.array_equal(getattr(maps, name), getattr(again, name))
        assert not np.array_equal(getattr(maps, name), getattr(other, name))


def test_baking_anew_gives_the_same_channels_as_the_cache(btf, tmp_path):
    cached = woven_sample(directions=FEW, folder=tmp_path)
    path = next(tmp_path.glob("*.btfz"))
    before = path.stat().st_mtime_ns
    again = woven_sample(directions=FEW, folder=tmp_path)
    assert path.stat().st_mtime_ns == before  # read, not made once more
    assert cached.channels.shape == (SIZE, SIZE, RANK)
    assert np.array_equal(cached.channels, again.channels)
    scale = np.float32(1 / np.sqrt(btf.images))
    assert np.array_equal(cached.channels, btf.factors.weights * scale)


def test_two_colours_take_turns_in_cells_of_a_thread(maps):
    red = redness(maps)
    assert 0.4 < (red > 0).mean() < 0.6
    for step in ((PITCH, 0), (0, PITCH)):
        assert alike(red, *step) < -0.7
        assert alike(red, 2 * step[0], 2 * step[1]) > 0.7
    assert alike(red, PITCH, PITCH) > 0.7


def test_fibres_run_along_their_threads(maps):
    value = maps.albedo.mean(axis=2, dtype=np.float64)
    down, right = np.abs(np.diff(value, axis=0)), np.abs(np.diff(value, axis=1))
    centre = (np.arange(SIZE) % PITCH >= 4) & (np.arange(SIZE) % PITCH < 12)
    inside = centre[:-1, None] & centre[None, :-1]
    warp = (redness(maps) > 0)[:-1, :-1]
    down, right = down[:, :-1], right[:-1]
    assert right[inside & warp].mean() > 1.5 * down[inside & warp].mean()
    assert down[inside & ~warp].mean() > 1.5 * right[inside & ~warp].mean()


def test_threads_rise_over_what_they_cross_and_shine(maps, btf):
    half = np.arange(SIZE) % PITCH
    middle = np.abs(half - PITCH / 2 + 0.5) < 2
    crown = maps.height[np.ix_(middle, middle)]
    hollow = maps.height[np.ix_(half == 0, half == 0)]
    assert crown.mean() > hollow.mean() + 0.4
    # highlights are white, and red threads have next to no green of their own
    green = btf.stack.read(np.arange(btf.images))[..., 1].max(axis=0)
    red = redness(maps) > 0
    assert np.quantile(green[red], 0.9) > 4 * maps.albedo[..., 1][red].mean()


def test_neighbours_are_nearer_than_strangers(btf):
    from btfcore.btf.appearance import quilting_sample as channels

    grid = sample_grid(channels(btf))
    assert grid.texel_difference < 0.4 * grid.random_difference


def test_inputs_offer_it_by_name_beside_files():
    assert quilting_sample("brick_red.png").channels.shape[2] == 3
