"""The editor of the keys as a user meets it."""

import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QEvent, QSettings, Qt  # noqa: E402
from PyQt6.QtGui import QKeyEvent, QKeySequence  # noqa: E402
from PyQt6.QtWidgets import QApplication, QMessageBox  # noqa: E402

from app.key_events import key_of  # noqa: E402
from app.key_sheet import cheat_sheet  # noqa: E402
from app.key_table import BY_ID  # noqa: E402
from app.keys import Keymap  # noqa: E402
from app.panels.keys_dialog import KeysDialog  # noqa: E402


@pytest.fixture
def store(tmp_path):
    return QSettings(str(tmp_path / "keys.ini"), QSettings.Format.IniFormat)


@pytest.fixture
def dialog(qtbot, store):
    dialog = KeysDialog(Keymap(store))
    qtbot.addWidget(dialog)
    dialog.show()
    dialog.activateWindow()
    qtbot.waitExposed(dialog)
    qtbot.waitUntil(dialog.isActiveWindow)
    return dialog


def capture(qtbot, dialog, key, modifiers=Qt.KeyboardModifier.NoModifier):
    """Press the field, then a key."""
    qtbot.mouseClick(dialog.field, Qt.MouseButton.LeftButton)
    assert dialog.field.listening
    qtbot.keyClick(dialog.field, key, modifiers)
    assert not dialog.field.listening


def test_a_key_is_captured_and_added(qtbot, dialog):
    dialog.mark("tool.measure")
    capture(qtbot, dialog, Qt.Key.Key_M, Qt.KeyboardModifier.ControlModifier)
    assert dialog._keymap.keys("tool.measure") == ("U", "Ctrl+M")
    assert dialog.items["tool.measure"].text(1) == "U / Ctrl+M"
    assert dialog.items["tool.measure"].font(1).bold()
    qtbot.mouseClick(dialog.reset, Qt.MouseButton.LeftButton)
    assert dialog.items["tool.measure"].text(1) == "U"
    assert not dialog.reset.isEnabled()


def test_a_conflict_is_shown_and_solved(qtbot, dialog):
    dialog.mark("tool.measure")
    assert not dialog.take.isVisible()
    capture(qtbot, dialog, Qt.Key.Key_S)
    assert "Stamp" in dialog.told.text() and dialog.take.isVisible()
    assert dialog._keymap.keys("tool.stamp") == ("S",)
    qtbot.mouseClick(dialog.take, Qt.MouseButton.LeftButton)
    assert dialog._keymap.keys("tool.measure") == ("U", "S")
    assert dialog._keymap.keys("tool.stamp") == ()
    assert not dialog.take.isVisible() and dialog.told.text() == ""


@pytest.mark.parametrize(
    ("key", "modifiers", "expected"),
    [
        (Qt.Key.Key_Tab, Qt.KeyboardModifier.NoModifier, "Tab"),
        (Qt.Key.Key_F5, Qt.KeyboardModifier.ShiftModifier, "Shift+F5"),
        (Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier, "Ctrl+Return"),
        (Qt.Key.Key_Q, Qt.KeyboardModifier.AltModifier, "Alt+Q"),
    ],
)
def test_keys_with_another_use_can_be_captured(qtbot, dialog, key, modifiers, expected):
    heard = []
    dialog.field.captured.connect(heard.append)
    capture(qtbot, dialog, key, modifiers)
    assert heard == [expected] and dialog.isVisible()


def test_esc_and_a_click_elsewhere_stop_capturing(qtbot, dialog):
    heard = []
    dialog.field.captured.connect(heard.append)
    capture(qtbot, dialog, Qt.Key.Key_Escape)
    assert dialog.isVisible()
    dialog.field.listen()
    qtbot.keyClick(dialog.field, Qt.Key.Key_Shift)
    assert dialog.field.listening  # a modifier alone is no key
    dialog.search.setFocus()
    qtbot.waitUntil(lambda: not dialog.field.listening)
    assert heard == []


@pytest.mark.parametrize(
    ("key", "modifiers", "mac", "expected"),
    [
        (Qt.Key.Key_BraceLeft, Qt.KeyboardModifier.ShiftModifier, False, "{"),
        (Qt.Key.Key_B, Qt.KeyboardModifier.ShiftModifier, False, "Shift+B"),
        (Qt.Key.Key_Backtab, Qt.KeyboardModifier.ShiftModifier, False, "Shift+Tab"),
        (Qt.Key.Key_1, Qt.KeyboardModifier.KeypadModifier, False, "Num+1"),
        (Qt.Key.Key_End, Qt.KeyboardModifier.KeypadModifier, False, "Num+1"),
        (Qt.Key.Key_Left, Qt.KeyboardModifier.KeypadModifier, False, "Num+4"),
        (Qt.Key.Key_Left, Qt.KeyboardModifier.KeypadModifier, True, "Left"),
    ],
)
def test_how_a_press_is_written(key, modifiers, mac, expected):
    event = QKeyEvent(QEvent.Type.KeyPress, key, modifiers)
    assert key_of(event, mac=mac) == expected
    assert QKeySequence(expected).toString(QKeySequence.SequenceFormat.PortableText) == expected


def test_the_search_finds_names_and_keys(qtbot, dialog):
    def seen():
        return {command for command, item in dialog.items.items() if not item.isHidden()}

    qtbot.keyClicks(dialog.search, "stamp")
    assert seen() == {"tool.stamp", "brush.turn_left", "brush.turn_right"}
    assert dialog.command in seen()
    dialog.search.setText("ctrl+z")
    assert seen() == {"edit.undo"}
    dialog.search.setText("nothing like it")
    assert seen() == set() and dialog.command == "" and not dialog.field.isEnabled()
    dialog.search.clear()
    assert seen() == set(BY_ID)


def test_reset_all_asks_first(qtbot, dialog):
    dialog._keymap.assign("tool.measure", ["K"])
    for button, expected in (("Leave as it is", ("K",)), ("Reset", ("U",))):
        qtbot.mouseClick(dialog.reset_all, Qt.MouseButton.LeftButton)
        box = dialog.findChild(QMessageBox)
        found = next(each for each in box.buttons() if each.text() == button)
        qtbot.mouseClick(found, Qt.MouseButton.LeftButton)
        assert dialog._keymap.keys("tool.measure") == expected
        QApplication.sendPostedEvents(box, QEvent.Type.DeferredDelete)


def test_the_preset_and_the_copied_sheet(qtbot, dialog):
    dialog.preset.setCurrentIndex(dialog.preset.findData("blender"))
    dialog.preset.activated.emit(dialog.preset.currentIndex())
    assert dialog.items["brush.size"].text(1) == "F"
    qtbot.mouseClick(dialog.copy, Qt.MouseButton.LeftButton)
    text = QApplication.clipboard().text()
    assert text == cheat_sheet(dialog._keymap, "patina") and "`Shift+F`" in text


def test_a_list_of_some_commands(qtbot, store):
    dialog = KeysDialog(Keymap(store), only={"tool.stamp", "help.tool"})
    qtbot.addWidget(dialog)
    assert set(dialog.items) == {"tool.stamp", "help.tool"}
    assert dialog.tree.topLevelItemCount() == 2
