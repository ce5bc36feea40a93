"""Lines of sight and horizons, against plain twins and against what defines them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from btfcore.btf.bake.horizon import horizons
from btfcore.btf.bake.relief import relief
from btfcore.btf.bake.trace import cell, enter, first_root, folded, surface, trace, wrapped
from tests.btf.bake import fields, reference
from tests.btf.bake.fields import direction

FIELDS = {
    "bumps": (fields.bumps(24, 32), 5.0),
    "rough": (fields.bumps(16, 16, 1.0, 2), 3.0),
    "blocks": (fields.blocks(24), 4.0),
    "noise": (np.random.default_rng(5).random((9, 13), np.float32), 6.0),
    "spike": (np.pad(np.ones((1, 1), np.float32), ((3, 8), (5, 6))), 8.0),
}
VIEWS = [(0, 0), (5, 17), (40, 90), (60, 200), (75, 0), (75, 333), (85, 45), (90, 10)]
number = st.floats(-3, 3, allow_nan=False, width=32)


def field(name):
    height, depth = FIELDS[name]
    return relief(fields.plain(height, depth=depth))


def hits(made, view):
    count = made.shape[0] * made.shape[1]
    x, y = np.empty(count), np.empty(count)
    run = reference.run_of(view)
    trace(made.height, made.ceiling, 0, made.shape[1], run, made.level, x, y)
    return x, y


def apart(one, other, size):
    return np.abs((one - other + size / 2) % size - size / 2)


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("view", VIEWS)
def test_a_hit_is_the_first_point_of_its_line_on_the_surface(name, view):
    made = field(name)
    view = direction(*view)
    x, y = hits(made, view)
    rows, columns = made.height.shape
    assert (0 <= x).all() and (x < columns).all() and (0 <= y).all() and (y < rows).all()
    z = reference.height_at(made.height, x, y)
    row, column = np.divmod(np.arange(made.height.size), columns)
    run = reference.run_of(view)
    plane, top, _ = made.level
    assert apart(x, column + run[0] * (z - plane), columns).max() < 1e-4
    assert apart(y, row + run[1] * (z - plane), rows).max() < 1e-4
    for part in np.linspace(0, 1, 400, endpoint=False):  # nothing in front of it
        level = top + (z - top) * part
        there = reference.height_at(
            made.height, column + run[0] * (level - plane), row + run[1] * (level - plane)
        )
        assert (there - level).max() < 1e-5


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("view", [(0, 0), (40, 90), (75, 333)])
def test_small_steps_come_to_the_same_points(name, view):
    made = field(name)
    view = direction(*view)
    x, y = hits(made, view)
    other_x, other_y = reference.marched(made, view, 1 / 16)
    rows, columns = made.height.shape
    off = np.maximum(apart(x, other_x, columns), apart(y, other_y, rows))
    assert np.median(off) < 1e-9
    same = off < 1e-3
    assert same.mean() > 0.95
    mine, others = (
        reference.height_at(made.height, x, y),
        reference.height_at(made.height, other_x, other_y),
    )
    assert (mine > others)[~same].all()  # steps may step over a tip


def test_a_line_straight_down_meets_its_own_texel():
    made = field("noise")
    x, y = hits(made, np.array([0.0, 0.0, 1.0]))
    row, column = np.divmod(np.arange(made.height.size), made.shape[1])
    assert np.array_equal(x, column) and np.array_equal(y, row)


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("light", [(75, 20), (60, 135), (45, 270), (88, 181)])
@pytest.mark.parametrize("view", [(0, 0), (60, 310)])
def test_the_horizon_is_the_steepest_line_to_the_surface(name, light, view):
    made = field(name)
    light = direction(*light)
    x, y = hits(made, direction(*view))
    tangent = light[2] / np.hypot(light[0], light[1])
    low = min(tangent, 0.2)
    out = np.empty((1, len(x)), np.float32)
    along = light[:2] * [1, -1] / np.hypot(light[0], light[1])
    reach = np.array([[low, 1e9]])
    horizons(made.height, made.ceiling, made.level[1], x, y, along[None], reach, out)
    flattest = np.array([light[0], light[1], np.hypot(light[0], light[1]) * low])
    found = np.maximum(reference.horizon(made, x, y, flattest, 1 / 64), low)
    assert (found - out[0]).max() < 1e-5  # nothing sticks out
    assert (out[0] - found < 0.02 * (1 + found)).mean() > 0.99  # tips between steps
    assert np.median(np.abs(out[0] - found)) < 1e-3


def test_horizons_stop_where_they_stop_mattering():
    made = field("blocks")
    x, y = hits(made, direction(30, 30))
    way = np.array([[1.0, 0.0]])
    out = {}
    for key, reach in {"all": (0.1, 1e9), "some": (0.5, 1.0)}.items():
        out[key] = np.empty((1, len(x)), np.float32)
        limits = np.array([reach])
        horizons(made.height, made.ceiling, made.level[1], x, y, way, limits, out[key])
    for tangent in (0.51, 0.7, 0.99):
        assert np.array_equal(out["all"] >= tangent, out["some"] >= tangent)
    assert out["some"].min() >= 0.5


def test_a_level_surface_has_no_horizon_and_a_slope_its_own():
    flat = np.zeros((4, 4), np.float32)
    ramp = np.repeat(np.arange(8, dtype=np.float32)[None], 4, axis=0)  # one period of a sawtooth
    out = np.empty((1, 1), np.float32)
    at, way = np.array([2.5]), np.array([[1.0, 0.0]])
    limits = np.array([[0.01, 1e9]])
    horizons(flat, flat, 0.0, at, at, way, limits, out)
    assert out[0, 0] == np.float32(0.01)
    high = np.maximum(ramp, np.roll(ramp, -1, 1))
    horizons(ramp, high, 7.0, at, at, way, limits, out)
    assert out[0, 0] == 1


@given(number, number, number, st.floats(0, 4))
def test_first_root_is_the_first(c0, c1, c2, end):
    root = first_root(c0, c1, c2, end)
    t = np.linspace(0, end, 2001)
    values = c0 + t * (c1 + t * c2)
    scale = 1e-4 * (1 + abs(c0) + abs(c1) * end + abs(c2) * end**2)
    if root < 0:
        assert values.min() > -1e-9
    else:
        assert 0 <= root <= end
        assert values[t < root].min(initial=1) > -scale
        assert abs(c0 + root * (c1 + root * c2)) < scale or c0 <= 0


@given(st.floats(-50, 50), st.floats(-2, 2))
def test_entering_a_cell(position, speed):
    place, leave, step, gap = enter(position, speed)
    if abs(speed) > 1e-12:
        assert leave >= 0 and gap == pytest.approx(1 / abs(speed))
        edge = place + 1 if speed > 0 else place
        assert position + speed * leave == pytest.approx(edge, abs=1e-9)
        assert step == np.sign(speed)
        assert place <= position <= place + 1
    else:
        assert leave > 1e200 and gap > 1e200


def test_folding_and_wrapping_stay_inside():
    assert folded(-1e-18, 5) == 0 and folded(5.0, 5) == 0 and folded(-0.5, 5) == 4.5
    assert [wrapped(k, 3) for k in (-1, 0, 2, 3)] == [2, 0, 2, 0]


def test_a_cell_and_the_surface_are_bilinear():
    height = np.random.default_rng(0).random((3, 5), np.float32)
    base, along, down, twist = cell(height, 2, 4)
    corner = [height[2, 4], height[2, 0], height[0, 4], height[0, 0]]
    assert np.allclose([base, base + along, base + down, base + along + down + twist], corner)
    x, y = np.random.default_rng(1).random((2, 50)) * [[5], [3]]
    found = [surface(height, *point) for point in zip(x, y, strict=True)]
    assert np.allclose(found, reference.height_at(height, x, y), atol=1e-6)
