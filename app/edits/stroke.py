"""A stroke on its way from the pointer to the engine: nothing of it waits for the other end."""

from __future__ import annotations

import queue
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.edits.easel import Easel
from app.edits.timeline import Chapter
from app.tool_options import StrokeSpec
from btfcore.errors import Cancelled, InvalidEdit
from btfcore.paint.brush import BrushField
from btfcore.paint.edits import (
    AnyEdit,
    Area,
    EraseEdit,
    PaintEdit,
    RepairEdit,
    RequiltEdit,
    Stroke,
)
from btfcore.paint.engine import Engine
from btfcore.paint.region import target, zone
from btfcore.paint.symmetry import origin_of, transforms
from btfcore.progress import Progress, between
from btfcore.types import F4, F8, I4

LOOK_S = 0.02  # between two looks whether the stroke was cancelled
AT_ONCE = 6  # points between two pictures


@dataclass(frozen=True, eq=False)
class Points:
    """Part of a stroke: positions (n, 3) f8 in world units, normals (n, 3), pressure (n,).

    lifted : the brush was lifted before, so another stroke of the same edit begins here.
    """

    place: F8
    normals: F8 | None = None
    pressure: F8 | None = None
    lifted: bool = False

    def some(self, which: slice | NDArray[np.bool_]) -> Points:
        """Return those of `which`."""
        return Points(
            self.place[which],
            None if self.normals is None else self.normals[which],
            None if self.pressure is None else self.pressure[which],
            self.lifted,
        )

    def stroke(self, radius: float, hardness: float) -> Stroke:
        """As the engine wants it; raises `InvalidEdit`."""
        return Stroke(self.place, radius, self.normals, self.pressure, hardness)


def points(position: object, normals: object = None, pressure: object = None) -> Points:
    """Points from anything like arrays; a single one may come without its first axis."""
    place = np.array(position, np.float64).reshape(-1, 3)
    sides = None if normals is None else np.array(normals, np.float64).reshape(-1, 3)
    force = None if pressure is None else np.array(pressure, np.float64).reshape(-1)
    return Points(place, sides, force)


def joined(parts: list[Points]) -> Points:
    """All parts in a row; raises `InvalidEdit` where only some have normals or pressure."""
    columns = []
    for name in ("normals", "pressure"):
        given = [getattr(each, name) for each in parts]
        some = [each for each in given if each is not None]
        if some and len(some) < len(given):
            raise InvalidEdit(f"{name} must be given for all points of a stroke or for none")
        columns.append(np.concatenate(some) if some else None)
    sides, force = columns
    return Points(np.concatenate([each.place for each in parts]), sides, force)


class Feed:
    """The points of one stroke, put in by the window's thread and taken out by the worker."""

    def __init__(self, spec: StrokeSpec, radius: float, first: Points) -> None:
        """Begin with `first`; radius: of the brush in world units."""
        self.spec, self.radius, self.first = spec, radius, first
        self.cancelled = False
        self._queue: queue.SimpleQueue[Points | None] = queue.SimpleQueue()

    def add(self, more: Points) -> None:
        """Go on."""
        self._queue.put(more)

    def finish(self) -> None:
        """No more points come."""
        self._queue.put(None)

    def cancel(self) -> None:
        """The stroke is not wanted."""
        self.cancelled = True
        self._queue.put(None)

    def parts(self, progress: Progress, idle: Callable[[], None]) -> Iterator[Points]:
        """Give the points after the first as they come, and call `idle` while none do.

        Raises `Cancelled`.
        """
        while True:
            try:
                more = self._queue.get(timeout=LOOK_S)
            except queue.Empty:
                idle()
                progress(0.0, "painting")
                continue
            progress(0.0, "painting")
            if self.cancelled:
                raise Cancelled
            if more is None:
                return
            for begin in range(0, len(more.place), AT_ONCE):
                part = more.some(slice(begin, begin + AT_ONCE))
                yield replace(part, lifted=more.lifted and begin == 0)
                progress(0.0, "painting")


def paint(chapter: Chapter, feed: Feed, sample: int, easel: Easel, progress: Progress) -> I4:
    """Paint a stroke while it is drawn; returns the vertices (n,) i4 that it changed.

    Whatever interrupts it, the painting is as it was and shown so.
    """
    assert chapter.painting is not None
    document, spec = chapter.painting.document, feed.spec
    area = Area(strokes=(feed.first.stroke(feed.radius, spec.options.hardness),))
    session = document.begin(paint_edit(spec, area, sample))
    try:
        easel.show(session.changed, session.wanted)
        for part in feed.parts(progress, easel.flush):
            changed = session.extend(part.place, part.normals, part.pressure, lifted=part.lifted)
            easel.offer(changed, session.wanted)
        easel.flush()  # the whole area, before what it still lacks is computed
        rest = between(progress, 0.05, 1.0)
        changed = session.finish(progress=easel.watching(rest, session.wanted))
    except BaseException:
        session.cancel()
        easel.mend()
        raise
    easel.show(changed)
    return changed


def collect(
    chapter: Chapter, feed: Feed, easel: Easel, progress: Progress
) -> tuple[tuple[Stroke, ...], F4]:
    """Show the area of strokes while they are drawn; returns the strokes and their m_0 (N,)."""
    assert chapter.painting is not None
    engine = chapter.painting.document.engine
    options = feed.spec.options
    brushes = _Brushes(engine, feed)
    strokes = [[feed.first]]
    nothing = np.zeros(0, np.int32)
    try:
        brushes.extend(feed.first)
        easel.show(nothing, brushes.wanted)
        for part in feed.parts(progress, easel.flush):
            if part.lifted:
                brushes.finish()
                brushes.begin()
                strokes.append([])
            strokes[-1].append(part)
            brushes.extend(part)
            easel.offer(nothing, brushes.wanted)
        brushes.finish()
        easel.show(nothing, brushes.wanted)
        made = tuple(joined(parts).stroke(feed.radius, options.hardness) for parts in strokes)
        return made, brushes.wanted
    except BaseException:
        easel.show(nothing)
        raise


class _Brushes:
    """The growing area of a stroke and its images."""

    def __init__(self, engine: Engine, feed: Feed) -> None:
        options = feed.spec.options
        reach = feed.radius / engine.step
        width = 0.0 if options.transition is None else options.transition / engine.step
        self._zone = zone(reach, options.hardness, min(width, reach))
        self.wanted: F4 = np.zeros(len(engine.state.patch), np.float32)
        symmetry = options.symmetry()
        self._origin = origin_of(symmetry, engine.prepared.mesh)
        self._images = []
        for matrix in transforms(symmetry):
            brush = BrushField(engine.net, engine.locator, reach=self._zone / 2)
            self._images.append((matrix, brush))
        self._radius = feed.radius
        self.begin()

    def begin(self) -> None:
        for _, brush in self._images:
            brush.begin(self._radius)

    def extend(self, part: Points) -> None:
        for matrix, brush in self._images:
            place = self._origin + np.einsum("ij,nj->ni", matrix, part.place - self._origin)
            sides = part.normals
            if sides is not None:
                sides = np.einsum("ij,nj->ni", matrix, sides)
            self._take(brush, brush.extend(place, sides, part.pressure).lowered)

    def finish(self) -> None:
        for _, brush in self._images:
            self._take(brush, brush.finish().lowered)

    def _take(self, brush: BrushField, lowered: I4) -> None:
        asked = target(brush.value[lowered], self._zone)
        self.wanted[lowered] = np.maximum(self.wanted[lowered], asked)


def paint_edit(spec: StrokeSpec, area: Area, sample: int) -> PaintEdit:
    """Paint `area` as the options say."""
    options = spec.options
    return PaintEdit(
        area=area, sample=sample, weight=options.weight, transition=options.transition,
        orientation=options.orientation, protect=options.protect, seed=options.seed,
        symmetry=options.symmetry(),
    )  # fmt: skip


def area_edit(spec: StrokeSpec, area: Area) -> AnyEdit:
    """Erase, repair or requilt `area`."""
    options = spec.options
    if spec.kind == "erase":
        return EraseEdit(area=area, seed=options.seed, symmetry=options.symmetry())
    if spec.kind == "repair":
        return RepairEdit(
            area=area, protect=options.protect, seed=options.seed, symmetry=options.symmetry()
        )
    if spec.kind == "requilt":
        return RequiltEdit(
            area=area, tries=options.tries, seed=options.seed, symmetry=options.symmetry()
        )
    raise InvalidEdit(f"an area cannot be edited by {spec.kind!r}")


def spared(area_of: F4, protected: NDArray[np.bool_], rate: int) -> Area:
    """The vertices that are wanted more than not and not protected; raises `InvalidEdit`."""
    chosen = np.flatnonzero((area_of > 0.5) & ~protected).astype(np.int32)
    if not len(chosen):
        raise InvalidEdit("all of the area is protected; take protection away first")
    return Area(vertices=chosen, rate=rate)
