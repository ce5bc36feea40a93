"""A document saved and opened again is the same document, and goes on as if nothing had been."""

import numpy as np
import pytest

from btfcore.errors import InvalidEdit
from btfcore.files.project.document import background_of, document_of, project_of
from btfcore.files.project.read import read_project
from btfcore.files.project.value import Material
from btfcore.files.project.write import write_project
from btfcore.paint.edits import Area, EraseEdit, PaintEdit, RepairEdit, StampEdit
from btfcore.paint.operations import run
from tests.files.project.projects import differences
from tests.paint.scenes import bits, document, dot, feature, stroke


def materials(doc):
    names = ("background", "spotted")
    return [Material(name, each) for name, each in zip(names, doc.samples, strict=True)]


def painted():
    """Strokes, a stamp on one of them, an erasure, and a repair that is hidden again."""
    doc = document()
    doc.add(PaintEdit(area=Area((stroke(doc, at=10),)), sample=0))
    vertex = int(doc.layers[0].result.delta.vertices[5])
    point, normal = (tuple(map(float, each[vertex])) for each in (
        doc.prepared.dense.vertices, doc.prepared.dense.normals))  # fmt: skip
    doc.add(StampEdit(point=point, normal=normal, sample=1, rotation=30.0))
    doc.add(EraseEdit(area=dot(doc, vertex, 4.0)))
    doc.add(RepairEdit(area=dot(doc, 400, 5.0), seed=4))
    doc.add(PaintEdit(area=Area((stroke(doc, at=800, seed=3),)), sample=1, orientation="search"))
    doc.show(3, False)
    return doc


@pytest.fixture
def both(tmp_path):
    """A document, and the file that it was saved to."""
    path = tmp_path / "both.patina"
    doc = painted()
    write_project(path, project_of(doc, materials(doc)))
    return doc, path


def opened(path):
    return document_of(read_project(path))


def test_every_bit_of_the_document_comes_back(both):
    doc, path = both
    back = opened(path)
    assert bits(back) == bits(doc)
    assert back.engine.state.patches == doc.engine.state.patches
    assert back.engine.writer.tobytes() == doc.engine.writer.tobytes()
    assert back.engine.tokens == doc.engine.tokens and back.next_uid == doc.next_uid
    assert differences(list(doc.layers), list(back.layers)) == []
    assert differences(doc.engine.parameters, back.engine.parameters) == []
    assert differences(doc.prepared, back.prepared) == []
    assert differences(list(doc.samples), list(back.samples)) == []
    assert sum(len(each.result.delta.vertices) for each in back.layers) > 100
    assert back.undo_label == "" and back.redo_label == ""


def test_the_background_is_what_it_was_before_any_edit(both):
    doc, _ = both
    state = background_of(doc)
    arrays = (state.source, state.angle, state.sample, state.patch, state.ghost)
    assert tuple(each.tobytes() for each in arrays) == bits(document())


def test_computing_all_anew_after_opening_changes_nothing(both):
    _, path = both
    back = opened(path)
    before = bits(back)
    assert len(back.replay()) == 0
    assert bits(back) == before


def test_the_hidden_edit_comes_back_without_being_computed(both, monkeypatch):
    doc, path = both
    back = opened(path)
    computed = []

    def noted(engine, edit, **options):
        computed.append(edit.uid)
        return run(engine, edit, **options)

    monkeypatch.setattr("btfcore.paint.document.run", noted)
    back.show(3, True)
    doc.show(3, True)
    assert bits(back) == bits(doc)
    assert 3 not in computed


@pytest.mark.parametrize("step", ["remove", "move", "change", "add"])
def test_every_step_after_opening_is_the_step_without(both, step):
    doc, path = both
    back = opened(path)
    for each in (doc, back):
        if step == "remove":
            each.remove(0)
        elif step == "move":
            each.move(2, 0)
        elif step == "change":
            each.change(4, seed=77)
        else:
            each.add(StampEdit(point=tuple(map(float, each.prepared.dense.vertices[900])), sample=0,
                               feature=None))  # fmt: skip
    assert bits(back) == bits(doc)
    assert [edit.uid for edit in back.edits] == [edit.uid for edit in doc.edits]
    if step == "add":
        written = back.layers[-1].result.delta.vertices
        assert len(written) and np.isfinite(feature(back, written)).all()


def test_opening_and_saving_again_and_again_keeps_every_bit(both, tmp_path):
    doc, path = both
    for at in range(3):
        back = opened(path)
        path = tmp_path / f"{at}.patina"
        write_project(path, project_of(back, materials(back)))
    assert bits(opened(path)) == bits(doc)
    assert differences(list(doc.layers), list(opened(path).layers)) == []


def test_a_hidden_edit_on_ground_that_is_gone_is_kept_and_computed_when_shown(tmp_path):
    doc = painted()
    doc.remove(0)
    doc.change(2, visible=False)
    path = tmp_path / "a.patina"
    write_project(path, project_of(doc, materials(doc)))
    back = opened(path)
    assert differences(list(doc.layers), list(back.layers)) == []
    for each in (doc, back):
        each.show(2, True)
        each.show(3, True)
    assert bits(doc) == bits(back)


def test_a_document_without_edits_is_a_project_too(tmp_path):
    doc = document()
    write_project(tmp_path / "a.patina", project_of(doc, materials(doc)))
    assert bits(opened(tmp_path / "a.patina")) == bits(doc)


def test_no_project_is_made_while_a_stroke_is_drawn():
    doc = document()
    line = stroke(doc, at=10)
    begun = type(line)(line.points[:1], line.radius, line.normals[:1])
    session = doc.begin(PaintEdit(area=Area((begun,)), sample=0))
    with pytest.raises(InvalidEdit, match="finish or cancel"):
        project_of(doc, materials(doc))
    session.cancel()
    assert len(project_of(doc, materials(doc)).edits) == 0
