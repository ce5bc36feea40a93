"""Constrained graphcut against brute force, by the definitions of Zhou §IV-A alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from btfcore.paint.constrained import energy, feature_of, seam_count, unit_of
from btfcore.paint.palette import palette_of
from btfcore.quilt.recut import recut
from tests.paint.tiny import COUNT, FREE, Scene, made, textured


@pytest.mark.parametrize("weight", [0.0, 0.5, 4.0])
@pytest.mark.parametrize("seed", range(6))
def test_the_cut_is_the_cheapest_of_all_labellings(seed, weight):
    its = made(seed, off=5.0 * (seed % 3))
    unit = its.palette.normaliser(its.mine)
    costs = its.all_energies(weight, unit)
    core = set(its.core.tolist())
    for number in np.random.default_rng(0).integers(0, len(costs), 3).tolist():
        data, smooth = its.parts(its.labelling(number), core)
        assert weight * data + smooth / unit == pytest.approx(costs[number], abs=1e-9)
    cut = its.cut(weight)
    fresh = set(its.core[cut.fresh].tolist())
    assert fresh <= set(its.free)
    data, smooth = its.parts(fresh, core)
    assert weight * data + smooth / unit == pytest.approx(costs.min(), abs=1e-6)
    assert (cut.before - cut.after) / unit == pytest.approx(costs[0] - costs.min(), abs=1e-6)
    assert cut.after <= cut.before + 1e-9


def test_scenes_hold_all_that_may_happen():
    """Old seams of one and of two samples, bare vertices, rims, placements off the sample."""
    scenes = [made(seed, off=5.0 * (seed % 3)) for seed in range(6)]
    assert {its.mine for its in scenes} == {0, 1}
    assert min(len(its.free) for its in scenes) >= 3
    assert any(len(its.free) < (its.state.patch[its.core] >= 0).sum() for its in scenes)
    assert any((its.state.patch[its.core] < 0).any() for its in scenes)
    for its in scenes:
        a, b = its.tails, its.net.indices
        inside = np.isin(a, its.core) & np.isin(b, its.core)
        seam = inside & (its.state.patch[a] != its.state.patch[b])
        assert (seam & (its.state.sample[a] != its.state.sample[b])).any()
    assert any(0 < len(set(its.core[its.cut(0.5).fresh].tolist())) < FREE for its in scenes)


@pytest.mark.parametrize("several", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_energy_of_the_result_is_that_of_the_definition(seed, several):
    its = made(seed, several=several)
    unit = its.palette.normaliser(its.mine)
    every = set(range(COUNT))
    before = energy(its.net, its.state, its.palette, its.mine, its.target)
    data, smooth = its.parts(set(), every)
    assert before.constraint == pytest.approx(data, abs=1e-5)
    assert before.smooth == pytest.approx(smooth / unit, abs=1e-5)
    cut = its.cut(0.5)
    fresh = set(its.core[cut.fresh].tolist())
    data, smooth = its.parts(fresh, every)
    local = np.empty(COUNT, np.int32)
    local[its.order] = np.arange(COUNT)
    its.state.accept(
        its.net, its.order, local, its.place[its.order], cut.fresh, np.zeros(its.inner), its.mine
    )
    after = energy(its.net, its.state, its.palette, its.mine, its.target)
    assert after.constraint == pytest.approx(data, abs=1e-5)
    assert after.smooth == pytest.approx(smooth / unit, abs=1e-5)
    assert after.total(0.5) == 0.5 * after.constraint + after.smooth
    gain = (cut.before - cut.after) / unit
    assert before.total(0.5) - after.total(0.5) == pytest.approx(gain, abs=1e-5)


def test_energies_of_disjoint_sets_add_up():
    its = made(2)
    whole = energy(its.net, its.state, its.palette, its.mine, its.target)
    sets = np.array_split(np.random.default_rng(1).permutation(COUNT).astype(np.int32), 4)
    parts = [
        energy(its.net, its.state, its.palette, its.mine, its.target[each], each) for each in sets
    ]
    assert sum(part.constraint for part in parts) == pytest.approx(whole.constraint, abs=1e-9)
    assert sum(part.smooth for part in parts) == pytest.approx(whole.smooth, abs=1e-9)
    assert sum(part.seam_edges for part in parts) == whole.seam_edges
    patch = its.state.patch
    seams = {
        (i, j) for i, j in its.slot if i < j and patch[i] >= 0 <= patch[j] and patch[i] != patch[j]
    }
    assert whole.seam_edges == len(seams)
    assert seam_count(its.net, patch, np.arange(COUNT, dtype=np.int32)) == 2 * len(seams)


@pytest.mark.parametrize("seed", range(4))
def test_forced_and_frozen_vertices_are_obeyed_at_least_cost(seed):
    its = made(seed)
    unit = its.palette.normaliser(its.mine)
    some = np.random.default_rng(seed).permutation(its.free)
    forced, frozen = set(some[:3].tolist()), set(some[3:6].tolist())
    cut = its.cut(
        0.5, forced=np.isin(its.core, list(forced)), frozen=np.isin(its.core, list(frozen))
    )
    fresh = set(its.core[cut.fresh].tolist())
    assert forced <= fresh and not fresh & frozen
    costs = its.all_energies(0.5, unit)
    allowed = [
        cost
        for number, cost in enumerate(costs.tolist())
        if forced <= its.labelling(number) and not its.labelling(number) & frozen
    ]
    data, smooth = its.parts(fresh, set(its.core.tolist()))
    assert 0.5 * data + smooth / unit == pytest.approx(min(allowed), abs=1e-6)


def test_frozen_outweighs_forced():
    its = made(1)
    everyone = np.ones(its.inner, np.bool_)
    assert not its.cut(0.5, forced=everyone, frozen=everyone).fresh.any()


@pytest.mark.parametrize("seed", range(4))
def test_a_strict_cut_brings_no_feature_where_none_is_wanted(seed):
    its = made(seed)
    its.target = np.where(its.target > 0.6, 1.0, 0.0)
    new = np.array([its.mask(its.mine, its.place[v]) for v in its.core])
    barred = {
        int(v)
        for v, m in zip(its.core, new, strict=True)
        if m > 0.05 and its.target[v] < 0.05
    }  # fmt: skip
    fresh = set(its.core[its.cut(4.0, strict=True).fresh].tolist())
    assert barred and not fresh & barred
    costs = its.all_energies(4.0, its.palette.normaliser(its.mine))
    allowed = [c for n, c in enumerate(costs.tolist()) if not its.labelling(n) & barred]
    data, smooth = its.parts(fresh, set(its.core.tolist()))
    unit = its.palette.normaliser(its.mine)
    assert 4.0 * data + smooth / unit == pytest.approx(min(allowed), abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_without_weight_it_is_plain_graphcut(seed):
    its = made(seed)
    local = np.empty(COUNT, np.int32)
    local[its.order] = np.arange(COUNT)
    plain = recut(
        its.net.indptr, its.net.indices, its.order, its.inner, local, its.place[its.order],
        its.state.patch, its.state.source, its.state.ghost, its.palette.sheet,
        np.zeros(its.inner), owner=its.state.sample, mine=its.mine,
    )  # fmt: skip
    bound = its.cut(0.0)
    assert np.array_equal(plain.fresh, bound.fresh)
    assert (plain.before, plain.after) == (bound.before, bound.after)


@pytest.mark.parametrize("seed", range(4))
def test_with_all_weight_every_vertex_is_as_wanted_where_the_placement_allows(seed):
    its = made(seed, off=3.0)
    cut = its.cut(1e6)
    fresh = set(its.core[cut.fresh].tolist())
    better = {v for v in its.free if its.data(v, True) < its.data(v, False) - 1e-4}
    worse = {v for v in its.free if its.data(v, True) > its.data(v, False) + 1e-4}
    assert better and better <= fresh and not fresh & worse


def test_more_weight_never_leaves_more_constraint_energy():
    for seed in range(4):
        its = made(seed)
        core = set(its.core.tolist())
        found = [
            its.parts(set(its.core[its.cut(weight).fresh].tolist()), core)
            for weight in (0.0, 0.05, 0.25, 0.5, 1.0, 4.0, 100.0)
        ]
        data, smooth = np.array(found).T
        assert (np.diff(data) <= 1e-6).all() and (np.diff(smooth) >= -1e-5).all()


def test_the_cut_does_not_depend_on_the_unit_of_the_channels():
    """V and u grow together, so one λ serves samples of any contrast."""
    its = made(3)
    bright = tuple(replace(each, channels=5 * each.channels) for each in its.samples)
    loud = Scene(
        its.net, palette_of(bright, [1.0] * len(bright)), bright, its.state, its.order, its.inner,
        its.place, its.target, its.mine,
    )  # fmt: skip
    assert loud.palette.normaliser(0) == pytest.approx(5 * its.palette.normaliser(0), rel=1e-5)
    one, other = its.cut(0.5), loud.cut(0.5)
    assert np.array_equal(one.fresh, other.fresh)
    assert other.before == pytest.approx(5 * one.before, rel=1e-5)


def test_the_unit_is_twice_the_mean_distance_of_feature_and_background():
    its = made(0)
    for index, sample in enumerate(its.samples):
        inside = sample.channels[sample.mask > 0.5].astype(np.float64)
        outside = sample.channels[sample.mask < 0.05].astype(np.float64)
        pairs = np.linalg.norm(inside[:, None] - outside[None], axis=-1)
        assert unit_of(its.palette, index) == pytest.approx(2 * pairs.mean(), rel=0.02)


def test_a_sample_without_feature_is_measured_by_random_pairs():
    plain = replace(textured("plain", 4, (30, 40)), mask=None)
    flat = plain.channels.reshape(-1, 3).astype(np.float64)
    pairs = np.linalg.norm(flat[:, None] - flat[None], axis=-1).mean()
    assert unit_of(palette_of([plain], [1.0]), 0) == pytest.approx(2 * pairs, rel=0.05)


def test_features_of_other_samples_do_not_satisfy_the_constraint():
    its = made(0)
    others = its.state.sample != its.mine
    every = np.arange(COUNT, dtype=np.int32)
    covered = its.state.patch >= 0
    wanted, idle = np.ones(COUNT), np.zeros(COUNT)
    asked = feature_of(its.state, its.palette, its.mine, every, wanted)
    shown = feature_of(its.state, its.palette, its.mine, every, idle)
    assert (shown[others & covered] > 0.5).any() and not asked[others].any()
    assert np.array_equal(asked[~others], shown[~others])
    assert not shown[~covered].any()


def test_where_features_shall_stay_all_of_them_count():
    """As everywhere that nothing is asked for: what a vertex shows is what it shows."""
    its = made(1)
    every = np.arange(COUNT, dtype=np.int32)
    found = energy(its.net, its.state, its.palette, its.mine, its.target, any_sample=True)
    shown = feature_of(its.state, its.palette, its.mine, every, np.zeros(COUNT))
    covered = its.state.patch >= 0
    assert found.constraint == pytest.approx(np.abs(shown - its.target)[covered].sum())
    strict = energy(its.net, its.state, its.palette, its.mine, its.target)
    assert found.constraint < strict.constraint and found.smooth == strict.smooth
    halved = energy(its.net, its.state, its.palette, its.mine, its.target, unit=2 * unit_of(
        its.palette, its.mine
    ))  # fmt: skip
    assert halved.smooth == pytest.approx(strict.smooth / 2)


def test_over_another_material_the_larger_difference_is_the_unit():
    own = textured("own", 2, (24, 30))
    near = textured("near", 3, (24, 30))
    far = replace(near, channels=near.channels - 4)
    palette = palette_of([own, near, far], [1.0] * 3)
    alone = unit_of(palette, 0)
    assert unit_of(palette, 0, [0]) == alone
    inside = own.channels[own.mask > 0.5].astype(np.float64)
    outside = far.channels[far.mask <= 0.5].astype(np.float64)
    pairs = np.linalg.norm(inside[:, None] - outside[None], axis=-1)
    assert unit_of(palette, 0, [0, 1, 2]) == pytest.approx(2 * pairs.mean(), rel=0.02)
    assert unit_of(palette, 0, [1]) >= alone
