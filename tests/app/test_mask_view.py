"""How the mask editor shows a sample, and what wheel, pen and keys do to it."""

import numpy as np
import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QEvent, QPoint, QPointF, Qt  # noqa: E402
from PyQt6.QtGui import (  # noqa: E402
    QInputDevice,
    QPointingDevice,
    QPointingDeviceUniqueId,
    QTabletEvent,
    QWheelEvent,
)
from PyQt6.QtTest import QTest  # noqa: E402
from PyQt6.QtWidgets import (  # noqa: E402
    QAbstractButton,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QSlider,
)

from app.panels.mask_editor import MaskEditor  # noqa: E402
from btfcore.btf.appearance import frontal_colours  # noqa: E402
from btfcore.btf.mask_tools import brush  # noqa: E402
from btfcore.btf.stack import ArrayStack  # noqa: E402
from tests.app.masks import LEFT, LONG, NONE, at, drag, idle, pixels, spotted, texel  # noqa: E402
from tests.btf.bricks import images, sample  # noqa: E402


@pytest.fixture
def make(qtbot):
    """Make a shown editor that is idle."""
    made = []

    def open_(colour=None, mask=None, **details):
        editor = MaskEditor("spots", spotted() if colour is None else colour, mask, **details)
        made.append(editor)
        editor.resize(900, 640)
        editor.show()
        qtbot.waitExposed(editor)
        idle(qtbot, editor)
        return editor

    yield open_
    for editor in made:
        editor.done(0)
        editor.deleteLater()


def test_the_wheel_zooms_about_the_pointer_and_the_view_is_moved(qtbot, make):
    editor = make()
    view = editor.view
    place = QPointF(at(editor, 80, 30))
    below, before = view.texel_at(place), view.zoom
    for notches in (3, -1, 40, -100, 6):
        view.wheelEvent(
            QWheelEvent(
                place, place, QPoint(), QPoint(0, 120 * notches), Qt.MouseButton.NoButton, NONE,
                Qt.ScrollPhase.NoScrollPhase, False,
            )
        )  # fmt: skip
        now = view.texel_at(place)
        assert now.x() == pytest.approx(below.x(), abs=1e-6)
        assert now.y() == pytest.approx(below.y(), abs=1e-6)
        assert 0 < view.zoom <= 64
        view.grab()
    assert view.zoom != before
    for button, key in ((Qt.MouseButton.MiddleButton, None), (LEFT, Qt.Key.Key_Space)):
        start = view.texel_at(QPointF(100, 100))
        if key is not None:
            QTest.keyPress(view, key)
        QTest.mousePress(view, button, NONE, QPoint(100, 100))
        QTest.mouseMove(view, QPoint(160, 130))
        QTest.mouseRelease(view, button, NONE, QPoint(160, 130))
        if key is not None:
            QTest.keyRelease(view, key)
        moved = view.texel_at(QPointF(160, 130))
        assert (moved.x(), moved.y()) == pytest.approx((start.x(), start.y()), abs=1e-6)
    assert editor.drawn_mask().max() == 0
    QTest.keyClick(view, Qt.Key.Key_F)
    assert view.zoom == pytest.approx(before)


def test_texels_are_sharp_and_the_mask_lies_over_them(qtbot, make):
    colour = np.zeros((40, 50, 3), "f4")
    colour[::2, ::2] = colour[1::2, 1::2] = 1
    editor = make(colour)
    view = editor.view
    view.zoom_by(1.7)
    shown = pixels(view)
    ratio = shown.shape[1] / view.width()
    for column, row in ((10, 10), (11, 10), (20, 21)):
        spread = 0.4 * view.zoom
        corner = view.place_of(column, row)
        for dx, dy in ((-1, -1), (1, -1), (0, 0), (1, 1)):
            x, y = (int((c + d * spread) * ratio) for c, d in ((corner.x(), dx), (corner.y(), dy)))
            assert (shown[y, x] == 255 * colour[row, column].astype(int)).all()
    drag(editor, [(25, 20)])
    view.leaveEvent(QEvent(QEvent.Type.Leave))
    shown = pixels(view)
    corner = view.place_of(25, 20)
    red, green, blue = shown[int(corner.y() * ratio), int(corner.x() * ratio)]
    assert red > green + 50 and red > blue + 50
    view.set_opacity(0)
    assert np.ptp(pixels(view), axis=2)[int(corner.y() * ratio), int(corner.x() * ratio)] == 0


def test_a_line_of_one_texel_is_seen_however_small(qtbot, make):
    mask = np.zeros((1200, 1400), "f4")
    mask[601] = 1
    editor = make(np.full((1200, 1400, 3), 0.5, "f4"), mask)
    view = editor.view
    assert view.zoom < 0.5
    y = int(view.place_of(0, 601).y())
    shown = pixels(view)[y - 3 : y + 4, view.width() // 2]
    assert (shown[:, 0] - shown[:, 1]).max() > 40
    drag(editor, [(300, 300)])  # the reduced mask follows a stroke
    view.leaveEvent(QEvent(QEvent.Type.Leave))
    place = at(editor, 300, 300)
    red, green, _ = pixels(view)[place.y(), place.x()]
    assert red > green + 40


def pen(view, kind, place, pressure, device):
    down = LEFT if kind != QEvent.Type.TabletRelease else Qt.MouseButton.NoButton
    button = LEFT if kind != QEvent.Type.TabletMove else Qt.MouseButton.NoButton
    where = QPointF(place)
    QApplication.sendEvent(
        view,
        QTabletEvent(
            kind, device, where, QPointF(view.mapToGlobal(place)), pressure, 0, 0, 0, 0, 0, NONE,
            button, down,
        ),
    )  # fmt: skip


@pytest.mark.parametrize("eraser", [False, True])
def test_a_pens_pressure_is_the_brushes_size_and_its_other_end_removes(qtbot, make, eraser):
    start = np.full((90, 120), float(eraser), "f4")
    curve = (lambda pressure: pressure**2) if eraser else None
    editor = make(mask=start, curve=curve)
    kinds = QPointingDevice.PointerType
    device = QPointingDevice(
        "pen", 7, QInputDevice.DeviceType.Stylus, kinds.Eraser if eraser else kinds.Pen,
        QInputDevice.Capability.Position | QInputDevice.Capability.Pressure, 1, 1, "",
        QPointingDeviceUniqueId(),
    )  # fmt: skip
    places = [(20, 40), (60, 40), (100, 40)]
    pressures = (0.2, 0.6, 1.0)
    types = (QEvent.Type.TabletPress, QEvent.Type.TabletMove, QEvent.Type.TabletMove)
    for kind, place, pressure in zip(types, places, pressures, strict=True):
        pen(editor.view, kind, at(editor, *place), pressure, device)
        QTest.mouseMove(editor.view, at(editor, *place))  # its double
    pen(editor.view, QEvent.Type.TabletRelease, at(editor, *places[-1]), 0.0, device)
    factors = [curve(each) if curve else each for each in pressures]
    path = [[*texel(editor, *p), f] for p, f in zip(places, factors, strict=True)]
    wanted = brush(start, path, remove=eraser)
    assert np.allclose(editor.drawn_mask(), wanted, atol=1e-5)
    assert editor.model.history.undo_label == "Stroke"


def test_keys_change_the_brush(qtbot, make):
    editor = make()
    before = editor.model.settings.radius
    QTest.keyClick(editor.view, Qt.Key.Key_BracketRight)
    assert editor.model.settings.radius > before
    assert editor.options.spin("radius").value() == pytest.approx(
        editor.model.settings.radius, abs=0.06
    )
    for _ in range(60):
        QTest.keyClick(editor.view, Qt.Key.Key_BracketLeft)
    assert editor.model.settings.radius == 0.5
    QTest.keyClick(editor.view, "{")
    assert editor.model.settings.hardness == pytest.approx(0.7)


def test_typing_a_number_is_no_shortcut_and_enter_accepts_nothing(qtbot, make):
    editor = make()
    drag(editor, [(60, 40)])
    zoom = editor.view.zoom
    field = editor.options.spin("radius")
    field.setFocus()
    field.selectAll()
    for key in "11":
        QTest.keyClick(field, key)
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert editor.model.settings.radius == 11 and editor.view.zoom == zoom
    assert editor.isVisible()


def test_a_tile_is_drawn_over_its_border(qtbot, make):
    editor = make(tiles=True)
    drag(editor, [(1, 45)])
    drawn = editor.drawn_mask()
    assert drawn[45, 118] > 0.5 and drawn[45, 5] > 0.5
    QTest.keyClick(editor.view, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    editor.view.zoom_by(0.5)
    drag(editor, [(-20, 45)])  # on the neighbour that is shown beside it
    assert editor.drawn_mask()[45, 100] == 1


def test_another_light_is_another_picture_and_floods_use_it(qtbot, make):
    btf = sample(stack=ArrayStack(images(5, 12, 40, 50), sound=True))
    editor = make(frontal_colours(btf), btf=btf)
    before, shown = editor.model.colour, pixels(editor.view)
    with qtbot.waitSignal(editor.model.picture_changed, timeout=LONG):
        for value in (10, 60, 200):
            editor.options.azimuth.setValue(value)
    qtbot.waitUntil(lambda: not editor.model.lamp.busy, timeout=LONG)
    from btfcore.btf.colour import linear_to_srgb
    from btfcore.btf.directions import from_angles
    from btfcore.btf.interpolation.radiance import picture

    polar = np.radians(90 - editor.options.elevation.value())
    light = from_angles(np.array([polar]), np.radians([200.0]))[0]
    wanted = linear_to_srgb(picture(btf, [0, 0, 1], light))
    assert np.allclose(editor.model.colour, wanted, atol=1e-6)
    assert not np.allclose(before, wanted)
    from app.panels.mask_work import brightened

    dark = np.full((4, 4, 3), 0.05, "f4")
    assert brightened(dark).mean() == pytest.approx(0.18)
    assert np.array_equal(brightened(dark * 10), dark * 10), "what is bright enough stays"
    assert brightened(dark / 100).max() == pytest.approx(0.004), "noise is not blown up"
    assert np.abs(pixels(editor.view) - shown).max() > 40


def test_every_control_is_named_and_explained(qtbot, make):
    btf = sample(stack=ArrayStack(images(5, 12, 40, 50), sound=True))
    editor = make(frontal_colours(btf), btf=btf)
    for kind in (QAbstractButton, QAbstractSpinBox, QComboBox, QSlider):
        for each in editor.findChildren(kind):
            if each.window() is editor and each.isVisible():
                assert each.accessibleName() or each.text(), each
                assert each.toolTip(), (each, each.accessibleName())
    assert editor.view.accessibleName()
