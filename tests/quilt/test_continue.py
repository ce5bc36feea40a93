"""A quilt may be stopped anywhere and gone on with, in memory and from a stored map."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.errors import Cancelled, InvalidQuilt
from btfcore.quilt.measure import measure_seams
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.state import QuiltState
from btfcore.quilt.synthesize import Synthesizer
from tests.surfaces import blobs, constant_field, plane, sphere


def stop_at(share):
    def progress(fraction, label):
        if fraction >= share:
            raise Cancelled

    return progress


def bits(quilt):
    return [getattr(quilt, name).tobytes() for name in ("source", "angle", "sample", "patch")]


def partial(engine, share):
    with pytest.raises(Cancelled):
        engine.run(progress=stop_at(share))
    quilt = engine.state.quilt(engine.grid)
    assert 0 < (quilt.patch >= 0).mean() < 1
    return quilt


@pytest.mark.parametrize(
    "knobs", [{}, {"max_seam": 0.3}, {"scale": 0.5, "swing": (-5.0, 0.0, 5.0)}]
)
def test_stopped_and_run_again_gives_the_same_bits(knobs):
    dense = sphere(5)
    field, sample = constant_field(dense), blobs()
    whole = Synthesizer(dense, field, sample, QuiltParameters(**knobs)).run()
    engine = Synthesizer(dense, field, sample, QuiltParameters(**knobs))
    stops = 0
    for share in (0.0, 0.1, 0.25, 0.26, 0.5, 0.75, 0.9, 0.99):
        try:
            engine.run(progress=stop_at(share))
        except Cancelled:
            stops += 1
    again = engine.run()
    assert stops >= 6
    assert (again.patch >= 0).all() and engine.statistics.covered == 1.0
    assert bits(again) == bits(whole)
    assert bits(engine.run()) == bits(whole)  # nothing is left to do


def test_preparing_can_be_cancelled_too():
    dense, heard = sphere(4), []
    field = constant_field(dense)
    Synthesizer(dense, field, blobs(), QuiltParameters(), progress=lambda f, label: heard.append(f))
    assert heard == sorted(heard) and 0 <= heard[0] and heard[-1] <= 1
    with pytest.raises(Cancelled):
        Synthesizer(dense, field, blobs(), QuiltParameters(), progress=stop_at(heard[-1]))


@pytest.mark.parametrize("scale", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("make", [lambda: sphere(5), lambda: plane(60, 70)], ids=["ball", "plane"])
def test_ghosts_of_a_stored_quilt_are_where_they_were(make, scale):
    dense = make()
    engine = Synthesizer(dense, constant_field(dense), blobs(96, 96), QuiltParameters(scale=scale))
    quilt = engine.run()
    built = QuiltState.from_quilt(engine.net, engine.grid, quilt)
    state, net = engine.state, engine.net
    assert np.array_equal(built.patch, state.patch) and built.patches == state.patches
    assert np.abs(built.source - state.source).max() < 1e-3
    tail = np.repeat(np.arange(len(net.indptr) - 1), np.diff(net.indptr))
    seam = state.patch[tail] != state.patch[net.indices]
    off = np.linalg.norm((built.ghost - state.ghost)[seam], axis=1) * engine.grid.unit
    assert seam.sum() > 100
    assert np.median(off) < 0.05 and np.quantile(off, 0.99) < 0.6  # in dense-mesh steps
    assert measure_seams(net, built, engine.grid).per_edge == pytest.approx(
        measure_seams(net, state, engine.grid).per_edge, rel=0.05, abs=1e-4
    )


def test_a_lonely_vertex_goes_by_its_angle():
    dense = plane(5, 5)
    engine = Synthesizer(dense, constant_field(dense), blobs(), QuiltParameters())
    bare = engine.state.quilt(engine.grid)
    patch, source, angle = bare.patch.copy(), bare.source.copy(), bare.angle.copy()
    patch[12], source[12], angle[12] = 3, (20, 30), np.radians(90)
    built = QuiltState.from_quilt(
        engine.net, engine.grid, replace(bare, patch=patch, source=source, angle=angle)
    )
    assert built.patches == 4
    for slot in range(engine.net.indptr[12], engine.net.indptr[13]):
        row, column = np.divmod(engine.net.indices[slot], 5) - np.array([2, 2])
        # +column lies 90° counter-clockwise of the field, which is +x: up on the plane
        away = np.array([-row, column]) / dense.step
        assert built.ghost[slot] == pytest.approx([20, 30] + away, abs=1e-3)


def test_a_stored_quilt_is_gone_on_with():
    dense = sphere(5)
    field, sample = constant_field(dense), blobs()
    first = Synthesizer(dense, field, sample, QuiltParameters())
    begun = partial(first, 0.4)
    engine = Synthesizer(dense, field, sample, QuiltParameters(), start=begun)
    done = engine.run()
    assert (done.patch >= 0).all() and np.isfinite(done.source).all()
    assert engine.continued == begun.patch.max() + 1
    assert min(engine.ledger) >= engine.continued
    deep = (begun.patch >= 0) & (done.patch == begun.patch)
    assert deep.sum() > 0.5 * (begun.patch >= 0).sum()  # what a new seam did not take stays
    assert np.abs(done.source - begun.source)[deep].max() < 1e-4
    first.run()
    whole = measure_seams(first.net, first.state, first.grid).per_vertex
    assert measure_seams(engine.net, engine.state, engine.grid).per_vertex < 1.3 * whole


def test_a_whole_quilt_gone_on_with_stays_as_it_is():
    dense = sphere(4)
    field = constant_field(dense)
    done = Synthesizer(dense, field, blobs(), QuiltParameters()).run()
    again = Synthesizer(dense, field, blobs(), QuiltParameters(), start=done).run()
    assert bits(again) == bits(done)


def test_a_bare_quilt_is_a_start_like_none():
    dense = sphere(4)
    field = constant_field(dense)
    engine = Synthesizer(dense, field, blobs(), QuiltParameters())
    bare = engine.state.quilt(engine.grid)
    begun = Synthesizer(dense, field, blobs(), QuiltParameters(), start=bare)
    assert bits(begun.run()) == bits(engine.run())


@pytest.mark.parametrize(
    ("change", "knobs", "sample", "words"),
    [
        ({"patch": np.zeros(7, np.int32)}, {}, blobs(), "quilt of 7 vertices, the mesh has 2562"),
        ({}, {}, blobs(24, 24), r"positions lie outside a sample of 24 x 24"),
        ({}, {"scale": 4.0}, blobs(), "another scale"),
        ({"sample": np.full(2562, 2, np.uint16)}, {}, blobs(), "names sample 2"),
    ],
)
def test_a_quilt_of_something_else_is_refused(change, knobs, sample, words):
    dense = sphere(4)
    field = constant_field(dense)
    done = Synthesizer(dense, field, blobs(), QuiltParameters()).run()
    with pytest.raises(InvalidQuilt, match=words):
        Synthesizer(dense, field, sample, QuiltParameters(**knobs), start=replace(done, **change))


def test_a_placement_that_reaches_nothing_does_not_hang_the_run(monkeypatch):
    """Whatever matching answers, every vertex is covered by finite positions in the sample."""
    dense = sphere(4)
    engine = Synthesizer(dense, constant_field(dense), blobs(), QuiltParameters())
    best, calls = engine._finder.best, []

    def beside(patch, running):
        found = best(patch, running)
        calls.append(0)
        if len(calls) % 3 == 0:
            return found
        nothing = replace(found.cut, fresh=np.zeros_like(found.cut.fresh), gained=0)
        return replace(found, cut=nothing)

    monkeypatch.setattr(engine._finder, "best", beside)
    quilt = engine.run()
    assert (quilt.patch >= 0).all()
    assert (quilt.source >= 0).all() and (quilt.source <= 63).all()
    assert "forced" in {entry.reason for entry in engine.ledger.values()}
