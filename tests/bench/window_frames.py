"""Frames a second in the real window while real mouse events turn the view and move the light.

Run as ``python -m tests.bench.window_frames`` with a display (``xvfb-run -a`` where there is
none). Prints a row per atlas and motion: frames a second, where their time went, and the error
of the mode in use; then how long full quality takes once the mouse rests.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PyQt6.QtCore import QEvent, QPointF, QSettings, Qt
from PyQt6.QtGui import QMouseEvent
from PyQt6.QtWidgets import QApplication

from app.document import Canvas, Decoration, Mode
from app.operations import prepare
from app.window import Window
from btfcore import pipeline
from btfcore.btf.appearance import quilting_sample
from btfcore.progress import silent
from btfcore.quilt.measure import SeamMeasures, measure_seams
from btfcore.quilt.parameters import QuiltParameters
from btfcore.render.lights import NONE
from btfcore.render.material import factor_material
from btfcore.types import Quilt
from tests.bench.inputs import found
from tests.bench.woven import woven_btf

VIEW = (800, 600)
LEFT, NO_BUTTON = Qt.MouseButton.LeftButton, Qt.MouseButton.NoButton
MOTIONS = ("colour, view", "light", "view")


@dataclass(frozen=True)
class Row:
    """What one motion of some seconds came to; milliseconds a frame, and the mode at its end."""

    rate: int
    motion: str
    frames: float
    draw: float
    upload: float
    paint: float
    cpu: float
    mode: str
    error: float


class Bench:
    """A window with a decorated mesh, and hands that drag in it."""

    def __init__(self, mesh: str = "bunny.obj") -> None:
        """Open the window and the mesh."""
        self.application = QApplication.instance() or QApplication([])
        self._folder = tempfile.TemporaryDirectory()
        file = str(Path(self._folder.name) / "settings.ini")
        self.window = Window(settings=QSettings(file, QSettings.Format.IniFormat), scripted=True)
        self.window.show()
        self.view: Any = self.window.viewport._plotter
        self.window.open_mesh(found(mesh))
        self.idle()
        self.fit()
        self.frames = 0
        self.view.frameSwapped.connect(self._count)
        self.btf = woven_btf()
        self.sample = quilting_sample(self.btf)

    def close(self) -> None:
        """Close the window."""
        self.window.close()
        self._folder.cleanup()

    def fit(self) -> None:
        """Make the view 800 x 600 pixels."""
        for _ in range(4):
            self.pause(0.05)
            wide, high = self.view.width() - VIEW[0], self.view.height() - VIEW[1]
            self.window.resize(self.window.width() - wide, self.window.height() - high)
        self.pause(0.1)

    def decorate(self, rate: int) -> None:
        """Cover the mesh with the woven sample."""
        opened = self.window.document.opened
        assert opened is not None
        canvas = prepare(opened, rate, silent)
        engine = pipeline.synthesizer(canvas.prepared, self.sample, QuiltParameters())
        quilt = engine.run()
        seams = measure_seams(engine.net, engine.state, engine.sheet)
        self.take(canvas, quilt, seams)

    def take(self, canvas: Canvas, quilt: Quilt, seams: SeamMeasures) -> None:
        """Show a quilt of the woven sample."""
        materials = (factor_material(self.btf),)
        done = Decoration(canvas, (self.sample,), quilt, 0, seams, 0.0, materials)
        document = self.window.document
        document.set_canvas(canvas)
        document.set_decoration(done)
        self.window.operations.draw()
        self.idle()

    def show(self, mode: Mode) -> None:
        """Show colours or light, once it is prepared."""
        self.window.document.set_mode(mode)
        self.window.operations.draw()
        self.idle()
        self.fit()
        self.window.frame()
        self.pause(0.6)

    def drag(self, motion: str, seconds: float) -> Row:
        """Drag on and on, each step as soon as the frame of the one before is on the screen."""
        control = Qt.KeyboardModifier.ControlModifier
        keys = control if motion == "light" else Qt.KeyboardModifier.NoModifier
        lit, relighter = self.window.viewport.lit, self.window.document.lit
        stages = []
        self._mouse(QEvent.Type.MouseButtonPress, self._place(motion, 0), LEFT, LEFT, keys)
        begin, used, self.frames = time.perf_counter(), time.process_time(), 0
        step = 0
        while time.perf_counter() - begin < seconds:
            step += 1
            self._mouse(QEvent.Type.MouseMove, self._place(motion, step), NO_BUTTON, LEFT, keys)
            self._until_drawn()
            stages.append((lit.stages.draw, lit.stages.upload, lit.stages.paint))
        spent, used = time.perf_counter() - begin, time.process_time() - used
        quality = relighter.quality() if relighter is not None else None
        self._mouse(
            QEvent.Type.MouseButtonRelease, self._place(motion, step), LEFT, NO_BUTTON, keys
        )
        draw, upload, paint = np.mean(stages[len(stages) // 4 :], axis=0) * 1e3
        return Row(
            self._rate(), motion, self.frames / spent, draw, upload, paint,
            used / max(self.frames, 1) * 1e3, quality.mode if quality else "",
            quality.error if quality else 0.0,
        )  # fmt: skip

    def rest(self) -> float:
        """Seconds from the last event of a drag of the light to full quality on the screen.

        Where frames in motion have full quality already, it is there with the last of them.
        """
        moved = self.drag("light", 0.5)
        begin = time.perf_counter()
        self._wait(lambda: self.window.viewport.lit.resting)
        if moved.mode != "full":
            self.frames = 0
            self._until_drawn()
        return time.perf_counter() - begin

    def difference(self) -> int:
        """Greatest difference of codes between the image at rest and one evaluated anew."""
        relighter = self.window.document.lit
        assert relighter is not None
        before, lights = relighter.image.copy(), relighter.lights
        relighter.light(NONE)
        relighter.finish()
        relighter.light(lights)
        return int(np.abs(before.astype(int) - relighter.finish()).max())

    def idle(self) -> None:
        """Wait until no job runs."""
        operations = self.window.operations
        runners = (operations.work, operations.drawing, operations.reading)
        self._wait(lambda: not any(each.busy for each in runners))

    def pause(self, seconds: float) -> None:
        """Let the window live for a while."""
        until = time.perf_counter() + seconds
        self._wait(lambda: time.perf_counter() > until)

    # --- inside

    def _rate(self) -> int:
        canvas = self.window.document.canvas
        return canvas.prepared.dense.size if canvas is not None else 0

    def _count(self) -> None:
        self.frames += 1

    def _until_drawn(self) -> None:
        seen = self.frames
        limit = time.perf_counter() + 5
        while self.frames == seen and time.perf_counter() < limit:
            self.application.processEvents()

    def _wait(self, ready: Callable[[], bool]) -> None:
        while not ready():
            self.application.processEvents()
            time.sleep(0.001)

    def _place(self, motion: str, step: int) -> QPointF:
        width, height = self.view.width(), self.view.height()
        turn = 2 * np.pi * step / 120
        if motion == "light":
            return QPointF(
                width / 2 + 0.3 * height * np.cos(turn), height / 2 + 0.3 * height * np.sin(turn)
            )
        return QPointF(width / 2 + 2.5 * step, height / 2 + 30 * np.sin(turn))

    def _mouse(self, kind: Any, place: QPointF, button: Any, held: Any, keys: Any) -> None:
        event = QMouseEvent(kind, place, self.view.mapToGlobal(place), button, held, keys)
        QApplication.sendEvent(self.view, event)


def measure(rates: Sequence[int], seconds: float) -> list[tuple[Row, ...]]:
    """Rows for every atlas; prints them as they come."""
    bench = Bench()
    out = []
    print("rate  motion        frames/s  draw  upload  rest of frame  cpu/frame  mode, error")
    try:
        for rate in rates:
            bench.decorate(rate)
            rows = []
            for motion in MOTIONS:
                bench.show(Mode.COLOUR if motion.startswith("colour") else Mode.LIT)
                bench.drag(motion, min(seconds, 1.0))  # until its times are known
                rows.append(bench.drag(motion, seconds))
                print(_line(rows[-1]), flush=True)
            waits = sorted(bench.rest() for _ in range(5))
            print(
                f"{rate:5d} at rest: full quality after {waits[2] * 1e3:.0f} ms"
                f" ({waits[0] * 1e3:.0f} to {waits[-1] * 1e3:.0f}, LIT_REST_MS included),"
                f" {bench.difference()} codes from a new evaluation",
                flush=True,
            )
            out.append(tuple(rows))
    finally:
        bench.close()
    return out


def _line(row: Row) -> str:
    return (
        f"{row.rate:5d} {row.motion:13s} {row.frames:8.1f} {row.draw:6.1f} {row.upload:6.1f}"
        f" {row.paint:10.1f} {row.cpu:14.1f}     {row.mode} {row.error:.4f}"
    )


if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--rates", type=int, nargs="+", default=[512, 1024])
    asked.add_argument("--seconds", type=float, default=4.0)
    given = asked.parse_args()
    measure(given.rates, given.seconds)
