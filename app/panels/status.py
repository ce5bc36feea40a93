"""The status bar: what runs, how far it is, what waits, and what was told."""

from __future__ import annotations

from collections.abc import Mapping

from PyQt6.QtCore import Qt, QTimer, pyqtSignal
from PyQt6.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QPushButton, QSizePolicy, QWidget

from app.document import Document
from app.panels.message_log import ERROR, NOTE, MessageHistory, MessageLog
from app.tasks import Tasks
from app.theme import named

LATE_MS = 150  # work that ends sooner is not worth a flickering bar
LAST_S = 8.0  # how long the last message stays in the bar
DAY = 86_400


class StatusPanel(QWidget):
    """Follows several executors and shows the first that is busy, in the order given.

    cancel_wanted() asks to stop what runs. `fail` and `note` take messages; the button at the
    right shows all of them.
    """

    cancel_wanted = pyqtSignal()

    def __init__(
        self, document: Document, executors: Mapping[str, Tasks], parent: QWidget | None = None
    ) -> None:
        """`executors` : by what they do, in words, as "Synthesizing": shown without a phase."""
        super().__init__(parent)
        self._document, self._executors = document, dict(executors)
        self._state: dict[str, tuple[float, str, float]] = {}
        self.log = MessageLog(self)
        self.history: MessageHistory | None = None
        self.label = QLabel()
        self.label.setTextFormat(Qt.TextFormat.PlainText)
        self.label.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.label.setAccessibleName(self.tr("What is going on"))
        self.bar = QProgressBar()
        self.bar.setRange(0, 1000)
        self.bar.setFixedWidth(180)
        self.bar.setAccessibleName(self.tr("Progress"))
        self.bar.setToolTip(self.tr("How much of it is done"))
        self.queue = named(QLabel(), "faint")
        self.queue.setToolTip(self.tr("Edits that are computed one after the other"))
        self.queue.setAccessibleName(self.tr("Waiting edits"))
        self.cancel = QPushButton(self.tr("Cancel"))
        self.cancel.setToolTip(self.tr("Stop what runs and drop what waits (Esc)"))
        self.cancel.setAccessibleName(self.tr("Cancel"))
        self.cancel.clicked.connect(self.cancel_wanted)
        self.messages = QPushButton()
        self.messages.setFlat(True)
        self.messages.setToolTip(self.tr("All messages since the start"))
        self.messages.clicked.connect(self.show_history)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(10, 2, 6, 2)
        layout.addWidget(self.label, 1)
        for widget in (self.queue, self.bar, self.cancel, self.messages):
            widget.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
            layout.addWidget(widget)
        self._late = QTimer(self)
        self._late.setSingleShot(True)
        self._late.setInterval(LATE_MS)
        self._late.timeout.connect(self._refresh)
        self._quiet = QTimer(self)
        self._quiet.setSingleShot(True)
        self._quiet.setInterval(round(LAST_S * 1000))
        self._quiet.timeout.connect(self._hush)
        self._last = ""
        for name, tasks in self._executors.items():
            self._follow(name, tasks)
        document.layers_changed.connect(self._refresh)
        self.log.changed.connect(self._count)
        self._count()
        self._refresh()

    # --- messages

    def fail(self, text: str) -> None:
        """Take what went wrong."""
        self._tell(ERROR, text)

    def note(self, text: str) -> None:
        """Take what is worth knowing."""
        self._tell(NOTE, text)

    def show_history(self) -> None:
        """Open the list of messages, or bring it to the front."""
        if self.history is None:
            self.history = MessageHistory(self.log, self)
            self.history.destroyed.connect(self._forget)
            self.history.show()
        self.history.raise_()
        self.history.activateWindow()

    def _tell(self, kind: str, text: str) -> None:
        self._last = text
        self._quiet.start()
        self.log.tell(kind, text)
        self._refresh()

    def _hush(self) -> None:
        self._last = ""
        self._refresh()

    def _forget(self) -> None:
        self.history = None

    def _count(self) -> None:
        errors = sum(each.kind == ERROR for each in self.log.messages)
        count = len(self.log.messages)
        self.messages.setText(self.tr("✕ {0}").format(errors) if errors else f"· {count}")
        self.messages.setAccessibleName(
            self.tr("{0} messages, {1} of them errors").format(count, errors)
        )
        self.messages.setVisible(count > 0)

    # --- work

    def _follow(self, name: str, tasks: Tasks) -> None:
        def started(job: str) -> None:
            self._state[name] = (0.0, "", -1.0)
            self._late.start()

        def progressed(fraction: float, label: str, left: float) -> None:
            self._state[name] = (fraction, label, left)
            if not self._late.isActive():
                self._refresh()

        tasks.started.connect(started)
        tasks.progressed.connect(progressed)
        tasks.held.connect(lambda paused: self._refresh())
        tasks.idle.connect(self._refresh)

    def _refresh(self) -> None:
        busy = [name for name, tasks in self._executors.items() if tasks.busy]
        waiting = self._document.busy_edits
        shown = bool(busy) and not self._late.isActive()
        self.bar.setVisible(shown)
        self.cancel.setVisible(shown or waiting > 0)
        self.queue.setVisible(waiting > 1)
        self.queue.setText(self.tr("{0} edits to do").format(waiting))
        if not shown:
            self.label.setText(self._last.split("\n")[0])
            self.label.setToolTip(self._last)
            return
        name = busy[0]
        fraction, label, left = self._state.get(name, (0.0, "", -1.0))
        self.bar.setValue(round(1000 * fraction))
        parts = [name]
        if self._executors[name].paused:
            parts.append(self.tr("paused"))
        else:
            parts += [label] if label else []
            parts += [self.tr("{0} left").format(duration(left))] if left >= 0 else []
        if len(busy) > 1:
            parts.append(self.tr("and {0} more").format(len(busy) - 1))
        text = " · ".join(parts)
        self.label.setText(text)
        self.label.setToolTip(text)


def duration(seconds: float) -> str:
    """Write a rough duration: "5 s", "3 min", "2 h", "2 h 10 min"."""
    seconds = min(max(seconds, 0.0), 30.0 * DAY)
    if seconds < 60:
        return f"{max(round(seconds), 1)} s"
    minutes = round(seconds / 60)
    if minutes < 60:
        return f"{minutes} min"
    hours, rest = divmod(minutes, 60)
    return f"{hours} h {rest} min" if rest else f"{hours} h"
