"""Presses of a real keyboard, through the X server: unlike Qt's own they have scan codes."""

import ctypes
from functools import cache

from PyQt6.QtGui import QGuiApplication

MODIFIERS = {"shift": "Shift_L", "ctrl": "Control_L", "alt": "Alt_L"}


@cache
def _server():
    """(libX11, libXtst, display), or None where there is no X server or no library."""
    if QGuiApplication.platformName() != "xcb":
        return None
    try:
        x11, test = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
    except OSError:
        return None
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XStringToKeysym.restype = ctypes.c_ulong
    x11.XKeysymToKeycode.argtypes = [ctypes.c_void_p, ctypes.c_ulong]
    x11.XKeysymToKeycode.restype = ctypes.c_ubyte
    x11.XSync.argtypes = [ctypes.c_void_p, ctypes.c_int]
    test.XTestFakeKeyEvent.argtypes = [
        ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_ulong,
    ]  # fmt: skip
    display = x11.XOpenDisplay(None)
    return (x11, test, display) if display else None


def there_is_a_keyboard():
    return _server() is not None


def press(keys):
    """Press and let go of names of X joined by "+", as in "shift+bracketleft"."""
    x11, test, display = _server()
    names = [MODIFIERS.get(each, each) for each in keys.split("+")]
    codes = [x11.XKeysymToKeycode(display, x11.XStringToKeysym(each.encode())) for each in names]
    for code in codes:
        test.XTestFakeKeyEvent(display, code, 1, 0)
    for code in reversed(codes):
        test.XTestFakeKeyEvent(display, code, 0, 0)
    x11.XSync(display, 0)
