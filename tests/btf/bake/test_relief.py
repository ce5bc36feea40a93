"""What a PBR set is taken for: depth, contradictions between maps, slopes, steps of 8 bits."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from btfcore.btf.bake.depth import dequantized, fitted_depth
from btfcore.btf.bake.relief import ALPHA, DIFFUSE, MIRROR, OPEN, SHARPEST, relief
from btfcore.btf.bake.slopes import (
    integrated,
    mirrored,
    normals_of_slopes,
    slopes_of_height,
    slopes_of_normals,
)
from btfcore.errors import InvalidParameter
from tests.btf.bake import fields


def with_normals(depth=5.0, *, tiles=True, size=(48, 64)):
    """PBR set without a depth whose normals are those of its heights at `depth`."""
    height = fields.bumps(*size)
    normal = normals_of_slopes(slopes_of_height(height * depth, tiles=tiles))
    made = fields.plain(height, depth=None, normal=normal.astype(np.float32))
    return replace(made, tiles=tiles)


@pytest.mark.parametrize("tiles", [True, False])
@pytest.mark.parametrize("depth", [0.3, 5.0, 20.0])
def test_depth_is_told_by_the_normals(depth, tiles):
    made = with_normals(depth, tiles=tiles)
    fit = fitted_depth(made.height, made.normal, tiles=tiles)
    assert fit.depth == pytest.approx(depth, rel=1e-3)
    assert min(fit.correlation) > 0.999
    assert relief(made).depth == pytest.approx(depth, rel=1e-3)
    assert "fitted to the normal map" in relief(made).notes[0]


def test_depth_of_8_bit_maps_is_told_too():
    made = with_normals(5.0)
    coarse = replace(
        made,
        height=np.rint(made.height * 255).astype(np.float32) / 255,
        normal=np.rint((made.normal + 1) * 127.5).astype(np.float32) / 127.5 - 1,
    )
    assert relief(coarse).depth == pytest.approx(5, rel=0.02)


def test_inverted_heights_and_flipped_greens_are_noted_and_tell_the_depth_all_the_same():
    made = with_normals()
    turned = made.normal * np.array([1, -1, 1], np.float32)
    wrong = {
        "pits": replace(made, height=1 - made.height),
        "green": replace(made, normal=turned),
        "pits and green": replace(made, height=1 - made.height, normal=turned),
        "": made,
    }
    for name, each in wrong.items():
        found = relief(each)
        notes = " ".join(found.notes)
        assert ("pits" in notes, "green" in notes) == ("pits" in name, "green" in name)
        assert found.depth == pytest.approx(5, rel=1e-3)
        wanted = normals_of_slopes(slopes_of_normals(each.normal))
        assert np.allclose(found.maps[..., :3], wanted, atol=1e-6)  # nothing was turned


def test_depth_without_a_match_is_a_share_of_the_edge():
    made = with_normals()
    other = replace(made, normal=np.roll(made.normal, 20, axis=1)[::-1].copy())
    for each, why in ((other, "does not match"), (replace(made, normal=None), "nothing tells")):
        found = relief(each)
        assert found.depth == 64 / 50 and why in found.notes[-1]
    assert relief(replace(other, depth=3.0)).depth == 3
    assert relief(replace(other, depth=3.0), depth=7).depth == 7


@pytest.mark.parametrize("depth", [-1, np.nan, np.inf, 641, "deep"])
def test_depths_out_of_range_are_refused(depth):
    with pytest.raises(InvalidParameter, match=r"test: a depth of .* where 0 to 640"):
        relief(with_normals(), depth=depth)


def test_other_knobs_out_of_range_are_refused():
    for knob in ({"roughness": 1.5}, {"reflectance": -0.1}, {"plane": "bottom"}):
        with pytest.raises(InvalidParameter, match="test: "):
            relief(with_normals(), **knob)


def test_level_and_ceiling_bound_the_relief():
    made = relief(fields.plain(fields.blocks(24), depth=4))
    plane, top, bottom = made.level
    assert (top, bottom) == (4, 0) and plane == pytest.approx(made.height.mean())
    assert relief(fields.plain(fields.blocks(24), depth=4), plane="top").level[0] == 4
    corners = [
        np.roll(made.height, shift, (0, 1)) for shift in ((0, 0), (-1, 0), (0, -1), (-1, -1))
    ]
    assert np.array_equal(made.ceiling, np.max(corners, axis=0))


def test_material_of_metals_and_others():
    maps = fields.colourful(metallic=None, ao=None)
    plastic = relief(maps).maps
    assert np.array_equal(plastic[..., DIFFUSE : DIFFUSE + 3], maps.albedo)
    assert np.allclose(plastic[..., MIRROR : MIRROR + 3], 0.04)
    metal = relief(replace(maps, metallic=np.ones(maps.shape, np.float32))).maps
    assert np.array_equal(metal[..., MIRROR : MIRROR + 3], maps.albedo)
    assert (metal[..., DIFFUSE : DIFFUSE + 3] == 0).all()
    assert np.allclose(metal[..., ALPHA], np.maximum(maps.roughness**2, SHARPEST))


def test_occlusion_counts_only_where_nothing_is_traced():
    made = fields.colourful()
    assert (relief(made).maps[..., OPEN] == 1).all()
    flat = relief(replace(made, height=None))
    assert np.array_equal(flat.maps[..., OPEN], made.ao) and flat.flat
    assert any("occlusion" in note for note in flat.notes)


def test_what_does_not_tile_is_continued_by_its_mirror_image():
    made = replace(fields.colourful(), tiles=False)
    found = relief(made)
    assert found.shape == made.shape and found.height.shape == (48, 64)
    assert np.array_equal(found.height, found.height[::-1, ::-1])
    flipped = found.maps[:, ::-1] * np.array([-1, *[1] * 11], np.float32)
    assert np.array_equal(found.maps, flipped)
    flipped = found.maps[::-1] * np.array([1, -1, *[1] * 10], np.float32)
    assert np.array_equal(found.maps, flipped)


@given(arrays(np.float64, (4, 5, 2), elements=st.floats(-10, 10)))
def test_slopes_and_normals_are_one(slopes):
    assert np.allclose(slopes_of_normals(normals_of_slopes(slopes)), slopes, atol=1e-9)


def test_mirrored_slopes_are_those_of_mirrored_heights():
    height = np.random.default_rng(0).random((5, 6))
    wide = np.concatenate([height, height[:, ::-1]], axis=1)
    wide = np.concatenate([wide, wide[::-1]], axis=0)
    slopes = slopes_of_height(height, tiles=False)
    assert np.allclose(mirrored(slopes), slopes_of_height(wide, tiles=True))


@pytest.mark.parametrize("tiles", [True, False])
def test_normals_integrate_to_the_heights_that_they_came_from(tiles):
    height = fields.bumps(40, 56) * 6.0
    if not tiles:
        height = np.add.outer(np.sin(np.arange(40) / 9.0), np.cos(np.arange(56) / 7.0)) * 3
    slopes = slopes_of_height(height, tiles=tiles)
    found = integrated(slopes, tiles=tiles)
    assert np.allclose(found, height - height.mean(), atol=0.04)  # of a height of 6 and 12
    made = fields.plain((40, 56), normal=normals_of_slopes(slopes).astype(np.float32))
    made = replace(made, tiles=tiles)
    assert relief(made).flat
    found = relief(made, integrate=True)
    assert found.depth == pytest.approx(np.ptp(height), rel=0.01)
    assert np.allclose(found.height[:40, :56], height - height.mean(), atol=0.04)


def test_noise_in_normals_does_not_become_stripes():
    noise = np.random.default_rng(0).normal(scale=0.1, size=(32, 48, 2))
    found = integrated(noise, tiles=True)
    spectrum = np.abs(np.fft.fft2(found))
    assert spectrum[14:19].mean() < spectrum[4:9].mean()
    assert spectrum[:, 22:27].mean() < spectrum[:, 4:9].mean()


@pytest.mark.parametrize("width", [3.0, 8.0, 20.0])
def test_steps_are_taken_out(width):
    height = 0.2 + 0.6 * fields.bumps(128, 128, width)
    coarse = (np.rint(height * 255) / 255).astype(np.float32)
    fine = dequantized(coarse, tiles=True)
    assert np.abs(fine - coarse).max() <= 0.5 / 255 + 1e-6

    def error(values):
        wrong = slopes_of_height(values, tiles=True) - slopes_of_height(height, tiles=True)
        return np.sqrt((wrong**2).mean())

    assert error(fine) < error(coarse) * (0.35 if width > 10 else 1)
    assert np.sqrt(((fine - height) ** 2).mean()) < np.sqrt(((coarse - height) ** 2).mean())


def test_steps_that_are_meant_stay():
    for height in (fields.blocks(24), fields.bumps(24, 24), np.full((4, 4), 0.5, np.float32)):
        assert dequantized(height, tiles=True) is height
    stairs = np.repeat(np.arange(0, 256, 8, dtype=np.float32) / 255, 8)[None].repeat(16, 0)
    found = dequantized(stairs, tiles=False)
    assert np.abs(found - stairs).max() < 0.02 / 255  # eight levels high each
