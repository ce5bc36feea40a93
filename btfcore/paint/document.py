"""The document: a decorated surface, its background, and an ordered list of edits.

Edits are never merged into the background. Each keeps its delta; a change of the list takes
deltas off from the top down to the first place that differs and puts them on again in the new
order, computing anew only those whose ground has changed (see `delta`). So hiding, deleting,
reordering and undo cost memory traffic, not synthesis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from btfcore.errors import InvalidEdit
from btfcore.paint.edits import Edit, PaintEdit, StampEdit, knobs_of
from btfcore.paint.engine import Engine, Result
from btfcore.paint.operations import check, run
from btfcore.paint.session import Session
from btfcore.paint.stamp import Preview, Stamper
from btfcore.progress import Progress, between, silent
from btfcore.types import I4, Prepared, Quilt, Sample

PASSIVE = ("name", "visible")  # fields that change nothing on the surface


@dataclass(frozen=True, eq=False)
class Layer:
    """An edit and what it did; result: None until it was computed."""

    edit: Edit
    result: Result | None = None


@dataclass(frozen=True, eq=False)
class _Step:
    """A step of the history: the layers before and after, and the results of one of them only."""

    label: str
    before: tuple[Layer, ...]
    after: tuple[Layer, ...]
    results: tuple[Result, ...]


class Document:
    """Edits over a background; every verb is one undoable step and returns what it changed.

    All verbs may raise `InvalidEdit`, or `Cancelled` through their `progress`; the document
    is then as it was before.
    """

    def __init__(self, engine: Engine, *, budget_mb: float = 256.0) -> None:
        """Take over `engine`, whose quilt is the background.

        budget_mb: memory for undo; beyond it the oldest steps are forgotten.
        """
        self.engine = engine
        self.budget_mb = budget_mb
        self.layers: tuple[Layer, ...] = ()
        self._next_uid = 0
        self._done: list[_Step] = []
        self._undone: list[_Step] = []
        self._stamper = Stamper(engine)

    # --- what there is

    @property
    def prepared(self) -> Prepared:
        """The mesh, its atlas, dense mesh and field."""
        return self.engine.prepared

    @property
    def samples(self) -> tuple[Sample, ...]:
        """The samples that edits name by number; the first are the background's."""
        return self.engine.samples

    @property
    def edits(self) -> tuple[Edit, ...]:
        """All edits, bottom first."""
        return tuple(layer.edit for layer in self.layers)

    @property
    def next_uid(self) -> int:
        """Uid that the next edit gets."""
        return self._next_uid

    def layer(self, uid: int) -> Layer:
        """The layer of edit `uid`; raises `InvalidEdit` where there is none."""
        return self.layers[self._place(uid)]

    def quilt(self) -> Quilt:
        """Frozen copy of the decorated surface, with patches numbered without gaps."""
        return self.engine.quilt()

    # --- verbs

    def add(self, edit: Edit, *, progress: Progress = silent) -> I4:
        """Put an edit on top; it gets a uid. Returns the vertices (n,) that changed."""
        edit = self.admit(edit)
        changed = self._step(f"add {edit.name}", (*self.layers, Layer(edit)), progress)
        self._next_uid = edit.uid + 1
        return changed

    def preview(self, edit: StampEdit) -> tuple[Preview, ...]:
        """Where a stamp's feature would lie, and those of its images; nothing changes.

        Discs under the last places are kept, so that turning and scaling cost little. Raises
        `InvalidEdit` where the point is off the surface or the feature is not there.
        """
        check(self.engine, edit)
        self._idle()
        return self._stamper.preview(edit)

    def begin(self, edit: PaintEdit) -> Session:
        """Begin a stroke that is painted while it is drawn (see `Session`).

        `edit` holds the first point of its last stroke; nothing else may change the document
        before the session is finished or cancelled.
        """
        self._idle()
        return Session(self.engine, self.admit(edit), self._finished)

    def remove(self, uid: int, *, progress: Progress = silent) -> I4:
        """Delete an edit."""
        at = self._place(uid)
        name = self.layers[at].edit.name
        return self._step(f"delete {name}", self.layers[:at] + self.layers[at + 1 :], progress)

    def move(self, uid: int, place: int, *, progress: Progress = silent) -> I4:
        """Put an edit at another place of the list, 0 being the bottom."""
        at = self._place(uid)
        if not 0 <= place < len(self.layers):
            raise InvalidEdit(f"place {place} of {len(self.layers)} edits")
        rest = [*self.layers[:at], *self.layers[at + 1 :]]
        rest.insert(place, self.layers[at])
        return self._step(f"move {self.layers[at].edit.name}", tuple(rest), progress)

    def show(self, uid: int, visible: bool, *, progress: Progress = silent) -> I4:
        """Hide an edit or show it again."""
        return self.change(uid, progress=progress, visible=visible)

    def change(self, uid: int, /, *, progress: Progress = silent, **knobs: object) -> I4:
        """Change fields of an edit (see `edits`)."""
        at = self._place(uid)
        layer = self.layers[at]
        unknown = sorted(set(knobs) - set(knobs_of(layer.edit)))
        if unknown or "uid" in knobs:
            raise InvalidEdit(f"this edit has no field {', '.join(unknown) or 'uid'} to change")
        edit = replace(layer.edit, **knobs)  # type: ignore[arg-type]
        check(self.engine, edit)
        kept = layer.result if set(knobs) <= set(PASSIVE) else None
        layers = (*self.layers[:at], Layer(edit, kept), *self.layers[at + 1 :])
        verb = "change"
        if set(knobs) == {"visible"}:
            verb = "show" if edit.visible else "hide"
        elif set(knobs) == {"name"}:
            verb = "rename"
        return self._step(f"{verb} {edit.name}", layers, progress)

    def replay(self, *, progress: Progress = silent) -> I4:
        """Compute all visible edits anew, bottom first; returns the vertices that differ: none."""
        before = self.engine.copy()
        self._become(tuple(Layer(layer.edit) for layer in self.layers), progress)
        return self.engine.differences(before)

    # --- history

    @property
    def undo_label(self) -> str:
        """What `undo` would take back; "" where there is nothing."""
        return self._done[-1].label if self._done else ""

    @property
    def redo_label(self) -> str:
        """What `redo` would do again; "" where there is nothing."""
        return self._undone[-1].label if self._undone else ""

    @property
    def steps(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Labels of the steps that are done, and of those that `redo` would do, in their order."""
        undone = tuple(step.label for step in reversed(self._undone))
        return tuple(step.label for step in self._done), undone

    def forget_undone(self) -> None:
        """Let nothing be done again."""
        self._undone.clear()

    def undo(self, *, progress: Progress = silent) -> I4:
        """Take the last step back; returns the vertices that changed, none where there is none."""
        if not self._done:
            return np.zeros(0, np.int32)
        changed = self._become(self._done[-1].before, progress)
        self._undone.append(self._done.pop())
        return changed

    def redo(self, *, progress: Progress = silent) -> I4:
        """Do the last step again that was taken back."""
        if not self._undone:
            return np.zeros(0, np.int32)
        changed = self._become(self._undone[-1].after, progress)
        self._done.append(self._undone.pop())
        return changed

    @property
    def history_mb(self) -> float:
        """Memory that undo and redo hold beyond the layers themselves."""
        return _megabytes(self._done + self._undone, self.layers)

    # --- inside

    def admit(self, edit: Edit) -> Edit:
        """Check an edit and give it the next uid and, where it has none, a name.

        The uid is taken once the edit is in the document.
        """
        check(self.engine, edit)
        uid = self._next_uid
        return replace(edit, uid=uid, name=edit.name or f"{type(edit).__name__[:-4]} {uid + 1}")

    def restore(self, layers: Sequence[Layer], next_uid: int) -> None:
        """Take the layers of a stored document, whose deltas are on the quilt already."""
        self.layers, self._next_uid = tuple(layers), next_uid
        self._done.clear()
        self._undone.clear()

    def _place(self, uid: int) -> int:
        for at, layer in enumerate(self.layers):
            if layer.edit.uid == uid:
                return at
        raise InvalidEdit(f"there is no edit {uid}")

    def _finished(self, edit: Edit, result: Result) -> None:
        """Take what a session painted."""
        before = self.layers
        self.layers = (*before, Layer(edit, result))
        self._next_uid = edit.uid + 1
        self._remember(f"add {edit.name}", before)

    def _step(self, label: str, layers: tuple[Layer, ...], progress: Progress) -> I4:
        before = self.layers
        changed = self._become(layers, progress)
        self._remember(label, before)
        return changed

    def _idle(self) -> None:
        if self.engine.busy:
            raise InvalidEdit("a stroke is being drawn; finish or cancel it first")

    def _remember(self, label: str, before: tuple[Layer, ...]) -> None:
        """Put the step from the layers `before` to those now on the history."""
        one, other = _results(before), _results(self.layers)
        differ = tuple(
            result for at, result in (one | other).items() if (at in one) != (at in other)
        )
        self._done.append(_Step(label, before, self.layers, differ))
        self._undone.clear()
        while len(self._done) > 1 and self.history_mb > self.budget_mb:
            self._done.pop(0)

    def _become(self, wanted: tuple[Layer, ...], progress: Progress) -> I4:
        """Make the quilt that of `wanted`; returns the vertices that were written."""
        self._idle()
        engine, old = self.engine, self.layers
        same = 0
        while same < min(len(old), len(wanted)) and _alike(old[same], wanted[same]):
            same += 1
        for layer in reversed(old[same:]):
            _take_off(engine, layer)
        layers = list(wanted[:same])
        try:
            for at in range(same, len(wanted)):
                part = between(progress, at / len(wanted), (at + 1) / len(wanted))
                layers.append(self._put_on(wanted[at], part))
        except BaseException:
            for layer in reversed(layers[same:]):
                _take_off(engine, layer)
            for layer in old[same:]:
                if layer.edit.visible and layer.result is not None:
                    engine.put_on(layer.result)
            raise
        self.layers = tuple(layers)
        return _written([*old[same:], *layers[same:]])

    def _put_on(self, layer: Layer, progress: Progress) -> Layer:
        if not layer.edit.visible:
            return layer
        if layer.result is not None and self.engine.fits(layer.result):
            self.engine.put_on(layer.result)
            return layer
        return Layer(layer.edit, run(self.engine, layer.edit, progress=progress))


def _take_off(engine: Engine, layer: Layer) -> None:
    if layer.edit.visible and layer.result is not None:
        engine.take_off(layer.result)


def _alike(one: Layer, other: Layer) -> bool:
    """Whether two layers do the same to the same ground."""
    return one is other or (
        one.result is not None
        and one.result is other.result
        and one.edit.visible == other.edit.visible
    )


def _written(layers: Sequence[Layer]) -> I4:
    """Vertices that any of `layers` writes, ascending."""
    parts = [
        layer.result.delta.vertices
        for layer in layers
        if layer.result is not None and layer.edit.visible
    ]
    return np.unique(np.concatenate([np.zeros(0, np.int32), *parts]))


def _megabytes(steps: Sequence[_Step], now: Sequence[Layer]) -> float:
    """Memory of the results that only `steps` hold, each counted once."""
    mine = _results(now)
    held = {
        id(result): result.delta.nbytes
        for step in steps
        for result in step.results
        if id(result) not in mine
    }
    return sum(held.values()) / 1e6


def _results(layers: Sequence[Layer]) -> dict[int, Result]:
    """Results of `layers` by their identity."""
    return {id(layer.result): layer.result for layer in layers if layer.result is not None}
