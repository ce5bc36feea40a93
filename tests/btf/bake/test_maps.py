"""PBR sets of another size show the same material."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf.bake.maps import cropped, resized
from btfcore.btf.bake.slopes import normals_of_slopes, slopes_of_height, slopes_of_normals
from btfcore.errors import InvalidParameter
from tests.btf.bake import fields


def test_a_smaller_set_has_the_means():
    made = fields.colourful(24, 32, texel_size=0.5, depth=4.0)
    small = resized(made, 8)
    assert small.shape == (6, 8)
    assert small.depth == 1 and small.texel_size == 2
    for name in ("albedo", "height", "metallic", "ao", "mask"):
        old, new = getattr(made, name), getattr(small, name)
        assert np.allclose(new[0, 0], old[:4, :4].mean(axis=(0, 1)), atol=1e-6)
        assert new.mean() == pytest.approx(old.mean(), abs=1e-6)
    assert (small.tiles, small.licence, small.name) == (made.tiles, made.licence, made.name)


def test_sizes_that_do_not_divide_keep_the_mean():
    made = fields.colourful(24, 32)
    for size in (31, 13, 5, 1):
        small = resized(made, size)
        assert max(small.shape) == size
        assert small.albedo.mean() == pytest.approx(made.albedo.mean(), abs=2e-3)
    assert resized(made, 1).albedo.shape == (1, 1, 3)


def test_normals_stay_those_of_the_heights():
    height = fields.bumps(64, 64, 6.0)
    normal = normals_of_slopes(slopes_of_height(height * 8.0, tiles=True)).astype(np.float32)
    small = resized(fields.plain(height, depth=8.0, normal=normal), 32)
    wanted = slopes_of_height(small.height * small.depth, tiles=True)
    assert np.abs(slopes_of_normals(small.normal) - wanted).max() < 0.03
    assert np.allclose(np.linalg.norm(small.normal, axis=2), 1, atol=1e-6)


def test_a_depth_that_only_normals_tell_is_told_before():
    height = fields.bumps(64, 64, 3.0)
    normal = normals_of_slopes(slopes_of_height(height * 8.0, tiles=True)).astype(np.float32)
    small = resized(fields.plain(height, depth=None, normal=normal), 16)
    assert small.depth == pytest.approx(2, rel=1e-3)
    assert "at 64 x 64 texels: depth 8.00" in small.notes[-1]
    assert resized(fields.plain(height, depth=None), 16).depth is None


def test_lost_slopes_become_roughness():
    slopes = np.zeros((8, 8, 2))
    slopes[::2, :, 0], slopes[1::2, :, 0] = 0.3, -0.3
    maps = {
        "normal": normals_of_slopes(slopes).astype(np.float32),
        "roughness": np.full((8, 8), 0.4, np.float32),
    }
    made = fields.plain((8, 8), **maps)
    small = resized(made, 4)
    assert np.allclose(small.normal, [0, 0, 1], atol=1e-6)
    assert np.allclose(small.roughness**4, 0.4**4 + 0.3**2, atol=1e-5)
    assert np.allclose(resized(made, 4, roughen=False).roughness, 0.4)


@pytest.mark.parametrize("tiles", [True, False])
def test_a_larger_set_interpolates(tiles):
    made = replace(fields.colourful(6, 8), tiles=tiles)
    large = resized(made, 16)
    assert large.shape == (12, 16) and large.depth == made.depth * 2
    old, new = made.height.astype(float), large.height
    assert np.allclose(new[3, 3], np.array([0.75, 0.25]) @ old[1:3, 1:3] @ [0.75, 0.25])
    corner = old[:1, :1] if not tiles else old[[[-1], [0]], [[-1, 0]]]
    weight = np.array([0.25, 0.75])
    assert np.allclose(new[0, 0], weight @ corner @ weight if tiles else corner[0, 0])


def test_the_same_size_is_the_same_set():
    made = fields.colourful()
    assert resized(made, 32) is made


@pytest.mark.parametrize("size", [0, -3, 16385])
def test_sizes_out_of_range_are_refused(size):
    with pytest.raises(InvalidParameter, match=f"colourful: a size of {size} texels"):
        resized(fields.colourful(), size)


def test_a_window_is_that_part():
    made = fields.colourful()
    part = cropped(made, slice(2, 10), slice(5, -4))
    assert part.shape == (8, 23) and not part.tiles
    assert np.array_equal(part.normal, made.normal[2:10, 5:-4])
    assert part.depth == made.depth
    for window in (slice(5, 5), slice(40, 50), slice(0, 8, 2)):
        with pytest.raises(InvalidParameter, match="colourful: a window of"):
            cropped(made, window, slice(None))
