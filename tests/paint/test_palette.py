"""Palettes: samples in one space, their features, and what painting asks about them."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from btfcore.btf.feature import half_width
from btfcore.errors import InvalidImage, InvalidParameter
from btfcore.paint.palette import feature_at, palette_of, values_at
from btfcore.patch.connectivity import connect
from btfcore.quilt.candidates import CandidateFinder
from btfcore.quilt.layout import Borders, lay_out
from btfcore.quilt.matching import Matcher
from btfcore.quilt.metric import distance
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.synthesize import Synthesizer
from btfcore.types import Sample
from tests.surfaces import constant_field, sphere


def sample(name, height, width, seed, *, channels=5, radius=0.0, dark=0.6):
    """Smooth random channels with a feature, darker in the first channels."""
    from scipy.ndimage import gaussian_filter

    noise = np.random.default_rng(seed).standard_normal((height, width, channels))
    values = np.stack([gaussian_filter(noise[..., k], 2) for k in range(channels)], axis=-1)
    row, column = np.mgrid[:height, :width]
    mask = None
    if radius:
        mask = (np.hypot(row - height / 2, column - width / 2) < radius).astype(np.float32)
        values[..., :2] -= dark * mask[..., None]
    values = values.astype(np.float32)
    return Sample(name, values[..., :3].copy(), values, mask=mask)


@pytest.fixture(scope="module")
def palette():
    return palette_of(SAMPLES, [1.0, 1.0, 0.5])


SAMPLES = [
    sample("plain", 40, 50, 1),
    sample("stained", 44, 36, 2, radius=9),
    sample("halved", 60, 70, 3, radius=16, dark=0.3),
]


def bilinear(layer, source):
    at = np.clip(source[:, ::-1].astype(np.float64), 0, np.array(layer.shape[:2]) - 1).T
    return map_coordinates(layer.astype(np.float64), at, order=1, mode="nearest")


def test_all_samples_compare_in_all_channels(palette):
    sheet = palette.sheet
    assert sheet.colour is sheet.cut and sheet.cut.shape == (40 + 44 + 30, 50, 5)
    assert sheet.frames.tolist() == [[0, 40, 50, 5], [40, 44, 36, 5], [84, 30, 35, 5]]
    random = np.random.default_rng(0)
    for _ in range(40):
        a, b = (int(each) for each in random.integers(0, 2, 2))
        at, to = random.random((2, 2)) * 45 - 3
        one, two = (
            np.array([bilinear(SAMPLES[which].channels[..., k], place[None])[0] for k in range(5)])
            for which, place in ((a, at), (b, to))
        )
        found = distance(sheet.cut, sheet.colour, sheet.frames, a, *at, b, *to)
        assert found == pytest.approx(np.linalg.norm(one - two), abs=1e-5)


def test_channels_are_the_samples_own_without_any_offset(palette):
    for index in (0, 1):
        assert np.array_equal(palette.grids[index].cut, SAMPLES[index].channels)
    assert palette.grids[2].shrink == 0.5 and palette.grids[2].unit == 1.0
    assert palette_of(SAMPLES[:1], [3.0]).grids[0].unit == 3.0


def test_features_lie_on_their_grids(palette):
    assert not palette.feature_of(0).any()
    assert np.array_equal(palette.feature_of(1), SAMPLES[1].mask)
    assert palette.feature_of(2).shape == (30, 35)
    assert (palette.feature_of(2) > 0.5).sum() == pytest.approx(np.pi * 8**2, rel=0.1)
    assert palette.half_width(0) == 0
    assert palette.half_width(1) == half_width(SAMPLES[1].mask > 0.5)
    assert palette.half_width(2) == pytest.approx(8, abs=1)
    labels, parts = palette.components(1)
    assert len(parts) == 1 and (labels >= 0).sum() == parts[0].area


def test_a_line_that_reduction_swallows_is_thickened_again():
    thin = sample("thin", 96, 120, 4)
    mask = np.zeros((96, 120), np.float32)
    mask[47:50, 20:100] = 1
    thin = Sample(thin.name, thin.colour, thin.channels, mask=mask)
    assert (palette_of([thin], [1.0]).feature > 0.5).sum() == 240
    small = palette_of([thin], [0.2])
    assert small.half_width(0) >= 3
    row, column = np.nonzero(small.feature > 0.5)
    assert row.mean() == pytest.approx(9.2, abs=0.5) and column.mean() == pytest.approx(11.5, abs=1)


def test_feature_and_values_are_bilinear_and_clamped(palette):
    random = np.random.default_rng(5)
    owner = random.integers(0, 3, 300).astype(np.uint16)
    source = (random.random((300, 2)) * 60 - 5).astype(np.float32)
    source[:40] = np.round(source[:40])
    found = feature_at(palette.feature, palette.sheet.frames, owner, source)
    values = palette.values_at(palette.sheet.cut, owner, source)
    assert found.dtype == np.float32 and values.shape == (300, 5)
    assert np.array_equal(found, palette.feature_at(owner, source))
    for index in range(3):
        mine = owner == index
        twin = bilinear(palette.feature_of(index), source[mine])
        assert np.allclose(found[mine], twin, atol=1e-6)
        for k in range(5):
            twin = bilinear(palette.grids[index].cut[..., k], source[mine])
            assert np.allclose(values[mine, k], twin, atol=1e-5)
    assert values_at(palette.sheet.cut, palette.sheet.frames, owner[:0], source[:0]).shape == (0, 5)


@pytest.mark.parametrize("index", [0, 1, 2])
def test_the_match_space_is_the_samples_principal_one(palette, index):
    space = palette.match(index)
    grid = palette.grids[index]
    assert space.grid is grid and space.values.shape == (114, 50, grid.match.shape[2])
    top, height, width = palette.sheet.frames[index, :3]
    own = space.values[top : top + height, :width]
    assert np.array_equal(own, grid.match)
    assert np.abs(own.mean(axis=(0, 1))).max() < 1e-5
    flat = grid.cut.reshape(-1, 5).astype(np.float64)
    variance, vectors = np.linalg.eigh(np.cov(flat.T))
    kept = own.shape[2]
    assert kept <= 4
    assert np.var(own.reshape(-1, kept), axis=0) == pytest.approx(variance[::-1][:kept], rel=1e-2)
    # another sample's texels go through the same projection
    other = (index + 1) % 3
    top, height, width = palette.sheet.frames[other, :3]
    moved = (palette.grids[other].cut.reshape(-1, 5) - flat.mean(axis=0)) @ vectors[:, ::-1]
    theirs = space.values[top : top + height, :width].reshape(-1, kept)
    assert np.allclose(np.abs(theirs), np.abs(moved[:, :kept]), atol=1e-4)
    assert palette.match(index) is space


def test_matching_finds_a_piece_where_it_was_cut(palette):
    matcher = Matcher(palette.match(1).grid)
    image = np.moveaxis(palette.grids[1].match[10:27, 8:25], 2, 0)
    found = matcher.match(image, np.ones((17, 17), np.float32), most=1, overlap=0.9, margin=4)
    assert (found[0].column, found[0].row) == (16, 18) and found[0].cost < 1e-3


def test_the_normaliser_is_twice_the_mean_distance_of_feature_to_background(palette):
    for index in (1, 2):
        values, mask = palette.grids[index].cut.astype(np.float64), palette.feature_of(index)
        feature, ground = values[mask > 0.5], values[mask < 0.05]
        exact = np.linalg.norm(feature[:, None] - ground[None], axis=2).mean()
        assert palette.normaliser(index) == pytest.approx(2 * exact, rel=0.02)
    assert palette.normaliser(1) > palette.normaliser(2)
    assert palette.normaliser(1) == palette_of(SAMPLES, [1.0, 1.0, 0.5]).normaliser(1)
    with pytest.raises(InvalidImage, match="'plain': 0.00 % of it is feature"):
        palette.normaliser(0)


def test_a_feature_that_is_its_background_is_refused():
    flat = np.full((20, 20, 3), 0.5, np.float32)
    mask = np.zeros((20, 20), np.float32)
    mask[5:9, 5:9] = 1
    with pytest.raises(InvalidImage, match="cannot be told"):
        palette_of([Sample("flat", flat, flat.copy(), mask=mask)], [1.0]).normaliser(0)


@pytest.mark.parametrize("angle", [0.0, 0.6, -0.9, np.pi / 2])
def test_the_axis_is_the_direction_that_lines_run_in(angle):
    height, width = 90, 110
    row, column = np.mgrid[:height, :width]
    x, y = column - 55, 45 - row
    mask = np.zeros((height, width), np.float32)
    for offset in (-15, 15):  # two of them, side by side
        across = -x * np.sin(angle) + y * np.cos(angle) - offset
        along = x * np.cos(angle) + y * np.sin(angle)
        mask[(np.abs(across) < 2.5) & (np.abs(along) < 25)] = 1
    plain = sample("lines", height, width, 3)
    found = palette_of([Sample("lines", plain.colour, plain.channels, mask=mask)], [1.0]).axis(0)
    assert abs(np.exp(2j * found) - np.exp(2j * angle)) < 0.1
    assert palette_of([plain], [1.0]).axis(0) == 0


def test_the_background_bars_what_the_features_cover(palette):
    sheet = palette.background
    assert sheet.cut is palette.sheet.cut and len(palette.sheet.barred) == 0
    assert np.array_equal(sheet.barred, palette.feature > 0.05)
    assert palette.background is sheet


def test_what_does_not_fit_together_is_refused():
    few = sample("few", 20, 20, 1, channels=3)
    with pytest.raises(InvalidParameter, match="5 and 3 channels"):
        palette_of([SAMPLES[0], few], [1.0, 1.0])
    with pytest.raises(InvalidParameter, match="1 samples and 2 scales"):
        palette_of([few], [1.0, 1.0])
    with pytest.raises(InvalidParameter, match="0 samples"):
        palette_of([], [])
    with pytest.raises(InvalidImage, match="at least 2 x 2"):
        palette_of([few], [0.05])
    wrong = Sample("wrong", few.colour, few.channels, mask=np.zeros((5, 7), np.float32))
    with pytest.raises(InvalidImage, match=r"'wrong': a mask of 7 x 5 texels for 20 x 20"):
        palette_of([wrong], [1.0])


def test_a_surface_is_synthesised_from_the_background_of_a_palette():
    dense = sphere(4)
    field = constant_field(dense, (0, 0, 1.0))
    net = connect(dense, field)
    parts = [SAMPLES[1], SAMPLES[2]]
    palette = palette_of(parts, [1.0, 1.0])
    parameters = QuiltParameters()
    region = (dense.vertices[:, 1] > 0.1).astype(np.int32)
    layout = lay_out(net, region, [0, 1], Borders.all(False), parameters.border)
    run = Synthesizer(dense, field, parts, parameters, layout=layout)
    run.sheet = palette.background
    run._finder = CandidateFinder(run.net, run.sheet, run.state, run._flattener, parameters)
    quilt = run.run()
    assert (quilt.patch >= 0).all() and set(quilt.sample.tolist()) == {0, 1}
    assert palette.feature_at(quilt.sample, quilt.source).max() <= 0.05 + 1e-6
