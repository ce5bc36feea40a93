"""Every kind of edit by the verb that computes it."""

from __future__ import annotations

from btfcore.errors import InvalidEdit
from btfcore.paint.edits import (
    Edit,
    EraseEdit,
    PaintEdit,
    RepairEdit,
    RequiltEdit,
    StampEdit,
)
from btfcore.paint.engine import Engine, Result
from btfcore.paint.foreground import Painter
from btfcore.paint.local import erase, repair, requilt
from btfcore.paint.outcome import painted
from btfcore.paint.session import draw
from btfcore.paint.stamp import Stamper
from btfcore.progress import Progress, between, silent

DRAWN = 0.7  # share of a paint edit's time that its strokes take, roughly


def run(engine: Engine, edit: Edit, *, progress: Progress = silent) -> Result:
    """Compute `edit` on the quilt as it is; whatever interrupts that, the quilt is unchanged.

    Raises `InvalidEdit` where the edit does not fit the surface or the samples.
    """
    check(engine, edit)
    with engine.recording(edit.uid):
        if isinstance(edit, PaintEdit):
            painter = Painter(engine, edit)
            strokes = edit.area.strokes
            for at, stroke in enumerate(strokes):
                share = (DRAWN * at / len(strokes), DRAWN * (at + 1) / len(strokes))
                draw(painter, stroke, between(progress, *share))
            return painted(engine, painter, edit, between(progress, DRAWN, 1.0))
        if isinstance(edit, StampEdit):
            return Stamper(engine).merge(edit, progress)
        if isinstance(edit, EraseEdit):
            return erase(engine, edit, progress)
        if isinstance(edit, RepairEdit):
            return repair(engine, edit, progress)
        if isinstance(edit, RequiltEdit):
            return requilt(engine, edit, progress)
    raise InvalidEdit(f"an edit of kind {type(edit).__name__}")


def check(engine: Engine, edit: Edit) -> None:
    """Raise `InvalidEdit` where an edit names a sample or feature that is not there."""
    if not isinstance(edit, PaintEdit | StampEdit):
        return
    count = len(engine.samples)
    if not 0 <= edit.sample < count:
        raise InvalidEdit(f"{edit.name or 'the edit'} names sample {edit.sample} of {count}")
    if isinstance(edit, StampEdit):
        engine.part(edit.sample, edit.feature)
    else:
        engine.parts(edit.sample)
