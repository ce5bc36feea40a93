"""Strokes as a signed geodesic distance that grows with them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from btfcore.errors import InvalidEdit
from btfcore.paint.edits import Stroke
from btfcore.paint.geodesic import press, unreached
from btfcore.paint.locate import Locator
from btfcore.patch.connectivity import Connectivity
from btfcore.types import F4, F8, I4, Frozen

SPACING = 0.25  # between dabs, in radii
CLOSEST = 0.5  # between dabs, in steps
MARGIN = 1.0  # steps that a march goes on beyond what is asked, so that the last are exact


@dataclass(frozen=True, eq=False)
class Dabs(Frozen):
    """Where the brush touched the surface, in the order of the stroke, and what that changed.

    vertex (n,) i4: dense vertex nearest to each dab; position (n, 3) f8: the dab's middle on
    the surface, in world units; radius (n,) f8 and arc (n,) f8: radius, and way from the
    stroke's first point, in dense-mesh steps; direction (n, 3) f8: unit, of the stroke in
    space at the dab, zeros for a stroke of one point; stroke (n,) i4: number of the stroke.
    lowered (k,) i4: vertices whose distance became smaller, ascending. skipped: dabs that met
    no surface; weightless: dabs of no pressure.
    """

    vertex: I4
    position: F8
    radius: F8
    arc: F8
    direction: F8
    stroke: I4
    lowered: I4
    skipped: int = 0
    weightless: int = 0

    def __len__(self) -> int:
        """Return how many dabs there are."""
        return len(self.vertex)

    @staticmethod
    def none() -> Dabs:
        """No dabs at all."""
        void, places = np.zeros(0, np.int32), np.zeros((0, 3))
        return Dabs(void, places, np.zeros(0), np.zeros(0), places.copy(), void.copy(), void.copy())

    @staticmethod
    def joined(parts: Sequence[Dabs]) -> Dabs:
        """All parts one after another."""
        if not parts:
            return Dabs.none()
        return Dabs(
            np.concatenate([part.vertex for part in parts]),
            np.concatenate([part.position for part in parts]),
            np.concatenate([part.radius for part in parts]),
            np.concatenate([part.arc for part in parts]),
            np.concatenate([part.direction for part in parts]),
            np.concatenate([part.stroke for part in parts]),
            np.unique(np.concatenate([part.lowered for part in parts])),
            sum(part.skipped for part in parts),
            sum(part.weightless for part in parts),
        )


class BrushField:
    """Signed geodesic distance ψ to the edge of all that strokes have covered so far.

    ψ(p) = min over dabs of (distance of p to the dab's middle along the surface - its radius),
    in dense-mesh steps: negative inside. Dabs stand along the polyline at every quarter of the
    radius there, found from the points alone: however the points of a stroke are dealt out
    to `extend`, dabs and ψ are the same bits. A dab that falls on no surface is left out and
    counted; one whose middle lies outside an open mesh's border still reaches over it.
    """

    def __init__(self, net: Connectivity, locator: Locator, *, reach: float = 0.0) -> None:
        """Begin with nothing; ψ is kept up to `reach` steps outside the edge."""
        self.net, self.locator, self.reach = net, locator, reach
        self.value: F4 = unreached(net)
        """ψ (N,) f4, +inf where no dab came near."""
        self.strokes = 0
        self._own = unreached(net)
        self._radius = 0.0
        self._open = False
        self._low = locator.low - locator.tolerance
        self._high = locator.high + locator.tolerance

    def paint(self, stroke: Stroke) -> Dabs:
        """Add a whole stroke."""
        self.begin(stroke.radius)
        return Dabs.joined(
            [self.extend(stroke.points, stroke.normals, stroke.pressure), self.finish()]
        )

    def begin(self, radius: float) -> None:
        """Begin a stroke of `radius` world units at full pressure; ends one that is open."""
        if self._open:
            self.finish()
        self._radius, self._open = radius, True
        self._last: tuple[F8, F8, float] | None = None
        self._arc = self._due = 0.0  # way to the last point, and to the next dab; world units
        self._latest = -math.inf  # where the last dab stands
        self._ahead: F8 = np.zeros(3)
        self.strokes += 1

    def extend(self, points: F8, normals: F8 | None = None, pressure: F8 | None = None) -> Dabs:
        """Add the next points (n, 3) of the stroke; its first dab waits for a second point.

        normals (n, 3) and pressure (n,) as in `Stroke`. Raises `InvalidEdit` for arrays of
        other shapes or values, and without an open stroke.
        """
        if not self._open:
            raise InvalidEdit("points for a stroke that was not begun")
        if len(points) == 0:
            return Dabs.none()
        part = Stroke(
            np.array(points, np.float64),
            self._radius,
            None if normals is None else np.array(normals, np.float64),
            None if pressure is None else np.array(pressure, np.float64),
        )
        sides = np.zeros_like(part.points) if part.normals is None else part.normals
        force = np.ones(len(sides)) if part.pressure is None else part.pressure
        due: list[_Due] = []
        skipped = 0
        for point, side, push in zip(part.points, sides, force, strict=True):
            skipped += self._advance(point, side, float(push), due)
        return self._put(due, skipped)

    def finish(self) -> Dabs:
        """End the stroke with a dab on its last point."""
        due: list[_Due] = []
        if self._open and self._last is not None:
            point, side, push = self._last
            # the last dab may stand there already, or so near that another adds nothing
            if self._arc - self._latest > 1e-3 * self._spacing(push):
                due.append(_Due(point, side, push * self._radius, self._arc, self._ahead))
        self._open, self._last = False, None
        return self._put(due, 0)

    def _spacing(self, push: float) -> float:
        return max(SPACING * push * self._radius, CLOSEST * self.locator.step)

    def _advance(self, point: F8, side: F8, push: float, due: list[_Due]) -> int:
        """List the dabs up to the next point; returns how many fall outside the mesh's box."""
        if self._last is None:
            self._last = (point, side, push)
            return 0
        begin, begin_side, begin_push = self._last
        length = float(np.linalg.norm(point - begin))
        if length == 0.0:
            # a pen that is set down gains pressure before it moves
            self._last = (point, side, push if self._ahead.any() else max(push, begin_push))
            return 0
        self._ahead = (point - begin) / length
        enter, leave = self._in_box(begin, point)
        skipped = self._jump(self._arc + enter * length)
        end = self._arc + length
        while self._due <= self._arc + leave * length:
            t = (self._due - self._arc) / length
            force = begin_push + t * (push - begin_push)
            due.append(
                _Due(
                    begin + t * (point - begin), begin_side + t * (side - begin_side),
                    force * self._radius, self._due, self._ahead,
                )
            )  # fmt: skip
            self._latest = self._due
            self._due += self._spacing(force)
        skipped += self._jump(end)
        self._arc, self._last = end, (point, side, push)
        return skipped

    def _in_box(self, begin: F8, end: F8) -> tuple[float, float]:
        """Share of the way from `begin` to `end` where it enters and leaves the mesh's box."""
        low, high = self._low, self._high
        if ((low <= begin) & (begin <= high) & (low <= end) & (end <= high)).all():
            return 0.0, 1.0
        with np.errstate(divide="ignore", invalid="ignore"):
            one = (low - begin) / (end - begin)
            two = (high - begin) / (end - begin)
        flat = end == begin
        inside = (begin >= low) & (begin <= high)
        one = np.where(flat, np.where(inside, -np.inf, np.inf), one)
        two = np.where(flat, np.inf, two)
        enter = float(np.clip(np.minimum(one, two).max(), 0.0, 1.0))
        leave = float(np.clip(np.maximum(one, two).min(), 0.0, 1.0))
        return enter, leave if leave > enter else -1.0

    def _jump(self, until: float) -> int:
        """Step over dabs before `until` without looking at each; returns how many."""
        if self._due >= until:
            return 0
        spacing = self._spacing(1.0)
        count = int(np.ceil((until - self._due) / spacing))
        self._due += count * spacing
        return count

    def _put(self, due: list[_Due], skipped: int) -> Dabs:
        """Press the dabs on the surface, one after another."""
        heavy = [dab for dab in due if dab.radius > 0]
        weightless = len(due) - len(heavy)
        if not heavy:
            return replace(Dabs.none(), skipped=skipped, weightless=weightless)
        feet = self.locator.nearest(
            np.array([dab.point for dab in heavy]), np.array([dab.side for dab in heavy])
        )
        step = self.locator.step
        radius = np.array([dab.radius for dab in heavy]) / step
        met = (feet.distance <= self.locator.tolerance) & (feet.beyond < radius)
        lowered = [np.zeros(0, np.int32)]
        for index in np.flatnonzero(met):
            lowered.append(
                press(
                    self.net, self.value, self._own, feet.corner[index], feet.start[index],
                    radius[index], self.reach + MARGIN,
                )
            )  # fmt: skip
        return Dabs(
            feet.vertex[met],
            feet.position[met],
            radius[met],
            np.array([dab.arc for dab in heavy])[met] / step,
            np.array([dab.direction for dab in heavy])[met],
            np.full(int(met.sum()), self.strokes - 1, np.int32),
            np.unique(np.concatenate(lowered)),
            skipped + int((~met).sum()),
            weightless,
        )


@dataclass(frozen=True, eq=False)
class _Due:
    """A dab that is to be put: where, its radius and way along the stroke in world units."""

    point: F8
    side: F8
    radius: float
    arc: float
    direction: F8
