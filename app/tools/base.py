"""What a tool is: who gets the pointer's events, and what a tool may ask of the view."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from PyQt6.QtCore import QObject, Qt

from app.picking import Picker, View
from app.tools.marks import Marks


class Kind(StrEnum):
    """What points: a mouse, the tip of a pen, or its other end."""

    MOUSE = "mouse"
    PEN = "pen"
    ERASER = "eraser"


@dataclass(frozen=True)
class PointerEvent:
    """One moment of the pointer, the same for mouse and pen.

    pixel : (column, row) in logical pixels of the view. button : that was pressed or released
    now; buttons : that are down. pressure : 0–1, 1 for a mouse with a button down; tilt : of
    the pen in degrees from upright, along columns and rows. time : seconds, of the system's
    clock of events. clicks : 2 where a press is the second of a double click.
    """

    pixel: tuple[float, float]
    button: Qt.MouseButton = Qt.MouseButton.NoButton
    buttons: Qt.MouseButton = Qt.MouseButton.NoButton
    modifiers: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier
    pressure: float = 1.0
    tilt: tuple[float, float] = (0.0, 0.0)
    time: float = 0.0
    kind: Kind = Kind.MOUSE
    clicks: int = 1


@dataclass(frozen=True)
class KeyStroke:
    """A key that goes down or up."""

    key: int
    modifiers: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier
    down: bool = True
    repeated: bool = False


class Stage(Protocol):
    """What the view offers to tools."""

    @property
    def picker(self) -> Picker | None:
        """Finds places on the surface; None while there is none or it is being made."""

    def view(self) -> View:
        """Return what the user sees now."""

    def draw(self, marks: Marks) -> None:
        """Show these marks over the view instead of those before."""


class Hand(Protocol):
    """Who may get a drag: a tool, or the camera's navigation.

    `press`, any number of `drag`, then exactly one of `release` and `cancel`.
    """

    def press(self, event: PointerEvent) -> None:
        """Begin a drag."""

    def drag(self, event: PointerEvent) -> None:
        """Go on with it."""

    def release(self, event: PointerEvent) -> None:
        """End it: what it did becomes one step of undo."""

    def cancel(self) -> None:
        """End it and take back what it did. Called again, or without a drag, it does nothing."""


class Tool(QObject):
    """A tool that does nothing; tools override what they need.

    `name` tells tools apart (it is not shown) and `cursor` is the pointer's shape. One drag is one
    step of undo.
    """

    name = ""
    cursor = Qt.CursorShape.CrossCursor

    def __init__(self, stage: Stage, parent: QObject | None = None) -> None:
        """Work on `stage`."""
        super().__init__(parent)
        self.stage = stage

    def press(self, event: PointerEvent) -> None:
        """Begin a drag."""

    def drag(self, event: PointerEvent) -> None:
        """Go on with it."""

    def release(self, event: PointerEvent) -> None:
        """End it: what it did becomes one step of undo."""

    def cancel(self) -> None:
        """End it and take back what it did. Called again, or without a drag, it does nothing."""

    def hover(self, event: PointerEvent) -> None:
        """Show what a press would do; no button is down."""

    def leave(self) -> None:
        """The pointer has left the view: show what is to be seen without it."""
        self.stage.draw(())

    def put_away(self) -> None:
        """Another tool is taken: show nothing."""
        self.stage.draw(())

    def wheel(self, event: PointerEvent, notches: tuple[float, float]) -> bool:
        """Whether the wheel was of use; notches to the right and away from the user."""
        return False

    def key(self, stroke: KeyStroke) -> bool:
        """Whether a key was of use, that no shortcut took."""
        return False
