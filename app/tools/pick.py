"""The tool that takes the sample under the pointer as the one to paint with."""

from __future__ import annotations

from PyQt6.QtCore import QObject, Qt

from app.picking import Hits
from app.tools.base import PointerEvent, Stage, Tool
from app.tools.desk import Desk, hit
from app.tools.marks import Dots, Label

SPOT = (255, 255, 255)


class Pick(Tool):
    """Shows the name of the sample under the pointer; a click takes it."""

    name = "pick"
    cursor = Qt.CursorShape.WhatsThisCursor

    def __init__(self, stage: Stage, desk: Desk, parent: QObject | None = None) -> None:
        """Pick from the surface of `stage`."""
        super().__init__(stage, parent)
        self.desk = desk

    def hover(self, event: PointerEvent) -> None:
        """Name the sample."""
        found = hit(self.stage, event)
        if found is None:
            self.stage.draw(())
            return
        text = self.desk.lacking() or self.sample(found) or self.tr("nothing yet")
        self.stage.draw((Dots(found.position, SPOT, 6.0), Label(found.position[0], text)))

    def drag(self, event: PointerEvent) -> None:
        """Name the sample."""
        self.hover(event)

    def release(self, event: PointerEvent) -> None:
        """Take the sample."""
        self.hover(event)
        text, found = self.desk.lacking(), hit(self.stage, event)
        if text or found is None:
            if text:
                self.desk.tell(text)
            return
        name = self.sample(found)
        if not name:
            self.desk.tell(self.tr("Nothing is synthesised there."))
            return
        self.desk.document.set_options(sample=name)
        text = self.tr("Painting with “{0}” from now on.")
        if not self.desk.has_feature():
            text = self.tr("“{0}” is taken; it has no feature to paint yet.")
        self.desk.tell(text.format(name))

    def sample(self, hits: Hits) -> str:
        """Name of the sample at a place, "" where the surface is bare."""
        done, picker = self.desk.document.decoration, self.stage.picker
        if done is None or picker is None or picker.surface is not done.canvas.surface:
            return ""
        vertex = int(picker.vertices(hits)[0])
        if vertex < 0 or done.quilt.patch[vertex] < 0:
            return ""
        names, number = self.desk.document.sample_names, int(done.quilt.sample[vertex])
        return names[number] if number < len(names) else ""
