"""The window as a user meets it, under Xvfb, with the real pipeline at small rates."""

import itertools
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QEvent, QMimeData, QPoint, QPointF, QSettings, Qt, QUrl  # noqa: E402
from PyQt6.QtGui import QDropEvent, QMouseEvent, QWheelEvent  # noqa: E402
from PyQt6.QtWidgets import QApplication  # noqa: E402

from app.document import Mode  # noqa: E402
from app.window import Window  # noqa: E402
from btfcore.btf.stack import ArrayStack  # noqa: E402
from btfcore.files.package.write import write_package  # noqa: E402
from btfcore.quilt.synthesize import Synthesizer  # noqa: E402
from tests.btf.bricks import factors, images, sample  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
LONG = 120_000  # generous: a first run compiles


@pytest.fixture
def window(qtbot, tmp_path, monkeypatch):
    """An empty window without the shipped samples."""
    monkeypatch.setattr("app.window.samples", list)
    monkeypatch.setattr("app.window.btf_samples", list)
    settings = QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat)
    window = Window(settings=settings, scripted=True)
    window.resize(1280, 800)
    window.show()
    qtbot.waitExposed(window)
    yield window
    window.close()


def idle(qtbot, window):
    """Wait until nothing runs."""
    operations = window.operations
    edits = operations.edits
    runners = (operations.work, operations.drawing, operations.reading, edits, edits.tasks)
    qtbot.waitUntil(lambda: not any(each.busy for each in runners), timeout=LONG)


def load(qtbot, window, files, rate=64):
    """Open the ring and choose the blobs."""
    window.document.set_knobs(rate=rate)
    window.take([files / "ring.obj", files / "blobs.png"])
    idle(qtbot, window)


def pixels(image):
    """(H, W, 3) u8 of a QImage."""
    image = image.convertToFormat(image.Format.Format_RGB888)
    data = image.constBits().asarray(image.sizeInBytes())
    rows = np.frombuffer(bytes(data), np.uint8).reshape(image.height(), image.bytesPerLine())
    return rows[:, : 3 * image.width()].reshape(image.height(), image.width(), 3)


def test_an_empty_window_says_what_to_do(window):
    assert window.stack.currentWidget() is window.welcome
    assert not window.run.start.isEnabled()
    assert "mesh" in window.run.label.text() and "sample" in window.run.label.text()


def test_a_package_is_shown_and_synthesised(qtbot, window, files, tmp_path):
    bricks = sample(factors=factors(height=40, width=40), stack=ArrayStack(images(5, 12, 40, 40)))
    package = write_package(tmp_path / "random_material.btfz", bricks)
    window.document.set_knobs(rate=64)
    window.take([files / "ring.obj", package])
    idle(qtbot, window)
    (entry,) = window.document.samples
    assert entry.thumbnail is not None and entry.thumbnail.shape == (40, 40, 3)
    window.synthesize()
    idle(qtbot, window)
    done = window.document.decoration
    assert (done.quilt.patch >= 0).all()
    assert done.sample.channels.shape == (40, 40, 4), "the factors are what is compared"
    broken = tmp_path / "broken.btfz"
    broken.write_bytes(package.read_bytes()[:900])
    window.take([broken])
    idle(qtbot, window)
    assert "broken.btfz" in window.document.samples[-1].error


def test_a_dropped_mesh_and_image_can_be_synthesised_and_seen(qtbot, window, files):
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(files / n)) for n in ("ring.obj", "blobs.png")])
    window.dropEvent(
        QDropEvent(
            QPointF(300, 300), Qt.DropAction.CopyAction, data, Qt.MouseButton.LeftButton,
            Qt.KeyboardModifier.NoModifier,
        )
    )  # fmt: skip
    idle(qtbot, window)
    document = window.document
    assert document.opened.path.name == "ring.obj"
    assert document.samples[0].thumbnail is not None
    assert window.stack.currentWidget() is window.viewport
    bare = pixels(window.viewport.picture()).astype(int)
    assert np.ptp(bare) > 50
    document.set_knobs(rate=64)
    frames = []
    document.picture_changed.connect(lambda: frames.append(document.texture))
    qtbot.mouseClick(window.run.start, Qt.MouseButton.LeftButton)
    assert window.run.cancel.isVisible() and not window.run.start.isEnabled()
    idle(qtbot, window)
    assert (document.decoration.quilt.patch >= 0).all()
    assert len(frames) >= 2
    seen = {}
    modes = [mode for mode in Mode if mode is not Mode.LIT]  # see test_lit
    for mode, key in zip(modes, "1234", strict=True):
        window.menus.modes[mode].trigger()
        idle(qtbot, window)
        assert document.texture is not None, mode
        assert window.modes.buttons[mode].isChecked() and key in "1234"
        seen[mode] = pixels(window.viewport.picture()).astype(int)
        assert np.abs(seen[mode] - bare).max() > 40
    assert all(np.abs(seen[a] - seen[b]).max() > 40 for a in modes for b in modes if a is not b)
    yellow = lambda p: ((p[..., 0] > 150) & (p[..., 1] > 120) & (p[..., 2] < 70)).sum()  # noqa: E731
    assert yellow(seen[Mode.SEAMS]) > yellow(seen[Mode.COLOUR]) + 20


def test_cancel_leaves_the_document_usable(qtbot, window, files):
    load(qtbot, window, files, rate=256)
    window.operations.work.progressed.connect(
        lambda fraction, label, left: window.cancel() if fraction > 0.45 else None
    )
    with qtbot.waitSignal(window.operations.work.cancelled, timeout=LONG):
        window.synthesize()
    idle(qtbot, window)
    assert window.document.decoration is None and not window.document.unsaved
    assert window.document.texture is None  # nothing half-done stays on the surface
    assert window.run.start.isEnabled() and not window.run.export.isEnabled()
    window.operations.work.progressed.disconnect()
    window.document.set_knobs(rate=64)
    window.synthesize()
    idle(qtbot, window)
    assert window.document.decoration is not None and window.run.export.isEnabled()


def between_patches(monkeypatch, act):
    """Have every synthesis call `act(n)` in its own thread after its n-th patch."""
    run = Synthesizer.run

    def watched(self, *, progress, on_update=None):
        count = itertools.count(1)

        def told(fraction, label):
            act(next(count))
            progress(fraction, label)

        return run(self, progress=told, on_update=on_update)

    monkeypatch.setattr(Synthesizer, "run", watched)


def test_a_cancelled_synthesis_goes_on_where_it_stopped(qtbot, window, files, monkeypatch):
    load(qtbot, window, files, rate=128)
    operations, stops = window.operations, [3]

    def stop(number):
        if stops and number == stops[0]:
            stops.clear()
            operations.work._running.stop.set()

    between_patches(monkeypatch, stop)
    with qtbot.waitSignal(operations.work.cancelled, timeout=LONG):
        window.synthesize()
    idle(qtbot, window)
    (engine,) = operations._unfinished.values()
    before = engine.state.patch.copy()
    assert (before >= 0).any() and (before < 0).any()
    window.synthesize()
    idle(qtbot, window)
    quilt = window.document.decoration.quilt
    assert np.array_equal(quilt.patch, engine.state.patch) and (quilt.patch >= 0).all()
    assert not operations._unfinished


def test_pause_waits_and_going_on_gives_the_same_quilt(qtbot, window, files, monkeypatch):
    load(qtbot, window, files, rate=128)
    between_patches(monkeypatch, lambda number: time.sleep(0.05))  # the window hears of it in time
    work, paused = window.operations.work, []
    assert not window.menus.pause.isEnabled()

    def hold(fraction, label, left):
        if label == "quilting" and not paused:
            paused.append(fraction)
            window.menus.pause.trigger()

    work.progressed.connect(hold)
    with qtbot.waitSignal(work.held, timeout=LONG):
        window.synthesize()
    qtbot.wait(300)
    assert work.busy and work.paused and window.menus.pause.isChecked()
    assert window.run.label.text() == "Paused" and window.run.pause.text() == "Go on"
    assert window.run.pause.isVisible() and window.document.decoration is None
    qtbot.mouseClick(window.run.pause, Qt.MouseButton.LeftButton)
    assert not work.paused and not window.menus.pause.isChecked()
    idle(qtbot, window)
    first = window.document.decoration.quilt
    assert (first.patch >= 0).all() and not window.run.pause.isVisible()
    window.synthesize()
    idle(qtbot, window)
    assert window.document.decoration.quilt.source.tobytes() == first.source.tobytes()


def test_the_second_run_keeps_the_atlas_and_another_rate_makes_another(qtbot, window, files):
    load(qtbot, window, files)
    seen = []
    for rate, seed in ((64, 0), (64, 1), (96, 1), (64, 2)):
        window.document.set_knobs(rate=rate, seed=seed)
        window.synthesize()
        idle(qtbot, window)
        seen.append(window.document.decoration)
    assert seen[0].canvas is seen[1].canvas is seen[3].canvas is not seen[2].canvas
    assert window.document.canvas is seen[3].canvas
    assert seen[2].canvas.prepared.dense.size == 96


def test_export_writes_a_file_and_says_so(qtbot, window, files, tmp_path):
    load(qtbot, window, files)
    window.synthesize()
    idle(qtbot, window)
    assert window.document.unsaved and window.isWindowModified()
    window.operations.export(tmp_path / "out.glb")
    idle(qtbot, window)
    assert (tmp_path / "out.glb").read_bytes()[:4] == b"glTF"
    assert "out.glb" in window.notes.text.text() and not window.document.unsaved
    window.operations.export(tmp_path / "nowhere" / "out.glb")
    idle(qtbot, window)
    assert window.errors.isVisible() and "nowhere" in window.errors.text.text()


@pytest.mark.parametrize("name", ["broken.obj", "missing.obj", "notes.txt"])
def test_bad_files_end_in_the_error_bar(qtbot, window, files, name):
    window.take([files / name])
    idle(qtbot, window)
    assert window.errors.isVisible() and name in window.errors.text.text()
    assert window.document.opened is None
    window.take([files / "ring.obj"])
    idle(qtbot, window)
    assert window.document.opened is not None and not window.errors.isVisible()


def test_a_broken_image_is_offered_as_broken_and_fails_by_name(qtbot, window, files):
    load(qtbot, window, files)
    window.operations.offer([files / "noimage.png"])
    idle(qtbot, window)
    assert "noimage.png" in window.document.samples[1].error
    window.document.choose_sample(files / "noimage.png")
    window.synthesize()
    idle(qtbot, window)
    assert "noimage.png" in window.errors.text.text()
    assert window.run.start.isEnabled()


def test_a_folder_of_samples_is_offered_and_an_empty_one_is_named(qtbot, window, files, tmp_path):
    window.take([files, tmp_path])
    idle(qtbot, window)
    assert {e.path.name for e in window.document.samples} == {"blobs.png", "noimage.png"}
    assert str(tmp_path) in window.errors.text.text()


def test_closing_during_synthesis_stops_it(qtbot, window, files):
    load(qtbot, window, files, rate=256)
    with qtbot.waitSignal(window.operations.work.progressed, timeout=LONG):
        window.synthesize()
    assert window.operations.work.busy
    window.close()
    assert not window.operations.work.busy and window.operations.work.wait(0)
    assert not window.isVisible()


@pytest.mark.parametrize("answer", ["keep", "discard"])
def test_unexported_work_is_not_lost_without_a_question(qtbot, window, files, answer, monkeypatch):
    load(qtbot, window, files)
    window.synthesize()
    idle(qtbot, window)
    window.scripted = False
    asked = []

    def exec_box(box):
        asked.append(box.text())
        box.buttons()[0 if answer == "keep" else 1].click()

    monkeypatch.setattr("app.window.QMessageBox.exec", exec_box)
    window.close()
    assert len(asked) == 1 and "exported" in asked[0]
    assert window.isVisible() is (answer == "keep")
    window.scripted = True


def test_the_mouse_turns_shifts_and_zooms_and_keys_are_not_vtks(qtbot, window, files):
    load(qtbot, window, files)
    view = window.viewport
    target = view._plotter
    start = view.scene.camera

    def drag(button, modifier=Qt.KeyboardModifier.NoModifier):
        qtbot.mousePress(target, button, modifier, QPoint(200, 200))
        qtbot.mouseMove(target, QPoint(240, 220))
        target_event(target, button, modifier)
        qtbot.mouseRelease(target, button, modifier, QPoint(240, 220))

    def target_event(widget, button, modifier):
        place = QPointF(260, 230)
        event = QMouseEvent(
            QEvent.Type.MouseMove, place, widget.mapToGlobal(place), button, button, modifier
        )
        QApplication.sendEvent(widget, event)

    drag(Qt.MouseButton.LeftButton)
    turned = view.scene.camera
    assert turned.azimuth != start.azimuth and turned.focus == start.focus
    drag(Qt.MouseButton.MiddleButton)
    assert view.scene.camera.focus != turned.focus
    assert view.scene.camera.azimuth == turned.azimuth
    for key in "wspeqr":
        qtbot.keyClick(target, key)
    assert window.isVisible() and view.scene.camera.azimuth == turned.azimuth
    near = view.scene.camera.distance
    place = QPointF(200, 200)
    QApplication.sendEvent(
        target,
        QWheelEvent(
            place, target.mapToGlobal(place), QPoint(0, 0), QPoint(0, 120),
            Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier,
            Qt.ScrollPhase.NoScrollPhase, False,
        ),
    )  # fmt: skip
    assert view.scene.camera.distance < near
    shifted = view.scene.camera.focus
    window.frame()
    assert view.scene.camera.focus != shifted and view.scene.camera.azimuth == turned.azimuth


def test_the_demo_saves_a_picture_of_the_whole_window(tmp_path, files):
    target = tmp_path / "shot.png"
    done = subprocess.run(
        [sys.executable, "-m", "app", "gui", str(files / "ring.obj"), "--screenshot", str(target),
         "--script", "demo"],
        cwd=ROOT, capture_output=True, text=True, timeout=240,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    picture = np.asarray(Image.open(target).convert("RGB")).astype(int)
    assert picture.shape[0] >= 600 and picture.shape[1] >= 900
    view, panel = picture[100:-60, 400:-20], picture[100:400, 20:300]
    assert view.std() > 20 and panel.std() > 20
    assert view[:5].mean() > 200  # the view's background is there, not black


def test_without_a_display_one_line_says_so():
    done = subprocess.run(
        [sys.executable, "-m", "app", "gui"], cwd=ROOT, capture_output=True, text=True,
        env={"PATH": "/usr/bin:/bin", "HOME": "/tmp"},
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and "DISPLAY" in done.stderr


def test_a_display_that_is_not_there_is_named():
    done = subprocess.run(
        [sys.executable, "-m", "app", "gui"], cwd=ROOT, capture_output=True, text=True,
        env={"PATH": "/usr/bin:/bin", "HOME": "/tmp", "DISPLAY": ":4711"},
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and ":4711" in done.stderr


def test_ctrl_c_closes_the_window(files):
    done = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, str(files / "ring.obj")],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    out, errors = done.communicate(timeout=120)
    assert done.returncode == 0 and out == "left 0\n", errors


INTERRUPTED = """
import os, signal, sys
from pathlib import Path
from PyQt6.QtCore import QTimer
from PyQt6.QtWidgets import QApplication
application = QApplication([])
QTimer.singleShot(1500, lambda: os.kill(os.getpid(), signal.SIGINT))
from app.gui import run_gui
print("left", run_gui(Path(sys.argv[1])))
"""


def test_an_unknown_script_is_named():
    done = subprocess.run(
        [sys.executable, "-m", "app", "gui", "--script", "dance"], cwd=ROOT,
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 2 and "dance" in done.stderr
