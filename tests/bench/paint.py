"""Painting: how fast each tool answers, and what the result costs in energy.

The reference is the same engine that tries much more at every patch, see `THOROUGH`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass, fields, replace
from typing import Any

import numpy as np

import btfcore.paint.compose as compose
import btfcore.paint.foreground as foreground
import btfcore.paint.matching as matching
from btfcore.btf.joint import common_channels
from btfcore.paint.document import Document
from btfcore.paint.edits import Area, EraseEdit, PaintEdit, RepairEdit, StampEdit, Stroke
from btfcore.paint.engine import Engine
from btfcore.paint.region import constrain
from btfcore.paint.stamp import Stamper
from btfcore.pipeline import load_mesh, prepare, synthesizer
from btfcore.quilt.measure import measure_seams
from btfcore.quilt.parameters import QuiltParameters
from btfcore.samples import load_paint_sample
from btfcore.types import F8
from tests.bench.inputs import found, present
from tests.bench.table import machine, markdown, publish

MESH = "bunny.obj"
SAMPLES, QUICK_SAMPLES = ("cracked-brick.btfz", "mossy-stone.btfz", "rusty-paint.btfz"), 1
RATES, QUICK = (512, 1024), (128,)
SHARES = (0.01, 0.05)  # of the surface, covered by one stroke
RUNS = 3  # of which the median is told
MOVES = 40  # of the cursor, for previews
THOROUGH = {"PLACEMENTS": 16, "EXTENDED": 4, "LOOKED_AT": 8, "WORTH": 0.002, "TRIES": 4}
"""Knobs of the reference: placements cut and looked at, and when to leave off."""
NOTE = """Warm, wall milliseconds (medians of three; previews: median and 95th percentile over
40 moves of the cursor with turns). *first*: from the first point of a stroke to the first patch
shown; *step*: longest answer to one point while drawing (ray cast and display left out); *all*:
the stroke from its first point to its last patch, points as fast as they are taken; *area*: share
of the surface that the brush covers; *reached*: of it, as wanted; *E*: energy of the vertices
looked at over that before; *thorough*: the same with 16 placements cut at every patch and as many
tries as help: its time and E over ours; *seam*: mean of ½ V_pq per seam edge there over the
background's own; *moved*: vertices changed outside what the edit says that it touched."""


@dataclass(frozen=True)
class Stroked:
    """One stroke."""

    sample: str
    rate: int
    turns: str
    area: float
    first_ms: float
    step_ms: float
    all_ms: float
    patches: int
    reached: float
    E: float
    thorough_time: float
    thorough_E: float
    seam: float
    moved: int


@dataclass(frozen=True)
class Tool:
    """The other tools on one document."""

    sample: str
    rate: int
    channels: int
    preview_first: float
    preview: float
    preview_95: float
    stamp: float
    erase: float
    repair: float
    undo: float
    redo: float
    hide_lowest: float
    history_kb: float


def document(mesh: str, sample: str, rate: int) -> Document:
    """Background from a sample's own background, ready to be painted on with its feature."""
    prepared = prepare(load_mesh(found(mesh))[0], rate=rate)
    (ready,), _ = common_channels([load_paint_sample(found(sample))[0]])
    made = synthesizer(prepared, ready, QuiltParameters(features=False))
    made.run()
    return Document(Engine.over(prepared, [ready], made))


def ring(document: Document, height: float = 0.45, count: int = 400) -> tuple[F8, F8]:
    """Points (n, 3) and normals around the mesh at a share of its height."""
    dense = document.prepared.dense
    points, normals = np.asarray(dense.vertices), np.asarray(dense.normals, np.float64)
    low, high = points.min(axis=0), points.max(axis=0)
    level = low[1] + height * (high[1] - low[1])
    near = np.flatnonzero(np.abs(points[:, 1] - level) < 1.5 * document.engine.step)
    middle = points[near].mean(axis=0)
    away = points[near] - middle
    angle = np.arctan2(away[:, 2], away[:, 0])
    far = np.hypot(away[:, 0], away[:, 2])
    chosen = []
    for sector in range(count):
        inside = np.abs(angle - (-np.pi + 2 * np.pi * (sector + 0.5) / count)) < np.pi / count
        if inside.any():
            chosen.append(near[inside][int(far[inside].argmax())])
    return points[chosen], normals[chosen]


def stroke_over(document: Document, share: float) -> Stroke:
    """Return a stroke along the ring that covers `share` of the surface.

    Its radius is the feature's half-width at rates up to 512, and as large as there above.
    """
    engine = document.engine
    points, normals = ring(document)
    natural = max(engine.palette.half_width(0) * engine.palette.grids[0].unit, 5.0)
    at_512 = engine.step * max(document.prepared.dense.size / 512, 1.0)
    radius = natural * at_512 * (1.0 if share < 0.03 else 1.6)
    low, high = 2, len(points)
    while high - low > 1:
        middle = (low + high) // 2
        area = Area(strokes=(Stroke(points[:middle], radius, normals[:middle]),))
        covered = constrain(area, document.prepared.mesh, engine.net, engine.locator)
        if len(covered.vertices) < share * len(engine.state.patch):
            low = middle
        else:
            high = middle
    return Stroke(points[:high].copy(), radius, normals[:high].copy())


def drawn(document: Document, stroke: Stroke) -> tuple[float, float, float]:
    """Draw a stroke point by point; milliseconds to the first patch, longest step, and all."""
    begun = time.perf_counter()
    head = replace(
        stroke, points=stroke.points[:1].copy(),
        normals=None if stroke.normals is None else stroke.normals[:1].copy(),
    )  # fmt: skip
    session = document.begin(PaintEdit(area=Area(strokes=(head,)), sample=0))
    first, longest = 0.0, 0.0
    for at in range(1, len(stroke.points)):
        began = time.perf_counter()
        changed = session.extend(
            stroke.points[at : at + 1],
            None if stroke.normals is None else stroke.normals[at : at + 1],
        )
        now = time.perf_counter()
        longest = max(longest, now - began)
        if len(changed) and not first:
            first = now - begun
    session.finish()
    whole = time.perf_counter() - begun
    return 1e3 * (first or whole), 1e3 * longest, 1e3 * whole


@contextmanager
def thorough() -> Iterator[None]:
    """Try much more at every patch."""
    modules = {"PLACEMENTS": compose, "EXTENDED": compose, "LOOKED_AT": matching}
    kept = {}
    for name, value in THOROUGH.items():
        module = modules.get(name, foreground)
        kept[name] = (module, getattr(module, name))
        setattr(module, name, value)
    try:
        yield
    finally:
        for name, (module, value) in kept.items():
            setattr(module, name, value)


def measure_stroke(document: Document, sample: str, share: float) -> Stroked:
    """Draw one stroke several times, and once thoroughly; the document is as it was."""
    engine = document.engine
    stroke = stroke_over(document, share)
    times = []
    before = engine.copy()
    for _ in range(RUNS):
        times.append(drawn(document, stroke))
        result = document.layers[-1].result
        assert result is not None
        report, touched = result.report, result.delta.vertices
        moved = len(np.setdiff1d(engine.differences(before), touched))
        document.undo()
    moved += len(engine.differences(before))
    with thorough():
        began = time.perf_counter()
        document.add(PaintEdit(area=Area(strokes=(stroke,)), sample=0))
        slow = 1e3 * (time.perf_counter() - began)
        result = document.layers[-1].result
        assert result is not None
        document.undo()
    first, step, whole = np.median(np.array(times), axis=0).tolist()
    seams = measure_seams(engine.net, engine.state, engine.palette.grids[0])
    start = report.weight * report.constraint_before + report.smooth_before
    ours = report.weight * report.constraint + report.smooth
    # over the same vertices: what each left of the energy that its own were at
    other = result.report
    gain = (
        other.weight * (other.constraint - other.constraint_before)
        + other.smooth - other.smooth_before
    )  # fmt: skip
    return Stroked(
        sample=sample.removesuffix(".btfz"),
        rate=document.prepared.dense.size,
        turns="24" if engine.isotropic(0) else "1",
        area=report.area / len(engine.state.patch),
        first_ms=first,
        step_ms=step,
        all_ms=whole,
        patches=report.patches,
        reached=report.reached / max(report.area, 1),
        E=ours / start,
        thorough_time=slow / whole,
        thorough_E=(start + gain) / ours,
        seam=report.seam / max(seams.per_edge, 1e-12),
        moved=moved,
    )


def timed(verb: Callable[[], Any], undo: Callable[[], Any] | None = None) -> float:
    """Median wall milliseconds of a verb, which `undo` takes back each time."""
    times = []
    for _ in range(RUNS):
        began = time.perf_counter()
        verb()
        times.append(1e3 * (time.perf_counter() - began))
        if undo is not None:
            undo()
    return float(np.median(times))


def measure_tools(document: Document, sample: str) -> Tool:
    """Time the other tools; the document is left with the edits that they made."""
    engine = document.engine
    points, normals = ring(document, 0.55)
    stamper = Stamper(engine)
    previews = []
    for move in range(MOVES + 1):
        at = (move * len(points)) // (3 * (MOVES + 1))
        edit = StampEdit(
            point=tuple(points[at].tolist()), normal=tuple(normals[at].tolist()), sample=0,
            rotation=9.0 * move,
        )  # fmt: skip
        began = time.perf_counter()
        stamper.preview(edit)
        previews.append(1e3 * (time.perf_counter() - began))
    stamp = timed(lambda: document.add(edit), document.undo)
    stroke = stroke_over(document, SHARES[-1])
    document.add(PaintEdit(area=Area(strokes=(stroke,)), sample=0))
    undo, redo = [], []
    for _ in range(RUNS):
        undo.append(timed_once(document.undo))
        redo.append(timed_once(document.redo))
    history = document.layers[-1].result
    assert history is not None
    for place in range(10):
        at = (place + 1) * len(points) // 11
        document.add(replace(edit, point=tuple(points[at].tolist()), normal=None))
    lowest = document.edits[0].uid
    document.show(lowest, False)  # computes anew what lay on it
    document.show(lowest, True)
    hide = timed(lambda: document.show(lowest, False), document.undo)
    while len(document.layers) > 1:
        document.undo()
    small = stroke_over(document, SHARES[0])
    erase = timed(lambda: document.add(EraseEdit(area=Area(strokes=(small,)))), document.undo)
    repair = timed(lambda: document.add(RepairEdit(area=Area(strokes=(small,)))), document.undo)
    return Tool(
        sample=sample.removesuffix(".btfz"),
        rate=document.prepared.dense.size,
        channels=engine.palette.sheet.cut.shape[2],
        preview_first=previews[0],
        preview=float(np.median(previews[1:])),
        preview_95=float(np.percentile(previews[1:], 95)),
        stamp=stamp,
        erase=erase,
        repair=repair,
        undo=float(np.median(undo)),
        redo=float(np.median(redo)),
        hide_lowest=hide,
        history_kb=history.delta.nbytes / 1e3,
    )


def timed_once(verb: Callable[[], Any]) -> float:
    """Wall milliseconds of a verb."""
    began = time.perf_counter()
    verb()
    return 1e3 * (time.perf_counter() - began)


def run(
    mesh: str, samples: Iterable[str], rates: Iterable[int]
) -> tuple[list[Stroked], list[Tool]]:
    """Measure all strokes and tools."""
    strokes, tools = [], []
    for sample in samples:
        for rate in rates:
            here = document(mesh, sample, rate)
            strokes += [measure_stroke(here, sample, share) for share in SHARES]
            tools.append(measure_tools(here, sample))
    return strokes, tools


def main(*, write: bool = False, quick: bool = False) -> None:
    """Print both tables; `quick` keeps to one sample and a small rate."""
    (mesh,), _ = present([MESH])
    samples = SAMPLES[:QUICK_SAMPLES] if quick else SAMPLES
    run("sphere.obj", samples[:1], [96])  # compiles what there is to compile
    strokes, tools = run(mesh, samples, QUICK if quick else RATES)
    text = [f"## Painting: {MESH}", machine()]
    for kind, rows in ((Stroked, strokes), (Tool, tools)):
        columns = [item.name.replace("_", " ") for item in fields(kind)]
        text.append(markdown(columns, [astuple(row) for row in rows]))
    publish("paint", "\n\n".join([*text, NOTE]), write=write)
