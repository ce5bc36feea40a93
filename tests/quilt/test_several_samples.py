"""Laws of a quilt of several samples."""

import numpy as np
import pytest

from btfcore.errors import Cancelled, InvalidParameter, InvalidQuilt
from btfcore.patch.connectivity import connect
from btfcore.quilt.layout import Borders, lay_out
from btfcore.quilt.measure import measure_by_sample, measure_seams
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.refine import refine
from btfcore.quilt.synthesize import Synthesizer
from btfcore.render.texture import vertex_colours
from btfcore.types import Sample
from tests.quilt.test_fitting import value
from tests.surfaces import blobs, constant_field, plane, sphere


def factors(seed=5):
    """A sample with other channels and another size than `blobs`."""
    colour = blobs(48, 72, seed=seed).colour
    mixed = np.einsum("hwc,ck->hwk", colour, np.random.default_rng(seed).random((3, 6)))
    return Sample("factors", colour, mixed.astype(np.float32))


@pytest.fixture(scope="module")
def ball():
    dense = sphere(5)
    field = constant_field(dense, (0, 0, 1.0))
    return dense, field, connect(dense, field)


def halves(dense):
    return (dense.vertices[:, 1] > 0.1).astype(np.int32)


def same(one, two):
    """Whether two quilts are the same bits."""
    return all(
        getattr(one, name).tobytes() == getattr(two, name).tobytes()
        for name in ("source", "angle", "patch", "sample")
    )


def run(ball, samples, region, numbers, borders, **knobs):
    dense, field, net = ball
    parameters = QuiltParameters(**knobs)
    layout = lay_out(net, region, numbers, borders, parameters.border)
    engine = Synthesizer(dense, field, samples, parameters, layout=layout)
    return engine, engine.run(), layout


@pytest.mark.parametrize("knobs", [{}, {"literal": True}, {"beside": 1, "reuse": 1.0}])
def test_one_sample_is_the_same_with_and_without_regions(ball, knobs):
    dense, field, _ = ball
    plain = Synthesizer(dense, field, blobs(), QuiltParameters(**knobs)).run()
    _, one, _ = run(ball, [blobs()], halves(dense), [0, 0], Borders.all(True), **knobs)
    assert same(plain, one)
    # and the same as the second of a sheet, where it has all vertices
    nowhere = np.ones(len(dense.vertices), np.int32)
    _, two, _ = run(ball, [factors(), blobs()], nowhere, [0, 1], Borders.all(False), **knobs)
    assert (two.sample == 1).all()
    for name in ("source", "angle", "patch"):
        assert getattr(plain, name).tobytes() == getattr(two, name).tobytes()


def test_hard_borders_are_kept_to_the_vertex(ball):
    dense = ball[0]
    region = halves(dense)
    engine, quilt, _ = run(ball, [blobs(), factors()], region, [0, 1], Borders.all(True))
    assert (quilt.patch >= 0).all() and engine.statistics.covered == 1.0
    assert np.array_equal(quilt.sample, region)
    assert measure_by_sample(engine.net, engine.state, engine.sheet)[1].seam_edges == 0
    for index, sample in enumerate((blobs(), factors())):
        height, width = sample.colour.shape[:2]
        at = quilt.source[quilt.sample == index]
        assert (at >= 0).all() and (at <= [width - 1, height - 1]).all()


def test_what_is_beyond_a_hard_border_makes_no_difference_to_its_seams(ball):
    """The energies of the two sides are those of two meshes of their own."""
    dense = ball[0]
    engine, _, _ = run(ball, [blobs(), factors()], halves(dense), [0, 1], Borders.all(True))
    tails = np.repeat(np.arange(len(dense.vertices)), np.diff(engine.net.indptr))
    assert (engine.state.sample[tails] == engine.state.sample[engine.net.indices]).all()


@pytest.mark.parametrize("width", [3, 12])
def test_soft_borders_stay_within_their_width(ball, width):
    dense = ball[0]
    region = halves(dense)
    engine, quilt, layout = run(
        ball, [blobs(), factors()], region, [0, 1], Borders.all(False), border=width
    )
    assert (quilt.patch >= 0).all()
    assert layout.allowed[quilt.sample, np.arange(len(region))].all()
    assert 0 < (quilt.sample != region).sum() < (layout.allowed.sum() - len(region)) * 0.9
    tails = np.repeat(np.arange(len(region)), np.diff(engine.net.indptr))
    mixed = quilt.sample[tails] != quilt.sample[engine.net.indices]
    assert measure_by_sample(engine.net, engine.state, engine.sheet)[1].seam_edges == (
        mixed.sum() // 2
    )


def test_a_soft_border_runs_where_colours_meet(ball):
    """Its seams are cheaper than those along the regions' own line."""
    dense = ball[0]
    region = halves(dense)
    costs = []
    for width in (0, 12):
        engine, _, _ = run(
            ball, [blobs(), factors()], region, [0, 1], Borders.all(False), border=width
        )
        costs.append(measure_by_sample(engine.net, engine.state, engine.sheet)[1].per_edge)
    assert costs[1] < 0.75 * costs[0]


def test_several_samples_are_deterministic_and_the_seed_matters(ball):
    region = halves(ball[0])
    quilts = [
        run(ball, [blobs(), factors()], region, [0, 1], Borders.all(False), seed=seed)[1]
        for seed in (1, 1, 2)
    ]
    assert same(quilts[0], quilts[1]) and not same(quilts[0], quilts[2])


def test_regions_down_to_single_vertices_are_covered():
    dense = sphere(4)
    field = constant_field(dense, (0, 0, 1.0))
    ball = dense, field, connect(dense, field)
    region = np.random.default_rng(0).integers(0, 3, len(dense.vertices)).astype(np.int32)
    for hard in (True, False):
        _, quilt, layout = run(
            ball, [blobs(), factors(), blobs(seed=3)], region, [0, 1, 2], Borders.all(hard)
        )
        assert (quilt.patch >= 0).all()
        assert layout.allowed[quilt.sample, np.arange(len(region))].all()
        assert not hard or np.array_equal(quilt.sample, region)
        assert np.isfinite(quilt.source).all()


def test_scales_are_the_samples_own():
    dense = plane(60, 120)
    field = constant_field(dense)
    region = (np.arange(len(dense.vertices)) % 120 >= 60).astype(np.int32)
    layout = lay_out(connect(dense, field), region, [0, 1], Borders.all(True), 12)
    scales = (0.5, 2.0)
    engine = Synthesizer(
        dense, field, [blobs(), blobs(seed=1)], QuiltParameters(), layout=layout, scales=scales
    )
    quilt = engine.run()
    a, b = dense.faces[:, 0], dense.faces[:, 1]
    length = np.linalg.norm(dense.vertices[a] - dense.vertices[b], axis=1)
    step = np.linalg.norm(quilt.source[a] - quilt.source[b], axis=1) / length
    for index, scale in enumerate(scales):
        inside = (quilt.patch[a] == quilt.patch[b]) & (quilt.sample[a] == index)
        assert np.median(step[inside]) * scale == pytest.approx(1, abs=0.05)


def test_seams_by_sample_against_a_twin(ball):
    dense = ball[0]
    samples = [blobs(), factors()]
    engine, quilt, _ = run(ball, samples, halves(dense), [0, 1], Borders.all(False))
    net, state = engine.net, engine.state
    tails = np.repeat(np.arange(len(dense.vertices)), np.diff(net.indptr))
    total, edges = np.zeros(3), np.zeros(3, int)
    for slot, (i, j) in enumerate(zip(tails, net.indices, strict=True)):
        if state.patch[i] == state.patch[j]:
            continue
        a, b = int(state.sample[i]), int(state.sample[j])
        grids = [engine.sheet.grids[k].cut if a == b else samples[k].colour for k in (a, b)]
        step = value(grids[0], state.ghost[slot]) - value(grids[1], state.source[j])
        total[a if a == b else 2] += np.linalg.norm(step)
        edges[a if a == b else 2] += 1
    parts, border = measure_by_sample(net, state, engine.sheet)
    for index, part in enumerate(parts):
        assert part.seam_edges == edges[index] // 2
        unit = engine.sheet.grids[index].texel_difference
        assert part.per_edge == pytest.approx(total[index] / edges[index] / unit, rel=1e-4)
    assert border.seam_edges == edges[2] // 2 > 0
    whole = measure_seams(net, state, engine.sheet)
    assert whole.seam_edges == edges.sum() // 2
    share = np.bincount(quilt.sample) / len(quilt.sample)
    assert whole.per_vertex == pytest.approx(
        sum(p.per_vertex * s for p, s in zip(parts, share, strict=True)) + border.per_vertex
    )


def test_colours_come_from_each_vertex_own_sample(ball):
    red = Sample("red", np.zeros((32, 32, 3), np.float32) + [1, 0, 0], blobs(32, 32).channels)
    blue = Sample("blue", np.zeros((40, 32, 3), np.float32) + [0, 0, 1], blobs(40, 32).channels)
    red, blue = (Sample(s.name, s.colour.astype(np.float32), s.channels) for s in (red, blue))
    region = halves(ball[0])
    _, quilt, _ = run(ball, [red, blue], region, [0, 1], Borders.all(True))
    colours = vertex_colours(quilt, [red, blue])
    assert (colours == np.eye(3, dtype=np.float32)[2 * region]).all()


def test_samples_must_fit_the_layout(ball):
    dense, field, net = ball
    layout = lay_out(net, halves(dense), [0, 1], Borders.all(True), 12)
    with pytest.raises(InvalidParameter, match="1 samples"):
        Synthesizer(dense, field, blobs(), QuiltParameters(), layout=layout)
    with pytest.raises(InvalidParameter, match="2 samples"):
        Synthesizer(dense, field, [blobs(), factors()], QuiltParameters())


@pytest.mark.parametrize("hard", [True, False])
def test_a_quilt_of_several_samples_can_be_continued(ball, hard):
    dense, field, net = ball
    layout = lay_out(net, halves(dense), [0, 1], Borders.all(hard), 12)
    samples, knobs = [blobs(), factors()], QuiltParameters()
    first = Synthesizer(dense, field, samples, knobs, layout=layout)

    def stop(fraction, label):
        if fraction > 0.75:
            raise Cancelled

    with pytest.raises(Cancelled):
        first.run(progress=stop)
    part = first.state.quilt(first.sheet)
    done = part.patch >= 0
    assert 0.4 < done.mean() < 1.0 and len(np.unique(part.sample[done])) == 2
    again = Synthesizer(dense, field, samples, knobs, layout=layout, start=part)
    quilt = again.run()
    assert (quilt.patch >= 0).all()
    assert layout.allowed[quilt.sample, np.arange(len(done))].all()
    with pytest.raises(InvalidQuilt, match="another region"):
        other = lay_out(net, 1 - halves(dense), [0, 1], Borders.all(True), 12)
        Synthesizer(dense, field, samples, knobs, layout=other, start=part)


@pytest.mark.parametrize("hard", [True, False])
def test_refinement_mends_each_sample_and_leaves_their_borders(ball, hard):
    samples = [blobs(), factors()]
    engine, quilt, layout = run(ball, samples, halves(ball[0]), [0, 1], Borders.all(hard))
    parts, border = measure_by_sample(layout.net, engine.state, engine.sheet)
    found = refine(engine, tries=24)
    assert found.accepted > 0 and found.after < found.before
    better, same_border = measure_by_sample(layout.net, engine.state, engine.sheet)
    costs = [(one.per_vertex, two.per_vertex) for one, two in zip(parts, better, strict=True)]
    assert all(after <= before * (1 + 1e-6) for before, after in costs), costs
    assert sum(after < before for before, after in costs) > 0
    assert border == same_border
    refined = engine.state.quilt(engine.sheet)
    assert np.array_equal(refined.sample, quilt.sample)
    again, _, _ = run(ball, samples, halves(ball[0]), [0, 1], Borders.all(hard))
    refine(again, tries=24)
    assert same(refined, again.state.quilt(again.sheet))


def test_a_cancelled_refinement_of_several_samples_leaves_a_whole_quilt(ball):
    engine, quilt, layout = run(
        ball, [blobs(), factors()], halves(ball[0]), [0, 1], Borders.all(False)
    )
    calls = []

    def stop(fraction, label):
        calls.append(fraction)
        if len(calls) > 40:
            raise Cancelled

    before = [
        part.per_vertex for part in measure_by_sample(layout.net, engine.state, engine.sheet)[0]
    ]
    with pytest.raises(Cancelled):
        refine(engine, progress=stop)
    after = [
        part.per_vertex for part in measure_by_sample(layout.net, engine.state, engine.sheet)[0]
    ]
    assert (engine.state.patch >= 0).all()
    assert all(a <= b * (1 + 1e-6) for a, b in zip(after, before, strict=True))
