"""Laws of the tools that draw a mask."""

import numpy as np
import pytest

from btfcore.btf.mask_history import MaskHistory, across, difference
from btfcore.btf.mask_kernels import spread_flood
from btfcore.btf.mask_select import cielab, flood, similar
from btfcore.btf.mask_tools import (
    brush,
    feathered,
    grown,
    inverted,
    lasso,
    polygon_coverage,
    reach,
    report,
)
from btfcore.errors import InvalidParameter

SHAPE = (60, 80)
ROW, COLUMN = np.mgrid[:60, :80].astype(np.float64)
EMPTY = np.zeros(SHAPE, np.float32)
PATH = np.array([[20.3, 15.0], [50.0, 22.6], [47.2, 44.0]])


def noise(seed=0):
    return np.random.default_rng(seed).uniform(size=SHAPE).astype(np.float32)


def plain_stroke(path, radius, hardness, periods=((0, 0),)):
    """Coverage of a stroke by formula: distances of all texels to all segments."""
    out = np.zeros(SHAPE)
    for i, j in periods:
        here = np.stack([COLUMN + j * SHAPE[1], ROW + i * SHAPE[0]], axis=-1)
        for a, b in zip(path, path[1:] if len(path) > 1 else path, strict=False):
            step = b[:2] - a[:2]
            t = np.clip(((here - a[:2]) @ step) / max(step @ step, 1e-300), 0, 1)
            r = np.maximum((a[2] + t * (b[2] - a[2])) * radius, 0.5)
            ramp = np.maximum(2 * r * (1 - hardness), 1)
            away = np.linalg.norm(here - a[:2] - t[..., None] * step, axis=-1)
            out = np.maximum(out, np.clip(0.5 + (r - away) / ramp, 0, 1))
    return out


@pytest.mark.parametrize("hardness", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("pressure", [(1, 1, 1), (0.2, 1.0, 0.5)])
def test_a_stroke_is_the_distance_to_its_path(hardness, pressure):
    path = np.column_stack([PATH, pressure])
    found = brush(EMPTY, path, radius=6.5, hardness=hardness)
    assert np.allclose(found, plain_stroke(path, 6.5, hardness), atol=1e-6)
    nine = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    path[:, 0] += 22
    found = brush(EMPTY, path, radius=6.5, hardness=hardness, tiles=True)
    assert np.allclose(found, plain_stroke(path, 6.5, hardness, nine), atol=1e-6)


@pytest.mark.parametrize("hardness", [0.0, 0.5, 1.0])
def test_the_contour_is_the_radius_and_nothing_changes_beyond_reach(hardness):
    before = noise()
    after = brush(before, [[40.0, 30.0]], radius=9, hardness=hardness)
    away = np.hypot(COLUMN - 40, ROW - 30)
    dab = brush(EMPTY, [[40.0, 30.0]], radius=9, hardness=hardness)
    assert np.array_equal(dab > 0.5, away < 9)
    beyond = away >= reach(9, hardness)
    assert np.array_equal(after[beyond], before[beyond])
    assert (after >= before).all() and (after[away < 9] > 0.5).all()


def test_a_stroke_in_pieces_twice_or_backwards_is_the_stroke():
    knobs = {"radius": 5, "hardness": 0.3}
    before = noise()
    whole = brush(before, PATH, **knobs)
    pieces = brush(brush(before, PATH[:2], **knobs), PATH[1:], **knobs)
    assert np.array_equal(whole, pieces)
    assert np.array_equal(whole, brush(whole, PATH, **knobs))
    assert np.allclose(whole, brush(before, PATH[::-1], **knobs), atol=1e-6)


def test_removing_is_adding_to_the_background():
    before = noise()
    removed = brush(before, PATH, radius=4, remove=True)
    assert np.allclose(removed, 1 - brush(1 - before, PATH, radius=4), atol=1e-6)
    assert (removed <= before).all()
    cut = lasso(before, PATH, remove=True)
    assert np.allclose(cut, 1 - lasso(1 - before, PATH), atol=1e-6)


def test_a_tile_has_no_border():
    for tool in (
        lambda mask, at: brush(mask, PATH + at, radius=6, tiles=True),
        lambda mask, at: lasso(mask, PATH + at, tiles=True),
        lambda mask, at: grown(mask, 5, tiles=True),
        lambda mask, at: feathered(mask, 3, tiles=True),
    ):
        start = brush(EMPTY, [[5.0, 55.0], [30, 40]], radius=4, tiles=True)
        for shift in ((37, 0), (-41, 25)):
            moved = np.roll(start, (shift[1], shift[0]), (0, 1))
            wanted = np.roll(tool(start, np.zeros(2)), (shift[1], shift[0]), (0, 1))
            assert np.allclose(tool(moved, np.array(shift)), wanted, atol=1e-5)


def clipped_area(points, column, row):
    """Signed area of a polygon within one texel: clipped by its sides, then the shoelace."""
    for axis, limit, sign in ((0, column, 1), (0, column + 1, -1), (1, row, 1), (1, row + 1, -1)):
        kept = []
        for a, b in zip(np.roll(points, 1, axis=0), points, strict=True):
            da, db = sign * (a[axis] - limit), sign * (b[axis] - limit)
            if (da >= 0) != (db >= 0):
                kept.append(a + da / (da - db) * (b - a))
            if db >= 0:
                kept.append(b)
        if len(kept) < 3:
            return 0.0
        points = np.array(kept)
    x, y = points.T
    return 0.5 * float((np.roll(x, 1) * y - x * np.roll(y, 1)).sum())


@pytest.mark.parametrize("seed", range(6))
def test_a_lasso_covers_exactly(seed):
    # a star with points beyond the border, on texel borders and within one texel
    random = np.random.default_rng(seed)
    angle = np.sort(random.uniform(0, 2 * np.pi, 14))
    radius = random.uniform(2, 14, 14)
    points = np.stack([4 + radius * np.cos(angle), 9 + radius * np.sin(angle)], axis=1)
    if seed % 2:
        points = np.round(points * 2) / 2
    found = polygon_coverage(points, (20, 16))
    wanted = [[abs(clipped_area(points + 0.5, j, i)) for j in range(16)] for i in range(20)]
    assert np.allclose(found, np.minimum(wanted, 1), atol=1e-6)
    assert np.allclose(found, polygon_coverage(points[::-1], (20, 16)), atol=1e-6)


def test_both_lobes_of_an_eight_and_nothing_outside():
    eight = np.array([[10, 10], [40, 40], [40, 10], [10, 40]], float)
    found = lasso(EMPTY, eight)
    assert found[25, 15] == 1 and found[25, 35] == 1
    assert found[13, 25] == 0 and found[37, 25] == 0
    assert found[:, 42:].max() == 0 and found[42:].max() == 0
    assert lasso(EMPTY, [[-50, -50], [200, -50], [200, 200], [-50, 200]]).min() == 1
    assert lasso(EMPTY, [[-50, 10], [-5, 20], [-9, 40]]).max() == 0


def test_growing_moves_the_contour_by_texels_and_only_adds():
    disk = brush(EMPTY, [[40.0, 30.0]], radius=8, hardness=1)
    away = np.hypot(COLUMN - 40, ROW - 30)
    for texels in (1, 3, 7.5):
        found = grown(disk, texels)
        assert ((found > 0.5) | (away > 8 + texels - 1)).all()
        assert ((found <= 0.5) | (away < 8 + texels + 1)).all()
        assert (found >= disk).all()
        back = grown(found, -texels)
        assert np.mean((back > 0.5) != (disk > 0.5)) < 0.005
    soft = noise() * 0.5
    assert np.array_equal(grown(soft, 5), soft)
    assert np.array_equal(grown(EMPTY, 5), EMPTY)
    assert np.array_equal(grown(disk, 0), disk)
    full = np.ones(SHAPE, np.float32)
    assert np.array_equal(grown(full, -5), full), "the sample's border is no edge"


def test_feathering_keeps_straight_edges_and_the_mean_of_a_tile():
    edge = (COLUMN < 40).astype(np.float32)
    soft = feathered(edge, 4)
    assert np.array_equal(soft > 0.5, edge > 0.5) and 0.4 < soft[30, 40] < 0.5
    assert (np.diff(soft, axis=1) <= 1e-6).all()
    mask = noise()
    assert feathered(mask, 5, tiles=True).mean() == pytest.approx(mask.mean(), abs=1e-5)
    assert np.array_equal(inverted(inverted(edge)), edge)


def test_cielab_is_that_of_the_standard():
    # CIE values of sRGB's corners (Lindbloom's calculator)
    colours = np.array([[[1, 1, 1], [0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]], np.float32)
    wanted = [
        [100, 0, 0], [0, 0, 0], [53.2408, 80.0925, 67.2032], [87.7347, -86.1827, 83.1793],
        [32.2970, 79.1875, -107.8602],
    ]  # fmt: skip
    assert np.allclose(cielab(colours)[0], wanted, atol=0.02)
    tall = np.random.default_rng(1).uniform(size=(600, 3, 3)).astype(np.float32)
    assert np.array_equal(cielab(tall)[300:310], cielab(tall[300:310]))


def test_evening_takes_slow_light_away_and_keeps_the_mean_and_the_feature():
    colour = np.repeat(0.5 + (noise(3)[..., None] - 0.5) * 0.02, 3, axis=2)
    light = 0.4 * (COLUMN / 79 - 0.5)[..., None]
    line = np.abs(ROW - 30) < 1.5
    scratched = (colour + light - 0.1 * line[..., None]).astype(np.float32)
    plain, even = cielab(scratched), cielab(scratched, evening=12)
    assert np.allclose(even.mean((0, 1)), plain.mean((0, 1)), atol=1e-3)
    # between the ends the light changes by more than the scratch is deep
    taken = flood(plain, (60, 30), tolerance=6, contiguous=False)
    assert taken[line].mean() < 0.6 and taken[~line].mean() > 0.2
    taken = flood(even, (60, 30), tolerance=6, contiguous=False)
    assert taken[line].mean() > 0.95 and taken[~line].mean() < 0.02
    flat = np.full((30, 40, 3), 0.4, np.float32)
    assert np.allclose(cielab(flat, evening=9), cielab(flat), atol=1e-4)
    assert np.array_equal(cielab(scratched, evening=0), plain)
    knobs = {"evening": 7, "smoothing": 2, "tiles": True}
    rolled = cielab(np.roll(colour, 31, 1), **knobs)
    assert np.allclose(rolled, np.roll(cielab(colour, **knobs), 31, 1), atol=1e-3)


def two_colours():
    """Picture of a dark ring, a dark spot elsewhere and one across the border, on grey."""
    away = np.hypot(COLUMN - 30, ROW - 30)
    dark = (np.abs(away - 12) < 3) | (np.hypot(COLUMN - 65, ROW - 50) < 4)
    dark |= np.minimum(COLUMN, 79 - COLUMN) + np.abs(ROW - 8) < 6
    grey = np.where(dark, 0.2, 0.6)[..., None] + np.array([0, 0.01, 0.02])
    return np.clip(grey + (noise(3)[..., None] - 0.5) * 0.02, 0, 1).astype(np.float32), dark


def test_a_flood_takes_what_hangs_together_or_all():
    colour, dark = two_colours()
    lab = cielab(colour)
    every = flood(lab, (18, 30), tolerance=12, contiguous=False)
    assert np.array_equal(every > 0, dark)
    one = flood(lab, (18, 30), tolerance=12)
    assert np.array_equal(one > 0, dark & (np.hypot(COLUMN - 30, ROW - 30) < 20))
    left = flood(lab, (1, 8), tolerance=12)
    over = flood(lab, (1, 8), tolerance=12, tiles=True)
    assert left[8, 78] == 0 and over[8, 78] == 1 and (over >= left).all()
    exact = flood(lab, (18, 30), tolerance=0)
    assert exact[30, 18] == 1 and exact.sum() < 4


def test_a_flood_grows_with_its_tolerance_and_a_connected_one_is_its_own():
    lab = cielab(noise(5)[..., None].repeat(3, axis=2), smoothing=1.5)
    before = np.zeros(SHAPE, np.float32)
    for tolerance in (0, 2, 5, 9, 150):
        found = flood(lab, (40, 30), tolerance=tolerance)
        assert (found >= before).all()
        before = found
    assert before.min() == 1


@pytest.mark.parametrize("tiles", [False, True])
def test_the_kernel_floods_as_labels_do(tiles):
    from scipy.ndimage import label

    for seed in range(5):
        open_ = noise(seed) < 0.42
        row, column = np.argwhere(open_)[100 + seed]
        again = np.tile(open_, (3, 3)) if tiles else open_
        found, _ = label(again, np.ones((3, 3)))
        wanted = np.zeros(SHAPE, bool)
        seeds = {int(found[row, column])}
        while tiles:  # what reaches another copy of a texel reaches it everywhere
            folded = np.isin(found, list(seeds)).reshape(3, 60, 3, 80).any(axis=(0, 2))
            more = set(np.unique(found[np.tile(folded, (3, 3))]).tolist())
            if more == seeds:
                break
            seeds = more
        wanted = np.isin(found, list(seeds))
        wanted = wanted.reshape(3, 60, 3, 80).any(axis=(0, 2)) if tiles else wanted
        assert np.array_equal(spread_flood(open_, row, column, tiles), wanted)
    assert not spread_flood(np.zeros((4, 4), bool), 1, 1, tiles).any()


def test_similar_finds_the_other_places_and_forgives_a_slip():
    colour, dark = two_colours()
    lab = cielab(colour)
    spot = brush(EMPTY, [[65.0, 50.0]], radius=3.4, hardness=1)
    found = similar(lab, spot, tolerance=3)
    assert np.array_equal(found > 0, dark)
    spot[10, 40] = 1  # a slip onto the grey: it stays marked and attracts nothing
    found = similar(lab, np.maximum(spot, brush(EMPTY, [[30.0, 18.0]], radius=2.5)), tolerance=3)
    assert found[10, 40] == 1 and found.sum() == dark.sum() + 1
    assert similar(lab, EMPTY).max() == 0


def test_steps_lead_back_and_forth_to_the_bit():
    random = np.random.default_rng(7)
    history, masks = MaskHistory(), [noise()]
    for k in range(8):
        at = random.uniform(0, 60, (2, 2))
        masks.append(brush(masks[-1], at, radius=4, remove=bool(k % 2)))
        step = difference(f"stroke {k}", masks[-2], masks[-1])
        assert np.array_equal(across(masks[-2], step), masks[-1])
        history.add(step)
    assert difference("none", masks[0], masks[0].copy()) is None
    now = masks[-1]
    for wanted in masks[-2::-1]:
        now, _ = history.undo(now)
        assert np.array_equal(now, wanted)
    assert history.undo(now) is None and history.undo_label is None
    for wanted in masks[1:]:
        now, (left, top, right, bottom) = history.redo(now)
        assert np.array_equal(now, wanted) and left < right and top < bottom
    assert history.redo(now) is None and history.undo_label == "stroke 7"


def test_a_history_is_bounded_and_a_new_step_ends_redo():
    history, mask = MaskHistory(most_bytes=40_000), EMPTY
    for k in range(12):
        after = noise(k)
        history.add(difference(str(k), mask, after))
        mask = after
    assert 0 < history.size <= 40_000
    mask, _ = history.undo(mask)
    assert history.redo_label == "11"
    history.add(difference("new", mask, inverted(mask)))
    assert history.redo_label is None and history.undo_label == "new"


def test_the_report_says_what_painting_makes_of_it():
    assert not report(EMPTY).usable and "empty" in report(EMPTY).notes[0]
    full = report(np.ones(SHAPE, np.float32))
    assert not full.usable and full.share == 1 and "full" in full.notes[0]
    thin = report(brush(EMPTY, [[10.0, 30.0], [70.0, 30.0]], radius=1, hardness=1))
    assert thin.usable and thin.half_width <= 2 and "thickened" in thin.notes[0]
    large = report(np.pad(EMPTY, ((0, 2000), (0, 2200)), constant_values=1.0))
    assert large.usable and np.isnan(large.half_width) and large.share > 0.9
    wide = report(brush(EMPTY, [[40.0, 30.0]], radius=12, hardness=1))
    assert wide.usable and wide.notes == () and wide.half_width == pytest.approx(12, abs=1)
    assert wide.share == pytest.approx((np.hypot(COLUMN - 40, ROW - 30) < 12).mean())


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: brush(EMPTY, [[1.0, 2.0]], radius=0), "radius 0"),
        (lambda: brush(EMPTY, [[1.0, 2.0]], hardness=1.5), "hardness 1.5"),
        (lambda: brush(EMPTY, [[1.0, np.nan]]), "point 0"),
        (lambda: brush(EMPTY, [[1e9, 0.0]], tiles=True), "far outside"),
        (lambda: brush(EMPTY, [[1.0, 1.0, 2.0]]), "pressures"),
        (lambda: brush(EMPTY, np.zeros((0, 2))), "(0, 2)"),
        (lambda: lasso(EMPTY, [[0, 0], [1, 1]]), "(2, 2)"),
        (lambda: lasso(EMPTY, [[0, 0], [1, 1], [1e12, 1]]), "far outside"),
        (lambda: grown(EMPTY, 999), "growth 999"),
        (lambda: feathered(EMPTY, np.nan), "feathering nan"),
        (lambda: cielab(EMPTY), "(60, 80)"),
        (lambda: cielab(np.zeros((2, 2, 3), np.float32), smoothing=-1), "smoothing -1"),
        (lambda: cielab(np.zeros((2, 2, 3), np.float32), evening=999), "evening 999"),
        (lambda: flood(np.zeros((4, 5, 3), np.float32), (5, 0)), "(5, 0)"),
        (lambda: flood(np.zeros((4, 5, 3), np.float32), (0, 0), tolerance=-1), "tolerance -1"),
        (lambda: similar(np.zeros((4, 5, 3), np.float32), EMPTY), "(60, 80)"),
    ],
)
def test_what_makes_no_sense_is_refused_with_the_number(call, said):
    with pytest.raises(InvalidParameter) as error:
        call()
    assert said in str(error.value)
