"""Laws of the refinement: never dearer, repeatable, and valid wherever it is stopped."""

import numpy as np
import pytest

from btfcore.errors import Cancelled, InvalidParameter
from btfcore.progress import silent
from btfcore.quilt.extend import extensions
from btfcore.quilt.measure import measure_seams
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.refine import _Refiner, refine
from btfcore.quilt.state import QuiltState
from btfcore.quilt.synthesize import Synthesizer
from btfcore.quilt.worst import GIVE_UP, REST, WorstSeams, ball
from btfcore.types import Sample
from tests.surfaces import blobs, constant_field, plane, sphere

ARRAYS = ("source", "patch", "ghost", "angle")


def quilted(sample=None, seed=0, upto=1.0):
    """Engine with a finished quilt of a sphere, or one cancelled at the share `upto`."""
    dense = sphere(5)
    engine = Synthesizer(
        dense, constant_field(dense), sample or blobs(), QuiltParameters(seed=seed)
    )

    def stop(fraction, label):
        if upto < 1.0 and fraction > upto:
            raise Cancelled

    try:
        engine.run(progress=stop)
    except Cancelled:
        assert upto < 1.0
    return engine


def per_vertex(engine):
    return measure_seams(engine.net, engine.state, engine.grid).per_vertex


def bits(engine):
    return tuple(getattr(engine.state, name).tobytes() for name in ARRAYS)


def test_no_step_makes_a_seam_dearer_and_some_make_it_cheaper():
    engine = quilted()
    costs = [per_vertex(engine)]
    for _ in range(12):
        statistics = refine(engine, tries=1)
        assert statistics.before == pytest.approx(costs[-1], rel=1e-5)
        costs.append(per_vertex(engine))
        assert statistics.after == pytest.approx(costs[-1], rel=1e-5)
        assert costs[-1] <= costs[-2]
    statistics = refine(engine, tries=12)
    assert statistics.tries == 12
    assert per_vertex(engine) <= costs[-1] < costs[0]


def test_a_refined_quilt_is_a_sound_quilt():
    engine = quilted()
    statistics = refine(engine, tries=20)
    state, net = engine.state, engine.net
    assert statistics.accepted > 0 and state.patch.max() < state.patches
    assert (state.patch >= 0).all() and np.isfinite(state.angle).all()
    assert (state.source >= 0).all() and (state.source <= 63).all()
    tails = np.repeat(np.arange(len(state.patch)), np.diff(net.indptr))
    same = state.patch[tails] == state.patch[net.indices]
    assert np.array_equal(state.ghost[same], state.source[net.indices[same]])
    # neighbours of one patch are about as far apart in the sample as on the surface
    apart = np.linalg.norm(state.ghost - state.source[tails], axis=1)
    assert np.median(apart / np.linalg.norm(net.edge, axis=1)) == pytest.approx(1, abs=0.03)
    assert (engine._flattener.local == -1).all()


def test_same_tries_same_bits():
    one, two = quilted(seed=3), quilted(seed=3)
    first, second = refine(one, tries=10), refine(two, tries=10)
    assert bits(one) == bits(two) and first == second
    assert bits(one) != bits(quilted(seed=3))


def test_a_cut_that_is_no_cheaper_when_recounted_leaves_every_bit(monkeypatch):
    engine = quilted()
    before, patches = bits(engine), engine.state.patches
    asked = []
    monkeypatch.setattr(
        WorstSeams, "update", lambda self, changed: float(bool(asked.append(changed)))
    )
    statistics = refine(engine, tries=8)
    assert asked and statistics.accepted == 0
    assert bits(engine) == before and engine.state.patches == patches


def test_bare_vertices_stay_bare_and_the_run_can_go_on():
    engine = quilted(upto=0.6)
    bare = engine.state.patch < 0
    cost = per_vertex(engine)
    refine(engine, tries=10)
    assert bare.any() and np.array_equal(engine.state.patch < 0, bare)
    assert per_vertex(engine) <= cost
    assert (engine.run().patch >= 0).all()


@pytest.mark.parametrize("calls", [1, 9, 16])
def test_cancelling_leaves_a_valid_quilt(calls):
    engine = quilted()
    cost, seen = per_vertex(engine), []

    def stop(fraction, label):
        seen.append(fraction)
        if len(seen) > calls:
            raise Cancelled

    with pytest.raises(Cancelled):
        refine(engine, tries=30, progress=stop)
    assert seen == sorted(seen) and 0 <= seen[0] and seen[-1] <= 1
    assert per_vertex(engine) <= cost and (engine.state.patch >= 0).all()
    assert (engine._flattener.local == -1).all()
    tally = WorstSeams(engine.net, engine.state, engine.grid.cut)
    assert refine(engine, tries=0).after * 2 * len(
        engine.state.patch
    ) * engine.grid.random_difference == pytest.approx(tally.total())


def test_no_budget_no_step_and_a_spent_one_ends():
    engine = quilted()
    before = bits(engine)
    assert refine(engine, seconds=0.0).tries == 0
    assert refine(engine, tries=0).tries == 0
    assert bits(engine) == before
    assert refine(engine, seconds=0.5, tries=2).tries <= 2


def test_without_a_seam_there_is_nothing_to_do():
    flat = np.full((32, 32, 3), 0.5, np.float32)
    engine = quilted(Sample("flat", flat, flat))
    before = bits(engine)
    assert refine(engine).tries == 0
    assert bits(engine) == before


def test_it_ends_by_itself_when_nothing_improves():
    dense = plane(16, 16)
    engine = Synthesizer(dense, constant_field(dense), blobs(12, 12), QuiltParameters())
    engine.run()
    refine(engine)
    assert refine(engine, tries=3).after <= refine(engine, tries=0).before


@pytest.mark.parametrize("budget", [{"seconds": -1.0}, {"seconds": float("nan")}, {"tries": -2}])
def test_impossible_budgets_are_named(budget):
    with pytest.raises(InvalidParameter, match=next(iter(budget))):
        refine(quilted(upto=0.01), **budget)


@pytest.mark.parametrize("sample", [blobs(3, 40), blobs(8, 8), blobs(20, 200)])
def test_awkward_samples_are_refined_all_the_same(sample):
    engine = quilted(sample)
    cost = per_vertex(engine)
    refine(engine, tries=6)
    assert per_vertex(engine) <= cost and (engine.state.patch >= 0).all()


def test_costs_and_scores_kept_up_to_date_are_those_counted_anew():
    engine = quilted()
    run = _Refiner(engine, 0, silent)
    gained = sum(run.improve(*run.worst.pick(), silent) for _ in range(8))
    anew = WorstSeams(engine.net, engine.state, engine.grid.cut)
    assert gained
    near = np.abs(engine.state.angle) < np.radians(engine.parameters.near_field)
    assert run._near == near.sum()
    assert np.array_equal(run.worst.cost, anew.cost)
    assert run.worst.score == pytest.approx(anew.score)
    assert anew.score[anew.pick()[0]] == anew.score.max()


def test_balls_against_a_twin():
    dense = sphere(3)
    engine = Synthesizer(dense, constant_field(dense), blobs(), QuiltParameters())
    net, seen = engine.net, np.zeros(642, np.bool_)
    for seeds, levels in (([5], 0), ([5], 3), ([1, 600, 77], 2)):
        found = set(seeds)
        for _ in range(levels):
            found |= {int(q) for p in found for q in net.indices[net.indptr[p] : net.indptr[p + 1]]}
        got = ball(net.indptr, net.indices, np.array(seeds, np.int32), levels, seen)
        assert got.tolist() == sorted(found) and not seen.any()


def test_a_place_that_failed_rests_and_is_given_up_in_the_end():
    engine = quilted()
    worst = WorstSeams(engine.net, engine.state, engine.grid.cut)
    first, failures = worst.pick()
    assert failures == 0
    worst.failed(np.array([first], np.int32))
    assert all(worst.pick()[0] != first for _ in range(REST))
    everything = np.arange(len(engine.state.patch), dtype=np.int32)
    for _ in range(GIVE_UP - 1):
        worst.failed(everything)
        assert worst.pick()[0] >= 0  # all rest, so the rest is cut short
    worst.failed(everything)
    assert worst.pick() == (-1, 0)


def test_extending_a_patch_finds_its_own_motion():
    random = np.random.default_rng(0)
    points = random.normal(0, 9, 60) + 1j * random.normal(0, 9, 60)
    turn, centre = 0.3, 20.0 - 31.0j
    there = centre + np.exp(1j * turn) * points
    state = QuiltState(
        np.stack([there.real, -there.imag], axis=1).astype(np.float32),
        np.repeat([4, 7, -1], [30, 25, 5]).astype(np.int32),
        np.zeros((0, 2), np.float32), np.zeros(60, np.float32),
    )  # fmt: skip
    found = extensions(state, np.arange(60, dtype=np.int32), points, 3)
    assert len(found) == 2
    for at in found:
        assert (at.column, at.row, at.turn) == pytest.approx((20, 31, 0.3), abs=1e-4)
        assert at.cost < 1e-9
