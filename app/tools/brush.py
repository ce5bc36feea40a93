"""Brushes on the surface: the ring under the pointer, and strokes that become edits."""

from __future__ import annotations

import numpy as np
from PyQt6.QtCore import QObject, Qt

from app.tool_options import StrokeSpec
from app.tools.base import PointerEvent, Stage
from app.tools.desk import Desk, hit, sentence
from app.tools.marks import Colour, Mark, Marks, Ring
from app.tools.stroke import Brush, StrokeTool
from app.tools.trail import Run
from btfcore.types import F8

IMAGE = 0.55  # of the colour of a ring is left in its images


class SurfaceBrush(StrokeTool):
    """A brush whose drag is one edit of `kind`, computed in the background.

    needs_feature : it works with a sample that has a mask only.
    """

    kind = "paint"
    needs_feature = False

    def __init__(self, stage: Stage, desk: Desk, parent: QObject | None = None) -> None:
        """Draw on `stage` and have the edits of `desk` made."""
        super().__init__(stage, parent)
        self.desk = desk
        self._last: F8 | None = None  # place of the drag
        self._refused = False  # the edits take none now, and have said why
        self._spec = StrokeSpec(self.kind)

    def lacking(self) -> str:
        """Why the brush cannot work now, "" where it can."""
        return self.desk.lacking(feature=self.needs_feature)

    # --- strokes

    def brush(self) -> Brush:
        """As the options of the document say."""
        document = self.desk.document
        return Brush(max(document.radius, 1e-12), document.options.hardness)

    def begin_stroke(self, run: Run, brush: Brush) -> None:
        """Begin the edit, or where the drag has one already, go on with it from another place."""
        edits = self.desk.edits
        if self._refused:
            return
        self._last = run.hits.position[-1]
        if edits.drawing:
            edits.lift_stroke()
            self._extend(run)
            return
        first = run.hits.take(np.array([0]))
        self._refused = not edits.begin_stroke(self._spec, first, float(run.pressure[0]))
        if len(run) > 1 and not self._refused:
            self._extend(run, 1)

    def extend_stroke(self, run: Run) -> None:
        """Go on with the edit."""
        if not self._refused:
            self._last = run.hits.position[-1]
            self._extend(run)

    def _extend(self, run: Run, first: int = 0) -> None:
        hits = run.hits
        self.desk.edits.extend_stroke(
            hits.position[first:], hits.normal[first:], run.pressure[first:]
        )

    def finish_drag(self) -> None:
        """Let the edit be finished in the background."""
        self.desk.edits.finish_stroke()
        if self._last is not None and not self._refused:
            self.desk.touched(self._last)

    def cancel_drag(self) -> None:
        """Take the edit back."""
        self.desk.edits.cancel_stroke()

    # --- events

    def press(self, event: PointerEvent) -> None:
        """Begin a drag, or say why there is none."""
        text = self.lacking()
        if text:
            self._trail, self._lines = None, ()
            self.desk.tell(text)
            self._show(event)
            return
        self._spec, self._refused = StrokeSpec(self.kind, self.desk.document.options), False
        super().press(event)

    def _show(self, event: PointerEvent) -> None:
        text = "" if self._trail is not None else self.lacking()
        if not text:
            super()._show(event)
            return
        found = hit(self.stage, event)
        self.stage.draw(() if found is None else sentence(found, self._brush.radius, text))

    def _traces(self) -> tuple[Mark, ...]:
        return () if self._refused else super()._traces()

    def leave(self) -> None:
        """Show no brush."""
        self.stage.draw((*self.backdrop(), *self._traces()))

    def backdrop(self) -> Marks:
        """What is shown wherever the pointer is."""
        return ()

    def beside(self, ring: Ring) -> Marks:
        """Images of the brush's ring, in the symmetry that is set."""
        marks: list[Mark] = [
            Ring(point, normal, ring.radius, ring.hardness, _dim(ring.colour))
            for point, normal in self.desk.images(ring.point, ring.normal)[1:]
        ]
        return (*self.backdrop(), *marks)


class PaintBrush(SurfaceBrush):
    """Paints the sample's feature while the stroke is drawn (Zhou §IV)."""

    name = kind = "paint"
    colour = (255, 214, 120)
    needs_feature = True
    cursor = Qt.CursorShape.CrossCursor


def _dim(colour: Colour) -> Colour:
    red, green, blue = (round(IMAGE * each) for each in colour)
    return red, green, blue
