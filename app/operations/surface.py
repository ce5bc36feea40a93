"""The verbs that open a mesh and cover it with the background of a sample."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PyQt6.QtCore import QObject

from app.document import Document
from app.edits.timeline import Chapter, lit_by
from app.operations.samples import SampleOperations
from app.tasks import Report
from app.values import Canvas, Decoration, Opened
from btfcore import pipeline
from btfcore.btf.sample import BtfSample
from btfcore.errors import Cancelled
from btfcore.field import orientation_field
from btfcore.files.edits_json import BACKGROUND, Source
from btfcore.files.project.document import background_of
from btfcore.files.surface import export_input
from btfcore.guide import Guide
from btfcore.mesh.reader import SUFFIXES as MESH_SUFFIXES
from btfcore.painting import Painting, load_background, painting_over
from btfcore.progress import Progress, between
from btfcore.quilt.measure import SeamMeasures, measure_seams
from btfcore.render.gutter import gutter_source
from btfcore.render.live import LiveTexture
from btfcore.types import F4, Atlas, Quilt, Sample

if TYPE_CHECKING:
    from btfcore.quilt.parameters import QuiltParameters
    from btfcore.quilt.synthesize import Synthesizer

Loaded = tuple[BtfSample, Sample, list[str]]


class SurfaceOperations(SampleOperations):
    """Opens meshes and synthesises backgrounds."""

    def __init__(self, document: Document, parent: QObject | None = None) -> None:
        """See `OperationsBase`."""
        super().__init__(document, parent)
        self._canvases: dict[int, Canvas] = {}
        self._loaded: tuple[Path, F4 | None, Loaded] | None = None
        # the synthesis that was cancelled last, by what it was asked to do
        self._unfinished: dict[tuple[Canvas, Sample, QuiltParameters], Synthesizer] = {}

    def open_mesh(self, path: Path) -> bool:
        """Read a mesh file in the background; False while something else runs."""

        def job(progress: Progress, report: Report) -> Opened:
            mesh, imported = pipeline.load_mesh(path, progress=between(progress, 0.0, 0.9))
            bare = Atlas(
                mesh, np.zeros((len(mesh.faces), 3, 2)), np.zeros(len(mesh.faces), np.int32), 1
            )
            progress(0.9, "preparing to draw")
            return Opened(path, mesh, imported, export_input(mesh, bare))

        return self._start("open", job)

    def synthesize(self) -> bool:
        """Cover the mesh with the chosen sample; False where that cannot be started.

        Of a sample with a feature the background is synthesised. A synthesis that was cancelled
        goes on where it stopped, if it is asked for again.
        """
        opened, path, knobs = self.document.opened, self.document.sample_path, self.document.knobs
        if opened is None or path is None:
            self.failed.emit(self.tr("Choose a mesh and a sample first."))
            return False
        canvas, known = self._canvases.get(knobs.rate), self._loaded
        guide = self.document.guide
        mask = self.document.masks.get(path)
        label = self.tr("synthesise {0}").format(path.stem)
        source = Source(BACKGROUND, path, drawn=mask)

        def job(progress: Progress, report: Report) -> Chapter:
            start = time.monotonic()
            parameters = knobs.quilting()
            progress(0.0, "reading the sample")
            if known and known[0] == path and known[1] is mask:
                loaded = known[2]
            else:
                loaded = load_background(source, progress=between(progress, 0.0, 0.02))
            report("sample", (path, mask, loaded))
            found, sample, notes = loaded
            if canvas is None:
                here = prepare(opened, knobs.rate, between(progress, 0.02, 0.4), guide)
            else:
                here = guided(canvas, guide, between(progress, 0.02, 0.1))
            report("canvas", (opened, knobs.rate, here))

            def show(partial: Quilt) -> None:
                report("frame", lambda: self.partial(here, [sample], partial), droppable=True)

            begin = 0.4 if canvas is None else 0.02 if here is canvas else 0.1
            key = (here, sample, parameters)
            engine = self._unfinished.pop(key, None)
            if engine is None:
                engine = pipeline.synthesizer(
                    here.prepared, sample, parameters, progress=between(progress, begin, begin)
                )
            try:
                quilt = engine.run(progress=between(progress, begin, 0.97), on_update=show)
            except Cancelled:
                self._unfinished = {key: engine}  # between patches it is whole
                raise
            self._unfinished.clear()
            report("frame", self.partial(here, [sample], quilt))
            progress(0.98, "measuring the seams")
            seams = measure_seams(engine.net, engine.state, engine.sheet)
            painting = painting_over(here.prepared, [source], [found], engine, notes=notes)
            chapter = chapter_of(
                painting, here, label, patches=engine.statistics.patches, seams=seams,
                seconds=time.monotonic() - start,
            )  # fmt: skip
            chapter.brought[(path, 0 if mask is None else id(mask))] = BACKGROUND
            if mask is not None:
                chapter.masks.append(mask)
            return chapter

        return self._start("synthesize", job)

    def _take(self, name: str, value: Any) -> None:
        if name == "sample":
            self._loaded = value
        elif name == "canvas":
            opened, rate, canvas = value
            if opened is self.document.opened:
                self._canvases[rate] = canvas
                self.document.set_canvas(canvas)
                self.document.drop_textures()
        else:
            super()._take(name, value)

    def _finish(self, name: str, value: Any) -> None:
        if name == "open":
            self._canvases = {}
            self._unfinished = {}
            self.document.set_mesh(value)
            self.edits.restart()
            for note in value.imported.notes:
                self.noted.emit(f"{value.path.name}: {note}")
        elif name == "synthesize":
            self.edits.begin(value)
            self.draw()
        else:
            super()._finish(name, value)

    def _restore(self, name: str) -> None:
        """After a stopped synthesis show the last finished one, or the bare mesh."""
        if name == "synthesize":
            self.document.set_growing(False)
            done = self.document.decoration
            if done is not None:
                self.document.set_canvas(done.canvas)
            self.document.drop_textures()
            self.draw()
        else:
            super()._restore(name)


def is_mesh(path: Path) -> bool:
    """Say whether a path looks like a mesh file."""
    return path.suffix.lower() in MESH_SUFFIXES


def prepare(opened: Opened, rate: int, progress: Progress, guide: Guide | None = None) -> Canvas:
    """Prepare a mesh at some rate; raises as `btfcore.pipeline.prepare` does."""
    prepared = pipeline.prepare(
        opened.mesh, rate=rate, guide=guide, progress=between(progress, 0.0, 0.95)
    )
    progress(0.96, "preparing to draw")
    surface = export_input(prepared.mesh, prepared.atlas)
    return Canvas(prepared, surface, gutter_source(prepared.dense), guide)


def guided(canvas: Canvas, guide: Guide | None, progress: Progress) -> Canvas:
    """The same canvas with the field along another guide; raises `InvalidGuide`."""
    if guide is canvas.guide:
        return canvas
    old = canvas.prepared
    field = orientation_field(old.dense, old.mesh, guide=guide, progress=progress)
    return replace(canvas, prepared=replace(old, field=field), guide=guide)


def chapter_of(
    painting: Painting,
    canvas: Canvas,
    label: str = "",
    *,
    patches: int | None = None,
    seams: SeamMeasures | None = None,
    seconds: float = 0.0,
) -> Chapter:
    """A painting with all that showing it needs; patches and seams are found where not given."""
    engine = painting.document.engine
    quilt = engine.quilt()
    if seams is None:
        seams = measure_seams(engine.net, engine.state, engine.palette.sheet)
    if patches is None:
        patches = int(quilt.patch.max(initial=-1)) + 1
    decoration = Decoration(
        canvas, engine.samples, quilt, patches, seams, seconds, lit_by(painting)
    )
    live = LiveTexture(canvas.gutter, engine.net.indptr, engine.net.indices, engine.samples, quilt)
    background = background_of(painting.document)
    return Chapter(label, canvas, decoration, painting, background, live)
