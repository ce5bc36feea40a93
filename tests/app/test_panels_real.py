"""The panels over the real engine: what is clicked is what the painting becomes."""

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QPoint, Qt  # noqa: E402
from PyQt6.QtTest import QTest  # noqa: E402
from PyQt6.QtWidgets import QLineEdit  # noqa: E402

from app.document import Document  # noqa: E402
from app.operations import Operations  # noqa: E402
from app.panels.history import HistoryPanel  # noqa: E402
from app.panels.layers import LayersPanel  # noqa: E402
from app.panels.status import StatusPanel  # noqa: E402
from tests.app.panels_world import settings, uids  # noqa: E402
from tests.paint.scenes import MESHES, cracked  # noqa: E402

LONG = 120_000
LEFT, NONE = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier


class World:
    """A small cow with cracked plaster and three stamps, and the panels over it."""

    def __init__(self, qtbot, folder):
        self.qtbot, self.document = qtbot, Document()
        self.operations = Operations(self.document)
        self.told = []
        self.operations.failed.connect(self.told.append)
        plaster = cracked()
        path = folder / "plaster.png"
        Image.fromarray((plaster.colour * 255 + 0.5).astype(np.uint8)).save(path)
        self.document.set_mask(path, plaster.mask)
        self.document.set_knobs(rate=64, work_patch=12)
        self.operations.open_mesh(MESHES / "spot.obj")
        self.idle()
        self.operations.offer([path], choose=True)
        self.operations.synthesize()
        self.idle()
        edits = self.operations.edits
        self.layers = LayersPanel(self.document, edits, settings(folder))
        self.history = HistoryPanel(self.document, edits)
        self.status = StatusPanel(self.document, {"Painting": edits.tasks})
        self.status.cancel_wanted.connect(self.operations.cancel)
        for panel, width in ((self.layers, 330), (self.history, 260), (self.status, 700)):
            qtbot.addWidget(panel)
            panel.resize(width, 480 if width < 700 else 34)
            panel.show()
            qtbot.waitExposed(panel)
        dense = self.document.painting.document.prepared.dense
        for vertex in (300, 900, 1500):
            edits.stamp(dense.vertices[vertex], dense.normals[vertex])
        self.busy = self.document.busy_edits
        self.idle()

    def idle(self):
        """Wait until nothing runs or waits."""
        made = self.operations
        runners = (made.work, made.drawing, made.reading, made.edits.tasks)
        self.qtbot.waitUntil(
            lambda: not any(each.busy for each in runners) and not made.edits.busy, timeout=LONG
        )

    def click(self, uid, x=90, keys=NONE):
        panel = self.layers
        rect = panel.view.visualRect(panel.model.index(panel.model.row_of(uid)))
        where = QPoint(rect.left() + x, rect.center().y())
        QTest.mouseClick(panel.view.viewport(), LEFT, keys, where)

    def key(self, key, keys=NONE):
        QTest.keyClick(self.layers.view, key, keys)

    @property
    def source(self):
        return self.document.decoration.quilt.source.copy()


@pytest.fixture
def world(qtbot, tmp_path):
    made = World(qtbot, tmp_path)
    yield made
    made.operations.close()
    assert not made.told


def test_a_day_with_layers(world):
    document, layers = world.document, world.layers
    assert world.busy == 3 and uids(document) == [0, 1, 2]
    whole = world.source
    world.click(1, x=12)  # its eye
    world.idle()
    assert not document.layers[1].visible and not np.array_equal(world.source, whole)
    world.click(1, x=12)
    world.idle()
    assert np.array_equal(world.source, whole)

    world.click(1)
    world.key(Qt.Key.Key_F2)
    editor = layers.view.findChild(QLineEdit)
    editor.selectAll()
    QTest.keyClicks(editor, "Over the eye")
    QTest.keyClick(editor, Qt.Key.Key_Return)
    world.qtbot.waitUntil(lambda: document.layers[1].name == "Over the eye", timeout=LONG)

    field = layers.knobs.rotation.field
    field.selectAll()
    QTest.keyClicks(field, "90")
    QTest.keyClick(field, Qt.Key.Key_Return)
    world.idle()
    assert document.layers[1].edit.rotation == 90
    assert not np.array_equal(world.source, whole)

    QTest.mouseClick(layers.buttons["up"], LEFT)
    world.idle()
    assert uids(document) == [0, 2, 1] and document.selected == 1

    world.key(Qt.Key.Key_J, Qt.KeyboardModifier.ControlModifier)
    world.idle()
    assert len(document.layers) == 4

    world.click(0)
    world.click(2, keys=Qt.KeyboardModifier.ControlModifier)
    world.key(Qt.Key.Key_Delete)
    world.idle()
    assert len(document.layers) == 2 and not {0, 2} & set(uids(document))

    steps = document.history_at
    assert len(document.history) == steps and world.history.model.rowCount() == steps + 1
    before = world.source
    view = world.history.view
    row = steps - 8  # back to the three stamps as they were
    rect = view.visualRect(world.history.model.index(row))
    view.scrollTo(world.history.model.index(row))
    rect = view.visualRect(world.history.model.index(row))
    QTest.mouseClick(view.viewport(), LEFT, NONE, rect.center())
    world.idle()
    assert document.history_at == row and uids(document) == [0, 1, 2]
    assert np.array_equal(world.source, whole)
    view.scrollTo(world.history.model.index(steps))
    rect = view.visualRect(world.history.model.index(steps))
    QTest.mouseClick(view.viewport(), LEFT, NONE, rect.center())
    world.idle()
    assert document.history_at == steps and np.array_equal(world.source, before)
