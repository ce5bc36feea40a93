"""The window's tools, layers and files, driven as a person does."""

from pathlib import Path

import numpy as np
import pytest
from PyQt6.QtCore import QPoint, QSettings, Qt
from PyQt6.QtTest import QTest
from PyQt6.QtWidgets import QFileDialog

from app.window import Window

LIBRARY = Path(__file__).resolve().parents[2] / "resources"


@pytest.fixture
def window(qtbot, tmp_path):
    settings = QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat)
    window = Window(settings=settings, scripted=True)
    qtbot.addWidget(window)
    window.resize(1100, 700)
    window.show()
    qtbot.waitExposed(window)
    yield window
    window.close()


def idle(qtbot, window):
    operations = window.operations
    runners = (operations.work, operations.drawing, operations.reading, operations.edits.tasks)
    qtbot.waitUntil(
        lambda: not (any(each.busy for each in runners) or operations.edits.busy), timeout=90_000
    )


def test_from_a_mesh_to_a_painted_project_and_back(qtbot, window, tmp_path, monkeypatch):
    document, space = window.document, window.workspace
    document.set_knobs(rate=128)
    window.open_mesh(LIBRARY / "meshes" / "torus.obj")
    idle(qtbot, window)
    document.choose_sample(LIBRARY / "samples" / "cracked-brick.btfz")
    window.synthesize()
    idle(qtbot, window)
    assert document.painting is not None and not document.layers
    assert not any(dock.isVisible() for dock in space.docks)
    before = document.decoration.quilt.source.copy()

    view = window.viewport.surface
    view.setFocus()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow, timeout=5_000)
    QTest.keyClick(view, Qt.Key.Key_B)
    assert document.tool == "paint"
    assert all(dock.isVisible() for dock in space.docks)
    qtbot.waitUntil(lambda: space.bench.picker is not None, timeout=20_000)
    qtbot.wait(100)
    middle = view.rect().center() + QPoint(0, round(0.06 * view.height()))
    left, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    QTest.mousePress(view, left, none, middle - QPoint(60, 0))
    for step in range(-50, 61, 10):
        QTest.mouseMove(view, middle + QPoint(step, 0))
        qtbot.wait(5)
    QTest.mouseRelease(view, left, none, middle + QPoint(60, 0))
    idle(qtbot, window)
    assert len(document.layers) == 1
    assert space.layers.model.rowCount() == 1
    painted = document.decoration.quilt.source.copy()
    assert not np.array_equal(painted, before)

    assert space.undo.isEnabled() and not space.redo.isEnabled()
    space.undo.trigger()
    idle(qtbot, window)
    np.testing.assert_array_equal(document.decoration.quilt.source, before)
    space.redo.trigger()
    idle(qtbot, window)
    np.testing.assert_array_equal(document.decoration.quilt.source, painted)

    file = tmp_path / "painted"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *given: (str(file), ""))
    space.save()
    idle(qtbot, window)
    saved = file.with_suffix(".patina")
    assert saved.is_file() and not document.unsaved
    window.take([saved])
    idle(qtbot, window)
    assert len(document.layers) == 1
    np.testing.assert_array_equal(document.decoration.quilt.source, painted)


def test_saving_nothing_says_so(window):
    window.workspace.save()
    assert "nothing to save" in window.notes.text.text()


def test_every_tool_can_be_taken_before_there_is_a_mesh(qtbot, window):
    for action in window.workspace._bar.actions():
        action.trigger()
        assert action.isChecked()
    assert window.document.tool == "measure"


def test_escape_cancels_what_runs(qtbot, window):
    window.open_mesh(LIBRARY / "meshes" / "cat.obj")
    window.cancel()
    idle(qtbot, window)
    assert window.document.opened is None or not window.operations.work.busy
