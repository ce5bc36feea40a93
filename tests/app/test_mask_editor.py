"""Marking the feature as a user does it: mouse and keys on the real dialog."""

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import Qt, QTimer  # noqa: E402
from PyQt6.QtTest import QTest  # noqa: E402
from PyQt6.QtWidgets import (  # noqa: E402
    QApplication,
    QDialog,
    QMessageBox,
)

from app.panels.mask_editor import MaskEditor  # noqa: E402
from app.panels.mask_work import MaskTool  # noqa: E402
from btfcore.btf.image import read_mask  # noqa: E402
from btfcore.btf.mask_tools import brush, feathered, grown, lasso  # noqa: E402
from tests.app.masks import FAR_SPOT, LEFT, LONG, NONE, SPOT, at, drag, idle, spotted, texel  # noqa: E402


@pytest.fixture
def make(qtbot):
    """Make a shown editor that is idle."""
    made = []

    def open_(colour=None, mask=None, **details):
        editor = MaskEditor("spots", spotted() if colour is None else colour, mask, **details)
        made.append(editor)
        editor.resize(900, 640)
        editor.show()
        qtbot.waitExposed(editor)
        idle(qtbot, editor)
        return editor

    yield open_
    for editor in made:
        editor.done(0)
        editor.deleteLater()


def test_a_drag_draws_what_the_brush_says_and_undo_takes_it_back(qtbot, make):
    editor = make()
    path = [(30, 20), (50, 25), (60, 45)]
    drag(editor, path)
    wanted = brush(np.zeros((90, 120), "f4"), [texel(editor, *p) for p in path])
    assert np.allclose(editor.drawn_mask(), wanted, atol=1e-6)
    drag(editor, [(90, 70)])
    two = editor.drawn_mask()
    QTest.keyClick(editor.view, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert np.allclose(editor.drawn_mask(), wanted, atol=1e-6)
    QTest.mouseClick(editor.undo, LEFT)
    assert editor.drawn_mask().max() == 0 and not editor.undo.isEnabled()
    QTest.mouseClick(editor.redo, LEFT)
    QTest.mouseClick(editor.redo, LEFT)
    assert np.array_equal(editor.drawn_mask(), two)


def test_alt_x_and_the_right_button_remove(qtbot, make):
    editor = make(mask=np.ones((90, 120), "f4"))
    drag(editor, [(30, 20)], keys=Qt.KeyboardModifier.AltModifier)
    assert editor.drawn_mask()[20, 30] == 0
    drag(editor, [(60, 20)], button=Qt.MouseButton.RightButton)
    assert editor.drawn_mask()[20, 60] == 0
    QTest.keyClick(editor.view, Qt.Key.Key_X)
    assert editor.remove.isChecked()
    drag(editor, [(90, 20)])
    assert editor.drawn_mask()[20, 90] == 0
    QTest.keyClick(editor.view, Qt.Key.Key_X)
    drag(editor, [(90, 20)])
    assert editor.drawn_mask()[20, 90] == 1 and not editor.remove.isChecked()


def test_shift_draws_a_straight_line_and_escape_takes_a_stroke_back(qtbot, make):
    editor = make()
    drag(editor, [(20, 20)])
    drag(editor, [(100, 20)], keys=Qt.KeyboardModifier.ShiftModifier)
    assert (editor.drawn_mask()[20, 20:101] > 0.5).all()
    before = editor.drawn_mask()
    QTest.mousePress(editor.view, LEFT, NONE, at(editor, 60, 70))
    QTest.mouseMove(editor.view, at(editor, 80, 70))
    assert not np.array_equal(editor.drawn_mask(), before)
    QTest.keyClick(editor.view, Qt.Key.Key_Escape)
    QTest.mouseRelease(editor.view, LEFT, NONE, at(editor, 80, 70))
    assert np.array_equal(editor.drawn_mask(), before) and editor.isVisible()
    assert editor.model.history.undo_label == "Stroke"


def test_the_lasso_is_dragged_or_clicked(qtbot, make):
    editor = make()
    QTest.keyClick(editor.view, Qt.Key.Key_L)
    assert editor.tools[MaskTool.LASSO].isChecked()
    corners = [(20, 20), (60, 22), (55, 60), (25, 50)]
    drag(editor, corners)
    idle(qtbot, editor)
    wanted = lasso(np.zeros((90, 120), "f4"), [texel(editor, *p) for p in corners])
    assert np.allclose(editor.drawn_mask(), wanted, atol=1e-6)
    QTest.keyClick(editor.view, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    for corner in corners:
        QTest.mouseClick(editor.view, LEFT, NONE, at(editor, *corner))
    assert editor.drawn_mask().max() == 0, "an open outline marks nothing"
    QTest.keyClick(editor.view, Qt.Key.Key_Return)
    idle(qtbot, editor)
    assert np.allclose(editor.drawn_mask(), wanted, atol=1e-6) and editor.isVisible()
    QTest.mouseClick(editor.view, LEFT, NONE, at(editor, 90, 70))
    QTest.keyClick(editor.view, Qt.Key.Key_Escape)
    assert editor.isVisible() and np.allclose(editor.drawn_mask(), wanted, atol=1e-6)


def test_a_flood_takes_the_spot_and_follows_its_tolerance(qtbot, make):
    editor = make()
    QTest.keyClick(editor.view, Qt.Key.Key_W)
    editor.options.spin("smoothing").setValue(0)
    QTest.mouseClick(editor.view, LEFT, NONE, at(editor, 70, 40))
    idle(qtbot, editor)
    assert np.array_equal(editor.drawn_mask() > 0.5, SPOT)
    editor.options.check("contiguous").click()
    idle(qtbot, editor)
    assert np.array_equal(editor.drawn_mask() > 0.5, SPOT | FAR_SPOT)
    editor.options.spin("tolerance").setValue(60)
    editor.options.check("contiguous").click()
    idle(qtbot, editor)
    assert editor.model.share == 1 and not editor.ok.isEnabled()
    assert "All of it is marked" in editor.readout.text()
    editor.options.spin("tolerance").setValue(10)
    idle(qtbot, editor)
    assert np.array_equal(editor.drawn_mask() > 0.5, SPOT)
    editor.model.undo()  # however often it was changed, one flood is one step
    assert editor.drawn_mask().max() == 0 and editor.model.history.undo_label is None
    editor.options.spin("tolerance").setValue(20)
    idle(qtbot, editor)
    assert editor.drawn_mask().max() == 0, "what was undone is not flooded again"


def test_a_rough_mark_is_flooded_down_to_the_feature(qtbot, make):
    editor = make()
    drag(editor, [(60, 40), (80, 40)])
    rough = editor.drawn_mask()
    QTest.mouseClick(editor.tools[MaskTool.FLOOD], LEFT)
    editor.options.check("within").click()
    editor.options.check("contiguous").click()
    QTest.mouseClick(editor.view, LEFT, NONE, at(editor, 70, 40))
    idle(qtbot, editor)
    found = editor.drawn_mask()
    assert (found <= rough).all() and not found[FAR_SPOT].any()
    assert np.mean((found > 0.5) != (SPOT & (rough > 0.5))) < 0.01


def test_the_whole_mask_is_inverted_grown_feathered_and_cleared(qtbot, make):
    start = SPOT.astype("f4")
    editor = make(mask=start)
    buttons = editor.options.buttons
    editor.options.amount.setValue(3)
    now = start
    for name, change in (
        ("invert", lambda m: 1 - m),
        ("grow", lambda m: grown(m, 3)),
        ("shrink", lambda m: grown(m, -3)),
        ("feather", lambda m: feathered(m, 3)),
        ("clear", lambda m: m * 0),
    ):
        QTest.mouseClick(buttons[name], LEFT)
        idle(qtbot, editor)
        now = change(now)
        assert np.array_equal(editor.drawn_mask(), now), name
    for _ in range(5):
        QTest.mouseClick(editor.undo, LEFT)
    assert np.array_equal(editor.drawn_mask(), start) and not editor.model.changed
    QTest.mouseClick(buttons["similar"], LEFT)
    idle(qtbot, editor)
    assert np.mean((editor.drawn_mask() > 0.5) != (SPOT | FAR_SPOT)) < 0.01


def test_what_is_asked_for_meanwhile_waits_its_turn(qtbot, make):
    editor = make(mask=SPOT.astype("f4"))
    editor.model.grow(4)
    editor.model.invert()
    editor.model.set(remove=True)
    drag(editor, [(10, 10)])  # while that runs
    editor.model.set(remove=False)
    editor.model.feather(1)
    idle(qtbot, editor)
    wanted = 1 - grown(SPOT.astype("f4"), 4)
    wanted = feathered(brush(wanted, [texel(editor, 10, 10)], remove=True), 1)
    assert np.allclose(editor.drawn_mask(), wanted, atol=1e-6)
    editor.model.grow(4)
    QTest.mousePress(editor.view, LEFT, NONE, at(editor, 100, 10))
    editor.model.invert()  # in the middle of a stroke
    idle_but_one = lambda: not editor.model.work.busy  # noqa: E731
    qtbot.waitUntil(idle_but_one, timeout=LONG)
    QTest.mouseRelease(editor.view, LEFT, NONE, at(editor, 100, 10))
    idle(qtbot, editor)
    wanted = 1 - brush(grown(wanted, 4), [texel(editor, 100, 10)])
    assert np.allclose(editor.drawn_mask(), wanted, atol=1e-6)
    for _ in range(200):
        editor.model.undo()
    idle(qtbot, editor)
    assert np.array_equal(editor.drawn_mask(), SPOT.astype("f4"))


def test_the_readout_warns_of_thin_lines_and_counts(qtbot, make):
    editor = make()
    assert not editor.ok.isEnabled() and "Nothing is marked" in editor.readout.text()
    editor.options.spin("radius").setValue(1)
    drag(editor, [(20, 20), (100, 20)])
    share = 100 * (editor.drawn_mask() > 0.5).mean()
    assert f"{share:.2f} %" in editor.readout.text() and editor.ok.isEnabled()
    qtbot.waitUntil(lambda: "thickened" in editor.readout.text(), timeout=LONG)


def answer(button):
    """Click a button of the question that is about to be asked."""
    asked = []

    def click():
        box = QApplication.activeModalWidget()
        if isinstance(box, QMessageBox):
            asked.append(box.text())
            box.button(button).click()

    QTimer.singleShot(200, click)
    return asked


def test_closing_with_changes_asks(qtbot, make):
    editor = make()
    drag(editor, [(60, 40)])
    kinds = QMessageBox.StandardButton
    asked = answer(kinds.Cancel)
    editor.close()
    assert len(asked) == 1 and editor.isVisible()
    asked = answer(kinds.Save)
    QTest.keyClick(editor.view, Qt.Key.Key_Escape)
    assert len(asked) == 1 and not editor.isVisible()
    assert editor.result() == QDialog.DialogCode.Accepted and editor.drawn_mask()[40, 60] == 1
    other = make()
    drag(other, [(60, 40)])
    asked = answer(kinds.Discard)
    other.close()
    assert len(asked) == 1 and other.result() == QDialog.DialogCode.Rejected
    unchanged = make()
    unchanged.close()
    assert not unchanged.isVisible()


def test_ok_returns_the_mask_and_none_where_it_was_left(qtbot):
    def act():
        editor = QApplication.activeModalWidget()
        drag(editor, [(60, 40)])
        QTest.mouseClick(editor.ok, LEFT)
        if editor.isVisible():  # the first stroke waits for the kernels
            QTimer.singleShot(100, act)

    QTimer.singleShot(300, act)
    found = MaskEditor.edited("spots", spotted())
    assert found.shape == (90, 120) and found.dtype == np.float32 and found[40, 60] == 1
    QTimer.singleShot(300, lambda: QApplication.activeModalWidget().close())
    assert MaskEditor.edited("spots", spotted(), found) is None


def test_a_saved_mask_is_read_back(qtbot, make, tmp_path):
    editor = make()
    drag(editor, [(20, 20), (90, 60)])
    assert editor.save(tmp_path / "mask.png")
    back = read_mask(tmp_path / "mask.png")
    assert np.abs(back - editor.drawn_mask()).max() <= 0.5 / 255 + 1e-6
    assert np.array_equal(back > 0.5, editor.drawn_mask() > 0.5)
    assert Image.open(tmp_path / "mask.png").mode == "L"
    assert not editor.save(tmp_path / "nowhere" / "mask.png")
    assert editor.errors.isVisible() and editor.model.changed


def test_closing_in_the_middle_of_work_is_quiet(qtbot, make):
    rng = np.random.default_rng(0)
    editor = make(rng.uniform(size=(600, 700, 3)).astype("f4"))
    editor.model.mark_similar()
    editor.model.feather(20)
    editor.model.flood_from(3, 3)
    editor.done(0)
    qtbot.wait(300)
    assert not editor.isVisible()
