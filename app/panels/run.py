"""The button that starts a synthesis, and what is told while it runs."""

from __future__ import annotations

from PyQt6.QtCore import pyqtSignal
from PyQt6.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QPushButton, QVBoxLayout, QWidget

from app.document import Document
from app.tasks import Tasks
from app.theme import named


class RunPanel(QWidget):
    """Synthesize, a bar of progress with phase and time left, Pause and Cancel."""

    wanted = pyqtSignal()
    cancel_wanted = pyqtSignal()
    pause_wanted = pyqtSignal()
    export_wanted = pyqtSignal()

    def __init__(self, document: Document, tasks: Tasks, parent: QWidget | None = None) -> None:
        """Follow the jobs of `tasks`."""
        super().__init__(parent)
        self._document, self._tasks = document, tasks
        self._last = ""
        self.start = named(QPushButton(self.tr("Synthesize")), "primary")
        self.start.clicked.connect(self.wanted)
        self.export = QPushButton(self.tr("Export…"))
        self.export.setToolTip(self.tr("Save the decorated mesh as GLB, OBJ or PLY"))
        self.export.clicked.connect(self.export_wanted)
        self.cancel = QPushButton(self.tr("Cancel"))
        self.cancel.setToolTip(self.tr("Stop and go back to the state before (Esc)"))
        self.cancel.clicked.connect(self.cancel_wanted)
        self.pause = QPushButton(self.tr("Pause"))
        self.pause.setToolTip(self.tr("Wait, and go on later (Ctrl+P)"))
        self.pause.clicked.connect(self.pause_wanted)
        self.bar = QProgressBar()
        self.bar.setRange(0, 1000)
        self.bar.setAccessibleName(self.tr("Progress"))
        self.label = named(QLabel(), "faint")
        below = QHBoxLayout()
        below.addWidget(self.bar, 1)
        below.addWidget(self.pause)
        below.addWidget(self.cancel)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.start)
        layout.addWidget(self.label)
        layout.addLayout(below)
        layout.addWidget(self.export)
        tasks.started.connect(self._started)
        tasks.progressed.connect(self._progressed)
        tasks.cancelled.connect(lambda name: self._say(self.tr("Cancelled.")))
        tasks.failed.connect(lambda name, text: self._say(self.tr("Failed; see above.")))
        tasks.finished.connect(self._finished)
        tasks.held.connect(self._held)
        tasks.idle.connect(self._refresh)
        for changed in (document.mesh_changed, document.sample_chosen, document.result_changed):
            changed.connect(self._refresh)
        self._refresh()

    def _refresh(self) -> None:
        busy = self._tasks.busy
        document = self._document
        missing = []
        if document.opened is None:
            missing.append(self.tr("Open a mesh."))
        if document.sample_path is None:
            missing.append(self.tr("Choose a sample."))
        ready = self.tr("Cover the mesh with the chosen sample (Ctrl+R)")
        self.start.setEnabled(not busy and not missing)
        self.start.setToolTip(" ".join(missing) or ready)
        self.bar.setVisible(busy)
        self.cancel.setVisible(busy)
        self.pause.setVisible(busy)
        self.pause.setText(self.tr("Go on") if self._tasks.paused else self.tr("Pause"))
        self.export.setVisible(not busy)
        self.export.setEnabled(document.decoration is not None)
        if missing and not busy:
            self.label.setText(" ".join(missing))
        elif not busy:
            self.label.setText(self._last)

    def _say(self, text: str) -> None:
        """Keep `text` below the button until the next job."""
        self._last = text
        self.label.setText(text)

    def _finished(self, name: str, value: object) -> None:
        ready = {
            "open": self.tr("Ready to synthesise."),
            "synthesize": self.tr("Done. Other seeds give other arrangements."),
            "export": self.tr("Exported."),
        }
        self._say(ready.get(name, ""))

    def _started(self, name: str) -> None:
        names = {"open": self.tr("Opening"), "export": self.tr("Exporting")}
        self.bar.setValue(0)
        self.label.setText(names.get(name, self.tr("Starting")))
        self._refresh()

    def _held(self, paused: bool) -> None:
        if paused:
            self.label.setText(self.tr("Paused"))
        self._refresh()

    def _progressed(self, fraction: float, label: str, left: float) -> None:
        self.bar.setValue(round(fraction * 1000))
        if self._tasks.paused:  # told just before it stopped
            return
        text = label[:1].upper() + label[1:]
        if left >= 0:
            text = self.tr("{0} · {1} left").format(text, _duration(left))
        self.label.setText(text)


def _duration(seconds: float) -> str:
    """Write a rough duration."""
    if seconds < 60:
        return f"{max(round(seconds), 1)} s"
    return f"{round(seconds / 60)} min"
