"""Cuts between patches of two samples, against brute force on tiny patches."""

import itertools

import numpy as np
import pytest

from btfcore.patch.connectivity import connect
from btfcore.quilt.fitting import fit
from btfcore.quilt.metric import distance
from btfcore.quilt.sheet import Sheet, sheet_of
from btfcore.types import Sample
from tests.quilt.test_fitting import value
from tests.surfaces import blobs, constant_field, plane

ROWS, COLUMNS = 5, 5


def stacked(*colours):
    """Sheet of pictures whose channels are their colours, so that all distances are alike."""
    width = max(each.shape[1] for each in colours)
    padded = [np.pad(each, ((0, 0), (0, width - each.shape[1]), (0, 0))) for each in colours]
    cut = np.concatenate(padded)
    first = np.cumsum([0, *(len(each) for each in colours[:-1])])
    frames = [[top, *each.shape] for top, each in zip(first, colours, strict=True)]
    return Sheet(cut, cut.copy(), np.array(frames, np.int32))


@pytest.mark.parametrize("seed", range(10))
def test_cut_between_samples_is_the_cheapest_of_all_labellings(seed):
    random = np.random.default_rng(seed)
    dense = plane(ROWS, COLUMNS)
    net = connect(dense, constant_field(dense))
    count = ROWS * COLUMNS
    colours = [random.random(shape).astype(np.float32) for shape in ((12, 14, 3), (10, 11, 3))]
    sheet = stacked(*colours)
    offset = np.stack([dense.vertices[:, 0], -dense.vertices[:, 1]], axis=1)
    shifts = random.random((4, 2)) * [6, 5] + 0.3
    patch = random.integers(0, 3, count).astype(np.int32)
    patch[random.random(count) < 0.55] = -1
    owner = (np.maximum(patch, 0) % 2).astype(np.uint16)
    mine = seed % 2
    tails = np.repeat(np.arange(count), np.diff(net.indptr))
    source = np.zeros((count, 2), np.float32)
    covered = patch >= 0
    source[covered] = (offset + shifts[patch])[covered]
    ghost = np.where(covered[tails, None], offset[net.indices] + shifts[patch[tails]], 0)
    ghost = ghost.astype(np.float32)
    place = (offset + shifts[3]).astype(np.float32)
    allowed = random.random(count) < 0.8
    order = [12]
    for vertex in order:
        for other in net.indices[net.indptr[vertex] : net.indptr[vertex + 1]]:
            if other not in order and len(order) < 17:
                order.append(int(other))
    inner = len(order)
    order = np.array(order + [v for v in range(count) if v not in order], np.int32)
    local = np.empty(count, np.int32)
    local[order] = np.arange(count)
    height, width = colours[mine].shape[:2]
    inside = (place >= 0).all(axis=1) & (place[:, 0] <= width - 1) & (place[:, 1] <= height - 1)
    cut = fit(
        net.indptr, net.indices, order, inner, local, place[order], patch, source, ghost, sheet,
        50, owner=owner, mine=mine, allowed=allowed,
    )  # fmt: skip
    may = inside & allowed
    always = {int(v) for v in order[:inner] if patch[v] < 0 and may[v]}
    assert cut.gained == len(always)
    assert not (set(order[:inner][cut.fresh].tolist()) - set(np.flatnonzero(may).tolist()))
    slot_of = {(int(i), int(j)): k for k, (i, j) in enumerate(zip(tails, net.indices, strict=True))}

    def side(new, i, j, at):
        if i in new:
            return value(colours[mine], place[at])
        where = source[i] if at == i else ghost[slot_of[i, j]]
        return value(colours[owner[i]], where)

    def energy(new):
        total = 0.0
        for i, j in slot_of:
            if i > j or not all(v in new or patch[v] >= 0 for v in (i, j)):
                continue
            if (i in new) == (j in new) and (i in new or patch[i] == patch[j]):
                continue
            if (i in new) != (j in new):
                near, far = (i, j) if i in new else (j, i)
                if not inside[far]:
                    step = side(new, i, j, near) - side(new, j, i, near)
                    total += 2 * np.linalg.norm(step)
                    continue
            for at in (i, j):
                total += np.linalg.norm(side(new, i, j, at) - side(new, j, i, at))
        return total

    free, front = set(), set(always)
    while front:
        near = {
            int(q)
            for p in front
            for q in net.indices[net.indptr[p] : net.indptr[p + 1]]
            if may[q] and patch[q] >= 0 and local[q] < inner
        }
        front = near - free
        free |= near
    scores = {}
    for labels in itertools.product((False, True), repeat=len(free)):
        new = always | {v for v, chosen in zip(sorted(free), labels, strict=True) if chosen}
        scores[frozenset(new)] = energy(new)
    chosen = frozenset(int(v) for v in order[:inner][cut.fresh])
    assert scores[chosen] == pytest.approx(min(scores.values()), abs=1e-5)


def test_distances_compare_channels_within_a_sample_and_colours_across():
    random = np.random.default_rng(3)
    one = blobs(20, 30, seed=1)
    two = Sample("factors", blobs(25, 16, seed=2).colour, random.random((25, 16, 7), np.float32))
    sheet = sheet_of([one, two], [1.0, 1.0], match_channels=4)
    assert sheet.frames.tolist() == [[0, 20, 30, 3], [20, 25, 16, 7]]
    colours = [one.colour, two.colour]
    for _ in range(60):
        a, b = (int(each) for each in random.integers(0, 2, 2))
        at, to = random.random((2, 2)) * 34 - 2
        if a == b:
            step = value(sheet.grids[a].cut, at) - value(sheet.grids[a].cut, to)
        else:
            step = value(colours[a], at) - value(colours[b], to)
        found = distance(sheet.cut, sheet.colour, sheet.frames, a, *at, b, *to)
        assert found == pytest.approx(np.linalg.norm(step), abs=1e-5)
