"""Key presses as text of the table, and the keypad, which Qt's shortcuts do not tell apart.

On X11 Qt looks for a shortcut without the keypad's modifier: the keypad's 1 runs what 1 runs, and
"Num+1" never runs. `KeypadFilter` sees the press first.
"""

from __future__ import annotations

import sys
from typing import cast

from PyQt6.QtCore import QEvent, QKeyCombination, QObject, Qt
from PyQt6.QtGui import QKeyEvent, QKeySequence
from PyQt6.QtWidgets import QWidget

from app.keys import Keymap

_KEYPAD = Qt.KeyboardModifier.KeypadModifier
_SHIFT = Qt.KeyboardModifier.ShiftModifier
_COUNTED = (
    _SHIFT
    | _KEYPAD
    | Qt.KeyboardModifier.ControlModifier
    | Qt.KeyboardModifier.AltModifier
    | Qt.KeyboardModifier.MetaModifier
)
_ARROWS = (Qt.Key.Key_Left, Qt.Key.Key_Right, Qt.Key.Key_Up, Qt.Key.Key_Down)
_UNLOCKED = {  # what the keypad's keys are while Num Lock is off
    Qt.Key.Key_Insert: Qt.Key.Key_0,
    Qt.Key.Key_End: Qt.Key.Key_1,
    Qt.Key.Key_Down: Qt.Key.Key_2,
    Qt.Key.Key_PageDown: Qt.Key.Key_3,
    Qt.Key.Key_Left: Qt.Key.Key_4,
    Qt.Key.Key_Clear: Qt.Key.Key_5,
    Qt.Key.Key_Right: Qt.Key.Key_6,
    Qt.Key.Key_Home: Qt.Key.Key_7,
    Qt.Key.Key_Up: Qt.Key.Key_8,
    Qt.Key.Key_PageUp: Qt.Key.Key_9,
    Qt.Key.Key_Delete: Qt.Key.Key_Period,
}


def key_of(event: QKeyEvent, *, mac: bool = sys.platform == "darwin") -> str:
    """Portable text of a key press, as the table writes it.

    Shift is left out where it made another sign ("{" for Shift and "[" on a US layout), because
    which key that is depends on the layout. Keys of the keypad are the same with and without
    Num Lock. mac : arrows count to the keypad there, and there is no Num Lock.
    """
    key, modifiers = event.key(), event.modifiers() & _COUNTED
    if key == Qt.Key.Key_Backtab:
        key = Qt.Key.Key_Tab
    if modifiers & _KEYPAD:
        if mac and key in _ARROWS:
            modifiers &= ~_KEYPAD
        elif not mac:
            key = _UNLOCKED.get(Qt.Key(key), key)
    sign = chr(key) if 0x20 < key < 0x250 else ""
    if sign and not sign.isalnum():
        modifiers &= ~_SHIFT
    sequence = QKeySequence(QKeyCombination(modifiers, Qt.Key(key)))
    return sequence.toString(QKeySequence.SequenceFormat.PortableText)


class KeypadFilter(QObject):
    """Runs the actions of a window that have keys of the keypad; text fields come first."""

    def __init__(self, keymap: Keymap, window: QWidget) -> None:
        """Watch `window` for as long as it lives."""
        super().__init__(window)
        self._keymap, self._window = keymap, window
        window.installEventFilter(self)

    def eventFilter(self, target: QObject | None, event: QEvent | None) -> bool:  # noqa: N802
        """Take a press that nothing inside the window wants, before shortcuts are looked for."""
        if event is None or event.type() != QEvent.Type.ShortcutOverride:
            return False
        press = cast(QKeyEvent, event)
        if not press.modifiers() & _KEYPAD:
            return False
        key = key_of(press)
        if "Num+" not in key:
            return False
        for action in self._keymap.actions(key):
            if action.isEnabled() and _is_of(action, self._window):
                press.accept()
                if not press.isAutoRepeat() or action.autoRepeat():
                    action.trigger()
                return True
        return False


def _is_of(inner: QObject, outer: QObject) -> bool:
    parent: QObject | None = inner
    while parent is not None and parent is not outer:
        parent = parent.parent()
    return parent is outer
