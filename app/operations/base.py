"""What all verbs of the window share: executors, and what the user is told."""

from __future__ import annotations

from typing import Any

from PyQt6.QtCore import QObject, pyqtSignal

from app.document import Document
from app.edits import Edits
from app.tasks import Job, Tasks

REPLACING = ("open", "open project", "adopt", "synthesize")  # jobs that edits cannot wait for


class OperationsBase(QObject):
    """Runs verbs for one document.

    failed(text) and noted(text) are sentences for the user; broke(name, problem) comes before
    failed where a defect of ours is worth a report; exported(paths), saved(path). `work` is the
    serial executor of long work, `edits` paints, and only one of the two is at work at a time.
    """

    failed = pyqtSignal(str)
    noted = pyqtSignal(str)
    broke = pyqtSignal(str, object)
    exported = pyqtSignal(object)
    saved = pyqtSignal(object)
    save_failed = pyqtSignal()

    def __init__(self, document: Document, parent: QObject | None = None) -> None:
        """Connect the executors to `document`."""
        super().__init__(parent)
        self.document = document
        self.work = Tasks(self)
        self.drawing = Tasks(self)
        self.reading = Tasks(self)
        self.opening = Tasks(self)  # environments
        self._work_name = ""
        self.work.started.connect(self._note_work)
        self.edits = Edits(document, self.work, self._edits_allowed, self)
        self.edits.failed.connect(self.failed)
        self.edits.noted.connect(self.noted)
        for tasks in self._executors:
            tasks.broke.connect(self.broke)
            if tasks is not self.edits.tasks:
                tasks.finished.connect(self._finish)
                tasks.reported.connect(self._take)
                tasks.failed.connect(self._fail)
        self.work.cancelled.connect(self._restore)

    @property
    def _executors(self) -> tuple[Tasks, ...]:
        return self.work, self.drawing, self.reading, self.opening, self.edits.tasks

    def cancel(self) -> None:
        """Stop what runs; the document stays as it was before."""
        self.edits.cancel()
        self.work.cancel()

    def pause(self) -> None:
        """Let what runs wait, or go on where it waits already."""
        self.work.pause(not self.work.paused)

    def close(self) -> None:
        """Stop everything and wait until no thread of ours runs."""
        for tasks in self._executors:
            tasks.cancel()
        self.edits.close()
        for tasks in self._executors:
            tasks.close()

    def _note_work(self, name: str) -> None:
        self._work_name = name

    def _edits_allowed(self) -> bool:
        return not (self.work.busy and self._work_name in REPLACING)

    def _start(self, name: str, job: Job, *, harmless: bool = True) -> bool:
        """Begin what replaces the surface or the painting; False while something runs."""
        if not self.edits.busy and self.work.start(name, job, harmless=harmless):
            return True
        self.noted.emit(self.tr("Wait for the running task, or cancel it."))
        return False

    def _take(self, name: str, value: Any) -> None:
        """Take what a job reports before its end."""

    def _finish(self, name: str, value: Any) -> None:
        """Take what a job made."""

    def _fail(self, name: str, text: str) -> None:
        self.failed.emit(text)
        self._restore(name)

    def _restore(self, name: str) -> None:
        """Show what there was before a job that was stopped."""
