"""Samples of calm backgrounds on a sphere, and short ways to paint them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from btfcore.paint.document import Document
from btfcore.paint.edits import Area, PaintEdit, Stroke
from btfcore.paint.engine import Engine, Report
from btfcore.paint.region import constrain
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.synthesize import Synthesizer
from btfcore.types import Sample
from tests.paint.scenes import SIDE, blots, dot, featured, ready

AT = 1000  # a dense vertex away from creases and borders
BIG, LINE, OTHER = 0, 1, 2  # samples of the documents below


def calm(name: str, mask: np.ndarray, seed: int) -> Sample:
    """A sample whose background varies little against its feature."""
    sample = featured(name, mask, seed)
    background = 0.2 + 0.25 * sample.channels
    values = background + mask[..., None] * (sample.channels - background)
    values = np.ascontiguousarray(values, np.float32)
    return replace(sample, channels=values, colour=values.copy())


@cache
def samples() -> tuple[Sample, ...]:
    """A large blot, a line along the columns, and two blots of another colour."""
    other = calm("other", blots((30, 34, 16), (66, 60, 18)), 3)
    swapped = np.ascontiguousarray(other.channels[..., ::-1])
    row = np.mgrid[:SIDE, :SIDE][0]
    line = np.clip(4.5 - np.abs(row - SIDE / 2), 0, 1).astype(np.float32)
    return (
        calm("big", blots((48, 48, 24)), 2),
        calm("line", line, 4),
        replace(other, channels=swapped, colour=swapped.copy()),
    )


@cache
def background(mesh: str, rate: int, scale: float) -> Synthesizer:
    prepared = ready(mesh, rate)
    made = Synthesizer(
        prepared.dense, prepared.field, samples()[BIG],
        QuiltParameters(features=False, work_patch=16, scale=scale),
    )  # fmt: skip
    made.run()
    return made


def document(mesh: str = "sphere.obj", rate: int = 128, *, scale: float = 0.6) -> Document:
    made = background(mesh, rate, scale)
    return Document(Engine.over(ready(mesh, rate), samples(), made))


def report(doc: Document) -> Report:
    result = doc.layers[-1].result
    assert result is not None
    return result.report


def paint(doc: Document, area: Area | None = None, *, radius: float = 14.0, **knobs) -> Report:
    """Paint a round area unless another is given; transition in steps."""
    knobs = {"sample": BIG, "transition": 6.0, **knobs}
    if knobs["transition"] is not None:
        knobs["transition"] *= doc.engine.step
    doc.add(PaintEdit(area=dot(doc, AT, radius) if area is None else area, **knobs))
    return report(doc)


def wanted(doc: Document, area: Area, transition: float) -> np.ndarray:
    """m_0 (N,) of an area by itself; transition in steps."""
    engine = doc.engine
    found = constrain(
        area, doc.prepared.mesh, engine.net, engine.locator, width=transition * engine.step
    )
    return found.spread(len(engine.state.patch)).astype(np.float64)


def everyone(doc: Document) -> np.ndarray:
    return np.arange(len(doc.engine.state.patch), dtype=np.int32)


def arc(
    doc: Document, *, degrees: float = 70.0, radius: float, turn: float = 0.0, pressure=None,
    hardness: float = 1.0,
) -> Stroke:  # fmt: skip
    """Great circle over the sphere that begins at vertex AT; radius in steps."""
    dense, step = doc.prepared.dense, doc.engine.step
    up = np.asarray(dense.normals[AT], np.float64)
    middle = dense.vertices.mean(axis=0)
    size = np.linalg.norm(dense.vertices[AT] - middle)
    along = np.asarray(doc.prepared.field.tangents[AT], np.float64)
    along = along * np.cos(turn) + np.cross(up, along) * np.sin(turn)
    angle = np.radians(np.linspace(0, degrees, 40))[:, None]
    normals = np.cos(angle) * up + np.sin(angle) * along
    return Stroke(
        middle + size * normals, radius * step, normals=normals,
        pressure=None if pressure is None else np.asarray(pressure, np.float64),
        hardness=hardness,
    )  # fmt: skip
