"""Cutting again: the graph against brute force, and its costs against the measure's own."""

import itertools

import numpy as np
import pytest

from btfcore.patch.connectivity import connect
from btfcore.quilt.metric import distance, half_edge
from btfcore.quilt.recut import recut, vertex_costs
from btfcore.quilt.sheet import single
from tests.quilt.test_fitting import COLUMNS, ROWS, scene, value
from tests.surfaces import constant_field, plane


def energy(new, inner, net, grid, patch, source, ghost, place, tails, bias):
    """Σ V over edges with an end in `inner`, as it is measured: every half-edge by itself."""
    near = np.array(
        [bool({int(i), int(j)} & inner) for i, j in zip(tails, net.indices, strict=True)]
    )
    part = (np.asarray(tails)[near], net.indices[near], ghost[near])
    return sum(bias[v] for v in new) + _edges(new, *part, grid, patch, source, place)


def _edges(new, tails, heads, ghosts, grid, patch, source, place):
    total = 0.0
    for i, j, ghost in zip(tails, heads, ghosts, strict=True):
        if patch[i] < 0 or patch[j] < 0:
            continue
        if (i in new) == (j in new) and (i in new or patch[i] == patch[j]):
            continue
        shown = place[j] if i in new else ghost
        there = place[j] if j in new else source[j]
        total += float(np.linalg.norm(value(grid, shown) - value(grid, there)))
    return total


def energies(free, inner, net, grid, patch, source, ghost, place, tails, bias):
    """`energy` of every labelling of the vertices `free`, (2^n,), the last one changing first."""
    labels = np.zeros((2 ** len(free), len(patch)), np.int8)
    labels[:, free] = list(itertools.product((0, 1), repeat=len(free)))
    total = labels[:, free] @ np.array([bias[v] for v in free])
    for i, j in {(int(i), int(j)) for i, j in zip(tails, net.indices, strict=True)}:
        if {i, j} & inner:
            slots = [k for k in range(len(tails)) if (tails[k], net.indices[k]) == (i, j)]
            part = (np.asarray(tails)[slots], net.indices[slots], ghost[slots])
            cost = np.zeros((2, 2))
            for one, two in itertools.product((0, 1), repeat=2):
                new = {v for v, label in ((i, one), (j, two)) if label}
                cost[one, two] = _edges(new, *part, grid, patch, source, place)
            total += cost[labels[:, i], labels[:, j]]
    return total


@pytest.mark.parametrize("biased", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_recut_is_the_cheapest_of_all_labellings(seed, biased):
    random = np.random.default_rng(seed)
    net, grid, patch, source, ghost, place, tails = scene(random, 0.15)
    count = ROWS * COLUMNS
    order = [12]
    for vertex in order:
        for other in net.indices[net.indptr[vertex] : net.indptr[vertex + 1]]:
            if other not in order and len(order) < 13:
                order.append(int(other))
    inner = len(order)
    order = np.array(order + [v for v in range(count) if v not in order], np.int32)
    local = np.empty(count, np.int32)
    local[order] = np.arange(count)
    bias = random.normal(0, 0.3, inner) * biased
    cut = recut(
        net.indptr, net.indices, order, inner, local, place[order], patch, source, ghost, grid,
        bias,
    )  # fmt: skip
    free = [
        int(v)
        for v in order[:inner]
        if patch[v] >= 0
        and 0 <= place[v, 0] <= grid.shape[1] - 1
        and 0 <= place[v, 1] <= grid.shape[0] - 1
    ]
    of = dict(zip(order[:inner].tolist(), bias.tolist(), strict=True))
    known = (set(order[:inner].tolist()), net, grid, patch, source, ghost, place, tails, of)
    mine = {int(v) for v in order[:inner][cut.fresh]}
    assert mine <= set(free)
    costs = energies(free, *known)
    some = np.random.default_rng(0).integers(0, len(costs), 5)
    for number in some.tolist():
        new = {v for k, v in enumerate(free[::-1]) if number >> k & 1}
        assert costs[number] == pytest.approx(energy(new, *known), abs=1e-9)
    assert energy(mine, *known) == pytest.approx(min(costs), abs=1e-5)
    assert cut.before - cut.after == pytest.approx(costs[0] - min(costs), abs=1e-5)
    assert cut.after <= cut.before + 1e-9


def test_without_bias_before_and_after_are_the_seams_own_costs():
    random = np.random.default_rng(3)
    net, grid, patch, source, ghost, place, tails = scene(random, 0.0)
    order = np.arange(25, dtype=np.int32)
    zero = np.zeros(25)
    cut = recut(net.indptr, net.indices, order, 25, order, place, patch, source, ghost, grid, zero)
    of = dict(enumerate(zero))
    known = (set(range(25)), net, grid, patch, source, ghost, place, tails, of)
    assert cut.before == pytest.approx(energy(set(), *known), abs=1e-5)
    mine = {int(v) for v in np.flatnonzero(cut.fresh)}
    assert cut.after == pytest.approx(energy(mine, *known), abs=1e-5)


def test_a_patch_without_synthesised_vertices_is_left_alone():
    random = np.random.default_rng(3)
    net, grid, patch, source, ghost, place, _ = scene(random, 0.0)
    order = np.arange(25, dtype=np.int32)
    cut = recut(
        net.indptr, net.indices, order, 25, order, place, np.full(25, -1, np.int32), source,
        ghost, grid, np.zeros(25),
    )  # fmt: skip
    assert not cut.fresh.any() and (cut.before, cut.after) == (0, 0)


def test_vertex_costs_against_a_twin():
    random = np.random.default_rng(9)
    net, grid, patch, source, ghost, _, tails = scene(random, 0.2)
    expected = np.zeros(25)
    for slot, (i, j) in enumerate(zip(tails, net.indices, strict=True)):
        if patch[i] >= 0 and patch[j] >= 0 and patch[i] != patch[j]:
            expected[i] += np.linalg.norm(value(grid, ghost[slot]) - value(grid, source[j]))
    some = random.permutation(25)[:17].astype(np.int32)
    found = vertex_costs(net.indptr, net.indices, some, patch, source, ghost, grid)
    assert found == pytest.approx(expected[some], abs=1e-5)


def test_distances_against_a_twin_also_beyond_the_border():
    random = np.random.default_rng(2)
    grid = random.random((7, 9, 4)).astype(np.float32)
    for _ in range(60):
        a, b = (random.random((2, 2)) * [13, 11] - 2).astype(np.float32)
        expected = np.linalg.norm(value(grid, a) - value(grid, b))
        sheet = single(grid)
        found = distance(sheet.cut, sheet.colour, sheet.frames, 0, *a, 0, *b)
        assert found == pytest.approx(expected, abs=1e-5)


def test_half_edges_are_found_both_ways():
    dense = plane(4, 5)
    net = connect(dense, constant_field(dense))
    tails = np.repeat(np.arange(20), np.diff(net.indptr))
    for slot, (i, j) in enumerate(zip(tails, net.indices, strict=True)):
        assert half_edge(net.indptr, net.indices, i, j) == slot
    assert half_edge(net.indptr, net.indices, 0, 19) == -1
