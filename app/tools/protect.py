"""The brush that keeps a part of the surface from being edited, or gives it free."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PyQt6.QtCore import QObject

from app.tools.base import Stage
from app.tools.brush import SurfaceBrush
from app.tools.desk import Desk
from app.tools.directions import spread
from app.tools.marks import Dots, Marks
from btfcore.types import F8, DenseMesh

SHOWN = 80  # dots along the edge of what is protected
EDGE = (120, 210, 255)


class ProtectBrush(SurfaceBrush):
    """Protects what was drawn over, or with the option `erase_protection` gives it free."""

    name = kind = "protect"
    colour = EDGE

    def __init__(self, stage: Stage, desk: Desk, parent: QObject | None = None) -> None:
        """See `SurfaceBrush`."""
        super().__init__(stage, desk, parent)
        self._known: tuple[object, object, Marks] = (None, None, ())
        desk.document.stroke_changed.connect(self._renew)
        self._active = False

    def backdrop(self) -> Marks:
        """Show the edge of what is protected, as dots."""
        self._active = True
        document = self.desk.document
        mask, canvas = document.protected, document.canvas
        if self._known[0] is not mask or self._known[1] is not canvas:
            marks: Marks = ()
            if mask is not None and canvas is not None:
                dense = canvas.prepared.dense
                if len(mask) == len(dense.vertices):
                    marks = (Dots(edge(dense, mask), EDGE, 5.0),)
            self._known = (mask, canvas, marks)
        return self._known[2]

    def put_away(self) -> None:
        """Show nothing."""
        self._active = False
        super().put_away()

    def _renew(self) -> None:
        """Show what a finished stroke has protected."""
        if self._active and not self.drawing and self._known[0] is not self.desk.document.protected:
            self.stage.draw(self.backdrop())


def edge(dense: DenseMesh, mask: NDArray[np.bool_], most: int = SHOWN) -> F8:
    """Positions (n, 3) along the edge of `mask` (N,), evenly spread, at most `most`."""
    inside = mask[dense.faces]
    mixed = inside.any(axis=1) & ~inside.all(axis=1)
    points = np.asarray(dense.vertices[np.unique(dense.faces[mixed][inside[mixed]])], np.float64)
    if not len(points):
        return points
    gap = 3.0 * dense.step
    chosen = spread(points, gap)
    while len(chosen) > most:
        gap *= 1.25
        chosen = spread(points, gap)
    return points[chosen]
