"""What the tools of the window are set to, as one frozen value."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from btfcore.errors import InvalidEdit, InvalidParameter
from btfcore.paint.edits import ORIENTATIONS, Orientation, Symmetry

TOOLS = (
    "view", "orient", "synthesize", "paint", "stamp", "erase", "repair", "requilt", "protect",
    "light", "pick", "measure",
)  # fmt: skip
STROKES = ("paint", "erase", "repair", "requilt", "protect")  # tools that are brushes
SHARE = 0.05  # of the mesh's diagonal: the radius of a brush that was not set


def _within(name: str, value: float, low: float, high: float) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        raise InvalidParameter(f"{name} is {value:g}, outside {low:g} … {high:g}")


@dataclass(frozen=True)
class ToolOptions:
    """Of all painting tools; lengths in world units. Raises `InvalidParameter`.

    radius : of the brush at full pressure; 0: a share of the mesh's diagonal. hardness, weight
    (λ), transition, orientation, protect: see `btfcore.paint.edits`. sample : a file of the
    library, the name of one of the painting's samples, or None: the background's. feature,
    turn (degrees), scale : of stamps. tries : of requilting. mirror, radial, axis : symmetry.
    erase_protection : the brush of protection takes it away.
    """

    radius: float = 0.0
    hardness: float = 1.0
    transition: float | None = None
    weight: float = 0.5
    sample: Path | str | None = None
    feature: int | None = 0
    turn: float = 0.0
    scale: float = 1.0
    orientation: Orientation = "auto"
    protect: bool = True
    seed: int = 0
    tries: int = 12
    mirror: str = ""
    radial: int = 1
    axis: Literal["x", "y", "z"] = "y"
    erase_protection: bool = False

    def __post_init__(self) -> None:
        """Check every range, naming the option and its value."""
        _within("the radius of the brush", self.radius, 0.0, 1e300)
        _within("the hardness of the brush", self.hardness, 0.0, 1.0)
        if self.transition is not None:
            _within("the transition width", self.transition, 0.0, 1e300)
        _within("the weight of the constraint", self.weight, 0.0, 1e3)
        _within("the turn of the stamp", self.turn, -1e6, 1e6)
        _within("the scale of the stamp", self.scale, 0.05, 20.0)
        _within("the seed", self.seed, 0, 2**32 - 1)
        _within("the tries", self.tries, 1, 10_000)
        if self.feature is not None:
            _within("the feature", self.feature, 0, 2**31)
        if self.orientation not in ORIENTATIONS:
            raise InvalidParameter(
                f"the orientation is {self.orientation!r}; there are {', '.join(ORIENTATIONS)}"
            )
        try:
            self.symmetry()
        except InvalidEdit as error:
            raise InvalidParameter(str(error)) from None

    def symmetry(self) -> Symmetry:
        """The images that are made along; raises `InvalidEdit`."""
        return Symmetry(self.mirror, self.radial, self.axis)


@dataclass(frozen=True)
class StrokeSpec:
    """What a stroke does: one of `STROKES`, with the options it began with."""

    kind: str = "paint"
    options: ToolOptions = ToolOptions()

    def __post_init__(self) -> None:
        """Refuse a kind that there is not."""
        if self.kind not in STROKES:
            raise InvalidParameter(
                f"the stroke is of kind {self.kind!r}; there are {', '.join(STROKES)}"
            )
