"""Energy of whole paint edits, patch by patch and as reported; protected features."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

import btfcore.paint.compose as compose
import btfcore.paint.operations as operations
from btfcore.paint.constrained import energy
from btfcore.paint.document import Document
from btfcore.paint.edits import Area, PaintEdit
from btfcore.paint.foreground import Painter
from tests.paint.scenes import dot, feature
from tests.paint.spheres import (
    AT,
    BIG,
    LINE,
    OTHER,
    arc,
    document,
    everyone,
    paint,
    wanted,
)


def looked_up(values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Bilinear values (n, K) of (h, w, K) at (column, row), clamped."""
    place = np.asarray(at, np.float64).T[::-1]
    layers = np.moveaxis(np.atleast_3d(values), 2, 0).astype(np.float64)
    return np.stack([map_coordinates(each, place, order=1, mode="nearest") for each in layers], 1)


def plain_energy(doc: Document, target: np.ndarray, sample: int, among: np.ndarray):
    """Σ D and Σ V / u over the vertices `among`, from the state and the samples alone."""
    engine, state = doc.engine, doc.engine.state
    grids = [np.asarray(grid.cut) for grid in engine.palette.grids]
    masks = [engine.palette.feature_of(index) for index in range(len(grids))]

    def shown(what, owner, at):
        out = np.zeros((len(owner), np.atleast_3d(what[0]).shape[2]))
        for index, each in enumerate(what):
            mine = owner == index
            out[mine] = looked_up(each, at[mine])
        return out

    there = shown(masks, state.sample, state.source)[:, 0]
    there[(state.sample != sample) & (target >= 0.5)] = 0
    data = np.abs(there - target)[among].sum()
    tails = np.repeat(everyone(doc), np.diff(engine.net.indptr))
    heads = engine.net.indices
    seam = (state.patch[tails] != state.patch[heads]) & np.isin(tails, among)
    a, b = tails[seam], heads[seam]
    left = shown(grids, state.sample[a], state.ghost[seam])
    right = shown(grids, state.sample[b], state.source[b])
    smooth = np.linalg.norm(left - right, axis=1).sum()
    return float(data), float(smooth / engine.unit(sample))


KNOBS = (
    {},
    {"transition": 0.0},
    {"transition": 0.0, "weight": 4.0},
    {"weight": 0.05},
    {"orientation": "field", "work_patch": 12},
    {"sample": LINE, "orientation": "stroke", "transition": None},
    {"sample": OTHER, "protect": False},
)


@pytest.mark.parametrize("knobs", KNOBS, ids=str)
@pytest.mark.parametrize("kind", ["dot", "stroke"])
def test_energy_never_rises_with_any_patch(monkeypatch, knobs, kind):
    """E over the whole surface, before and after every patch, for the m_0 of that moment."""
    doc = document()
    engine = doc.engine
    painters: list[Painter] = []
    gains: list[tuple[float, float]] = []
    real = compose.Composer._keep

    class Noted(Painter):
        def __init__(self, *given):
            super().__init__(*given)
            painters.append(self)

    def kept(composer, lay, choice):
        target = painters[-1].target(everyone(doc))

        def total():
            return energy(engine.net, engine.state, engine.palette, composer.sample, target).total(
                composer.weight
            )

        before = total()
        vertices = real(composer, lay, choice)
        unit = engine.unit(composer.sample)
        gains.append((before - total(), (choice.cut.before - choice.cut.after) / unit))
        return vertices

    monkeypatch.setattr(operations, "Painter", Noted)
    monkeypatch.setattr(compose.Composer, "_keep", kept)
    area = dot(doc, AT, 14.0) if kind == "dot" else Area(strokes=(arc(doc, radius=9.0),))
    found = paint(doc, area, **knobs)
    assert len(gains) == found.patches
    real_gain, told = np.array(gains).reshape(-1, 2).T
    assert (real_gain > 0).all()
    assert real_gain == pytest.approx(told, rel=1e-4, abs=1e-4)
    after, before = (
        found.weight * data + smooth
        for data, smooth in (
            (found.constraint, found.smooth), (found.constraint_before, found.smooth_before)
        )
    )  # fmt: skip
    assert after <= before + 1e-6


@pytest.mark.parametrize("knobs", [KNOBS[0], KNOBS[2], KNOBS[4], KNOBS[6]], ids=str)
def test_the_report_is_what_can_be_measured_from_outside(knobs):
    doc = document()
    area = dot(doc, AT, 14.0)
    given = {"transition": 6.0, "sample": BIG, **knobs}
    target = wanted(doc, area, given["transition"])
    ground = feature(doc, everyone(doc))
    assert ground.max() <= 0.05  # nothing to protect: m_0 is the area's alone
    target = np.maximum(target, ground) if given.get("protect", True) else target
    before = plain_energy(doc, target, given["sample"], everyone(doc))
    found = paint(doc, area, **knobs)
    result = doc.layers[-1].result
    among = result.delta.reads
    data, smooth = plain_energy(doc, target, given["sample"], among)
    assert found.constraint == pytest.approx(data, rel=1e-4)
    assert found.smooth == pytest.approx(smooth, rel=1e-4)
    whole = plain_energy(doc, target, given["sample"], everyone(doc))
    # what was not looked at is as it was
    assert whole[0] - before[0] == pytest.approx(
        found.constraint - found.constraint_before, abs=0.05
    )
    assert whole[1] - before[1] == pytest.approx(found.smooth - found.smooth_before, abs=0.05)
    assert found.weight == given.get("weight", 0.5)
    inside = target > 0.5
    state = doc.engine.state
    own = state.sample == given["sample"]
    there = feature(doc, everyone(doc)) >= 0.5
    assert found.area == inside.sum()
    assert found.reached == (own & there & inside).sum()


def test_more_weight_leaves_less_undone():
    """A small one paints what happens to lower the seams, and no more than that."""
    found = [
        paint(document(), radius=20.0, transition=0.0, orientation="search", weight=weight)
        for weight in (0.001, 0.5, 8.0)
    ]
    small, usual, large = (1 - each.reached / each.area for each in found)
    assert large <= usual + 0.02 < small and large < 0.1
    assert found[0].smooth <= found[0].smooth_before
    assert found[0].smooth < found[2].smooth


def test_a_weight_of_zero_paints_nothing_worse():
    doc = document()
    found = paint(doc, weight=0.0, transition=0.0)
    assert found.smooth <= found.smooth_before + 1e-9


@pytest.mark.parametrize("sample", [BIG, OTHER])
def test_protected_features_stay_and_others_may_go(sample):
    """A second stroke beside the first: with protection the first keeps what it reached."""
    left = {}
    for protect in (True, False):
        doc = document()
        paint(doc, radius=14.0, orientation="search")
        first = (feature(doc, everyone(doc)) > 0.5) & (doc.engine.state.sample == BIG)
        assert first.sum() > 400
        beside = dot(doc, AT, 14.0)
        point = arc(doc, radius=14.0, degrees=20).points[-1:]
        beside = replace(beside, strokes=(replace(beside.strokes[0], points=point, normals=None),))
        target = wanted(doc, beside, 6.0)
        paint(doc, beside, sample=sample, protect=protect, orientation="search")
        free = first & (target < 0.02)
        assert free.sum() > 100
        left[protect] = float((feature(doc, everyone(doc))[free] > 0.5).mean())
    assert left[True] >= 0.85
    assert left[False] < 0.2


def test_unprotected_the_background_may_come_back():
    """Painted over with a small m_0 around it, a neighbour's feature counts as unwanted."""
    doc = document()
    paint(doc, radius=14.0, orientation="search")
    first = feature(doc, everyone(doc)) > 0.5
    doc.add(
        PaintEdit(
            area=dot(doc, AT, 5.0), sample=BIG, protect=False, orientation="search",
            transition=0.0, weight=2.0, work_patch=28,
        )
    )  # fmt: skip
    second = feature(doc, everyone(doc)) > 0.5
    assert second.sum() < first.sum()
    doc.undo()
    paint(doc, radius=5.0, orientation="search", transition=0.0, weight=2.0, work_patch=28)
    third = feature(doc, everyone(doc)) > 0.5
    assert third[first].mean() > 0.99


@pytest.mark.parametrize("protect", [True, False])
@pytest.mark.parametrize("sample", [BIG, OTHER])
def test_beside_a_painted_feature_the_report_adds_up(monkeypatch, sample, protect):
    """What the cuts gained, one by one, is what E fell by; also over another sample's feature."""
    doc = document()
    paint(doc, radius=14.0, orientation="search")
    point = arc(doc, radius=14.0, degrees=20).points[-1:]
    beside = dot(doc, AT, 14.0)
    beside = replace(beside, strokes=(replace(beside.strokes[0], points=point, normals=None),))
    gains = []
    real = compose.Composer._keep

    def kept(composer, lay, choice):
        gains.append(choice.cut.before - choice.cut.after)
        return real(composer, lay, choice)

    monkeypatch.setattr(compose.Composer, "_keep", kept)
    found = paint(doc, beside, sample=sample, protect=protect, orientation="search")
    fell = found.weight * (found.constraint_before - found.constraint)
    fell += found.smooth_before - found.smooth
    assert len(gains) == found.patches > 0 and min(gains) > 0
    assert fell == pytest.approx(sum(gains) / doc.engine.unit(sample), rel=1e-4)
