"""Handles, borders, thin sheets, crumbs and dirt: all covered, quickly enough to be a test."""

import numpy as np
import pytest

from btfcore import pipeline
from btfcore.quilt.ledger import worst_patches
from btfcore.quilt.measure import measure_seams
from btfcore.quilt.parameters import QuiltParameters
from btfcore.types import Mesh
from tests.surfaces import blobs, sphere


def quilt_of(mesh, rate, most_patches):
    """Cover a mesh; `most_patches` is a tenth of its vertices or less."""
    prepared = pipeline.prepare(mesh, rate=rate)
    engine = pipeline.synthesizer(prepared, blobs(48, 48), QuiltParameters())
    quilt = engine.run()
    assert (quilt.patch >= 0).all() and np.isfinite(quilt.source).all()
    assert np.isfinite(quilt.angle).all() and np.isfinite(engine.state.ghost).all()
    assert engine.statistics.patches <= most_patches * len(quilt.patch)
    seams = measure_seams(engine.net, engine.state, engine.grid)
    assert np.isfinite(seams.per_vertex)
    rows = worst_patches(engine, prepared.dense, prepared.field)
    assert len(rows) <= 10 and all(row["reason"] for row in rows)
    return engine, seams


@pytest.mark.parametrize(
    ("name", "rate"),
    [
        ("fertility.off", 160), ("3holes.off", 160), ("plane_holes.obj", 160),
        ("teapot.obj", 160), ("soup.stl", 128), ("beetle.obj", 160), ("suzanne.obj", 160),
        ("fandisk.obj", 160), ("cube_no_bottom.obj", 128), ("busted.STL", 160),
    ],
)  # fmt: skip
def test_real_meshes_are_covered(data, name, rate):
    mesh, _ = pipeline.load_mesh(data / "meshes" / name)
    _, seams = quilt_of(mesh, rate, 0.03)
    assert seams.per_vertex < 0.25


def plate(thickness=0.01, side=12):
    """A closed double-sided plate of side 2."""
    line = np.linspace(-1, 1, side)
    x, y = np.meshgrid(line, line)
    top = np.stack([x, y, 0 * x + thickness / 2], axis=-1).reshape(-1, 3)
    index = np.arange(side * side).reshape(side, side)
    a, b, c, d = (
        part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:])
    )
    up = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
    rim = np.concatenate([index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]])
    after, below = np.roll(rim, -1), side * side
    walls = [(after, rim, rim + below), (after, rim + below, after + below)]
    faces = np.concatenate([up, up[:, ::-1] + below, *(np.stack(wall, 1) for wall in walls)])
    return Mesh(np.concatenate([top, top * [1, 1, -1]]), faces.astype(np.int32))


def test_both_sides_of_a_thin_plate_are_covered():
    _, seams = quilt_of(plate(), 192, 0.01)
    assert seams.per_vertex < 0.15


def test_hundreds_of_small_solids_are_covered():
    ball, random = sphere(0), np.random.default_rng(0)
    vertices = [ball.vertices * 0.05 + random.uniform(-1, 1, 3) for _ in range(300)]
    faces = [ball.faces + len(ball.vertices) * number for number in range(300)]
    mesh = Mesh(np.concatenate(vertices), np.concatenate(faces).astype(np.int32))
    engine, _ = quilt_of(mesh, 256, 0.2)
    solid = engine._flattener.dense.face // len(ball.faces)
    low, high = np.full(engine.state.patches, 300), np.full(engine.state.patches, -1)
    np.minimum.at(low, engine.state.patch, solid)
    np.maximum.at(high, engine.state.patch, solid)
    assert (low == high)[high >= 0].all()  # no patch spans two solids
    assert set(solid) == set(range(300))


def test_a_cone_with_a_sharp_tip_is_covered():
    angle, radius = np.linspace(0, 2 * np.pi, 24, endpoint=False), np.linspace(0.05, 1, 12)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle - 3], axis=1)
    vertices = np.concatenate([[(0, 0, 0)], *(r * ring for r in radius)])
    at, after = np.arange(24), (np.arange(24) + 1) % 24
    faces = [np.stack([0 * at, 1 + at, 1 + after], 1)]
    for start in range(1, 1 + 24 * 11, 24):
        faces.append(np.stack([start + at, start + at + 24, start + after + 24], 1))
        faces.append(np.stack([start + at, start + after + 24, start + after], 1))
    quilt_of(Mesh(vertices, np.concatenate(faces).astype(np.int32)), 160, 0.03)
