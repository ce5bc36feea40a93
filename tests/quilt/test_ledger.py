"""What is noted of every patch, and which patches the report points at."""

import json
from dataclasses import replace

import numpy as np
import pytest

from btfcore.field import singularities
from btfcore.quilt.ledger import FEW_EDGES, REASONS, _seams, reductions, worst_patches
from btfcore.quilt.measure import measure_seams
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.synthesize import Synthesizer
from btfcore.types import Field, Sample
from tests.surfaces import blobs, constant_field, cylinder, dense_mesh, plane, random_field, sphere


def run(dense, sample=None, field=None, **knobs):
    field = constant_field(dense, (0, 0, 1.0)) if field is None else field
    engine = Synthesizer(dense, field, sample or blobs(), QuiltParameters(**knobs))
    engine.run()
    return engine, worst_patches(engine, dense, field)


def test_the_ledger_has_a_row_for_every_patch_that_adds_up():
    engine, _ = run(sphere(5))
    ledger, counts = engine.ledger, engine.statistics
    assert sorted(ledger) == list(range(counts.patches))
    assert sum(entry.gained for entry in ledger.values()) == len(engine.state.patch)
    for kind, number in counts.kinds.items():
        assert sum(entry.kind == kind for entry in ledger.values()) == number
    for entry in ledger.values():
        assert entry.wanted == engine.radius and 1 <= entry.radius <= entry.wanted
        assert entry.reason in REASONS and np.isfinite(entry.seam)
        assert (entry.radius < entry.wanted) <= bool(entry.reason)
    assert sum(reductions(ledger).values()) == sum(bool(e.reason) for e in ledger.values())


def test_seams_by_patch_add_up_to_those_of_the_quilt():
    engine, _ = run(sphere(5))
    number, cost = _seams(engine, engine.state.patches)
    seams = measure_seams(engine.net, engine.state, engine.grid)
    assert number.sum() == 2 * seams.seam_edges  # both patches count an edge
    assert cost.sum() == pytest.approx(2 * seams.per_edge * seams.seam_edges, rel=1e-6)


def test_the_dearest_come_first_with_place_and_words():
    dense = sphere(5)
    engine, rows = run(dense)
    assert 1 <= len(rows) <= 10
    json.dumps(rows, allow_nan=False)
    number, cost = _seams(engine, engine.state.patches)
    per_edge = np.where(number >= FEW_EDGES, cost / np.maximum(number, 1), 0)
    assert rows[0]["patch"] == per_edge.argmax()
    assert rows[0]["seam_per_edge"] == pytest.approx(per_edge.max())
    assert len({row["patch"] for row in rows}) == len(rows)
    for row in rows:
        assert row["position"] == dense.vertices[row["vertex"]].tolist()
        assert row["reason"] in REASONS.values()


@pytest.mark.parametrize(
    ("knobs", "key"), [({"max_seam": 0.05}, "seam"), ({"work_patch": 60}, "sample")]
)
def test_bounds_and_small_samples_are_named_as_reasons(knobs, key):
    engine, _ = run(plane(90, 90, one_chart=False), blobs(40, 40), **knobs)
    assert key in reductions(engine.ledger)


def test_a_turning_field_is_named():
    dense = sphere(5)
    engine, rows = run(dense, field=random_field(dense))
    assert "field" in reductions(engine.ledger)
    assert REASONS["field"] in {row["reason"] for row in rows}


def test_a_singularity_is_told_from_a_turn():
    dense = plane(90, 90, one_chart=False)
    away = dense.vertices - dense.vertices.mean(axis=0) - [0.25, 0.25, 0]
    tangents = (away / np.linalg.norm(away, axis=1)[:, None]).astype(np.float32)
    field = Field(tangents, singularities(dense, tangents))
    assert len(field.singularities) == 1
    _, rows = run(dense, field=field)
    near = [row for row in rows if row["reason"] == REASONS["singularity"]]
    assert near
    for row in near:
        away = np.linalg.norm(np.array(row["position"]) - field.singularities[0])
        assert away <= row["radius_wanted"] * dense.step


def test_a_tube_is_bent_and_a_crumb_is_small():
    tube = cylinder(20, 90)
    engine, rows = run(tube, blobs(96, 96), constant_field(tube, (0, 1, 0)))
    assert {"tear", "distortion"} & set(reductions(engine.ledger))  # it closes upon itself
    assert all(row["radius"] < row["radius_wanted"] for row in rows if "radius" in row)
    crumb = dense_mesh(np.random.default_rng(0).random((4, 3)), [(0, 1, 2), (1, 3, 2)])
    engine, _ = run(crumb)
    assert reductions(engine.ledger) == {"component": len(engine.ledger)}


@pytest.mark.parametrize(("hole", "key"), [(True, "border"), (False, "tear")])
def test_a_border_nearby_is_told_from_a_handle(hole, key):
    dense = plane(40, 40) if hole else sphere(4)
    field = constant_field(dense)
    engine = Synthesizer(dense, field, blobs(), QuiltParameters())
    engine.run()
    worn = {p: replace(entry, reason="tear", radius=1) for p, entry in engine.ledger.items()}
    engine.ledger = worn
    assert {row["reason"] for row in worst_patches(engine, dense, field)} == {REASONS[key]}


def test_a_flat_sample_has_no_dear_seam():
    grey = np.full((32, 32, 3), 0.5, np.float32)
    engine, rows = run(sphere(4), Sample("grey", grey, grey.copy()))
    assert all(row["seam_per_edge"] == 0 for row in rows)


def test_patches_of_an_earlier_run_have_no_row_but_are_listed():
    dense = sphere(5)
    field = constant_field(dense)
    whole = Synthesizer(dense, field, blobs(), QuiltParameters()).run()
    engine = Synthesizer(dense, field, blobs(), QuiltParameters(), start=whole)
    engine.run()
    rows = worst_patches(engine, dense, field)
    assert engine.ledger == {} and len(rows) > 0
    assert {row["reason"] for row in rows} == {REASONS["earlier"]}
