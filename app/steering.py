"""Drags that are the camera's or the lamp's, and not a tool's."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np
from PyQt6.QtCore import Qt

from app.document import Document
from app.navigation import (
    HELD_KEYS,
    Device,
    Press,
    Verb,
    drag_verb,
    moved,
    pinched,
    rolled,
    wheel_verb,
)
from app.values import Mode
from btfcore.render.camera import Turntable
from btfcore.types import F8

LIGHT_REACH = 0.9  # of the way to the nearer border: a light there shines from the side
FIRST_LIGHT = (-0.45, 0.5, 0.74)  # in the camera's frame
MOST_TURN = 2.9  # radians from the camera's axis, nearly from behind
_SHIFT, _CTRL = Qt.KeyboardModifier.ShiftModifier, Qt.KeyboardModifier.ControlModifier

Pixel = tuple[float, float]


class Moment(Protocol):
    """What steering reads of a pointer's event; `kind` is "mouse", "pen" or "eraser"."""

    @property
    def pixel(self) -> Pixel: ...  # noqa: D102
    @property
    def button(self) -> Qt.MouseButton: ...  # noqa: D102
    @property
    def modifiers(self) -> Qt.KeyboardModifier: ...  # noqa: D102
    @property
    def kind(self) -> str: ...  # noqa: D102


class Steering:
    """Decides who gets a press, and moves camera and main lamp.

    preset : of `app.navigation`. light_drag : plain left drags that no tool wants move the lamp
    while light is shown. held : keys that are down. pivot : (3,) in the scene, what orbiting
    turns round, None: the point looked at.
    """

    def __init__(
        self,
        document: Document,
        camera: Callable[[], Turntable],
        move: Callable[[Turntable], None],
        size: Callable[[], tuple[int, int]],
    ) -> None:
        """Steer what `camera` returns by `move`, in a view of `size` (width, height) pixels."""
        self._document, self._camera, self._move, self._size = document, camera, move, size
        self.preset = "patina"
        self.light_drag = False
        self.held: set[Qt.Key] = set()
        self.pivot: F8 | None = None
        self.aimed = False  # the main lamp was given a direction

    # --- presses

    def hand(self, event: Moment, *, tool: bool) -> CameraDrag | LightDrag | None:
        """Who gets the drag that begins with `event`; None: a tool, if there is one.

        tool : a tool wants plain drags there.
        """
        if self._is_light(event, tool):
            return self.light_hand()
        device = Device.MOUSE if event.kind == "mouse" else Device.PEN
        press = Press(event.button, event.modifiers, frozenset(self.held), tool, device)
        verb = drag_verb(self.preset, press)
        return None if verb is Verb.NONE else CameraDrag(self, verb)

    def light_hand(self) -> LightDrag:
        """What moves the lamp by a drag."""
        return LightDrag(self, self._document)

    def _is_light(self, event: Moment, tool: bool) -> bool:
        """Whether a press is for the lamp, which the user sees shine."""
        left = event.button == Qt.MouseButton.LeftButton
        wanted = bool(event.modifiers & _CTRL) or Qt.Key.Key_L in self.held
        wanted |= self.light_drag and not tool
        free = not event.modifiers & _SHIFT and Qt.Key.Key_Space not in self.held
        return left and wanted and free and self._document.mode is Mode.LIT

    def press_key(self, key: int, down: bool) -> None:
        """Note that a key is held, or no more."""
        for each in HELD_KEYS:
            if key == each:
                (self.held.add if down else self.held.discard)(each)

    # --- the camera

    def drag(self, verb: Verb, way: Pixel, start: Pixel) -> None:
        """Move the camera by a way in pixels; start : where the drag began."""
        height = max(self._size()[1], 1)
        self._move(
            moved(self._camera(), verb, way, height, pivot=self.pivot, pointer=self._place(start))
        )

    def roll(
        self,
        pixel: Pixel,
        notches: tuple[float, float],
        modifiers: Qt.KeyboardModifier,
        device: Device = Device.MOUSE,
    ) -> None:
        """Move the camera by a wheel that no tool wants."""
        verb = wheel_verb(self.preset, modifiers, device=device)
        if verb is Verb.ZOOM:  # what is over the pad goes sideways too
            notches = (0.0, notches[1] or notches[0])
        height = max(self._size()[1], 1)
        self._move(
            rolled(
                self._camera(), verb, notches, height, pivot=self.pivot,
                pointer=self._place(pixel),
            )
        )  # fmt: skip

    def pinch(self, pixel: Pixel, value: float) -> None:
        """Move the camera by two fingers that come together or part."""
        self._move(pinched(self._camera(), value, self._place(pixel)))

    def restore(self, camera: Turntable) -> None:
        """Go back to where the camera was."""
        self._move(camera)

    @property
    def camera(self) -> Turntable:
        """The camera as it is."""
        return self._camera()

    def _place(self, pixel: Pixel) -> Pixel:
        """From the middle of the view to the right and upwards, in its heights."""
        width, height = self._size()
        return (pixel[0] - width / 2) / max(height, 1), (height / 2 - pixel[1]) / max(height, 1)

    # --- the lamp

    def shine_from(self, pixel: Pixel) -> None:
        """Let the main lamp shine from where the pointer lies on a ball around the surface."""
        width, height = self._size()
        radius = max(min(width, height) / 2 * LIGHT_REACH, 1.0)
        x, y = (pixel[0] - width / 2) / radius, (height / 2 - pixel[1]) / radius
        away = math.hypot(x, y)
        angle = min(away * math.pi / 2, MOST_TURN)
        across = math.sin(angle) / max(away, 1e-9)
        self.aim((x * across, y * across, math.cos(angle)))

    def aim(self, local: tuple[float, float, float] = FIRST_LIGHT) -> None:
        """Let the main lamp shine from a direction in the camera's frame."""
        self.aimed = True
        towards = np.array(local) @ self._camera().axes()
        towards /= np.linalg.norm(towards)
        self._document.move_light((float(towards[0]), float(towards[1]), float(towards[2])))


class CameraDrag:
    """A drag that moves the camera; cancelling brings it back."""

    def __init__(self, steering: Steering, verb: Verb) -> None:
        """Do what `verb` says."""
        self._steering, self._verb = steering, verb
        self._start = self._last = (0.0, 0.0)
        self._before = steering.camera

    def press(self, event: Moment) -> None:
        """Begin."""
        self._start = self._last = event.pixel
        self._before = self._steering.camera

    def drag(self, event: Moment) -> None:
        """Move the camera on."""
        way = event.pixel[0] - self._last[0], event.pixel[1] - self._last[1]
        self._last = event.pixel
        if way != (0.0, 0.0):
            self._steering.drag(self._verb, way, self._start)

    def release(self, event: Moment) -> None:
        """Leave the camera where it is."""

    def cancel(self) -> None:
        """Bring the camera back."""
        if self._steering.camera != self._before:
            self._steering.restore(self._before)


class LightDrag:
    """A drag that moves the main lamp; cancelling brings it back."""

    def __init__(self, steering: Steering, document: Document) -> None:
        """Move the lamp of `document`."""
        self._steering, self._document = steering, document
        self._before: tuple[float, float, float] | None = None

    def press(self, event: Moment) -> None:
        """Let it shine from here."""
        lighting = self._document.lighting
        if lighting.lamps:
            self._before = lighting.lamps[lighting.main].direction
        self._steering.shine_from(event.pixel)

    def drag(self, event: Moment) -> None:
        """Let it shine from there."""
        self._steering.shine_from(event.pixel)

    def release(self, event: Moment) -> None:
        """Leave it."""
        self._before = None

    def cancel(self) -> None:
        """Bring it back."""
        before, self._before = self._before, None
        if before is not None:
            self._document.move_light(before)
