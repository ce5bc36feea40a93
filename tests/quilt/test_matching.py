"""Patch matching against its definition."""

import numpy as np
import pytest

from btfcore.errors import InvalidImage
from btfcore.quilt.grid import sample_grid
from btfcore.quilt.literal import RotatedMatcher
from btfcore.quilt.matching import Matcher, local_minima
from btfcore.types import Sample
from tests.surfaces import blobs


def brute(match, image, mask, row, column):
    """Mean SSD with the work image's middle pixel on sample texel (row, column)."""
    half = mask.shape[0] // 2
    total = count = 0.0
    for y, x in zip(*np.nonzero(mask), strict=True):
        r, c = row + y - half, column + x - half
        if 0 <= r < match.shape[0] and 0 <= c < match.shape[1]:
            total += ((image[:, y, x] - match[r, c]) ** 2).sum()
            count += 1
    return total / max(count, 1), count


@pytest.mark.parametrize("shape", [(40, 40), (23, 51), (12, 9)])
def test_costs_are_the_mean_ssd(shape):
    random = np.random.default_rng(3)
    grid = sample_grid(blobs(*shape))
    mask = (random.random((25, 25)) < 0.4).astype(np.float32)
    image = random.standard_normal((grid.match.shape[2], 25, 25)).astype(np.float32) * mask
    costs, count = Matcher(grid).costs(image, mask)
    for _ in range(40):
        row, column = random.integers(shape[0]), random.integers(shape[1])
        cost, overlap = brute(grid.match, image, mask, row, column)
        assert count[row, column] == pytest.approx(overlap, abs=1e-6)
        assert costs[row, column] == pytest.approx(cost, rel=1e-3, abs=1e-4)


def test_a_piece_of_the_sample_is_found_where_it_was_cut():
    grid = sample_grid(blobs(64, 80))
    mask = np.zeros((33, 33), np.float32)
    mask[4:, 4:20] = 1
    piece = np.moveaxis(grid.match[30 - 16 : 30 + 17, 41 - 16 : 41 + 17], -1, 0) * mask
    best = Matcher(grid).match(piece, mask, most=3, overlap=0.8, margin=16)
    assert (best[0].row, best[0].column) == (30, 41)
    assert best[0].cost < 1e-5
    assert [p.cost for p in best] == sorted(p.cost for p in best)


def test_margins_are_relaxed_until_something_fits():
    grid = sample_grid(blobs(12, 12))
    mask = np.ones((41, 41), np.float32)
    found = Matcher(grid).match(
        np.zeros((3, 41, 41), np.float32), mask, most=2, overlap=0.9, margin=24
    )
    assert found


def test_rotated_copies_find_a_turned_piece():
    sample = blobs(96, 96, seed=4)
    grid = sample_grid(sample)
    matcher = RotatedMatcher(grid)
    copy, valid = matcher.copy(6)  # 30 degrees
    middle = copy.shape[1] // 2
    piece = copy[:, middle - 16 : middle + 17, middle - 12 : middle + 21].copy()
    found = matcher.match(
        piece, np.ones((33, 33), np.float32), turn=np.radians(30), overlap=0.8, margin=16
    )
    assert found[0].cost < 1e-5
    assert found[0].turn == pytest.approx(np.radians(30))
    offset = 4.0 + (0.5 if copy.shape[1] % 2 == 0 else 0.0)
    shift = (offset - 1j * (0.5 if copy.shape[1] % 2 == 0 else 0.0)) * np.exp(1j * np.radians(30))
    assert found[0].column == pytest.approx(47.5 + shift.real, abs=1e-6)
    assert found[0].row == pytest.approx(47.5 - shift.imag, abs=1e-6)


def test_local_minima_against_a_twin():
    random = np.random.default_rng(0)
    costs = random.random((30, 30)).round(1)  # many ties
    allowed = random.random((30, 30)) < 0.9
    found = local_minima(costs, allowed, 900)
    values = [costs[r, c] for r, c in found]
    assert values == sorted(values)
    for row, column in found:
        near = [
            costs[r, c]
            for r in range(max(row - 1, 0), min(row + 2, 30))
            for c in range(max(column - 1, 0), min(column + 2, 30))
            if allowed[r, c]
        ]
        assert costs[row, column] == min(near)
    assert tuple(found[0]) in {tuple(p) for p in np.argwhere(costs == costs[allowed].min())}


def test_grey_pictures_cost_one_channel_and_change_nothing():
    colour = blobs(32, 32).colour[..., :1]
    grey = Sample("grey", np.repeat(colour, 3, axis=2), np.repeat(colour, 3, axis=2))
    grid = sample_grid(grey)
    assert grid.cut.shape[2] == 1 and grid.match.shape[2] == 1
    wide = grey.channels.astype(np.float64)
    expected = np.sqrt(((wide[3, 4] - wide[20, 7]) ** 2).sum())
    assert abs(grid.cut[3, 4, 0] - grid.cut[20, 7, 0]) == pytest.approx(expected, rel=1e-5)


def test_few_principal_channels_keep_the_distances():
    random = np.random.default_rng(2)
    base = blobs(40, 40).channels
    mixed = base @ random.standard_normal((3, 12)).astype(np.float32)
    grid = sample_grid(Sample("mixed", base, mixed.astype(np.float32)), match_channels=4)
    assert grid.cut.shape[2] == 12 and grid.match.shape[2] <= 3
    a, b = grid.match.reshape(1600, -1), grid.cut.reshape(1600, -1)
    pairs = random.integers(0, 1600, (2, 500))
    few = np.linalg.norm(a[pairs[0]] - a[pairs[1]], axis=1)
    all_of_them = np.linalg.norm(b[pairs[0]] - b[pairs[1]], axis=1)
    assert np.abs(few - all_of_them).mean() < 0.05 * all_of_them.mean()


def test_a_sample_too_small_to_quilt_is_named():
    dot = np.zeros((1, 1, 3), np.float32)
    with pytest.raises(InvalidImage, match="1 x 1"):
        sample_grid(Sample("dot", dot, dot))
    with pytest.raises(InvalidImage, match="scale 0.05"):
        sample_grid(blobs(20, 20), scale=0.05)


def test_large_samples_are_matched_on_means_and_refined_exactly():
    grid = sample_grid(blobs(400, 400, seed=9))
    matcher = Matcher(grid)
    assert matcher.factor == 2
    mask = np.zeros((81, 81), np.float32)
    mask[3:70, 5:44] = 1
    piece = np.moveaxis(grid.match[151 - 40 : 151 + 41, 238 - 40 : 238 + 41], -1, 0) * mask
    best = matcher.match(piece.astype(np.float32), mask, most=3, overlap=0.8, margin=24)
    assert (best[0].row, best[0].column) == (151, 238)
    assert best[0].cost < 1e-6
    cost, _ = brute(grid.match, piece, mask, int(best[1].row), int(best[1].column))
    assert best[1].cost == pytest.approx(cost, rel=1e-3)
