"""Real mouse, pen, wheel and key events reach the tool that they are for, once."""

import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QEvent, QPoint, QPointF, Qt  # noqa: E402
from PyQt6.QtGui import (  # noqa: E402
    QFocusEvent,
    QInputDevice,
    QKeyEvent,
    QMouseEvent,
    QPointingDevice,
    QTabletEvent,
    QWheelEvent,
)
from PyQt6.QtWidgets import QApplication, QWidget  # noqa: E402

from app.pressure import SOFT  # noqa: E402
from app.tools.base import Kind, Tool  # noqa: E402
from app.tools.pointer import Pointer  # noqa: E402

LEFT, RIGHT = Qt.MouseButton.LeftButton, Qt.MouseButton.RightButton
MIDDLE, NONE = Qt.MouseButton.MiddleButton, Qt.MouseButton.NoButton
POINTING = (
    QEvent.Type.MouseButtonPress, QEvent.Type.MouseMove, QEvent.Type.MouseButtonRelease,
    QEvent.Type.Wheel,
)  # fmt: skip
PLAIN, ALT = Qt.KeyboardModifier.NoModifier, Qt.KeyboardModifier.AltModifier


class Diary(Tool):
    """Writes down what it is told."""

    def __init__(self):
        super().__init__(stage=None)
        self.said, self.events, self.fails = [], [], ""

    def _note(self, what, event=None):
        self.said.append(what)
        self.events.append(event)
        if what == self.fails:
            raise RuntimeError(what)

    def press(self, event):
        self._note("press", event)

    def drag(self, event):
        self._note("drag", event)

    def release(self, event):
        self._note("release", event)

    def cancel(self):
        self._note("cancel")

    def hover(self, event):
        self._note("hover", event)

    def leave(self):
        self._note("leave")

    def put_away(self):
        self._note("put away")

    def wheel(self, event, notches):
        self._note("wheel", notches)
        return True

    def key(self, stroke):
        self._note("key", stroke)
        return stroke.key == Qt.Key.Key_X


class Surface(QWidget):
    """A view that offers its events to a pointer and notes what is left over."""

    def __init__(self, claim=None):
        super().__init__()
        self.now, self.left, self.pointer = 0.0, [], None
        self.resize(200, 100)
        self.setMouseTracking(True)
        self.pointer = Pointer(claim, clock=lambda: self.now, parent=self)
        self.tool = Diary()
        self.pointer.set_tool(self.tool)
        self.left.clear()

    def event(self, event):
        if self.pointer is not None and self.pointer.handle(event):
            return True
        if event.type() in POINTING:
            self.left.append(event.type())
        return super().event(event)


@pytest.fixture
def view(qtbot):
    surface = Surface()
    qtbot.addWidget(surface)
    return surface


def mouse(view, kind, x, y, button=NONE, held=NONE, keys=PLAIN, device=None):
    place = QPointF(x, y)
    more = [] if device is None else [device]
    event = QMouseEvent(kind, place, view.mapToGlobal(place), button, held, keys, *more)
    QApplication.sendEvent(view, event)
    return event


def down(view, x, y, button=LEFT, held=None, keys=PLAIN):
    held = button if held is None else held
    return mouse(view, QEvent.Type.MouseButtonPress, x, y, button, held, keys)


def move(view, x, y, held=NONE):
    return mouse(view, QEvent.Type.MouseMove, x, y, NONE, held)


def up(view, x, y, button=LEFT, held=NONE):
    return mouse(view, QEvent.Type.MouseButtonRelease, x, y, button, held)


def stylus(tip=QPointingDevice.PointerType.Pen):
    capability = QInputDevice.Capability
    return QPointingDevice(
        "pen",
        7,
        QInputDevice.DeviceType.Stylus,
        tip,
        capability.Position | capability.Pressure,
        1,
        3,
    )


@pytest.fixture
def pen():
    return stylus()


def tablet(view, device, kind, x, y, pressure=0.5, button=NONE, held=LEFT, tilt=(0, 0)):
    place = QPointF(x, y)
    event = QTabletEvent(
        kind, device, place, view.mapToGlobal(place), pressure, *tilt, 0.0, 0.0, 0.0, PLAIN,
        button, held,
    )  # fmt: skip
    QApplication.sendEvent(view, event)
    return event


def pen_down(view, device, x, y, pressure=0.5):
    return tablet(view, device, QEvent.Type.TabletPress, x, y, pressure, LEFT)


def pen_move(view, device, x, y, pressure=0.5, held=LEFT, tilt=(0, 0)):
    return tablet(view, device, QEvent.Type.TabletMove, x, y, pressure, NONE, held, tilt)


def pen_up(view, device, x, y):
    return tablet(view, device, QEvent.Type.TabletRelease, x, y, 0.0, LEFT, NONE)


def test_a_drag_with_the_mouse(view):
    move(view, 1, 2)
    down(view, 10.5, 20)
    move(view, 30, 40, LEFT)
    move(view, 500, -40, LEFT)  # outside
    up(view, 500, -40)
    move(view, 5, 5)
    assert view.tool.said == ["hover", "press", "drag", "drag", "release", "hover"]
    hover, press, drag, outside, release, _ = view.tool.events
    assert press.pixel == (10.5, 20) and outside.pixel == (500, -40)
    assert (hover.pressure, press.pressure, drag.pressure) == (0.0, 1.0, 1.0)
    assert press.button == LEFT and drag.buttons == LEFT and release.buttons == NONE
    assert press.kind is Kind.MOUSE and not view.pointer.dragging


def test_a_double_click_is_two_presses(view):
    down(view, 5, 5)
    up(view, 5, 5)
    mouse(view, QEvent.Type.MouseButtonDblClick, 5, 5, LEFT, LEFT)
    up(view, 5, 5)
    assert view.tool.said == ["press", "release"] * 2
    assert [e.clicks for e in view.tool.events] == [1, 1, 2, 1]


def test_other_buttons_neither_begin_nor_end_a_drag_of_the_tool(view):
    down(view, 5, 5, RIGHT)
    move(view, 6, 6, RIGHT)
    up(view, 6, 6, RIGHT)
    assert view.tool.said == [] and len(view.left) >= 3
    down(view, 5, 5)
    left = len(view.left)
    down(view, 5, 5, RIGHT, LEFT | RIGHT)
    up(view, 5, 5, RIGHT, LEFT)
    move(view, 7, 7, LEFT)
    up(view, 7, 7)
    assert view.tool.said == ["press", "drag", "release"] and len(view.left) == left


def test_a_release_that_was_never_seen_ends_the_drag_where_it_was(view):
    down(view, 5, 5)
    move(view, 9, 9, LEFT)
    move(view, 50, 50)
    assert view.tool.said == ["press", "drag", "release", "hover"]
    assert view.tool.events[2].pixel == (9, 9) and view.tool.events[3].pixel == (50, 50)
    down(view, 5, 5)
    down(view, 60, 60)
    up(view, 60, 60)
    assert view.tool.said[4:] == ["press", "release", "press", "release"]
    assert view.tool.events[5].pixel == (5, 5)


@pytest.mark.parametrize(
    "lost",
    [
        QFocusEvent(QEvent.Type.FocusOut, Qt.FocusReason.ActiveWindowFocusReason),
        QEvent(QEvent.Type.WindowDeactivate),
        QEvent(QEvent.Type.Hide),
        QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_Escape, PLAIN),
    ],
    ids=["focus", "window", "hidden", "escape"],
)
def test_what_interrupts_a_drag_cancels_it(view, lost):
    down(view, 5, 5)
    QApplication.sendEvent(view, lost)
    assert view.tool.said[:2] == ["press", "cancel"] and not view.pointer.dragging
    move(view, 8, 8, LEFT)
    up(view, 8, 8)
    assert [each for each in view.tool.said[2:] if each != "leave"] == []


def test_leaving_the_view_ends_hovering_but_no_drag(view):
    move(view, 5, 5)
    QApplication.sendEvent(view, QEvent(QEvent.Type.Leave))
    assert view.tool.said == ["hover", "leave"]
    down(view, 5, 5)
    QApplication.sendEvent(view, QEvent(QEvent.Type.Leave))
    up(view, 300, 5)
    assert view.tool.said[2:] == ["press", "release"]


def test_escape_is_kept_from_shortcuts_within_a_drag_only(view):
    override = QEvent.Type.ShortcutOverride
    free = QKeyEvent(override, Qt.Key.Key_Escape, PLAIN)
    free.ignore()
    QApplication.sendEvent(view, free)
    assert not free.isAccepted()
    down(view, 5, 5)
    kept = QKeyEvent(override, Qt.Key.Key_Escape, PLAIN)
    other = QKeyEvent(override, Qt.Key.Key_B, PLAIN)
    for event in (kept, other):
        event.ignore()
        QApplication.sendEvent(view, event)
    assert kept.isAccepted() and not other.isAccepted()


def test_a_pen_has_pressure_and_tilt_and_a_curve_for_its_pressure(view, pen):
    pen_move(view, pen, 1, 1, 0.0, NONE)
    pen_down(view, pen, 10, 20, 0.25)
    pen_move(view, pen, 11, 21, 0.75, tilt=(30, -10))
    assert pen_up(view, pen, 12, 22).isAccepted()
    assert view.tool.said == ["hover", "press", "drag", "release"]
    assert [e.pressure for e in view.tool.events] == [0.0, 0.25, 0.75, 0.0]
    assert view.tool.events[2].tilt == (30, -10) and view.tool.events[2].pixel == (11, 21)
    assert {e.kind for e in view.tool.events} == {Kind.PEN}
    view.pointer.curve = SOFT
    pen_down(view, pen, 10, 20, 0.25)
    assert view.tool.events[-1].pressure == pytest.approx(0.5)


def test_mouse_events_that_repeat_the_pen_are_dropped(view, pen):
    pen_down(view, pen, 10, 20)
    down(view, 10, 20)
    for x in (11, 12):
        pen_move(view, pen, x, 20)
        move(view, x, 20, LEFT)
    pen_up(view, pen, 12, 20)
    up(view, 12, 20)
    move(view, 12, 20)
    assert view.tool.said == ["press", "drag", "drag", "release"] and not view.left
    view.now += 1.0  # the hand is on the mouse now
    move(view, 50, 50)
    down(view, 50, 50)
    up(view, 50, 50)
    assert view.tool.said[4:] == ["hover", "press", "release"]
    mouse(view, QEvent.Type.MouseMove, 51, 50, device=pen)
    assert len(view.tool.said) == 7, "its device says that it was the pen"


def test_a_late_double_of_a_tap_begins_nothing(view, pen):
    pen_down(view, pen, 10, 20)
    pen_up(view, pen, 10, 20)
    down(view, 10, 20)
    view.now += 1.0
    up(view, 10, 20)
    assert view.tool.said == ["press", "release"] and not view.pointer.dragging


def test_a_mouse_on_the_table_does_not_disturb_the_pen_nor_the_other_way(view, pen):
    down(view, 5, 5)
    pen_move(view, pen, 90, 90, 0.0, NONE)
    view.now += 1.0
    move(view, 6, 6, LEFT)
    assert view.tool.said == ["press", "drag"]
    pen_down(view, pen, 50, 50)
    assert view.tool.said == ["press", "drag", "release", "press"], "the pen takes over"
    assert view.tool.events[2].pixel == (6, 6)
    pen_up(view, pen, 50, 50)
    assert view.tool.said[4:] == ["release"]


def test_the_other_end_of_the_pen_has_a_tool_of_its_own(view, pen):
    eraser, end = Diary(), stylus(QPointingDevice.PointerType.Eraser)
    pen_down(view, end, 1, 1)
    pen_up(view, end, 1, 1)
    assert [e.kind for e in view.tool.events] == [Kind.ERASER] * 2, "the tool in use"
    view.pointer.set_eraser(eraser)
    pen_move(view, pen, 5, 5, 0.0, NONE)
    pen_move(view, end, 5, 5, 0.0, NONE)
    pen_down(view, end, 5, 5)
    pen_move(view, end, 6, 6)
    pen_up(view, end, 6, 6)
    pen_move(view, pen, 6, 6, 0.0, NONE)
    assert view.tool.said[2:] == ["leave", "hover", "leave", "hover"]
    assert eraser.said == ["hover", "press", "drag", "release", "leave"]


def test_taking_another_tool_cancels_the_drag(view):
    other = Diary()
    move(view, 5, 5)
    down(view, 5, 5)
    view.pointer.set_tool(other)
    move(view, 6, 6, LEFT)
    up(view, 6, 6)
    move(view, 7, 7)
    assert view.tool.said == ["hover", "press", "cancel", "leave", "put away"] and other.said == [
        "hover"
    ]


def test_a_tool_that_fails_loses_the_drag_and_takes_it_back(view):
    view.tool.fails = "drag"
    pointer = view.pointer
    down(view, 5, 5)
    place = QPointF(6, 6)
    with pytest.raises(RuntimeError):
        pointer.handle(QMouseEvent(QEvent.Type.MouseMove, place, place, NONE, LEFT, PLAIN))
    assert view.tool.said == ["press", "drag", "cancel"] and not pointer.dragging


def test_who_claims_a_press_gets_the_whole_drag_by_mouse_and_pen(qtbot, pen):
    camera = Diary()
    view = Surface(
        lambda event: camera if event.modifiers & ALT or event.button == MIDDLE else None
    )
    qtbot.addWidget(view)
    changes = []
    view.pointer.dragging_changed.connect(changes.append)
    down(view, 5, 5, keys=ALT)
    move(view, 6, 6, LEFT)  # Alt is up again
    up(view, 6, 6)
    down(view, 5, 5, MIDDLE)
    up(view, 5, 5, MIDDLE)
    assert camera.said == ["press", "drag", "release", "press", "release"]
    assert view.tool.said == [] and changes == [True, False, True, False]
    down(view, 5, 5)
    up(view, 5, 5)
    assert view.tool.said == ["press", "release"]


def test_without_a_tool_everything_is_left_to_others_the_pen_as_a_mouse_too(view, pen):
    view.pointer.set_tool(None)
    assert view.tool.said == ["put away"]
    down(view, 5, 5)
    move(view, 6, 6, LEFT)
    up(view, 6, 6)
    assert len(view.left) == 3
    assert not pen_down(view, pen, 5, 5).isAccepted()
    down(view, 5, 5)  # what Qt makes of it
    pen_move(view, pen, 6, 6)
    move(view, 6, 6, LEFT)
    pen_up(view, pen, 6, 6)
    up(view, 6, 6)
    assert view.left == 2 * list(POINTING[:3])


def test_wheel_and_keys_go_to_the_tool_and_with_alt_the_wheel_does_not(view):
    def wheel(keys):
        QApplication.sendEvent(
            view,
            QWheelEvent(
                QPointF(5, 5), QPointF(5, 5), QPoint(), QPoint(0, 240), NONE, keys,
                Qt.ScrollPhase.NoScrollPhase, False,
            ),
        )  # fmt: skip

    wheel(PLAIN)
    wheel(ALT)
    assert view.tool.said == ["wheel"] and view.tool.events == [(0.0, 2.0)]
    assert QEvent.Type.Wheel in view.left
    assert view.pointer.handle(QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_X, PLAIN))
    assert not view.pointer.handle(QKeyEvent(QEvent.Type.KeyRelease, Qt.Key.Key_Y, PLAIN))
    assert [(e.key, e.down) for e in view.tool.events[1:]] == [
        (Qt.Key.Key_X, True),
        (Qt.Key.Key_Y, False),
    ]
