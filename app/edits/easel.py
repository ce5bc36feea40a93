"""What of a painting was shown: pictures of what an edit has changed so far, made as it works."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.edits.timeline import Chapter
from app.tasks import Report
from app.values import U1, Mode
from btfcore.progress import Progress
from btfcore.types import F4, I4, Quilt

FRAME_S = 0.06  # between two pictures while an edit is computed


@dataclass(frozen=True, eq=False)
class Frame:
    """A picture of an edit at work, and what it was made from.

    vertices (n,) i4 changed since the last one; part: the quilt there; images by mode; wanted
    (N,) f4: m_0 of the stroke, None where it is not drawn any more.
    """

    chapter: Chapter
    vertices: I4
    part: Quilt
    images: dict[Mode, U1]
    wanted: F4 | None = None


class Easel:
    """Shows one edit of a chapter; used in the thread that computes it."""

    def __init__(self, chapter: Chapter, report: Report, mode: Callable[[], Mode]) -> None:
        """Hand frames to `report`; `mode` says what is looked at."""
        self._chapter, self._report, self._mode = chapter, report, mode
        self._shown: list[I4] = []
        self._waiting: list[I4] = []
        self._wanted: F4 | None = None  # not shown yet
        self._last = self._took = 0.0

    def offer(self, vertices: I4, wanted: F4) -> None:
        """Show it soon: at once where a patch was laid, else when it is time for a picture."""
        self._waiting.append(vertices)
        self._wanted = wanted
        patch = len(vertices) > 0
        if time.monotonic() - self._last >= max(FRAME_S * (not patch) / 2, 2 * self._took):
            self.flush()

    def flush(self) -> None:
        """Show what was offered and is not shown yet."""
        if self._wanted is not None:
            self.show(np.unique(np.concatenate(self._waiting)), self._wanted)

    def show(self, vertices: I4, wanted: F4 | None = None) -> None:
        """Show the quilt as it is at `vertices` (n,), and the area that is wanted yet."""
        begun = time.monotonic()
        chapter, live = self._chapter, self._chapter.live
        assert live is not None
        self._waiting, self._wanted = [], None
        part = chapter.part(vertices)
        self._shown.append(vertices)
        images = {Mode.COLOUR: live.image() if wanted is None else self._tinted(wanted)}
        if self._mode() is Mode.SEAMS:
            images[Mode.SEAMS] = live.seams()
        kept = None if wanted is None else wanted.copy()
        self._report("edited", Frame(chapter, vertices, part, images, kept))
        self._last = time.monotonic()
        self._took = self._last - begun

    def _tinted(self, wanted: F4) -> U1:
        assert self._chapter.painting is not None and self._chapter.live is not None
        engine = self._chapter.painting.document.engine
        done = engine.recorder.changed if engine.busy else np.zeros(0, np.int32)
        return self._chapter.live.tinted(wanted, done)

    def watching(self, progress: Progress, wanted: F4 | None = None) -> Progress:
        """Show what the running edit has changed, now and then, whenever it tells its progress.

        wanted (N,) f4: m_0, shown as long as it is not reached.
        """
        assert self._chapter.painting is not None
        engine = self._chapter.painting.document.engine

        def told(fraction: float, label: str) -> None:
            progress(fraction, label)
            if engine.busy and time.monotonic() - self._last >= max(FRAME_S, 3 * self._took):
                changed = engine.recorder.changed
                if len(changed):
                    self.show(changed, wanted)

        return told

    def mend(self) -> None:
        """Show what there is now wherever anything was shown: the edit was taken back."""
        if self._shown:
            self.show(np.unique(np.concatenate(self._shown)))
