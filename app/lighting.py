"""What the surface in the window is lit by."""

from __future__ import annotations

from dataclasses import dataclass

from btfcore.render.importance import LightTree


@dataclass(frozen=True)
class Lamp:
    """A distant light: unit direction towards it in scene coordinates, linear colour, strength."""

    direction: tuple[float, float, float] = (0.45, 0.55, 0.705)
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    strength: float = 1.0


@dataclass(frozen=True)
class Lighting:
    """What the surface is lit by and how its radiance is shown.

    lamps: `main` is the one that dragging moves. exposure in stops; curve: one of those of
    `btfcore.render.tonemap`. environment: light from all around, of the file `source`, turned
    by `turn` degrees. shadows: lamps cast shadows between parts of the mesh.
    """

    lamps: tuple[Lamp, ...] = (Lamp(),)
    main: int = 0
    exposure: float = 0.0
    curve: str = "clip"
    environment: LightTree | None = None
    source: str = ""
    turn: float = 0.0
    shadows: bool = False
