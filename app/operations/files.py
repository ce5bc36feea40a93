"""The verbs for project files, and for the painted mesh as other programs read it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.edits.line import Entry
from app.edits.timeline import Chapter
from app.layer_views import Mark
from app.operations.surface import SurfaceOperations, chapter_of
from app.tasks import Job, Report
from app.values import Canvas, Decoration, Opened
from btfcore.files.surface import export_input
from btfcore.mesh.topology import statistics
from btfcore.painting import Painting, export_document, open_project, save_project
from btfcore.progress import Progress, between
from btfcore.render.gutter import gutter_source
from btfcore.render.thumbnail import thumbnail
from btfcore.types import ImportReport

SUFFIX = ".patina"


class FileOperations(SurfaceOperations):
    """Opens, saves and exports what was painted."""

    def open_project(self, path: Path) -> bool:
        """Open a project file in place of everything; False while something runs."""

        def job(progress: Progress, report: Report) -> tuple[Opened, Chapter]:
            painting = open_project(path, progress=between(progress, 0.0, 0.7))
            return _shown(painting, path, between(progress, 0.7, 1.0))

        return self._start("open project", job)

    def adopt(self, painting: Painting, name: str = "") -> bool:
        """Show a painting that was restored; False while something runs."""
        path = painting.path or Path(name or "restored")

        def job(progress: Progress, report: Report) -> tuple[Opened, Chapter]:
            return _shown(painting, path, progress)

        return self._start("adopt", job)

    def save_project(self, path: Path | None = None) -> bool:
        """Save the painting, once edits that were asked for are done.

        path : None is where it was saved or opened last. False where there is nothing to save or
        no place for it.
        """
        target = path if path is not None else self.document.project_path
        if self.document.painting is None or target is None:
            self.failed.emit(self.tr("There is nothing to save yet: synthesise first."))
            return False
        return self._line_up("save", lambda chapter: _saving(chapter, target))

    def save_as(self, path: Path) -> bool:
        """Save the painting in another file, which is its own from then on."""
        return self.save_project(path)

    def export(
        self, path: Path, *, dense_shape: bool = False, relightable: bool = False,
        rate: int | None = None,
    ) -> bool:  # fmt: skip
        """Write the painted mesh to a .glb, .obj or .ply file."""
        if self.document.decoration is None:
            self.failed.emit(self.tr("There is nothing to export yet: synthesise first."))
            return False

        def job_of(chapter: Chapter) -> Job:
            painting, done = chapter.painting, chapter.decoration
            assert painting is not None

            def job(progress: Progress, report: Report) -> tuple[Decoration, tuple[Path, ...]]:
                written = export_document(
                    path, painting, rate=rate, dense_shape=dense_shape, relightable=relightable,
                    progress=progress,
                )  # fmt: skip
                assert done is not None
                return done, written

            return job

        return self._line_up("export", job_of)

    def _line_up(self, name: str, job_of: Callable[[Chapter], Job]) -> bool:
        """Let a job of the present painting run after the edits that were asked for."""
        if not self.edits.ready():
            return False
        if self.work.busy:
            self.noted.emit(self.tr("Wait for the running task, or cancel it."))
            return False
        self.edits.finish_stroke()

        def prepare() -> Job | None:
            chapter = self.edits.timeline.now
            return None if chapter.painting is None else job_of(chapter)

        self.edits.line.add(Entry(name, prepare, self.work))
        return True

    def _finish(self, name: str, value: Any) -> None:
        if name in ("open project", "adopt"):
            opened, chapter = value
            self._canvases = {chapter.canvas.prepared.dense.size: chapter.canvas}
            self._unfinished = {}
            self.document.set_mesh(opened)
            self.document.set_knobs(rate=chapter.canvas.prepared.dense.size)
            self.edits.restart(chapter)
            if name == "open project":
                self.document.set_saved(self.document.state.mark, opened.path)
            for note in chapter.painting.notes:
                self.noted.emit(note)
            self.draw()
        elif name == "save":
            mark, path = value
            self.document.set_saved(mark, path)
            self.saved.emit(path)
        elif name == "export":
            done, written = value
            if done is self.document.decoration:
                self.document.set_exported()
            self.exported.emit(written)
        else:
            super()._finish(name, value)

    def _fail(self, name: str, text: str) -> None:
        super()._fail(name, text)
        if name == "save":
            self.save_failed.emit()

    def _restore(self, name: str) -> None:
        super()._restore(name)
        if name == "save":
            self.save_failed.emit()


def _saving(chapter: Chapter, path: Path) -> Job:
    painting, done = chapter.painting, chapter.decoration
    assert painting is not None and done is not None
    document = painting.document

    def job(progress: Progress, report: Report) -> tuple[Mark, Path]:
        mark = Mark(painting, document.layers, painting.materials)
        progress(0.0, "saving")
        preview = thumbnail(done.canvas.prepared.dense, done.quilt, done.samples)
        save_project(painting, path, preview=preview, progress=between(progress, 0.1, 1.0))
        return mark, path

    return job


def _shown(painting: Painting, path: Path, progress: Progress) -> tuple[Opened, Chapter]:
    """A painting with all that the window needs to show it."""
    prepared = painting.document.prepared
    progress(0.0, "preparing to draw")
    surface = export_input(prepared.mesh, prepared.atlas)
    canvas = Canvas(prepared, surface, gutter_source(prepared.dense, progress=progress))
    mesh = prepared.mesh
    found = ImportReport(str(path), statistics(mesh.vertices, mesh.faces))
    return Opened(path, mesh, found, surface), chapter_of(painting, canvas)
