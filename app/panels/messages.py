"""What went wrong and what is worth knowing, in bars that block nothing."""

from __future__ import annotations

from PyQt6.QtCore import Qt, QTimer
from PyQt6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QSizePolicy, QWidget

MOST_LINES = 3


class MessageBar(QFrame):
    """One bar; further messages join the last ones. Notes vanish by themselves, errors stay."""

    def __init__(self, kind: str, *, seconds: float = 0.0, parent: QWidget | None = None) -> None:
        """`kind` is "errors" or "notes"; `seconds` > 0 hides it after that long."""
        super().__init__(parent)
        self.setObjectName(kind)
        self._lines: list[str] = []
        self._seconds = seconds
        self.text = QLabel()
        self.text.setWordWrap(True)
        self.text.setTextFormat(Qt.TextFormat.PlainText)
        self.text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.text.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.text.setAccessibleName(self.tr("Error") if kind == "errors" else self.tr("Note"))
        close = QPushButton("×")
        close.setToolTip(self.tr("Dismiss"))
        close.setAccessibleName(self.tr("Dismiss"))
        close.clicked.connect(self.clear)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(12, 6, 6, 6)
        layout.addWidget(self.text, 1)
        layout.addWidget(close, 0, Qt.AlignmentFlag.AlignTop)
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.timeout.connect(self.clear)
        self.hide()

    def tell(self, text: str) -> None:
        """Show a sentence, below the last ones."""
        if text not in self._lines:
            self._lines = [*self._lines, text][-MOST_LINES:]
        self.text.setText("\n".join(self._lines))
        self.show()
        if self._seconds:
            self._timer.start(round(self._seconds * 1000))

    def clear(self) -> None:
        """Forget everything."""
        self._lines = []
        self.hide()
