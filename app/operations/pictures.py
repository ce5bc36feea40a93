"""Pictures of the modes, and what light is evaluated with: made when they are looked at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from PyQt6.QtCore import QObject

from app.document import Document
from app.operations.base import OperationsBase
from app.tasks import Report
from app.values import U1, Canvas, Decoration, Mode
from btfcore.progress import Progress
from btfcore.render.glsl.decorated import pack_surface
from btfcore.render.lights import directional
from btfcore.render.modes import chart_colours, field_colours, seam_colours
from btfcore.render.relight import Relighter
from btfcore.render.texture import atlas_texture, vertex_colours
from btfcore.types import Quilt, Sample


class PictureOperations(OperationsBase):
    """Draws in the background what the document lacks."""

    def __init__(self, document: Document, parent: QObject | None = None) -> None:
        """See `OperationsBase`."""
        super().__init__(document, parent)
        self._unlit: Decoration | None = None  # what could not be lit
        self._followed: Decoration | None = None  # what light is up to date with
        self.drawing.idle.connect(self.draw)
        self.edits.finished.connect(self.draw)
        document.mode_changed.connect(self.draw)

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
        decorated = mode in (Mode.COLOUR, Mode.SEAMS, Mode.LIT)
        if decorated and (done is None or done.canvas is not canvas):
            return
        shown = done if decorated else None
        self.drawing.start(
            "draw", lambda progress, report: (canvas, shown, pictures(canvas, mode, shown))
        )

    def partial(self, canvas: Canvas, samples: Sequence[Sample], quilt: Quilt) -> Any:
        """Picture of a growing quilt in the mode that is being looked at."""
        if self.document.mode is Mode.SEAMS:
            return canvas, both(canvas, samples, quilt)
        return canvas, {Mode.COLOUR: image(canvas, vertex_colours(quilt, samples))}

    def _light(self, done: Decoration | None) -> None:
        """Prepare what lights the decoration, in the background: it may have to compile."""
        document = self.document
        if done is None or done.canvas is not document.canvas or self.edits.busy:
            return
        shader, ready = document.shader_wanted, document.relighter
        if ready is not None:
            if self._followed is not done or (shader and document.packed is None):
                self._follow(done, ready, shader)
            return
        if not done.materials or done is self._unlit:
            return

        def job(progress: Progress, report: Report) -> tuple[Decoration, Relighter, Any]:
            relighter = Relighter(
                done.canvas.prepared, done.quilt, done.materials,
                gutter=done.canvas.gutter, progress=progress,
            )  # fmt: skip
            relighter.warm_up(directional((0.3, 0.4, 0.9)), progress=progress)
            surfels, gutter = relighter.surfels, relighter.gutter
            packed = pack_surface(done.materials, surfels, gutter) if shader else None
            return done, relighter, packed

        self.drawing.start("light", job)

    def _follow(self, done: Decoration, relighter: Relighter, shader: bool) -> None:
        """Bring up to date after edits what light looks at beside single surfels."""
        known = self._followed is done

        def job(progress: Progress, report: Report) -> tuple[Decoration, Relighter, Any, Any]:
            made = None if known else relighter.followed(done.quilt)
            packed = None
            if shader:
                packed = pack_surface(done.materials, relighter.surfels, relighter.gutter)
            return done, relighter, made, packed

        self.drawing.start("follow", job)

    def _show(self, canvas: Canvas, images: dict[Mode, U1]) -> None:
        if canvas is self.document.canvas:
            for mode, each in images.items():
                self.document.set_texture(mode, each)

    def _take(self, name: str, value: Any) -> None:
        if name == "frame":
            self.document.set_growing(True)
            self._show(*value)
        else:
            super()._take(name, value)

    def _finish(self, name: str, value: Any) -> None:
        if name == "draw":
            canvas, done, images = value
            if done is None or done is self.document.decoration:  # else it was edited meanwhile
                self._show(canvas, images)
        elif name == "light":
            done, relighter, packed = value
            # another decoration: it was edited meanwhile, and idle() asks again
            if done is self.document.decoration and not self.edits.busy:
                self._followed = done
                self.document.set_relighter(relighter, packed)
        elif name == "follow":
            done, relighter, made, packed = value
            current = done is self.document.decoration and relighter is self.document.relighter
            if current and not self.edits.busy:
                self._followed = done
                if made is not None:
                    relighter.follow(made)
                if packed is not None:
                    self.document.set_relighter(relighter, packed)
        else:
            super()._finish(name, value)

    def _fail(self, name: str, text: str) -> None:
        if name == "light":  # not tried again for this one
            self._unlit = self.document.decoration
        super()._fail(name, text)


def pictures(canvas: Canvas, mode: Mode, done: Decoration | None) -> dict[Mode, U1]:
    """Pictures of a mode: of a decoration, or of the mesh alone."""
    if done is not None:
        return both(canvas, done.samples, done.quilt)
    dense = canvas.prepared.dense
    if mode is Mode.CHARTS:
        return {mode: image(canvas, chart_colours(dense))}
    return {mode: image(canvas, field_colours(dense, canvas.prepared.field))}


def image(canvas: Canvas, colours: Any) -> U1:
    """Atlas image of colours (N, 3) f4."""
    return atlas_texture(canvas.prepared.dense, colours, source=canvas.gutter)


def both(canvas: Canvas, samples: Sequence[Sample], quilt: Quilt) -> dict[Mode, U1]:
    """Pictures of a quilt with and without its seams."""
    colours = vertex_colours(quilt, samples)
    seams = seam_colours(canvas.prepared.dense, quilt, colours)
    return {Mode.COLOUR: image(canvas, colours), Mode.SEAMS: image(canvas, seams)}
