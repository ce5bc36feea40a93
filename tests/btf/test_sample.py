"""A sample's parts cannot contradict each other, and its windows and subsets keep the images."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf.sample import cropped, from_picture, full_index, subset
from btfcore.btf.stack import ArrayStack
from btfcore.errors import InvalidBtf
from tests.btf.bricks import LIGHTS, VIEWS, factors, images, sample


def test_images_are_found_by_view_and_light():
    whole = sample()
    stored = images()
    for view, light in ((0, 0), (2, 7), (4, 11)):
        assert np.array_equal(whole.image(view, light), stored[view * 12 + light])
    assert np.array_equal(whole.pairs()[31], (2, 7))
    assert (whole.shape, whole.images, whole.missing, whole.is_image) == ((6, 8), 60, 0, False)


def test_missing_images_are_counted_and_refused():
    index = full_index(5, 12)
    index[1, 3] = -1
    index[index > 15] -= 1
    some = sample(stack=ArrayStack(np.delete(images(), 15, axis=0)), index=index)
    assert some.missing == 1
    assert np.array_equal(some.image(1, 4), images()[16])
    with pytest.raises(InvalidBtf, match="no image of view 1 under light 3"):
        some.image(1, 3)


def test_a_picture_is_a_btf_of_one_view_and_one_light():
    colours = np.arange(4 * 5 * 3, dtype=np.uint8).reshape(4, 5, 3)
    picture = from_picture("picture", colours, tiles=True)
    assert picture.is_image and picture.tiles
    assert picture.stack.images.base is not None, "the picture was copied"
    assert picture.image(0, 0).max() < 0.06  # sRGB 59 / 255 is 0.044 in linear light


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"views": VIEWS[:4]}, "an index of shape"),
        ({"lights": LIGHTS * 2}, "no unit vector, its length is 2"),
        ({"lights": -LIGHTS}, "below the horizon"),
        ({"lights": np.repeat(LIGHTS[:1], 12, axis=0)}, "same direction"),
        ({"views": np.zeros((5, 2))}, "not \\(n, 3\\)"),
        ({"views": np.full((5, 3), np.nan)}, "no unit vector, its length is nan"),
        ({"index": full_index(5, 12) + 1}, "each of the 60 images must be named once"),
        ({"mask": np.zeros((3, 3), np.float32)}, "a mask of 3 x 3 texels for images of 8 x 6"),
        ({"texel_size": 0.0}, "a texel size of 0"),
        ({"factors": factors(count=7)}, "factors of 7 images for 60"),
    ],
)
def test_contradictions_are_refused_by_name(change, message):
    with pytest.raises(InvalidBtf, match=f"random: .*{message}"):
        replace(sample(), **change)


def test_a_window_shows_the_same_texels():
    mask = np.linspace(0, 1, 48, dtype=np.float32).reshape(6, 8)
    window = cropped(sample(mask=mask, tiles=True), slice(1, 4), slice(2, 7))
    assert window.shape == (3, 5) and not window.tiles
    assert np.array_equal(window.image(3, 2), images()[38][1:4, 2:7])
    assert np.array_equal(window.mask, mask[1:4, 2:7])
    with pytest.raises(InvalidBtf, match="a crop of 0 x 2 texels out of 8 x 6"):
        cropped(sample(), slice(0, 2), slice(9, 12))


def test_a_subset_keeps_pairs_and_factors():
    whole = sample(factors=factors())
    part = subset(whole, [4, 1], [0, 5, 7])
    assert part.images == 6
    assert np.array_equal(part.image(0, 2), whole.image(4, 7))
    assert np.array_equal(part.image(1, 1), whole.image(1, 5))
    assert np.array_equal(part.factors.basis[part.index[0, 2]], whole.factors.basis[55])


def test_arrays_are_locked():
    with pytest.raises(ValueError, match="read-only"):
        sample().views[0, 0] = 1
