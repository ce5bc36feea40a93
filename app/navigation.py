"""What the mouse, the pen and the touchpad do to the camera, for each preset.

Everything here is a pure function: the view hands in what it sees of an event and gets a verb,
and `moved` turns a verb and a way in pixels into the next camera.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from PyQt6.QtCore import Qt
from PyQt6.QtGui import QInputDevice

from btfcore.render.camera import ANGLE, Turntable
from btfcore.types import F8

PRESETS = ("patina", "blender", "maya", "pen", "trackpad")
DEGREES_PER_PIXEL = 0.4
ZOOM_PER_NOTCH = 1.15
ZOOM_PER_PIXEL = 1.01
PIXELS_PER_NOTCH = 40.0  # of a wheel without notches
NEAREST, FARTHEST = 0.01, 100.0  # distances of the camera, as of `Turntable.zoomed`


class Verb(StrEnum):
    """What happens to the camera; NONE: the event is not the camera's, a tool may have it.

    ZOOM changes the distance to the point looked at; DOLLY takes that point along.
    """

    NONE = "none"
    ORBIT = "orbit"
    PAN = "pan"
    ZOOM = "zoom"
    DOLLY = "dolly"
    FRAME_ALL = "frame all"
    FRAME_SELECTED = "frame selected"
    PIVOT_STROKE = "orbit round the last stroke"


class Device(StrEnum):
    """What sent an event."""

    MOUSE = "mouse"
    PEN = "pen"
    TOUCHPAD = "touchpad"


_LEFT, _MIDDLE, _RIGHT = (
    Qt.MouseButton.LeftButton,
    Qt.MouseButton.MiddleButton,
    Qt.MouseButton.RightButton,
)
_PLAIN, _SHIFT, _CTRL, _ALT = (
    Qt.KeyboardModifier.NoModifier,
    Qt.KeyboardModifier.ShiftModifier,
    Qt.KeyboardModifier.ControlModifier,
    Qt.KeyboardModifier.AltModifier,
)
_COUNTED = _SHIFT | _CTRL | _ALT | Qt.KeyboardModifier.MetaModifier  # not the keypad's
_SPACE, _LIGHT = Qt.Key.Key_Space, Qt.Key.Key_L
HELD_KEYS = frozenset({_SPACE, _LIGHT})  # that mean something while they are held


@dataclass(frozen=True)
class Press:
    """What a drag began with.

    held : those of `HELD_KEYS` that are down. tool : a tool wants plain drags at this place.
    """

    buttons: Qt.MouseButton
    modifiers: Qt.KeyboardModifier = _PLAIN
    held: frozenset[Qt.Key] = frozenset()
    tool: bool = False
    device: Device = Device.MOUSE


@dataclass(frozen=True)
class Rule:
    """A drag with exactly this button and these modifiers is `verb`.

    held : a key that must be down, None: none may be. free : only where no tool wants it.
    """

    verb: Verb
    button: Qt.MouseButton
    modifiers: Qt.KeyboardModifier = _PLAIN
    held: Qt.Key | None = None
    free: bool = False

    def fits(self, press: Press) -> bool:
        """Whether this rule is about `press`."""
        held = press.held & HELD_KEYS
        return (
            press.buttons == self.button
            and (press.modifiers & _COUNTED) == self.modifiers
            and held == (frozenset() if self.held is None else frozenset({self.held}))
            and not (self.free and press.tool)
        )


_SPACED = (  # one hand on the keyboard and a tip are enough
    Rule(Verb.PAN, _LEFT, held=_SPACE),
    Rule(Verb.ZOOM, _LEFT, _CTRL, held=_SPACE),
    Rule(Verb.ORBIT, _LEFT, _SHIFT, held=_SPACE),
)
_ALTERNATE = (  # for those whose system lets Alt through
    Rule(Verb.ORBIT, _LEFT, _ALT),
    Rule(Verb.PAN, _LEFT, _ALT | _SHIFT),
    Rule(Verb.ZOOM, _LEFT, _ALT | _CTRL),
)
_FREE = (
    Rule(Verb.ORBIT, _LEFT, free=True),
    Rule(Verb.PAN, _LEFT, _SHIFT, free=True),
)
RULES: dict[str, tuple[Rule, ...]] = {
    "patina": (
        *_FREE,
        *_ALTERNATE,
        *_SPACED,
        Rule(Verb.PAN, _MIDDLE),
        Rule(Verb.ORBIT, _MIDDLE, _ALT),
        Rule(Verb.ZOOM, _MIDDLE, _CTRL),
        Rule(Verb.DOLLY, _MIDDLE, _CTRL | _SHIFT),
        Rule(Verb.ZOOM, _RIGHT, free=True),
        Rule(Verb.ZOOM, _RIGHT, _ALT),
    ),
    "blender": (
        Rule(Verb.ORBIT, _MIDDLE),
        Rule(Verb.PAN, _MIDDLE, _SHIFT),
        Rule(Verb.ZOOM, _MIDDLE, _CTRL),
        Rule(Verb.DOLLY, _MIDDLE, _CTRL | _SHIFT),
        *_ALTERNATE,
        *_SPACED,
        *_FREE,
    ),
    "maya": (
        Rule(Verb.ORBIT, _LEFT, _ALT),
        Rule(Verb.PAN, _MIDDLE, _ALT),
        Rule(Verb.ZOOM, _RIGHT, _ALT),
        Rule(Verb.DOLLY, _RIGHT, _ALT | _CTRL),
        *_SPACED,
    ),
    "pen": (
        *_ALTERNATE,
        *_SPACED,
        Rule(Verb.ORBIT, _RIGHT),  # the button on the barrel
        Rule(Verb.PAN, _RIGHT, _SHIFT),
        Rule(Verb.ZOOM, _RIGHT, _CTRL),
        *_FREE,
    ),
    "trackpad": (*_ALTERNATE, *_SPACED, *_FREE),
}
COMMAND_VERBS = {
    "view.frame_all": Verb.FRAME_ALL,
    "view.frame_selected": Verb.FRAME_SELECTED,
    "view.pivot_stroke": Verb.PIVOT_STROKE,
}
VIEWS = {  # azimuth and elevation in degrees
    "view.front": (0.0, 0.0),
    "view.back": (180.0, 0.0),
    "view.right": (90.0, 0.0),
    "view.left": (270.0, 0.0),
    "view.top": (0.0, 89.0),
    "view.bottom": (0.0, -89.0),
}


def drag_verb(preset: str, press: Press) -> Verb:
    """What a drag does that began with `press`."""
    return next((rule.verb for rule in RULES[preset] if rule.fits(press)), Verb.NONE)


def wheel_verb(
    preset: str,
    modifiers: Qt.KeyboardModifier = _PLAIN,
    *,
    device: Device = Device.MOUSE,
    tool: bool = False,
) -> Verb:
    """What a wheel, or two fingers on a touchpad, do.

    tool : a tool wants the wheel at this place (the stamp turns and scales by it); Alt and the
    wheel are the camera's all the same.
    """
    pressed = modifiers & _COUNTED
    if device is Device.TOUCHPAD and preset in ("trackpad", "blender"):
        fingers = {_PLAIN: Verb.ORBIT, _SHIFT: Verb.PAN, _CTRL: Verb.ZOOM, _ALT: Verb.ZOOM}
        return Verb.NONE if tool and pressed != _ALT else fingers.get(pressed, Verb.NONE)
    if tool:
        return Verb.ZOOM if pressed == _ALT else Verb.NONE
    wheel = {_PLAIN: Verb.ZOOM, _ALT: Verb.ZOOM, _CTRL: Verb.ZOOM, _SHIFT: Verb.PAN}
    if preset == "blender":
        wheel = {_PLAIN: Verb.ZOOM, _ALT: Verb.ZOOM, _SHIFT: Verb.PAN, _CTRL: Verb.PAN}
    return wheel.get(pressed, Verb.NONE)


def gesture_verb(kind: Qt.NativeGestureType) -> Verb:
    """What a gesture of a touchpad does; its value is handed to `pinched` where it zooms."""
    return {
        Qt.NativeGestureType.ZoomNativeGesture: Verb.ZOOM,
        Qt.NativeGestureType.PanNativeGesture: Verb.PAN,
        Qt.NativeGestureType.SmartZoomNativeGesture: Verb.FRAME_SELECTED,
    }.get(kind, Verb.NONE)


def device_of(kind: QInputDevice.DeviceType) -> Device:
    """Device of an event by what Qt calls it; what is no pen nor touchpad counts as a mouse."""
    kinds = QInputDevice.DeviceType
    if kind in (kinds.Stylus, kinds.Airbrush):
        return Device.PEN
    return Device.TOUCHPAD if kind is kinds.TouchPad else Device.MOUSE


def wheel_way(
    angle: tuple[float, float], pixels: tuple[float, float], modifiers: Qt.KeyboardModifier
) -> tuple[float, float]:
    """Way of a wheel to the right and upwards, in notches.

    angle : of Qt, 120 a notch; pixels : of devices without notches, else zeros. Qt exchanges the
    two directions while Alt is held; that is undone.
    """
    x, y = (each / PIXELS_PER_NOTCH for each in pixels)
    if x == y == 0.0:
        x, y = (each / 120.0 for each in angle)
    return (y, x) if modifiers & _ALT and y == 0.0 else (x, y)


def moved(
    camera: Turntable,
    verb: Verb,
    way: tuple[float, float],
    height: float,
    *,
    pivot: F8 | None = None,
    pointer: tuple[float, float] = (0.0, 0.0),
) -> Turntable:
    """Camera after a drag.

    way : pixels to the right and downwards, as Qt counts; height : of the view in pixels.
    pivot : (3,) point that orbiting turns round and leaves where it is in the picture, None:
    the point looked at. pointer : place under which zooming leaves the surface, to the right
    and upwards from the middle of the view in its heights.
    """
    right, down = way
    if verb is Verb.ORBIT:
        turned = camera.orbited(right * DEGREES_PER_PIXEL, -down * DEGREES_PER_PIXEL)
        return turned if pivot is None else _held(camera, turned, pivot)
    if verb is Verb.PAN:
        return camera.panned(right / max(height, 1.0), -down / max(height, 1.0))
    if verb is Verb.ZOOM:
        return zoomed_at(camera, ZOOM_PER_PIXEL**-down, pointer)
    if verb is Verb.DOLLY:
        step = camera.distance * (ZOOM_PER_PIXEL**-down - 1.0)
        return _focused(camera, np.asarray(camera.focus) - step * camera.axes()[2])
    return camera


def rolled(
    camera: Turntable,
    verb: Verb,
    notches: tuple[float, float],
    height: float,
    *,
    pivot: F8 | None = None,
    pointer: tuple[float, float] = (0.0, 0.0),
) -> Turntable:
    """Camera after a wheel's way in notches to the right and upwards; the rest is of `moved`."""
    right, up = notches
    if verb is Verb.ZOOM:
        return zoomed_at(camera, ZOOM_PER_NOTCH**up, pointer)
    way = (right * PIXELS_PER_NOTCH, up * PIXELS_PER_NOTCH)
    return moved(camera, verb, way, height, pivot=pivot, pointer=pointer)


def zoomed_at(camera: Turntable, factor: float, pointer: tuple[float, float]) -> Turntable:
    """Enlarge the picture by `factor` and keep in place what lies under the pointer.

    Exact for points as far away as the point looked at. pointer : as of `moved`.
    """
    zoomed = camera.zoomed(factor, nearest=NEAREST, farthest=FARTHEST)
    reach = 2.0 * np.tan(np.radians(ANGLE / 2)) * (camera.distance - zoomed.distance)
    x, y, _ = camera.axes()
    return _focused(zoomed, np.asarray(camera.focus) + reach * (pointer[0] * x + pointer[1] * y))


def pinched(
    camera: Turntable, value: float, pointer: tuple[float, float] = (0.0, 0.0)
) -> Turntable:
    """Camera after a zoom gesture of Qt, whose value is the growth of the picture.

    One event makes it at most twice or half as large. pointer : as of `moved`.
    """
    return zoomed_at(camera, min(max(1.0 + value, 0.5), 2.0), pointer)


def looking(camera: Turntable, command: str) -> Turntable:
    """Camera that looks from the side that a command of `VIEWS` names."""
    azimuth, elevation = VIEWS[command]
    return replace(camera, azimuth=azimuth, elevation=elevation)


def _held(before: Turntable, after: Turntable, pivot: F8) -> Turntable:
    """Shift `after` so that `pivot` is where `before` saw it."""
    local = np.einsum("ij,j->i", before.axes(), np.asarray(before.focus) - pivot)
    return _focused(after, pivot + np.einsum("ij,i->j", after.axes(), local))


def _focused(camera: Turntable, focus: F8) -> Turntable:
    return replace(camera, focus=(float(focus[0]), float(focus[1]), float(focus[2])))
