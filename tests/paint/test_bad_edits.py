"""Edits that make no sense: an error that names what is wrong, and nothing changed."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.errors import InvalidEdit, PatinaError
from btfcore.paint.document import Document
from btfcore.paint.edits import (
    Area,
    EraseEdit,
    PaintEdit,
    RepairEdit,
    RequiltEdit,
    StampEdit,
    Stroke,
)
from btfcore.paint.engine import Engine
from tests.paint import scenes

PLACE = 2000


def kinds(area):
    """Every kind of edit that has an area."""
    yield PaintEdit(area=area, sample=0, name="it")
    yield EraseEdit(area=area, name="it")
    yield RepairEdit(area=area, name="it")
    yield RequiltEdit(area=area, name="it", tries=2)


@pytest.fixture
def doc():
    return scenes.document()


def refused(doc, edit, words):
    """Adding raises with these words and leaves the document as it was."""
    before = scenes.bits(doc), doc.layers, doc.next_uid, doc.engine.writer.tobytes()
    with pytest.raises(PatinaError, match=words):
        doc.add(edit)
    assert (scenes.bits(doc), doc.layers, doc.next_uid, doc.engine.writer.tobytes()) == before
    assert not doc.engine.busy and (doc.engine.flattener.local == -1).all()


def test_an_empty_area_is_no_area():
    for parts in ({}, {"faces": np.zeros(0, np.int32)}, {"vertices": np.zeros(0, np.int32)}):
        with pytest.raises(InvalidEdit, match="the area of an edit is empty"):
            Area(**parts, rate=96)


def test_an_area_off_the_surface(doc):
    away = Area(strokes=(Stroke(np.full((3, 3), 90.0), 0.1),))
    for edit in kinds(away):
        refused(doc, edit, "covers? n")
    with pytest.raises(InvalidEdit, match="1 of 9 numbers of points of a stroke are not finite"):
        Stroke(np.array([[0, 0, np.nan], [0, 0, 0], [0, 0, 0.0]]), 1.0)


def test_a_stroke_of_no_pressure_covers_nothing(doc):
    points = doc.prepared.dense.vertices[PLACE : PLACE + 4].copy()
    for edit in kinds(Area(strokes=(Stroke(points, 0.2, pressure=np.zeros(4)),))):
        refused(doc, edit, "covers? n")


def test_pressure_that_is_no_number():
    for wrong in (np.nan, -0.1, 1.5, np.inf):
        with pytest.raises(InvalidEdit, match="pressure 1 of a stroke is .*, outside 0 … 1"):
            Stroke(np.zeros((2, 3)), 1.0, pressure=np.array([1.0, wrong]))
    for radius in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InvalidEdit, match="the radius of a stroke is"):
            Stroke(np.zeros((2, 3)), radius)


def test_parts_of_the_mesh_that_are_not_there(doc):
    faces = len(doc.prepared.mesh.faces)
    for area, words in (
        (Area(faces=np.array([faces], np.int32)), f"face {faces} of an area"),
        (Area(faces=np.array([-1], np.int32)), "face -1 of an area"),
        (Area(region="tail"), "no region 'tail'"),
        (Area(vertices=np.array([1], np.int32), rate=512), "vertices are of rate 512"),
        (
            Area(vertices=np.array([10**6], np.int32), rate=doc.prepared.dense.size),
            "vertex 1000000",
        ),
    ):
        for edit in kinds(area):
            refused(doc, edit, words)


@pytest.mark.parametrize("sample", [2, -1, 99])
def test_a_sample_that_is_not_there(doc, sample):
    area = scenes.dot(doc, PLACE)
    point = tuple(map(float, doc.prepared.dense.vertices[PLACE]))
    refused(doc, PaintEdit(area=area, sample=sample, name="it"), f"it names sample {sample} of 2")
    refused(doc, StampEdit(point=point, sample=sample, name="it"), f"it names sample {sample} of 2")
    doc.add(PaintEdit(area=area, sample=0))
    before = scenes.bits(doc), doc.layers
    with pytest.raises(InvalidEdit, match=f"names sample {sample} of 2"):
        doc.change(0, sample=sample)
    assert (scenes.bits(doc), doc.layers) == before


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_masks_of_nothing_and_of_everything(value):
    base = scenes.document()
    mask = np.full((scenes.SIDE, scenes.SIDE), value, np.float32)
    odd = replace(scenes.spotted(), name="odd", mask=mask)
    engine = base.engine
    doc = Document(
        Engine(
            engine.prepared, (scenes.cracked(), odd), engine.net, engine.copy(), engine.parameters
        )
    )  # fmt: skip
    area = scenes.dot(doc, PLACE)
    words = "'odd' has no feature" if value == 0 else "'odd'"
    refused(doc, PaintEdit(area=area, sample=1), words)
    point = tuple(map(float, doc.prepared.dense.vertices[PLACE]))
    refused(doc, StampEdit(point=point, sample=1), words)
    doc.add(PaintEdit(area=area, sample=0))  # the other samples serve all the same


def test_a_mask_of_another_size_is_refused_with_its_sample():
    base = scenes.document().engine
    odd = replace(scenes.spotted(), name="odd", mask=None)
    object.__setattr__(odd, "mask", np.zeros((5, 5), np.float32))
    with pytest.raises(PatinaError, match="odd"):
        Engine(base.prepared, (scenes.cracked(), odd), base.net, base.copy(), base.parameters)


def test_everything_at_once(doc):
    for edit in kinds(Area(everywhere=True)):
        doc.add(edit)
        assert (doc.engine.state.patch >= 0).all()
    doc.add(RepairEdit(area=Area(everywhere=True), protect=False))
    kept = doc.layers[-1].result.report
    assert kept.reached == kept.area == len(doc.engine.state.patch)
    while doc.undo_label:
        doc.undo()
    assert scenes.bits(doc) == scenes.bits(scenes.document())


def test_at_the_border_of_an_open_mesh():
    doc = scenes.document("open_box.obj", 96)
    dense, net = doc.prepared.dense, doc.engine.net
    corners = np.sort(dense.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, count = np.unique(corners, axis=0, return_counts=True)
    border = np.unique(edges[count == 1])
    assert len(border) > 20
    before = scenes.bits(doc)
    for at in border[:: len(border) // 5]:
        for edit in kinds(scenes.dot(doc, int(at), 7.0)):
            doc.add(edit)
            assert (doc.engine.state.patch >= 0).all()
            assert np.isfinite(doc.engine.state.source).all()
        doc.add(StampEdit(point=tuple(map(float, dense.vertices[at])), sample=1, scale=0.5))
        if doc.layers[-1].edit.uid == 4:
            notes = doc.layers[-1].result.report.notes
            assert any("of the feature lies on the surface" in note for note in notes)
    while doc.undo_label:
        doc.undo()
    assert scenes.bits(doc) == before and len(net.indptr)


@pytest.mark.parametrize("mesh", ["torus.obj", "sphere.obj"])
def test_on_meshes_smaller_than_a_patch(mesh):
    doc = scenes.document(mesh, 24)
    count = len(doc.engine.state.patch)
    assert count < 600
    before = scenes.bits(doc)
    for edit in (
        *kinds(scenes.dot(doc, 5, 3.0)),
        StampEdit(point=tuple(map(float, doc.prepared.dense.vertices[5])), sample=1),
        StampEdit(point=tuple(map(float, doc.prepared.dense.vertices[9])), sample=0),
        *kinds(Area(everywhere=True)),
    ):
        doc.add(edit)
        state = doc.engine.state
        assert np.isfinite(state.source).all() and np.isfinite(state.ghost).all()
        assert (state.patch >= 0).all()
    assert not len(doc.replay())
    while doc.undo_label:
        doc.undo()
    assert scenes.bits(doc) == before


def test_a_feature_wider_than_the_work_patch(doc):
    wide = PaintEdit(area=scenes.dot(doc, PLACE, 12.0), sample=1, work_patch=4)
    doc.add(wide)
    report = doc.layers[-1].result.report
    after = report.weight * report.constraint + report.smooth
    assert after <= report.weight * report.constraint_before + report.smooth_before
    if report.reached < report.area / 2:
        assert any("of the area is as wanted" in note for note in report.notes)


def test_two_edits_over_each_other(doc):
    line = Area(strokes=(scenes.stroke(doc, at=PLACE, length=30, radius=5.0),))
    first = PaintEdit(area=line, sample=0)
    doc.add(first)
    once = scenes.bits(doc)
    doc.add(replace(first))
    one, two = (layer.result.report for layer in doc.layers)
    assert two.reached >= one.reached
    doc.remove(0)  # what is left is computed anew, on the background
    alone = scenes.document()
    alone.add(replace(first))
    assert alone.layers[0].edit.uid == 0
    same = np.array_equal(alone.engine.state.source, doc.engine.state.source)
    assert same  # the uid is in the patch numbers only
    doc.undo()
    doc.undo()
    assert scenes.bits(doc) == once
