"""A small decorated surface that the tests of edits paint on, made once and copied."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter

from btfcore.paint.document import Document
from btfcore.paint.edits import Area, Stroke
from btfcore.paint.engine import Engine, copied
from btfcore.patch.connectivity import connect
from btfcore.pipeline import load_mesh, prepare
from btfcore.quilt.layout import Borders, lay_out
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.synthesize import Synthesizer
from btfcore.types import F4, Prepared, Sample

MESHES = Path(__file__).resolve().parents[2] / "resources" / "meshes"
SIDE = 96


def pattern(seed: int, *, tint: float = 0.0) -> F4:
    """Colours (SIDE, SIDE, 3) in 0–0.6 with structure at several texels."""
    noise = np.random.default_rng(seed).standard_normal((SIDE, SIDE, 3))
    soft = np.stack([gaussian_filter(noise[..., k], 2.0, mode="wrap") for k in range(3)], axis=-1)
    soft = (soft - soft.min()) / (soft.max() - soft.min())
    return (0.6 * soft + tint).astype(np.float32)


def blots(*spots: tuple[float, float, float]) -> F4:
    """Mask (SIDE, SIDE) with soft discs of (column, row, radius)."""
    row, column = np.mgrid[:SIDE, :SIDE]
    mask = np.zeros((SIDE, SIDE))
    for x, y, radius in spots:
        away = np.hypot(column - x, row - y)
        mask = np.maximum(mask, np.clip(radius + 0.5 - away, 0, 1))
    return mask.astype(np.float32)


def crack() -> F4:
    """Mask (SIDE, SIDE) of a soft winding line from the left border to the right one."""
    row, column = np.mgrid[:SIDE, :SIDE]
    away = np.abs(row - SIDE / 2 - 6 * np.sin(column / 9.0))
    return np.clip(4.5 - away, 0, 1).astype(np.float32)


def featured(name: str, mask: F4, seed: int = 0, *, tint: float = 0.0) -> Sample:
    """Sample whose feature is bright where `mask` is 1."""
    colour = pattern(seed, tint=tint)
    bright = np.array([0.95, 0.85, 0.2], np.float32)
    colour = colour + mask[..., None] * (bright - colour)
    colour = np.ascontiguousarray(colour, np.float32)
    return Sample(name, colour, colour.copy(), mask=mask)


@cache
def cracked() -> Sample:
    return featured("cracked", crack())


@cache
def spotted() -> Sample:
    """Three discs, the largest first; none touches the border."""
    return featured("spotted", blots((30, 34, 11), (70, 26, 7), (62, 70, 5)), 1, tint=0.1)


@cache
def ready(mesh: str = "spot.obj", rate: int = 96) -> Prepared:
    return prepare(load_mesh(MESHES / mesh)[0], rate=rate)


@cache
def _made(mesh: str, rate: int, first: str) -> Synthesizer:
    prepared = ready(mesh, rate)
    sample = {"cracked": cracked, "spotted": spotted}[first]()
    made = Synthesizer(
        prepared.dense, prepared.field, sample, QuiltParameters(features=False, work_patch=16)
    )
    made.run()
    return made


def document(mesh: str = "spot.obj", rate: int = 96, *, budget_mb: float = 256.0) -> Document:
    """Background of the cracked sample; the spotted one may be painted too (sample 1)."""
    return Document(
        Engine.over(ready(mesh, rate), (cracked(), spotted()), _made(mesh, rate, "cracked")),
        budget_mb=budget_mb,
    )


@cache
def _divided(hard: bool, rate: int) -> Synthesizer:
    prepared = ready("spot.obj", rate)
    knobs = QuiltParameters(features=False, work_patch=16)
    region = (prepared.dense.vertices[:, 1] > 0.1).astype(np.int32)
    net = connect(prepared.dense, prepared.field)
    layout = lay_out(net, region, [0, 1], Borders.all(hard), knobs.border)
    made = Synthesizer(
        prepared.dense, prepared.field, (cracked(), spotted()), knobs, layout=layout
    )  # fmt: skip
    made.run()
    return made


def divided(*, hard: bool, rate: int = 96) -> Document:
    """Background of the cracked sample below and of the spotted one above."""
    made = _divided(hard, rate)
    return Document(Engine.over(ready("spot.obj", rate), (cracked(), spotted()), made))


def stroke(
    doc: Document, *, at: int = 0, length: int = 40, radius: float = 4.0, seed: int = 0
) -> Stroke:
    """Walk on the surface that begins at dense vertex `at`; radius and length in steps."""
    dense, net = doc.prepared.dense, doc.engine.net
    heading = np.random.default_rng(seed).standard_normal(3)
    vertex, walk = at, [at]
    for _ in range(length):
        near = net.indices[net.indptr[vertex] : net.indptr[vertex + 1]]
        ahead = dense.vertices[near] - dense.vertices[vertex]
        ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=1), 1e-12)[:, None]
        vertex = int(near[int((ahead * heading).sum(axis=1).argmax())])
        if vertex in walk[-3:]:
            break
        walk.append(vertex)
    at_ = np.array(walk)
    return Stroke(
        dense.vertices[at_].copy(), radius * doc.engine.step,
        normals=dense.normals[at_].astype(np.float64),
    )  # fmt: skip


def dot(doc: Document, at: int, radius: float = 6.0) -> Area:
    """Round area about a dense vertex; radius in steps."""
    return Area(
        strokes=(
            Stroke(
                doc.prepared.dense.vertices[at : at + 1].copy(), radius * doc.engine.step,
                normals=doc.prepared.dense.normals[at : at + 1].astype(np.float64),
            ),
        )
    )  # fmt: skip


def bits(doc: Document) -> tuple[bytes, ...]:
    """The whole state of the quilt, ghosts included, as bytes."""
    state = doc.engine.state
    arrays = (state.source, state.angle, state.sample, state.patch, state.ghost)
    return tuple(array.tobytes() for array in arrays)


def feature(doc: Document, vertices: np.ndarray) -> F4:
    """m_S of whatever `vertices` show."""
    state = doc.engine.state
    return doc.engine.palette.feature_at(state.sample[vertices], state.source[vertices])


def fresh(doc: Document) -> Document:
    """Document over the background of `doc`, without edits."""
    engine = doc.engine
    state = copied(engine.state)
    for layer in reversed(doc.layers):
        if layer.edit.visible and layer.result is not None:
            layer.result.delta.take_off(engine.net, state, engine.writer.copy())
    return Document(
        Engine(
            engine.prepared, engine.samples, engine.net, state, engine.parameters,
            layout=engine.layout, scales=engine.scales,
        )
    )  # fmt: skip
