"""What drags, wheels and fingers do to the camera."""

import itertools

import numpy as np
import pytest

pytest.importorskip("PyQt6.QtCore")

from PyQt6.QtCore import Qt  # noqa: E402
from PyQt6.QtGui import QInputDevice  # noqa: E402

from app import navigation  # noqa: E402
from app.navigation import PRESETS, RULES, Device, Press, Verb, drag_verb, wheel_verb  # noqa: E402
from btfcore.render.camera import Turntable  # noqa: E402

LEFT, MIDDLE, RIGHT = (
    Qt.MouseButton.LeftButton,
    Qt.MouseButton.MiddleButton,
    Qt.MouseButton.RightButton,
)
NO, SHIFT, CTRL, ALT = (
    Qt.KeyboardModifier.NoModifier,
    Qt.KeyboardModifier.ShiftModifier,
    Qt.KeyboardModifier.ControlModifier,
    Qt.KeyboardModifier.AltModifier,
)
SPACE, L = frozenset({Qt.Key.Key_Space}), frozenset({Qt.Key.Key_L})
FREE, TOOL = False, True

DRAGS = [
    ("patina", LEFT, NO, (), FREE, "orbit"),
    ("patina", LEFT, NO, (), TOOL, "none"),
    ("patina", LEFT, SHIFT, (), FREE, "pan"),
    ("patina", LEFT, SHIFT, (), TOOL, "none"),
    ("patina", LEFT, CTRL, (), FREE, "none"),  # the main lamp
    ("patina", LEFT, NO, L, FREE, "none"),  # the main lamp as well
    ("patina", LEFT, ALT, (), TOOL, "orbit"),
    ("patina", LEFT, NO, SPACE, TOOL, "pan"),
    ("patina", LEFT, CTRL, SPACE, TOOL, "zoom"),
    ("patina", MIDDLE, NO, (), TOOL, "pan"),
    ("patina", MIDDLE, CTRL | SHIFT, (), TOOL, "dolly"),
    ("patina", RIGHT, NO, (), FREE, "zoom"),
    ("patina", LEFT | RIGHT, NO, (), FREE, "none"),
    ("blender", MIDDLE, NO, (), TOOL, "orbit"),
    ("blender", MIDDLE, SHIFT, (), TOOL, "pan"),
    ("blender", MIDDLE, CTRL, (), TOOL, "zoom"),
    ("blender", MIDDLE, CTRL | SHIFT, (), TOOL, "dolly"),
    ("blender", LEFT, ALT, (), TOOL, "orbit"),
    ("blender", LEFT, NO, (), TOOL, "none"),
    ("blender", RIGHT, NO, (), FREE, "none"),
    ("maya", LEFT, ALT, (), TOOL, "orbit"),
    ("maya", MIDDLE, ALT, (), TOOL, "pan"),
    ("maya", RIGHT, ALT, (), TOOL, "zoom"),
    ("maya", LEFT, NO, (), FREE, "none"),
    ("maya", MIDDLE, NO, (), FREE, "none"),
    ("pen", LEFT, ALT, (), TOOL, "orbit"),
    ("pen", LEFT, NO, SPACE, TOOL, "pan"),
    ("pen", LEFT, CTRL, SPACE, TOOL, "zoom"),
    ("pen", LEFT, SHIFT, SPACE, TOOL, "orbit"),
    ("pen", RIGHT, NO, (), TOOL, "orbit"),
    ("pen", LEFT, NO, (), TOOL, "none"),
    ("pen", LEFT, NO, (), FREE, "orbit"),
    ("trackpad", LEFT, NO, SPACE, TOOL, "pan"),
    ("trackpad", LEFT, ALT | SHIFT, (), TOOL, "pan"),
]


@pytest.mark.parametrize(("preset", "button", "modifiers", "held", "tool", "expected"), DRAGS)
def test_a_drag(preset, button, modifiers, held, tool, expected):
    press = Press(button, modifiers, frozenset(held), tool)
    assert drag_verb(preset, press) == expected


WHEELS = [
    ("patina", Device.MOUSE, NO, FREE, "zoom"),
    ("patina", Device.TOUCHPAD, NO, FREE, "zoom"),
    ("patina", Device.MOUSE, NO, TOOL, "none"),
    ("patina", Device.MOUSE, SHIFT, TOOL, "none"),
    ("patina", Device.MOUSE, ALT, TOOL, "zoom"),
    ("patina", Device.MOUSE, SHIFT, FREE, "pan"),
    ("blender", Device.MOUSE, CTRL, FREE, "pan"),
    ("blender", Device.TOUCHPAD, NO, FREE, "orbit"),
    ("blender", Device.TOUCHPAD, CTRL, FREE, "zoom"),
    ("maya", Device.MOUSE, NO, FREE, "zoom"),
    ("trackpad", Device.TOUCHPAD, NO, FREE, "orbit"),
    ("trackpad", Device.TOUCHPAD, SHIFT, FREE, "pan"),
    ("trackpad", Device.TOUCHPAD, NO, TOOL, "none"),
    ("trackpad", Device.MOUSE, NO, FREE, "zoom"),
    ("trackpad", Device.MOUSE, CTRL | SHIFT, FREE, "none"),
]


@pytest.mark.parametrize(("preset", "device", "modifiers", "tool", "expected"), WHEELS)
def test_a_wheel(preset, device, modifiers, tool, expected):
    assert wheel_verb(preset, modifiers, device=device, tool=tool) == expected


@pytest.mark.parametrize("preset", PRESETS)
def test_a_tool_always_gets_the_plain_tip(preset):
    assert drag_verb(preset, Press(LEFT, tool=True)) is Verb.NONE


@pytest.mark.parametrize("preset", PRESETS)
def test_orbit_pan_and_zoom_need_no_middle_button_while_a_tool_is_active(preset):
    spoken = {
        drag_verb(preset, Press(button, modifiers, held, True))
        for button in (LEFT, RIGHT)
        for modifiers in (NO, SHIFT, CTRL, ALT, ALT | SHIFT, ALT | CTRL)
        for held in (frozenset(), SPACE)
    }
    assert {Verb.ORBIT, Verb.PAN, Verb.ZOOM} <= spoken


@pytest.mark.parametrize("preset", PRESETS)
def test_no_drag_is_told_twice(preset):
    told = [(rule.button, rule.modifiers, rule.held) for rule in RULES[preset]]
    assert len(told) == len(set(told))


@pytest.mark.parametrize("preset", PRESETS)
def test_the_keypad_and_other_keys_change_nothing(preset):
    keypad = Qt.KeyboardModifier.KeypadModifier
    for button, modifiers in itertools.product((LEFT, MIDDLE, RIGHT), (NO, SHIFT, ALT)):
        plain = drag_verb(preset, Press(button, modifiers))
        odd = Press(button, modifiers | keypad, frozenset({Qt.Key.Key_B}))
        assert drag_verb(preset, odd) is plain


def test_a_wheel_counts_notches_and_undoes_what_alt_does():
    assert navigation.wheel_way((0, 240), (0, 0), NO) == (0.0, 2.0)
    assert navigation.wheel_way((120, 0), (0, 0), ALT) == (0.0, 1.0)
    assert navigation.wheel_way((120, 0), (0, 0), NO) == (1.0, 0.0)
    assert navigation.wheel_way((0, 120), (20, -40), NO) == (0.5, -1.0)


@pytest.mark.parametrize(
    ("kind", "expected"),
    [("Zoom", "zoom"), ("Pan", "pan"), ("SmartZoom", "frame selected"), ("Rotate", "none")],
)
def test_a_gesture(kind, expected):
    kind = getattr(Qt.NativeGestureType, f"{kind}NativeGesture")
    assert navigation.gesture_verb(kind) == expected


@pytest.mark.parametrize(
    ("kind", "expected"),
    [("Mouse", "mouse"), ("TouchPad", "touchpad"), ("Stylus", "pen"), ("Puck", "mouse")],
)
def test_a_device(kind, expected):
    assert navigation.device_of(getattr(QInputDevice.DeviceType, kind)) == expected


def seen(camera, point):
    """Camera coordinates of a point."""
    return camera.local(np.asarray(point, float))


CAMERA = Turntable(azimuth=35.0, elevation=20.0, focus=(0.3, -0.1, 0.2), distance=4.0)


def test_orbiting_round_a_stroke_leaves_it_where_it_is():
    pivot = np.array([0.7, 0.2, -0.4])
    turned = navigation.moved(CAMERA, Verb.ORBIT, (60, -35), 800, pivot=pivot)
    assert np.allclose(seen(turned, pivot), seen(CAMERA, pivot))
    assert turned.azimuth != CAMERA.azimuth and turned.elevation != CAMERA.elevation
    steep = navigation.moved(CAMERA, Verb.ORBIT, (0, 5000), 800, pivot=pivot)
    assert np.allclose(seen(steep, pivot), seen(CAMERA, pivot))


def test_orbiting_without_a_pivot_keeps_the_focus():
    turned = navigation.moved(CAMERA, Verb.ORBIT, (60, -35), 800)
    assert turned.focus == CAMERA.focus
    back = navigation.moved(turned, Verb.ORBIT, (-60, 35), 800)
    assert np.allclose(back.axes(), CAMERA.axes())


def test_panning_takes_the_focus_along_with_the_pointer():
    panned = navigation.moved(CAMERA, Verb.PAN, (80, 40), 800)
    before = CAMERA.pixels(np.asarray(CAMERA.focus), (1000, 800))
    after = panned.pixels(np.asarray(CAMERA.focus), (1000, 800))
    assert np.allclose(after[:2] - before[:2], (80, 40))


@pytest.mark.parametrize("factor", [0.5, 1.3, 4.0])
def test_zooming_keeps_what_lies_under_the_pointer(factor):
    size = (1000, 800)
    x, y, _ = CAMERA.axes()
    point = np.asarray(CAMERA.focus) + 0.6 * x - 0.3 * y
    column, row, _ = CAMERA.pixels(point, size)
    pointer = ((column - 500) / 800, (400 - row) / 800)
    zoomed = navigation.zoomed_at(CAMERA, factor, pointer)
    assert np.allclose(zoomed.pixels(point, size)[:2], (column, row))
    assert zoomed.distance == pytest.approx(CAMERA.distance / factor)


def test_zoom_stops_at_the_nearest_and_then_shifts_nothing():
    close = navigation.zoomed_at(CAMERA, 1e9, (0.3, 0.2))
    assert close.distance == navigation.NEAREST
    again = navigation.zoomed_at(close, 2.0, (0.3, 0.2))
    assert again == close


@pytest.mark.parametrize(("value", "factor"), [(0.1, 1.1), (-0.2, 0.8), (-5.0, 0.5), (9.0, 2.0)])
def test_a_pinch_enlarges_by_its_value(value, factor):
    pinched = navigation.pinched(CAMERA, value)
    assert pinched.distance == pytest.approx(CAMERA.distance / factor)


def test_upwards_is_nearer_for_drags_and_wheels():
    assert navigation.moved(CAMERA, Verb.ZOOM, (0, -10), 800).distance < CAMERA.distance
    assert navigation.rolled(CAMERA, Verb.ZOOM, (0, 1), 800).distance < CAMERA.distance


def test_dolly_takes_the_focus_along():
    gone = navigation.moved(CAMERA, Verb.DOLLY, (0, -30), 800)
    assert gone.distance == CAMERA.distance
    step = gone.position - CAMERA.position
    assert np.allclose(np.asarray(gone.focus) - CAMERA.focus, step)
    assert step @ CAMERA.axes()[2] < 0  # forwards


@pytest.mark.parametrize("verb", [Verb.NONE, Verb.FRAME_ALL, Verb.PIVOT_STROKE])
def test_other_verbs_do_not_move_the_camera_by_a_drag(verb):
    assert navigation.moved(CAMERA, verb, (10, 10), 800) == CAMERA


def test_named_views_look_along_the_axes():
    for command, axis in (
        ("view.front", (0, 0, 1)),
        ("view.back", (0, 0, -1)),
        ("view.right", (1, 0, 0)),
        ("view.left", (-1, 0, 0)),
    ):
        assert np.allclose(navigation.looking(CAMERA, command).axes()[2], axis)
    assert navigation.looking(CAMERA, "view.top").axes()[2][1] > 0.99
    assert navigation.looking(CAMERA, "view.bottom").axes()[2][1] < -0.99
