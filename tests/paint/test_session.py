"""A stroke drawn live is the edit that is replayed, however its points came in."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.errors import Cancelled, InvalidEdit
from btfcore.paint.edits import Area, EraseEdit, PaintEdit, Stroke, Symmetry
from btfcore.paint.operations import run
from tests.paint import scenes


def one(stroke, begin, end):
    """Points `begin` … `end` of a stroke."""
    some = slice(begin, end)
    return replace(
        stroke,
        points=stroke.points[some].copy(),
        normals=None if stroke.normals is None else stroke.normals[some].copy(),
        pressure=None if stroke.pressure is None else stroke.pressure[some].copy(),
    )


def drawn(doc, edit, sizes):
    """Draw an edit's last stroke in parts of these sizes; returns what was said to change."""
    *earlier, last = edit.area.strokes
    first = replace(edit, area=replace(edit.area, strokes=(*earlier, one(last, 0, 1))))
    session, at, said = doc.begin(first), 1, []
    for size in sizes:
        if at >= len(last.points):
            break
        part = one(last, at, at + size)
        said.append(session.extend(part.points, part.normals, part.pressure))
        at += size
    assert at >= len(last.points)
    whole = session.finish()
    return said, whole


def winding(doc, at, length=40, **more):
    base = scenes.stroke(doc, at=at, length=length)
    assert len(base.points) > 12
    return replace(base, **more)


def cases(doc):
    plain = winding(doc, 2000)
    count = len(plain.points)
    pressed = replace(plain, pressure=np.linspace(0.3, 1.0, count))
    yield "plain", PaintEdit(area=Area(strokes=(plain,)), sample=0)
    yield "pressed", PaintEdit(area=Area(strokes=(pressed,)), sample=0, orientation="stroke")
    yield "mirrored", PaintEdit(
        area=Area(strokes=(winding(doc, 900, 20),)), sample=1, symmetry=Symmetry(mirror="x")
    )  # fmt: skip
    yield "radial", PaintEdit(
        area=Area(strokes=(pressed,)), sample=0, symmetry=Symmetry(radial=3, axis="y")
    )  # fmt: skip
    yield "several", PaintEdit(
        area=Area(strokes=(winding(doc, 900, 15), plain)), sample=0, orientation="search"
    )  # fmt: skip
    yield "unsided", PaintEdit(area=Area(strokes=(replace(plain, normals=None),)), sample=0)
    yield "soft", PaintEdit(
        area=Area(strokes=(replace(plain, hardness=0.3),), vertices=np.arange(40, dtype=np.int32),
                  rate=doc.prepared.dense.size),
        sample=0, transition=0.0,
    )  # fmt: skip


NAMES = [name for name, _ in cases(scenes.document())]


@pytest.mark.parametrize("name", NAMES)
def test_any_batching_gives_the_bits_of_the_replay(name):
    replayed = scenes.document()
    edit = dict(cases(replayed))[name]
    replayed.add(edit)
    count = len(edit.area.strokes[-1].points)
    random = np.random.default_rng(3)
    for sizes in ([count], [1] * count, random.integers(1, 6, count).tolist()):
        doc = scenes.document()
        before = doc.engine.copy()
        said, whole = drawn(doc, edit, sizes)
        assert scenes.bits(doc) == scenes.bits(replayed)
        assert doc.layers[-1].result.report == replayed.layers[-1].result.report
        assert np.isin(doc.engine.differences(before), whole).all()
        kept = doc.edits[-1]
        assert kept.uid == 0 and kept.name == "Paint 1"
        assert np.array_equal(kept.area.strokes[-1].points, edit.area.strokes[-1].points)
        run(replayed.engine, replace(kept, uid=9))  # what is kept can be computed
        replayed.engine.take_off(replayed.layers[-1].result)
        replayed = scenes.document()
        replayed.add(kept)
        assert scenes.bits(doc) == scenes.bits(replayed)


def test_a_brush_that_is_lifted_makes_two_strokes_of_one_edit_with_the_bits_of_the_replay():
    doc, replayed = scenes.document(), scenes.document()
    strokes = (winding(doc, 900, 15), winding(doc, 2000))
    session = doc.begin(PaintEdit(area=Area(strokes=(one(strokes[0], 0, 1),)), sample=0))
    session.extend(strokes[0].points[1:], strokes[0].normals[1:])
    session.extend(strokes[1].points[:4], strokes[1].normals[:4], lifted=True)
    session.extend(strokes[1].points[4:], strokes[1].normals[4:])
    session.finish()
    (kept,) = doc.edits
    for drawn_one, wanted in zip(kept.area.strokes, strokes, strict=True):
        assert np.array_equal(drawn_one.points, wanted.points)
    replayed.add(PaintEdit(area=Area(strokes=strokes), sample=0))
    assert scenes.bits(doc) == scenes.bits(replayed)


def test_what_is_drawn_shows_before_the_end():
    doc = scenes.document()
    stroke = winding(doc, 2000)
    session = doc.begin(PaintEdit(area=Area(strokes=(one(stroke, 0, 1),)), sample=0))
    before = doc.engine.copy()
    said = session.extend(stroke.points[1:], stroke.normals[1:])
    assert len(said) and set(doc.engine.differences(before)) <= set(said.tolist())
    assert len(doc.engine.differences(before))
    session.cancel()


@pytest.fixture
def begun():
    doc = scenes.document()
    doc.add(EraseEdit(area=scenes.dot(doc, 100)))
    state = (scenes.bits(doc), doc.layers, doc.next_uid, doc.undo_label, doc.redo_label)
    writer = doc.engine.writer.tobytes()
    stroke = winding(doc, 2000)
    session = doc.begin(PaintEdit(area=Area(strokes=(one(stroke, 0, 1),)), sample=0))

    def unchanged():
        now = (scenes.bits(doc), doc.layers, doc.next_uid, doc.undo_label, doc.redo_label)
        assert now == state and doc.engine.writer.tobytes() == writer
        assert (doc.engine.flattener.local == -1).all() and not doc.engine.busy

    return doc, session, stroke, unchanged


def test_a_cancelled_session_leaves_no_trace(begun):
    doc, session, stroke, unchanged = begun
    session.extend(stroke.points[1:20], stroke.normals[1:20])
    session.cancel()
    unchanged()
    session.cancel()
    for verb in (session.finish, lambda: session.extend(stroke.points[:1])):
        with pytest.raises(InvalidEdit, match="finished or cancelled already"):
            verb()
    unchanged()
    doc.add(PaintEdit(area=Area(strokes=(stroke,)), sample=0))
    other = scenes.document()
    for each in doc.edits:
        other.add(replace(each))
    assert scenes.bits(doc) == scenes.bits(other)


def test_progress_may_cancel_the_end_of_a_session(begun):
    doc, session, stroke, unchanged = begun
    session.extend(stroke.points[1:], stroke.normals[1:])

    def progress(done, label):
        raise Cancelled

    with pytest.raises(Cancelled):
        session.finish(progress=progress)
    unchanged()


def test_nothing_else_may_change_the_document_meanwhile(begun):
    doc, session, stroke, unchanged = begun
    session.extend(stroke.points[1:20], stroke.normals[1:20])
    now = scenes.bits(doc)
    for verb in (
        doc.undo, doc.redo, doc.replay, lambda: doc.remove(0), lambda: doc.show(0, False),
        lambda: doc.add(EraseEdit(area=scenes.dot(doc, 100))),
        lambda: doc.begin(PaintEdit(area=Area(strokes=(one(stroke, 0, 1),)), sample=0)),
    ):  # fmt: skip
        if verb == doc.redo:
            assert not len(verb())
            continue
        with pytest.raises(InvalidEdit, match="being drawn"):
            verb()
        assert scenes.bits(doc) == now and len(doc.edits) == 1
    session.finish()
    assert len(doc.edits) == 2 and doc.undo_label == "add Paint 2"
    doc.undo()
    doc.undo()
    assert doc.edits == ()


def test_points_that_make_no_sense_are_refused_and_the_stroke_goes_on(begun):
    doc, session, stroke, unchanged = begun
    session.extend(stroke.points[1:10], stroke.normals[1:10])
    now = scenes.bits(doc)
    far = np.full((1, 3), np.nan)
    for points, normals, pressure, words in (
        (far, stroke.normals[:1], None, "not finite"),
        (stroke.points[:1], None, None, "normals must be given for all"),
        (stroke.points[:1], stroke.normals[:1], np.ones(1), "pressure must be given for all"),
        (stroke.points[:2], stroke.normals[:1], None, "normals of shape"),
        (np.zeros((100_000, 3)), np.ones((100_000, 3)), None, "more than 100,000 points"),
    ):
        with pytest.raises(InvalidEdit, match=words):
            session.extend(points, normals, pressure)
        assert scenes.bits(doc) == now
    assert not len(session.extend(np.zeros((0, 3)), np.zeros((0, 3))))
    session.extend(stroke.points[10:], stroke.normals[10:])
    session.finish()
    other = scenes.document()
    other.add(EraseEdit(area=scenes.dot(doc, 100)))
    other.add(PaintEdit(area=Area(strokes=(stroke,)), sample=0))
    assert scenes.bits(doc) == scenes.bits(other)


def test_an_error_while_drawing_cancels(begun, monkeypatch):
    doc, session, stroke, unchanged = begun

    def failing(*arguments, **more):
        raise MemoryError("no room")

    monkeypatch.setattr(type(doc.engine.state), "accept", failing)
    with pytest.raises(MemoryError):
        session.extend(stroke.points[1:], stroke.normals[1:])
    unchanged()


def test_a_stroke_beside_the_surface_is_an_error_and_leaves_no_trace():
    doc = scenes.document()
    before = scenes.bits(doc)
    away = np.array([[50.0, 0, 0], [51.0, 0, 0]])
    session = doc.begin(
        PaintEdit(area=Area(strokes=(Stroke(away[:1], 0.1),)), sample=0, name="far")
    )
    assert not len(session.extend(away[1:]))
    with pytest.raises(InvalidEdit, match="far: its strokes cover no vertex"):
        session.finish()
    assert scenes.bits(doc) == before and doc.edits == () and not doc.engine.busy


def test_only_paint_edits_with_a_stroke_are_drawn():
    doc = scenes.document()
    with pytest.raises(InvalidEdit, match="drawn live"):
        doc.begin(EraseEdit(area=scenes.dot(doc, 0)))
    with pytest.raises(InvalidEdit, match="drawn live"):
        doc.begin(PaintEdit(area=Area(everywhere=True), sample=0))
    with pytest.raises(InvalidEdit, match="sample 5 of 2"):
        doc.begin(PaintEdit(area=scenes.dot(doc, 0), sample=5))
    assert not doc.engine.busy and doc.next_uid == 0
