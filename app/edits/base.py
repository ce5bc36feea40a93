"""Between the worker that paints and the document that is shown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from PyQt6.QtCore import QObject, pyqtSignal

from app.document import Document
from app.edits.easel import Easel, Frame
from app.edits.line import Entry, Line
from app.edits.stroke import Feed
from app.edits.timeline import Chapter, Timeline, warm_up
from app.layer_views import LayerView, PaintState
from app.tasks import Job, Report, Tasks
from app.values import Decoration, Mode
from btfcore.errors import InvalidParameter
from btfcore.progress import Progress
from btfcore.types import I4

Act = Callable[[Chapter, Easel, Progress], Any]


@dataclass(frozen=True, eq=False)
class Done:
    """What a job left: the chapter that is present now, and what changed on its surface."""

    chapter: Chapter
    vertices: I4
    decoration: Decoration | None


class EditsBase(QObject):
    """Owns the painting: its timeline, and the line of jobs that change it.

    failed(text), noted(text) : sentences for the user ; finished(name) : of the job that ended
    well. `tasks` runs edits; `work` is the executor of long work, which nothing runs beside.
    """

    failed = pyqtSignal(str)
    noted = pyqtSignal(str)
    finished = pyqtSignal(str)

    def __init__(
        self, document: Document, work: Tasks, allowed: Callable[[], bool], parent: QObject | None
    ) -> None:
        """Edit what `document` shows; allowed() says whether edits may be asked for now."""
        super().__init__(parent)
        self.document = document
        self.tasks = Tasks(self)
        self.line = Line((self.tasks, work), self)
        self._allowed = allowed
        self.timeline = Timeline()
        self._calm = PaintState()  # as it was when no job ran
        self._shown = self.timeline.now
        self.budget_mb = 256.0
        self.tasks.reported.connect(self._take)
        for tasks in (self.tasks, work):
            tasks.finished.connect(self._finish)
            tasks.failed.connect(self._fail)
            tasks.cancelled.connect(self._stop)
        self.line.changed.connect(self._show_line)

    @property
    def busy(self) -> bool:
        """An edit is computed or waited for."""
        return self.line.busy

    def set_budget(self, megabytes: float) -> None:
        """Memory for undo, of every background's edits; counts from the next edit on."""
        self.budget_mb = megabytes
        for chapter in self.timeline.chapters:
            if chapter.painting is not None:
                chapter.painting.document.budget_mb = megabytes

    # --- chapters, in the window's thread while no job runs

    def begin(self, chapter: Chapter) -> None:
        """Go on with another background; undo leads back."""
        self.timeline.begin(chapter)
        self._present()
        self._warm_up()

    def restart(self, chapter: Chapter | None = None) -> None:
        """Begin anew with another mesh or project; nothing can be undone."""
        self.line.clear()
        self.timeline = Timeline()
        if chapter is not None:
            self.timeline.chapters = [chapter]
        self._present()

    def _present(self) -> None:
        """Show the present chapter."""
        chapter = self._shown = self.timeline.now
        document = self.document
        if chapter.painting is not None:
            chapter.painting.document.budget_mb = self.budget_mb
        self.refresh()
        document.show_stroke(None)
        document.show_preview((), None)
        if chapter.decoration is None or chapter.live is None:
            document.set_bare()
            return
        document.set_decoration(chapter.decoration)
        document.set_texture(Mode.COLOUR, chapter.live.image())

    def _warm_up(self) -> None:
        """Make the tables of the background's sample while nothing is asked for."""
        chapter = self.timeline.now

        def job(progress: Progress, report: Report) -> None:
            if chapter.painting is not None:
                warm_up(chapter.painting.document)

        self.line.glance(Entry("warm up", lambda: job, self.tasks, light=True))

    def refresh(self) -> None:
        """Tell the document how the painting is; to be called while no job runs."""
        self._calm = self.timeline.state()
        self._show_line()

    def _show_line(self) -> None:
        """Tell the document what is waited for."""
        entries = self.line.entries
        busy = {each.uid for each in entries if each.uid is not None}
        layers = tuple(
            replace(each, busy=True) if each.uid in busy else each for each in self._calm.layers
        )
        waited = [each for each in entries if each.label]
        coming = tuple(
            LayerView(-1 - number, each.label, each.kind, busy=True)
            for number, each in enumerate(waited)
        )
        self.document.set_state(replace(self._calm, layers=layers + coming))

    # --- jobs

    def ask(
        self,
        name: str,
        act: Act,
        *,
        label: str = "",
        kind: str = "",
        uid: int | None = None,
        feed: Feed | None = None,
        done: Callable[[Any], None] | None = None,
    ) -> Entry | None:
        """Line up an edit of the present chapter; None where edits are refused.

        done : takes what `act` returns, where that is no edit.
        """
        if not self.ready():
            return None

        def prepare() -> Job | None:
            chapter = self.timeline.now
            if chapter.painting is None:
                self.failed.emit(self.tr("There is nothing to edit yet: synthesise first."))
                return None

            def job(progress: Progress, report: Report) -> Any:
                easel = Easel(chapter, report, lambda: self.document.mode)
                changed = act(chapter, easel, progress)
                if done is not None:
                    return changed
                return Done(chapter, changed, chapter.decorated())

            return job

        entry = Entry(name, prepare, self.tasks, label, kind, uid, feed, done=done or self._edited)
        self.line.add(entry)
        return entry

    def ready(self) -> bool:
        """Say whether edits can be asked for; where not, the user is told why."""
        if self.timeline.now.painting is None:
            self.failed.emit(self.tr("There is nothing to edit yet: synthesise first."))
            return False
        if not self._allowed():
            self.noted.emit(self.tr("Wait for the running task, or cancel it."))
            return False
        return True

    def _edited(self, done: Done) -> None:
        self.timeline.forget_undone()
        self._arrived(done)

    def _arrived(self, done: Done) -> None:
        """Take what a job left."""
        done.chapter.decoration = done.decoration
        while done.chapter.remarks:
            self.noted.emit(done.chapter.remarks.pop())
        if done.chapter is not self._shown:
            self._present()
            return
        self.document.show_stroke(None)
        if done.decoration is None:
            return
        if len(done.vertices):
            self._keep_light(done.decoration)
        self.document.follow_edits(done.decoration)

    def _take(self, name: str, value: Any) -> None:
        if name == "edited" and isinstance(value, Frame):
            self._show(value)

    def _show(self, frame: Frame) -> None:
        document = self.document
        if frame.chapter is not self._shown or document.canvas is not frame.chapter.canvas:
            return
        document.show_stroke(frame.wanted)
        if not len(frame.vertices):
            document.set_texture(Mode.COLOUR, frame.images[Mode.COLOUR])
            return
        if Mode.SEAMS not in frame.images:
            document.textures.pop(Mode.SEAMS, None)
        self._relight(frame)
        for mode, image in frame.images.items():
            document.set_texture(mode, image)
        document.surface_edited.emit(frame.vertices)

    def _relight(self, frame: Frame) -> None:
        """Let the light follow; where it cannot, it is prepared anew once the edit is done."""
        relighter = self.document.relighter
        if relighter is None:
            return
        try:
            relighter.update(frame.vertices, frame.part)
        except InvalidParameter:  # a sample that is new to it
            self.document.drop_light()
            return
        self.document.edited_light()

    def _keep_light(self, decoration: Decoration) -> None:
        """Drop the light where it does not know all samples."""
        relighter = self.document.relighter
        if relighter is not None and len(relighter.materials) != len(decoration.materials):
            self.document.drop_light()

    def _finish(self, name: str, value: Any) -> None:
        entry = self.line.ended()
        if entry is None:
            return
        if entry.done is not None:
            entry.done(value)
        now = self.timeline.now.painting
        brought = now is not None and now.materials is not self._calm.mark.materials
        if not entry.light or brought:
            self.refresh()
        if not entry.light:
            self.finished.emit(name)

    def _fail(self, name: str, text: str) -> None:
        entry = self.line.ended()
        if entry is not None:
            self._undone()
            if entry.tasks is self.tasks:
                self.failed.emit(text)

    def _stop(self, name: str) -> None:
        if self.line.ended() is not None:
            self._undone()

    def _undone(self) -> None:
        """An edit came to nothing: the painting is as it was, and is shown so."""
        self.document.show_stroke(None)
        if self.timeline.now is not self._shown:
            self._present()
        self.refresh()
