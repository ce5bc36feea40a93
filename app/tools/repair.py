"""Brushes that mend the quilt itself: synthesise anew, or cut the seams again."""

from __future__ import annotations

from app.tools.brush import SurfaceBrush


class RepairBrush(SurfaceBrush):
    """Synthesises anew what was drawn over, once the stroke ends."""

    name = kind = "repair"
    colour = (150, 230, 160)


class RequiltBrush(SurfaceBrush):
    """Looks for better seams where it was drawn, once the stroke ends."""

    name = kind = "requilt"
    colour = (150, 200, 255)
