"""A window with a view, its tools and their keys, on a real small painting."""

import time
from contextlib import contextmanager

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QPoint, QPointF, QSettings, Qt  # noqa: E402
from PyQt6.QtGui import QAction, QWheelEvent  # noqa: E402
from PyQt6.QtTest import QTest  # noqa: E402
from PyQt6.QtWidgets import QApplication, QMainWindow  # noqa: E402

from app.document import Document, Mode  # noqa: E402
from app.keys import Keymap  # noqa: E402
from app.operations import Operations  # noqa: E402
from app.settings import Settings  # noqa: E402
from app.tool_options import ToolOptions  # noqa: E402
from app.tools.marks import Label  # noqa: E402
from app.tools.workbench import Workbench  # noqa: E402
from app.viewport import Viewport  # noqa: E402
from tests.app.test_pointer import (  # noqa: E402
    LEFT,
    NONE,
    PLAIN,
    down,
    move,
    up,
)
from tests.paint.scenes import MESHES, cracked, featured, spotted  # noqa: E402

LONG_S = 120.0
CTRL, SHIFT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier


class Studio(QMainWindow):
    """A window with a view, its tools and their keys, and nothing else."""

    def __init__(self, folder):
        super().__init__()
        store = QSettings(str(folder / "settings.ini"), QSettings.Format.IniFormat)
        self.document, self.settings, self.keymap = Document(), Settings(store), Keymap(store)
        self.operations = Operations(self.document)
        self.edits = self.operations.edits
        self.viewport = Viewport(self.document)
        self.setCentralWidget(self.viewport)
        self.bench = Workbench(self.viewport, self.document, self.edits, self.settings)
        self.addActions(list(self.bench.actions(self.keymap).values()))
        undo = QAction(self)
        undo.triggered.connect(self.bench.undo)
        self.addAction(self.keymap.bind(undo, "edit.undo"))
        self.told = []
        self.bench.told.connect(self.told.append)
        self.operations.failed.connect(self.told.append)
        self.resize(520, 420)

    @property
    def view(self):
        return self.viewport.surface

    @property
    def layers(self):
        return self.document.layers

    def idle(self):
        runners = (
            self.operations.work, self.operations.drawing, self.operations.reading,
            self.edits.tasks, self.bench._picking, self.bench._measuring,
            self.bench.tools["orient"].tasks,
        )  # fmt: skip
        end = time.monotonic() + LONG_S
        while self.edits.busy or any(each.busy for each in runners):
            assert time.monotonic() < end, "still busy"
            QTest.qWait(5)
        QApplication.processEvents()

    def take(self, tool, **options):
        self.document.set_tool(tool)
        if options:
            self.document.set_options(**options)

    def marks(self, kind):
        return [each for each in self.bench.overlay.marks if isinstance(each, kind)]

    def text(self):
        return " ".join(each.text for each in self.marks(Label))

    def place(self, pixel):
        """Position and normal under a pixel, None beside the surface."""
        found = self.bench.picker.pick(self.bench.view(), np.array([pixel], np.float64))
        return (found.position[0], found.normal[0]) if found.on[0] else None

    def middle(self):
        """Pixel in the middle of what is seen of the cow's flank."""
        return self.view.width() * 0.45, self.view.height() * 0.55

    def changed(self):
        """Positions of vertices that the last layer wrote."""
        dense = self.document.canvas.prepared.dense
        return dense.vertices[self.layers[-1].vertices]

    def line(self, *pixels, steps=12):
        """Draw with the mouse along pixels."""
        down(self.view, *pixels[0])
        for one, two in zip(pixels, pixels[1:], strict=False):
            for share in np.linspace(0, 1, steps + 1)[1:]:
                at = np.array(one) + share * (np.array(two) - one)
                move(self.view, *at, LEFT)
        up(self.view, *pixels[-1])

    def wheel(self, pixel, notches, keys=PLAIN):
        place = QPointF(*pixel)
        QApplication.sendEvent(
            self.view,
            QWheelEvent(
                place, self.view.mapToGlobal(place), QPoint(), QPoint(0, int(120 * notches)), NONE,
                keys, Qt.ScrollPhase.NoScrollPhase, False,
            ),
        )  # fmt: skip


@contextmanager
def opened(folder):
    """A studio on the screen, without a mesh."""
    studio = Studio(folder)
    studio.show()
    QTest.qWaitForWindowExposed(studio)
    document = studio.document
    plain = featured("plain", np.zeros((96, 96), np.float32), 5)
    studio.files = {}
    for sample in (cracked(), spotted(), plain):
        path = studio.files[sample.name] = folder / f"{sample.name}.png"
        Image.fromarray((sample.colour * 255 + 0.5).astype(np.uint8)).save(path)
        if sample is not plain:
            document.set_mask(path, sample.mask)
    document.set_knobs(rate=96, work_patch=16)
    try:
        yield studio
    finally:
        studio.bench.close()
        studio.operations.close()
        studio.viewport.close_view()
        studio.close()


def painted(shared):
    """The studio after a synthesis."""
    if shared.document.painting is None:
        shared.operations.open_mesh(MESHES / "spot.obj")
        shared.idle()
        shared.operations.offer([shared.files["cracked"]], choose=True)
        shared.operations.synthesize()
        shared.idle()
        assert not shared.told, shared.told
    return shared


def cleared(painted):
    """The studio without edits, as it was first."""
    document = painted.document
    painted.edits.undo_to(1)
    painted.idle()
    document.set_mode(Mode.COLOUR)
    painted.edits.protect(None)
    document.set_guide(None)
    step = document.painting.document.engine.step
    document.set_options(**{**vars(ToolOptions()), "radius": 5 * step})
    document.set_tool("view")
    painted.settings.reset()
    painted.viewport.look(azimuth=75.0, elevation=15.0)
    painted.told.clear()
    painted.activateWindow()
    painted.view.setFocus()
    QTest.qWait(1)
    assert document.layers == () and painted.place(painted.middle()) is not None
    return painted
