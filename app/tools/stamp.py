"""The stamp: the sample's feature slides over the surface and is merged where one clicks."""

from __future__ import annotations

from PyQt6.QtCore import QObject, Qt

from app.picking import Hits
from app.tools.adjust import scaled, turned
from app.tools.base import PointerEvent, Stage, Tool
from app.tools.desk import Desk, hit, sentence
from app.tools.marks import Dots, Label, Mark

NOTCH = 15.0  # degrees
GROWTH = 1.1  # of the scale, by a notch
SPOT = (255, 214, 120)
_RESIZING = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier


class Stamp(Tool):
    """Preview follows the pointer; click or lift the pen to stamp.

    The wheel turns the stamp, with Ctrl or Shift it scales it. Escape while the button is down
    stamps nothing.
    """

    name = "stamp"

    def __init__(self, stage: Stage, desk: Desk, parent: QObject | None = None) -> None:
        """Stamp on the surface of `stage`."""
        super().__init__(stage, parent)
        self.desk = desk
        self._hits: Hits | None = None  # under the pointer
        self._down = False

    def lacking(self) -> str:
        """Why nothing can be stamped now, "" where it can."""
        return self.desk.lacking(feature=True)

    def hover(self, event: PointerEvent) -> None:
        """Let the preview follow."""
        self._aim(event)

    def press(self, event: PointerEvent) -> None:
        """Aim; the stamp is made on release, so that a pen can slide it too."""
        text = self.lacking()
        self._down = not text
        self._aim(event)
        if text:
            self.desk.tell(text)

    def drag(self, event: PointerEvent) -> None:
        """Slide the preview."""
        self._aim(event)

    def release(self, event: PointerEvent) -> None:
        """Stamp, if the pointer is over the surface."""
        self._aim(event)
        down, self._down = self._down, False
        if down and self._hits is not None:
            place = self._hits.position[0]
            self.desk.edits.stamp(place, self._hits.normal[0])
            self.desk.touched(place)

    def cancel(self) -> None:
        """Stamp nothing."""
        self._down = False
        self._clear()

    def leave(self) -> None:
        """Show no preview."""
        self._clear()

    def put_away(self) -> None:
        """Show no preview."""
        self._clear()

    def wheel(self, event: PointerEvent, notches: tuple[float, float]) -> bool:
        """Turn the stamp under the pointer, or scale it; beside the surface it is the camera's."""
        way = notches[1] or notches[0]
        if way == 0.0 or self.lacking() or hit(self.stage, event) is None:
            return False
        document = self.desk.document
        if event.modifiers & _RESIZING:
            scaled(document, GROWTH**way)
        else:
            turned(document, NOTCH * way)
        self._aim(event, figures=True)
        return True

    def refresh(self) -> None:
        """Show the preview anew: the options have changed."""
        if self._hits is not None:
            self._preview(self._hits)

    def _aim(self, event: PointerEvent, *, figures: bool = False) -> None:
        self._hits = hit(self.stage, event)
        if self._hits is None:
            self._clear()
            return
        text = self.lacking()
        if text:
            self.stage.draw(sentence(self._hits, self.desk.document.radius, text))
            return
        point, normal = self._hits.position[0], self._hits.normal[0]
        marks: list[Mark] = [
            Dots(place[None], SPOT, 5.0) for place, _ in self.desk.images(point, normal)
        ]
        if figures:
            options = self.desk.document.options
            marks.append(Label(point, f"{options.turn:.0f}°   × {options.scale:.2f}"))
        self.stage.draw(tuple(marks))
        self._preview(self._hits)

    def _preview(self, hits: Hits) -> None:
        if not self.lacking():
            self.desk.edits.preview_stamp(hits.position[0], hits.normal[0])

    def _clear(self) -> None:
        self._hits = None
        self.desk.edits.clear_preview()
        self.stage.draw(())
