"""A field that takes the next key that is pressed."""

from __future__ import annotations

from typing import cast

from PyQt6.QtCore import QEvent, Qt, pyqtSignal
from PyQt6.QtGui import QFocusEvent, QKeyEvent
from PyQt6.QtWidgets import QPushButton, QWidget

from app.key_events import key_of

_BARE = {
    Qt.Key.Key_Shift, Qt.Key.Key_Control, Qt.Key.Key_Alt, Qt.Key.Key_Meta, Qt.Key.Key_AltGr,
    Qt.Key.Key_CapsLock, Qt.Key.Key_NumLock, Qt.Key.Key_ScrollLock, Qt.Key.Key_Super_L,
    Qt.Key.Key_Super_R, Qt.Key.Key_Hyper_L, Qt.Key.Key_Hyper_R, Qt.Key.Key_unknown,
}  # fmt: skip


class KeyField(QPushButton):
    """A button that listens once it is pressed; captured(key) tells portable text.

    Esc and a click elsewhere stop it. Shortcuts of the window wait meanwhile.
    """

    captured = pyqtSignal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        """Wait to be pressed."""
        super().__init__(parent)
        self._rest = self.tr("Press to add a key")
        self.setCheckable(True)
        self.setAutoDefault(False)
        self.setToolTip(self.tr("Press this, and then the key; Esc stops"))
        self.setAccessibleName(self.tr("Add a key"))
        self.toggled.connect(self._show)
        self._show(False)

    @property
    def listening(self) -> bool:
        """Whether the next key is taken."""
        return self.isChecked()

    def set_rest(self, text: str) -> None:
        """Say this while it does not listen."""
        self._rest = text
        self._show(self.listening)

    def listen(self) -> None:
        """Take the next key."""
        self.setFocus(Qt.FocusReason.OtherFocusReason)
        self.setChecked(True)

    def event(self, event: QEvent | None) -> bool:
        """Take keys before shortcuts and the order of focus do."""
        if event is not None and self.listening:
            if event.type() == QEvent.Type.ShortcutOverride:
                event.accept()
                return True
            if event.type() == QEvent.Type.KeyPress:
                self._take(cast(QKeyEvent, event))
                return True
            if event.type() == QEvent.Type.KeyRelease:
                return True  # a button would answer to Space
        return super().event(event)

    def focusOutEvent(self, event: QFocusEvent | None) -> None:  # noqa: N802
        """Stop listening."""
        self.setChecked(False)
        super().focusOutEvent(event)

    def _take(self, event: QKeyEvent) -> None:
        event.accept()
        if event.isAutoRepeat() or event.key() in _BARE:
            return
        self.setChecked(False)
        key = key_of(event)
        if key != "Esc":
            self.captured.emit(key)

    def _show(self, listening: bool) -> None:
        self.setText(self.tr("Press a key …") if listening else self._rest)
