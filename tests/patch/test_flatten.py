"""Laws of work patches: growth, flattening, tears, distortion."""

import numpy as np
import pytest

from btfcore.patch.connectivity import adjacency, connect, faces_at_vertices, turning_rate
from btfcore.patch.distortion import field_directions, sound_levels
from btfcore.patch.expmap import exponential_map
from btfcore.patch.flatten import Flattener
from btfcore.patch.grow import grow, release
from btfcore.patch.lscm import lscm, patch_faces
from btfcore.patch.relax import relax
from btfcore.types import Field
from tests.patch.dijkstra_map import exponential_map as dijkstra_map
from tests.surfaces import constant_field, cylinder, dense_mesh, plane, random_field, sphere


def flat(dense, field, seed, levels):
    net = connect(dense, field)
    local = np.full(len(dense.vertices), -1, np.int32)
    order, start = grow(net.indptr, net.indices, seed, levels, local, 10**9)
    return net, local, order, start


def length_error(net, order, local, points):
    worst = []
    for here, vertex in enumerate(order):
        for slot in range(net.indptr[vertex], net.indptr[vertex + 1]):
            other = local[net.indices[slot]]
            if other >= 0:
                drawn = np.linalg.norm(points[other] - points[here])
                worst.append(drawn - np.linalg.norm(net.edge[slot]))
    return float(np.sqrt(np.mean(np.square(worst))))


def test_adjacency_is_the_set_of_edges():
    faces = sphere(2).faces
    indptr, indices = adjacency(faces, int(faces.max()) + 1)
    pairs = {
        tuple(p) for p in np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    }
    pairs |= {(b, a) for a, b in pairs}
    rows = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
    assert {(int(a), int(b)) for a, b in zip(rows, indices, strict=True)} == pairs
    pointer, face_of = faces_at_vertices(faces, len(indptr) - 1)
    for vertex in (0, 7, 100):
        mine = face_of[pointer[vertex] : pointer[vertex + 1]]
        assert list(mine) == list(np.flatnonzero((faces == vertex).any(axis=1)))


def test_smaller_patch_is_prefix_of_larger():
    dense = sphere(4)
    net, local, order, start = flat(dense, constant_field(dense), 5, 9)
    release(order, local)
    assert (local == -1).all()
    small, _ = grow(net.indptr, net.indices, 5, 4, local, 10**9)
    assert np.array_equal(small, order[: start[5]])


def test_levels_are_graph_distances():
    dense = plane(15, 17)
    net, local, order, start = flat(dense, constant_field(dense), 100, 6)
    distance = np.full(len(dense.vertices), 99)
    distance[100] = 0
    for level in range(6):  # twin: plain relaxation
        for vertex in np.flatnonzero(distance == level):
            near = net.indices[net.indptr[vertex] : net.indptr[vertex + 1]]
            distance[near] = np.minimum(distance[near], level + 1)
    for level in range(7):
        assert set(order[start[level] : start[level + 1]]) == set(np.flatnonzero(distance == level))


@pytest.mark.parametrize("make", [constant_field, random_field])
def test_exponential_map_of_a_plane_is_the_plane(make):
    dense = plane(40, 50, one_chart=False)
    field = make(dense)
    net, local, order, start = flat(dense, field, 1020, 15)
    points, frame = exponential_map(
        net.indptr, net.indices, net.edge, net.turn, order, start, local
    )
    seed = int(order[0])
    tangent = field.tangents[seed].astype(np.float64)
    side = np.cross([0, 0, 1.0], tangent)
    offset = (dense.vertices[order] - dense.vertices[seed]) / dense.step
    wanted = np.stack([offset @ tangent, offset @ side], axis=1)
    assert np.abs(points - wanted).max() < 1e-4
    direction = field.tangents[order].astype(np.float64)
    drawn = np.stack([direction @ tangent, direction @ side], axis=1)
    assert np.abs(frame - drawn).max() < 1e-5
    seen = field_directions(net.indptr, net.indices, net.edge, order, len(order), local, points)
    assert np.abs(seen - drawn).max() < 1e-3


def test_exponential_map_of_a_cylinder_keeps_lengths():
    dense = cylinder(90, 60)
    net, local, order, start = flat(dense, random_field(dense), 30 * 90 + 7, 20)
    points, _ = exponential_map(net.indptr, net.indices, net.edge, net.turn, order, start, local)
    assert length_error(net, order, local, points) < 0.01


def test_exponential_map_keeps_geodesic_distance_on_a_sphere():
    dense = sphere(5)
    net, local, order, start = flat(dense, random_field(dense), 3000, 25)
    points, _ = exponential_map(net.indptr, net.indices, net.edge, net.turn, order, start, local)
    axis = dense.vertices[order[0]]
    geodesic = np.arccos(np.clip(dense.vertices[order] @ axis, -1, 1)) / dense.step
    radius = np.linalg.norm(points, axis=1)
    assert np.abs(radius - geodesic).max() < 0.01 * geodesic.max()


def test_levels_are_no_worse_than_dijkstra_s_order():
    dense = sphere(5)
    rough = np.random.default_rng(1).normal(1, 0.004, (len(dense.vertices), 1))
    dense = dense_mesh(dense.vertices * rough, dense.faces)
    net, local, order, start = flat(dense, random_field(dense), 3000, 25)
    points, _ = exponential_map(net.indptr, net.indices, net.edge, net.turn, order, start, local)
    reference, _ = dijkstra_map(net.indptr, net.indices, net.edge, net.turn, order, local)
    mine = length_error(net, order, local, points)
    assert mine < 1.05 * length_error(net, order, local, reference)


def test_relaxation_comes_nearer_to_isometry():
    dense = sphere(5)
    net, local, order, start = flat(dense, constant_field(dense), 3000, 30)
    points, _ = exponential_map(net.indptr, net.indices, net.edge, net.turn, order, start, local)
    eased = relax(net.indptr, net.indices, net.edge, order, local, points, 3, 30)
    assert length_error(net, order, local, eased) < 0.8 * length_error(net, order, local, points)
    assert np.abs(eased[0]).max() == 0


def test_a_map_that_meets_itself_is_torn_and_cut():
    dense = cylinder(24, 80)
    field = constant_field(dense, (0, 1.0, 0))
    net, local, order, start = flat(dense, field, 40 * 24, 20)
    points, _ = exponential_map(net.indptr, net.indices, net.edge, net.turn, order, start, local)
    sound, _ = sound_levels(
        net.indptr, net.indices, net.face_ptr, net.face_of, net.faces, net.area, net.edge,
        order, start, local, points, 4.0, 0.005, 1.3, 1.0,
    )  # fmt: skip
    assert 6 <= sound <= 12  # the disk closes around the cylinder at 12 levels


def test_flattener_takes_the_chart_where_it_can():
    dense = plane(60, 60)
    field = constant_field(dense)
    flattener = Flattener(dense, field, connect(dense, field))
    patch = flattener.flatten(30 * 60 + 30, 10)
    assert patch.kind == "chart" and patch.radius == 10 and patch.shrinks == 0
    offset = (dense.vertices[patch.order] - dense.vertices[1830])[:, :2] / dense.step
    assert np.abs(patch.plane - offset).max() < 1e-5
    flattener.release(patch)
    assert (flattener.local == -1).all()


@pytest.mark.parametrize("literal", [False, True])
def test_flattener_shrinks_to_a_sound_patch(literal):
    dense = cylinder(24, 80)
    field = constant_field(dense, (0, 1.0, 0))
    net = connect(dense, field)
    flattener = Flattener(dense, field, net, literal=literal)
    patch = flattener.flatten(40 * 24, 24)
    assert patch.shrinks > 0 and 4 <= patch.radius < 12
    mapped = flattener.local[patch.order]
    assert np.array_equal(mapped, np.arange(len(patch.order)))
    assert (flattener.local >= 0).sum() == len(patch.order)
    assert length_error(net, patch.order, flattener.local, patch.plane) < 0.15


def test_lscm_of_a_developable_patch_agrees_with_the_exponential_map():
    dense = cylinder(120, 60)
    field = constant_field(dense, (0, 1.0, 0))
    net, local, order, start = flat(dense, field, 30 * 120, 12)
    points, _ = exponential_map(net.indptr, net.indices, net.edge, net.turn, order, start, local)
    faces = patch_faces(net.faces, net.face_ptr, net.face_of, order, local)
    normal = dense.normals[order[0]].astype(np.float64)
    conformal = lscm(
        dense.vertices[order] / dense.step, faces, normal,
        field.tangents[order[0]].astype(np.float64),
    )  # fmt: skip
    used = np.isfinite(conformal).all(axis=1)
    assert used.mean() > 0.9
    assert np.abs(conformal[used] - points[used]).max() < 0.1


def test_turning_rate_of_a_field_that_turns_evenly():
    dense = plane(40, 40)
    angle = 0.05 * dense.vertices[:, 0]
    tangents = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1).astype(np.float32)
    net = connect(dense, Field(tangents, np.zeros((0, 3))))
    rate = turning_rate(net.indptr, net.indices, net.edge, net.turn, 0)
    inside = 20 * 40 + 20
    near = net.indices[net.indptr[inside] : net.indptr[inside + 1]]
    offset = dense.vertices[near] - dense.vertices[inside]
    # twin: angle between the two ends over the edge's length in steps
    length = np.linalg.norm(offset, axis=1) / dense.step
    assert rate[inside] == pytest.approx((0.05 * np.abs(offset[:, 0]) / length).mean(), rel=1e-3)
    spread = turning_rate(net.indptr, net.indices, net.edge, net.turn, 5)
    assert spread[inside] == pytest.approx(rate[inside], rel=1e-3)
