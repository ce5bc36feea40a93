"""Start of the window: is there a display, is there OpenGL, and then Qt's own loop."""

from __future__ import annotations

import os
import signal
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from btfcore.errors import InvalidParameter, PatinaError

if TYPE_CHECKING:
    from PyQt6.QtCore import QTimer

    from app.window import Window

SCRIPTS = ("demo",)


class NoWindow(PatinaError):
    """No window can be opened: no display, no OpenGL, or a library of the system is missing."""


def run_gui(path: Path | None, *, screenshot: Path | None = None, script: str | None = None) -> int:
    """Open the window with the mesh at `path` and run until it is closed; returns the status.

    `script` drives the window ("demo": a shipped mesh and sample, synthesised; `path` takes
    the mesh's place); `screenshot` saves a picture of the window, after the script or as soon
    as the mesh is there, and ends. Raises `NoWindow` where none can be opened.
    """
    if script is not None and script not in SCRIPTS:
        raise InvalidParameter(f"no script {script!r}; there is {', '.join(SCRIPTS)}")
    if screenshot is not None:
        from btfcore.files.export import check_output

        check_output(screenshot, suffixes=(".png",))
    _check_display()
    from PyQt6.QtCore import qInstallMessageHandler

    complaints = _Complaints()
    qInstallMessageHandler(complaints)
    from PyQt6.QtWidgets import QApplication

    application = QApplication.instance() or QApplication(sys.argv[:1])
    assert isinstance(application, QApplication)
    complaints.started = True
    application.setApplicationName("Patina")
    _check_opengl()
    from app.demo import Script
    from app.theme import dress
    from app.window import Window

    dress(application)
    scripted = screenshot is not None or script is not None
    window = Window(scripted=scripted)
    window.show()
    pulse = _leave_on_interrupt(window)
    application.aboutToQuit.connect(pulse.stop)
    if scripted:
        driver = Script(window, demo=script == "demo", mesh=path, screenshot=screenshot)
        driver.start()
        status = application.exec()
        return driver.status or status
    if path is not None:
        window.open_mesh(path)
    return application.exec()


def _leave_on_interrupt(window: Window) -> QTimer:
    """Close the window on Ctrl-C; the timer lets Python hear of it inside Qt's loop."""
    from PyQt6.QtCore import QTimer

    def leave(number: int, frame: object) -> None:
        window.scripted = True  # who presses Ctrl-C wants no question
        window.close()

    pulse = QTimer()
    pulse.timeout.connect(lambda: None)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, leave)
        pulse.start(200)
    return pulse


def _check_display() -> None:
    """Qt aborts the process where X11 and Wayland are both missing; say it by name instead."""
    if not sys.platform.startswith("linux") or os.environ.get("QT_QPA_PLATFORM"):
        return
    if not os.environ.get("DISPLAY") and not os.environ.get("WAYLAND_DISPLAY"):
        raise NoWindow(
            "no window can be opened: neither DISPLAY nor WAYLAND_DISPLAY is set "
            "(without a display use `patina decorate … --preview picture.png`)"
        )


def _check_opengl() -> None:
    """Raise `NoWindow` where Qt gets no OpenGL context."""
    from PyQt6.QtGui import QOpenGLContext

    context = QOpenGLContext()
    if not context.create():
        raise NoWindow("no window can be opened: the system gives no OpenGL context")
    major, minor = context.format().version()
    if (major, minor) < (3, 2):
        raise NoWindow(f"no window can be opened: OpenGL is {major}.{minor}, 3.2 is needed")


class _Complaints:
    """Qt's messages: kept until the window stands, for Qt's last words before it aborts."""

    def __init__(self) -> None:
        self.started = False
        self._lines: list[str] = []

    def __call__(self, kind: object, context: object, text: str | None) -> None:
        from PyQt6.QtCore import QtMsgType

        if text:
            self._lines = [*self._lines[-5:], text.strip()]
        if kind == QtMsgType.QtFatalMsg:
            if self.started:
                reason = text or "unknown"
            else:  # the first lines name the cause, the last is advice of many lines
                reason = "; ".join(self._lines[:-1]) or text or "unknown"
            sys.stderr.write(f"patina: no window can be opened: {reason}\n")
            sys.stderr.flush()
            os._exit(2)  # after this handler Qt would abort with a core dump
        if kind == QtMsgType.QtCriticalMsg and self.started:
            sys.stderr.write(f"patina: {text}\n")
