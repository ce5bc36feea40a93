"""Unexpected errors as something that a person can read, copy and send.

A report names the error, where it was raised, what ran and the versions of everything; it holds
no contents of files, and the home folder is written as "~".
"""

from __future__ import annotations

import os
import platform
import sys
import threading
import time
import traceback
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from types import TracebackType
from typing import Any

from PyQt6.QtCore import QCoreApplication, QObject, pyqtSignal

from btfcore import __version__

PACKAGES = ("PyQt6", "PyQt6-Qt6", "vtk", "pyvista", "numpy", "scipy", "numba", "llvmlite")
LONGEST_MESSAGE = 500  # characters of an error's own text: it may quote what it could not read
LONGEST_REPORT = 60_000
DEEPEST = 40  # calls of a traceback, the innermost ones
MOST_KINDS = 200  # different errors that are told apart

_facts: dict[str, str] = {}


@dataclass(frozen=True)
class Problem:
    """An unexpected error: a sentence, what ran, the report, and what tells it from others."""

    sentence: str
    running: str
    report: str
    place: str


def tell_fact(name: str, value: str) -> None:
    """Let reports say more, such as the OpenGL renderer once it is known."""
    _facts[name] = value


def problem_of(error: BaseException, running: str = "") -> Problem:
    """Describe an error; running : what was being done, as `Tasks` calls it."""
    kind = type(error).__name__
    text = str(error).strip()[:LONGEST_MESSAGE]
    frames = traceback.extract_tb(error.__traceback__)
    place = f"{frames[-1].filename}:{frames[-1].lineno}" if frames else ""
    if isinstance(error, MemoryError):
        sentence = _tr("there is not enough memory for this")
    else:
        sentence = _tr("internal error: {0}").format(shortened(f"{kind}: {text}" if text else kind))
    return Problem(sentence, running, _report(error, running), f"{kind} {place}")


def problem_of_crash(words: str) -> Problem:
    """Describe a crash of an earlier run; words : what the interpreter wrote when it came."""
    sentence = _tr("Patina crashed when it ran last; it had no work that was not saved.")
    text = "\n".join([*_header(""), "", words[:LONGEST_REPORT]])
    return Problem(sentence, "", shortened(text), f"crash {words[:LONGEST_MESSAGE]}")


def shortened(text: str) -> str:
    """Text with the home folder written as "~"."""
    home = str(Path.home())
    for each in {home, os.path.realpath(home), home.replace("\\", "/")}:
        if len(each) > 3:  # "/" or "C:\\" is nobody's
            text = text.replace(each + os.sep, "~" + os.sep).replace(each + "/", "~/")
            text = text.replace(f"'{each}'", "'~'")
    return text


class Reporter(QObject):
    """Hears of every error that nobody handled, in whatever thread, and tells the window's.

    happened(problem) comes once for each place at which errors are raised: one in a paint event
    would come sixty times a second. `count` says how often each came.
    """

    happened = pyqtSignal(object)
    _crossed = pyqtSignal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        """Hear of nothing before `install`."""
        super().__init__(parent)
        self.count: dict[str, int] = {}
        self._before: tuple[Any, Any] | None = None
        self._hook: tuple[Any, Any] | None = None
        self._crossed.connect(self.take)

    def install(self) -> None:
        """Take over the interpreter's hooks; those that were there are still called."""
        if self._before is None:
            self._before = (sys.excepthook, threading.excepthook)
            self._hook = (self._uncaught, self._uncaught_in_thread)
            sys.excepthook, threading.excepthook = self._hook

    def remove(self) -> None:
        """Put the hooks back, where they are still ours."""
        if self._before is not None and self._hook is not None:
            if sys.excepthook == self._hook[0]:
                sys.excepthook = self._before[0]
            if threading.excepthook == self._hook[1]:
                threading.excepthook = self._before[1]
            self._before = self._hook = None

    def take(self, problem: Problem) -> None:
        """Tell of a problem that was caught elsewhere, such as by `Tasks`; window's thread only."""
        known = self.count.get(problem.place, 0)
        if known or len(self.count) < MOST_KINDS:
            self.count[problem.place] = known + 1
            if not known:
                self.happened.emit(problem)

    def broke(self, name: str, problem: Problem) -> None:
        """Slot for `Tasks.broke`."""
        self.take(problem)

    def _uncaught(
        self, kind: type[BaseException], error: BaseException, trace: TracebackType | None
    ) -> None:
        if self._before is not None:
            self._before[0](kind, error, trace)
        self._hand_over(error)

    def _uncaught_in_thread(self, told: threading.ExceptHookArgs) -> None:
        if self._before is not None:
            self._before[1](told)
        if told.exc_value is not None:
            thread = told.thread.name if told.thread is not None else ""
            self._hand_over(told.exc_value, thread)

    def _hand_over(self, error: BaseException, running: str = "") -> None:
        if not isinstance(error, Exception):  # Ctrl-C, and the interpreter's end
            return
        try:
            self._crossed.emit(problem_of(error, running))
        except RuntimeError:
            return  # this object's window is gone already


def _header(running: str) -> list[str]:
    """Lines that tell when it was, what ran, and on what."""
    lines = [f"Patina {__version__}", f"When: {time.strftime('%Y-%m-%d %H:%M:%S %z')}"]
    if running:
        lines.append(f"Running: {running}")
    lines.append(f"Python: {platform.python_version()} ({platform.python_implementation()})")
    lines += [f"{name}: {version}" for name in PACKAGES if (version := _version(name))]
    lines.append(f"System: {platform.platform()}, {platform.machine()}, {os.cpu_count()} cores")
    return lines + [f"{name}: {value}" for name, value in _facts.items()]


def _report(error: BaseException, running: str) -> str:
    """The text to send."""
    text = "\n".join([*_header(running), "", "".join(_trace(error))])
    if len(text) > LONGEST_REPORT:
        half = LONGEST_REPORT // 2
        text = f"{text[:half]}\n…\n{text[-half:]}"
    return shortened(text)


def _trace(error: BaseException) -> list[str]:
    """Traceback of an error after those of the errors that led to it, their texts cut short."""
    parts: list[str] = []
    each: BaseException | None = error
    seen: set[int] = set()
    while each is not None and id(each) not in seen and len(seen) < 10:
        seen.add(id(each))
        frames = traceback.format_list(traceback.extract_tb(each.__traceback__, limit=-DEEPEST))
        text = str(each)
        text = text[:LONGEST_MESSAGE] + "…" if len(text) > LONGEST_MESSAGE else text
        frames = ["Traceback (most recent call last):\n", *frames] if frames else []
        parts.append("".join([*frames, f"{type(each).__qualname__}: {text}\n"]))
        each = each.__cause__ or (None if each.__suppress_context__ else each.__context__)
    return ["\nwhich led to:\n\n".join(reversed(parts))]


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _tr(text: str) -> str:
    return QCoreApplication.translate("Reports", text)
