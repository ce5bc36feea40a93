"""Setting the brush and the stamp without leaving the view: by keys, and by moving the pointer."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from PyQt6.QtCore import QObject, Qt

from app.document import Document
from app.picking import Hits
from app.tools.base import KeyStroke, PointerEvent, Stage, Tool
from app.tools.desk import hit
from app.tools.marks import Label, Mark, Ring

LARGER = 1.15  # by a key
HARDER = 0.1
SMALLEST, LARGEST = 1e-4, 1.0  # radius of the brush in the mesh's diagonals
ACROSS = 200.0  # pixels from soft to hard
COLOUR = (255, 255, 255)


def resized(document: Document, factor: float) -> None:
    """Make the brush larger by a factor."""
    set_radius(document, document.radius * factor)


def set_radius(document: Document, radius: float) -> None:
    """Set the brush's radius in world units, within what makes sense on the mesh."""
    opened = document.opened
    if opened is not None:
        unit = opened.mesh.diagonal
        document.set_options(radius=float(np.clip(radius, SMALLEST * unit, LARGEST * unit)))


def hardened(document: Document, step: float) -> None:
    """Make the brush harder by `step`."""
    hardness = round(float(np.clip(document.options.hardness + step, 0.0, 1.0)), 3)
    document.set_options(hardness=hardness)


def turned(document: Document, degrees: float) -> None:
    """Turn the stamp counter-clockwise; it stays within -180 … 180 degrees."""
    turn = document.options.turn + degrees
    document.set_options(turn=round((turn + 180.0) % 360.0 - 180.0, 6))


def scaled(document: Document, factor: float) -> None:
    """Enlarge the stamp by a factor."""
    document.set_options(scale=float(np.clip(document.options.scale * factor, 0.05, 20.0)))


def mirrored(document: Document, axis: str) -> None:
    """Turn symmetry across an axis on or off."""
    old = document.options.mirror
    new = old.replace(axis, "") if axis in old else "".join(sorted(old + axis))
    document.set_options(mirror=new)


class Adjust(Tool):
    """Sets the radius or the hardness by moving the pointer sideways.

    It stands in for the tool in use from `begin` on: a click keeps the new value, Escape or the
    right button brings the old one back; then `done` is called.
    """

    name = "adjust"
    cursor = Qt.CursorShape.SizeHorCursor

    def __init__(
        self,
        stage: Stage,
        document: Document,
        shown: Callable[[float], str],
        done: Callable[[], None],
        parent: QObject | None = None,
    ) -> None:
        """Set the options of `document`; shown : text of a length in world units."""
        super().__init__(stage, parent)
        self._document, self._shown, self._done = document, shown, done
        self._option = ""
        self._before = 0.0
        self._unset = False  # there was no radius, but the share of the mesh
        self._start, self._unit = (0.0, 0.0), 1.0
        self._hits: Hits | None = None

    @property
    def active(self) -> bool:
        """Whether a value is being set."""
        return bool(self._option)

    def begin(self, option: str, event: PointerEvent) -> bool:
        """Set "radius" or "hardness" from where the pointer is; False beside the surface."""
        picker = self.stage.picker
        found = hit(self.stage, event)
        if picker is None or found is None:
            return False
        self._option, self._start, self._hits = option, event.pixel, found
        self._unit = picker.pixel_size(self.stage.view(), float(found.depth[0]))
        radius = option == "radius"
        self._before = self._document.radius if radius else self._document.options.hardness
        self._unset = radius and self._document.options.radius == 0.0
        self._show()
        return True

    def hover(self, event: PointerEvent) -> None:
        """Set the value."""
        way = event.pixel[0] - self._start[0]
        if self._option == "radius":
            set_radius(self._document, self._before + way * self._unit)
        elif self._option == "hardness":
            hardened(self._document, self._before + way / ACROSS - self._document.options.hardness)
        self._show()

    def drag(self, event: PointerEvent) -> None:
        """Set the value with the button down."""
        self.hover(event)

    def release(self, event: PointerEvent) -> None:
        """Keep the value."""
        self._end()

    def cancel(self) -> None:
        """Bring the old value back."""
        if self._option == "radius":
            self._document.set_options(radius=0.0 if self._unset else self._before)
        elif self._option == "hardness":
            self._document.set_options(hardness=self._before)
        self._end()

    def leave(self) -> None:
        """Go on showing the ring: the value is still being set."""

    def key(self, stroke: KeyStroke) -> bool:
        """Keep by Enter; Escape brings the old value back."""
        if not self.active or not stroke.down:
            return False
        if stroke.key in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self._end()
            return True
        if stroke.key == Qt.Key.Key_Escape:
            self.cancel()
            return True
        return False

    def _end(self) -> None:
        if self._option:
            self._option = ""
            self.stage.draw(())
            self._done()

    def _show(self) -> None:
        if self._hits is None or not self._option:
            return
        document = self._document
        point = self._hits.position[0]
        text = self._shown(document.radius)
        if self._option == "hardness":
            text = f"{document.options.hardness:.0%}"
        ring: Mark = Ring(
            point, self._hits.normal[0], document.radius, document.options.hardness, COLOUR
        )
        self.stage.draw((ring, Label(point, text)))


class GiveUp:
    """What the right button does while a value is set."""

    def __init__(self, adjust: Adjust) -> None:
        """Cancel `adjust` once the button is up."""
        self._adjust = adjust

    def press(self, event: PointerEvent) -> None:
        """Nothing yet."""

    def drag(self, event: PointerEvent) -> None:
        """Nothing yet."""

    def release(self, event: PointerEvent) -> None:
        """Bring the old value back."""
        self._adjust.cancel()

    def cancel(self) -> None:
        """Bring the old value back."""
        self._adjust.cancel()
