"""What all brushes share: the ring under the pointer, and strokes without gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.tools.base import PointerEvent, Tool
from app.tools.marks import LIGHT, Colour, Line, Mark, Marks, Ring
from app.tools.trail import Run, Trail
from btfcore.types import F8

SPACING = 0.25  # of the brush's radius, between two samples
TAIL = 400  # samples of the present drag's way that are drawn


@dataclass(frozen=True)
class Brush:
    """A brush: radius in world units at full pressure, hardness 0–1.

    sized : the pressure of a pen scales the radius.
    """

    radius: float
    hardness: float = 1.0
    sized: bool = True


class StrokeTool(Tool):
    """A tool that is drawn with; a brush needs `brush` and the four verbs of strokes.

    A drag is one step of undo, and holds more than one stroke where it jumps over a silhouette.
    """

    colour: Colour = LIGHT
    trace = True  # the way of the present drag is drawn

    def brush(self) -> Brush:
        """Return the brush as it is set now; a drag keeps the one that it began with.

        Of radius 1 where a tool does not say otherwise.
        """
        return Brush(1.0)

    def begin_stroke(self, run: Run, brush: Brush) -> None:
        """Begin a stroke with the samples of `run`; the one before it, if any, is complete."""

    def extend_stroke(self, run: Run) -> None:
        """Draw the stroke on through the samples of `run`."""

    def finish_drag(self) -> None:
        """End the drag: its strokes are one step of undo. Not called where it left none."""

    def cancel_drag(self) -> None:
        """Take back all strokes of the drag. Not called where it left none."""

    # --- events

    _trail: Trail | None = None
    _brush = Brush(1.0)
    _lines: tuple[list[F8], ...] = ()  # positions of each stroke of the drag

    @property
    def drawing(self) -> bool:
        """Whether a drag has left a stroke so far."""
        return bool(self._lines)

    def press(self, event: PointerEvent) -> None:
        """Begin a drag; it may begin off the surface."""
        picker = self.stage.picker
        self._brush, self._lines = self.brush(), ()
        if picker is not None:
            self._trail = Trail(picker, SPACING * self._brush.radius)
            view = self.stage.view()
            self._take(self._trail.begin(view, event.pixel, self._pressure(event)))
        self._show(event)

    def drag(self, event: PointerEvent) -> None:
        """Draw on."""
        if self._trail is not None:
            view = self.stage.view()
            self._take(self._trail.move(view, event.pixel, self._pressure(event)))
        self._show(event)

    def release(self, event: PointerEvent) -> None:
        """Draw to the end and finish."""
        trail, self._trail = self._trail, None
        if trail is not None:
            # a pen that is lifted reports no pressure: its last one counts
            self._take(trail.end(self.stage.view(), event.pixel))
        if self._lines:
            self._lines = ()
            self.finish_drag()
        self._show(event)

    def cancel(self) -> None:
        """Take the drag back."""
        self._trail = None
        if self._lines:
            self._lines = ()
            self.cancel_drag()
        self.stage.draw(())

    def hover(self, event: PointerEvent) -> None:
        """Show the brush on the surface."""
        self._brush = self.brush()
        self._show(event)

    def leave(self) -> None:
        """Show no brush."""
        self.stage.draw(self._traces())

    def _pressure(self, event: PointerEvent) -> float:
        return event.pressure if self._brush.sized else 1.0

    def _take(self, runs: list[Run]) -> None:
        for run in runs:
            if run.joined and self._lines:
                self._lines[-1].append(run.hits.position)
                self.extend_stroke(run)
            else:
                self._lines = (*self._lines, [run.hits.position])
                self.begin_stroke(run, self._brush)

    def _traces(self) -> tuple[Mark, ...]:
        if not self.trace:
            return ()
        whole = (np.concatenate(parts[-TAIL:])[-TAIL:] for parts in self._lines)
        return tuple(Line(points, self.colour) for points in whole if len(points) > 1)

    def _show(self, event: PointerEvent) -> None:
        """Draw the brush's ring where it would paint, and the way of the drag."""
        marks, picker = self._traces(), self.stage.picker
        if picker is not None:
            hits = picker.pick(self.stage.view(), np.array([event.pixel], np.float64))
            if hits.on[0]:
                share = self._pressure(event) if self._trail is not None else 1.0
                radius = max(share, 0.02) * self._brush.radius
                ring = Ring(
                    hits.position[0], hits.normal[0], radius, self._brush.hardness, self.colour
                )
                marks = (*marks, *self.beside(ring), ring)
        self.stage.draw(marks)

    def beside(self, ring: Ring) -> Marks:
        """What is drawn beside the ring of the brush."""
        return ()
