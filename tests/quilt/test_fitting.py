"""The real graph builder against brute force on tiny patches."""

import itertools

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from btfcore.patch.connectivity import connect
from btfcore.quilt.fitting import fit, near_bare
from tests.surfaces import constant_field, plane

ROWS, COLUMNS = 5, 5


def value(grid, place):
    place = np.asarray(place, np.float64)
    return np.array(
        [
            map_coordinates(grid[..., k], [[place[1]], [place[0]]], order=1, mode="nearest")[0]
            for k in range(grid.shape[2])
        ]
    )


def scene(random, bare_share):
    """A random quilt of two or three patches on a tiny plane, and a new placement."""
    dense = plane(ROWS, COLUMNS)
    net = connect(dense, constant_field(dense))
    count = ROWS * COLUMNS
    grid = random.random((12, 14, 3)).astype(np.float32)
    offset = np.stack([dense.vertices[:, 0], -dense.vertices[:, 1]], axis=1)
    shifts = random.random((4, 2)) * [8, 6] + 0.3
    patch = random.integers(0, 3, count).astype(np.int32)
    patch[random.random(count) < bare_share] = -1
    source = np.zeros((count, 2), np.float32)
    ghost = np.zeros((len(net.indices), 2), np.float32)
    tails = np.repeat(np.arange(count), np.diff(net.indptr))
    for vertex in np.flatnonzero(patch >= 0):
        source[vertex] = offset[vertex] + shifts[patch[vertex]]
    for slot, (i, j) in enumerate(zip(tails, net.indices, strict=True)):
        if patch[i] >= 0:
            ghost[slot] = offset[j] + shifts[patch[i]]
    place = (offset + shifts[3]).astype(np.float32)
    return net, grid, patch, source, ghost, place, tails


def energy(new, net, grid, patch, source, ghost, place, tails, reached):
    """Sum of V over all mesh edges for a labelling, by its definition alone."""
    total = 0.0
    slot_of = {(int(i), int(j)): k for k, (i, j) in enumerate(zip(tails, net.indices, strict=True))}

    def side(i, j, at):
        """What i's patch shows at `at` (i itself or its neighbour j)."""
        if i in new:
            return value(grid, place[at])
        return value(grid, source[i] if at == i else ghost[slot_of[i, j]])

    for i, j in slot_of:
        if i > j or not all(v in new or patch[v] >= 0 for v in (i, j)):
            continue
        if (i in new) == (j in new) and (i in new or patch[i] == patch[j]):
            continue
        # beyond the sample's border the new patch shows nothing: its near side counts twice
        if (i in new) != (j in new):
            outer = j if i in new else i
            inner = i if i in new else j
            if outer not in reached:
                total += 2 * np.linalg.norm(side(i, j, inner) - side(j, i, inner))
                continue
        total += np.linalg.norm(side(i, j, i) - side(j, i, i))
        total += np.linalg.norm(side(i, j, j) - side(j, i, j))
    return total


@pytest.mark.parametrize("seed", range(12))
def test_cut_is_the_cheapest_of_all_labellings(seed):
    random = np.random.default_rng(seed)
    net, grid, patch, source, ghost, place, tails = scene(random, 0.55)
    count = ROWS * COLUMNS
    # the patch proper: a random connected part, then everything else as ghosts
    order = [12]
    for vertex in order:
        for other in net.indices[net.indptr[vertex] : net.indptr[vertex + 1]]:
            if other not in order and len(order) < 17:
                order.append(int(other))
    inner = len(order)
    rest = [v for v in range(count) if v not in order]
    order = np.array(order + rest, np.int32)
    local = np.empty(count, np.int32)
    local[order] = np.arange(count)
    reached = {
        int(v)
        for v in range(count)
        if 0 <= place[v, 0] <= grid.shape[1] - 1 and 0 <= place[v, 1] <= grid.shape[0] - 1
    }
    cut = fit(
        net.indptr, net.indices, order, inner, local, place[order], patch, source, ghost, grid, 50
    )
    always = {int(v) for v in order[:inner] if patch[v] < 0 and int(v) in reached}
    assert set(order[:inner][cut.fresh]) >= always
    assert cut.gained == len(always)
    # only vertices joined to the bare ones through the overlap may change
    free, front = set(), set(always)
    while front:
        near = {
            int(q)
            for p in front
            for q in net.indices[net.indptr[p] : net.indptr[p + 1]]
            if int(q) in reached and patch[q] >= 0 and local[q] < inner
        }
        front = near - free
        free |= near
    free = sorted(free)
    assert len(free) <= 14
    scores = {}
    for labels in itertools.product((False, True), repeat=len(free)):
        new = always | {v for v, chosen in zip(free, labels, strict=True) if chosen}
        scores[frozenset(new)] = energy(new, net, grid, patch, source, ghost, place, tails, reached)
    mine = frozenset(int(v) for v in order[:inner][cut.fresh])
    best = min(scores.values())
    assert scores[mine] == pytest.approx(best, abs=1e-5)
    # the flow differs from the energy by the old seams no node can touch: a constant
    others = [v for v in scores.values()]
    assert cut.flow <= best + 1e-5 and best <= min(others) + 1e-9


def test_flow_is_the_energy_of_one_seam():
    """Without old seams or rims the flow is the seam's whole cost."""
    random = np.random.default_rng(5)
    dense = plane(5, 9)
    net = connect(dense, constant_field(dense))
    grid = random.random((14, 30, 3)).astype(np.float32)
    offset = np.stack([dense.vertices[:, 0], -dense.vertices[:, 1]], axis=1).astype(np.float32)
    patch = np.where(offset[:, 0] < 5, 0, -1).astype(np.int32)
    source = offset + np.float32(1.25)
    ghost = source[net.indices]
    order = np.arange(45, dtype=np.int32)
    place = offset + np.array([12.5, 3.25], np.float32)
    cut = fit(net.indptr, net.indices, order, 45, order, place, patch, source, ghost, grid, 50)
    tails = np.repeat(np.arange(45), np.diff(net.indptr))
    new = {int(v) for v in np.flatnonzero(cut.fresh)}
    total = energy(new, net, grid, patch, source, ghost, place, tails, set(range(45)))
    assert cut.flow == pytest.approx(total, abs=1e-5)


def test_same_placement_costs_nothing():
    dense = plane(6, 8)
    net = connect(dense, constant_field(dense))
    offset = np.stack([dense.vertices[:, 0], -dense.vertices[:, 1]], axis=1).astype(np.float32)
    grid = np.random.default_rng(0).random((10, 12, 3)).astype(np.float32)
    patch = np.where(offset[:, 0] < 4, 0, -1).astype(np.int32)
    order = np.arange(48, dtype=np.int32)
    cut = fit(
        net.indptr, net.indices, order, 48, order, offset, patch, offset, offset[net.indices],
        grid, 50,
    )  # fmt: skip
    assert cut.flow == pytest.approx(0, abs=1e-9)
    assert cut.fresh[patch < 0].all() and cut.missed == 0


@pytest.mark.parametrize("levels", [0, 2, 5])
def test_near_bare_against_plain_relaxation(levels):
    random = np.random.default_rng(levels)
    dense = plane(12, 14)
    net = connect(dense, constant_field(dense))
    patch = np.where(random.random(168) < 0.05, -1, 0).astype(np.int32)
    order = random.permutation(168)[:140].astype(np.int32)  # the rest lies outside the patch
    local = np.full(168, -1, np.int32)
    local[order] = np.arange(140)
    near = {int(v) for v in order if patch[v] < 0}
    for _ in range(levels):
        near |= {
            int(q)
            for p in near
            for q in net.indices[net.indptr[p] : net.indptr[p + 1]]
            if local[q] >= 0
        }
    found = near_bare(net.indptr, net.indices, order, local, patch, levels)
    assert {int(v) for v in order[found]} == near
