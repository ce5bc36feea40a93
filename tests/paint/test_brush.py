"""Laws of strokes: round, even, the same however they are dealt out, and harmless off the mesh."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.errors import InvalidEdit
from btfcore.paint.brush import CLOSEST, SPACING, BrushField, Dabs
from btfcore.paint.edits import Stroke
from tests.paint.grounds import Ground, ball, cow, flat, ground, walls

ROWS = ("vertex", "position", "radius", "arc", "direction", "stroke")


def brush(place: Ground, reach: float = 3.0) -> BrushField:
    return BrushField(place.net, place.locator(), reach=reach)


def from_dabs(place: Ground, dabs: Dabs) -> np.ndarray:
    """Twin on a plane: ψ (N,) from straight distances to the dabs."""
    away = np.linalg.norm(place.dense.vertices[:, None] - dabs.position, axis=2) / place.step
    return (away - dabs.radius).min(axis=1)


def wandering(place: Ground, count: int = 40, seed: int = 0):
    """Points along an uneven way near a surface, with normals and pressure."""
    random = np.random.default_rng(seed)
    locator = place.locator()
    box = place.dense.vertices
    points = box[random.integers(len(box))] + np.cumsum(
        random.standard_normal((count, 3)) * 3 * place.step, axis=0
    )
    feet = locator.nearest(points)
    normals = place.dense.normals[feet.vertex].astype(np.float64)
    pressure = np.clip(random.uniform(-0.2, 1.2, count), 0, 1)
    points[7] = points[6]  # a hand that rests
    return points, normals, pressure


def test_a_dab_is_a_disc_about_the_point_and_not_about_a_vertex():
    place = flat()
    point = np.array([[50.37, -40.81, 0.4]])
    field = brush(place)
    dabs = field.paint(Stroke(point, 9.3))
    away = np.linalg.norm(place.dense.vertices[:, :2] - point[0, :2], axis=1)
    kept = np.isfinite(field.value)
    assert np.array_equal(kept, away / place.step <= 9.3 / place.step + 4)
    assert np.allclose(field.value[kept], (away[kept] - 9.3) / place.step, atol=1e-3)
    assert np.array_equal(dabs.lowered, np.flatnonzero(kept))
    assert len(dabs) == 1 and np.allclose(dabs.radius, 9.3 / place.step)
    assert np.allclose(dabs.position, [[50.37, -40.81, 0]])
    assert (dabs.direction == 0).all(), "a click has no direction"


def test_a_straight_stroke_is_a_capsule():
    place = flat()
    begin, end, radius = np.array([20.2, -30.6, 0]), np.array([77.7, -52.1, 0]), 8.0
    field = brush(place)
    dabs = field.paint(Stroke(np.stack([begin, end]), radius))
    points = place.dense.vertices
    along = np.clip((points - begin) @ (end - begin) / ((end - begin) @ (end - begin)), 0, 1)
    away = np.linalg.norm(points - begin - along[:, None] * (end - begin), axis=1)
    kept = np.isfinite(field.value)
    error = field.value[kept] - (away[kept] - radius) / place.step
    near = np.abs(field.value[kept]) < 3
    depth = radius / place.step - 3  # between two dabs, there the edge is farthest off
    ripple = np.hypot(depth, SPACING / 2 * radius / place.step) - depth
    assert -0.01 < error[near].min() and error[near].max() < ripple + 0.01
    assert np.abs(field.value[kept] - from_dabs(place, dabs)[kept]).max() < 0.02
    assert kept[away < radius + 2.5 * place.step].all()
    assert not kept[away > radius + 4.5 * place.step].any()
    length = np.linalg.norm(end - begin)
    assert np.allclose(dabs.direction, (end - begin) / length)
    assert dabs.arc[0] == 0 and np.isclose(dabs.arc[-1], length / place.step)
    assert np.allclose(np.diff(dabs.arc)[:-1], SPACING * radius / place.step)
    assert np.diff(dabs.arc)[-1] <= SPACING * radius / place.step + 1e-9


@pytest.mark.parametrize("place", [flat, cow])
def test_dealing_a_stroke_out_changes_no_bit(place):
    place = place()
    points, normals, pressure = wandering(place)
    radius = 6 * place.step
    whole = brush(place)
    expected = whole.paint(Stroke(points, radius, normals, pressure))
    assert len(expected) > 40
    for seed in range(3):
        cuts = np.sort(np.random.default_rng(seed).integers(0, len(points), 12))
        field = brush(place)
        field.begin(radius)
        parts = [
            field.extend(*each)
            for each in zip(
                np.split(points, cuts), np.split(normals, cuts), np.split(pressure, cuts),
                strict=True,
            )
        ]  # fmt: skip
        parts.append(field.finish())
        assert np.array_equal(field.value, whole.value)
        joined = Dabs.joined(parts)
        for name in (*ROWS, "lowered"):
            assert np.array_equal(getattr(joined, name), getattr(expected, name)), name
        assert (joined.skipped, joined.weightless) == (expected.skipped, expected.weightless)


def test_what_is_lowered_is_what_changed():
    place = cow()
    points, normals, _ = wandering(place)
    field = brush(place)
    field.begin(5 * place.step)
    for begin in range(0, len(points), 5):
        before = field.value.copy()
        dabs = field.extend(points[begin : begin + 5], normals[begin : begin + 5])
        assert np.array_equal(dabs.lowered, np.flatnonzero(field.value != before))
        assert (field.value <= before).all()


def test_the_first_dab_waits_until_its_direction_is_known():
    place = flat()
    field = brush(place)
    field.begin(5.0)
    assert len(field.extend(np.array([[50.0, -40, 0]]))) == 0
    assert len(field.extend(np.array([[50.0, -40, 0]]))) == 0, "the same place again"
    dabs = field.extend(np.array([[50.0, -41, 0]]))
    assert len(dabs) == 1 and np.allclose(dabs.direction, [[0, -1, 0]])
    assert len(field.finish()) == 1
    assert len(field.finish()) == 0, "there is nothing to end"


def test_pressure_scales_the_radius_and_dabs_stay_close():
    place = flat()
    points = np.array([[10.0, -40, 0], [90.0, -40, 0]])
    field = brush(place)
    dabs = field.paint(Stroke(points, 12.0, pressure=np.array([0.0, 1.0])))
    along = (dabs.position[:, 0] - 10) / 80
    assert np.allclose(dabs.radius, 12 / place.step * along)
    gap = np.maximum(SPACING * dabs.radius[:-1], CLOSEST)
    assert (np.diff(dabs.arc) <= gap + 1e-9).all()
    assert dabs.weightless == 1 and dabs.skipped == 0
    kept = np.isfinite(field.value)
    assert np.abs(field.value[kept] - from_dabs(place, dabs)[kept]).max() < 0.1


def test_no_pressure_paints_nothing():
    place = flat()
    field = brush(place)
    points = np.array([[10.0, -40, 0], [30.0, -40, 0], [50.0, -40, 0]])
    dabs = field.paint(Stroke(points, 6.0, pressure=np.zeros(3)))
    assert len(dabs) == len(dabs.lowered) == dabs.skipped == 0 and dabs.weightless > 40
    assert np.isposinf(field.value).all()


def test_a_pen_that_is_pressed_down_before_it_moves_counts_its_pressure():
    field = brush(flat())
    point = np.array([50.0, -40, 0])
    dabs = field.paint(Stroke(np.stack([point] * 3), 6.0, pressure=np.array([0.1, 0.8, 0.0])))
    assert np.allclose(dabs.radius, 0.8 * 6.0 / flat().step)


def test_a_stroke_may_leave_the_mesh():
    place = flat()
    inside = np.array([[60.0, -40, 0], [100.0, -40, 0]])
    whole, part = brush(place), brush(place)
    for far in (140.0, 1e9):
        field = brush(place)
        dabs = field.paint(Stroke(np.array([[60.0, -40, 0], [far, -40, 0]]), 6.0))
        assert dabs.skipped >= (min(far, 1e6) - 106) / 1.5 - 2
        assert dabs.position[:, 0].max() <= 100
    whole.paint(Stroke(np.array([[60.0, -40, 0], [140.0, -40, 0]]), 6.0))
    part.paint(Stroke(inside, 6.0))
    both = np.isfinite(whole.value) & np.isfinite(part.value)
    rim = both & (np.abs(part.value) < 2)
    assert np.abs(whole.value[rim] - part.value[rim]).max() < 0.2
    assert (np.sign(whole.value[both]) == np.sign(part.value[both]))[
        np.abs(part.value[both]) > 0.2
    ].all()
    assert np.minimum(whole.value, part.value)[~both].min() > 3
    there_and_back = np.array([[60.0, -40, 0], [100, -40, 0], [200, 50, 0], [100.0, -60, 0]])
    dabs = brush(place).paint(Stroke(np.concatenate([there_and_back, [[60.0, -60, 0]]]), 6.0))
    assert {-40.0, -60.0} <= set(np.round(dabs.position[:, 1], 9))


def test_points_far_apart_are_joined_over_the_surface():
    place = ball()
    ends = np.array([[np.cos(turn), np.sin(turn), 0.0] for turn in np.radians([10, 70])])
    field = brush(place)
    dabs = field.paint(Stroke(ends, 0.1))
    assert dabs.skipped == 0
    x, y, z = place.dense.vertices.T
    turn = np.degrees(np.arctan2(y, x))
    beside = np.arcsin(np.abs(z)) / place.step
    on_way = (turn > 10) & (turn < 70)
    expected = beside[on_way] - 0.1 / place.step
    near = np.abs(expected) < 2
    assert np.abs(field.value[on_way][near] - expected[near]).max() < 0.15


def test_a_way_through_the_inside_is_skipped_and_counted():
    place = ball()
    ends = np.array([[1.0, 0.02, 0.03], [-1.0, 0.02, 0.03]])
    field = brush(place)
    dabs = field.paint(Stroke(ends, 0.1))
    deep = place.locator().tolerance
    assert np.abs(dabs.skipped - (2 - 2 * deep) / 0.025) < 3
    assert len(dabs) + dabs.skipped == 81
    assert np.abs(place.dense.vertices[field.value < 0, 0]).min() > 0.7


def test_a_stroke_beside_the_border_reaches_over_it():
    place = flat()
    field = brush(place)
    points = np.array([[103.0, -20, 0], [103.0, -60, 0]])
    field.paint(Stroke(points, 8.0))
    x, y, _ = place.dense.vertices.T
    middle = (y < -24) & (y > -56)
    near = middle & (np.abs(x - 95) < 3)
    assert np.allclose(field.value[near], (95 - x[near]) / place.step, atol=0.3)
    nothing = brush(place).paint(Stroke(points + [6.0, 0, 0], 8.0))
    assert len(nothing) == len(nothing.lowered) == 0 and nothing.skipped > 10


def test_a_dab_does_not_jump_through_a_thin_wall():
    place = walls()
    half = len(place.dense.vertices) // 2
    points = np.array([[20.0, -20, 0]])
    for side, other in ((1.0, slice(half, None)), (-1.0, slice(0, half))):
        field = brush(place)
        dabs = field.paint(Stroke(points, 10.0, np.array([[0, 0, side]])))
        assert len(dabs.lowered) > 200
        assert np.isposinf(field.value[other]).all()


def test_strokes_over_each_other_are_their_union():
    place = flat()
    one = Stroke(np.array([[20.0, -40, 0], [80.0, -40, 0]]), 7.0)
    two = Stroke(np.array([[50.0, -10, 0], [50.0, -70, 0]]), 5.0)
    both, first, second = brush(place), brush(place), brush(place)
    dabs = Dabs.joined([both.paint(one), both.paint(two)])
    first.paint(one)
    second.paint(two)
    union = np.minimum(first.value, second.value)
    kept = np.isfinite(union)
    assert np.array_equal(kept, np.isfinite(both.value))
    assert np.abs(both.value[kept] - union[kept]).max() < 0.02
    rim = np.abs(union) < 1e-2  # there the last bits may decide
    assert np.array_equal((both.value <= 0)[~rim], (union <= 0)[~rim])
    assert set(dabs.stroke.tolist()) == {0, 1}


@pytest.mark.parametrize(("scale", "shift"), [(1e-4, 0.0), (1e3, 1e6)])
def test_size_and_place_of_the_world_do_not_matter(scale, shift):
    place = ball()
    dense = replace(place.dense, vertices=place.dense.vertices * scale + shift)
    other = ground(dense)
    points = np.array([[np.cos(turn), np.sin(turn), 0.1] for turn in (0.1, 0.4, 0.7)])
    one, two = brush(place), brush(other)
    dabs = one.paint(Stroke(points, 0.15))
    moved = two.paint(Stroke(points * scale + shift, 0.15 * scale))
    assert np.array_equal(np.isfinite(one.value), np.isfinite(two.value))
    kept = np.isfinite(one.value)
    assert np.allclose(one.value[kept], two.value[kept], atol=1e-3)
    assert np.allclose(dabs.arc, moved.arc, rtol=1e-5)


def test_a_stroke_that_was_not_begun_and_bad_numbers():
    field = brush(flat())
    with pytest.raises(InvalidEdit, match="not begun"):
        field.extend(np.zeros((1, 3)))
    field.begin(3.0)
    with pytest.raises(InvalidEdit, match="pressure 0 of a stroke is nan"):
        field.extend(np.zeros((1, 3)), None, np.array([np.nan]))
    with pytest.raises(InvalidEdit, match="not finite"):
        field.extend(np.array([[0, np.inf, 0]]))
    assert len(field.extend(np.zeros((0, 3)))) == 0
    assert len(Dabs.joined([])) == 0
