"""Geodesic discs: exact on the plane, near enough on the sphere, and they grow on in place."""

import numpy as np
import pytest

from btfcore.patch.connectivity import connect
from btfcore.patch.disc import disc, grown
from tests.surfaces import constant_field, cylinder, plane, sphere


def net_of(dense, direction=(1.0, 0.0, 0.0)):
    net = connect(dense, constant_field(dense, direction))
    return net, np.full(len(dense.vertices), -1, np.int32)


def reference(net, seed, radius, sweeps=2):
    """The same map by dictionaries and complex numbers."""
    rows = [net.indices[net.indptr[v] : net.indptr[v + 1]] for v in range(len(net.indptr) - 1)]
    edge = net.edge[:, 0].astype(float) + 1j * net.edge[:, 1].astype(float)
    turn = net.turn[:, 0].astype(float) + 1j * net.turn[:, 1].astype(float)
    place, frame, way, order = {seed: 0j}, {seed: 1 + 0j}, {seed: 0.0}, [seed]

    def predict(vertex, known):
        votes, spins = [], 0j
        for slot, other in enumerate(rows[vertex], start=int(net.indptr[vertex])):
            if other in known:
                spin = frame[other] * np.conj(turn[slot])
                votes.append(place[other] - spin * edge[slot])
                spins += spin
        place[vertex], frame[vertex] = np.mean(votes), spins / abs(spins)

    level = [seed]
    while level:
        known, found = set(order), []
        for vertex in level:
            if abs(place[vertex]) <= radius and way[vertex] <= 1.5 * radius:
                found += [int(v) for v in rows[vertex] if v not in known and v not in found]
        for vertex in found:
            predict(vertex, known)
            slots = enumerate(rows[vertex], start=int(net.indptr[vertex]))
            way[vertex] = min(way[v] + abs(edge[at]) for at, v in slots if v in known)
        order, level = order + found, found
    for _ in range(sweeps):
        for vertex in order[1:]:
            predict(vertex, set(order))
    return order, np.array([place[v] for v in order])


@pytest.mark.parametrize("surface", [plane(30, 30), sphere(3), cylinder(24, 20)])
def test_the_kernel_is_its_plain_twin(surface):
    net, local = net_of(surface, (0.6, 0.3, 0.7))
    for seed, radius in ((0, 3.0), (len(surface.vertices) // 2, 6.5)):
        found = disc(net, local, seed, radius, 10**6)
        order, place = reference(net, seed, radius)
        assert found.order.tolist() == order
        assert np.allclose(found.plane, np.stack([place.real, place.imag], 1), atol=1e-9)
        assert (local == -1).all()


def test_on_a_plane_it_is_the_plane():
    dense = plane(61, 61)
    net, local = net_of(dense)
    seed = 30 * 61 + 30
    found = disc(net, local, seed, 20.0, 10**6)
    true = (dense.vertices[found.order] - dense.vertices[seed])[:, :2] / dense.step
    assert np.allclose(found.plane, true, atol=1e-3)
    inside = np.hypot(*((dense.vertices - dense.vertices[seed])[:, :2] / dense.step).T) <= 19.9
    assert np.isin(np.flatnonzero(inside), found.order).all()
    assert len(found.order) < 1.3 * inside.sum()
    assert not found.full


def test_on_a_sphere_distances_from_the_centre_are_those_of_great_circles():
    dense = sphere(5)
    net, local = net_of(dense)
    found = disc(net, local, 7, 25.0, 10**6)
    cosine = (dense.vertices[found.order] * dense.vertices[7]).sum(axis=1)
    true = np.arccos(np.clip(cosine, -1, 1)) / dense.step
    assert np.abs(np.hypot(*found.plane.T) - true).max() < 0.05 * 25


def test_growing_on_moves_nothing_and_reaches_as_far():
    dense = sphere(5)
    net, local = net_of(dense)
    small = disc(net, local, 11, 12.0, 10**6)
    large = grown(net, local, small, 20.0, 10**6)
    count = len(small.order)
    assert large.order[:count].tolist() == small.order.tolist()
    assert large.plane[:count].tobytes() == small.plane.tobytes()
    assert large.frame[:count].tobytes() == small.frame.tobytes()
    whole = disc(net, local, 11, 20.0, 10**6)
    closed = set(whole.order[~whole.open].tolist())
    assert len(closed - set(large.order.tolist())) < 0.02 * len(closed)
    for vertex in large.order[~large.open]:
        near = net.indices[net.indptr[vertex] : net.indptr[vertex + 1]]
        assert np.isin(near, large.order).all()


def test_it_ends_where_the_surface_does_or_at_the_limit():
    dense = sphere(2)
    net, local = net_of(dense)
    whole = disc(net, local, 0, 1e3, 10**6)
    assert whole.full and not whole.open.any()
    assert sorted(whole.order.tolist()) == list(range(len(dense.vertices)))
    some = disc(net, local, 0, 1e3, 30)
    assert some.full and some.open.any() and 30 < len(some.order) < len(dense.vertices)
    assert np.isfinite(whole.plane).all()
