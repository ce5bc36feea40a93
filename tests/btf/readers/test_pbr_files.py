"""PBR sets of every naming become the same maps, and upside-down ones are turned."""

import numpy as np
import pytest

from btfcore.btf.colour import linear_to_srgb, srgb_to_linear
from btfcore.btf.readers.pbr_files import looks_like_pbr, read_pbr
from btfcore.btf.readers.pbr_relief import compared, settled, slopes
from btfcore.btf.readers.reduce import area_reduced
from btfcore.errors import InvalidBtf, InvalidParameter
from btfcore.files.exr import encode_exr
from tests.btf.readers.sets import png, to_folder, to_zip

SIZE = 64


def bytes_of(values):
    return np.rint(np.clip(values, 0, 1) * 255).astype(np.uint8)


@pytest.fixture(scope="module")
def truth():
    """A periodic relief: height (H, W) in 0–1, its normals and colours that follow it."""
    y, x = np.mgrid[:SIZE, :SIZE] * (2 * np.pi / SIZE)
    height = 0.5 + 0.2 * np.sin(x) * np.cos(2 * y) + 0.15 * np.sin(3 * x + y) + 0.1 * np.cos(y)
    across = (np.roll(height, -1, 1) - np.roll(height, 1, 1)) / 2 * 8
    up = (np.roll(height, 1, 0) - np.roll(height, -1, 0)) / 2 * 8
    normal = np.stack([-across, -up, np.ones_like(height)], axis=2)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    colour = np.stack([height, 1 - height, 0.3 + 0 * height], axis=2)
    return height.astype(np.float32), normal.astype(np.float32), colour.astype(np.float32)


def maps(truth):
    """Files' contents by role, 8 bits, OpenGL."""
    height, normal, colour = truth
    flat = np.full((SIZE, SIZE), 0.25)
    packed = np.stack([flat, 1 - height, 0 * height], axis=2)
    return {
        "color": png(bytes_of(colour)),
        "gl": png(bytes_of(normal / 2 + 0.5)),
        "dx": png(bytes_of(normal * [1, -1, 1] / 2 + 0.5)),
        "height": png(bytes_of(height)),
        "pits": png(bytes_of(1 - height)),
        "rough": png(bytes_of(1 - height)),
        "gloss": png(bytes_of(height)),
        "metal": png(bytes_of(0 * height)),
        "ao": png(bytes_of(flat)),
        "packed": png(bytes_of(packed)),
    }


NAMINGS = {
    "ambientCG": {
        "Bricks102_1K-PNG_Color.png": "color",
        "Bricks102_1K-PNG_NormalGL.png": "gl",
        "Bricks102_1K-PNG_NormalDX.png": "dx",
        "Bricks102_1K-PNG_Displacement.png": "height",
        "Bricks102_1K-PNG_Roughness.png": "rough",
        "Bricks102_1K-PNG_Metalness.png": "metal",
        "Bricks102_1K-PNG_AmbientOcclusion.png": "ao",
        "Bricks102.png": "color",
    },
    "Poly Haven": {
        "textures/rock_02_diff_1k.png": "color",
        "textures/rock_02_nor_gl_1k.png": "gl",
        "textures/rock_02_disp_1k.png": "height",
        "textures/rock_02_arm_1k.png": "packed",
    },
    "Unreal": {
        "T_Rock_BC.png": "color",
        "T_Rock_N.png": "dx",
        "T_Rock_ORM.png": "packed",
        "T_Rock_H.png": "height",
    },
    "Unreal letters": {
        "T_Rock_D.png": "color",
        "T_Rock_N.png": "dx",
        "T_Rock_R.png": "rough",
        "T_Rock_M.png": "metal",
        "T_Rock_AO.png": "ao",
        "T_Rock_H.png": "height",
    },
    "Blender": {
        "my rock baseColor.png": "color",
        "my rock Normal.png": "gl",
        "my rock Glossiness.png": "gloss",
        "my rock metallic.png": "metal",
        "my rock ambient occlusion.png": "ao",
        "my rock Height.png": "height",
    },
    "roles only": {
        "albedo.png": "color",
        "normal.png": "dx",
        "roughness.png": "rough",
        "metal.png": "metal",
        "ao.png": "ao",
        "depth.png": "pits",
    },
    "the colour map has no role": {
        "rock.png": "color",
        "rock_normal.png": "gl",
        "rock_rough.png": "rough",
        "rock_mtl.png": "metal",
        "rock_occ.png": "ao",
        "rock_bump.png": "pits",
    },
}


@pytest.mark.parametrize("naming", NAMINGS)
def test_all_namings_give_the_same_maps(tmp_path, truth, naming, in_process):
    height, normal, colour = truth
    contents = maps(truth)
    files = {name: contents[what] for name, what in NAMINGS[naming].items()}
    where = to_folder(tmp_path / "set", files)
    assert looks_like_pbr(where)
    found = read_pbr(where)
    assert found.shape == (SIZE, SIZE)
    assert linear_to_srgb(found.albedo) == pytest.approx(colour, abs=0.003)
    assert found.height == pytest.approx(height, abs=0.003)
    assert found.roughness == pytest.approx(1 - height, abs=0.003)
    assert found.metallic == pytest.approx(0, abs=0.003)
    assert found.ao == pytest.approx(0.25, abs=0.003)
    assert (found.normal * normal).sum(axis=2).min() > 0.999
    assert np.linalg.norm(found.normal, axis=2) == pytest.approx(1, abs=1e-5)
    assert found.tiles
    zipped = read_pbr(to_zip(tmp_path / "set.zip", files))
    assert np.array_equal(zipped.normal, found.normal)


def test_decisions_are_told_and_may_be_overruled(tmp_path, truth, in_process):
    contents = maps(truth)
    files = {"albedo.png": contents["color"], "normal.png": contents["dx"]}
    where = to_folder(tmp_path / "set", files)
    found = read_pbr(where)
    assert any("its curl" in note and "DirectX" in note for note in found.notes)
    assert (found.normal * truth[1]).sum(axis=2).min() > 0.999
    forced = read_pbr(where, normals="opengl")
    assert (forced.normal * [1, -1, 1] * truth[1]).sum(axis=2).min() > 0.999
    assert any("kept" in note for note in forced.notes)
    with pytest.raises(InvalidParameter, match="'up'"):
        read_pbr(where, normals="up")
    with pytest.raises(InvalidParameter, match="0 texels"):
        read_pbr(where, size=0)
    to_folder(where, {"depth.png": contents["pits"], "normal.png": b""})
    (where / "normal.png").unlink()
    alone = read_pbr(where)
    assert alone.normal is None
    assert alone.height == pytest.approx(truth[0], abs=0.003)
    assert any("by its name" in note for note in alone.notes)


def test_relief_is_settled_for_each_of_the_four_ways_round(truth):
    height, normal, _ = truth
    for inverted in (False, True):
        for flipped in (False, True):
            given = normal * np.array([1, -1 if flipped else 1, 1], np.float32)
            seen = settled(1 - height if inverted else height, given,
                           green_down=None, sure=False, depth=False)  # fmt: skip
            assert np.allclose(seen.height, height, atol=1e-6)
            assert np.allclose(seen.normal, normal)
            assert bool(seen.notes) == (inverted or flipped)
    flat = settled(np.full_like(height, 0.5), np.zeros_like(normal) + [0, 0, 1],
                   green_down=None, sure=False, depth=False)  # fmt: skip
    assert flat.notes == ()


def test_sizes_keep_proportions_and_the_mean(tmp_path, in_process):
    rng = np.random.default_rng(2)
    colour = rng.integers(0, 255, (90, 60, 3), dtype=np.uint8)
    rough = rng.integers(0, 255, (45, 30), dtype=np.uint8)
    deep = rng.integers(0, 65535, (90, 60), dtype=np.uint16)
    files = {"x_albedo.png": png(colour), "x_rough.png": png(rough), "x_height.png": png(deep),
             "x_metal.png": png(np.full((4, 4), 255, np.uint8))}  # fmt: skip
    where = to_folder(tmp_path, files)
    whole = read_pbr(where, size=4096)
    assert whole.shape == (90, 60)
    assert np.array_equal(whole.albedo, srgb_to_linear(colour))
    assert whole.height == pytest.approx(deep / 65535, abs=1e-6)
    assert (whole.metallic == 1).all()
    small = read_pbr(where, size=40)
    assert small.shape == (40, 27)
    assert small.albedo.mean(axis=(0, 1)) == pytest.approx(whole.albedo.mean(axis=(0, 1)), abs=1e-4)
    assert small.roughness.mean() == pytest.approx(rough.mean() / 255, abs=1e-4)
    to_folder(where, {"x_rough.png": png(rough[:30])})
    with pytest.raises(InvalidBtf, match=r"x_rough\.png: 30 x 30"):
        read_pbr(where)


def test_averages_over_areas():
    rng = np.random.default_rng(0)
    values = rng.random((12, 9)).astype(np.float32)
    plain = values.reshape(4, 3, 3, 3).mean(axis=(1, 3))
    assert area_reduced(values, 4, 3, False) == pytest.approx(plain, abs=1e-6)
    for size in ((5, 7), (12, 9), (30, 20), (1, 1)):
        assert area_reduced(values, *size, False).mean() == pytest.approx(values.mean(), abs=1e-5)
    assert np.array_equal(area_reduced(values, 24, 18, False)[::2, ::2], values)


def test_float_maps_and_two_channel_normals(tmp_path, truth, in_process):
    height, normal, colour = truth
    two = normal / 2 + 0.5
    two[..., 2] = 0
    spread = np.repeat(height[:, :, None] * 4 - 2, 3, axis=2)
    files = {
        "x_basecolor.exr": encode_exr(colour),
        "x_normal.png": png(bytes_of(two)),
        "x_height.exr": encode_exr(spread, half=False),
    }
    found = read_pbr(to_folder(tmp_path, files))
    assert found.albedo == pytest.approx(colour, abs=1e-3)  # floats are linear already
    assert (found.normal * normal).sum(axis=2).min() > 0.999
    low, high = height.min(), height.max()
    assert found.height == pytest.approx((height - low) / (high - low), abs=1e-5)
    assert len([note for note in found.notes if "stretched" in note or "channels" in note]) == 2
    spread[3, 4, 0] = np.nan
    to_folder(tmp_path, {"x_height.exr": encode_exr(spread, half=False)})
    with pytest.raises(InvalidBtf, match=r"x_height\.exr: 1 of its values"):
        read_pbr(tmp_path)


def test_several_sets_are_listed_and_chosen_by_name(tmp_path, truth, in_process):
    contents = maps(truth)
    files = {}
    for name in ("Rock", "moss"):
        files[f"{name}_albedo.png"] = contents["color"]
        files[f"{name}_rough.png"] = contents["rough"]
    to_folder(tmp_path / "both", files)
    with pytest.raises(InvalidBtf, match="'moss', 'rock'"):
        read_pbr(tmp_path / "both")
    assert read_pbr(tmp_path / "both", name="ROCK").name == "Rock"
    with pytest.raises(InvalidBtf, match="0 PBR sets called 'sand'"):
        read_pbr(tmp_path / "both", name="sand")
    to_folder(tmp_path / "none", {"a.png": contents["color"], "b.png": contents["color"]})
    assert not looks_like_pbr(tmp_path / "none")
    with pytest.raises(InvalidBtf, match="none: no PBR set"):
        read_pbr(tmp_path / "none")


def test_what_does_not_tile_is_told(tmp_path, truth, in_process):
    ramp = np.repeat(np.linspace(0, 255, 64).astype(np.uint8)[:, None], 64, axis=1)
    files = {"a_color.png": png(np.stack([ramp] * 3, axis=2)), "a_rough.png": png(ramp)}
    found = read_pbr(to_folder(tmp_path, files))
    assert not found.tiles
    assert any("top and bottom" in note for note in found.notes)


SETS = {
    "pbr_Bricks102": "",
    "pbr_Metal049A": "",
    "pbr_bark": "",
    "pbr_facade": "",
    "pbr_godot_bricks": "inverted",
    "pbr_rustymetal": "",
    "pbr_seaside_rocks": "DirectX",
    "pbr_wool": "inverted",
}


@pytest.mark.parametrize("name", SETS)
def test_real_sets(data, name, in_process):
    found = read_pbr(data / "textures" / name, size=256)
    assert found.shape == (256, 256)
    assert found.tiles
    assert 0.01 < found.albedo.mean() < 1
    told = " ".join(found.notes)
    assert SETS[name] in told if SETS[name] else told == ""
    relief = compared(found.height, found.normal)
    if np.ptp(found.height) > 0:  # slopes agree both ways once all is the right way up
        assert min(relief.across, relief.up) > 0.3
    p, q = slopes(found.normal)
    assert abs(p.mean()) < 0.2 and abs(q.mean()) < 0.2
