"""The verbs of painting on the surface: strokes, areas and stamps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PyQt6.QtCore import QObject

from app.document import Document
from app.edits.base import EditsBase
from app.edits.easel import Easel
from app.edits.line import Entry
from app.edits.stroke import (
    Feed,
    area_edit,
    collect,
    paint,
    paint_edit,
    points,
    spared,
)
from app.edits.timeline import Chapter
from app.tasks import Job, Report, Tasks
from app.tool_options import STROKES, StrokeSpec, ToolOptions
from btfcore.errors import PatinaError
from btfcore.paint.edits import AnyEdit, Area, StampEdit, Symmetry
from btfcore.paint.region import constrain
from btfcore.progress import Progress, between
from btfcore.render.texture import vertex_colours
from btfcore.types import F4, I4, Quilt

Place = Sequence[float] | NDArray[np.floating]


class SurfaceEdits(EditsBase):
    """What happens at places of the surface."""

    def __init__(
        self,
        document: Document,
        work: Tasks,
        allowed: Callable[[], bool],
        parent: QObject | None = None,
    ) -> None:
        """See `EditsBase`."""
        super().__init__(document, work, allowed, parent)
        self._stroke: Entry | None = None
        self._sliding: Entry | None = None
        self._lifted = False  # the brush is, until its next point

    # --- strokes

    @property
    def drawing(self) -> bool:
        """A stroke is open."""
        return self._stroke is not None

    def begin_stroke(
        self, spec: StrokeSpec | None, hit: Any, pressure: float | None = None
    ) -> bool:
        """Begin a stroke at `hit`, which has a position and a normal, each (3,) or (1, 3).

        spec : None takes the document's tool and options. With pressure here every further
        point must have one. A stroke that is open is finished first.
        """
        self.finish_stroke()
        self._lifted = False
        if spec is None:
            tool = self.document.tool
            spec = StrokeSpec(tool if tool in STROKES else "paint", self.document.options)
        given = None if pressure is None else [pressure]
        first = points(hit.position, hit.normal, given)
        if not np.isfinite(first.place).all():
            return False
        feed = Feed(spec, spec.options.radius or self.document.radius, first)
        if spec.kind == "protect":
            self._stroke = self._protecting(spec, feed)
            return self._stroke is not None
        if spec.kind == "paint" and self.document.protected is None:
            act = self._live(spec, feed)
        else:
            act = self._collected(spec, feed)
        self._stroke = self.ask("stroke", act, label=spec.kind, kind=spec.kind, feed=feed)
        return self._stroke is not None

    def extend_stroke(self, more: Any, normals: Any = None, pressure: Any = None) -> None:
        """Go on through points (n, 3), normals (n, 3), pressure (n,); nothing without a stroke."""
        if self._stroke is None or self._stroke.feed is None:
            return
        part = points(more, normals, pressure)
        good = np.asarray(np.isfinite(part.place).all(axis=1))
        if good.all() and len(part.place):
            self._stroke.feed.add(replace(part, lifted=self._lifted))
        elif good.any():
            self._stroke.feed.add(replace(part.some(good), lifted=self._lifted))
        self._lifted = self._lifted and not good.any()

    def lift_stroke(self) -> None:
        """Let the brush be lifted: further points are another stroke of the same edit."""
        self._lifted = True

    def finish_stroke(self) -> None:
        """End the stroke; what it left to do is done in the background."""
        if self._stroke is not None and self._stroke.feed is not None:
            self._stroke.feed.finish()
        self._stroke = None

    def cancel_stroke(self) -> None:
        """Take the open stroke back; those before it stay."""
        entry, self._stroke = self._stroke, None
        if entry is not None and entry.feed is not None and not self.line.drop(entry):
            entry.feed.cancel()

    def _live(self, spec: StrokeSpec, feed: Feed) -> Callable[[Chapter, Easel, Progress], I4]:
        """What is done with a stroke that is painted while it is drawn."""
        mask = self._mask(spec.options)

        def act(chapter: Chapter, easel: Easel, progress: Progress) -> I4:
            ready = between(progress, 0.0, 0.02)
            number = chapter.sample(spec.options.sample, mask, progress=ready)
            return paint(chapter, feed, number, easel, progress)

        return act

    def _collected(self, spec: StrokeSpec, feed: Feed) -> Callable[[Chapter, Easel, Progress], I4]:
        """What is done with a stroke that is only an area until it ends."""
        protected, mask = self.document.protected, self._mask(spec.options)

        def act(chapter: Chapter, easel: Easel, progress: Progress) -> I4:
            assert chapter.painting is not None
            strokes, wanted = collect(chapter, feed, easel, progress)
            area, plain = Area(strokes=strokes), spec
            if protected is not None:
                area = spared(wanted, protected, chapter.painting.document.prepared.dense.size)
                plain = _plain(spec)
            return self._run(chapter, easel, progress, plain, area, mask)

        return act

    def _protecting(self, spec: StrokeSpec, feed: Feed) -> Entry | None:
        """A stroke that adds to what is protected, or takes from it."""

        def act(chapter: Chapter, easel: Easel, progress: Progress) -> F4:
            wanted = collect(chapter, feed, easel, progress)[1]
            easel.show(np.zeros(0, np.int32))
            return wanted

        def done(wanted: F4) -> None:
            inside, old = wanted > 0.5, self.document.protected
            old = np.zeros(len(wanted), np.bool_) if old is None else old
            more = not spec.options.erase_protection
            self.document.protect(old | inside if more else old & ~inside)
            self.document.show_stroke(None)

        return self.ask("stroke", act, feed=feed, done=done)

    # --- areas and stamps

    def fill(
        self, area: Area | None = None, kind: str = "paint", options: ToolOptions | None = None
    ) -> bool:
        """Paint, erase, repair or requilt an area; None: everywhere."""
        spec = StrokeSpec(kind, options or self.document.options)
        area = Area(everywhere=True) if area is None else area
        protected, mask = self.document.protected, self._mask(spec.options)

        def act(chapter: Chapter, easel: Easel, progress: Progress) -> I4:
            assert chapter.painting is not None
            here, plain = area, spec
            if protected is not None:
                engine = chapter.painting.document.engine
                found = constrain(area, engine.prepared.mesh, engine.net, engine.locator)
                wanted = found.spread(len(protected))
                here, plain = spared(wanted, protected, engine.prepared.dense.size), _plain(spec)
            return self._run(chapter, easel, progress, plain, here, mask)

        return self.ask(kind, act, label=kind, kind=kind) is not None

    def erase(self, area: Area | None = None, options: ToolOptions | None = None) -> bool:
        """Bring the background back in an area."""
        return self.fill(area, "erase", options)

    def repair(self, area: Area | None = None, options: ToolOptions | None = None) -> bool:
        """Synthesise an area anew."""
        return self.fill(area, "repair", options)

    def requilt(self, area: Area | None = None, options: ToolOptions | None = None) -> bool:
        """Cut the seams of an area again."""
        return self.fill(area, "requilt", options)

    def _run(
        self, chapter: Chapter, easel: Easel, progress: Progress, spec: StrokeSpec, area: Area,
        mask: F4 | None,
    ) -> I4:  # fmt: skip
        if spec.kind != "paint":
            return added(chapter, easel, progress, area_edit(spec, area))
        number = chapter.sample(spec.options.sample, mask, progress=between(progress, 0.0, 0.1))
        return added(chapter, easel, progress, paint_edit(spec, area, number))

    def protect(self, mask: NDArray[np.bool_] | None) -> None:
        """Let all further edits leave the dense vertices of `mask` (N,) alone; None: none."""
        self.document.protect(mask)

    def stamp(
        self, position: Place, normal: Place | None = None, options: ToolOptions | None = None
    ) -> bool:
        """Stamp the chosen sample's feature."""
        chosen = options or self.document.options
        mask = self._mask(chosen)
        self.clear_preview()

        def act(chapter: Chapter, easel: Easel, progress: Progress) -> I4:
            number = chapter.sample(chosen.sample, mask, progress=between(progress, 0.0, 0.1))
            edit = _stamp_edit(chosen, position, normal, number)
            return added(chapter, easel, progress, edit)

        return self.ask("stamp", act, label="stamp", kind="stamp") is not None

    def preview_stamp(
        self, position: Place, normal: Place | None = None, options: ToolOptions | None = None
    ) -> None:
        """Show where a stamp would lie once nothing else is to be done; the newest one wins."""
        chosen = options or self.document.options
        mask = self._mask(chosen)
        if self.timeline.now.painting is None or self.line.busy:
            return

        def prepare() -> Job | None:
            chapter = self.timeline.now
            if chapter.painting is None:
                return None

            def job(progress: Progress, report: Report) -> Any:
                try:
                    number = chapter.sample(chosen.sample, mask, progress=progress)
                    return _preview(chapter, _stamp_edit(chosen, position, normal, number))
                except PatinaError:  # beside the surface: there is nothing to show
                    return (), None

            return job

        def done(value: Any) -> None:
            if self._sliding is entry:
                self.document.show_preview(*value)

        entry = Entry("preview", prepare, self.tasks, light=True, done=done)
        self._sliding = entry
        self.line.glance(entry)

    def clear_preview(self) -> None:
        """Show no stamp any more."""
        self._sliding = None
        self.line.glance(None)
        self.document.show_preview((), None)

    def _mask(self, options: ToolOptions) -> F4 | None:
        sample = options.sample
        return self.document.masks.get(sample) if isinstance(sample, Path) else None


def added(chapter: Chapter, easel: Easel, progress: Progress, edit: AnyEdit) -> I4:
    """Add an edit, shown as it grows."""
    assert chapter.painting is not None
    try:
        changed = chapter.painting.document.add(edit, progress=easel.watching(progress))
    except BaseException:
        easel.mend()
        raise
    return shown(easel, changed)


def shown(easel: Easel, changed: I4) -> I4:
    """Show what an edit changed, and return that."""
    easel.show(changed)
    return changed


def _plain(spec: StrokeSpec) -> StrokeSpec:
    """The same without symmetry, where the area has its images already."""
    return replace(spec, options=replace(spec.options, mirror="", radial=1))


def _stamp_edit(
    options: ToolOptions, position: Place, normal: Place | None, sample: int
) -> StampEdit:
    x, y, z = (float(each) for each in position)
    side = None if normal is None else tuple(float(each) for each in normal)
    return StampEdit(
        point=(x, y, z), normal=side, sample=sample, rotation=options.turn, scale=options.scale,  # type: ignore[arg-type]
        feature=options.feature, weight=options.weight, protect=options.protect,
        seed=options.seed, symmetry=Symmetry(options.mirror, options.radial, options.axis),
    )  # fmt: skip


def _preview(chapter: Chapter, edit: StampEdit) -> tuple[Any, Any]:
    """Where a stamp would lie, and the picture of that."""
    assert chapter.painting is not None and chapter.live is not None
    document = chapter.painting.document
    found = document.preview(edit)
    vertices = np.concatenate([each.vertices for each in found])
    source = np.concatenate([each.source for each in found])
    alpha = np.concatenate([each.alpha for each in found])
    grid = document.engine.palette.grids[edit.sample]
    count = len(vertices)
    part = Quilt(
        grid.to_sample(source).astype(np.float32), np.zeros(count, np.float32),
        np.full(count, edit.sample, np.uint16), np.zeros(count, np.int32),
    )  # fmt: skip
    colours = vertex_colours(part, document.samples)
    return found, chapter.live.overlaid(vertices, colours, alpha)
