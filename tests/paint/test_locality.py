"""Painting changes nothing far from its area, and the same edit gives the same bits."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from btfcore.paint.document import Document
from btfcore.paint.edits import Area, PaintEdit, Symmetry
from btfcore.paint.region import constrain
from btfcore.patch.grow import grow, release
from tests.paint import scenes
from tests.paint.scenes import bits, dot, stroke

ROOT = Path(__file__).resolve().parents[2]
RADIUS = 10  # of the work patches, in levels

RATE = 160

PAINTED = """
import sys
from tests.paint.test_locality import digest, painted
print(digest(painted(sys.argv[1])))
"""


def document() -> Document:
    return scenes.document(rate=RATE)


def edit_of(doc: Document, kind: str) -> PaintEdit:
    """One edit of every kind of area and orientation, work patches of RADIUS."""
    step = doc.engine.step
    if kind == "stroke":
        area = Area(strokes=(stroke(doc, at=300, radius=5.0),))
        return PaintEdit(area=area, sample=0, work_patch=RADIUS, orientation="search")
    if kind == "along":
        area = Area(strokes=(stroke(doc, at=900, radius=5.0, seed=3),))
        return PaintEdit(area=area, sample=0, work_patch=RADIUS, orientation="stroke")
    if kind == "vertices":
        near, _ = grow(
            doc.engine.net.indptr, doc.engine.net.indices, 1500, 9, doc.engine.flattener.local,
            10**6,
        )  # fmt: skip
        release(near, doc.engine.flattener.local)
        area = Area(vertices=np.sort(near), rate=doc.prepared.dense.size)
        return PaintEdit(
            area=area, sample=1, work_patch=RADIUS, transition=0.0, weight=3.0, orientation="search"
        )
    if kind == "mirrored":
        return PaintEdit(
            area=dot(doc, 2000, 6.0), sample=1, work_patch=RADIUS, transition=2 * step,
            symmetry=Symmetry(mirror="x"), orientation="search",
        )  # fmt: skip
    return PaintEdit(
        area=dot(doc, 2000, 6.0), sample=1, work_patch=RADIUS, transition=2 * step, weight=2.0,
        orientation="field",
    )  # fmt: skip


KINDS = ("stroke", "along", "vertices", "mirrored", "dot")


def painted(kind: str) -> Document:
    doc = document()
    doc.add(edit_of(doc, kind))
    return doc


def digest(doc: Document) -> str:
    return hashlib.sha256(b"".join(bits(doc))).hexdigest()


def zone(doc: Document, edit: PaintEdit) -> np.ndarray:
    """Vertices where an edit asks for anything."""
    engine = doc.engine
    width = engine.palette.half_width(edit.sample) * engine.palette.grids[edit.sample].unit
    width = width * engine.step if edit.transition is None else edit.transition
    found = constrain(edit.area, doc.prepared.mesh, engine.net, engine.locator, width=width)
    return found.vertices


def within(doc: Document, vertices: np.ndarray, levels: int) -> np.ndarray:
    """Vertices (N,) bool at most `levels` edges from any of `vertices`."""
    net = doc.engine.net
    tails = np.repeat(np.arange(len(net.indptr) - 1), np.diff(net.indptr))
    inside = np.zeros(len(net.indptr) - 1, np.bool_)
    inside[vertices] = True
    for _ in range(levels):
        grown = inside.copy()
        grown[net.indices[inside[tails]]] = True
        inside = grown
    return inside


def changed(doc: Document, before: tuple[bytes, ...]) -> np.ndarray:
    """Vertices (N,) bool at which any bit of the state differs, their half-edges' included."""
    state, net = doc.engine.state, doc.engine.net
    count = len(state.patch)
    differs = np.zeros(count, np.bool_)
    tails = np.repeat(np.arange(count), np.diff(net.indptr))
    arrays = (state.source, state.angle, state.sample, state.patch, state.ghost)
    for old, array in zip(before, arrays, strict=True):
        now = np.frombuffer(array.tobytes(), np.uint8).reshape(len(array), -1)
        apart = (np.frombuffer(old, np.uint8).reshape(len(array), -1) != now).any(axis=1)
        if len(array) == count:
            differs |= apart
        else:
            differs[tails[apart]] = True
    return differs


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "mirrored"])
def test_no_bit_changes_farther_than_two_radii_from_the_zone(kind):
    doc = document()
    before = bits(doc)
    edit = edit_of(doc, kind)
    doc.add(edit)
    differs = changed(doc, before)
    assert differs.sum() > 50
    near = within(doc, zone(doc, edit), 2 * RADIUS)
    assert not (differs & ~near).any()
    assert 0.02 < near.mean() < 0.6  # the bound says something on this mesh


@pytest.mark.parametrize("kind", KINDS)
def test_the_delta_holds_all_that_changed(kind):
    doc = document()
    before = bits(doc)
    told = doc.add(edit_of(doc, kind))
    differs = np.flatnonzero(changed(doc, before))
    assert len(differs) and np.isin(differs, told).all()
    result = doc.layers[0].result
    assert np.array_equal(differs, result.delta.vertices)
    assert np.isin(differs, result.delta.reads).all()
    doc.undo()
    assert bits(doc) == before


def test_far_apart_edits_do_not_know_of_each_other():
    """Either order gives the same surface but for the numbers of the patches."""
    first = document()
    one = PaintEdit(area=dot(first, 300, 6.0), sample=1, work_patch=RADIUS)
    points = first.prepared.dense.vertices
    farthest = int(np.linalg.norm(points - points[300], axis=1).argmax())
    other = PaintEdit(area=dot(first, farthest, 6.0), sample=1, work_patch=RADIUS)
    apart = within(first, zone(first, one), 2 * RADIUS + 2)
    assert not (apart & within(first, zone(first, other), 2 * RADIUS + 2)).any()
    first.add(one)
    first.add(other)
    second = document()
    second.add(other)
    second.add(one)
    a, b = first.engine.state, second.engine.state
    for name in ("source", "angle", "sample", "ghost"):
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes()


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_edit_gives_the_same_bits(kind):
    assert bits(painted(kind)) == bits(painted(kind))


def test_bits_do_not_depend_on_the_process_or_its_threads():
    kind = "stroke"
    mine = digest(painted(kind))
    for threads in ("1", "2"):
        names = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
        environment = {**os.environ, **dict.fromkeys(names, threads), "PYTHONHASHSEED": threads}
        environment["PYTHONPATH"] = str(ROOT)
        done = subprocess.run(
            [sys.executable, "-c", PAINTED, kind], env=environment, cwd=ROOT, timeout=300,
            capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert done.stdout.strip() == mine


def test_earlier_edits_leave_nothing_behind():
    """Painting, undoing and painting again: the same but for the edit's number."""
    doc = document()
    edit = edit_of(doc, "stroke")
    doc.add(edit_of(doc, "vertices"))
    doc.undo()
    doc.add(edit)
    one, other = doc.engine.state, painted("stroke").engine.state
    for name in ("source", "angle", "sample", "ghost"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()
    assert len(doc.replay()) == 0
