"""Light in the window, with real mouse events under Xvfb."""

import numpy as np
import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QEvent, QPointF, QSettings, Qt  # noqa: E402
from PyQt6.QtGui import QMouseEvent  # noqa: E402
from PyQt6.QtWidgets import QApplication  # noqa: E402

from app.document import Lamp, Mode  # noqa: E402
from app.window import Window  # noqa: E402
from btfcore.btf.stack import ArrayStack  # noqa: E402
from btfcore.files.exr import encode_exr  # noqa: E402
from btfcore.files.package.write import write_package  # noqa: E402
from tests.app.test_window import idle, pixels  # noqa: E402
from tests.btf.bricks import factors, images, sample  # noqa: E402

LONG = 120_000
LEFT, NONE = Qt.MouseButton.LeftButton, Qt.MouseButton.NoButton
PLAIN, CONTROL = Qt.KeyboardModifier.NoModifier, Qt.KeyboardModifier.ControlModifier


@pytest.fixture
def window(qtbot, tmp_path, monkeypatch):
    """A window without the shipped samples."""
    monkeypatch.setattr("app.window.samples", list)
    monkeypatch.setattr("app.window.btf_samples", list)
    settings = QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat)
    window = Window(settings=settings, scripted=True)
    window.resize(1100, 700)
    window.show()
    qtbot.waitExposed(window)
    yield window
    window.close()


@pytest.fixture
def lit(qtbot, window, files, tmp_path):
    """The window with a ring of bricks under light, at rest."""
    bricks = sample(
        factors=factors(height=40, width=40), stack=ArrayStack(images(5, 12, 40, 40), sound=True)
    )
    package = write_package(tmp_path / "bricks.btfz", bricks)
    window.document.set_knobs(rate=64)
    window.take([files / "ring.obj", package])
    idle(qtbot, window)
    window.synthesize()
    idle(qtbot, window)
    window.menus.modes[Mode.LIT].trigger()
    idle(qtbot, window)
    rested(qtbot, window)
    return window


def rested(qtbot, window):
    """Wait for full quality on the screen."""
    qtbot.waitUntil(lambda: window.viewport.lit.resting, timeout=LONG)


def mouse(view, kind, place, button, held, keys):
    event = QMouseEvent(kind, place, view.mapToGlobal(place), button, held, keys)
    QApplication.sendEvent(view, event)


def drag(window, points, keys=PLAIN, release=True):
    """Drag with the left button over points in shares of the view's width and height."""
    view = window.viewport._plotter
    places = [QPointF(x * view.width(), y * view.height()) for x, y in points]
    mouse(view, QEvent.Type.MouseButtonPress, places[0], LEFT, LEFT, keys)
    for place in places[1:]:
        mouse(view, QEvent.Type.MouseMove, place, NONE, LEFT, keys)
    if release:
        mouse(view, QEvent.Type.MouseButtonRelease, places[-1], LEFT, NONE, keys)


def shot(window):
    return pixels(window.viewport.picture()).astype(int)


def full(window):
    """The atlas's image evaluated anew, and what the view's texture holds."""
    relighter = window.document.lit
    kept = relighter.image.copy()
    lights = relighter.lights
    relighter.light(type(lights)(np.zeros((0, 3)), np.zeros((0, 3))))
    relighter.finish()
    relighter.light(lights)
    return relighter.finish().copy(), kept


def test_dragging_with_control_moves_the_light_and_not_the_camera(qtbot, lit):
    camera, before = lit.viewport.scene.camera, shot(lit)
    drag(lit, [(0.5, 0.5), (0.6, 0.5), (0.8, 0.5)], CONTROL)
    rested(qtbot, lit)
    after = shot(lit)
    assert lit.viewport.scene.camera == camera
    assert np.abs(after - before).max() > 40
    right, up, back = camera.axes() @ np.array(lit.document.lighting.lamps[0].direction)
    assert right > 0.7 and abs(up) < 0.1 and back > 0
    drag(lit, [(0.2, 0.5)], CONTROL)
    rested(qtbot, lit)
    other = shot(lit)
    wide = other.shape[1] // 2
    assert after[:, wide:].sum() - after[:, :wide].sum() > (
        other[:, wide:].sum() - other[:, :wide].sum()
    ), "the lit side follows the pointer"


def test_the_camera_turns_as_before_and_the_light_stays(qtbot, lit):
    light, camera = lit.document.lighting, lit.viewport.scene.camera
    before = shot(lit)
    drag(lit, [(0.5, 0.5), (0.6, 0.5)])
    rested(qtbot, lit)
    assert lit.document.lighting == light and lit.viewport.scene.camera != camera
    assert np.abs(shot(lit) - before).max() > 30


def test_holding_l_or_the_button_moves_the_light_too(qtbot, lit):
    view, camera = lit.viewport._plotter, lit.viewport.scene.camera
    seen = [lit.document.lighting]
    view.setFocus()
    qtbot.keyPress(view, Qt.Key.Key_L)
    drag(lit, [(0.5, 0.5), (0.7, 0.4)])
    qtbot.keyRelease(view, Qt.Key.Key_L)
    seen.append(lit.document.lighting)
    qtbot.mouseClick(lit.light.drag, LEFT)
    drag(lit, [(0.5, 0.5), (0.3, 0.4)])
    seen.append(lit.document.lighting)
    qtbot.mouseClick(lit.light.drag, LEFT)
    assert lit.viewport.scene.camera == camera
    assert seen[0] != seen[1] != seen[2]
    drag(lit, [(0.5, 0.5), (0.3, 0.4)])
    assert lit.document.lighting is seen[2] and lit.viewport.scene.camera != camera


def test_at_rest_the_texture_is_a_full_evaluation_and_the_panel_says_so(qtbot, lit):
    drag(lit, [(0.5, 0.5), (0.65, 0.35), (0.7, 0.3)], CONTROL)
    rested(qtbot, lit)
    anew, kept = full(lit)
    assert np.array_equal(anew, kept)
    qtbot.waitUntil(lambda: "Full quality" in lit.light.readout.text(), timeout=LONG)
    assert lit.light.readout.toolTip(), "why it is drawn like that"


def test_the_view_shows_radiance_and_no_light_of_the_scene(qtbot, lit):
    relighter = lit.document.lit
    lit.document.set_lighting(exposure=8.0, lamps=(Lamp((0, 0, 1)), Lamp((0, 0, -1))))
    rested(qtbot, lit)
    bright = relighter.image[relighter.image.min(axis=2) == 255]
    picture = shot(lit)
    assert len(bright) and (picture == 255).all(axis=2).sum() > 200, "white is white"
    lit.document.set_lighting(exposure=-8.0)
    rested(qtbot, lit)
    middle = shot(lit)[100:-100, 100:-100]
    assert (middle.max(axis=2) < 12).sum() > 200


def test_exposure_and_curve_change_the_picture_but_evaluate_nothing(qtbot, lit, monkeypatch):
    calls = []
    inner = lit.document.lit._backing.radiance
    monkeypatch.setattr(
        lit.document.lit._backing, "radiance",
        lambda *a, **k: (calls.append(a[0]), inner(*a, **k))[1],
    )  # fmt: skip
    before = shot(lit)
    lit.light.exposure.setValue(15)
    lit.light.curve.setCurrentIndex(2)
    lit.light.curve.activated.emit(2)
    rested(qtbot, lit)
    assert lit.document.lighting.exposure == 1.5 and lit.document.lighting.curve == "filmic"
    assert np.abs(shot(lit) - before).max() > 30 and calls == []


def test_lights_are_added_removed_and_coloured_by_the_panel(qtbot, lit):
    before = shot(lit)
    qtbot.mouseClick(lit.light.add, LEFT)
    assert len(lit.document.lighting.lamps) == 2 and lit.document.lighting.main == 1
    lit.light.strength.setValue(3.0)
    assert lit.document.lighting.lamps[1].strength == 3.0
    rested(qtbot, lit)
    brighter = shot(lit)
    assert brighter.sum() > before.sum()
    qtbot.mouseClick(lit.light.remove, LEFT)
    rested(qtbot, lit)
    assert np.abs(shot(lit) - before).max() <= 2
    qtbot.mouseClick(lit.light.remove, LEFT)
    assert lit.document.lighting.lamps == () and not lit.light.remove.isEnabled()
    drag(lit, [(0.5, 0.5), (0.7, 0.5)], CONTROL)
    rested(qtbot, lit)
    row, column = lit.document.canvas.prepared.dense.texel[lit.document.lit.visible].T
    assert not lit.document.lit.image[row, column].any(), "no light at all"


def test_an_environment_lights_and_a_broken_one_is_named(qtbot, lit, tmp_path):
    sky = np.full((8, 16, 3), 0.2, np.float32)
    sky[1:3, 4:7] = 6.0
    (tmp_path / "sky.exr").write_bytes(encode_exr(sky))
    before, seen = lit.document.lit.image.astype(int), shot(lit)
    with qtbot.waitSignal(lit.document.lighting_changed, timeout=LONG):
        lit.operations.open_environment(tmp_path / "sky.exr")
    rested(qtbot, lit)
    assert np.abs(lit.document.lit.image - before).max() > 20
    assert "sky.exr" in lit.light.environment.text() and lit.light.turn.isVisible()
    (tmp_path / "odd.exr").write_bytes(b"no picture")
    lit.operations.open_environment(tmp_path / "odd.exr")
    qtbot.waitUntil(lambda: "odd.exr" in lit.errors.text.text(), timeout=LONG)
    lit.light.bare.click()
    rested(qtbot, lit)
    assert lit.document.lighting.environment is None and not lit.light.turn.isVisible()
    for bar in (lit.errors, lit.notes):  # they made the view a little smaller
        bar.clear()
    qtbot.waitUntil(lambda: shot(lit).shape == seen.shape, timeout=LONG)
    rested(qtbot, lit)
    again = shot(lit)
    assert again.shape == seen.shape and np.abs(again - seen).max() <= 2


def test_modes_change_back_and_forth(qtbot, lit):
    light = shot(lit)
    assert lit.light.isVisible()
    for key in "15":
        lit.menus.modes[Mode.COLOUR if key == "1" else Mode.LIT].trigger()
        idle(qtbot, lit)
        if key == "1":
            colour = shot(lit)
            assert not lit.light.isVisible()
    rested(qtbot, lit)
    assert np.abs(colour - light[: colour.shape[0]]).max() > 30 or colour.shape != light.shape
    assert np.abs(shot(lit) - light).max() <= 2


def test_a_synthesis_runs_meanwhile_and_its_result_is_lit(qtbot, lit):
    first = lit.document.relighter
    lit.document.set_knobs(seed=4)
    with qtbot.waitSignal(lit.operations.work.reported, timeout=LONG):
        lit.synthesize()
    drag(lit, [(0.5, 0.5), (0.7, 0.4)], CONTROL)
    idle(qtbot, lit)
    idle(qtbot, lit)
    rested(qtbot, lit)
    assert lit.document.mode is Mode.LIT and lit.document.lit is not first
    anew, kept = full(lit)
    assert np.array_equal(anew, kept)


def test_another_mesh_ends_the_light(qtbot, lit, files):
    drag(lit, [(0.5, 0.5), (0.7, 0.4)], CONTROL, release=False)
    lit.take([files / "ring.obj"])
    idle(qtbot, lit)
    assert lit.document.mode is Mode.COLOUR and lit.document.relighter is None
    assert not lit.modes.buttons[Mode.LIT].isEnabled() and not lit.light.isVisible()
    assert not lit.viewport.lit.active and np.ptp(shot(lit)) > 30


def test_hiding_resizing_and_closing_while_refining(qtbot, lit):
    lit.stack.setCurrentWidget(lit.welcome)
    drag(lit, [(0.5, 0.5), (0.7, 0.4)], CONTROL)
    qtbot.wait(50)
    lit.stack.setCurrentWidget(lit.viewport)
    lit.resize(900, 640)
    rested(qtbot, lit)
    anew, kept = full(lit)
    assert np.array_equal(anew, kept)
    drag(lit, [(0.5, 0.5), (0.6, 0.4)], CONTROL)
    lit.viewport.lit.rest()
    assert lit.viewport.lit.refining
    lit.close()
    assert not lit.isVisible() and not lit.viewport.lit.refining


def test_an_error_while_lighting_is_told_and_colours_stay(qtbot, lit, monkeypatch):
    def fail(*args, **kwargs):
        raise RuntimeError("planted")

    monkeypatch.setattr(lit.document.lit._backing, "radiance", fail)
    drag(lit, [(0.5, 0.5), (0.7, 0.4)], CONTROL)
    qtbot.waitUntil(lambda: "planted" in lit.errors.text.text(), timeout=LONG)
    assert lit.isVisible() and not lit.viewport.lit.active
    assert np.ptp(shot(lit)) > 30
    drag(lit, [(0.5, 0.5), (0.6, 0.5)])
    lit.document.set_mode(Mode.COLOUR)
    idle(qtbot, lit)


def test_a_picture_is_lit_as_a_diffuse_surface(qtbot, window, files):
    window.document.set_knobs(rate=64)
    window.take([files / "ring.obj", files / "blobs.png"])
    idle(qtbot, window)
    window.synthesize()
    idle(qtbot, window)
    window.document.set_mode(Mode.LIT)
    idle(qtbot, window)
    rested(qtbot, window)
    relighter, (material,) = window.document.lit, window.document.decoration.materials
    assert material.rank == 3 and relighter.image.any()
    camera = window.viewport.scene.camera
    right, up, back = camera.axes() @ np.array(window.document.lighting.lamps[0].direction)
    assert right < 0 < up and back > 0, "at first the light comes from the upper left"
