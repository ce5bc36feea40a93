"""A background worker for what is looked at: the last question wins."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PyQt6.QtCore import QObject, pyqtSignal

from app.tasks import Job, Tasks

Done = Callable[[Any], None]


class Latest(QObject):
    """Runs one job at a time; another one stops it, and is run as soon as it has stopped.

    failed(text) is a sentence for the user; broke(problem) a defect of ours, as of `tasks`.
    """

    failed = pyqtSignal(str)

    def __init__(self, parent: QObject | None = None) -> None:
        """Start idle."""
        super().__init__(parent)
        self.tasks = Tasks(self)
        self._next: tuple[str, Job, Done] | None = None
        self._done: Done | None = None
        self.tasks.finished.connect(self._finished)
        self.tasks.failed.connect(self._failed)
        self.tasks.idle.connect(self._go_on)

    @property
    def busy(self) -> bool:
        """Something runs or waits."""
        return self.tasks.busy or self._next is not None

    def ask(self, name: str, job: Job, done: Done) -> None:
        """Run `job` in the background and give what it returns to `done`, unless asked again."""
        self._next, self._done = (name, job, done), None
        if self.tasks.busy:
            self.tasks.cancel()
        else:
            self._go_on()

    def stop(self) -> None:
        """Ask for nothing any more."""
        self._next = self._done = None
        self.tasks.cancel()

    def close(self) -> None:
        """Stop and wait until no thread of ours runs."""
        self.stop()
        self.tasks.close()

    def _go_on(self) -> None:
        if self._next is not None and not self.tasks.busy:
            (name, job, self._done), self._next = self._next, None
            self.tasks.start(name, job)

    def _finished(self, name: str, value: object) -> None:
        done, self._done = self._done, None
        if done is not None:
            done(value)

    def _failed(self, name: str, text: str) -> None:
        if self._next is None and self._done is not None:
            self.failed.emit(text)
        self._done = None
