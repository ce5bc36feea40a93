"""Drives a window without hands: opens, synthesises, takes a picture, leaves."""

from __future__ import annotations

import sys
from pathlib import Path

from PyQt6.QtCore import QBuffer, QByteArray, QIODevice, QObject, QTimer
from PyQt6.QtWidgets import QApplication

from app.document import Mode
from app.window import Window
from btfcore.errors import PatinaError
from btfcore.files.atomic import write_bytes

MESH, SAMPLE = "spot", "brick_red"
AZIMUTH = 215.0  # from where the demo's mesh shows its face
SETTLE_MS = 400  # for layout, thumbnails of the last batch and the first frame


class Script(QObject):
    """One run through the window; `status` is the exit status once the application ends."""

    def __init__(
        self,
        window: Window,
        *,
        demo: bool,
        mesh: Path | None,
        screenshot: Path | None,
        mode: Mode = Mode.COLOUR,
        rate: int = 512,
    ) -> None:
        """`demo`: synthesise; otherwise only open `mesh`. No `screenshot`: stay open."""
        super().__init__(window)
        self.status = 0
        self._window, self._demo, self._mesh = window, demo, mesh
        self._screenshot, self._mode, self._rate = screenshot, mode, rate

    def start(self) -> None:
        """Begin as soon as the event loop runs."""
        QTimer.singleShot(0, self._begin)

    def _begin(self) -> None:
        operations, document = self._window.operations, self._window.document
        operations.failed.connect(self._fail)
        if self._demo:
            self._mesh = self._mesh or _shipped(MESH, meshes=True)
            document.set_knobs(rate=self._rate)
            document.choose_sample(_shipped(SAMPLE, meshes=False))
        if self._mesh is None:
            self._settle()
            return
        document.mesh_changed.connect(self._opened)
        document.result_changed.connect(self._done)
        operations.open_mesh(self._mesh)

    def _opened(self) -> None:
        if not self._demo:
            self._settle()
        elif self._window.operations.work.busy:
            QTimer.singleShot(10, self._opened)
        else:
            self._window.synthesize()

    def _done(self) -> None:
        if self._window.document.decoration is not None:
            self._window.document.set_mode(self._mode)
            self._window.viewport.look(azimuth=AZIMUTH)
            self._settle()

    def _settle(self) -> None:
        """Wait until thumbnails and picture are there, then take the picture."""
        operations = self._window.operations
        if operations.reading.busy or operations.drawing.busy or operations.work.busy:
            QTimer.singleShot(50, self._settle)
        else:
            QTimer.singleShot(SETTLE_MS, self._shoot)

    def _shoot(self) -> None:
        if self._screenshot is None:
            return
        data = QByteArray()
        buffer = QBuffer(data)
        buffer.open(QIODevice.OpenModeFlag.WriteOnly)
        self._window.picture().save(buffer, "PNG")
        try:
            write_bytes(self._screenshot, data.data())
        except PatinaError as error:
            self._fail(str(error))
            return
        self._leave()

    def _fail(self, text: str) -> None:
        sys.stderr.write(f"patina: {text}\n")
        self.status = 1
        if self._screenshot is not None:
            self._leave()

    def _leave(self) -> None:
        self._window.close()
        QApplication.exit(self.status)


def _shipped(name: str, *, meshes: bool) -> Path:
    """Shipped file of that name, or the first one."""
    from btfcore import library

    found = library.meshes() if meshes else library.samples()
    return next((path for path in found if path.stem == name), found[0])
