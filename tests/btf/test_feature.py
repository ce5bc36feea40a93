"""Masks made ready for painting, light evened out, and samples opened with their masks."""

import numpy as np
import pytest
from PIL import Image

from btfcore.btf.feature import check_mask, components, flat_fielded, half_width, prepared
from btfcore.btf.image import read_mask
from btfcore.errors import InvalidImage
from btfcore.samples import load_paint_sample
from tests.surfaces import blobs

ROW, COLUMN = np.mgrid[:120, :160].astype(np.float64)


def line(width, angle=0.0):
    """Straight line of `width` texels through the middle of 160 x 120."""
    away = (COLUMN - 80) * np.sin(angle) + (ROW - 60) * np.cos(angle)
    along = (COLUMN - 80) * np.cos(angle) - (ROW - 60) * np.sin(angle)
    return ((np.abs(away) < width / 2) & (np.abs(along) < 40)).astype(np.float32)


def disk(radius, column=80.0, row=60.0):
    return (np.hypot(COLUMN - column, ROW - row) < radius).astype(np.float32)


@pytest.mark.parametrize("angle", [0.0, 0.4, np.pi / 4, np.pi / 2])
@pytest.mark.parametrize("width", [4, 9, 15])
def test_half_width_of_a_strip_is_half_its_width(width, angle):
    assert half_width(line(width, angle) > 0) == pytest.approx(width / 2, abs=0.75)


@pytest.mark.parametrize("radius", [5, 12, 30])
def test_half_width_of_a_disk_is_its_radius(radius):
    assert half_width(disk(radius) > 0) == pytest.approx(radius, abs=1.0)


def test_half_width_of_what_has_no_edge():
    assert half_width(np.zeros((9, 9), bool)) == 0
    assert half_width(np.ones((9, 9), bool)) == np.inf
    # the sample's border is none: half a disk is as wide as a whole one
    assert half_width(disk(20, column=0) > 0) == pytest.approx(20, abs=1.0)


@pytest.mark.parametrize("angle", [0.0, 0.7])
@pytest.mark.parametrize("width", [1, 2, 3])
def test_thin_lines_are_thickened_by_about_six_texels(width, angle):
    found = prepared(line(width, angle))
    assert 0 < found.drawn_half_width <= 2
    assert found.half_width == pytest.approx(found.drawn_half_width + 6, abs=0.75)
    drawn = line(width, angle) > 0.5
    assert (found.mask[drawn] == 1).all()
    soft = (found.mask > 0) & (found.mask < 1)
    assert soft.any() and not found.mask.flags.writeable
    # across the line the edge is a ramp of four texels
    across = prepared(line(1)).mask[:60, 80]
    ramp = across[(across > 0) & (across < 1)]
    assert np.allclose(np.diff(ramp), 0.25, atol=1e-6) and len(ramp) == 4


def test_wide_features_keep_their_outline():
    found = prepared(disk(20))
    assert np.array_equal(found.mask > 0.5, disk(20) > 0.5)
    assert found.half_width == found.drawn_half_width
    again = prepared(found.mask)
    assert np.array_equal(again.mask, found.mask)


def test_thickening_grows_less_the_wider_a_feature_is():
    grown = [prepared(disk(r)).half_width - half_width(disk(r) > 0) for r in (2.5, 4, 5, 6, 7, 9)]
    assert grown[0] == pytest.approx(6, abs=1) and grown[-1] == 0
    assert all(a >= b - 0.5 for a, b in zip(grown, grown[1:], strict=False))


def test_specks_and_pinholes_go_but_pieces_of_a_broken_line_stay():
    mask = disk(30)
    mask[5, 5] = mask[110, 150] = 1  # specks
    mask[60, 80] = mask[61, 80] = 0  # a pinhole
    found = prepared(mask)
    assert len(found.components) == 1 and "2 specks" in found.notes[0]
    assert (found.mask[55:65, 75:85] == 1).all()
    broken = line(2)
    broken[:, 70:74] = 0
    broken[:, 84:88] = 0  # a piece of 20 texels between two of 60
    broken[:, 110:] = 0
    found = prepared(broken)
    assert len(found.components) == 1 and not any("speck" in note for note in found.notes)
    assert (found.mask[60, 45:105] > 0.5).all()


def test_noise_of_a_compressed_mask_does_no_harm(tmp_path):
    random = np.random.default_rng(0)
    clean = disk(18)
    noisy = np.clip(clean + 0.12 * random.standard_normal(clean.shape), 0, 1)
    Image.fromarray((noisy * 255).astype(np.uint8)).save(tmp_path / "mask.jpg", quality=40)
    found = prepared(read_mask(tmp_path / "mask.jpg"))
    assert len(found.components) == 1
    assert np.mean((found.mask > 0.5) != (clean > 0.5)) < 0.002


def test_components_fall_in_area_and_know_where_they_lie():
    mask = disk(10, 40, 30) + disk(6, 120, 80) + disk(6, 20, 90)
    mask[115:, 150:] = 1
    labels, parts = components(mask > 0)
    assert [part.area for part in parts] == sorted((part.area for part in parts), reverse=True)
    assert [(labels == k).sum() for k in range(4)] == [part.area for part in parts]
    assert parts[0].centre == pytest.approx((40, 30)) and parts[0].box == (31, 21, 50, 40)
    assert parts[1].centre == pytest.approx((120, 80))  # a tie falls to the upper one
    assert parts[2].centre == pytest.approx((20, 90)) and parts[2].border == ()
    assert parts[3].border == ("right", "bottom") and parts[3].area == 50
    assert (labels[mask == 0] == -1).all()
    assert components(np.zeros((4, 5), bool))[1] == ()


def test_a_feature_at_the_border_is_noted():
    assert any("border (left)" in note for note in prepared(disk(20, column=0)).notes)
    assert prepared(disk(20)).notes == ()


def test_lines_that_would_fill_the_sample_are_thickened_less():
    mask = np.zeros((64, 64), np.float32)
    mask[::12] = 1
    found = prepared(mask)
    assert (found.mask > 0.5).mean() <= 0.6
    assert any("lest they fill" in note for note in found.notes)


def test_masks_of_no_use_are_refused_with_the_share():
    size = (120, 160)
    with pytest.raises(InvalidImage, match=r"m: the mask is empty: 0 % .*brightest texel is 0.004"):
        check_mask("m", np.full(size, 0.004, np.float32), size)
    with pytest.raises(InvalidImage, match=r"the mask is full: 100.00 %"):
        prepared(np.ones(size, np.float32))
    holes = np.ones(size, np.float32)
    holes[::7, ::9] = 0
    with pytest.raises(InvalidImage, match="the mask is full"):
        prepared(holes)
    tiny = np.zeros((4, 4), np.float32)
    tiny[:3, :3] = 1  # seven texels of background are a lot of sixteen
    assert np.array_equal(prepared(tiny, thicken=0).mask > 0.5, tiny > 0.5)
    with pytest.raises(InvalidImage, match="a mask of 160 x 120 texels for a sample of 128 x 64"):
        check_mask("m", disk(5), (64, 128))
    bad = disk(5)
    bad[3, 3] = np.nan
    with pytest.raises(InvalidImage, match="1 values of the mask"):
        check_mask("m", bad, size)


@pytest.mark.parametrize("mode", ["L", "RGB", "red", "RGBA", "black on clear", "I;16", "1"])
def test_masks_of_every_kind_of_image_are_read(tmp_path, mode):
    drawn = disk(12)
    grey = (drawn * 255).astype(np.uint8)
    empty = np.zeros_like(grey)
    pictures = {
        "L": grey,
        "RGB": np.stack([grey] * 3, axis=2),
        "red": np.stack([grey, empty, empty], axis=2),
        "RGBA": np.stack([np.full_like(grey, 255)] * 3 + [grey], axis=2),
        "black on clear": np.stack([empty] * 3 + [grey], axis=2),
        "I;16": (drawn * 65535).astype(np.uint16),
        "1": grey > 0,
    }
    Image.fromarray(pictures[mode]).save(tmp_path / "mask.png")
    assert np.array_equal(read_mask(tmp_path / "mask.png") > 0.5, drawn > 0.5)


def shaded(seed=1):
    """Even picture with a dark stain, and the light that falls on it."""
    picture = 0.3 + 0.4 * blobs(120, 160, seed=seed).colour
    picture[disk(25, 110, 40) > 0] *= 0.3
    x, y = COLUMN / 80 - 1, ROW / 60 - 1
    light = np.exp(0.5 * x - 0.4 * y - 0.4 * x * x + 0.3 * x * y)
    return picture, (picture * light[..., None]).astype(np.float32)


def test_light_is_evened_out_and_the_stain_stays_dark():
    even, lit = shaded()
    mask = disk(25, 110, 40)
    found = flat_fielded(lit, mask)
    ground = mask == 0
    scale = found[ground].mean() / even[ground].mean()
    off = np.abs(found / (even * scale) - 1)
    assert np.median(off) < 0.03 and off.max() < 0.15
    was = np.abs(lit / (even * lit[ground].mean() / even[ground].mean()) - 1)
    assert np.median(was) > 0.2
    assert found[ground].mean() == pytest.approx(lit[ground].mean(), rel=0.02)
    # with the stain taken for background, light is blamed for it
    blind = flat_fielded(lit)
    assert np.median(np.abs(blind / (even * blind[ground].mean() / even[ground].mean()) - 1)) > (
        2 * np.median(off)
    )


def test_even_light_changes_next_to_nothing():
    # what is left is what little slow change the random pattern has itself
    even = shaded(seed=3)[0].astype(np.float32)
    found = flat_fielded(even, disk(25, 110, 40))
    assert np.abs(found - even).max() < 0.06
    black = np.zeros((20, 30, 3), np.float32)
    assert np.array_equal(flat_fielded(black), black)


def test_a_sample_is_opened_with_a_mask_beside_it(tmp_path):
    colour = (blobs(120, 160).colour * 255).astype(np.uint8)
    Image.fromarray(colour).save(tmp_path / "wall.png")
    Image.fromarray((line(1) * 255).astype(np.uint8)).save(tmp_path / "crack.png")
    sample, notes = load_paint_sample(tmp_path / "wall.png", tmp_path / "crack.png")
    assert np.array_equal(sample.mask, prepared(line(1)).mask) and sample.is_image
    assert notes == sample.notes
    plain, _ = load_paint_sample(tmp_path / "wall.png")
    assert plain.mask is None
    assert np.array_equal(plain.image(0, 0), sample.image(0, 0))
    flat, _ = load_paint_sample(tmp_path / "wall.png", tmp_path / "crack.png", flat=True)
    assert np.array_equal(flat.image(0, 0), flat_fielded(sample.image(0, 0), sample.mask))
    Image.fromarray(np.zeros((50, 60), np.uint8)).save(tmp_path / "small.png")
    with pytest.raises(InvalidImage, match=r"small.png: a mask of 60 x 50 .* 160 x 120"):
        load_paint_sample(tmp_path / "wall.png", tmp_path / "small.png")
    with pytest.raises(InvalidImage, match="no such file"):
        load_paint_sample(tmp_path / "wall.png", tmp_path / "none.png")
    Image.fromarray(np.zeros((120, 160), np.uint8)).save(tmp_path / "empty.png")
    with pytest.raises(InvalidImage, match=r"empty.png: the mask is empty: 0 %"):
        load_paint_sample(tmp_path / "wall.png", tmp_path / "empty.png")


def test_real_defects_keep_their_place(data):
    for name in ("crackforest_034", "MT_Blowhole_0", "MT_Break_0", "MT_Fray_0", "MT_Crack_0"):
        folder = data / "textures" / "imperf"
        sample, notes = load_paint_sample(folder / f"{name}.jpg", folder / f"{name}_mask.png")
        drawn = read_mask(folder / f"{name}_mask.png") > 0.5
        kept = sample.mask[drawn] > 0.5
        assert kept.mean() > 0.98, name
        assert half_width(sample.mask > 0.5) >= 6, name
        assert (sample.mask > 0.5).mean() < 0.2, name
