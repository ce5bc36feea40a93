"""One background job at a time, its progress and its end told to the window's thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, Protocol

from PyQt6.QtCore import QObject, QRunnable, QThreadPool, QTimer, pyqtSignal

from app.reports import Problem, problem_of
from btfcore.errors import Cancelled, PatinaError
from btfcore.progress import Progress

SHOW_S = 0.04  # progress is told no oftener than this

PATIENCE_MS = 150  # how long a cancelled job may take to notice before it is left to itself
FRAME_MS = 200  # pause between droppable reports, so that drawing them slows no job down


class Report(Protocol):
    """What a job is given to show a partial result: ``report(name, value)``."""

    def __call__(self, name: str, value: Any, *, droppable: bool = False) -> None:
        """Hand `value` to the window's thread.

        A droppable one is a function that makes the value, called only if the window keeps up.
        """


Job = Callable[[Progress, Report], Any]


class Tasks(QObject):
    """Runs jobs one after the other in a worker thread; every signal arrives on its own thread.

    progressed(fraction, label, seconds left or -1) ; reported(name, value): partial results ;
    held(True) when a job is paused and held(False) when it goes on ; then exactly one of
    finished(value), failed(text), cancelled() ; and idle() after it. Where a job failed by a
    defect of ours, broke(problem), with all that is worth reporting, comes right before
    failed(text).
    """

    started = pyqtSignal(str)
    progressed = pyqtSignal(float, str, float)
    reported = pyqtSignal(str, object)
    held = pyqtSignal(bool)
    finished = pyqtSignal(str, object)
    failed = pyqtSignal(str, str)
    broke = pyqtSignal(str, object)
    cancelled = pyqtSignal(str)
    idle = pyqtSignal()

    def __init__(self, parent: QObject | None = None) -> None:
        """Start idle."""
        super().__init__(parent)
        self._pool = QThreadPool(self)
        self._pool.setMaxThreadCount(1)
        self._running: _Worker | None = None
        self._left: list[_Worker] = []

    @property
    def busy(self) -> bool:
        """A job is running or its end has not been told yet."""
        return self._running is not None

    @property
    def paused(self) -> bool:
        """The running job was asked to wait."""
        return self._running is not None and not self._running.go.is_set()

    def pause(self, wait: bool = True) -> None:
        """Let the running job wait at its next call of progress, or go on."""
        worker = self._running
        if worker is not None and self.paused != wait:
            if wait:
                worker.go.clear()
            else:
                worker.go.set()
            self.held.emit(wait)

    def start(self, name: str, job: Job, *, harmless: bool = True) -> bool:
        """Run ``job(progress, report)`` in the background; False where one is running.

        A `harmless` job changes nothing but what it returns: cancelled in the middle of a long
        step it is left to itself, and the next job waits for it in the worker thread.
        """
        if self.busy:
            return False
        worker = _Worker(name, job, harmless)
        self._running = worker
        worker.signals.progressed.connect(self._pass_progress)
        worker.signals.reported.connect(self._pass_on)
        worker.signals.ended.connect(self._end)
        self.started.emit(name)
        self._pool.start(worker)
        return True

    def cancel(self) -> None:
        """Stop the running job; told within `PATIENCE_MS` where it is harmless."""
        worker = self._running
        if worker is not None:
            worker.stop.set()
            worker.go.set()
            if worker.harmless:
                QTimer.singleShot(PATIENCE_MS, lambda: self._abandon(worker))

    def wait(self, milliseconds: int = -1) -> bool:
        """Block until the worker thread is through; its signals may still be queued."""
        return self._pool.waitForDone(milliseconds)

    def close(self) -> None:
        """Stop what runs, wait for it, and say nothing any more."""
        self.blockSignals(True)
        self.cancel()
        self.wait()
        self._running = None

    def _abandon(self, worker: _Worker) -> None:
        if worker is self._running:
            self._left.append(worker)  # Python must not free it while it runs
            self._tell(worker, "cancelled", None)

    def _pass_progress(self, worker: object, fraction: float, label: str, left: float) -> None:
        if worker is self._running:
            self.progressed.emit(fraction, label, left)

    def _pass_on(self, worker: object, name: str, value: object) -> None:
        if self._running is not None and worker is self._running:
            self.reported.emit(name, value)
            QTimer.singleShot(FRAME_MS, self._running.shown.set)

    def _end(self, worker: object, outcome: str, value: object) -> None:
        if self._running is not None and worker is self._running:
            self.wait()  # its last word is said, but it must not be freed under its own feet
            self._left.clear()
            self._tell(self._running, outcome, value)

    def _tell(self, worker: _Worker, outcome: str, value: object) -> None:
        self._running = None
        if outcome == "finished":
            self.finished.emit(worker.name, value)
        elif outcome == "failed":
            if isinstance(value, Problem):
                self.broke.emit(worker.name, value)
                value = value.sentence
            self.failed.emit(worker.name, str(value))
        else:
            self.cancelled.emit(worker.name)
        if not self.busy:  # nobody started the next one while hearing of this one's end
            self.idle.emit()


class _Signals(QObject):
    progressed = pyqtSignal(object, float, str, float)
    reported = pyqtSignal(object, str, object)
    ended = pyqtSignal(object, str, object)


class _Worker(QRunnable):
    """A job with its flags; lives in the pool's thread, its signals cross over."""

    def __init__(self, name: str, job: Job, harmless: bool) -> None:
        super().__init__()
        self.setAutoDelete(False)  # Python owns it
        self.name, self.harmless = name, harmless
        self.signals = _Signals()
        self.stop = threading.Event()
        self.go = threading.Event()  # cleared while paused
        self.go.set()
        self.shown = threading.Event()  # the window has taken the last report
        self.shown.set()
        self._job: Job | None = job
        self._clock = Clock()
        self._told = 0.0

    def run(self) -> None:
        """Run the job and tell how it ended, whatever it raises."""
        assert self._job is not None
        try:
            value = self._job(self._progress, self._report)
        except Cancelled:
            self._end("cancelled", None)
        except PatinaError as error:
            self._end("failed", str(error))
        except MemoryError:
            self._end("failed", "there is not enough memory for this")
        except BaseException as error:  # a defect must not take the window down; nor sys.exit()
            self._end("failed", problem_of(error, self.name))
        else:
            self._end("finished", value)

    def _end(self, outcome: str, value: object) -> None:
        self._job = None  # lets go of what the job held, should this worker be kept
        self.signals.ended.emit(self, outcome, value)

    def _progress(self, fraction: float, label: str) -> None:
        if not self.go.is_set():
            before = time.monotonic()
            self.go.wait()
            self._clock.skip(time.monotonic() - before)
        if self.stop.is_set():
            raise Cancelled
        now = time.monotonic()
        left = self._clock.left(fraction, now)
        if now - self._told >= SHOW_S or fraction >= 1.0:
            self._told = now
            self.signals.progressed.emit(self, min(max(fraction, 0.0), 1.0), label, left)

    def _report(self, name: str, value: Any, *, droppable: bool = False) -> None:
        if droppable and not self.shown.is_set():
            return
        self.shown.clear()
        self.signals.reported.emit(self, name, value() if droppable else value)


class Clock:
    """Estimates the seconds left from how fast the fraction has grown lately."""

    def __init__(self) -> None:
        """Start without an estimate."""
        self._marks: list[tuple[float, float]] = []

    def skip(self, seconds: float) -> None:
        """Leave out a pause of `seconds` that has just ended."""
        self._marks = [(when + seconds, fraction) for when, fraction in self._marks]

    def left(self, fraction: float, now: float) -> float:
        """Seconds left, or -1 while nothing can be said (`now` in seconds, any origin)."""
        if not self._marks or fraction < self._marks[-1][1]:
            self._marks = [(now, fraction)]
        elif now - self._marks[-1][0] >= 0.2:
            self._marks = [*self._marks[-40:], (now, fraction)]
        start, first = self._marks[0]
        if now - start < 0.5 or fraction - first < 0.02:
            return -1.0
        return (1.0 - fraction) * (now - start) / (fraction - first)
