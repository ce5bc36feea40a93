"""A mask editor under test: its sample, and the mouse upon it."""

import numpy as np
from PyQt6.QtCore import QPointF, Qt
from PyQt6.QtTest import QTest

LONG = 120_000  # generous: a first run compiles
LEFT, NONE = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
ROW, COLUMN = np.mgrid[:90, :120].astype(float)
SPOT = np.hypot(COLUMN - 70, ROW - 40) < 15
FAR_SPOT = np.hypot(COLUMN - 20, ROW - 75) < 8


def spotted():
    """Grey picture (90, 120, 3) with two brown spots and a little grain."""
    grain = np.random.default_rng(2).normal(0, 0.004, (90, 120, 1))
    brown, grey = np.array([0.45, 0.25, 0.15]), np.array([0.6, 0.6, 0.62])
    return (np.where((SPOT | FAR_SPOT)[..., None], brown, grey) + grain).astype(np.float32)


def idle(qtbot, editor):
    """Wait until nothing runs or waits."""
    qtbot.waitUntil(lambda: not editor.model.busy, timeout=LONG)


def at(editor, column, row):
    return editor.view.place_of(column, row).toPoint()


def texel(editor, column, row):
    """Where a click at a position really lands, in texels: places in the view are whole."""
    found = editor.view.texel_at(QPointF(at(editor, column, row)))
    return [found.x(), found.y()]


def drag(editor, points, keys=NONE, button=LEFT):
    """Draw through positions in texels with the mouse."""
    places = [at(editor, *each) for each in points]
    QTest.mousePress(editor.view, button, keys, places[0])
    for place in places[1:]:
        QTest.mouseMove(editor.view, place)
    QTest.mouseRelease(editor.view, button, keys, places[-1])


def pixels(widget):
    """(H, W, 3) i of what a widget shows."""
    image = widget.grab().toImage().convertToFormat(widget.grab().toImage().Format.Format_RGB888)
    data = bytes(image.constBits().asarray(image.sizeInBytes()))
    rows = np.frombuffer(data, np.uint8).reshape(image.height(), image.bytesPerLine())
    return rows[:, : 3 * image.width()].reshape(image.height(), image.width(), 3).astype(int)
