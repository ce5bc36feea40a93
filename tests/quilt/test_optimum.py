"""The engine against exact optima: every cut of real runs, every placement of small ones."""

import numpy as np
import pytest

from btfcore.quilt import candidates
from btfcore.quilt.fitting import fit
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.synthesize import Synthesizer
from tests.bench.optimum import audited, crop, excess
from tests.quilt.test_fitting import value
from tests.surfaces import blobs, constant_field, plane, random_field, sphere

MOST = 13  # nodes of a graph that is enumerated: 8192 labellings
BOUND = 3.0  # of the cost chosen over the least


class Enumerated:
    """`fit` as an oracle has it: all 2^n labellings of its nodes, edge by edge."""

    def __init__(
        self, indptr, indices, order, inner, local, place, patch, source, ghost, grid, band
    ):
        self.indptr, self.indices, self.order, self.inner = indptr, indices, order, inner
        self.local, self.place, self.patch = local, place, patch
        self.source, self.ghost, self.grid = source, ghost, grid
        height, width = grid.shape[:2]
        x, y = place.T
        self.covered = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
        bare = patch[order] < 0
        self.always = {int(v) for v in order[:inner][bare[:inner] & self.covered[:inner]]}
        self.free = self._reach(band)

    def _reach(self, band):
        """Old vertices that `band` steps through covered old ones join to the new part."""
        found, front = set(), set(self.always)
        for _ in range(band):
            front = {
                int(q)
                for p in front
                for q in self.indices[self.indptr[p] : self.indptr[p + 1]]
                if 0 <= self.local[q] < self.inner
                and self.covered[self.local[q]]
                and self.patch[q] >= 0
                and int(q) not in found
            }
            found |= front
        return sorted(found)

    def shown(self, i, j, at, new):
        """What i's side shows at `at`, i itself or its neighbour j."""
        if new:
            return value(self.grid, self.place[self.local[at]])
        if at == i:
            return value(self.grid, self.source[i])
        row = slice(self.indptr[i], self.indptr[i + 1])
        slot = self.indptr[i] + int(np.flatnonzero(self.indices[row] == j)[0])
        return value(self.grid, self.ghost[slot])

    def edge(self, i, j, new_i, new_j):
        """V of one edge; beyond the sample's border the near side counts twice."""
        if new_i == new_j and (new_i or self.patch[i] == self.patch[j]):
            return 0.0
        at = [i, j]
        if new_i != new_j:
            outer = j if new_i else i
            place = self.local[outer]
            if place < 0 or not self.covered[place]:
                at = [i if new_i else j] * 2
        return sum(
            np.linalg.norm(self.shown(i, j, v, new_i) - self.shown(j, i, v, new_j)) for v in at
        )

    def energies(self):
        """Σ V over the edges that are or may be cut, (2^n,), bit k being free[k]'s label."""
        count = len(self.free)
        bit = {v: k for k, v in enumerate(self.free)}
        label = (np.arange(2**count)[:, None] >> np.arange(count)) & 1
        total = np.zeros(2**count)
        for i in self.free:
            for j in map(int, self.indices[self.indptr[i] : self.indptr[i + 1]]):
                if j in bit and j < i:
                    continue
                if j not in bit and j not in self.always and self.patch[j] < 0:
                    continue
                mine = label[:, bit[i]]
                theirs = label[:, bit[j]] if j in bit else np.full(len(mine), j in self.always)
                cost = np.array([[self.edge(i, j, a, b) for b in (0, 1)] for a in (0, 1)])
                total += cost[mine, theirs.astype(int)]
        for i in self.always:  # seams that every labelling has
            for j in map(int, self.indices[self.indptr[i] : self.indptr[i + 1]]):
                if j not in bit and self.patch[j] >= 0:
                    total += self.edge(i, j, True, False)
        return total


@pytest.mark.parametrize(
    ("dense", "field", "knobs"),
    [
        (plane(13, 13), constant_field(plane(13, 13)), {"work_patch": 4, "band": 2}),
        (sphere(2), random_field(sphere(2), 1), {"work_patch": 4, "band": 1}),
        (sphere(2), constant_field(sphere(2)), {"work_patch": 4, "band": 1, "scale": 1.7}),
    ],
    ids=["plane", "wild sphere", "large pattern"],
)
def test_every_cut_of_a_run_is_the_cheapest_labelling(monkeypatch, dense, field, knobs):
    seen = {"graphs": 0, "old seams": 0, "beyond": 0, "choices": 0}

    def checked(*arguments, **several):
        cut = fit(*arguments, **several)
        *before, sheet, band = arguments
        oracle = Enumerated(*before, sheet.cut, band)
        if len(oracle.free) > MOST:
            return cut
        costs = oracle.energies()
        fresh = {int(v) for v in oracle.order[: oracle.inner][cut.fresh]}
        assert fresh - set(oracle.free) == oracle.always
        mine = sum(1 << k for k, v in enumerate(oracle.free) if v in fresh)
        assert costs[mine] == pytest.approx(costs.min(), abs=1e-4)
        assert cut.flow == pytest.approx(costs.min(), abs=1e-4)
        seen["graphs"] += 1
        seen["choices"] += len(oracle.free) > 1
        seen["old seams"] += len({int(oracle.patch[v]) for v in oracle.free}) > 1
        seen["beyond"] += not oracle.covered.all()
        return cut

    monkeypatch.setattr(candidates, "fit", checked)
    for seed in range(3):
        engine = Synthesizer(dense, field, blobs(12, 12), QuiltParameters(seed=seed, **knobs))
        engine.run()
    assert min(seen.values()) > 3, seen


@pytest.mark.parametrize("turns", [(0.0,), (-10.0, 0.0, 10.0)])
@pytest.mark.parametrize("seed", range(2))
def test_no_pick_is_cheaper_than_the_best_of_all_placements(seed, turns):
    """Without sub-texel shifts every pick is among those enumerated, so it costs no less."""
    knobs = QuiltParameters(seed=seed, sway=0.0, carry_on=0, swing=turns, margin=6.0)
    picks = audited(blobs(24, 24, seed=seed), knobs, side=14, turns=turns)
    assert len(picks) > 3 and max(pick.vertices for pick in picks) > 80
    for pick in picks:
        assert pick.chosen >= pick.least - 1e-6
    assert excess(picks) < BOUND


def test_a_crop_is_the_middle():
    whole = blobs(20, 30)
    part = crop(whole, 8)
    assert np.array_equal(part.channels, whole.channels[6:14, 11:19])
