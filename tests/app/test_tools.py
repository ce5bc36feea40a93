"""Brushes on a real small painting, driven by real mouse, pen and key events."""

import numpy as np
import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QEvent, Qt  # noqa: E402
from PyQt6.QtGui import QPointingDevice  # noqa: E402
from PyQt6.QtTest import QTest  # noqa: E402
from PyQt6.QtWidgets import QApplication  # noqa: E402

from app.pressure import SOFT  # noqa: E402
from app.tools.marks import Dots, Ring  # noqa: E402
from app.tools.pointer import ECHO_S  # noqa: E402
from tests.app.test_pointer import (  # noqa: E402
    LEFT,
    NONE,
    down,
    move,
    pen_down,
    pen_move,
    pen_up,
    stylus,
    up,
)
from tests.paint.scenes import MESHES  # noqa: E402

CTRL, SHIFT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier


# --- before there is anything to work on


def test_a_brush_says_what_it_lacks(shared):
    if shared.document.painting is not None:
        pytest.skip("the painting is there already; this test runs first")
    shared.take("paint")
    down(shared.view, *shared.middle())
    up(shared.view, *shared.middle())
    assert shared.told == ["Open a mesh first."]
    shared.operations.open_mesh(MESHES / "spot.obj")
    shared.idle()
    shared.viewport.look(azimuth=75.0, elevation=15.0)
    for tool in ("paint", "erase", "stamp", "pick", "repair"):
        shared.told.clear()
        shared.take(tool)
        move(shared.view, *shared.middle())
        assert "Synthesise first" in shared.text()
        down(shared.view, *shared.middle())
        move(shared.view, 5, 5, LEFT)
        up(shared.view, *shared.middle())
        assert len(shared.told) == 1 and "Synthesise first" in shared.told[0]
    shared.take("light")
    down(shared.view, *shared.middle())
    up(shared.view, *shared.middle())
    assert "light" in shared.told[-1]
    assert shared.layers == () and not shared.edits.busy
    shared.told.clear()
    shared.take("view")


def test_a_sample_without_a_feature_is_named_before_the_stroke(studio):
    studio.take("paint", sample=studio.files["plain"])
    move(studio.view, *studio.middle())
    assert "no feature" in studio.text()
    studio.line(studio.middle(), (studio.middle()[0] + 30, studio.middle()[1]))
    assert "no feature" in studio.told[0] and studio.layers == ()
    studio.take("erase")
    move(studio.view, *studio.middle())
    assert studio.text() == "", "erasing needs none"


# --- strokes


def test_a_stroke_paints_where_the_pointer_went_and_undo_by_key_takes_it_back(studio):
    studio.take("paint")
    x, y = studio.middle()
    way = [(x - 40, y), (x + 40, y)]
    studio.line(*way)
    assert studio.layers[-1].busy
    studio.idle()
    (layer,) = studio.layers
    assert layer.kind == "paint" and len(layer.vertices) and not studio.told
    (drawn,) = layer.edit.area.strokes
    assert drawn.radius == studio.document.radius and (drawn.pressure == 1).all()
    for pixel, end in zip(way, (drawn.points[0], drawn.points[-1]), strict=True):
        assert np.linalg.norm(studio.place(pixel)[0] - end) < 1e-9
    gaps = np.linalg.norm(np.diff(drawn.points, axis=0), axis=1)
    assert gaps.max() <= drawn.radius / 4 + 1e-9
    pending_free = studio.document.pending is None
    away = np.linalg.norm(studio.changed()[:, None] - drawn.points, axis=2).min(axis=1)
    patch = 24 * studio.document.painting.document.engine.step
    assert pending_free and away.max() < drawn.radius + 2 * patch and away.min() < drawn.radius
    QTest.keyClick(studio.view, Qt.Key.Key_Z, CTRL)
    studio.idle()
    assert studio.layers == ()


def test_one_fast_move_leaves_no_gap_and_covers_what_slow_ones_do(studio):
    studio.take("paint")
    x, y = studio.middle()
    strokes = []
    for steps in (1, 40):
        studio.line((x - 45, y - 10), (x + 45, y + 10), steps=steps)
        studio.idle()
        strokes.append(studio.layers[-1].edit.area.strokes[0])
        studio.edits.undo()
        studio.idle()
    for stroke in strokes:
        gaps = np.linalg.norm(np.diff(stroke.points, axis=0), axis=1)
        assert len(stroke.points) > 8 and gaps.max() <= stroke.radius / 4 + 1e-9
    fast, slow = (each.points for each in strokes)
    apart = np.linalg.norm(fast[:, None] - slow, axis=2).min(axis=1)
    assert apart.max() < strokes[0].radius / 4


def test_off_the_mesh_and_back_is_one_edit_of_two_strokes(studio):
    studio.take("paint")
    row = next(
        row
        for row in range(studio.view.height() - 4, 0, -2)  # between the legs
        if len(_parts(studio, row)) >= 2
    )
    first, second, *_ = _parts(studio, row)
    studio.line((first[0] + 1, row), (second[1] - 1, row), steps=5)
    studio.idle()
    (layer,) = studio.layers
    one, two = layer.edit.area.strokes
    for stroke in (one, two):
        gaps = np.linalg.norm(np.diff(stroke.points, axis=0), axis=1)
        assert gaps.max(initial=0) <= stroke.radius / 4 + 1e-9
    assert np.linalg.norm(one.points[-1] - two.points[0]) > one.radius / 4
    assert studio.document.history[1:] == (f"add {layer.name}",)
    studio.take("erase")
    studio.line((first[0] + 1, row), (second[1] - 1, row), steps=5)
    studio.idle()
    assert len(studio.layers[-1].edit.area.strokes) == 2, "an area of two strokes"
    studio.take("erase")
    studio.line((2, 2), (30, 2))
    assert len(studio.layers) == 2, "beside the mesh there is no edit"


def _parts(studio, row):
    """Stretches (first, last column) of the surface along a row of pixels."""
    columns = np.arange(0, studio.view.width(), 1.0) + 0.5
    places = np.stack([columns, np.full(len(columns), float(row))], axis=1)
    on = studio.bench.picker.pick(studio.bench.view(), places).on
    edge = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    found = [(columns[a], columns[b - 1]) for a, b in edge.reshape(-1, 2)]
    return [each for each in found if each[1] - each[0] > 12]


def test_a_stroke_that_leaves_the_window_goes_on_when_it_comes_back(studio):
    studio.take("paint")
    x, y = studio.middle()
    down(studio.view, x, y)
    move(studio.view, x + 20, y, LEFT)
    move(studio.view, x, -80, LEFT)
    QApplication.sendEvent(studio.view, QEvent(QEvent.Type.Leave))
    move(studio.view, x - 20, y + 5, LEFT)
    up(studio.view, x - 30, y + 5)
    studio.idle()
    (layer,) = studio.layers
    ends = layer.edit.area.strokes[-1].points[-1]
    assert np.linalg.norm(ends - studio.place((x - 30, y + 5))[0]) < 1e-9


@pytest.mark.parametrize("way", ["escape", "focus", "tool"])
def test_an_interrupted_stroke_leaves_no_trace(studio, way):
    before = studio.document.decoration.quilt
    studio.take("paint")
    x, y = studio.middle()
    down(studio.view, x, y)
    move(studio.view, x + 40, y, LEFT)
    QTest.qWait(60)  # some of it is painted
    if way == "escape":
        QTest.keyClick(studio.view, Qt.Key.Key_Escape)
    elif way == "focus":
        QApplication.sendEvent(studio.view, QEvent(QEvent.Type.WindowDeactivate))
    else:
        studio.take("erase")
    move(studio.view, x + 60, y, LEFT)
    up(studio.view, x + 60, y)
    studio.idle()
    after = studio.document.decoration.quilt
    assert studio.layers == () and studio.document.pending is None
    assert np.array_equal(before.source, after.source) and not studio.told


def test_a_pen_paints_with_pressure_and_the_mouse_beside_it_does_nothing(studio):
    studio.take("paint")
    pen, (x, y) = stylus(), studio.middle()
    pen_down(studio.view, pen, x - 30, y, 0.3)
    down(studio.view, x - 30, y)  # what the system makes of the pen
    for step in range(1, 7):
        pen_move(studio.view, pen, x - 30 + 10 * step, y, 0.3 + 0.1 * step)
        move(studio.view, x - 30 + 10 * step, y, LEFT)
    move(studio.view, 5, 5)  # somebody pushes the mouse
    pen_up(studio.view, pen, x + 30, y)
    up(studio.view, x + 30, y)
    QTest.qWait(round(1100 * ECHO_S))
    studio.idle()
    (layer,) = studio.layers
    (stroke,) = layer.edit.area.strokes
    assert stroke.pressure[0] == pytest.approx(0.3) and stroke.pressure[-1] == pytest.approx(0.9)
    assert (np.diff(stroke.pressure) >= -1e-9).all()
    assert np.linalg.norm(stroke.points[-1] - studio.place((x + 30, y))[0]) < 1e-9


def test_the_users_curve_is_between_the_pen_and_the_brush(studio):
    studio.settings.change(pressure=SOFT)
    studio.take("erase")
    pen, (x, y) = stylus(), studio.middle()
    pen_move(studio.view, pen, x, y, 0.0, NONE)
    assert studio.marks(Ring)[0].radius == studio.document.radius, "hovering shows all of it"
    pen_down(studio.view, pen, x, y, 0.25)
    assert studio.marks(Ring)[0].radius == pytest.approx(0.5 * studio.document.radius)
    pen_up(studio.view, pen, x, y)
    QTest.qWait(round(1100 * ECHO_S))
    studio.idle()
    assert studio.layers[-1].edit.area.strokes[0].pressure.tolist() == pytest.approx([0.5])


def test_the_other_end_of_the_pen_erases(studio):
    studio.take("paint")
    end, (x, y) = stylus(QPointingDevice.PointerType.Eraser), studio.middle()
    pen_down(studio.view, end, x, y)
    pen_move(studio.view, end, x + 20, y)
    pen_up(studio.view, end, x + 20, y)
    QTest.qWait(round(1100 * ECHO_S))  # until a mouse's events are its own again
    studio.idle()
    assert [each.kind for each in studio.layers] == ["erase"]


def test_erase_takes_the_feature_away_that_was_painted(studio):
    x, y = studio.middle()
    way = [(x - 40, y), (x + 40, y)]
    studio.take("paint")
    studio.line(*way)
    studio.take("erase", radius=2 * studio.document.radius)
    studio.line(*way)  # without waiting for the first
    studio.idle()
    assert not studio.told
    paint, erase = studio.layers
    assert (paint.kind, erase.kind) == ("paint", "erase")
    engine = studio.document.painting.document.engine
    left = engine.palette.feature_at(
        engine.state.sample[paint.vertices], engine.state.source[paint.vertices]
    )
    assert (left > 0.5).sum() < 0.1 * paint.figures["area"]


@pytest.mark.parametrize("tool", ["repair", "requilt"])
def test_brushes_that_mend_make_edits_of_their_kind(studio, tool):
    x, y = studio.middle()
    studio.take(tool, tries=2)
    studio.line((x, y), (x + 25, y))
    studio.idle()
    assert [each.kind for each in studio.layers] == [tool] and not studio.told


def test_symmetry_shows_images_of_the_ring_and_paints_them(studio):
    QTest.keyClick(studio.view, Qt.Key.Key_B)
    assert studio.document.tool == "paint"
    QTest.keyClick(studio.view, Qt.Key.Key_X, SHIFT)
    assert studio.document.options.mirror == "x"
    move(studio.view, *studio.middle())
    rings = studio.marks(Ring)
    assert len(rings) == 2
    mesh = studio.document.opened.mesh.vertices
    middle = (mesh.max(axis=0) + mesh.min(axis=0)) / 2
    one, two = (each.point - middle for each in rings)
    assert one[0] == pytest.approx(-two[0]) and one[1:] == pytest.approx(two[1:])
    x, y = studio.middle()
    studio.line((x, y), (x + 20, y))
    studio.idle()
    sides = studio.changed()[:, 0] - middle[0]
    assert (sides > 0).any() and (sides < 0).any()


def test_what_is_protected_is_marked_and_spared(studio):
    x, y = studio.middle()
    studio.take("protect")
    studio.line((x - 40, y), (x + 40, y))
    studio.idle()
    kept = studio.document.protected
    assert kept is not None and studio.layers == () and studio.marks(Dots)
    quilt = studio.document.decoration.quilt
    studio.take("erase", radius=2 * studio.document.radius)
    studio.line((x - 40, y), (x + 40, y))
    studio.idle()
    after = studio.document.decoration.quilt
    assert np.array_equal(quilt.source[kept], after.source[kept])
    studio.take("protect")
    QTest.keyClick(studio.view, Qt.Key.Key_X)
    assert studio.document.options.erase_protection
    studio.line((x - 50, y), (x + 50, y))
    studio.idle()
    assert studio.document.protected is None and not studio.marks(Dots)
