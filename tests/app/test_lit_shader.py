"""Light drawn by the fragment shader in the window; a driver without a card runs it, slowly."""

import numpy as np
import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QSettings  # noqa: E402
from PyQt6.QtWidgets import QApplication, QMainWindow  # noqa: E402

from app.document import Lamp, Mode  # noqa: E402
from app.window import Window  # noqa: E402
from btfcore.btf.stack import ArrayStack  # noqa: E402
from btfcore.files.exr import encode_exr  # noqa: E402
from btfcore.files.package.write import write_package  # noqa: E402
from btfcore.render.glsl import surface as glsl  # noqa: E402
from tests.app.test_lit import CONTROL, drag, rested, shot  # noqa: E402
from tests.app.test_window import idle  # noqa: E402

LONG = 20_000
from tests.btf.bricks import factors, images, sample  # noqa: E402


@pytest.fixture
def window(qtbot, tmp_path, monkeypatch):
    """A small window without the shipped samples, which is to use the shader."""
    monkeypatch.setattr("app.window.samples", list)
    monkeypatch.setattr("app.window.btf_samples", list)
    monkeypatch.setenv("PATINA_BACKEND", "shader")
    settings = QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat)
    window = Window(settings=settings, scripted=True)
    window.resize(700, 480)
    window.show()
    qtbot.waitExposed(window)
    yield window
    window.close()


def light_up(qtbot, window, files, tmp_path):
    stack = ArrayStack(images(5, 12, 40, 40), sound=True)
    bricks = sample(factors=factors(height=40, width=40), stack=stack)
    package = write_package(tmp_path / "bricks.btfz", bricks)
    window.document.set_knobs(rate=64)
    window.take([files / "ring.obj", package])
    idle(qtbot, window)
    window.synthesize()
    idle(qtbot, window)
    window.viewport._framed = False
    window.viewport.scene.camera = window.viewport.scene.camera.zoomed(0.5)
    window.menus.modes[Mode.LIT].trigger()
    idle(qtbot, window)
    rested(qtbot, window)


@pytest.fixture
def lit(qtbot, window, files, tmp_path):
    """The window with a ring of bricks under light, at rest."""
    light_up(qtbot, window, files, tmp_path)
    assert window.viewport.lit._card.shown, "the shader draws"
    return window


def by_processor(window):
    """The picture that the processor evaluates of what is shown."""
    lit = window.viewport.lit
    was = lit.software
    lit.software = True
    window.viewport.redraw()
    drawn = shot(window)
    assert not lit._card.shown
    lit.software = was
    window.viewport.redraw()
    return drawn


def inside(window, picture):
    """Pixels (H, W) of the surface, one away from its outline."""
    scene = window.viewport.scene
    scene.actor.SetVisibility(False)
    ground = shot(window)
    scene.actor.SetVisibility(True)
    found = (picture != ground).any(axis=2)
    for axis in (0, 1):
        found &= np.roll(found, 1, axis) & np.roll(found, -1, axis)
    assert found.sum() > 500
    return found


def close(window, *, mean=2.0):
    by_card = shot(window)
    wanted = by_processor(window)
    apart = np.abs(by_card - wanted)[inside(window, wanted)]
    assert apart.mean() < mean, apart.mean()
    return by_card


def test_at_rest_the_picture_is_the_processors(qtbot, lit):
    picture = close(lit)
    assert picture[inside(lit, picture)].std() > 20
    assert lit.light.readout.text().startswith("Full quality · shader on ")
    lit.document.set_lighting(exposure=1.0, curve="filmic", lamps=(Lamp(), Lamp((-1, 0, 0))))
    rested(qtbot, lit)
    assert np.abs(close(lit) - picture).max() > 30


def test_dragging_moves_the_light_by_uniforms_only(qtbot, lit):
    before, actor = shot(lit), lit.viewport.scene.actor
    table = actor.GetProperty().GetTexture("patinaTable")
    camera = lit.viewport.scene.camera
    drag(lit, [(0.5, 0.5), (0.6, 0.5), (0.8, 0.5)], CONTROL)
    rested(qtbot, lit)
    after = shot(lit)
    assert np.abs(after - before).max() > 40 and lit.viewport.scene.camera == camera
    drag(lit, [(0.5, 0.5), (0.6, 0.6)])
    rested(qtbot, lit)
    assert np.abs(shot(lit) - after).max() > 40 and lit.viewport.scene.camera != camera
    assert actor.GetProperty().GetTexture("patinaTable") is table
    close(lit)


def test_in_motion_the_nearest_texel_is_taken_and_no_error_told(qtbot, lit):
    lit.viewport.redraw()
    qtbot.waitUntil(lambda: not lit.viewport.lit._card._shader._smooth, timeout=LONG)
    rested(qtbot, lit)
    assert lit.viewport.lit._card._shader._smooth
    assert "Moving" not in lit.light.readout.text()


def test_modes_change_and_come_back(qtbot, lit):
    light = shot(lit)
    for mode in (Mode.COLOUR, Mode.CHARTS, Mode.LIT):
        lit.menus.modes[mode].trigger()
        idle(qtbot, lit)
        assert lit.viewport.lit._card.shown is (mode is Mode.LIT) or mode is Mode.LIT
        if mode is Mode.COLOUR:
            colour = shot(lit)
    rested(qtbot, lit)
    assert lit.viewport.lit._card.shown
    assert np.abs(shot(lit) - light).max() <= 2
    wide = min(len(colour), len(light))
    assert np.abs(colour[-wide:] - light[-wide:]).max() > 30


def test_another_mesh_and_its_light(qtbot, lit, files):
    lit.take([files / "ring.obj"])
    idle(qtbot, lit)
    assert lit.document.mode is Mode.COLOUR and lit.document.packed is None
    assert not lit.viewport.lit._card.shown and np.ptp(shot(lit)) > 30
    lit.synthesize()
    idle(qtbot, lit)
    lit.menus.modes[Mode.LIT].trigger()
    idle(qtbot, lit)
    rested(qtbot, lit)
    assert lit.viewport.lit._card.shown
    close(lit)


def test_an_environment_and_lamps_share_the_shaders_lights(qtbot, lit, tmp_path):
    sky = np.random.default_rng(0).uniform(0.1, 0.4, size=(16, 32, 3)).astype(np.float32)
    sky[2:4, 8:12] = 6.0
    (tmp_path / "sky.exr").write_bytes(encode_exr(sky))
    before = shot(lit)
    dark = before[inside(lit, before)].mean()
    with qtbot.waitSignal(lit.document.lighting_changed, timeout=LONG):
        lit.operations.open_environment(tmp_path / "sky.exr")
    rested(qtbot, lit)
    lights = lit.viewport.lit._card._lights
    assert len(lights) == glsl.MOST_LIGHTS and lights.sampled == glsl.MOST_LIGHTS - 1
    picture = close(lit)
    assert picture[inside(lit, picture)].mean() > dark + 20
    lit.document.set_lighting(environment=None, source="")  # or closing draws it once more


def test_cast_shadows_come_at_rest_and_go_with_the_light(qtbot, lit):
    lit.document.set_lighting(lamps=(Lamp((0.96, 0.28, 0.0)),))
    rested(qtbot, lit)
    bright = shot(lit)
    lit.document.set_lighting(shadows=True)
    rested(qtbot, lit)
    dark = close(lit)
    assert (dark < bright - 20).any(axis=2).sum() > 50, "the ring shades itself"
    rested(qtbot, lit)
    lit.viewport.redraw()
    qtbot.waitUntil(lambda: not lit.viewport.lit._card._shader._smooth, timeout=LONG)
    assert lit.viewport.lit._card._shader._shadowed, "the view moves, the light does not"
    lit.document.set_lighting(lamps=(Lamp((0.0, 0.28, 0.96)),))
    qtbot.waitUntil(lambda: not lit.viewport.lit._card._shader._shadowed, timeout=LONG)
    rested(qtbot, lit)
    assert lit.viewport.lit._card._shader._shadowed
    close(lit)


def test_a_program_that_does_not_compile_leaves_the_processor(
    qtbot, window, files, tmp_path, monkeypatch
):
    monkeypatch.setattr("app.shader._FRAGMENT", "  such is no program;\n{colour}")
    told = []
    window.viewport.lit.failed.connect(told.append)
    light_up(qtbot, window, files, tmp_path)
    assert len(told) == 1 and "shader failed" in told[0] and "syntax error" in told[0]
    assert len(told[0]) < 400
    assert window.errors.text.text() == told[0]
    assert not window.viewport.lit._card.shown and window.viewport.lit.active
    assert "processor: The shader failed" in window.light.readout.toolTip()
    assert window.document.lit.image.any() and np.ptp(shot(window)) > 30
    drag(window, [(0.5, 0.5), (0.7, 0.4)], CONTROL)
    rested(qtbot, window)
    assert len(told) == 1


def test_a_broken_program_is_noticed_in_a_picture_too(qtbot, lit, monkeypatch):
    wanted = by_processor(lit)
    monkeypatch.setattr("app.shader._FRAGMENT", "  such is no program;\n{colour}")
    lit.viewport.lit._card.remove()
    lit.viewport.redraw()
    drawn = shot(lit)  # the bar with the error makes the view a little smaller
    assert np.ptp(drawn[inside(lit, drawn)]) > 60 and lit.viewport.lit.software
    assert drawn.mean() == pytest.approx(wanted.mean(), abs=1)


def test_a_card_without_memory_leaves_the_processor(qtbot, window, files, tmp_path, monkeypatch):
    monkeypatch.setattr("app.lit.exhausted", lambda context: context is not None)
    light_up(qtbot, window, files, tmp_path)
    assert "memory is used up" in window.errors.text.text()
    assert not window.viewport.lit._card.shown and window.document.lit.image.any()


def test_what_does_not_fit_is_drawn_by_the_processor_and_says_why(
    qtbot, window, files, tmp_path, monkeypatch
):
    monkeypatch.setattr("btfcore.render.glsl.samples.MOST_FACTORS", 3)
    light_up(qtbot, window, files, tmp_path)
    assert isinstance(window.document.packed, str)
    assert not window.viewport.lit._card.shown and window.document.lit.image.any()
    assert "4 factors, a shader takes 3" in window.light.readout.toolTip()
    assert not window.errors.isVisible()


def test_lost_contexts_leave_the_picture(qtbot, lit):
    """Hidden, in another window, on the whole screen, and back."""
    before = shot(lit)
    lit.stack.setCurrentWidget(lit.welcome)
    QApplication.processEvents()
    lit.stack.setCurrentWidget(lit.viewport)
    rested(qtbot, lit)
    assert np.array_equal(shot(lit), before)
    size = lit.viewport.size()
    other = QMainWindow()
    qtbot.addWidget(other)
    other.setCentralWidget(lit.viewport)
    other.resize(size)
    lit.viewport.show()
    other.show()
    qtbot.waitExposed(other)
    rested(qtbot, lit)
    assert lit.viewport.lit._card.shown
    assert lit.viewport.size() != size or np.array_equal(shot(lit), before)
    assert np.ptp(shot(lit)) > 30
    lit.stack.addWidget(lit.viewport)
    lit.stack.setCurrentWidget(lit.viewport)
    other.hide()
    rested(qtbot, lit)
    assert np.array_equal(shot(lit), before)
    lit.showFullScreen()
    qtbot.wait(50)
    lit.showNormal()
    lit.resize(700, 480)
    rested(qtbot, lit)
    assert lit.viewport.lit._card.shown and not lit.errors.isVisible()
    close(lit)
