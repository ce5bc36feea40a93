"""The list of layers and the history as a user meets them: mouse and keys."""

import time

import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QModelIndex, QPoint, QPointF, Qt, QTimer  # noqa: E402
from PyQt6.QtGui import QDropEvent, QKeySequence, QShortcut  # noqa: E402
from PyQt6.QtTest import QTest  # noqa: E402
from PyQt6.QtWidgets import QLineEdit, QWidget  # noqa: E402

from app.document import Document  # noqa: E402
from app.panels.history import HistoryPanel  # noqa: E402
from app.panels.layers import LayersPanel  # noqa: E402
from tests.app.panels_world import Verbs, layer, settings, uids  # noqa: E402
from tests.app.xmouse import button, move, there_is_a_mouse  # noqa: E402

LEFT, NONE = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
CONTROL = Qt.KeyboardModifier.ControlModifier
KINDS = ("paint", "stamp", "erase", "repair", "requilt")


@pytest.fixture
def document(qtbot):
    return Document()


@pytest.fixture
def verbs(document):
    made = Verbs(document)
    made.put(layer(uid, kind) for uid, kind in enumerate(KINDS))
    return made


@pytest.fixture
def panel(qtbot, document, verbs, tmp_path):
    panel = LayersPanel(document, verbs, settings(tmp_path))
    qtbot.addWidget(panel)
    panel.resize(330, 560)
    panel.show()
    qtbot.waitExposed(panel)
    return panel


def place(panel, uid, x=90):
    """Where the row of a layer is in the view."""
    rect = panel.view.visualRect(panel.model.index(panel.model.row_of(uid)))
    return QPoint(rect.left() + x, rect.center().y())


def click(panel, uid, x=90, keys=NONE):
    QTest.mouseClick(panel.view.viewport(), LEFT, keys, place(panel, uid, x))


def names(panel):
    return [panel.model.index(row).data() for row in range(panel.model.rowCount())]


def test_the_top_of_the_stack_is_on_top(panel):
    assert names(panel) == ["requilt 4", "repair 3", "erase 2", "stamp 1", "paint 0"]
    assert not panel.hint.isVisible()


def test_a_click_selects_in_the_document_and_back(panel, document):
    click(panel, 1)
    assert document.selected == 1
    document.select(3)
    assert panel.view.currentIndex().row() == panel.model.row_of(3) and panel.selected() == [3]
    document.select(None)
    assert panel.selected() == []


def test_the_eye_hides_and_leaves_the_selection(panel, document, verbs):
    click(panel, 1)
    click(panel, 3, x=12)
    assert verbs.asked == [("show", 3, False)] and document.selected == 1
    assert not document.layers[3].visible
    click(panel, 3, x=12)
    assert document.layers[3].visible
    QTest.mouseDClick(panel.view.viewport(), LEFT, NONE, place(panel, 3, x=12))
    assert panel.view.state() != panel.view.State.EditingState


def test_f2_renames_in_place_though_the_window_has_the_key_too(qtbot, panel, document, verbs):
    heard = []
    shortcut = QShortcut(QKeySequence("F2"), panel)
    shortcut.activated.connect(lambda: heard.append(1))
    click(panel, 2)
    panel.activateWindow()
    panel.view.setFocus()
    QTest.keyClick(panel.view, Qt.Key.Key_F2)
    editor = panel.view.findChild(QLineEdit)
    assert editor is not None and editor.text() == "erase 2" and not heard
    editor.selectAll()
    QTest.keyClicks(editor, "scratch on the lid")
    verbs.put([*document.layers, layer(9)])  # another edit ends meanwhile
    assert panel.view.findChild(QLineEdit) is editor, "the field stays open"
    QTest.keyClick(editor, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: ("rename", 2, "scratch on the lid") in verbs.asked)
    assert document.layers[2].name == "scratch on the lid"


def test_an_empty_name_is_not_taken(qtbot, panel, verbs):
    click(panel, 2)
    QTest.keyClick(panel.view, Qt.Key.Key_F2)
    editor = panel.view.findChild(QLineEdit)
    editor.selectAll()
    QTest.keyClick(editor, Qt.Key.Key_Delete)
    QTest.keyClick(editor, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: panel.view.state() != panel.view.State.EditingState)
    assert verbs.asked == []


def test_several_are_deleted_and_duplicated_by_keys(panel, document, verbs):
    click(panel, 4)
    click(panel, 2, keys=CONTROL)
    QTest.keyClick(panel.view, Qt.Key.Key_J, CONTROL)
    assert [ask for ask in verbs.asked if ask[0] == "duplicate"] == [
        ("duplicate", 4), ("duplicate", 2),
    ]  # fmt: skip
    assert sorted(panel.selected()) == [2, 4]
    QTest.keyClick(panel.view, Qt.Key.Key_Delete)
    assert uids(document) == [0, 1, 6, 3, 5]


def test_buttons_move_and_stop_at_the_ends(panel, document):
    click(panel, 0)
    assert not panel.buttons["down"].isEnabled()
    QTest.mouseClick(panel.buttons["up"], LEFT)
    assert uids(document) == [1, 0, 2, 3, 4]
    QTest.keyClick(panel.view, Qt.Key.Key_Down, Qt.KeyboardModifier.AltModifier)
    assert uids(document) == [0, 1, 2, 3, 4]
    click(panel, 4)
    assert not panel.buttons["up"].isEnabled()


@pytest.mark.parametrize("moved", [(0,), (4,), (2,), (0, 4), (1, 3), (0, 1, 4), (4, 3)])
@pytest.mark.parametrize("row", range(6))
def test_dropping_gives_the_order_that_was_shown(panel, document, moved, row):
    rows = [4, 3, 2, 1, 0]
    kept = [uid for uid in rows if uid not in moved]
    at = sum(uid not in moved for uid in rows[:row])
    wanted = [*kept[:at], *sorted(moved, reverse=True), *kept[at:]]
    panel.model.move(list(moved), row)
    assert uids(document) == wanted[::-1]


def drop(panel, uid, at):
    """Drop the row of a layer at a place, as Qt does at the end of a drag."""
    data = panel.model.mimeData([panel.model.index(panel.model.row_of(uid))])
    event = QDropEvent(QPointF(at), Qt.DropAction.MoveAction, data, LEFT, NONE)
    panel.view.dropEvent(event)


def test_a_drop_between_rows_moves_and_keeps_the_selection(panel, document, verbs):
    click(panel, 4)
    below = panel.view.visualRect(panel.model.index(panel.model.row_of(2)))
    drop(panel, 4, QPoint(60, below.bottom()))
    assert uids(document) == [0, 1, 4, 2, 3]
    assert document.selected == 4 and panel.selected() == [4]


def test_a_row_is_dragged_by_a_real_mouse(qtbot, panel, document, verbs):
    if not there_is_a_mouse():
        pytest.skip("no X server with the test extension")
    panel.move(40, 40)
    panel.activateWindow()
    qtbot.wait(50)
    port = panel.view.viewport()
    start = port.mapToGlobal(place(panel, 4))
    below = panel.view.visualRect(panel.model.index(panel.model.row_of(1))).bottom()
    end = port.mapToGlobal(QPoint(90, below))
    ways = [start + QPoint(0, each) for each in (0, 4, 12, 30)] + [end - QPoint(0, 3), end, end]
    acts = [lambda: move(start.x(), start.y()), lambda: button(True)]
    acts += [lambda at=at: move(at.x(), at.y()) for at in ways]
    acts += [lambda: button(False)]
    clock = QTimer()  # the drag has an event loop of its own
    clock.timeout.connect(lambda: acts.pop(0)() if acts else clock.stop())
    clock.start(60)
    try:
        qtbot.waitUntil(lambda: uids(document) == [0, 4, 1, 2, 3] or not acts, timeout=10_000)
        qtbot.waitUntil(lambda: not clock.isActive())
    finally:
        button(False)
    assert uids(document) == [0, 4, 1, 2, 3] and verbs.asked == [("move", 4, 1)]
    assert document.selected == 4


def test_layers_of_another_window_are_refused(panel, document, verbs, qtbot, tmp_path):
    other = Document()
    theirs = Verbs(other)
    theirs.put([layer(0), layer(1)])
    stranger = LayersPanel(other, theirs, settings(tmp_path))
    qtbot.addWidget(stranger)
    data = stranger.model.mimeData([stranger.model.index(0)])
    assert not panel.model.canDropMimeData(data, Qt.DropAction.MoveAction, 0, 0, QModelIndex())
    panel.model.dropMimeData(data, Qt.DropAction.MoveAction, 0, 0, QModelIndex())
    assert verbs.asked == []


def test_nothing_is_computed_while_a_slider_is_dragged(panel, document, verbs):
    click(panel, 0)
    slider = panel.knobs.weight.slider
    middle = slider.rect().center()
    handle = QPoint(round(slider.width() * slider.value() / 1000), middle.y())
    QTest.mousePress(slider, LEFT, NONE, handle)
    for x in range(handle.x(), slider.width() - 4, 9):
        QTest.mouseMove(slider, QPoint(x, middle.y()))
    assert slider.isSliderDown() and panel.knobs.weight.value > 2
    QTest.qWait(450)  # longer than a rest
    assert verbs.asked == []
    QTest.mouseRelease(slider, LEFT, NONE, QPoint(slider.width() - 4, middle.y()))
    ((verb, uid, knobs),) = verbs.asked
    assert (verb, uid) == ("change", 0) and knobs["weight"] == panel.knobs.weight.value
    assert document.layers[0].edit.weight == knobs["weight"]


def test_typed_settings_are_taken_on_enter(panel, document, verbs):
    click(panel, 1)
    assert panel.knobs.scale.isVisible() and not panel.knobs.transition.isVisible()
    field = panel.knobs.rotation.field
    field.selectAll()
    QTest.keyClicks(field, "33.5")
    assert verbs.asked == []
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert verbs.asked == [("change", 1, {"rotation": 33.5})]
    click(panel, 0)
    field = panel.knobs.transition
    assert field.text() == "automatic"
    field.selectAll()
    QTest.keyClicks(field, "0,25")
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert document.layers[0].edit.transition == 0.25
    field.selectAll()
    QTest.keyClick(field, Qt.Key.Key_Delete)
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert document.layers[0].edit.transition is None and field.text() == "automatic"


def test_typing_goes_on_while_other_edits_end(panel, document, verbs):
    for uid, field in ((0, panel.knobs.transition), (1, panel.knobs.rotation.field)):
        click(panel, uid)
        field.setFocus()
        field.selectAll()
        QTest.keyClicks(field, "1")
        verbs.put([*document.layers, layer(20 + uid)])
        QTest.keyClicks(field, "2")
        QTest.keyClick(field, Qt.Key.Key_Return)
    assert document.layers[0].edit.transition == 12 and document.layers[1].edit.rotation == 12


def test_a_refused_change_shows_what_still_is(panel, document, verbs, monkeypatch):
    monkeypatch.setattr(verbs, "change_layer", lambda uid, **knobs: False)
    click(panel, 0)
    field = panel.knobs.weight.field
    field.selectAll()
    QTest.keyClicks(field, "3")
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert panel.knobs.weight.value == 0.5


def test_a_layer_that_is_waited_for_can_only_be_looked_at(qtbot, panel, document, verbs):
    waiting = layer(-1, "paint", "Paint")
    verbs.put([*document.layers, type(waiting)(-1, "Paint", "paint", busy=True)])
    assert names(panel)[0] == "Paint" and panel._spin.isActive()
    turn = panel.tile.turn
    qtbot.waitUntil(lambda: panel.tile.turn != turn)
    click(panel, -1)
    for key in (Qt.Key.Key_F2, Qt.Key.Key_Delete, Qt.Key.Key_Space):
        QTest.keyClick(panel.view, key)
    click(panel, -1, x=12)
    assert verbs.asked == [] and panel.view.findChild(QLineEdit) is None
    panel.model.move([0], 0)  # onto the very top, above what waits
    assert [uid for uid in uids(document) if uid >= 0] == [1, 2, 3, 4, 0]
    verbs.put(each for each in document.layers if not each.busy)
    assert not panel._spin.isActive()


def test_notes_are_the_tooltip(panel, verbs, document):
    verbs.put([layer(0, notes=("The feature is wider than the stroke.",))])
    tip = panel.model.index(0).data(Qt.ItemDataRole.ToolTipRole)
    assert "wider than the stroke" in tip and "rust" in tip


def test_without_layers_there_is_a_hint(panel, verbs):
    verbs.put([])
    assert panel.hint.isVisible() and not panel.view.isVisible()
    assert not any(button.isEnabled() for button in panel.buttons.values())


def test_five_hundred_layers_make_no_widgets_and_keep_selection(qtbot, panel, document, verbs):
    before = len(panel.findChildren(QWidget))
    many = [layer(uid, KINDS[uid % 5]) for uid in range(500)]
    verbs.put(many)
    assert len(panel.findChildren(QWidget)) == before
    click(panel, 495)
    start = time.process_time()
    verbs.put([*many, layer(500)])
    panel.grab()
    spent = time.process_time() - start
    print(f"500 layers: followed and drawn in {spent * 1000:.0f} ms")  # noqa: T201
    assert document.selected == 495 and panel.selected() == [495]


def test_every_control_says_what_it_is(panel):
    click(panel, 0)
    for widget in (*panel.buttons.values(), panel.knobs.weight.slider, panel.knobs.weight.field,
                   panel.knobs.transition, panel.knobs.rotation.field):  # fmt: skip
        assert widget.toolTip() and widget.accessibleName()
    assert panel.view.accessibleName() and panel.knobs.seed.toolTip()


# --- history


@pytest.fixture
def history(qtbot, document, verbs):
    panel = HistoryPanel(document, verbs)
    qtbot.addWidget(panel)
    panel.resize(280, 300)
    panel.show()
    qtbot.waitExposed(panel)
    return panel


def test_a_click_goes_to_a_step_and_the_rest_is_grey(history, document, verbs):
    assert history.hint.isVisible()
    verbs.put(document.layers, ("Synthesise", "Stamp rust", "Paint moss"), 3)
    role = Qt.ItemDataRole
    model = history.model
    assert [model.index(row).data().strip(" ▸") for row in range(4)] == [
        "Beginning", "Synthesise", "Stamp rust", "Paint moss",
    ]  # fmt: skip
    rect = history.view.visualRect(model.index(1))
    QTest.mouseClick(history.view.viewport(), LEFT, NONE, rect.center())
    assert verbs.asked == [("undo_to", 1)]
    assert [model.index(row).data().startswith("▸") for row in range(4)] == [0, 1, 0, 0]
    assert [model.index(row).data(role.ForegroundRole) is not None for row in range(4)] == [
        False, False, True, True,
    ]  # fmt: skip
    assert history.view.currentIndex().row() == 1
    QTest.mouseClick(history.view.viewport(), LEFT, NONE, rect.center())
    assert len(verbs.asked) == 1, "it is there already"


def test_arrows_move_the_mark_and_only_enter_goes(history, document, verbs):
    verbs.put(document.layers, ("a", "b", "c"), 3)
    history.activateWindow()
    history.view.setFocus()
    QTest.keyClick(history.view, Qt.Key.Key_Up)
    QTest.keyClick(history.view, Qt.Key.Key_Up)
    assert verbs.asked == []
    QTest.keyClick(history.view, Qt.Key.Key_Return)
    assert verbs.asked == [("undo_to", 1)]
    verbs.put(document.layers, ("a", "d"), 2)  # another way was taken
    assert history.model.rowCount() == 3
