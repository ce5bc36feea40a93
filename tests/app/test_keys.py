"""The keys: the table's laws, what is stored, what actions do, and the sheet."""

import re
from pathlib import Path

import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QEvent, QSettings, Qt  # noqa: E402
from PyQt6.QtGui import QAction  # noqa: E402
from PyQt6.QtWidgets import (  # noqa: E402
    QApplication,
    QLineEdit,
    QMainWindow,
    QPushButton,
    QWidget,
)

from app.key_events import KeypadFilter  # noqa: E402
from app.key_sheet import cheat_sheet, presets_sheet  # noqa: E402
from app.key_table import (  # noqa: E402
    BY_ID,
    COMMANDS,
    DIFFERENCES,
    GROUPS,
    KEY_PRESETS,
    default_keys,
)
from app.keys import Keymap, KeyTaken, clash, normal_key  # noqa: E402
from app.navigation import COMMAND_VERBS, VIEWS  # noqa: E402
from btfcore.errors import InvalidParameter  # noqa: E402
from tests.app import xkeys  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def store(tmp_path):
    return QSettings(str(tmp_path / "keys.ini"), QSettings.Format.IniFormat)


def again(store):
    """A store that reads the file anew, as the next start does."""
    store.sync()
    return QSettings(store.fileName(), QSettings.Format.IniFormat)


def pairs_that_clash(keymap):
    """Pairs of commands that one key would ask for."""
    held = [(each.id, key) for each in COMMANDS for key in keymap.keys(each.id)]
    return [
        (one, other, key)
        for at, (one, key) in enumerate(held)
        for other, second in held[at + 1 :]
        if clash(key, second)
    ]


# --- the table


@pytest.mark.parametrize("preset", KEY_PRESETS)
def test_a_preset_gives_no_key_twice_and_loses_none(qtbot, store, preset):
    keymap = Keymap(store)
    keymap.set_preset(preset)
    assert pairs_that_clash(keymap) == []
    for each in COMMANDS:
        assert keymap.keys(each.id) == default_keys(preset, each.id)
    assert not any(keymap.is_changed(each.id) for each in COMMANDS)


def test_the_table_is_whole():
    assert len(BY_ID) == len(COMMANDS)
    assert {each.group for each in COMMANDS} == set(GROUPS)
    assert len({each.name for each in COMMANDS}) == len(COMMANDS)
    for differences in DIFFERENCES.values():
        assert set(differences) <= set(BY_ID)
    assert set(COMMAND_VERBS) | set(VIEWS) <= set(BY_ID)
    for each in COMMANDS:
        assert each.keys and all(normal_key(key) == key for key in each.keys)


@pytest.mark.parametrize(
    ("command", "key"),
    [
        ("brush.smaller", "["), ("brush.larger", "]"), ("brush.softer", "Shift+["),
        ("tool.brush", "B"), ("tool.erase", "E"), ("tool.stamp", "S"), ("tool.repair", "R"),
        ("tool.orient", "O"), ("tool.light", "L"), ("tool.mask", "M"), ("tool.pick", "I"),
        ("edit.undo", "Ctrl+Z"), ("edit.redo", "Ctrl+Shift+Z"), ("file.save", "Ctrl+S"),
        ("file.save_as", "Ctrl+Shift+S"), ("file.export", "Ctrl+E"), ("view.frame_all", "F"),
        ("view.panels", "Tab"), ("help.tool", "F1"), ("mode.colour", "1"), ("mode.split", "9"),
    ],
)  # fmt: skip
def test_the_keys_that_painters_expect(command, key):
    assert default_keys("patina", command)[0] == key


def test_blender_has_f_for_the_size():
    assert default_keys("blender", "brush.size") == ("F",)
    assert "F" not in default_keys("blender", "view.frame_all")


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ("B", "B", True),
        ("B", "Shift+B", False),
        ("Shift+[", "{", True),
        ("Shift+{", "{", True),
        ("[", "{", False),
        ("Shift+=", "+", True),
        ("1", "Num+1", False),
        ("Ctrl+K", "Ctrl+K, Ctrl+S", True),
        ("Ctrl+K, Ctrl+A", "Ctrl+K, Ctrl+S", False),
    ],
)
def test_what_clashes(one, other, expected):
    assert clash(one, other) is expected and clash(other, one) is expected


@pytest.mark.parametrize("text", ["", "nonsense", "Ctrl+", "Ctrl+Nope", "Space", "Ctrl+Space"])
def test_what_is_no_key_is_refused(text):
    with pytest.raises(InvalidParameter):
        normal_key(text)


# --- changes


def test_a_change_is_kept_for_its_preset(qtbot, store):
    keymap = Keymap(store)
    keymap.assign("tool.measure", ["Ctrl+M", "ctrl+m", "K"])
    assert keymap.keys("tool.measure") == ("Ctrl+M", "K")
    keymap.set_preset("maya")
    assert keymap.keys("tool.measure") == ("U",)
    keymap = Keymap(again(store))
    assert keymap.preset == "maya"
    keymap.set_preset("patina")
    assert keymap.keys("tool.measure") == ("Ctrl+M", "K") and keymap.is_changed("tool.measure")
    assert keymap.notes == ()


def test_a_key_of_another_command_is_taken_only_if_that_is_wanted(qtbot, store):
    keymap = Keymap(store)
    with pytest.raises(KeyTaken, match="Paint a feature") as caught:
        keymap.assign("tool.stamp", ["B"])
    assert caught.value.owners == ("tool.brush",)
    assert keymap.keys("tool.stamp") == ("S",) and keymap.keys("tool.brush") == ("B",)
    keymap.assign("tool.stamp", ["B"], take=True)
    assert keymap.keys("tool.stamp") == ("B",) and keymap.keys("tool.brush") == ()
    assert Keymap(again(store)).keys("tool.brush") == ()


def test_a_reset_takes_the_key_back(qtbot, store):
    keymap = Keymap(store)
    keymap.assign("tool.stamp", ["B"], take=True)
    keymap.reset("tool.brush")
    assert keymap.keys("tool.brush") == ("B",) and keymap.keys("tool.stamp") == ()
    keymap.reset_all()
    assert not any(keymap.is_changed(each.id) for each in COMMANDS)
    assert not [key for key in again(store).allKeys() if key.startswith("keys/patina")]


def test_no_two_commands_have_one_key_whatever_is_done(qtbot, store):
    import random

    dice = random.Random(3)
    keymap = Keymap(store)
    keys = [key for each in COMMANDS for key in each.keys] + ["{", "}", "Ctrl+K, Ctrl+S", "Ctrl+K"]
    for step in range(150):
        command = dice.choice(COMMANDS).id
        if step % 10 == 9:
            keymap.reset(command)
        else:
            keymap.assign(command, dice.sample(keys, dice.randrange(3)), take=True)
        if step == 75:
            keymap.set_preset("blender")
        assert pairs_that_clash(keymap) == []
    before = {each.id: keymap.keys(each.id) for each in COMMANDS}
    keymap = Keymap(again(store))
    assert {each.id: keymap.keys(each.id) for each in COMMANDS} == before
    assert keymap.notes == ()


def test_wrong_changes_change_nothing(qtbot, store):
    keymap = Keymap(store)
    changes = []
    keymap.changed.connect(lambda: changes.append(1))
    for command, keys in (
        ("tool.nothing", ["Ctrl+M"]),
        ("tool.stamp", ["nonsense"]),
        ("tool.stamp", ["Space"]),
        ("tool.stamp", ["F5", "F6", "F7", "F8", "F9"]),
    ):
        with pytest.raises(InvalidParameter):
            keymap.assign(command, keys, take=True)
    with pytest.raises(InvalidParameter, match="zbrush"):
        keymap.set_preset("zbrush")
    assert changes == [] and keymap.keys("tool.stamp") == ("S",)
    assert again(store).allKeys() == []


def test_a_broken_store_falls_back_with_a_note(qtbot, store):
    store.setValue("keys/preset", "zbrush")
    store.setValue("keys/patina/tool.stamp", "nonsense")
    store.setValue("keys/patina/tool.erase", "x" * 5000)
    store.setValue("keys/patina/tool.mask", "Ctrl+M")
    store.setValue("keys/patina/tool.pick", "Ctrl+M")  # after the mask's
    store.setValue("keys/patina/tool.measure", "S | Ctrl+,")  # takes the stamp's
    store.setValue("keys/patina/tool.unheard", "F9")
    keymap = Keymap(again(store))
    assert len(keymap.notes) == 4
    assert keymap.preset == "patina"
    assert keymap.keys("tool.erase") == ("E",)
    assert keymap.keys("tool.mask") == ("Ctrl+M",) and keymap.keys("tool.pick") == ("I",)
    assert keymap.keys("tool.measure") == ("S", "Ctrl+,")
    assert keymap.keys("tool.stamp") == () and keymap.keys("edit.settings") == ()
    assert pairs_that_clash(keymap) == []


# --- actions


@pytest.fixture
def window(qtbot, store):
    """A window with some actions; `window.done` lists those that ran."""
    window = QMainWindow()
    window.keymap = Keymap(store)
    window.done = []
    for command in ("tool.stamp", "brush.softer", "edit.redo", "view.front", "mode.colour"):
        action = window.keymap.bind(QAction(window), command)
        action.triggered.connect(lambda checked, command=command: window.done.append(command))
        window.addAction(action)
    window.view = QPushButton("view")
    window.other = QLineEdit()
    centre = QWidget()
    window.view.setParent(centre)
    window.other.setParent(centre)
    window.other.move(0, 40)
    window.setCentralWidget(centre)
    qtbot.addWidget(window)
    window.show()
    window.activateWindow()
    qtbot.waitExposed(window)
    window.view.setFocus()
    qtbot.waitUntil(window.view.hasFocus)
    return window


def test_bound_actions_run_and_changes_are_live(qtbot, window):
    def press(key, modifiers=Qt.KeyboardModifier.NoModifier):
        window.done.clear()
        qtbot.keyClick(window.view, key, modifiers)
        return list(window.done)

    assert press(Qt.Key.Key_S) == ["tool.stamp"]
    control, shift = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier
    assert press(Qt.Key.Key_Y, control) == ["edit.redo"]
    assert press(Qt.Key.Key_Z, control | shift) == ["edit.redo"]
    assert press(Qt.Key.Key_1) == ["mode.colour"]
    assert press(Qt.Key.Key_1, Qt.KeyboardModifier.KeypadModifier) == ["view.front"]
    window.keymap.assign("tool.stamp", ["K"])
    assert press(Qt.Key.Key_S) == [] and press(Qt.Key.Key_K) == ["tool.stamp"]
    window.keymap.assign("edit.redo", ["K"], take=True)
    assert press(Qt.Key.Key_K) == ["edit.redo"]
    window.keymap.reset_all()
    assert press(Qt.Key.Key_S) == ["tool.stamp"] and press(Qt.Key.Key_K) == []


REAL = [
    ("bracketleft", []), ("shift+bracketleft", ["brush.softer"]), ("1", ["mode.colour"]),
    ("KP_1", ["view.front"]), ("ctrl+y", ["edit.redo"]), ("ctrl+shift+z", ["edit.redo"]),
    ("shift+s", []), ("s", ["tool.stamp"]),
]  # fmt: skip


@pytest.mark.parametrize("num_lock", [False, True])
def test_a_real_keyboard_runs_the_same_commands(qtbot, window, num_lock):
    if not xkeys.there_is_a_keyboard():
        pytest.skip("no X server, or no libXtst")
    KeypadFilter(window.keymap, window)
    end = QAction(window)
    end.setShortcut("End")
    end.triggered.connect(lambda: window.done.append("end"))
    window.addAction(end)
    if num_lock:
        xkeys.press("Num_Lock")
    try:
        for keys, expected in REAL:
            window.done.clear()
            xkeys.press(keys)
            xkeys.press("End")  # comes after it
            qtbot.waitUntil(lambda: "end" in window.done)
            assert window.done == [*expected, "end"], keys
        window.done.clear()
        window.other.setFocus()
        xkeys.press("KP_1")
        qtbot.wait(50)
        assert window.done == []
        assert window.other.text() == ("1" if num_lock else "")
    finally:
        if num_lock:
            xkeys.press("Num_Lock")


def test_the_keypad_runs_only_actions_of_its_window_that_are_enabled(qtbot, window):
    other = QMainWindow()
    qtbot.addWidget(other)
    KeypadFilter(window.keymap, window)
    foreign = window.keymap.bind(QAction(other), "view.front")
    foreign.triggered.connect(lambda: window.done.append("foreign"))
    keypad = Qt.KeyboardModifier.KeypadModifier
    qtbot.keyClick(window.view, Qt.Key.Key_1, keypad)
    qtbot.keyClick(window.view, Qt.Key.Key_End, keypad)
    assert window.done == ["view.front"] * 2
    (action,) = (each for each in window.keymap.actions("Num+1") if each is not foreign)
    action.setEnabled(False)
    qtbot.keyClick(window.view, Qt.Key.Key_End, keypad)
    assert window.done == ["view.front"] * 2


def test_a_field_keeps_its_letters(qtbot, window):
    window.other.setFocus()
    qtbot.keyClicks(window.other, "s1")
    assert window.other.text() == "s1" and window.done == []


def test_tab_hides_panels_only_from_the_view(qtbot, window):
    action = window.keymap.bind(QAction(window), "view.panels")
    action.triggered.connect(lambda: window.done.append("view.panels"))
    window.view.addAction(action)
    qtbot.keyClick(window.view, Qt.Key.Key_Tab)
    assert window.done == ["view.panels"]
    window.other.setFocus()
    qtbot.keyClick(window.other, Qt.Key.Key_Tab)
    assert window.done == ["view.panels"]


def test_tooltips_tell_the_keys_as_they_are(qtbot, window):
    keymap = window.keymap
    button = QPushButton("Stamp")
    qtbot.addWidget(button)
    button.setToolTip("Put a feature down")
    keymap.tell(button, "tool.stamp")
    assert button.toolTip() == "Put a feature down (S)"
    keymap.assign("tool.stamp", ["Ctrl+M", "K"])
    assert button.toolTip() == "Put a feature down (Ctrl+M / K)"
    keymap.assign("tool.stamp", [])
    assert button.toolTip() == "Put a feature down"


def test_deleted_actions_are_forgotten(qtbot, store):
    keymap = Keymap(store)
    owner = QWidget()
    for _ in range(20):
        keymap.bind(QAction(owner), "tool.stamp")
    assert keymap.bound() == {"tool.stamp"}
    owner.deleteLater()
    QApplication.sendPostedEvents(owner, QEvent.Type.DeferredDelete)
    keymap.assign("tool.stamp", ["K"])  # must not touch them
    assert keymap.bound() == frozenset() and keymap._bound == []


# --- the sheet


def test_the_docs_are_as_the_table_says():
    text = (ROOT / "docs" / "keys.md").read_text(encoding="utf-8")
    assert text == presets_sheet(), "run: python -m app.key_sheet > docs/keys.md"


def test_a_sheet_shows_the_keys_in_force(qtbot, store):
    keymap = Keymap(store)
    keymap.assign("tool.measure", ["|", "`"])
    sheet = cheat_sheet(keymap, "maya")
    assert re.search(r"^\| Measure \| .*\\\|.* \|$", sheet, re.M)
    assert re.search(r"^\| Orbit \| Alt\+left, Shift\+Space\+left \|$", sheet, re.M)
    for row in re.findall(r"^\| .*$", sheet, re.M):
        assert len(re.findall(r"(?<!\\)\|", row)) == 3, row
    assert all(each.name in sheet for each in COMMANDS)
