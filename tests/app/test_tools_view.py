"""Stamp, light, pick, measure, orient and the camera, driven by real events."""

import numpy as np
import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QEvent, Qt  # noqa: E402
from PyQt6.QtGui import QKeyEvent  # noqa: E402
from PyQt6.QtTest import QTest  # noqa: E402
from PyQt6.QtWidgets import QApplication  # noqa: E402

from app.document import Mode  # noqa: E402
from app.tools.marks import Arrows, Dots, Ring  # noqa: E402
from tests.app.test_pointer import (  # noqa: E402
    ALT,
    LEFT,
    PLAIN,
    RIGHT,
    down,
    move,
    up,
)

CTRL, SHIFT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier


# --- stamp


def test_a_stamp_is_previewed_turned_scaled_and_merged_where_one_clicks(studio):
    document = studio.document
    studio.take("stamp", sample=studio.files["spotted"])
    middle = studio.middle()
    move(studio.view, *middle)
    studio.idle()
    assert document.preview and (document.preview[0].alpha > 0.5).any()
    first = document.preview[0]
    camera = studio.viewport.scene.camera
    studio.wheel(middle, 2)
    studio.wheel(middle, -1, CTRL)
    assert document.options.turn == 30.0 and document.options.scale == pytest.approx(1 / 1.1)
    assert studio.viewport.scene.camera == camera and "30°" in studio.text()
    studio.idle()
    assert not np.array_equal(document.preview[0].source, first.source)
    studio.wheel(middle, 1, ALT)
    assert studio.viewport.scene.camera != camera, "with Alt the wheel is the camera's"
    down(studio.view, *middle)
    move(studio.view, middle[0] + 6, middle[1], LEFT)
    up(studio.view, middle[0] + 6, middle[1])
    place = studio.place((middle[0] + 6, middle[1]))[0]
    studio.idle()
    (layer,) = studio.layers
    assert layer.kind == "stamp" and np.allclose(layer.edit.point, place)
    assert (layer.edit.rotation, layer.edit.scale) == (30.0, pytest.approx(1 / 1.1))
    move(studio.view, 3, 3)
    studio.idle()
    assert document.preview == () and not studio.bench.overlay.marks


def test_escape_within_a_click_stamps_nothing(studio):
    studio.take("stamp", sample=studio.files["spotted"])
    down(studio.view, *studio.middle())
    QTest.keyClick(studio.view, Qt.Key.Key_Escape)
    up(studio.view, *studio.middle())
    studio.idle()
    assert studio.layers == () and studio.document.preview == ()


# --- setting the brush


def test_keys_change_size_and_hardness_and_the_ring_follows(studio):
    studio.take("paint")
    move(studio.view, *studio.middle())
    radius = studio.document.radius
    QTest.keyClick(studio.view, Qt.Key.Key_BracketRight)
    (ring,) = studio.marks(Ring)
    assert ring.radius == studio.document.radius == pytest.approx(1.15 * radius)
    QTest.keyClick(studio.view, Qt.Key.Key_BracketLeft)
    assert studio.document.radius == pytest.approx(radius)
    studio.bench.verbs()["brush.softer"]()
    (ring,) = studio.marks(Ring)
    assert ring.hardness == studio.document.options.hardness == pytest.approx(0.9)


@pytest.mark.parametrize("end", ["click", "escape", "right"])
def test_moving_the_pointer_sets_the_size_in_the_blender_preset(studio, end):
    studio.keymap.set_preset("blender")
    try:
        studio.take("paint")
        x, y = studio.middle()
        move(studio.view, x, y)
        radius = studio.document.radius
        QTest.keyClick(studio.view, Qt.Key.Key_F)
        move(studio.view, x + 25, y)
        (ring,) = studio.marks(Ring)
        wide = studio.document.radius
        assert ring.radius == wide > radius and np.allclose(ring.point, studio.place((x, y))[0])
        edge = studio.bench.picker.pixels(studio.bench.view(), ring.circle())[:, 0]
        move(studio.view, x + 26, y)
        if end == "click":
            down(studio.view, x + 26, y)
            up(studio.view, x + 26, y)
            assert studio.document.radius > wide
        elif end == "escape":
            QTest.keyClick(studio.view, Qt.Key.Key_Escape)
            assert studio.document.radius == radius
        else:
            down(studio.view, x + 26, y, RIGHT)
            up(studio.view, x + 26, y, RIGHT)
            assert studio.document.radius == radius
        assert edge.max() > x + 20, "the ring's edge follows the pointer"
        assert studio.bench.pointer.tool is studio.bench.tools["paint"] and studio.layers == ()
    finally:
        studio.keymap.set_preset("patina")


# --- the other tools


def test_the_light_tool_shows_light_and_moves_the_lamp_alone(studio):
    document = studio.document
    if not document.offers(Mode.LIT):
        pytest.skip("this sample cannot be lit")
    studio.take("light")
    camera, lamp = studio.viewport.scene.camera, document.lighting.lamps[0].direction
    x, y = studio.middle()
    down(studio.view, x, y)
    assert document.mode is Mode.LIT
    move(studio.view, x + 60, y, LEFT)
    up(studio.view, x + 60, y)
    assert document.lighting.lamps[0].direction != lamp
    assert studio.viewport.scene.camera == camera
    moved = document.lighting.lamps[0].direction
    down(studio.view, x, y)
    QTest.keyClick(studio.view, Qt.Key.Key_Escape)
    assert document.lighting.lamps[0].direction == moved
    up(studio.view, x, y)
    studio.idle()


def test_under_light_a_brush_paints_and_with_control_the_lamp_moves(studio):
    document = studio.document
    document.set_mode(Mode.LIT)
    studio.viewport.set_light_drag(True)
    studio.take("erase")
    x, y = studio.middle()
    lamp = document.lighting
    studio.line((x, y), (x + 15, y))
    assert document.lighting is lamp and len(studio.layers) == 1
    down(studio.view, x, y, keys=CTRL)
    move(studio.view, x + 50, y, LEFT)
    up(studio.view, x + 50, y)
    assert document.lighting is not lamp and len(studio.layers) == 1
    studio.viewport.set_light_drag(False)
    studio.idle()


def test_while_a_synthesis_runs_a_brush_says_so_once(studio):
    studio.take("erase")
    notes = []
    studio.operations.noted.connect(notes.append)
    x, y = studio.middle()
    studio.operations.synthesize()
    studio.line((x, y), (5, y), (x, y))
    assert len(notes) == 1 and "running" in notes[0]
    studio.operations.cancel()
    studio.idle()
    assert studio.layers == () and not studio.edits.busy


def test_picking_takes_the_sample_under_the_pointer(studio):
    x, y = studio.middle()
    studio.take("stamp", sample=studio.files["spotted"])
    down(studio.view, x, y)
    up(studio.view, x, y)
    studio.idle()
    studio.take("pick")
    dense, quilt = studio.document.canvas.prepared.dense, studio.document.decoration.quilt
    where = np.flatnonzero(quilt.sample == 1)
    seen = studio.bench.picker.visible(studio.bench.view(), dense.vertices[where])
    inner = dense.vertices[where[seen]].mean(axis=0)
    pixel = studio.bench.picker.pixels(studio.bench.view(), inner[None])[0, :2]
    move(studio.view, *pixel)
    assert studio.text() == "spotted"
    down(studio.view, *pixel)
    up(studio.view, *pixel)
    assert studio.document.options.sample == "spotted" and "spotted" in studio.told[-1]
    quilt = studio.document.decoration.quilt
    away = np.linalg.norm(dense.vertices - inner, axis=1)
    seen = studio.bench.picker.visible(studio.bench.view(), dense.vertices)
    far = np.where(seen & (quilt.sample == 0), away, 0).argmax()
    pixel = studio.bench.picker.pixels(studio.bench.view(), dense.vertices[far][None])[0, :2]
    move(studio.view, *pixel)
    assert studio.text() == "background"


def test_measuring_gives_both_lengths_in_the_users_units(studio):
    studio.settings.change(unit="cm", metres_per_unit=1.0)
    studio.take("measure")
    x, y = studio.middle()
    studio.line((x - 40, y), (x + 40, y))
    studio.idle()
    one, two = studio.place((x - 40, y))[0], studio.place((x + 40, y))[0]
    text = studio.text()
    assert f"{100 * np.linalg.norm(one - two):.4g} cm straight" in text
    assert "over the surface" in text


def test_drawn_directions_guide_the_field_and_the_next_synthesis(studio):
    document = studio.document
    studio.take("orient")
    studio.idle()
    move(studio.view, *studio.middle())
    assert studio.marks(Arrows) and len(studio.marks(Arrows)[0].tails) > 40
    assert len(studio.marks(Dots)[0].points) == len(document.canvas.prepared.field.singularities)
    x, y = studio.middle()
    studio.line((x, y - 40), (x, y + 40))
    guide = document.guide
    assert guide is not None and len(guide.positions) >= 2
    studio.idle()
    before = document.canvas
    shown = studio.marks(Arrows)[0]
    near = np.linalg.norm(shown.tails - guide.positions.mean(axis=0), axis=1).argmin()
    arrow = shown.heads[near] - shown.tails[near]
    wanted = guide.directions.mean(axis=0)
    cosine = arrow @ wanted / np.linalg.norm(arrow) / np.linalg.norm(wanted)
    assert cosine > 0.9 and document.canvas is before, "only shown so far"
    count = len(guide.positions)
    pixel = studio.bench.picker.pixels(studio.bench.view(), guide.positions[:1])[0, :2]
    down(studio.view, *pixel)
    up(studio.view, *pixel)
    assert len(document.guide.positions) == count - 1
    QTest.keyClick(studio.view, Qt.Key.Key_Backspace)
    assert document.guide is guide
    QTest.keyClick(studio.view, Qt.Key.Key_Z, CTRL)
    assert document.guide is None and studio.bench.redo() and document.guide is guide
    asked = []
    studio.bench.synthesize_wanted.connect(lambda: asked.append(True))
    QTest.keyClick(studio.view, Qt.Key.Key_Return)
    assert asked
    studio.operations.synthesize()
    studio.idle()
    try:
        assert document.canvas.guide is guide
        dense, field = document.canvas.prepared.dense, document.canvas.prepared.field
        away = np.linalg.norm(dense.vertices[:, None] - guide.positions, axis=2)
        at = away.argmin(axis=0)
        cosines = np.einsum("ij,ij->i", field.tangents[at], guide.directions)
        assert cosines.min() > 0.8
    finally:
        studio.edits.undo_to(1)
        studio.idle()
    assert document.canvas is before


# --- the camera


def test_a_tool_leaves_the_camera_its_drags_and_the_wheel(studio):
    studio.take("paint")
    steering, camera = studio.viewport.steering, studio.viewport.scene.camera
    x, y = studio.middle()
    down(studio.view, x, y, keys=ALT)
    move(studio.view, x + 30, y, LEFT)
    up(studio.view, x + 30, y)
    turned = studio.viewport.scene.camera
    assert turned.azimuth != camera.azimuth
    QTest.keyPress(studio.view, Qt.Key.Key_Space)
    down(studio.view, x, y)
    move(studio.view, x + 30, y, LEFT)
    up(studio.view, x + 30, y)
    QTest.keyRelease(studio.view, Qt.Key.Key_Space)
    assert studio.viewport.scene.camera.focus != turned.focus and not steering.held
    distance = studio.viewport.scene.camera.distance
    studio.wheel((x, y), 1)
    assert studio.viewport.scene.camera.distance < distance
    down(studio.view, x, y, keys=ALT)
    before = studio.viewport.scene.camera
    move(studio.view, x + 50, y, LEFT)
    QTest.keyClick(studio.view, Qt.Key.Key_Escape)
    assert studio.viewport.scene.camera == before, "Escape takes an orbit back"
    up(studio.view, x + 50, y)
    assert studio.layers == () and not studio.edits.busy


def test_navigation_follows_the_preset(studio):
    studio.take("view")
    x, y = studio.middle()
    studio.settings.change(navigation="maya")
    camera = studio.viewport.scene.camera
    studio.line((x, y), (x + 30, y))
    assert studio.viewport.scene.camera == camera
    studio.settings.change(navigation="patina")
    studio.line((x, y), (x + 30, y))
    assert studio.viewport.scene.camera != camera


def test_orbiting_round_the_last_stroke_keeps_it_in_place(studio):
    studio.take("erase")
    x, y = studio.middle()
    studio.line((x, y), (x + 10, y))
    studio.bench.pivot_stroke()
    place = studio.bench.last
    before = studio.bench.picker.pixels(studio.bench.view(), place[None])[0, :2]
    down(studio.view, x, y, keys=ALT)
    move(studio.view, x + 25, y + 10, LEFT)
    up(studio.view, x + 25, y + 10)
    after = studio.bench.picker.pixels(studio.bench.view(), place[None])[0, :2]
    assert np.abs(before - after).max() < 3.0
    studio.bench.pivot_stroke()
    assert studio.viewport.steering.pivot is None
    studio.idle()


def test_keys_of_the_pointer_do_nothing_without_a_tool(studio):
    QApplication.sendEvent(studio.view, QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_Return, PLAIN))
    studio.line(studio.middle(), (5, 5))
    assert studio.layers == () and not studio.bench.overlay.marks
