"""The last part of every edit: its figures and its delta."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from btfcore.errors import InvalidEdit
from btfcore.paint.compose import Tally
from btfcore.paint.constrained import Energy, energy
from btfcore.paint.edits import PaintEdit
from btfcore.paint.engine import Engine, Report, Result
from btfcore.paint.foreground import Painter
from btfcore.progress import Progress, between
from btfcore.types import F8, I4

UNLIKE = 1.5  # times as far from the background as the sample's own is worth a note


def painted(engine: Engine, painter: Painter, edit: PaintEdit, progress: Progress) -> Result:
    """Fill what the strokes left, and end a paint edit."""
    area = painter.area
    if not len(area):
        raise InvalidEdit(
            f"{edit.name or 'the edit'}: its strokes cover no vertex of the surface"
            f" ({painter.off_surface} places of the brush lie beside it)"
        )
    if (engine.state.patch[area] < 0).all():
        raise InvalidEdit(f"{edit.name or 'the edit'}: nothing is synthesised yet in its area")
    painter.fill(progress=between(progress, 0.0, 0.8))
    painter.polish(progress=between(progress, 0.8, 1.0))
    notes = []
    if painter.off_surface:
        notes.append(f"{painter.off_surface} places of the brush lie beside the surface")

    if engine.unit(edit.sample) > UNLIKE * engine.palette.normaliser(edit.sample):
        notes.append("the sample is of another colour than the background: the cut edge will show")

    def reached() -> int:
        return int((painter._present(area) >= 0.5).sum())

    return concluded(
        engine, painter.composer.tally, edit.sample, edit.weight, painter.target, area, reached,
        notes, asked=painter.asked,
    )  # fmt: skip


def concluded(
    engine: Engine,
    tally: Tally,
    sample: int,
    weight: float,
    target: Callable[[I4], F8],
    area: I4,
    reached: Callable[[], int],
    notes: list[str],
    *,
    any_sample: bool = False,
    asked: Callable[[I4], F8] | None = None,
) -> Result:
    """End the running edit and measure what it left against what was there.

    target: m_0 of vertices; area: those that it was asked for, reached: how many of them are
    as wanted; any_sample, asked: see `constrained.energy`.
    """
    looked = engine.recorder.looked
    stored = target(looked).astype(np.float32)
    wanted = stored.astype(np.float64)  # so that E is what anybody finds from what is stored
    found = reached()

    def measured() -> Energy:
        return energy(
            engine.net, engine.state, engine.palette, sample, wanted, looked,
            any_sample=any_sample, asked=None if asked is None else asked(looked),
            unit=engine.unit(sample),
        )  # fmt: skip

    after = measured()
    delta = engine.finish(stored)
    delta.take_off(engine.net, engine.state, engine.writer)
    before = measured()  # where this fails, the quilt is as it was
    delta.put_on(engine.net, engine.state, engine.writer)
    if len(area) and found < 0.5 * len(area):
        notes = [*notes, f"only {found / len(area):.0%} of the area is as wanted"]
    report = Report(
        patches=tally.kept,
        tries=tally.tries,
        area=len(area),
        reached=found,
        weight=weight,
        constraint=after.constraint,
        constraint_before=before.constraint,
        smooth=after.smooth,
        smooth_before=before.smooth,
        seam=_per_edge(engine, sample, after),
        seam_before=_per_edge(engine, sample, before),
        notes=tuple([*tally.notes, *notes]),
    )
    return Result(delta, report)


def _per_edge(engine: Engine, sample: int, found: Energy) -> float:
    """Mean of ½ V_pq over the seam edges, in the sample's texel differences."""
    step = max(engine.palette.grids[sample].texel_difference, 1e-12)
    total = found.smooth * engine.unit(sample)
    return float(np.float64(total) / max(found.seam_edges, 0.5) / 2 / step)
