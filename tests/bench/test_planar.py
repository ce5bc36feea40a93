"""Planar measures are right where the answer is known, and agree with the shared script."""

import re
import subprocess
import sys

import numpy as np
import pytest

from btfcore.errors import InvalidImage
from tests.bench import planar
from tests.bench.plane_work import SIDE, flat_grid, load, pictures, save
from tests.conftest import ROOT


def noise(side, seed=0):
    """Grey noise of 8-bit values, smooth enough to have neighbourhoods."""
    values = np.random.default_rng(seed).random((side, side))
    values = sum(np.roll(values, (a, b), (0, 1)) for a in range(3) for b in range(3)) / 9
    return np.repeat((values * 255).round()[..., None] / 255, 3, axis=2).astype(np.float32)


def pasted(sample, side, block, seed=0):
    """Blocks copied from the sample at random places."""
    random = np.random.default_rng(seed)
    out = np.empty((side, side, 3), np.float32)
    for top in range(0, side, block):
        for left in range(0, side, block):
            row, column = random.integers(0, len(sample) - block + 1, 2)
            piece = sample[row : row + block, column : column + block]
            out[top : top + block, left : left + block] = piece[: side - top, : side - left]
    return out


def test_a_verbatim_copy_has_no_error_and_is_one_piece():
    sample = noise(128)
    found = planar.measure_plane(sample, sample)
    assert found.patch_nn == pytest.approx(0, abs=1e-6) and found.seam == pytest.approx(0, abs=1e-6)
    count = len(range(0, 128 - 10, 8))
    assert found.copied_side == pytest.approx(8 * count)
    assert found.source_use == pytest.approx(1)
    assert found.self_repeat == 0


def test_a_tiling_repeats_and_its_seams_are_seen():
    sample = noise(64)
    found = planar.measure_plane(sample, np.tile(sample, (3, 3, 1)))
    assert found.self_repeat == 1
    assert 0 < found.patch_nn < found.seam
    copies = planar.measure_plane(sample, pasted(sample, 192, 32))
    assert copies.patch_nn > found.patch_nn and copies.copied_side < found.copied_side


def test_nearest_patches_agree_with_a_plain_search():
    sample, output = noise(24, 1), noise(40, 2)
    sample[..., 2] *= np.float32(0.5)  # not grey
    error, where = planar.nearest_patches(sample, output)
    for n, m in ((0, 0), (2, 3), (3, 1)):
        asked = output[8 * n : 8 * n + 11, 8 * m : 8 * m + 11].astype(np.float64)
        best = min(
            (np.sqrt(((asked - sample[r : r + 11, c : c + 11]) ** 2).mean()), r, c)
            for r in range(14)
            for c in range(14)
        )
        assert error[n, m] == pytest.approx(best[0], rel=1e-5)
        assert tuple(where[n, m]) == best[1:]


def test_self_repeat_agrees_with_a_plain_search():
    sample = noise(64, 3)
    output = pasted(sample, 160, 80 // 2, 4)
    grey, bound = output.mean(axis=2), 0.35 * sample.mean(axis=2).std()
    again = []
    for top in range(0, 130, 16):
        for left in range(0, 130, 16):
            piece = grey[top : top + 31, left : left + 31]
            again.append(
                any(
                    np.sqrt(((piece - grey[r : r + 31, c : c + 31]) ** 2).mean()) < bound
                    for r in range(130)
                    for c in range(130)
                    if abs(r - top) > 48 or abs(c - left) > 48
                )
            )
    assert 0 < np.mean(again) < 1
    assert planar.self_repeat(sample, output) == pytest.approx(np.mean(again))


def test_small_pictures_are_refused():
    with pytest.raises(InvalidImage, match="8, 8, 3"):
        planar.measure_plane(noise(8), noise(128))
    with pytest.raises(InvalidImage, match="64, 64, 3"):
        planar.measure_plane(noise(64), noise(64))


def test_the_figures_are_those_of_the_shared_script(tmp_path):
    script = ROOT.parent / "shared" / "checks" / "plane_measures.py"
    if not script.exists():
        pytest.skip("the script that defines the measures, ../shared/checks, is not here")
    save(tmp_path / "sample.png", noise(96, 5))
    save(tmp_path / "output.png", pasted(noise(96, 5), 208, 48, 6))
    said = subprocess.run(
        [sys.executable, str(script), str(tmp_path / "sample.png"), str(tmp_path / "output.png")],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    error, side, use, again = (
        float(re.search(rf"{key} ([\d.]+)", said).group(1))
        for key in ("NN", "side", "use", "self-repeat")
    )
    found = planar.measure_plane(load(tmp_path / "sample.png"), load(tmp_path / "output.png"))
    assert found.patch_nn == pytest.approx(error, abs=6e-4)
    assert found.copied_side == pytest.approx(side, abs=0.51)
    assert found.source_use == pytest.approx(use, abs=6e-3)
    assert found.self_repeat == pytest.approx(again, abs=6e-4)


def test_the_flat_grid_is_a_grid():
    dense, field = flat_grid(20)
    assert dense.vertices.shape == (400, 3) and len(dense.faces) == 2 * 19 * 19
    corner = dense.vertices[dense.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    np.testing.assert_allclose(normal, np.broadcast_to([0, 0, 1.0], normal.shape))
    np.testing.assert_array_equal(dense.texel[:, ::-1] * [1, -1], dense.vertices[:, :2])
    assert (field.tangents == [1, 0, 0]).all()


def test_samples_are_the_top_left_quarter_halved():
    try:
        from skimage import data
    except ImportError:
        pytest.skip("scikit-image, whose pictures the samples are, is not installed")
    from PIL import Image

    found, origin = pictures()
    assert origin.startswith("scikit-image")
    for name, picture in found.items():
        grey = Image.fromarray(getattr(data, name)()[:256, :256])
        assert picture.size == (SIDE, SIDE)
        halved = np.asarray(grey.resize((SIDE, SIDE), Image.Resampling.LANCZOS))
        np.testing.assert_array_equal(np.asarray(picture)[..., 0], halved)


def test_shared_copies_give_the_samples_that_the_quoted_figures_were_measured_on(data):
    del data  # skipped where the copies are not here
    found, origin = pictures()
    assert origin.startswith("scikit-image")
    for name, mean, deviation in (("brick", 111.0778, 27.21755), ("gravel", 125.9114, 37.08907)):
        values = np.asarray(found[name], np.float64)
        assert values.shape == (SIDE, SIDE, 3)
        assert values.mean() == pytest.approx(mean, abs=1e-4)
        assert values.std() == pytest.approx(deviation, abs=1e-4)
