"""Joint matching over texture and constraint: planted places are found again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from btfcore.paint.matching import CONSTRAINT, JointMatcher, joint_cost, look_closely
from btfcore.paint.palette import palette_of
from btfcore.paint.search import CoarseSearch, splat, window_sums
from btfcore.patch.flatten import Flattener
from btfcore.quilt.lay import Lay, lay_along_field
from btfcore.quilt.register import warped
from btfcore.quilt.state import QuiltState
from btfcore.types import Sample
from tests.paint.grounds import flat
from tests.paint.scenes import blots

TURNS = tuple(2 * np.pi * np.arange(24) / 24)
MIDDLE = 40 * 101 + 50


def picture(side: int, seed: int = 0, *, mask: np.ndarray | None = None) -> Sample:
    """Smooth random colours, and a feature that shows in the mask alone."""
    from scipy.ndimage import gaussian_filter

    noise = np.random.default_rng(seed).standard_normal((side, side, 3))
    colour = np.stack([gaussian_filter(noise[..., k], 2.5) for k in range(3)], axis=-1)
    colour = ((colour - colour.min()) / np.ptp(colour)).astype(np.float32)
    return Sample(f"picture {seed}", colour, colour.copy(), mask=mask)


def comma(side: int) -> np.ndarray:
    """Mask of two unequal discs, so that no turn or shift of it is like another."""
    where = side / 96
    mask = blots((30, 34, 12), (52, 44, 6), (70, 74, 4))
    if side == 96:
        return mask
    from scipy.ndimage import map_coordinates

    row, column = np.mgrid[:side, :side] / where
    return map_coordinates(mask, [row, column], order=1, mode="nearest").astype(np.float32)


@dataclass(eq=False)
class Planted:
    """A patch on a plane that shows a piece of a sample, turned."""

    lay: Lay
    state: QuiltState
    place: np.ndarray  # (n, 2) of the patch's vertices in the sample
    inside: np.ndarray

    def find(self, matcher, target, known, *, turns=(0.0,), most=3):
        return matcher.find(self.lay, self.state, known, target, turns=turns, most=most)


def planted(column, row, *, turn=0.0, radius=10, side=(96, 96), sample=0) -> Planted:
    """Patch that shows what lies around (column, row) of a sample of side (width, height)."""
    ground = flat()
    flattener = Flattener(ground.dense, ground.field, ground.net)
    patch = flattener.flatten(MIDDLE, radius)
    lay = lay_along_field(ground.net, flattener.local, patch, bend=0.0)
    place, _ = warped(lay.points(1.0), np.array([column, row, turn, 0, 0, 0, 0, 0.0]), 1.0)
    place = place.astype(np.float32)
    state = QuiltState.bare(ground.net)
    state.source[patch.order], state.patch[patch.order] = place, 0
    state.sample[patch.order] = sample
    inside = ((place >= 0) & (place <= np.array(side) - 1)).all(axis=1)
    return Planted(lay, state, place, inside)


def near(found, column, row, turn=0.0, *, texels=1.5):
    apart = abs((found.turn - turn + np.pi) % (2 * np.pi) - np.pi)
    off = np.hypot(found.column - column, found.row - row)
    return off <= texels and apart < np.radians(1)


def matcher_of(*samples, index=0):
    palette = palette_of(samples, [1.0] * len(samples))
    return JointMatcher(palette, index), palette


@pytest.mark.parametrize("seed", range(4))
def test_costs_against_a_twin(seed):
    random = np.random.default_rng(seed)
    match = random.random((9, 13, 3)).astype(np.float32)
    feature = random.random((9, 13)).astype(np.float32)
    points = random.normal(0, 4, 40) + 1j * random.normal(0, 4, 40)
    values = random.random((40, 3)).astype(np.float32)
    known, target = random.random(40) < 0.6, random.random(40)

    def twin(column, row):
        x = np.floor(column + points.real + 0.5).astype(int)
        y = np.floor(row - points.imag + 0.5).astype(int)
        inside = (x >= 0) & (y >= 0) & (x < 13) & (y < 9)
        if not inside.any():
            return np.inf
        x, y = x[inside], y[inside]
        constraint = 4.0 * ((target[inside] - feature[y, x]) ** 2).sum()
        ssd = ((values[inside] - match[y, x]) ** 2).sum(axis=1)[known[inside]].sum() / 0.7
        return (constraint + ssd) / inside.sum()

    given = (match, feature, points, values, known, target)
    for column, row in (random.random((12, 2)) * [18, 14] - 3).tolist():
        assert joint_cost(*given, column, row, 0.7, 4.0) == pytest.approx(twin(column, row))
    assert joint_cost(*given, 500.0, 5.0, 0.7, 4.0) == np.inf
    column, row, cost = look_closely(*given, 6.0, 4.0, 4, 0.7, 4.0)
    assert cost == pytest.approx(twin(column, row)) and cost <= twin(6.0, 4.0)
    around = [twin(column + x, row + y) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    assert cost <= min(around) + 1e-12  # a local minimum of single steps


@pytest.mark.parametrize("reach", [1, 2, 4, 8])
def test_looking_closely_goes_no_further_than_its_steps_add_up_to(reach):
    """Even where it always gets cheaper to one side."""
    ramp = np.zeros((60, 60, 1), np.float32)
    feature = np.tile(np.linspace(0, 1, 60, dtype=np.float32), (60, 1))
    one = np.zeros(1, np.complex128)
    blank = np.zeros((1, 1), np.float32)
    column, row, _ = look_closely(
        ramp, feature, one, blank, np.zeros(1, bool), np.ones(1), 20.0, 30.0, reach, 1.0, 4.0
    )
    steps = [max(reach // 2, 1) >> k for k in range(8)]
    assert column - 20 == sum(steps) <= max(reach, 1) >= abs(row - 30)


@pytest.mark.parametrize("side", [60, 96, 160, 420])
@pytest.mark.parametrize("number", [0, 5, 18])
def test_a_planted_place_is_found(side, number):
    """Samples searched on every texel, every second and every fourth."""
    sample = picture(side, mask=comma(side))
    matcher, palette = matcher_of(sample)
    column, row = 0.4 * side + 0.3, 0.45 * side - 0.4
    its = planted(column, row, turn=TURNS[number], side=(side, side))
    target = palette.feature_at(its.state.sample[its.lay.patch.order], its.place)
    everywhere = np.ones(len(target), np.bool_)
    found = its.find(matcher, target.astype(np.float64), everywhere, turns=TURNS)
    assert near(found[0], column, row, TURNS[number])
    assert found[0].cost < 0.25 * found[1].cost
    assert [at.cost for at in found] == sorted(at.cost for at in found)


@pytest.mark.parametrize("number", [0, 7, 16])
def test_the_constraint_alone_decides(number):
    """Nothing known: only the feature's shape tells where the patch belongs."""
    matcher, palette = matcher_of(picture(96, mask=comma(96)))
    its = planted(38.0, 40.0, turn=TURNS[number], radius=16)
    target = palette.feature_at(its.state.sample[its.lay.patch.order], its.place)
    its.state.source[:] = 3.0  # what is there says nothing, and must not be asked
    found = its.find(
        matcher, target.astype(np.float64), np.zeros(len(target), np.bool_), turns=TURNS
    )
    assert near(found[0], 38, 40, TURNS[number])


@pytest.mark.parametrize("number", [0, 7, 16])
def test_the_texture_alone_decides(number):
    """A sample without feature, nothing wanted."""
    matcher, _ = matcher_of(picture(96))
    its = planted(50.0, 31.0, turn=TURNS[number])
    count = len(its.place)
    found = its.find(matcher, np.zeros(count), np.ones(count, np.bool_), turns=TURNS)
    assert near(found[0], 50, 31, TURNS[number])


def test_both_weigh_as_the_cost_says():
    """Texture of one place and constraint of another: whatever wins is cheapest by a twin."""
    sample = picture(96, mask=comma(96))
    matcher, palette = matcher_of(sample)
    its = planted(64.0, 30.0)
    wanted = planted(30.0, 34.0)
    count = len(its.place)
    target = palette.feature_at(np.zeros(count, np.uint16), wanted.place).astype(np.float64)
    known = np.arange(count) % 3 == 0
    found = its.find(matcher, target, known, most=1)
    scale = (palette.normaliser(0) / 2) ** 2
    match, points = palette.match(0), its.lay.points(1.0)
    given = (
        match.grid.match, np.ascontiguousarray(palette.feature_of(0)), points,
        matcher.values_of(its.state, its.lay.patch.order), known, target,
    )  # fmt: skip
    inside = np.arange(14, 82, 2) + 0.5  # the coarse grid's pixels are of two texels
    every = [
        joint_cost(*given, c, r, scale, CONSTRAINT)
        for r in inside.tolist()
        for c in inside.tolist()
    ]
    assert found[0].cost == pytest.approx(min(every))


def test_unknown_vertices_do_not_matter():
    matcher, palette = matcher_of(picture(96, mask=comma(96)))
    its = planted(45.0, 52.0)
    order = its.lay.patch.order
    known = its.lay.plane.real < 1.0
    target = palette.feature_at(its.state.sample[order], its.place).astype(np.float64)
    its.state.source[order[~known]] = [80.0, 8.0]
    found = its.find(matcher, target, known)
    assert near(found[0], 45, 52)


def test_bare_vertices_may_be_unknown():
    """Their values are whatever their zeros stand for; only `known` decides."""
    matcher, palette = matcher_of(picture(96, mask=comma(96)))
    its = planted(45.0, 52.0)
    order = its.lay.patch.order
    bare = its.lay.plane.imag > 1.0
    target = palette.feature_at(its.state.sample[order], its.place).astype(np.float64)
    its.state.patch[order[bare]] = -1
    its.state.source[order[bare]] = 0
    assert near(its.find(matcher, target, ~bare)[0], 45, 52)


def test_a_place_beside_the_border_is_found():
    """Of the patch a quarter lies off the sample; what is off does not count."""
    matcher, palette = matcher_of(picture(96, mask=comma(96)))
    its = planted(4.0, 60.0, radius=12)
    share = its.inside.mean()
    assert 0.6 < share < 0.75
    target = palette.feature_at(its.state.sample[its.lay.patch.order], its.place)
    found = its.find(matcher, target.astype(np.float64), its.inside)
    assert near(found[0], 4, 60)


def test_most_of_a_patch_lies_inside_where_that_can_be():
    matcher, _ = matcher_of(picture(96, mask=comma(96)))
    its = planted(-8.0, 60.0, radius=12)  # where it came from, a fifth of it was inside
    count = len(its.place)
    assert its.inside.mean() < 0.25
    points = its.lay.points(1.0)
    for at in its.find(matcher, np.zeros(count), its.inside, turns=TURNS, most=8):
        place, _ = warped(points, np.array([at.column, at.row, at.turn, *at.warp]), 1.0)
        assert ((place > -1) & (place < 96)).all(axis=1).mean() > 0.5


@pytest.mark.parametrize(("width", "height"), [(14, 14), (40, 9), (9, 40)])
def test_a_sample_smaller_than_the_patch(width, height):
    mask = np.zeros((height, width), np.float32)
    mask[height // 3 : 2 * height // 3, width // 3 : 2 * width // 3] = 1
    colour = np.ascontiguousarray(picture(96).channels[:height, :width])
    matcher, palette = matcher_of(Sample("small", colour, colour.copy(), mask=mask))
    its = planted(width / 2, height / 2, radius=16, side=(width, height))
    assert its.inside.mean() < 0.5
    target = palette.feature_at(its.state.sample[its.lay.patch.order], its.place)
    found = its.find(matcher, target * its.inside, its.inside, turns=TURNS)
    assert 1 <= len(found) <= 3
    assert all(np.isfinite([at.column, at.row, at.cost]).all() for at in found)
    assert found[0].cost <= found[-1].cost


def test_what_another_sample_shows_is_matched_in_this_ones_space():
    one = picture(96, mask=comma(96))
    piece = np.ascontiguousarray(one.channels[20:80, 25:75])
    other = replace(picture(60, 9), channels=piece, colour=piece.copy())
    matcher, palette = matcher_of(one, other)
    its = planted(25.0, 30.0, side=(50, 60), sample=1)
    assert its.inside.all()
    count = len(its.place)
    own = palette.feature_at(np.zeros(count, np.uint16), its.place + np.float32([25, 20]))
    found = its.find(matcher, own.astype(np.float64), np.ones(count, np.bool_))
    assert near(found[0], 50, 50)
    order = its.lay.patch.order
    expected = palette.match(0).values
    shown = matcher.values_of(its.state, order)
    x, y = np.round(its.place).astype(int).T
    assert np.abs(shown - expected[96 + y, x]).mean() < 0.1


def test_placements_are_apart_and_as_many_as_asked_for():
    matcher, _ = matcher_of(picture(160, mask=comma(160)))
    its = planted(70.0, 80.0)
    count = len(its.place)
    for most in (1, 3, 8):
        found = its.find(matcher, np.zeros(count), np.ones(count, np.bool_), turns=TURNS, most=most)
        assert len(found) == most
        for k, at in enumerate(found):
            for other in found[:k]:
                assert (
                    max(abs(at.column - other.column), abs(at.row - other.row)) >= 2
                    or abs(at.turn - other.turn) > 0.03
                )


def test_the_same_question_has_the_same_answer():
    """Also after others were asked, and from another matcher."""
    sample = picture(96, mask=comma(96))
    matcher, palette = matcher_of(sample)
    its = planted(40.0, 40.0, turn=TURNS[3])
    target = palette.feature_at(its.state.sample[its.lay.patch.order], its.place).astype(float)
    everywhere = np.ones(len(target), np.bool_)
    first = its.find(matcher, target, everywhere, turns=TURNS)
    its.find(matcher, 1 - target, everywhere)
    assert its.find(matcher, target, everywhere, turns=TURNS) == first
    assert its.find(matcher_of(sample)[0], target, everywhere, turns=TURNS) == first


# --- the coarse search


def pixels(points, turn, factor, half):
    """Pixel (n, 2) row and column of points turned, with the centre in the middle."""
    at = points * np.exp(1j * turn) / factor
    return np.floor(np.stack([-at.imag, at.real], axis=1) + 0.5).astype(int) + half


@pytest.mark.parametrize("factor", [1, 2, 4])
@pytest.mark.parametrize("some", [0.0, 0.5, 1.0])
def test_coarse_costs_against_a_twin(factor, some):
    """Every centre and turn: the patch's pixels are laid on block means one by one."""
    random = np.random.default_rng(factor)
    match = random.random((37, 45, 2)).astype(np.float32)
    feature = random.random((37, 45)).astype(np.float32)
    points = random.normal(0, 5, 150) + 1j * random.normal(0, 5, 150)
    values = random.random((150, 2)).astype(np.float32)
    known, target = random.random(150) < some, random.random(150)
    turns = (0.0, 1.1, -2.5)
    scale, weight = 0.7, 4.0
    search = CoarseSearch(match, feature, factor, scale, weight)
    costs, count, area = search.costs(points, turns, values, known, target)
    high, wide = 37 // factor, 45 // factor
    assert costs.shape == count.shape == (3, high, wide)

    def reduced(each):
        blocks = each[: high * factor, : wide * factor].astype(np.float64)
        return blocks.reshape(high, factor, wide, factor, -1).mean(axis=(1, 3))

    texture, wanted = reduced(match), reduced(feature)[..., 0]
    for index, turn in enumerate(turns):
        cells: dict[tuple[int, int], list[int]] = {}
        for vertex, cell in enumerate(pixels(points, turn, factor, 0).tolist()):
            cells.setdefault(tuple(cell), []).append(vertex)
        assert area[index] == len(cells)
        for row, column in random.integers(0, (high, wide), (12, 2)).tolist():
            total, inside = 0.0, 0
            for (down, right), members in cells.items():
                r, c = row + down, column + right
                if not (0 <= r < high and 0 <= c < wide):
                    continue
                inside += 1
                total += weight * (target[members].mean() - wanted[r, c]) ** 2
                seen = [vertex for vertex in members if known[vertex]]
                if seen:
                    ssd = ((values[seen].mean(axis=0) - texture[r, c]) ** 2).sum()
                    total += len(seen) / len(members) * ssd / scale
            assert count[index, row, column] == inside
            assert costs[index, row, column] == pytest.approx(total / max(inside, 1e-3), abs=2e-4)


def test_pixels_are_means_of_their_vertices():
    random = np.random.default_rng(7)
    points = random.normal(0, 3, 80) + 1j * random.normal(0, 3, 80)
    values = random.random((80, 3)).astype(np.float32)
    known, target = random.random(80) < 0.6, random.random(80).astype(np.float32)
    spins = np.exp(1j * np.array([0.3, 2.0])) / 2
    image, seen, wanted, mask = splat(points, spins, values, known, target, 3)
    assert image.shape == (2, 3, 7, 7)
    for turn, spin in enumerate(spins):
        at = pixels(points, float(np.angle(spin)), 2, 3)
        for row in range(7):
            for column in range(7):
                here = (at == (row, column)).all(axis=1)
                assert mask[turn, row, column] == here.any()
                if not here.any():
                    continue
                assert wanted[turn, row, column] == pytest.approx(target[here].mean(), abs=1e-5)
                assert seen[turn, row, column] == pytest.approx(known[here].mean(), abs=1e-5)
                shown = values[here & known].mean(axis=0) if (here & known).any() else np.zeros(3)
                assert image[turn, :, row, column] == pytest.approx(shown, abs=1e-5)


@pytest.mark.parametrize(("side", "height", "width"), [(5, 8, 11), (9, 4, 6), (3, 1, 2)])
def test_sums_of_what_is_inside_against_a_twin(side, height, width):
    random = np.random.default_rng(side)
    values = random.random((2, side, side))
    found = window_sums(values, height, width)
    half = side // 2
    for row in range(height):
        for column in range(width):
            rows = np.arange(side) + row - half
            columns = np.arange(side) + column - half
            inside = values[:, (rows >= 0) & (rows < height)]
            inside = inside[:, :, (columns >= 0) & (columns < width)]
            assert found[:, row, column] == pytest.approx(inside.sum(axis=(1, 2)))


def test_spectra_are_kept_within_bounds():
    random = np.random.default_rng(1)
    search = CoarseSearch(
        random.random((30, 30, 2)).astype(np.float32), np.zeros((30, 30), np.float32), 1, 1.0, 4.0
    )
    for reach in np.linspace(1, 25, 40):
        points = np.array([0, reach, -reach], np.complex128)
        costs, _, _ = search.costs(
            points, (0.0,), np.zeros((3, 2), np.float32), np.ones(3, np.bool_), np.zeros(3)
        )
        assert np.isfinite(costs).all()
    assert len(search._spectra) <= 16
