"""Jobs that wait for each other: one at a time touches the painting, in the order of asking."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from PyQt6.QtCore import QObject, pyqtSignal

from app.edits.stroke import Feed
from app.tasks import Job, Tasks


@dataclass(eq=False)
class Entry:
    """A job to come.

    name : of the job, for messages; label : of the layer that it makes, "" where it makes none;
    kind : of that layer; uid : of the layer that it changes. prepare : called in the window's
    thread right before the start, it gives the job, or None where nothing is left to do. feed :
    of a stroke. tasks : who runs it. light : it leaves the painting as it is.
    """

    name: str
    prepare: Callable[[], Job | None]
    tasks: Tasks
    label: str = ""
    kind: str = ""
    uid: int | None = None
    feed: Feed | None = None
    light: bool = False
    done: Callable[[Any], None] | None = field(default=None)


class Line(QObject):
    """Starts the entries one after the other; changed() whenever one comes, begins or ends."""

    changed = pyqtSignal()

    def __init__(self, executors: tuple[Tasks, ...], parent: QObject | None = None) -> None:
        """Run on `executors`, only one of which is busy at a time, whoever started it."""
        super().__init__(parent)
        self._executors = executors
        self._waiting: deque[Entry] = deque()
        self._glance: Entry | None = None
        self.running: Entry | None = None
        for tasks in executors:
            tasks.idle.connect(self._next)

    @property
    def busy(self) -> bool:
        """An entry that may change the painting runs or waits."""
        return bool(self._waiting) or (self.running is not None and not self.running.light)

    @property
    def entries(self) -> list[Entry]:
        """The running entry and those that wait, in their order."""
        return [*([self.running] if self.running else []), *self._waiting]

    def add(self, entry: Entry) -> None:
        """Let an entry wait for its turn."""
        self._waiting.append(entry)
        self._glance = None  # it would show what is no more
        self.changed.emit()
        self._next()

    def glance(self, entry: Entry | None) -> None:
        """Run an entry once nothing else is to be done; a newer one takes its place."""
        self._glance = entry
        self._next()

    def drop(self, entry: Entry) -> bool:
        """Take an entry back that has not begun; False where it has."""
        if entry not in self._waiting:
            return False
        self._waiting.remove(entry)
        self.changed.emit()
        return True

    def clear(self) -> None:
        """Take back all entries that have not begun."""
        self._glance = None
        if self._waiting:
            self._waiting.clear()
            self.changed.emit()

    def ended(self) -> Entry | None:
        """Note that the running entry is through, and return it."""
        entry, self.running = self.running, None
        return entry

    def _next(self) -> None:
        while not any(each.busy for each in self._executors):
            if self._waiting:
                entry = self._waiting.popleft()
            elif self._glance is not None:
                entry, self._glance = self._glance, None
            else:
                return
            job = entry.prepare()
            if job is not None:
                self.running = entry
                entry.tasks.start(entry.name, job, harmless=False)
            if not entry.light:
                self.changed.emit()
