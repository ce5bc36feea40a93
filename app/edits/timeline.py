"""The backgrounds that were made one after the other, each with the edits over it: all of undo.

A painting knows the history of its own edits. A new background begins another chapter, and undo
goes back into the one before.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from app.layer_views import LayerView, Mark, PaintState, view_of
from app.values import Canvas, Decoration
from btfcore.errors import InvalidEdit, PatinaError
from btfcore.files.edits_json import Source
from btfcore.paint.document import Document
from btfcore.paint.edits import Area, PaintEdit, Stroke
from btfcore.painting import Painting, add_samples
from btfcore.progress import Progress, silent
from btfcore.quilt.state import QuiltState
from btfcore.render.live import LiveTexture
from btfcore.render.material import Material, factor_material
from btfcore.types import F4, I4, Quilt

MOST = 5  # chapters that are kept, as each has tables of its own

Brought = tuple[Path, int]  # a file of the library, and which drawn mask


@dataclass(eq=False)
class Chapter:
    """One background with its edits; `painting` is None before the first synthesis.

    label : of the step that began it. background : a copy of the quilt below all edits. live :
    its pictures. brought : names of samples by where they come from, `masks` keeping the masks
    alive whose identity that is. remarks : sentences for the user, not told yet.
    """

    label: str = ""
    canvas: Canvas | None = None
    decoration: Decoration | None = None
    painting: Painting | None = None
    background: QuiltState | None = None
    live: LiveTexture | None = None
    brought: dict[Brought, str] = field(default_factory=dict)
    masks: list[F4] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    _stale: bool = False

    def sample(
        self, wanted: Path | str | None, mask: F4 | None, *, progress: Progress = silent
    ) -> int:
        """Number of a sample to paint with, which is brought on first use.

        Raises `InvalidEdit` for a name that is not there, and as `add_samples` does.
        """
        painting = self.painting
        assert painting is not None
        if wanted is None:
            return 0
        if isinstance(wanted, str):
            if wanted not in painting.names:
                raise InvalidEdit(f"there is no sample {wanted!r}; open its file first")
            return painting.names.index(wanted)
        key = (wanted, 0 if mask is None else id(mask))
        if key not in self.brought:
            name, before = _free(wanted.stem, painting.names), painting.document.steps
            add_samples(painting, [Source(name, wanted, drawn=mask)], progress=progress)
            self._stale = True  # what is shown by its colours may have others, or be made anew
            if painting.document.steps != before:
                self.remarks.append(
                    f"{wanted.name} cannot be compared with the samples that were there; all go by"
                    " their colours now, edits were computed anew, and undo ends here"
                )
            self.brought[key] = name
            if mask is not None:
                self.masks.append(mask)
        return painting.names.index(self.brought[key])

    def part(self, vertices: I4) -> Quilt:
        """The quilt at `vertices` as it is now, after its picture was brought up to date."""
        assert self.painting is not None and self.live is not None
        engine = self.painting.document.engine
        if self._stale:
            every = np.arange(len(engine.state.patch), dtype=np.int32)
            self.live.update(every, engine.part_of_quilt(every), engine.samples)
            self._stale = False
        part = engine.part_of_quilt(vertices)
        self.live.update(vertices, part, engine.samples)
        return part

    def decorated(self) -> Decoration:
        """The decoration as the edits left it."""
        assert self.painting is not None and self.decoration is not None
        done, engine = self.decoration, self.painting.document.engine
        materials = done.materials
        if len(materials) != len(self.painting.materials) or done.samples != engine.samples:
            materials = lit_by(self.painting, materials)
        return replace(done, quilt=engine.quilt(), samples=engine.samples, materials=materials)


class Timeline:
    """Chapters in a row, one of which is the present one."""

    def __init__(self) -> None:
        """Begin with nothing synthesised."""
        self.chapters = [Chapter()]
        self.place = 0

    @property
    def now(self) -> Chapter:
        """The present chapter."""
        return self.chapters[self.place]

    def begin(self, chapter: Chapter) -> None:
        """Go on with another background; what could be done again is forgotten."""
        self.forget_undone()
        if self.now.painting is not None:
            self.now.painting.document.forget_undone()
        self.chapters.append(chapter)
        del self.chapters[:-MOST]
        self.place = len(self.chapters) - 1

    def forget_undone(self) -> None:
        """Forget the chapters after the present one: a step was made in it."""
        del self.chapters[self.place + 1 :]

    @property
    def history(self) -> tuple[tuple[str, ...], int]:
        """Labels of all steps, and how many are done."""
        labels: list[str] = []
        at = 0
        for number, chapter in enumerate(self.chapters):
            if number:
                labels.append(chapter.label)
            done, undone = _steps(chapter)
            if number == self.place:
                at = len(labels) + len(done)
            labels += [*done, *undone]
        return tuple(labels), at

    def backward(self, progress: Progress = silent) -> I4 | None:
        """Undo one step: the vertices that changed, or None where another chapter is present."""
        painting = self.now.painting
        if painting is not None and painting.document.undo_label:
            return painting.document.undo(progress=progress)
        self.place = max(self.place - 1, 0)
        return None

    def forward(self, progress: Progress = silent) -> I4 | None:
        """Redo one step, as `backward` does."""
        painting = self.now.painting
        if painting is not None and painting.document.redo_label:
            return painting.document.redo(progress=progress)
        self.place = min(self.place + 1, len(self.chapters) - 1)
        return None

    def state(self, waiting: tuple[LayerView, ...] = (), busy: int | None = None) -> PaintState:
        """What the window shows; to be asked while nothing changes the painting."""
        now = self.now
        labels, at = self.history
        if now.painting is None:
            return PaintState(history=labels, at=at)
        layers, materials = now.painting.document.layers, now.painting.materials
        views = tuple(
            view_of(layer, now.painting.names, busy=layer.edit.uid == busy) for layer in layers
        )
        return PaintState(
            now.painting, now.background, views + waiting, labels, at,
            Mark(now.painting, layers, materials),
        )  # fmt: skip


def lit_by(painting: Painting, known: tuple[Material, ...] = ()) -> tuple[Material, ...]:
    """What the samples of a painting are lit with; none where one was stored without images.

    known : those of the first samples, where these are as they were.
    """
    btfs = [each.btf for each in painting.materials]
    if any(each is None for each in btfs):
        return ()
    return tuple(
        known[number] if number < len(known) else factor_material(btf)
        for number, btf in enumerate(btfs)
        if btf is not None
    )


def warm_up(document: Document) -> None:
    """Begin a stroke with the background's own feature and take it back, every bit of it.

    So tables are made and compiled code is loaded before the first stroke of the user.
    """
    engine = document.engine
    if engine.samples[0].mask is None:
        return
    vertex = len(engine.prepared.dense.vertices) // 2
    points = engine.prepared.dense.vertices[vertex : vertex + 1]
    stroke = Stroke(points.copy(), 8 * engine.step)
    try:
        session = document.begin(PaintEdit(area=Area(strokes=(stroke,)), sample=0))
    except PatinaError:
        return  # told when it is painted with
    try:
        session.extend(points + 2 * engine.step)
    except PatinaError:
        pass
    finally:
        session.cancel()


def _steps(chapter: Chapter) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return ((), ()) if chapter.painting is None else chapter.painting.document.steps


def _free(name: str, taken: tuple[str, ...]) -> str:
    number, free = 2, name
    while free in taken:
        number, free = number + 1, f"{name} {number}"
    return free
