"""A stroke that is painted while it is drawn: begin, extend, then finish or cancel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from btfcore.errors import InvalidEdit
from btfcore.paint.edits import MOST_POINTS, Edit, PaintEdit, Stroke
from btfcore.paint.engine import Engine, Result
from btfcore.paint.foreground import Painter
from btfcore.paint.outcome import painted
from btfcore.progress import Progress, silent
from btfcore.types import F4, F8, I4

AT_ONCE = 64  # points of a stroke between two calls of progress


class Session:
    """Paints the last stroke of an edit as its points come in.

    What it leaves is what replaying the finished edit gives, bit for bit.
    """

    def __init__(self, engine: Engine, edit: Edit, done: Callable[[Edit, Result], None]) -> None:
        """Begin with the strokes that `edit` has; `done` is told the result."""
        if not isinstance(edit, PaintEdit) or not edit.area.strokes:
            raise InvalidEdit("only a paint edit with a stroke can be drawn live")
        self._engine, self._edit, self._done = engine, edit, done
        self._open = True
        engine.start(edit.uid)
        try:
            self._painter = Painter(engine, edit)
            *earlier, last = edit.area.strokes
            for stroke in earlier:
                draw(self._painter, stroke)
            self._painter.begin(last)
            self._points = [(last.points, last.normals, last.pressure)]
            self._painter.extend(last.points, last.normals, last.pressure)
        except BaseException:
            engine.cancel()
            raise

    @property
    def wanted(self) -> F4:
        """m_0 (N,) f4 that the edit asks for so far; read it, and copy it to keep it."""
        return self._painter.wanted

    @property
    def changed(self) -> I4:
        """Vertices (n,) i4 written so far, in no order."""
        return self._engine.recorder.changed

    def extend(
        self,
        points: F8,
        normals: F8 | None = None,
        pressure: F8 | None = None,
        *,
        lifted: bool = False,
    ) -> I4:
        """Draw on through `points` (n, 3); returns the vertices that changed.

        normals and pressure are given in every call or in none, as with the first point. lifted:
        the brush was lifted before, so another stroke of the same edit begins here.
        Raises `InvalidEdit` for points that make no sense; the session goes on without them.
        """
        self._check()
        if np.size(points) == 0:
            return np.zeros(0, np.int32)
        last = self._edit.area.strokes[-1]
        part = Stroke(
            np.array(points, np.float64).reshape(-1, 3), last.radius,
            None if normals is None else np.array(normals, np.float64).reshape(-1, 3),
            None if pressure is None else np.array(pressure, np.float64).reshape(-1),
            last.hardness,
        )  # fmt: skip
        for name, one, other in (
            ("normals", part.normals, last.normals), ("pressure", part.pressure, last.pressure),
        ):  # fmt: skip
            if (one is None) != (other is None):
                raise InvalidEdit(f"{name} must be given for all points of a stroke or for none")
        if sum(len(each[0]) for each in self._points) + len(part.points) > MOST_POINTS:
            raise InvalidEdit(f"the stroke has more than {MOST_POINTS:,} points; finish it")
        try:
            changed = self._next(part) if lifted else []
            self._points.append((part.points, part.normals, part.pressure))
            changed += self._painter.extend(part.points, part.normals, part.pressure)
            return _union(changed)
        except BaseException:
            self.cancel()
            raise

    def finish(self, *, progress: Progress = silent) -> I4:
        """End the stroke and fill what it left; returns all vertices that the edit changed.

        Where `progress` raises `Cancelled`, the session is cancelled.
        """
        self._check()
        edit = self._edit = self._whole()
        try:
            self._painter.end()
            result = painted(self._engine, self._painter, edit, progress)
        except BaseException:
            self.cancel()
            raise
        self._open = False
        self._done(edit, result)
        return result.delta.vertices

    def cancel(self) -> None:
        """Take back everything; the document is as it was before the stroke."""
        if self._open:
            self._open = False
            self._engine.cancel()

    def _next(self, part: Stroke) -> list[I4]:
        """End the last stroke and begin another one."""
        edit = self._whole()
        changed = self._painter.end()
        self._painter.begin(part)
        strokes = (*edit.area.strokes, part)
        self._edit = replace(edit, area=replace(edit.area, strokes=strokes))
        self._points = []
        return changed

    def _whole(self) -> PaintEdit:
        """The edit with all points of its last stroke."""
        points = np.concatenate([part[0] for part in self._points])
        normals, pressure = (_joined([part[column] for part in self._points]) for column in (1, 2))
        *earlier, last = self._edit.area.strokes
        whole = replace(last, points=points, normals=normals, pressure=pressure)
        return replace(self._edit, area=replace(self._edit.area, strokes=(*earlier, whole)))

    def _check(self) -> None:
        if not self._open:
            raise InvalidEdit("the stroke is finished or cancelled already")


def draw(painter: Painter, stroke: Stroke, progress: Progress = silent) -> None:
    """Draw a whole stroke; the painter does not care how its points are dealt out."""
    painter.begin(stroke)
    for begin in range(0, len(stroke.points), AT_ONCE):
        progress(begin / len(stroke.points), "painting")
        part = slice(begin, begin + AT_ONCE)
        painter.extend(
            stroke.points[part],
            None if stroke.normals is None else stroke.normals[part],
            None if stroke.pressure is None else stroke.pressure[part],
        )
    painter.end()


def _joined(parts: list[F8 | None]) -> F8 | None:
    """All parts in a row; None where they are None."""
    given = [part for part in parts if part is not None]
    return np.concatenate(given) if given else None


def _union(parts: list[I4]) -> I4:
    return np.unique(np.concatenate([np.zeros(0, np.int32), *parts]))
