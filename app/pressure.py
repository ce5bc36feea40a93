"""How hard the pen must press: a curve from the pen's pressure to the tool's."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from btfcore.errors import InvalidParameter

MOST_POINTS = 12
CLOSEST = 0.01  # between the inputs of two points


@dataclass(frozen=True)
class Curve:
    """A curve through 2 … 12 points (input, output), each from 0 to 1, that never falls.

    Between the points it is the monotone cubic of Fritsch and Carlson ("Monotone piecewise cubic
    interpolation", SIAM J. Numer. Anal. 17, 1980), so it does not swing; outside it is flat.
    Raises `InvalidParameter` where points leave 0 … 1, fall, or are closer than 0.01.
    """

    points: tuple[tuple[float, float], ...] = ((0.0, 0.0), (1.0, 1.0))

    def __post_init__(self) -> None:  # noqa: D105
        if not 2 <= len(self.points) <= MOST_POINTS:
            raise InvalidParameter(
                f"the pressure curve has {len(self.points)} points, not 2 … {MOST_POINTS}"
            )
        for point in self.points:
            if not all(0.0 <= each <= 1.0 for each in point):  # NaN fails too
                raise InvalidParameter(f"the pressure curve has {point}, outside 0 … 1")
        for (x, y), (right, above) in zip(self.points, self.points[1:], strict=False):
            if right - x < CLOSEST - 1e-9:
                raise InvalidParameter(f"the pressure curve has {right} close to or before {x}")
            if above < y:
                raise InvalidParameter(f"the pressure curve falls from {y} to {above} at {right}")

    def __call__(self, pressure: float) -> float:
        """Pressure 0 … 1 of the tool where the pen reports `pressure`; NaN counts as 0."""
        points = self.points
        if not pressure > points[0][0]:
            return points[0][1]
        if pressure >= points[-1][0]:
            return points[-1][1]
        at = next(i for i in range(len(points) - 1) if pressure < points[i + 1][0])
        (x, y), (right, above) = points[at], points[at + 1]
        width = right - x
        t = (pressure - x) / width
        m, n = self._slopes[at] * width, self._slopes[at + 1] * width
        a, b = y - above, m + n
        value = y + t * (m + t * (-3 * a - m - b + t * (2 * a + b)))
        return min(max(value, y), above)

    @cached_property
    def _slopes(self) -> tuple[float, ...]:
        points = self.points
        pairs = zip(points, points[1:], strict=False)
        rises = [(d - b) / (c - a) for (a, b), (c, d) in pairs]
        slopes = [rises[0], *((a + b) / 2 for a, b in zip(rises, rises[1:], strict=False))]
        slopes.append(rises[-1])
        for i, rise in enumerate(rises):
            if rise == 0.0:
                slopes[i] = slopes[i + 1] = 0.0
                continue
            length = math.hypot(slopes[i] / rise, slopes[i + 1] / rise)
            if length > 3.0:  # the circle inside which the cubic is monotone
                slopes[i] *= 3.0 / length
                slopes[i + 1] *= 3.0 / length
        return tuple(slopes)

    def text(self) -> str:
        """Points as text, which `parse` reads: "0,0;0.5,0.2;1,1"."""
        return ";".join(f"{x:.6g},{y:.6g}" for x, y in self.points)

    @classmethod
    def parse(cls, text: str) -> Curve:
        """Read what `text` wrote; raises `InvalidParameter` where it is none."""
        pieces = text[:400].split(";")
        try:
            pairs = [tuple(float(each) for each in piece.split(",")) for piece in pieces]
            return cls(tuple((x, y) for x, y in pairs))
        except ValueError:
            raise InvalidParameter(f"{text[:40]!r} is no pressure curve") from None


LINEAR = Curve()
SOFT = Curve(((0.0, 0.0), (0.25, 0.5), (1.0, 1.0)))  # a light hand reaches everything
FIRM = Curve(((0.0, 0.0), (0.5, 0.25), (1.0, 1.0)))
