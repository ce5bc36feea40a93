"""A real mouse, through the X server: what Qt's own events cannot do is drag and drop."""

import ctypes

from tests.app.xkeys import _server, there_is_a_keyboard

there_is_a_mouse = there_is_a_keyboard


def move(x, y):
    """Put the pointer at a place of the screen."""
    x11, test, display = _server()
    test.XTestFakeMotionEvent.argtypes = [
        ctypes.c_void_p, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_ulong,
    ]  # fmt: skip
    test.XTestFakeMotionEvent(display, -1, int(x), int(y), 0)
    x11.XSync(display, 0)


def button(down, number=1):
    """Press a button, or let it go."""
    x11, test, display = _server()
    test.XTestFakeButtonEvent.argtypes = [
        ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_ulong,
    ]  # fmt: skip
    test.XTestFakeButtonEvent(display, number, int(down), 0)
    x11.XSync(display, 0)
