"""The triangulated chart: Delaunay, linear, its border convex, its kernel what numpy does."""

import numpy as np
import pytest

from btfcore.btf.directions import from_angles
from btfcore.btf.interpolation.barycentric import barycentric_weights_plain
from btfcore.btf.interpolation.interpolator import prepare
from btfcore.btf.interpolation.triangulation import chart, triangulate
from tests.btf.interpolation.sets import SETS, dense, scattered

FILLED = [name for name in SETS if name not in ("pole", "two", "meridian", "slanted line")]


def net_of(name):
    return triangulate(SETS[name], np.arange(len(SETS[name]), dtype=np.int32))


def cross(one, two):
    return one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0]


@pytest.mark.parametrize("name", SETS)
def test_the_kernel_and_its_twin_agree(name):
    count = len(SETS[name])
    queries = np.concatenate([scattered(2000, 8), -scattered(50, 9), SETS[name]])
    found = prepare(SETS[name], "barycentric")
    index, weight, outside = barycentric_weights_plain(net_of(name), queries)
    # on an edge the two may name either triangle
    want, got = dense((index, weight), count), dense(found.weights(queries), count)
    np.testing.assert_allclose(want, got, atol=1e-8)
    np.testing.assert_array_equal(outside, found.clamped(queries))


@pytest.mark.parametrize("name", FILLED)
def test_triangles_cover_the_convex_border_once(name):
    net = net_of(name)
    points = chart(SETS[name])
    assert set(net.triangles.ravel()) == set(range(len(points)))
    corner = points[net.triangles]
    area = cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert area.min() > 0
    start, stop = points[net.edges].swapaxes(0, 1)
    assert area.sum() == pytest.approx(cross(start, stop).sum(), rel=1e-9)
    away = cross((stop - start)[:, None], points[None] - start[:, None])
    assert away.min() > -1e-12  # every direction lies to the left of every border edge


@pytest.mark.parametrize("name", FILLED)
def test_no_direction_lies_inside_the_circle_of_a_triangle(name):
    points = chart(SETS[name])
    points = (points - points.mean(axis=0)) / np.ptp(points, axis=0).max()
    corner = points[net_of(name).triangles]
    lifted = np.concatenate([corner, (corner**2).sum(axis=2, keepdims=True)], axis=2)
    every = np.column_stack([points, (points**2).sum(axis=1)])
    normal = np.cross(lifted[:, 1] - lifted[:, 0], lifted[:, 2] - lifted[:, 0])
    height = np.einsum("tpc,tc->tp", every[None] - lifted[:, :1], normal)
    assert height.min() > -1e-7  # of the extent's square


@pytest.mark.parametrize("name", ["12x8", "12x5", "ubo81", "ubo151", "one ring", "horizon"])
def test_rounding_does_not_choose_the_diagonals(name):
    nodes = np.arange(len(SETS[name]), dtype=np.int32)
    usual = net_of(name).triangles
    for seed in range(5):
        rounded = SETS[name] + np.random.default_rng(seed).uniform(-6e-8, 6e-8, SETS[name].shape)
        again = triangulate(rounded, nodes).triangles
        assert {tuple(sorted(row)) for row in again} == {tuple(sorted(row)) for row in usual}


@pytest.mark.parametrize("name", FILLED)
def test_linear_functions_of_the_chart_are_reproduced(name):
    found = prepare(SETS[name], "barycentric")
    net, rng = net_of(name), np.random.default_rng(1)
    share = rng.dirichlet(np.ones(3), 2000)
    which = rng.integers(0, len(net.triangles), 2000)
    point = np.einsum("nk,nkc->nc", share, chart(SETS[name])[net.triangles[which]])
    squared = (point**2).sum(axis=1, keepdims=True)
    query = np.hstack([2 * point, 1 - squared]) / (1 + squared)  # the chart's inverse
    np.testing.assert_allclose(chart(query), point, atol=1e-14)
    weight = dense(found.weights(query), len(SETS[name]))
    np.testing.assert_allclose(weight @ chart(SETS[name]), point, atol=1e-8)


@pytest.mark.parametrize("name", [name for name in FILLED if name != "horizon"])
def test_a_query_outside_takes_the_nearest_point_of_the_border(name):
    found = prepare(SETS[name], "barycentric")
    queries = scattered(500, 2)
    queries = queries[found.clamped(queries)]
    assert len(queries) > 5
    points, edges = chart(SETS[name]), net_of(name).edges
    taken = dense(found.weights(queries), len(points)) @ points
    line = np.linspace(0, 1, 501)[:, None, None]
    border = (points[edges[:, 0]] * (1 - line) + points[edges[:, 1]] * line).reshape(-1, 2)
    least = np.linalg.norm(chart(queries)[:, None] - border[None], axis=2).min(axis=1)
    apart = np.linalg.norm(chart(queries) - taken, axis=1)
    assert (apart <= least + 1e-12).all() and (apart >= least - 1e-2).all()


def test_directions_on_a_line_are_interpolated_along_it():
    found = prepare(SETS["meridian"], "barycentric")
    slope = np.tan(np.radians(30) / 2), np.tan(np.radians(15) / 2)
    weight = dense(found.weights(from_angles(np.radians([15, 80]), [np.pi, 0.0])), 5)
    share = slope[1] / slope[0]
    np.testing.assert_allclose(weight[0], [0, 0, 1 - share, share, 0], atol=1e-12)
    np.testing.assert_allclose(weight[1], [1, 0, 0, 0, 0], atol=1e-12)


@pytest.mark.parametrize("seed", range(40))
def test_awkward_sets_are_triangulated_and_exact(seed):
    """Thin bands, clusters, coarse lattices: whatever is wider than a ten-thousandth."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 60))
    theta, phi = np.arccos(rng.uniform(0.02, 1, count)), rng.uniform(0, 7, count)
    if seed % 4 == 0:
        theta, phi = np.clip(theta.round(1), 0, 1.5), phi.round()
    elif seed % 4 == 1:
        phi = 1 + rng.normal(size=count) * 10.0 ** rng.uniform(-2.5, -1)
    elif seed % 4 == 2:
        theta = 0.8 + 1e-2 * rng.normal(size=count)
        phi = 1e-2 * rng.normal(size=count)
    directions = from_angles(theta, phi)
    found = prepare(directions, "barycentric")
    weight = dense(found.weights(directions), count)
    np.testing.assert_allclose(weight @ directions, directions, atol=1e-8)
