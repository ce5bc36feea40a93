"""The brush that takes features away: the background comes back."""

from __future__ import annotations

from app.tools.brush import SurfaceBrush


class EraseBrush(SurfaceBrush):
    """Brings the background back where it was drawn, once the stroke ends."""

    name = kind = "erase"
    colour = (255, 150, 140)
