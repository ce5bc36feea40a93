"""The verbs of the window: values in, a background job, and its result into the document."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PyQt6.QtCore import QObject, pyqtSignal

from app.document import U1, Canvas, Decoration, Document, Mode, Opened, SampleEntry
from app.tasks import Job, Report, Tasks
from btfcore import pipeline
from btfcore.btf.image import SUFFIXES as IMAGE_SUFFIXES
from btfcore.btf.image import read_images
from btfcore.errors import Cancelled, PatinaError
from btfcore.files.light_file import read_environment
from btfcore.files.package.read import read_package
from btfcore.files.package.write import SUFFIX as PACKAGE_SUFFIX
from btfcore.files.samples import thumbnail
from btfcore.files.surface import export_input
from btfcore.mesh.reader import SUFFIXES as MESH_SUFFIXES
from btfcore.progress import Progress, between
from btfcore.quilt.measure import measure_seams
from btfcore.render.gutter import gutter_source
from btfcore.render.importance import LightTree, light_tree
from btfcore.render.lights import directional
from btfcore.render.material import factor_material
from btfcore.render.modes import chart_colours, field_colours, seam_colours
from btfcore.render.relight import Relighter
from btfcore.render.texture import atlas_texture, vertex_colours
from btfcore.samples import LoadedMaterial, load_material
from btfcore.types import Atlas, Quilt, Sample

if TYPE_CHECKING:
    from btfcore.quilt.parameters import QuiltParameters
    from btfcore.quilt.synthesize import Synthesizer

SAMPLE_SUFFIXES = (*IMAGE_SUFFIXES, PACKAGE_SUFFIX)
THUMBNAIL = 192  # pixels a side, enough for 96 on a screen of double density
MOST_SAMPLES = 400  # of one folder


class Operations(QObject):
    """Runs verbs for one document; `work` is the serial executor of everything that writes.

    failed(text) and noted(text) are sentences for the user.
    """

    failed = pyqtSignal(str)
    noted = pyqtSignal(str)
    exported = pyqtSignal(object)

    def __init__(self, document: Document, parent: QObject | None = None) -> None:
        """Connect the executors to `document`."""
        super().__init__(parent)
        self.document = document
        self.work = Tasks(self)
        self.drawing = Tasks(self)
        self.reading = Tasks(self)
        self.opening = Tasks(self)  # environments
        self._to_read: list[Path] = []
        self._canvases: dict[int, Canvas] = {}
        self._sample: tuple[Path, LoadedMaterial] | None = None
        self._unlit: Decoration | None = None  # what could not be lit
        # the synthesis that was cancelled last, by what it was asked to do
        self._unfinished: dict[tuple[Canvas, Sample, QuiltParameters], Synthesizer] = {}
        for tasks in (self.work, self.drawing, self.reading, self.opening):
            tasks.finished.connect(self._finish)
            tasks.reported.connect(self._take)
            tasks.failed.connect(self._fail)
        self.work.cancelled.connect(self._restore)
        self.reading.idle.connect(self._read_more)
        self.drawing.idle.connect(self.draw)
        document.mode_changed.connect(self.draw)

    # --- verbs

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

        A synthesis that was cancelled goes on where it stopped, if it is asked for again.
        """
        opened, path, knobs = self.document.opened, self.document.sample_path, self.document.knobs
        if opened is None or path is None:
            self.failed.emit(self.tr("Choose a mesh and a sample first."))
            return False
        canvas, known = self._canvases.get(knobs.rate), self._sample

        def job(progress: Progress, report: Report) -> Decoration:
            start = time.monotonic()
            parameters = knobs.quilting()
            progress(0.0, "reading the sample")
            if known and known[0] == path:
                loaded = known[1]
            else:
                loaded = load_material(path, progress=between(progress, 0.0, 0.02))
            report("sample", (path, loaded))
            sample = loaded.picture
            here = canvas or _prepare(opened, knobs.rate, between(progress, 0.02, 0.4))
            report("canvas", (opened, knobs.rate, here))

            def show(partial: Quilt) -> None:
                report("frame", lambda: self._pictures(here, sample, partial), droppable=True)

            begin = 0.02 if canvas else 0.4
            key = (here, sample, parameters)
            engine = self._unfinished.pop(key, None)
            if engine is None:
                engine = pipeline.synthesizer(
                    here.prepared, sample, parameters, progress=between(progress, begin, begin)
                )
            try:
                quilt = engine.run(progress=between(progress, begin, 0.98), on_update=show)
            except Cancelled:
                self._unfinished = {key: engine}  # between patches it is whole
                raise
            self._unfinished.clear()
            progress(0.99, "measuring the seams")
            seams = measure_seams(engine.net, engine.state, engine.sheet)
            patches, seconds = engine.statistics.patches, time.monotonic() - start
            report("frame", self._pictures(here, sample, quilt))
            materials = (factor_material(loaded.btf),)
            return Decoration(here, sample, quilt, patches, seams, seconds, materials)

        return self._start("synthesize", job)

    def export(self, path: Path, *, dense_shape: bool = False) -> bool:
        """Write the result to a .glb, .obj or .ply file."""
        done = self.document.decoration
        if done is None:
            self.failed.emit(self.tr("There is nothing to export yet: synthesise first."))
            return False

        def job(progress: Progress, report: Report) -> tuple[Decoration, tuple[Path, ...]]:
            written = pipeline.export(
                path, done.canvas.prepared, done.quilt, done.sample,
                dense_shape=dense_shape, progress=progress,
            )  # fmt: skip
            return done, written

        return self._start("export", job, harmless=False)

    def offer(self, paths: Sequence[Path], *, choose: bool = False) -> None:
        """Put samples on offer; their thumbnails follow. `choose` takes the first."""
        paths = [path.absolute() for path in paths]
        fresh = [path for path in paths if path not in {e.path for e in self.document.samples}]
        self.document.offer_samples([SampleEntry(path) for path in fresh])
        self._to_read += fresh
        self._read_more()
        if choose and paths:
            self.document.choose_sample(paths[0])

    def offer_folder(self, folder: Path) -> None:
        """Put the samples of a folder on offer."""
        try:
            found = [path for path in sorted(folder.iterdir()) if is_sample(path)]
        except OSError as error:
            self.failed.emit(self.tr("{0} cannot be read: {1}").format(folder, error.strerror))
            return
        if not found:
            known = ", ".join(SAMPLE_SUFFIXES)
            self.failed.emit(self.tr("{0} holds no sample ({1}).").format(folder, known))
            return
        if len(found) > MOST_SAMPLES:
            text = self.tr("{0} holds {1} samples; the first {2} are shown.")
            self.noted.emit(text.format(folder, len(found), MOST_SAMPLES))
        self.offer(found[:MOST_SAMPLES])

    def open_environment(self, path: Path) -> bool:
        """Light the surface by a picture of all that is around; False while another is read."""

        def job(progress: Progress, report: Report) -> tuple[str, LightTree, tuple[str, ...]]:
            environment, notes = read_environment(path, progress=between(progress, 0.0, 0.7))
            return path.name, light_tree(environment), notes

        return self.opening.start("environment", job)

    def cancel(self) -> None:
        """Stop what runs; the document stays as it was before."""
        self.work.cancel()

    def pause(self) -> None:
        """Let what runs wait, or go on where it waits already."""
        self.work.pause(not self.work.paused)

    def close(self) -> None:
        """Stop everything and wait until no thread of ours runs."""
        self._to_read = []
        for tasks in (self.work, self.drawing, self.reading, self.opening):
            tasks.cancel()
        for tasks in (self.work, self.drawing, self.reading, self.opening):
            tasks.close()

    def draw(self) -> None:
        """Make the picture of the present mode where it is missing."""
        document, mode = self.document, self.document.mode
        canvas, done = document.canvas, document.decoration
        if canvas is None or self.drawing.busy:
            return
        if mode is Mode.LIT and Mode.COLOUR in document.textures:
            self._light(done)
            return
        if mode in document.textures:
            return
        make: Callable[[], dict[Mode, U1]]
        if mode in (Mode.COLOUR, Mode.SEAMS, Mode.LIT):
            if done is None or done.canvas is not canvas:
                return
            make = lambda: _both(canvas, done.sample, done.quilt)  # noqa: E731
        elif mode is Mode.CHARTS:
            dense = canvas.prepared.dense
            make = lambda: {mode: _image(canvas, chart_colours(dense))}  # noqa: E731
        else:
            prepared = canvas.prepared
            make = lambda: {  # noqa: E731
                mode: _image(canvas, field_colours(prepared.dense, prepared.field))
            }
        self.drawing.start("draw", lambda progress, report: (canvas, make()))

    def _light(self, done: Decoration | None) -> None:
        """Prepare what lights the decoration, in the background: it may have to compile."""
        document = self.document
        if done is None or document.relighter is not None or done.canvas is not document.canvas:
            return
        if not done.materials or done is self._unlit:
            return

        def job(progress: Progress, report: Report) -> tuple[Decoration, Relighter]:
            relighter = Relighter(
                done.canvas.prepared, done.quilt, done.materials,
                gutter=done.canvas.gutter, progress=progress,
            )  # fmt: skip
            relighter.warm_up(directional((0.3, 0.4, 0.9)), progress=progress)
            return done, relighter

        self.drawing.start("light", job)

    # --- results

    def _start(self, name: str, job: Job, *, harmless: bool = True) -> bool:
        if self.work.start(name, job, harmless=harmless):
            return True
        self.noted.emit(self.tr("Wait for the running task, or cancel it."))
        return False

    def _pictures(self, canvas: Canvas, sample: Sample, quilt: Quilt) -> tuple[Canvas, dict]:
        """Picture of a partial quilt in the mode that is being looked at."""
        if self.document.mode is Mode.SEAMS:
            return canvas, _both(canvas, sample, quilt)
        return canvas, {Mode.COLOUR: _image(canvas, vertex_colours(quilt, [sample]))}

    def _take(self, name: str, value: Any) -> None:
        if name == "sample":
            self._sample = value
        elif name == "thumbnail":
            self.document.offer_samples([value])
        elif name == "canvas":
            opened, rate, canvas = value
            if opened is self.document.opened:
                self._canvases[rate] = canvas
                self.document.set_canvas(canvas)
                self.document.drop_textures()
        elif name == "frame":
            self.document.set_growing(True)
            self._show(*value)

    def _show(self, canvas: Canvas, images: dict[Mode, U1]) -> None:
        if canvas is self.document.canvas:
            for mode, image in images.items():
                self.document.set_texture(mode, image)

    def _finish(self, name: str, value: Any) -> None:
        if name == "open":
            self._canvases = {}
            self._unfinished = {}
            self.document.set_mesh(value)
            for note in value.imported.notes:
                self.noted.emit(f"{value.path.name}: {note}")
        elif name == "synthesize":
            self.document.set_decoration(value)
            self.draw()
        elif name == "export":
            done, written = value
            if done is self.document.decoration:
                self.document.set_exported()
            self.exported.emit(written)
        elif name == "draw":
            self._show(*value)
        elif name == "environment":
            source, tree, notes = value
            self.document.set_lighting(environment=tree, source=source, turn=0.0)
            for note in notes:
                self.noted.emit(f"{source}: {note}")
        elif name == "light":
            done, relighter = value
            if done is self.document.decoration:
                self.document.set_relighter(relighter)
        elif name == "thumbnails":
            self.document.offer_samples(value)

    def _fail(self, name: str, text: str) -> None:
        if name == "light":  # not tried again for this one
            self._unlit = self.document.decoration
        self.failed.emit(text)
        self._restore(name)

    def _restore(self, name: str) -> None:
        """After a stopped synthesis show the last finished one, or the bare mesh."""
        if name == "synthesize":
            self.document.set_growing(False)
            done = self.document.decoration
            if done is not None:
                self.document.set_canvas(done.canvas)
            self.document.drop_textures()
            self.draw()

    def _read_more(self) -> None:
        """Decode the thumbnails that were asked for, all in one guarded child."""
        if not self._to_read or self.reading.busy:
            return
        paths, self._to_read = self._to_read, []
        self.reading.start("thumbnails", lambda progress, report: _thumbnails(paths, progress))


def is_sample(path: Path) -> bool:
    """Say whether a path looks like an image file or a sample package."""
    return path.suffix.lower() in SAMPLE_SUFFIXES and not path.name.startswith(".")


def is_mesh(path: Path) -> bool:
    """Say whether a path looks like a mesh file."""
    return path.suffix.lower() in MESH_SUFFIXES


def _prepare(opened: Opened, rate: int, progress: Progress) -> Canvas:
    prepared = pipeline.prepare(opened.mesh, rate=rate, progress=between(progress, 0.0, 0.95))
    progress(0.96, "preparing to draw")
    surface = export_input(prepared.mesh, prepared.atlas)
    return Canvas(prepared, surface, gutter_source(prepared.dense))


def _image(canvas: Canvas, colours: Any) -> U1:
    return atlas_texture(canvas.prepared.dense, colours, source=canvas.gutter)


def _both(canvas: Canvas, sample: Sample, quilt: Quilt) -> dict[Mode, U1]:
    """Pictures of a quilt with and without its seams."""
    colours = vertex_colours(quilt, [sample])
    seams = seam_colours(canvas.prepared.dense, quilt, colours)
    return {Mode.COLOUR: _image(canvas, colours), Mode.SEAMS: _image(canvas, seams)}


def _thumbnails(paths: Sequence[Path], progress: Progress) -> list[SampleEntry]:
    packages = [path for path in paths if path.suffix.lower() == PACKAGE_SUFFIX]
    entries = []
    for number, path in enumerate(packages):
        progress(number / len(paths), "reading samples")  # a chance to cancel
        entries.append(_package_entry(path))
    pictures = [path for path in paths if path not in packages]
    for path, read in zip(
        pictures, read_images(pictures, max_side=THUMBNAIL, progress=progress), strict=True
    ):
        if isinstance(read, PatinaError):
            entries.append(SampleEntry(path, error=str(read)))
        else:
            small = (np.clip(read.colour, 0, 1) * 255 + 0.5).astype(np.uint8)
            entries.append(SampleEntry(path, thumbnail=small))
    return entries


def _package_entry(path: Path) -> SampleEntry:
    """Show a package from above, lit obliquely; nothing foreign decodes it."""
    try:
        return SampleEntry(path, thumbnail=thumbnail(read_package(path), side=THUMBNAIL))
    except PatinaError as error:
        return SampleEntry(path, error=str(error))
