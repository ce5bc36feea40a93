"""Laws of geodesic distances: exact on planes, close on all else, and never more work than due."""

import igl
import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from btfcore.paint.geodesic import march, press, unreached
from tests.paint.grounds import Ground, ball, cow, flat, ground, walls
from tests.surfaces import cylinder

NOWHERE = np.zeros(0, np.int32)


def from_vertex(place: Ground, seed: int, limit: float = np.inf, *, circle: bool = True):
    value, seeds = unreached(place.net), np.array([seed])
    if circle:
        return value, press(place.net, value, unreached(place.net), seeds, np.zeros(1), 0.0, limit)
    return value, march(place.net, value, seeds, np.zeros(1), limit)


def lengths(place: Ground) -> np.ndarray:
    return np.linalg.norm(place.net.edge.astype(np.float64), axis=1)


def tails(place: Ground) -> np.ndarray:
    return np.repeat(np.arange(len(place.net.indptr) - 1), np.diff(place.net.indptr))


def along_edges(place: Ground, seed: int) -> np.ndarray:
    net = place.net
    graph = csr_matrix((lengths(place), net.indices, net.indptr))
    return dijkstra(graph, indices=seed)


def exact(place: Ground, seed: int, near: np.ndarray) -> np.ndarray:
    """Exact polyhedral distance (Mitchell et al. 1987) in steps."""
    return igl.exact_geodesic(
        place.dense.vertices / place.step, place.dense.faces.astype(np.int64),
        np.array([seed]), np.zeros(0, np.int64), near.astype(np.int64), np.zeros(0, np.int64),
    )  # fmt: skip


def twin(place: Ground, seeds, start, circle: bool) -> np.ndarray:
    """All faces over and over, the front's best crossing of each base found by bisection."""
    faces, points = place.net.faces, place.dense.vertices / place.step
    corner = np.concatenate([np.roll(faces, shift, axis=1) for shift in range(3)])
    a, b, c = points[corner].swapaxes(0, 1)
    base = np.linalg.norm(b - a, axis=1)
    x = ((c - a) * (b - a)).sum(axis=1) / base
    y = np.sqrt(np.maximum(((c - a) ** 2).sum(axis=1) - x**2, 0))
    value = np.full(len(points), np.inf)
    np.minimum.at(value, seeds, start)
    while True:
        first, second = value[corner[:, 0]], value[corner[:, 1]]
        found = np.minimum(first + np.hypot(x, y), second + np.hypot(base - x, y))
        both = np.isfinite(first) & np.isfinite(second)
        near, far, wide = first[both], second[both], base[both]
        middle = (near**2 - far**2 + wide**2) / (2 * wide)
        below = np.sqrt(np.maximum(near**2 - middle**2, 0)) if circle else 0 * wide

        def crossing(t, ends=(near, far, wide, x[both], y[both], middle, below)):
            near, far, wide, right, up, middle, below = ends
            here = np.hypot(t - middle, below) if circle else near + t / wide * (far - near)
            return here + np.hypot(right - t, up)

        low, high = np.zeros(both.sum()), wide.copy()
        for _ in range(80):
            one, two = low + (high - low) / 3, high - (high - low) / 3
            left = crossing(one) <= crossing(two)
            low, high = np.where(left, low, one), np.where(left, two, high)
        inner = ((low + high) / 2 > 1e-6 * wide) & ((low + high) / 2 < (1 - 1e-6) * wide)
        best = np.where(inner, crossing((low + high) / 2), np.inf)
        found[both] = np.minimum(found[both], best)
        lower = value.copy()
        np.minimum.at(lower, corner[:, 2], found)
        if (lower >= value - 1e-6).all():
            return lower
        value = lower


@pytest.mark.parametrize("place", [lambda: ball(2), lambda: flat(9, 12)])
def test_straight_fronts_equal_their_twin(place):
    place = place()
    seeds, start = np.array([3, 50, 77], np.int32), np.array([0.0, -0.7, 2.5])
    value = unreached(place.net)
    lowered = march(place.net, value, seeds, start, np.inf)
    assert np.allclose(value, twin(place, seeds, start, False), atol=1e-3)
    assert np.array_equal(lowered, np.arange(len(value)))


@pytest.mark.parametrize("radius", [0.0, 3.5])
@pytest.mark.parametrize("place", [lambda: ball(2), lambda: flat(9, 12)])
def test_round_fronts_equal_their_twin(place, radius):
    place = place()
    seeds = place.net.faces[20]
    corner = place.dense.vertices[seeds]
    start = np.linalg.norm(corner - [0.5, 0.3, 0.2] @ corner, axis=1) / place.step
    value, own = unreached(place.net), unreached(place.net)
    lowered = press(place.net, value, own, seeds, start, radius, np.inf)
    assert np.allclose(value + radius, twin(place, seeds, start, True), atol=1e-3)
    assert np.array_equal(lowered, np.arange(len(value)))
    assert np.isposinf(own).all()


def test_a_plane_is_exact():
    place = flat()
    seed = 40 * 101 + 50
    value, _ = from_vertex(place, seed)
    away = np.linalg.norm(place.dense.vertices - place.dense.vertices[seed], axis=1) / place.step
    assert np.abs(value - away).max() < 1e-3
    straight, _ = from_vertex(place, seed, circle=False)
    assert (straight >= away - 1e-3).all() and np.abs(straight - away).max() < 1.5


def test_a_straight_front_is_exact_on_a_plane():
    place = flat()
    direction = np.array([np.cos(0.4), np.sin(0.4), 0.0])
    true = (place.dense.vertices * direction).sum(axis=1) / place.step
    row, column = place.dense.texel.T
    rim = np.flatnonzero((row == 80) | (column == 0))  # where the front enters
    value = unreached(place.net)
    march(place.net, value, rim, true[rim], np.inf)
    assert np.abs(value - true).max() < 1e-3


def test_a_cylinder_is_exact():
    place = ground(cylinder(60, 50))
    seed = 25 * 60
    value, _ = from_vertex(place, seed)
    row, column = np.divmod(np.arange(60 * 50), 60)
    chord = 2 * 60 / (2 * np.pi) * np.sin(np.pi / 60)  # the prism's edge, not the circle's arc
    turn = np.minimum(column, 60 - column) * chord
    away = np.hypot(row - 25, turn) / place.step
    assert np.abs(value - away)[away < 24].max() < 1e-3
    assert np.abs(value - away).max() < 0.3, "where both ways around meet"


def test_a_sphere_is_close():
    place = ball()
    value, _ = from_vertex(place, 0)
    points = place.dense.vertices
    angle = 2 * np.arcsin(np.minimum(np.linalg.norm(points - points[0], axis=1) / 2, 1))
    error = value - angle / place.step
    near = angle < 20 * place.step
    assert np.abs(error[near]).max() < 0.05
    assert np.abs(error).mean() < 0.15 and np.abs(error).max() < 1.0


@pytest.mark.parametrize("seed", [0, 4000, 7777])
def test_a_real_mesh_is_close(seed):
    place = cow()
    value, _ = from_vertex(place, seed)
    near = np.flatnonzero(value < 25)
    error = value[near] - exact(place, seed, near)
    assert np.abs(error).mean() < 0.05
    assert np.quantile(np.abs(error), 0.95) < 0.2
    assert np.abs(error).max() < 1.0
    straight, _ = from_vertex(place, seed, circle=False)
    over = straight[near] - exact(place, seed, near)
    assert over.min() > -0.2 and over.max() < 2.0
    assert np.abs(error).mean() < np.abs(over).mean() / 4, "what circles are for"


@pytest.mark.parametrize("circle", [True, False])
@pytest.mark.parametrize("place", [flat, ball, cow])
def test_no_way_is_longer_than_along_edges(place, circle):
    place = place()
    value, _ = from_vertex(place, 17, circle=circle)
    assert (value <= along_edges(place, 17) + 1e-2).all()
    rise = np.abs(value[tails(place)] - value[place.net.indices])
    assert (rise <= lengths(place) + 1e-3).all(), "the triangle inequality along every edge"


def test_distance_is_the_same_from_either_end():
    place = ball()
    forth, back = from_vertex(place, 12)[0][2000], from_vertex(place, 2000)[0][12]
    assert abs(forth - back) < 0.1


@pytest.mark.parametrize("circle", [True, False])
def test_a_limit_cuts_and_changes_nothing_below(circle):
    place = cow()
    whole, _ = from_vertex(place, 100, circle=circle)
    value, lowered = from_vertex(place, 100, 12.0, circle=circle)
    assert np.array_equal(lowered, np.flatnonzero(np.isfinite(value)))
    assert value[lowered].max() <= 12.0
    # an obtuse triangle at the rim may miss its other end, beyond the limit
    below = whole < 11
    assert (np.abs(value - whole)[below] < 0.05).all()


def test_a_second_front_works_only_where_it_lowers():
    place = flat()
    value, _ = from_vertex(place, 40 * 101 + 20)
    before = value.copy()
    second, own = np.array([40 * 101 + 60]), unreached(place.net)
    lowered = press(place.net, value, own, second, np.zeros(1), 0.0, np.inf)
    changed = np.flatnonzero(value != before)
    assert np.array_equal(lowered, changed)
    assert (value <= before).all()
    column = place.dense.texel[:, 1]
    assert column[lowered].min() >= 40
    points = place.dense.vertices[[40 * 101 + 20, 40 * 101 + 60]]
    away = np.linalg.norm(place.dense.vertices[:, None] - points, axis=2).min(axis=1) / place.step
    assert np.abs(value - away).max() < 1e-3
    assert len(press(place.net, value, own, second, np.zeros(1), 0.0, np.inf)) == 0
    assert np.isposinf(own).all()


def test_straight_fronts_do_not_mind_their_order():
    place = cow()
    seeds, start = np.array([5, 900, 4321], np.int32), np.array([0.0, -3.0, 2.0])
    together = unreached(place.net)
    march(place.net, together, seeds, start, np.inf)
    for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        value = unreached(place.net)
        for index in order:
            march(place.net, value, seeds[[index]], start[[index]], np.inf)
        assert np.allclose(value, together, atol=2e-3)


def test_the_same_call_gives_the_same_bits():
    place = cow()
    one, two = from_vertex(place, 77)[0], from_vertex(place, 77)[0]
    assert np.array_equal(one, two)


def test_fronts_stay_on_their_piece_and_outside_what_is_closed():
    place = walls()
    half = len(place.dense.vertices) // 2
    value, lowered = from_vertex(place, 20 * 41 + 20)
    assert np.array_equal(lowered, np.arange(half)) and np.isinf(value[half:]).all()
    place = flat()
    value = unreached(place.net)
    closed = place.dense.texel[:, 1] == 50
    value[closed] = -np.inf
    own = unreached(place.net)
    lowered = press(place.net, value, own, np.array([40 * 101]), np.zeros(1), 0.0, np.inf)
    assert place.dense.texel[lowered, 1].max() == 49
    assert np.isneginf(value[closed]).all()
    assert np.isposinf(value[place.dense.texel[:, 1] > 50]).all()


def test_nothing_to_do():
    place = flat()
    value = unreached(place.net)
    assert len(march(place.net, value, NOWHERE, np.zeros(0), np.inf)) == 0
    assert len(march(place.net, value, np.array([3]), np.array([2.0]), 1.0)) == 0
    own = unreached(place.net)
    assert len(press(place.net, value, own, np.array([3]), np.array([2.0]), 0.5, 1.0)) == 0
    assert np.isposinf(value).all()
