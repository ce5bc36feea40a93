"""Which patterns have an orientation of their own."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, rotate

from btfcore.btf.appearance import quilting_sample
from btfcore.paint.isotropy import AWAY, ORDERED, spread_of_orientations
from btfcore.samples import load_paint_sample
from tests.paint.grounds import MESHES

SIDE = 128
EVERYWHERE = np.ones((SIDE, SIDE), np.bool_)
TEXTURES = MESHES.parent / "textures"


def noise(seed=0, channels=2):
    random = np.random.default_rng(seed).standard_normal((SIDE, SIDE, channels))
    return np.stack(
        [gaussian_filter(random[..., k], 2.0) for k in range(channels)], axis=-1
    ).astype(np.float32)


def stripes(degrees, period=9.0):
    row, column = np.mgrid[:SIDE, :SIDE]
    turn = np.radians(degrees)
    wave = np.sin(2 * np.pi * (column * np.cos(turn) + row * np.sin(turn)) / period)
    return wave[..., None].astype(np.float32)


@pytest.mark.parametrize("seed", range(5))
def test_noise_has_none(seed):
    assert spread_of_orientations(noise(seed), EVERYWHERE) < 0.2


@pytest.mark.parametrize("degrees", [0, 17, 45, 90, 120, 173])
def test_stripes_have_one_whatever_their_direction(degrees):
    assert spread_of_orientations(stripes(degrees), EVERYWHERE) > 2.0


def test_a_grid_has_two():
    crossed = np.maximum(stripes(10), stripes(100))
    assert spread_of_orientations(crossed, EVERYWHERE) > 1.5 * ORDERED


def test_it_does_not_depend_on_contrast_or_brightness():
    both = np.concatenate([noise(), 0.3 * stripes(30)], axis=2)
    found = spread_of_orientations(both, EVERYWHERE)
    assert spread_of_orientations(40 * both + 7, EVERYWHERE) == pytest.approx(found, rel=1e-3)


def test_it_grows_with_the_share_of_what_is_ordered():
    found = [
        spread_of_orientations(noise(channels=1) + share * stripes(60), EVERYWHERE)
        for share in (0.0, 0.05, 0.15, 0.5)
    ]
    assert found == sorted(found) and found[-1] > ORDERED > found[0]


def test_turned_by_half_a_bin_it_changes_little():
    values = noise(channels=1) + 0.3 * stripes(0)
    turned = rotate(values, 3.75, reshape=False, order=3, mode="reflect")
    one, other = (spread_of_orientations(each, EVERYWHERE) for each in (values, turned))
    assert other == pytest.approx(one, rel=0.3)


def test_features_and_what_lies_near_them_do_not_count():
    values, background = noise(), EVERYWHERE.copy()
    plain = spread_of_orientations(values, EVERYWHERE)
    values = values.copy()
    values[50:70] += 5 * stripes(90)[50:70]
    background[50:70] = False
    assert spread_of_orientations(values, EVERYWHERE) > ORDERED
    assert AWAY > 4  # more than the wider blur's two standard deviations
    assert spread_of_orientations(values, background) == pytest.approx(plain, abs=0.1)


def test_a_background_that_is_all_near_features_still_counts():
    background = np.indices((SIDE, SIDE)).sum(axis=0) % 2 == 0
    assert spread_of_orientations(stripes(30), background) > 2.0


def test_a_plain_sample_has_none():
    assert spread_of_orientations(np.ones((SIDE, SIDE, 3), np.float32), EVERYWHERE) == 0.0


@pytest.mark.parametrize(
    ("name", "ordered"),
    [
        ("gravel", False),
        ("concrete", False),
        ("rust", False),
        ("brick_red", True),
        ("bark", True),
        ("weave_grey", True),
        ("logs", True),
    ],
)
def test_pictures_are_told_apart(name, ordered):
    sample = quilting_sample(load_paint_sample(TEXTURES / f"{name}.png", flat=True)[0])
    colour = sample.channels
    whole = np.ones(colour.shape[:2], np.bool_)
    assert (spread_of_orientations(colour, whole) >= ORDERED) == ordered
