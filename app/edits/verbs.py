"""The verbs of painting: each returns at once and is one undoable step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from app.edits.base import Done
from app.edits.easel import Easel
from app.edits.line import Entry
from app.edits.surface import SurfaceEdits, added, shown
from app.edits.timeline import Chapter
from app.tasks import Job, Report
from btfcore.errors import Cancelled
from btfcore.progress import Progress
from btfcore.types import I4


class Edits(SurfaceEdits):
    """What tools and panels call, in the window's thread; nothing here waits for the engine.

    Verbs return whether they were taken on; where not, failed or noted says why.
    """

    # --- layers

    def show_layer(self, uid: int, visible: bool) -> bool:
        """Hide a layer or show it again."""
        return self.change_layer(uid, visible=visible)

    def rename_layer(self, uid: int, name: str) -> bool:
        """Give a layer another name."""
        return self.change_layer(uid, name=name)

    def change_layer(self, uid: int, **knobs: object) -> bool:
        """Change fields of a layer's edit; it is computed anew where that is needed."""

        def act(chapter: Chapter, easel: Easel, progress: Progress) -> I4:
            assert chapter.painting is not None
            document = chapter.painting.document
            return shown(easel, document.change(uid, progress=progress, **knobs))

        return self.ask("change", act, uid=uid) is not None

    def remove_layer(self, uid: int) -> bool:
        """Delete a layer."""

        def act(chapter: Chapter, easel: Easel, progress: Progress) -> I4:
            assert chapter.painting is not None
            return shown(easel, chapter.painting.document.remove(uid, progress=progress))

        return self.ask("remove", act, uid=uid) is not None

    def move_layer(self, uid: int, place: int) -> bool:
        """Put a layer at another place, 0 being the bottom."""

        def act(chapter: Chapter, easel: Easel, progress: Progress) -> I4:
            assert chapter.painting is not None
            return shown(easel, chapter.painting.document.move(uid, place, progress=progress))

        return self.ask("move", act, uid=uid) is not None

    def duplicate_layer(self, uid: int) -> bool:
        """Make the same edit once more, on top."""
        suffix = self.tr("{0} copy")

        def act(chapter: Chapter, easel: Easel, progress: Progress) -> I4:
            assert chapter.painting is not None
            edit = chapter.painting.document.layer(uid).edit
            again: Any = replace(edit, uid=-1, name=suffix.format(edit.name), visible=True)
            return added(chapter, easel, progress, again)

        return self.ask("duplicate", act, label=self.tr("copy"), kind="paint") is not None

    # --- history

    def undo(self) -> bool:
        """Take back one step, once the edits before are done."""
        return self._travel(lambda at, count: at - 1)

    def redo(self) -> bool:
        """Do one step again."""
        return self._travel(lambda at, count: at + 1)

    def undo_to(self, step: int) -> bool:
        """Go to where `step` steps of the history are done."""
        return self._travel(lambda at, count: step)

    def _travel(self, where: Callable[[int, int], int]) -> bool:
        if not self._allowed():
            self.noted.emit(self.tr("Wait for the running task, or cancel it."))
            return False
        self.finish_stroke()
        timeline = self.timeline

        def prepare() -> Job | None:
            labels, at = timeline.history
            goal = min(max(where(at, len(labels)), 0), len(labels))
            if goal == at or timeline is not self.timeline:
                return None

            def job(progress: Progress, report: Report) -> Done:
                written: dict[int, list[I4]] = {}
                try:
                    while (here := timeline.history[1]) != goal:
                        number = timeline.place
                        progress(0.0, "undoing" if goal < here else "redoing")
                        step = timeline.backward if goal < here else timeline.forward
                        changed = step(progress)
                        if changed is not None:
                            written.setdefault(number, []).append(changed)
                except Cancelled:
                    pass  # so far is a state as good as any
                for number, parts in written.items():
                    if number != timeline.place:
                        timeline.chapters[number].part(np.unique(np.concatenate(parts)))
                chapter = timeline.now
                parts = written.get(timeline.place, [np.zeros(0, np.int32)])
                changed = np.unique(np.concatenate(parts))
                if chapter.painting is None:
                    return Done(chapter, changed, None)
                Easel(chapter, report, lambda: self.document.mode).show(changed)
                return Done(chapter, changed, chapter.decorated())

            return job

        self.line.add(Entry("undo", prepare, self.tasks, done=self._arrived))
        return True

    # --- the rest

    def sample_at(self, hit: Any) -> str:
        """Name of the sample that lies at a place of the surface, "" where it is bare."""
        done, painting = self.document.decoration, self.document.painting
        if done is None or painting is None:
            return ""
        place = np.asarray(hit.position, np.float64).reshape(-1, 3)[0]
        side = np.asarray(hit.normal, np.float64).reshape(-1, 3)[0]
        dense = done.canvas.prepared.dense
        away = ((dense.vertices - place) ** 2).sum(axis=1)
        away[(dense.normals * side).sum(axis=1) < 0] += 4 * dense.step**2
        vertex = int(away.argmin())
        if done.quilt.patch[vertex] < 0:
            return ""
        return self.document.sample_names[int(done.quilt.sample[vertex])]

    def cancel(self) -> None:
        """Stop the running edit, and drop those that wait."""
        self._stroke = None
        self.line.clear()
        if self.line.running is not None:
            self.line.running.tasks.cancel()

    def close(self) -> None:
        """Stop, and wait until no thread of ours runs."""
        self._stroke = None
        self.line.clear()
        self.tasks.close()
