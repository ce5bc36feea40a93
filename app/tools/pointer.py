"""From Qt's events of mouse, pen, wheel and keys to the tool in use.

A pen's events come twice on most systems: as tablet events, and as mouse events for programs
that know no pen. The latter are dropped.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import cast

from PyQt6.QtCore import QEvent, QObject, Qt, pyqtSignal
from PyQt6.QtGui import (
    QInputDevice,
    QKeyEvent,
    QMouseEvent,
    QPointingDevice,
    QSinglePointEvent,
    QTabletEvent,
    QWheelEvent,
)
from PyQt6.QtWidgets import QWidget

from app.navigation import wheel_way
from app.tools.base import Hand, KeyStroke, Kind, PointerEvent, Tool

ECHO_S = 0.1  # how long after a pen's event a mouse's may be its double

Claim = Callable[[PointerEvent], Hand | None]
Curve = Callable[[float], float]
_Type = QEvent.Type
_NONE = Qt.MouseButton.NoButton
_PRESSES = (_Type.MouseButtonPress, _Type.MouseButtonDblClick)
_MOUSE = (*_PRESSES, _Type.MouseMove, _Type.MouseButtonRelease)
_TABLET = (_Type.TabletPress, _Type.TabletMove, _Type.TabletRelease)
_LOST = (_Type.FocusOut, _Type.WindowDeactivate, _Type.Hide, _Type.UngrabMouse)


def from_mouse(event: QMouseEvent) -> PointerEvent:
    """What a mouse event says."""
    pressed = event.buttons() != _NONE
    return PointerEvent(
        pixel=(event.position().x(), event.position().y()),
        button=event.button(),
        buttons=event.buttons(),
        modifiers=event.modifiers(),
        pressure=1.0 if pressed else 0.0,
        time=_seconds(event),
        clicks=2 if event.type() == _Type.MouseButtonDblClick else 1,
    )


def from_tablet(event: QTabletEvent, curve: Curve | None = None) -> PointerEvent:
    """What a tablet event says; `curve` from the pen's pressure to the tool's."""
    raw = min(max(event.pressure(), 0.0), 1.0)
    eraser = event.pointerType() == QPointingDevice.PointerType.Eraser
    return PointerEvent(
        pixel=(event.position().x(), event.position().y()),
        button=event.button(),
        buttons=event.buttons(),
        modifiers=event.modifiers(),
        pressure=raw if curve is None else curve(raw),
        tilt=(event.xTilt(), event.yTilt()),
        time=_seconds(event),
        kind=Kind.ERASER if eraser else Kind.PEN,
    )


class Pointer(QObject):
    """Hands the events of a view to the tool in use, or to who claims a press.

    A drag belongs to one hand from its press on, whatever is pressed, taken or left meanwhile.
    """

    dragging_changed = pyqtSignal(bool)

    def __init__(
        self,
        claim: Claim | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
        parent: QObject | None = None,
    ) -> None:
        """Begin without a tool.

        claim : says for a press who gets its drag, before the tool does: the camera; None: the
        tool. clock : seconds, for tests.
        """
        super().__init__(parent)
        self.curve: Curve | None = None  # from the pen's pressure to the tool's
        self._claim, self._clock = claim, clock
        self._widget: QWidget | None = None
        self._tool: Tool | None = None
        self._eraser: Tool | None = None
        self._hovered: Tool | None = None
        self._owner: Hand | None = None  # of the drag
        self._button, self._by_pen = _NONE, False  # that began it
        self._last = self._seen = PointerEvent((0.0, 0.0))  # of all, and within the drag
        self._pen_down = self._pen_passed = False
        self._echo_until = float("-inf")

    def attach(self, widget: QWidget) -> None:
        """Take the events of `widget` before it and its earlier filters do.

        It then reports moves without a button too, and shows the tool's cursor.
        """
        self._widget = widget
        widget.setMouseTracking(True)
        widget.setTabletTracking(True)
        widget.installEventFilter(self)
        self._show_cursor()

    def eventFilter(self, target: QObject | None, event: QEvent | None) -> bool:  # noqa: N802
        """Offer each event of the attached widget to the tool."""
        return event is not None and target is self._widget and self.handle(event)

    # --- the tool in use

    @property
    def tool(self) -> Tool | None:
        """The tool that mouse and pen have."""
        return self._tool

    @property
    def dragging(self) -> bool:
        """Whether somebody has a drag."""
        return self._owner is not None

    @property
    def place(self) -> PointerEvent:
        """The last event seen, for what keys do at the pointer."""
        return self._last

    def set_tool(self, tool: Tool | None) -> None:
        """Take another tool; a drag of the one before is cancelled."""
        if tool is not self._tool:
            self.cancel()
            self._unhover()
            if self._tool is not None:
                self._tool.put_away()
            self._tool = tool
            self._show_cursor()

    def set_eraser(self, tool: Tool | None) -> None:
        """Give the pen's other end a tool of its own; None: the one in use."""
        if tool is not self._eraser:
            self.cancel()
            self._unhover()
            self._eraser = tool

    def _show_cursor(self) -> None:
        if self._widget is not None and self._tool is not None:
            self._widget.setCursor(self._tool.cursor)
        elif self._widget is not None:
            self._widget.unsetCursor()

    def cancel(self) -> None:
        """Cancel the drag, if there is one."""
        owner = self._owner
        if owner is not None:
            self._drop()
            owner.cancel()

    # --- events

    def handle(self, event: QEvent) -> bool:
        """Whether an event of the view was for tools, so that nobody else wants it."""
        kind = event.type()
        if kind in _TABLET:
            return self._tablet(cast(QTabletEvent, event))
        if kind in _MOUSE:
            mouse = cast(QMouseEvent, event)
            return self._is_double(mouse) or self._pointed(kind, from_mouse(mouse))
        if kind == _Type.Wheel:
            return self._wheel(cast(QWheelEvent, event))
        if kind in (_Type.KeyPress, _Type.KeyRelease):
            return self._key(cast(QKeyEvent, event))
        if kind == _Type.ShortcutOverride and self.dragging:
            # else a shortcut on Escape would get it
            escape = cast(QKeyEvent, event).key() == Qt.Key.Key_Escape
            event.setAccepted(escape)
            return escape
        if kind == _Type.Leave and not self.dragging:
            self._unhover()
        elif kind in _LOST:
            self.cancel()
            self._pen_down = self._pen_passed = False
            if kind == _Type.Hide:
                self._unhover()
        return False

    def _tablet(self, event: QTabletEvent) -> bool:
        kind = event.type()
        made = from_tablet(event, self.curve)
        if kind == _Type.TabletPress:
            self._pen_down = True
        used = self._pointed(kind, made)
        if kind == _Type.TabletPress:
            self._pen_passed = not used
        if made.buttons == _NONE:
            self._pen_down = False
        self._echo_until = self._clock() + ECHO_S
        event.setAccepted(used)  # of what is not accepted Qt makes mouse events
        return used

    def _is_double(self, event: QMouseEvent) -> bool:
        """Whether a mouse event repeats what the pen has said."""
        if self._pen_passed:
            # nobody here wanted the pen, so its mouse events are for others, to the last
            if event.type() == _Type.MouseButtonRelease and not self._pen_down:
                self._pen_passed = False
            return False
        return self._pen_down or self._clock() < self._echo_until or _of_pen(event)

    def _pointed(self, kind: QEvent.Type, event: PointerEvent) -> bool:
        self._last = event
        if kind in (*_PRESSES, _Type.TabletPress):
            return self._press(event)
        if kind in (_Type.MouseButtonRelease, _Type.TabletRelease):
            return self._release(event)
        return self._move(event)

    def _press(self, event: PointerEvent) -> bool:
        if self._owner is not None:
            if self._is_own(event) and event.button != self._button in event.buttons:
                return True  # another button within a drag
            self._lost_release()
        owner: Hand | None = self._claim(event) if self._claim is not None else None
        if owner is None and event.button == Qt.MouseButton.LeftButton:
            owner = self._hover_over(event)
        if owner is None:
            return False
        self._owner, self._button, self._by_pen = owner, event.button, event.kind != Kind.MOUSE
        self.dragging_changed.emit(True)
        self._tell(owner.press, event)
        return True

    def _move(self, event: PointerEvent) -> bool:
        owner = self._owner
        if owner is not None:
            if not self._is_own(event):
                return True  # the other device, moved by accident
            if self._button in event.buttons:
                self._tell(owner.drag, event)
                return True
            self._lost_release()
        if event.buttons != _NONE:
            return False  # a drag that is somebody else's
        tool = self._hover_over(event)
        if tool is not None:
            tool.hover(event)
        return tool is not None

    def _hover_over(self, event: PointerEvent) -> Tool | None:
        """Return the tool that an event is for; another that hovered leaves."""
        erasing = event.kind == Kind.ERASER and self._eraser is not None
        tool = self._eraser if erasing else self._tool
        if tool is not self._hovered:
            self._unhover()
            self._hovered = tool
        return tool

    def _release(self, event: PointerEvent) -> bool:
        owner = self._owner
        if owner is None:
            return False
        if self._is_own(event) and event.button == self._button:
            self._end(owner, event)
        return True

    def _lost_release(self) -> None:
        """End a drag whose release went elsewhere, where it was last seen."""
        if self._owner is not None:
            self._end(self._owner, replace(self._seen, button=self._button, buttons=_NONE))

    def _end(self, owner: Hand, event: PointerEvent) -> None:
        self._tell(owner.release, event)
        self._drop()

    def _drop(self) -> None:
        """Forget the drag."""
        if self._owner is not None:
            self._owner = None
            self.dragging_changed.emit(False)

    def _tell(self, call: Callable[[PointerEvent], None], event: PointerEvent) -> None:
        """Tell the drag's owner; one that fails loses the drag, and what it did is taken back."""
        self._seen = event
        try:
            call(event)
        except BaseException:
            self.cancel()
            raise

    def _wheel(self, event: QWheelEvent) -> bool:
        tool = self._tool
        busy = self._owner is not None and self._owner is not tool
        if tool is None or busy or event.modifiers() & Qt.KeyboardModifier.AltModifier:
            return False  # with Alt it is the camera's
        angle, pixels = event.angleDelta(), event.pixelDelta()
        way = (angle.x(), angle.y()), (pixels.x(), pixels.y())
        notches = wheel_way(*way, event.modifiers())
        place = PointerEvent(
            (event.position().x(), event.position().y()), buttons=event.buttons(),
            modifiers=event.modifiers(), time=_seconds(event),
        )  # fmt: skip
        return tool.wheel(place, notches)

    def _key(self, event: QKeyEvent) -> bool:
        down = event.type() == _Type.KeyPress
        if down and event.key() == Qt.Key.Key_Escape and self.dragging:
            self.cancel()
            return True
        stroke = KeyStroke(event.key(), event.modifiers(), down, event.isAutoRepeat())
        return self._tool is not None and self._tool.key(stroke)

    def _is_own(self, event: PointerEvent) -> bool:
        """Whether an event comes from the device that began the drag."""
        return (event.kind != Kind.MOUSE) == self._by_pen

    def _unhover(self) -> None:
        if self._hovered is not None:
            hovered, self._hovered = self._hovered, None
            hovered.leave()


def _of_pen(event: QMouseEvent) -> bool:
    """Whether Qt or the system says that a mouse event comes from a pen."""
    device = event.pointingDevice()
    return device is not None and device.type() == QInputDevice.DeviceType.Stylus


def _seconds(event: QSinglePointEvent) -> float:
    return event.timestamp() / 1000 if event.timestamp() else time.monotonic()
