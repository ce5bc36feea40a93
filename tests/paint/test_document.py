"""Laws of layers and history: the list of edits alone says what the surface shows."""

from dataclasses import replace

import numpy as np
import pytest

import btfcore.paint.document as document_module
from btfcore.errors import Cancelled, InvalidEdit
from btfcore.paint.edits import (
    Area,
    EraseEdit,
    PaintEdit,
    RepairEdit,
    RequiltEdit,
    StampEdit,
)
from btfcore.paint.operations import run
from btfcore.paint.wanted import rings
from tests.paint import scenes

PLACES = (400, 1500, 2600, 3700)  # dense vertices about which the edits of these tests lie


def edit(doc, kind, place=0, *, seed=0, radius=4.0):
    """An edit of a kind about one of `PLACES`."""
    at = PLACES[place]
    if kind == "paint":
        stroke = scenes.stroke(doc, at=at, length=14, radius=radius, seed=seed)
        return PaintEdit(area=Area(strokes=(stroke,)), sample=seed % 2)
    if kind == "stamp":
        point = tuple(float(x) for x in doc.prepared.dense.vertices[at])
        normal = tuple(float(x) for x in doc.prepared.dense.normals[at])
        return StampEdit(point=point, normal=normal, sample=1, feature=1 + seed % 2, rotation=seed)
    area = scenes.dot(doc, at, radius + 2)
    if kind == "erase":
        return EraseEdit(area=area)
    if kind == "repair":
        return RepairEdit(area=area, seed=seed)
    return RequiltEdit(area=area, tries=3)


KINDS = ("paint", "stamp", "erase", "repair", "requilt")


class Reference:
    """Bits of a fresh document to which the visible edits are added in their order."""

    def __init__(self):
        self.known = {}

    def __call__(self, doc):
        visible = [each for each in doc.edits if each.visible]
        key = tuple(id(each) for each in visible)
        if key not in self.known:
            other = scenes.document()
            for each in visible:
                run(other.engine, each)
            self.known[key] = scenes.bits(other), visible  # held, so that no id comes again
        return self.known[key][0]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_every_state_is_that_of_the_visible_edits_in_their_order(seed):
    random = np.random.default_rng(seed)
    doc, reference = scenes.document(), Reference()
    background = doc.engine.copy()
    verbs = ["add"] * 4 + ["show", "show", "move", "remove", "change", "undo", "undo", "redo"]
    done = set()
    for step in range(36):
        verb = str(random.choice(verbs)) if step > 2 else "add"
        before = doc.engine.copy()
        uid = int(random.choice([each.uid for each in doc.edits])) if doc.edits else -1
        if verb == "add" or uid < 0 and verb not in ("undo", "redo"):
            kind = KINDS[int(random.integers(len(KINDS)))]
            changed = doc.add(edit(doc, kind, int(random.integers(4)), seed=step))
        elif verb == "show":
            changed = doc.show(uid, not doc.layer(uid).edit.visible)
        elif verb == "move":
            changed = doc.move(uid, int(random.integers(len(doc.edits))))
        elif verb == "remove":
            changed = doc.remove(uid)
        elif verb == "change":
            area = hasattr(doc.layer(uid).edit, "area")
            changed = doc.change(uid, **({"seed": step + 100} if area else {"rotation": 50.0}))
        else:
            changed = doc.undo() if verb == "undo" else doc.redo()
        done.add(verb)
        assert scenes.bits(doc) == reference(doc), f"after step {step}, {verb}"
        assert set(doc.engine.differences(before)) <= set(changed.tolist())
        written = np.zeros(len(before.patch), bool)
        for layer in doc.layers:
            if layer.edit.visible:
                written[layer.result.delta.vertices] = True
        assert written[doc.engine.differences(background)].all()
    assert len(done) > 4
    while doc.undo_label:
        doc.undo()
    assert not len(doc.engine.differences(background)) and doc.edits == ()


def test_undo_and_redo_are_inverse():
    doc = scenes.document()
    states, layers = [scenes.bits(doc)], [doc.layers]
    doc.add(edit(doc, "paint", 0))
    states.append(scenes.bits(doc))
    doc.add(edit(doc, "stamp", 1))
    states.append(scenes.bits(doc))
    doc.show(0, False)
    states.append(scenes.bits(doc))
    doc.move(1, 0)
    states.append(scenes.bits(doc))
    doc.remove(0)
    states.append(scenes.bits(doc))
    for back in range(2):
        for at in reversed(range(len(states) - 1)):
            doc.undo()
            assert scenes.bits(doc) == states[at]
        assert doc.undo_label == "" and not len(doc.undo())
        assert doc.layers == layers[0]
        for at in range(1, len(states)):
            doc.redo()
            assert scenes.bits(doc) == states[at]
        assert doc.redo_label == "" and not len(doc.redo()), back
    doc.undo()
    doc.add(edit(doc, "erase", 0))
    assert doc.redo_label == ""


@pytest.fixture
def counted(monkeypatch):
    """Uids of the edits that are computed, in order."""
    uids = []

    def counting(engine, edit, **more):
        uids.append(edit.uid)
        return run(engine, edit, **more)

    monkeypatch.setattr(document_module, "run", counting)
    return uids


def test_edits_far_apart_are_not_computed_again(counted):
    doc = scenes.document(rate=192)
    dense = doc.prepared.dense.vertices
    low, high = int(dense[:, 2].argmin()), int(dense[:, 2].argmax())
    for at in (low, high):
        doc.add(PaintEdit(area=scenes.dot(doc, at, 4.0), sample=0, work_patch=10))
    one, other = (layer.result.delta for layer in doc.layers)
    assert len(one.vertices) and len(other.vertices)
    assert not len(np.intersect1d(one.reads, other.vertices))
    both = scenes.bits(doc)
    doc.show(0, False)
    doc.show(0, True)
    doc.move(0, 1)
    assert scenes.bits(doc) == both
    doc.remove(1)
    doc.undo()
    assert scenes.bits(doc) == both
    assert counted == [0, 1]


def test_only_what_stands_on_a_change_is_computed_again(counted):
    doc = scenes.document()
    doc.add(edit(doc, "paint", 0))
    doc.add(edit(doc, "erase", 0))
    assert counted == [0, 1]
    doc.show(0, False)
    assert counted == [0, 1, 1]  # what it erased is gone
    doc.undo()
    doc.redo()
    doc.undo()
    doc.change(0, name="crack")
    doc.show(1, False)
    doc.show(1, True)
    assert counted == [0, 1, 1]
    doc.change(0, seed=5)
    assert counted == [0, 1, 1, 0, 1]


def test_replaying_changes_no_bit_and_can_be_undone_past():
    doc = scenes.document()
    begin = scenes.bits(doc)
    for kind in KINDS:
        doc.add(edit(doc, kind, 1, seed=2))
    painted = scenes.bits(doc)
    assert not len(doc.replay())
    assert scenes.bits(doc) == painted
    while doc.undo_label:
        doc.undo()
    assert scenes.bits(doc) == begin
    while doc.redo_label:
        doc.redo()
    assert scenes.bits(doc) == painted


def test_the_budget_drops_the_oldest_steps_only():
    free, tight = scenes.document(), scenes.document(budget_mb=0.02)
    for doc in (free, tight):
        for at in range(5):
            doc.add(edit(doc, "paint", at % 4, seed=at))
            doc.remove(at)
    assert scenes.bits(free) == scenes.bits(tight)
    assert free.history_mb > tight.history_mb
    counts = []
    for doc in (free, tight):
        count = 0
        while doc.undo_label:
            doc.undo()
            count += 1
        counts.append(count)
        forth = 0
        while doc.redo_label:
            doc.redo()
            forth += 1
        assert forth == count
        assert doc.edits == ()
    assert counts[0] == 10 and 1 <= counts[1] < 10
    assert scenes.bits(free) == scenes.bits(tight)


@pytest.mark.parametrize("kind", KINDS)
def test_cancelling_anywhere_leaves_everything_as_it_was(kind):
    doc = scenes.document()
    doc.add(edit(doc, "paint", 0))
    doc.add(edit(doc, "stamp", 0, seed=1))
    calls = []
    trial = scenes.document()
    for each in doc.edits:
        trial.add(replace(each))
    trial.add(edit(trial, kind, 0, seed=3), progress=lambda done, label: calls.append(done))
    assert calls and calls == sorted(calls) and 0 <= calls[0] and calls[-1] <= 1
    before = scenes.bits(doc), doc.layers, doc.next_uid, doc.undo_label, doc.engine.writer.tobytes()
    for stop in sorted({0, len(calls) // 3, len(calls) // 2, len(calls) - 1}):
        left = [stop]

        def progress(done, label, left=left):
            left[0] -= 1
            if left[0] < 0:
                raise Cancelled

        with pytest.raises(Cancelled):
            doc.add(edit(doc, kind, 0, seed=3), progress=progress)
        after = scenes.bits(doc), doc.layers, doc.next_uid, doc.undo_label
        assert (*after, doc.engine.writer.tobytes()) == before
        assert (doc.engine.flattener.local == -1).all() and not doc.engine.busy
    doc.add(edit(doc, kind, 0, seed=3))
    assert scenes.bits(doc) == scenes.bits(trial)


def test_cancelling_a_change_below_puts_all_back():
    doc = scenes.document()
    doc.add(edit(doc, "paint", 0))
    doc.add(edit(doc, "erase", 0))
    doc.add(edit(doc, "repair", 0))
    before, layers = scenes.bits(doc), doc.layers
    labels = []

    def progress(done, label):
        labels.append(done)
        if done > 0.5:
            raise Cancelled

    with pytest.raises(Cancelled):
        doc.change(0, seed=9, progress=progress)
    assert labels[0] < 0.5  # something was computed anew before
    assert scenes.bits(doc) == before and doc.layers is layers
    doc.undo()
    doc.redo()
    assert scenes.bits(doc) == before


def test_an_error_within_an_edit_leaves_everything_as_it_was(monkeypatch):
    doc = scenes.document()
    doc.add(edit(doc, "paint", 0))
    before, writer = scenes.bits(doc), doc.engine.writer.tobytes()
    accept = type(doc.engine.state).accept
    left = [2]

    def failing(*arguments, **more):
        left[0] -= 1
        if left[0] < 0:
            raise MemoryError("no room")
        return accept(*arguments, **more)

    monkeypatch.setattr(type(doc.engine.state), "accept", failing)
    with pytest.raises(MemoryError):
        doc.add(edit(doc, "repair", 1, radius=12.0))
    monkeypatch.undo()
    assert scenes.bits(doc) == before and doc.engine.writer.tobytes() == writer
    assert (doc.engine.flattener.local == -1).all()
    doc.add(edit(doc, "repair", 1, radius=12.0))
    other = scenes.document()
    for each in doc.edits:
        other.add(replace(each))
    assert scenes.bits(doc) == scenes.bits(other)


def test_uids_are_never_given_again():
    doc = scenes.document()
    doc.add(edit(doc, "requilt", 0))
    doc.undo()
    doc.add(edit(doc, "requilt", 0))
    doc.remove(1)
    doc.add(edit(doc, "requilt", 0))
    assert [each.uid for each in doc.edits] == [2]


def test_nothing_changes_far_from_an_edit():
    doc = scenes.document(rate=192)
    size = 14 + 6  # of the edits themselves, in edges
    reach = 2 * doc.engine.largest(0)
    near = rings(doc.engine, np.array([PLACES[2]], np.int32), size + reach)
    assert len(near) < 0.8 * len(doc.engine.state.patch)
    for kind in KINDS:
        before = doc.engine.copy()
        changed = doc.add(edit(doc, kind, 2))
        differ = doc.engine.differences(before)
        assert len(differ) or kind in ("erase", "requilt")
        assert np.isin(differ, changed).all() and np.isin(differ, near).all()


def test_wrong_verbs_are_refused_by_name():
    doc = scenes.document()
    doc.add(edit(doc, "requilt", 0))
    with pytest.raises(InvalidEdit, match="there is no edit 7"):
        doc.remove(7)
    with pytest.raises(InvalidEdit, match="place 1 of 1"):
        doc.move(0, 1)
    with pytest.raises(InvalidEdit, match="no field colour"):
        doc.change(0, colour=1)
    with pytest.raises(InvalidEdit, match="no field uid"):
        doc.change(0, uid=1)
    with pytest.raises(InvalidEdit, match="seed"):
        doc.change(0, seed=-1)
    assert [each.uid for each in doc.edits] == [0]
