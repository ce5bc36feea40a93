"""What was told since the program started."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from PyQt6.QtCore import QObject, Qt, pyqtSignal
from PyQt6.QtGui import QGuiApplication
from PyQt6.QtWidgets import (
    QAbstractItemView,
    QDialog,
    QDialogButtonBox,
    QListWidget,
    QListWidgetItem,
    QVBoxLayout,
    QWidget,
)

MOST = 300  # messages that are kept
ERROR, NOTE = "error", "note"


@dataclass(frozen=True)
class Message:
    """A sentence, whether it is an `ERROR` or a `NOTE`, and when it was told."""

    kind: str
    text: str
    time: datetime


class MessageLog(QObject):
    """Keeps the last messages; changed() at each."""

    changed = pyqtSignal()

    def __init__(self, parent: QObject | None = None) -> None:
        """Nothing was told yet."""
        super().__init__(parent)
        self.messages: tuple[Message, ...] = ()

    def tell(self, kind: str, text: str) -> None:
        """Keep a message."""
        message = Message(kind, text, datetime.now())
        self.messages = (*self.messages, message)[-MOST:]
        self.changed.emit()

    def text(self) -> str:
        """Everything, oldest first, a message a line."""
        return "\n".join(f"{each.time:%H:%M:%S}  {each.text}" for each in self.messages)


class MessageHistory(QDialog):
    """The messages, the newest first; follows the log while it is open."""

    def __init__(self, log: MessageLog, parent: QWidget | None = None) -> None:
        """Show `log`."""
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle(self.tr("Messages"))
        self._log = log
        self.list = QListWidget()
        self.list.setAccessibleName(self.tr("Messages, the newest first"))
        self.list.setWordWrap(True)
        self.list.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        copy = buttons.addButton(self.tr("Copy"), QDialogButtonBox.ButtonRole.ActionRole)
        assert copy is not None
        self.copy = copy
        self.copy.setToolTip(self.tr("Copy all messages as text"))
        self.copy.clicked.connect(self._copy)
        buttons.rejected.connect(self.reject)
        layout = QVBoxLayout(self)
        layout.addWidget(self.list)
        layout.addWidget(buttons)
        self.resize(560, 360)
        log.changed.connect(self._fill)
        self._fill()

    def _fill(self) -> None:
        self.list.clear()
        for message in reversed(self._log.messages):
            mark = "✕" if message.kind == ERROR else "·"
            item = QListWidgetItem(f"{message.time:%H:%M}  {mark}  {message.text}")
            words = self.tr("Error") if message.kind == ERROR else self.tr("Note")
            item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{words}: {message.text}")
            self.list.addItem(item)

    def _copy(self) -> None:
        board = QGuiApplication.clipboard()
        if board is not None:
            board.setText(self._log.text())
