"""The tool that draws which way the sample runs: vectors that guide the orientation field."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from PyQt6.QtCore import QObject, Qt, pyqtSignal

from app.tasks import Job, Report, Tasks
from app.tools.base import KeyStroke, PointerEvent, Stage
from app.tools.desk import Desk, hit
from app.tools.directions import Shown, along, shown_of, snapped
from app.tools.marks import Arrows, Dots, Label, Mark, Marks, Ring
from app.tools.stroke import Brush, StrokeTool
from app.tools.trail import Run
from app.values import Canvas
from btfcore.guide import Guide
from btfcore.progress import Progress
from btfcore.types import F8

MOVED = 4.0  # pixels that make a press a drag
NEAR = 14.0  # pixels from which a click removes a vector
GUIDED, FIELD, TURNING = (255, 190, 90), (190, 205, 220), (240, 80, 60)
MOST_UNDONE = 100


@dataclass(eq=False)
class _Preview:
    """What of the field is shown, and what it was made of."""

    canvas: Canvas | None = None
    guide: Guide | None = None
    shown: Shown | None = None
    failed: str = ""
    asked: tuple[Canvas | None, Guide | None] = (None, None)
    before: list[Guide | None] = field(default_factory=list)  # what undo brings back
    after: list[Guide | None] = field(default_factory=list)  # what redo does


class Orient(StrokeTool):
    """Draw the sample's rightward direction on the surface; the field follows while you look.

    Shift : directions snap to those of curvature. A click on a vector removes it, Backspace takes
    the last stroke back, Delete removes all. Enter: `synthesize_wanted`.
    """

    name = "orient"
    colour = GUIDED
    synthesize_wanted = pyqtSignal()

    def __init__(self, stage: Stage, desk: Desk, parent: QObject | None = None) -> None:
        """Guide the field of the document of `desk`."""
        super().__init__(stage, parent)
        self.desk = desk
        self.tasks = Tasks(self)
        self.tasks.finished.connect(self._made)
        self.tasks.failed.connect(lambda name, text: self._refused(text))
        self.tasks.idle.connect(self._ask)
        self._preview = _Preview()
        self._parts: list[list[Run]] = []  # of the drag
        self._pixel, self._snap = (0.0, 0.0), False
        self._active = False
        desk.document.guide_changed.connect(self._changed)
        desk.document.picture_changed.connect(self._changed)
        desk.document.mesh_changed.connect(self._forget)

    # --- strokes

    def brush(self) -> Brush:
        """As wide as directions are apart."""
        return Brush(max(self.desk.document.radius, 1e-12), sized=False)

    def begin_stroke(self, run: Run, brush: Brush) -> None:
        """Begin a line."""
        self._parts.append([run])

    def extend_stroke(self, run: Run) -> None:
        """Go on with it."""
        self._parts[-1].append(run)

    def finish_drag(self) -> None:
        """Add the directions of the lines to the guide."""
        parts, self._parts = self._parts, []
        found = []
        for runs in parts:
            points, normals = (
                np.concatenate([getattr(run.hits, name) for run in runs])
                for name in ("position", "normal")
            )
            place, direction = along(points, normals, self._brush.radius)
            if self._snap and len(place):
                direction = self._snapped(place, direction)
            found.append((place, direction))
        place, direction = (np.concatenate(each) for each in zip(*found, strict=True))
        if len(place):
            self._set(_joined(self.desk.document.guide, place, direction))

    def cancel_drag(self) -> None:
        """Forget the lines."""
        self._parts = []

    def _snapped(self, place: F8, direction: F8) -> F8:
        canvas = self.desk.document.canvas
        if canvas is None:
            self.desk.tell(self.tr("Directions snap to curvature once the mesh is prepared."))
            return direction
        dense = canvas.prepared.dense
        return snapped(dense, place, direction, max(self._brush.radius, 4 * dense.step))

    # --- events

    def press(self, event: PointerEvent) -> None:
        """Begin a line, or a click."""
        self._pixel = event.pixel
        self._snap = bool(event.modifiers & Qt.KeyboardModifier.ShiftModifier)
        self._parts = []
        super().press(event)

    def release(self, event: PointerEvent) -> None:
        """Add what was drawn; a mere click removes the vector under it."""
        if math.dist(event.pixel, self._pixel) >= MOVED:
            super().release(event)
            return
        self._trail, self._lines, self._parts = None, (), []
        self._remove(event)
        self._show(event)

    def leave(self) -> None:
        """Show the field without a brush."""
        self.stage.draw((*self.backdrop(), *self._traces()))

    def put_away(self) -> None:
        """Show nothing."""
        self._active = False
        super().put_away()

    def key(self, stroke: KeyStroke) -> bool:
        """Backspace, Delete and Enter."""
        if not stroke.down or self.drawing:
            return False
        document = self.desk.document
        if stroke.key == Qt.Key.Key_Backspace:
            return self.undo()
        if stroke.key == Qt.Key.Key_Delete and document.guide is not None:
            self._set(None)
            return True
        if stroke.key in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.synthesize_wanted.emit()
            return True
        return False

    def _show(self, event: PointerEvent) -> None:
        if self.stage.picker is None or hit(self.stage, event) is None:
            self.stage.draw((*self.backdrop(), *self._traces()))
        else:
            super()._show(event)

    def beside(self, ring: Ring) -> Marks:
        """The field; where there is none yet, why."""
        marks = self.backdrop()
        document = self.desk.document
        if document.canvas is None and document.guide is None and not self.drawing:
            text = self.tr("Draw which way the sample shall run.")
            marks = (*marks, Label(ring.point, text))
        return marks

    # --- what is shown

    def backdrop(self) -> Marks:
        """Arrows of the field, its singularities, and the vectors of the guide."""
        self._active = True
        self._ask()
        marks: list[Mark] = []
        shown, guide = self._preview.shown, self.desk.document.guide
        if shown is not None:
            marks.append(Arrows(shown.tails, shown.heads, FIELD))
            if len(shown.singularities):
                marks.append(Dots(shown.singularities, TURNING, 9.0))
        if guide is not None:
            unit = guide.directions / np.linalg.norm(guide.directions, axis=1, keepdims=True)
            heads = guide.positions + self.desk.document.radius * unit
            marks.append(Arrows(guide.positions, heads, GUIDED))
        return tuple(marks)

    def _changed(self) -> None:
        if self._active and not self.drawing:
            self.stage.draw(self.backdrop())

    def _ask(self) -> None:
        """Have what is out of date made in the background."""
        document, preview = self.desk.document, self._preview
        canvas, guide = document.canvas, document.guide
        if not self._active:
            return
        if canvas is None:
            preview.shown = None
            return
        wanted = (canvas, guide)
        if (preview.canvas, preview.guide) == wanted:
            return
        if self.tasks.busy:
            if preview.asked != wanted:
                self.tasks.cancel()
            return
        preview.asked = wanted
        self.tasks.start("field", _job(canvas, guide))

    def _made(self, name: str, value: Shown) -> None:
        self._preview.canvas, self._preview.guide = self._preview.asked
        self._preview.shown = value
        self._changed()

    def _refused(self, text: str) -> None:
        self._preview.canvas, self._preview.guide = self._preview.asked
        self.desk.tell(text)

    # --- the guide

    def undo(self) -> bool:
        """Take back what was drawn or removed last; False where there is nothing."""
        return self._travel(self._preview.before, self._preview.after)

    def redo(self) -> bool:
        """Do it again."""
        return self._travel(self._preview.after, self._preview.before)

    def _travel(self, source: list[Guide | None], other: list[Guide | None]) -> bool:
        if not source:
            return False
        other.append(self.desk.document.guide)
        self.desk.document.set_guide(source.pop())
        return True

    def _forget(self) -> None:
        """Forget the steps: they belong to another mesh."""
        self._preview.before.clear()
        self._preview.after.clear()

    def _set(self, guide: Guide | None) -> None:
        before = self._preview.before
        before.append(self.desk.document.guide)
        del before[:-MOST_UNDONE]
        self._preview.after.clear()
        self.desk.document.set_guide(guide)

    def _remove(self, event: PointerEvent) -> None:
        """Remove the vector that is nearest to a click, if one is near."""
        guide, picker = self.desk.document.guide, self.stage.picker
        if guide is None or picker is None:
            return
        view = self.stage.view()
        away = np.linalg.norm(picker.pixels(view, guide.positions)[:, :2] - event.pixel, axis=1)
        away[~picker.visible(view, guide.positions) | np.isnan(away)] = np.inf
        nearest = int(away.argmin())
        if away[nearest] > NEAR:
            return
        kept = np.arange(len(away)) != nearest
        self._set(
            Guide(guide.positions[kept].copy(), guide.directions[kept].copy())
            if kept.any()
            else None
        )


def _joined(guide: Guide | None, place: F8, direction: F8) -> Guide:
    if guide is None:
        return Guide(place, direction)
    return Guide(
        np.concatenate([guide.positions, place]), np.concatenate([guide.directions, direction])
    )


def _job(canvas: Canvas, guide: Guide | None) -> Job:
    """Make what is shown of a canvas's own field, or of one that a guide would give."""
    prepared, same = canvas.prepared, guide is canvas.guide

    def job(progress: Progress, report: Report) -> Shown:
        from btfcore.field import orientation_field

        found = prepared.field
        if not same:
            found = orientation_field(prepared.dense, prepared.mesh, guide=guide, progress=progress)
        return shown_of(prepared.dense, found)

    return job
