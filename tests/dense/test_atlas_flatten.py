"""Laws of laying charts flat, of labels and of segmentation; kernels against plain twins."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

from btfcore.dense.atlas import chart_mesh
from btfcore.dense.charts import Charts
from btfcore.dense.flatten import fails, flatten_charts
from btfcore.dense.labels import absorb, bisect, borders, connected, fill, smooth
from btfcore.dense.quality import _overlaps, measure
from btfcore.dense.segment import segment
from btfcore.dense.transfer import transfer
from btfcore.dense.unwrap import _forces, _solve, face_shapes, mean_positions, net, relax, unfold
from btfcore.mesh.reader import read_mesh
from btfcore.mesh.topology import twins
from btfcore.types import Mesh
from tests.dense.atlas_laws import areas, covered_twice, surface
from tests.mesh.shapes import grid, sphere, torus


def mesh_of(shape):
    return Mesh(np.asarray(shape[0], float), np.asarray(shape[1], np.int32))


def rolled(rows=12, columns=30):
    """A sheet rolled up to three quarters of a cylinder: developable."""
    vertices, faces = grid(rows, columns)
    angle = 1.5 * np.pi * vertices[:, 0] / (columns - 1)
    radius = (columns - 1) / (1.5 * np.pi)
    x, z = radius * np.sin(angle), radius * np.cos(angle)
    return mesh_of((np.stack([x, vertices[:, 1], z], axis=1), faces))


def joined(mesh, chart=None):
    chart = np.zeros(len(mesh.faces), np.int32) if chart is None else chart
    shape, weight = face_shapes(mesh)
    return net(chart, twins(mesh.faces), shape, weight)


def blank(some):
    return np.zeros(some.count, complex), np.zeros(some.count, bool)


def edges_of(some, position):
    return position[np.roll(some.corner, -1, axis=1)] - position[some.corner]


def test_a_developable_sheet_unfolds_exactly():
    some = joined(rolled())
    position, known = blank(some)
    unfold(some, position, known)
    assert known.all()
    np.testing.assert_allclose(np.abs(edges_of(some, position)), np.abs(some.shape), rtol=1e-9)


def test_relaxing_makes_a_distorted_sheet_rigid_again():
    some = joined(rolled())
    position, known = blank(some)
    unfold(some, position, known)
    bent = position * 1.2 + 0.3 * np.sin(position.real) + 0.2j * np.cos(position.imag)
    flat = relax(some, bent, rounds=200, steps=50)
    np.testing.assert_allclose(np.abs(edges_of(some, flat)), np.abs(some.shape), rtol=1e-3)


def test_chart_vertices_are_fans_within_charts():
    mesh = mesh_of(torus())
    chart = (mesh.vertices[mesh.faces].mean(axis=1)[:, 2] > 0).astype(np.int32)
    some = joined(mesh, chart)
    rim = np.intersect1d(mesh.faces[chart == 0], mesh.faces[chart == 1])
    assert some.count == len(mesh.vertices) + len(rim)


def test_a_subset_of_charts_is_joined_like_the_whole():
    mesh = mesh_of(torus())
    chart = (mesh.vertices[mesh.faces].mean(axis=1)[:, 2] > 0).astype(np.int32)
    shape, weight = face_shapes(mesh)
    whole = joined(mesh, chart)
    upper = np.flatnonzero(chart == 1)
    part = net(chart, twins(mesh.faces), shape, weight, upper)
    assert part.count == len(np.unique(whole.corner[upper]))
    assert np.array_equal(whole.twin.reshape(-1, 3)[upper] < 0, part.twin.reshape(-1, 3) < 0)


def test_forces_turn_each_face_to_fit():
    some = joined(mesh_of(sphere(6, 8)))
    random = np.random.default_rng(0)
    position = random.normal(size=some.count) + 1j * random.normal(size=some.count)
    force = np.empty_like(position)
    _forces(some.corner, some.shape, some.weight, position, force)
    edge = edges_of(some, position)
    fit = (some.weight * edge * some.shape.conj()).sum(axis=1)
    pull = some.weight * (fit / np.abs(fit))[:, None] * some.shape
    wanted = np.zeros_like(position)
    np.add.at(wanted, np.roll(some.corner, -1, axis=1), pull)
    np.add.at(wanted, some.corner, -pull)
    np.testing.assert_allclose(force, wanted, atol=1e-12)


def test_conjugate_gradients_solve():
    random = np.random.default_rng(1)
    root = coo_array(random.normal(size=(40, 40)) * (random.random((40, 40)) < 0.1))
    matrix = (root @ root.T + coo_array(np.eye(40))).tocsr()
    force, place = random.normal(size=(40, 2)), np.zeros((40, 2))
    _solve(matrix.indptr, matrix.indices, matrix.data, 1 / matrix.diagonal(), force, place, 500)
    np.testing.assert_allclose(place, spsolve(matrix.tocsc(), force), atol=1e-4)


def test_mean_positions_take_the_faces_that_are_usable():
    some = joined(mesh_of(grid(2, 2)))
    place = np.arange(6).reshape(2, 3) + 0j
    position, known = mean_positions(some, place, np.array([True, False]))
    assert np.array_equal(position[some.corner[0]], place[0]) and known.sum() == 3


def stretched(mesh, matrix):
    """Quality of a flat mesh moved by a 2 x 2 matrix."""
    shape, _ = face_shapes(mesh)
    flat = mesh.vertices[mesh.faces][..., :2] @ np.asarray(matrix, float).T
    place = np.ascontiguousarray(flat[..., 0] + 1j * flat[..., 1])
    return measure(np.zeros(len(mesh.faces), np.int32), 1, shape, place)


def test_quality_knows_singular_values_and_mirrors():
    mesh = mesh_of(grid(5, 9))
    turn = [[0.6, -0.8], [0.8, 0.6]]
    found = stretched(mesh, turn)
    assert not fails(found).any() and found.strain[0] < 1e-20 and found.mirrored[0] == 0
    assert np.isclose(found.fill[0], 1, atol=0.2)
    found = stretched(mesh, np.array(turn) @ np.diag([1.3, 0.9]))
    assert np.isclose(found.strain[0], 0.09 + 0.01) and found.bad[0] == 0
    found = stretched(mesh, np.diag([1.6, 1.0]))
    assert found.bad[0] == 1
    found = stretched(mesh, np.diag([-1.0, 1.0]))
    assert found.mirrored[0] == 1 and fails(found).all() and found.culprit[0, 0] >= 0


def test_overlaps_are_found_with_two_faces_that_overlap():
    mesh = mesh_of(grid(3, 21))
    shape, _ = face_shapes(mesh)
    flat = mesh.vertices[mesh.faces][..., :2].copy()
    moved = flat[..., 0].mean(axis=1) > 15
    flat[moved, :, 0] -= 10
    place = np.ascontiguousarray(flat[..., 0] + 1j * flat[..., 1])
    found = measure(np.zeros(len(mesh.faces), np.int32), 1, shape, place)
    assert np.isclose(found.overlap[0], 1 / 3, atol=0.05)
    one, two = found.culprit[0]
    assert moved[two] != moved[one]


def ramp(turn, rows=4, columns=160):
    """A ring that rises a little while it turns: from a full turn on it lies over its own start."""
    vertices, faces = grid(rows, columns)
    angle, radius = turn * vertices[:, 0] / (columns - 1), 1 + vertices[:, 1] / (rows - 1)
    corners = [radius * np.cos(angle), -radius * np.sin(angle), 0.02 * angle]
    return mesh_of((np.stack(corners, axis=1), faces[:, ::-1]))


def own_plan(mesh):
    """A mesh as one chart, seen from above."""
    flat = mesh.vertices[mesh.faces][..., :2] * [1, -1]
    flat = flat if areas(flat).sum() > 0 else flat * [1, -1]
    return Charts(mesh, flat, np.zeros(len(mesh.faces), np.int32))


@pytest.mark.parametrize(("turn", "overlapping"), [(6.2, False), (6.293, True), (6.5, True)])
def test_a_ring_that_overlaps_itself_by_a_sliver_is_cut(turn, overlapping):
    plan = own_plan(ramp(turn))
    assert (covered_twice(plan).sum() > 0) == overlapping
    charts = flatten_charts(plan.mesh, plan.chart, plan.uv)
    assert (charts.count > 1) == overlapping
    assert covered_twice(charts).max() <= 4


def test_no_chart_of_a_real_mesh_lies_over_itself(data):
    mesh, _ = read_mesh(data / "meshes" / "skull.obj")
    assert covered_twice(chart_mesh(mesh)).max() <= 4


def test_overlaps_are_counted_like_point_by_point():
    random = np.random.default_rng(4)
    place = random.normal(size=(60, 3, 2)) * 0.2 + random.random((60, 1, 2))
    chart = random.integers(0, 3, 60).astype(np.int32)
    order = np.argsort(chart, kind="stable")
    bounds = np.searchsorted(chart[order], np.arange(4))
    culprit = np.full((3, 2), -1, np.int32)
    signed = areas(place) * -1
    step = 0.004
    found = _overlaps(place, signed, order, bounds, step, culprit)
    for c in range(3):
        mine = place[chart == c]
        low, high = mine.min(axis=(0, 1)), mine.max(axis=(0, 1))
        size = ((high - low) / step).astype(int) + 1
        x, y = np.meshgrid(*(low[k] + step * np.arange(size[k]) for k in range(2)))
        times = np.zeros(x.shape, int)
        for face in mine:
            sides = [
                (face[k, 0] - face[k - 1, 0]) * (y - face[k, 1])
                - (face[k, 1] - face[k - 1, 1]) * (x - face[k, 0])
                for k in range(3)
            ]
            times += (np.min(sides, axis=0) > 0) | (np.max(sides, axis=0) < 0)
        wanted = (times - 1).clip(0).sum() / (times > 0).sum()
        assert np.isclose(found[c], wanted, rtol=1e-4)
        assert (chart[culprit[c]] == c).all() and culprit[c, 0] != culprit[c, 1]


def graph(label, twin):
    """Twin of `connected`, by scipy, on faces with equal labels."""
    here = np.flatnonzero(twin >= 0)
    one, two = here // 3, twin[here] // 3
    same = label[one] == label[two]
    size = len(label)
    matrix = coo_array((np.ones(same.sum()), (one[same], two[same])), shape=(size, size))
    return connected_components(matrix, directed=False)


def test_connected_parts_are_those_of_the_graph():
    mesh = mesh_of(torus())
    label = np.random.default_rng(2).integers(0, 3, len(mesh.faces)).astype(np.int32)
    count, wanted = graph(label, twins(mesh.faces))
    found = connected(label, twins(mesh.faces))
    assert found.max() + 1 == count == len(np.unique(np.stack([found, wanted]), axis=1).T)
    first = np.unique(found, return_index=True)[1]
    assert (np.diff(first) > 0).all()


def test_fill_reaches_every_face_and_moves_none():
    mesh = mesh_of(torus())
    label = np.full(len(mesh.faces), -1, np.int32)
    label[[3, 200]] = [5, 7]
    full = fill(label, twins(mesh.faces))
    assert set(full) == {5, 7} and full[3] == 5 and full[200] == 7
    assert fill(np.full(8, -1, np.int32), twins(grid(3, 3)[1])).tolist() == [0] * 8


def test_smoothing_takes_off_teeth():
    _, faces = grid(8, 8)
    twin = twins(faces)
    label = np.zeros(len(faces), np.int32)
    label[20] = 1
    assert not smooth(label, twin).any() and label[20] == 1


def test_absorption_leaves_no_small_part_and_lengths_add_up():
    mesh = mesh_of(torus())
    twin, area = twins(mesh.faces), surface(mesh)
    corner = mesh.vertices[mesh.faces]
    length = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).ravel()
    label = np.random.default_rng(3).integers(0, 40, len(mesh.faces)).astype(np.int32)
    a, b, shared = borders(label, twin, length)
    apart = label.repeat(3) != label[twin // 3]
    assert np.isclose(shared.sum(), length[apart].sum()) and (a != b).all()
    least = 0.05 * area.sum()
    joined_labels = absorb(label, twin, area, length, least=least)
    assert np.bincount(joined_labels, area).min() >= least
    assert np.array_equal(joined_labels, connected(joined_labels, twin))


def test_bisection_makes_two_connected_halves_around_the_seeds():
    mesh = mesh_of(torus())
    twin = twins(mesh.faces)
    label = np.zeros(len(mesh.faces), np.int32)
    for seeds in ([0, 250], [-1, -1]):
        halves = bisect(label, twin, np.array([0], np.int32), np.array([seeds], np.int32))
        assert set(halves) == {0, 1} and connected(halves, twin).max() == 1
        assert np.bincount(halves).min() > 0.25 * len(label)
        assert seeds[0] < 0 or halves[0] != halves[250]


@pytest.mark.parametrize("shape", [torus(), sphere(), grid(6, 9)])
def test_segmentation_gives_every_face_a_chart_that_faces_one_way(shape):
    mesh = mesh_of(shape)
    chart, uv, usable = segment(mesh)
    assert chart.min() == 0 and len(np.unique(chart)) == chart.max() + 1
    assert (areas(uv)[usable] > 0).all() and usable.mean() > 0.9


def test_charts_that_cannot_lie_flat_are_cut():
    mesh = mesh_of(sphere())
    whole = np.zeros(len(mesh.faces), np.int32)
    flat = mesh.vertices[mesh.faces][..., :2] * [1, -1]
    charts = flatten_charts(mesh, whole, flat)
    assert 2 <= charts.count < 40
    assert (areas(charts.uv) > 0).all()
    shape, _ = face_shapes(mesh)
    place = np.ascontiguousarray(charts.uv[..., 0] - 1j * charts.uv[..., 1])
    assert not fails(measure(charts.chart, charts.count, shape, place)).any()


def test_small_charts_of_a_plane_are_joined():
    mesh = mesh_of(grid(25, 25))
    mosaic = (np.arange(len(mesh.faces)) // 20).astype(np.int32)
    parts = connected(mosaic, twins(mesh.faces)).max() + 1
    charts = flatten_charts(mesh, mosaic, mesh.vertices[mesh.faces][..., :2] * [1, -1])
    assert charts.count < 0.1 * parts
    assert np.isclose(areas(charts.uv).sum(), 24 * 24)


def test_charts_are_carried_from_a_proxy_to_the_mesh():
    coarse, fine = mesh_of(grid(4, 4)), mesh_of(grid(13, 13))
    fine = Mesh(fine.vertices / 4, fine.faces)
    half = (coarse.vertices[coarse.faces].mean(axis=1)[:, 0] > 1.5).astype(np.int32)
    flat = coarse.vertices[coarse.faces][..., :2] * [1, -1]
    proxy = flatten_charts(coarse, half, flat)
    middle = fine.vertices[fine.faces].mean(axis=1)
    centre = coarse.vertices[coarse.faces].mean(axis=1)
    nearest = np.linalg.norm(middle[:, None] - centre[None], axis=2).argmin(axis=1)
    chart, uv, usable = transfer(proxy, fine, nearest.astype(np.int32))
    assert chart.max() == proxy.chart.max() and usable.mean() > 0.9
    np.testing.assert_allclose(areas(uv), surface(fine), rtol=1e-6)
