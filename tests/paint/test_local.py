"""Laws of erase, repair and re-quilt."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.errors import InvalidEdit
from btfcore.paint.constrained import energy
from btfcore.paint.edits import Area, EraseEdit, PaintEdit, RepairEdit, RequiltEdit, StampEdit
from btfcore.paint.local import AROUND
from btfcore.paint.region import constrain
from btfcore.paint.wanted import Before, foreign_of, orphans, rings
from tests.paint import scenes

FEATURE = 0.05
PLACE = 2000


def covered(doc, area):
    """Dense vertices of an edit's area."""
    engine = doc.engine
    found = constrain(area, engine.prepared.mesh, engine.net, engine.locator)
    return found.vertices[found.target > 0.5]


def painted(rate=96, **knobs):
    """A document with a painted stroke about `PLACE`."""
    doc = scenes.document(rate=rate)
    line = scenes.stroke(doc, at=PLACE, length=30, radius=5.0)
    doc.add(PaintEdit(area=Area(strokes=(line,)), sample=0, **knobs))
    return doc, line


def shown(doc):
    return scenes.feature(doc, np.arange(len(doc.engine.state.patch), dtype=np.int32))


def stamped(doc, at, **more):
    """Add the largest spot at a vertex; returns the vertices that show it."""
    dense = doc.prepared.dense
    doc.add(
        StampEdit(
            point=tuple(map(float, dense.vertices[at])),
            normal=tuple(map(float, dense.normals[at])), **{"sample": 1, **more},
        )
    )  # fmt: skip
    written = doc.layers[-1].result.delta.vertices
    return written[scenes.feature(doc, written) > 0.5]


def seam(doc):
    """Mean seam of the whole surface per edge."""
    engine = doc.engine
    count = len(engine.state.patch)
    found = energy(engine.net, engine.state, engine.palette, 0, np.zeros(count))
    return found.smooth / found.seam_edges


# --- erase


def test_no_feature_is_left_where_it_was_erased():
    doc, line = painted()
    assert (shown(doc) > 0.5).sum() > 100
    area = Area(strokes=(replace(line, radius=2.5 * line.radius),))
    doc.add(EraseEdit(area=area))
    inside = covered(doc, area)
    assert scenes.feature(doc, inside).max() <= FEATURE
    assert (doc.engine.state.patch[inside] >= 0).all()
    report = doc.layers[-1].result.report
    assert report.reached == report.area == len(inside) and report.notes == ()


def test_the_seams_of_what_was_erased_are_like_those_of_the_background():
    doc = scenes.document()
    own = seam(doc)
    doc, line = painted()
    doc.add(EraseEdit(area=Area(everywhere=True)))
    assert shown(doc).max() <= FEATURE
    assert seam(doc) < 1.25 * own


@pytest.mark.parametrize("at", range(300, 4500, 600))
def test_features_of_another_sample_are_erased_with_their_surroundings(at):
    doc = scenes.document()
    spot = stamped(doc, at, scale=0.7)
    assert len(spot) > 50
    area = scenes.dot(doc, at, 22.0)
    doc.add(EraseEdit(area=area))
    inside = covered(doc, area)
    assert scenes.feature(doc, inside).max() <= FEATURE
    assert (doc.engine.state.sample[inside] == 0).all()
    assert (doc.engine.state.patch >= 0).all()


def test_only_the_part_in_the_brush_is_erased():
    doc, line = painted()
    before, was = doc.engine.copy(), shown(doc)
    area = scenes.dot(doc, PLACE, 9.0)
    inside = covered(doc, area)
    assert (was[inside] > 0.5).any()
    doc.add(EraseEdit(area=area))
    assert scenes.feature(doc, inside).max() <= FEATURE
    gone = rings(doc.engine, inside[was[inside] > FEATURE], AROUND)
    outside = np.setdiff1d(np.flatnonzero(was > FEATURE), gone)
    assert len(outside) > 50
    assert not len(np.intersect1d(outside, doc.engine.differences(before)))
    fresh = np.setdiff1d(np.flatnonzero(shown(doc) > FEATURE), np.flatnonzero(was > FEATURE))
    assert not len(fresh)


@pytest.mark.parametrize("radius", [0.6, 2.0, 4.0])
def test_a_hole_can_be_erased_into_a_feature(radius):
    doc = scenes.document()
    spot = stamped(doc, PLACE)
    before = doc.engine.copy()
    area = scenes.dot(doc, PLACE, radius)
    inside = covered(doc, area)
    assert np.isin(rings(doc.engine, inside, AROUND + 1), spot).all()
    changed = doc.add(EraseEdit(area=area))
    assert scenes.feature(doc, inside).max() <= FEATURE
    assert doc.layers[-1].result.report.notes == ()
    assert np.isin(doc.engine.differences(before), rings(doc.engine, inside, AROUND)).all()
    assert len(changed) == len(rings(doc.engine, inside, AROUND))


def test_where_there_is_no_feature_erasing_changes_nothing():
    doc = scenes.document()
    before = scenes.bits(doc)
    assert not len(doc.add(EraseEdit(area=Area(everywhere=True))))
    assert scenes.bits(doc) == before
    assert "there is no feature in the area" in doc.layers[-1].result.report.notes


def test_orphans_are_the_pieces_that_have_lost_their_feature():
    doc = scenes.document()
    engine = doc.engine
    at = [300, 4000]
    spots = [stamped(doc, each, scale=0.5) for each in at]
    foreign = foreign_of(engine)
    assert foreign[np.concatenate(spots)].all()
    unwanted = np.zeros(len(foreign), bool)
    unwanted[rings(engine, spots[0], 2)] = True
    with engine.recording(99) as recorder:
        found = orphans(engine, Before(engine), unwanted, foreign, 24)
        assert np.isin(found, recorder.looked).all()
        engine.cancel()
    # plain twin: what is connected to the first spot through foreign vertices
    pieces, todo = set(spots[0].tolist()), spots[0].tolist()
    while todo:
        vertex = todo.pop()
        near = engine.net.indices[engine.net.indptr[vertex] : engine.net.indptr[vertex + 1]]
        new = [int(v) for v in near if foreign[v] and int(v) not in pieces]
        pieces.update(new)
        todo += new
    assert not pieces & set(spots[1].tolist())
    assert set(found.tolist()) == {v for v in pieces if not unwanted[v]}
    with engine.recording(99):
        half = np.zeros(len(foreign), bool)
        half[spots[0][: len(spots[0]) // 2]] = True
        assert not len(orphans(engine, Before(engine), half, foreign, 24))
        engine.cancel()


# --- repair


def test_repair_replaces_all_of_its_area():
    doc = scenes.document()
    before = doc.engine.copy()
    area = scenes.dot(doc, PLACE, 9.0)
    doc.add(RepairEdit(area=area))
    inside = covered(doc, area)
    assert (doc.engine.state.patch[inside] != before.patch[inside]).all()
    assert (doc.engine.state.patch[inside] >= 0).all()
    assert shown(doc).max() <= FEATURE


def test_a_seed_is_a_result():
    made = {}
    for seed in (1, 2, 1):
        doc = scenes.document()
        doc.add(RepairEdit(area=scenes.dot(doc, PLACE, 9.0), seed=seed))
        inside = covered(doc, doc.edits[0].area)
        made.setdefault(seed, []).append((scenes.bits(doc), doc.engine.state.source[inside]))
    assert made[1][0][0] == made[1][1][0]
    moved = np.abs(made[1][0][1] - made[2][0][1]).max(axis=1)
    assert (moved > 1).mean() > 0.5


@pytest.mark.parametrize("protect", [True, False])
def test_features_are_kept_where_they_are_protected(protect):
    doc, line = painted()
    was, before = shown(doc), doc.engine.copy()
    area = scenes.dot(doc, PLACE, 12.0)
    inside = covered(doc, area)
    features = inside[was[inside] > FEATURE]
    assert len(features) > 30
    doc.add(RepairEdit(area=area, protect=protect))
    changed = doc.engine.differences(before)
    if protect:
        assert not len(np.intersect1d(features, changed))
        rest = np.setdiff1d(inside, features)
        assert np.isin(rest, changed).mean() > 0.95
        assert scenes.feature(doc, rest).max() <= FEATURE
    else:
        assert np.isin(inside, changed).all()
        assert scenes.feature(doc, inside).max() <= FEATURE


# --- re-quilt


@pytest.mark.parametrize("seed", range(4))
def test_cutting_again_never_raises_the_energy_and_keeps_features(seed):
    doc, line = painted()
    engine = doc.engine
    for at in (PLACE, PLACE + 200):
        doc.add(RepairEdit(area=scenes.dot(doc, at, 12.0), seed=seed))

    def total(target):
        return energy(
            engine.net, engine.state, engine.palette, 0, target, any_sample=True,
            unit=engine.unit(0),
        )  # fmt: skip

    first = total(shown(doc))
    for tries in (1, 3, 10):
        was = shown(doc).astype(np.float64)
        before = total(was)
        doc.add(RequiltEdit(area=Area(everywhere=True), tries=tries))
        after = total(was)
        report = doc.layers[-1].result.report
        drop = before.total(report.weight) - after.total(report.weight)
        said = report.weight * (report.constraint_before - report.constraint)
        said += report.smooth_before - report.smooth
        assert drop == pytest.approx(said, abs=1e-6 * before.smooth)
        assert drop >= -1e-9 * before.smooth
        now = shown(doc)
        assert (now[was > 0.5] > 0.5).mean() > 0.97
        assert not ((now > 0.5) & (was < FEATURE)).any()
    assert after.smooth < first.smooth  # repaired with whatever came: there is something to gain


# --- several samples of the background


@pytest.mark.parametrize("hard", [True, False])
def test_each_region_gets_its_own_background_back(hard):
    doc = scenes.divided(hard=hard)
    engine = doc.engine
    border = [
        v for v in range(len(engine.state.patch))
        if abs(engine.prepared.dense.vertices[v, 1] - 0.1) < 0.5 * engine.step
    ]  # fmt: skip
    at = border[len(border) // 2]
    allowed = engine.layout.allowed
    for edit in (
        PaintEdit(area=scenes.dot(doc, at, 8.0), sample=1),
        StampEdit(point=tuple(map(float, engine.prepared.dense.vertices[at])), sample=1, scale=0.7),
        EraseEdit(area=scenes.dot(doc, at, 22.0)),
        RepairEdit(area=scenes.dot(doc, at, 10.0), seed=3),
        RequiltEdit(area=scenes.dot(doc, at, 20.0), tries=6),
    ):
        before = doc.engine.copy()
        doc.add(edit)
        if isinstance(edit, PaintEdit | StampEdit):
            continue
        assert (engine.state.patch >= 0).all()
        inside = covered(doc, edit.area)
        changed = doc.engine.differences(before)
        assert allowed[engine.state.sample[changed], changed].all()
        if isinstance(edit, EraseEdit):
            assert scenes.feature(doc, inside).max() <= FEATURE
            assert allowed[engine.state.sample[inside], inside].all()
            assert doc.layers[-1].result.report.notes == ()
        if isinstance(edit, RepairEdit):
            assert np.isin(inside, changed).all()


# --- partly bare


def test_bare_vertices_stay_bare_and_do_no_harm():
    doc, line = painted()
    engine = doc.engine
    bare = rings(engine, np.array([PLACE], np.int32), 6)
    engine.state.patch[bare] = -1
    for edit in (
        EraseEdit(area=Area(everywhere=True)),
        RepairEdit(area=scenes.dot(doc, PLACE, 14.0)),
        RequiltEdit(area=scenes.dot(doc, PLACE, 14.0)),
        PaintEdit(area=scenes.dot(doc, PLACE, 14.0), sample=0),
        StampEdit(point=tuple(map(float, engine.prepared.dense.vertices[PLACE])), sample=1),
    ):
        before = scenes.bits(doc)
        doc.add(edit)
        assert (engine.state.patch[bare] == -1).all()
        inside = np.setdiff1d(np.arange(len(engine.state.patch)), bare)
        assert (engine.state.patch[inside] >= 0).all()
        if isinstance(edit, EraseEdit):
            assert scenes.feature(doc, inside.astype(np.int32)).max() <= FEATURE
        doc.undo()
        assert scenes.bits(doc) == before
    for edit in (
        EraseEdit(area=scenes.dot(doc, PLACE, 2.0), name="wipe"),
        RepairEdit(area=scenes.dot(doc, PLACE, 2.0), name="wipe"),
        RequiltEdit(area=scenes.dot(doc, PLACE, 2.0), name="wipe"),
        PaintEdit(area=scenes.dot(doc, PLACE, 2.0), sample=0, name="wipe"),
    ):
        with pytest.raises(InvalidEdit, match="wipe: nothing is synthesised yet in its area"):
            doc.add(edit)
    assert len(doc.edits) == 1
