"""The tool that measures between two places: straight, and over the surface."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from PyQt6.QtCore import QObject, Qt, pyqtSignal

from app.picking import Hits
from app.tools.base import KeyStroke, PointerEvent, Stage, Tool
from app.tools.marks import Dots, Label, Line, Mark
from btfcore.types import F8

if TYPE_CHECKING:
    from btfcore.files.surface import ExportSurface
    from btfcore.paint.ruler import Ruler, Way

MOVED = 4.0  # pixels that make a press a drag; less is the first of two clicks
ENDS, STRAIGHT, BENT = (120, 210, 255), (255, 255, 255), (255, 190, 90)

Place = tuple[int, F8]  # a face of the surface, and weights (3,) of its corners
Ask = Callable[[Place, Place, Callable[["Way"], None]], None]


def ruler_of(surface: ExportSurface) -> Ruler:
    """Ruler whose faces are those of `surface`, joined where only textures part it."""
    from btfcore.paint.ruler import Ruler

    points = np.zeros((int(surface.origin.max()) + 1, 3))
    points[surface.origin] = surface.positions
    return Ruler(points, surface.origin[surface.faces])


class Measure(Tool):
    """Drag from one place to the other, or click both; Escape clears.

    measured(straight, over) in world units, when the longer answer is there too.
    """

    name = "measure"
    cursor = Qt.CursorShape.CrossCursor
    measured = pyqtSignal(float, float)

    def __init__(
        self,
        stage: Stage,
        shown: Callable[[float], str],
        ask: Ask | None = None,
        parent: QObject | None = None,
    ) -> None:
        """Measure on `stage`.

        shown : text of a length in world units. ask : has the way over the surface found
        between two places and hands it to the function that it is given, on this thread, now or
        later; None: only the straight distance is shown.
        """
        super().__init__(stage, parent)
        self._shown, self._ask = shown, ask
        self._begin: Hits | None = None
        self._end: Hits | None = None
        self._pixel = (0.0, 0.0)  # of the press
        self._second = self._done = False  # of two clicks; all is measured
        self._asked = 0  # answers to earlier questions come too late
        self._way: Way | None = None

    @property
    def straight(self) -> float | None:
        """Distance through space, in world units; None without two ends."""
        if self._begin is None or self._end is None:
            return None
        return float(np.linalg.norm(self._end.position[0] - self._begin.position[0]))

    @property
    def over(self) -> float | None:
        """Distance over the surface; None where it is not known, inf where there is no way."""
        return None if self._way is None else self._way.length

    def clear(self) -> None:
        """Forget what was measured."""
        self._begin = self._end = self._way = None
        self._done = False
        self._asked += 1
        self._show()

    def press(self, event: PointerEvent) -> None:
        """Take the first place, or after a click the second."""
        self._pixel = event.pixel
        self._second = self._begin is not None and not self._done
        if self._second:
            self._aim(event)
            return
        self.clear()
        self._begin = self._hit(event)
        self._show()

    def drag(self, event: PointerEvent) -> None:
        """Move the second place; off the surface it stays where it was."""
        self._aim(event)

    def release(self, event: PointerEvent) -> None:
        """Keep what was measured; after a mere click wait for a second one."""
        if self._second or math.dist(event.pixel, self._pixel) >= MOVED:
            self._done = self._end is not None
        else:
            self._end = None
        self._show()
        if self._done:
            self._find()

    def cancel(self) -> None:
        """Forget an unfinished measurement."""
        if self._begin is not None and not self._done:
            self.clear()

    def hover(self, event: PointerEvent) -> None:
        """Show what a click would measure, or where it would begin."""
        if self._begin is not None and not self._done:
            self._aim(event)
            return
        hit = self._hit(event)
        self._show(() if hit is None else (Dots(hit.position, ENDS, 6.0),))

    def leave(self) -> None:
        """Keep showing what was measured."""
        self._show()

    def key(self, stroke: KeyStroke) -> bool:
        """Clear by Escape."""
        used = stroke.down and stroke.key == Qt.Key.Key_Escape and self._begin is not None
        if used:
            self.clear()
        return used

    def _aim(self, event: PointerEvent) -> None:
        hit = self._hit(event)
        if self._begin is not None and hit is not None:
            self._end = hit
        self._show()

    def _hit(self, event: PointerEvent) -> Hits | None:
        picker = self.stage.picker
        if picker is None:
            return None
        hits = picker.pick(self.stage.view(), np.array([event.pixel], np.float64))
        return hits if hits.on[0] else None

    def _find(self) -> None:
        """Ask for the way over the surface."""
        if self._ask is None or self._begin is None or self._end is None:
            return
        self._asked += 1
        question = self._asked

        def answer(way: Way) -> None:
            if question == self._asked:
                self._way = way
                self._show()
                self.measured.emit(self.straight or 0.0, way.length)

        one, two = ((int(each.face[0]), each.bary[0]) for each in (self._begin, self._end))
        self._ask(one, two, answer)

    def _show(self, more: tuple[Mark, ...] = ()) -> None:
        """Draw both ends, the line between, the way over the surface, and the lengths."""
        marks: list[Mark] = []
        straight = self.straight
        if self._begin is not None and self._end is not None and straight is not None:
            ends = np.concatenate([self._begin.position, self._end.position])
            text = self.tr("{} straight").format(self._shown(straight))
            if self._way is not None and len(self._way.points):
                marks.append(Line(self._way.points, BENT, thickness=2.0))
                text += "\n" + self.tr("{} over the surface").format(self._shown(self._way.length))
            elif self._way is not None:
                text += "\n" + self.tr("no way over the surface")
            between = ends[:1] + np.linspace(0, 1, 33)[:, None] * (ends[1:] - ends[:1])
            marks.append(Line(between, STRAIGHT, dashed=True))
            marks += [Dots(ends, ENDS), Label(ends.mean(axis=0), text)]
        elif self._begin is not None:
            marks.append(Dots(self._begin.position, ENDS))
        self.stage.draw((*marks, *more))
