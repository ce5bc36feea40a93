"""Foreground synthesis over whole edits: coverage, orientation and knobs (Zhou §IV)."""

from __future__ import annotations

import numpy as np
import pytest

import btfcore.paint.compose as compose
from btfcore.errors import InvalidEdit
from btfcore.paint.document import Document
from btfcore.paint.edits import Area, PaintEdit, Stroke
from btfcore.paint.engine import Engine
from btfcore.paint.foreground import ENOUGH, LEAST, Painter
from btfcore.paint.region import signed_distance
from btfcore.quilt.lay import lay_along_field
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.synthesize import Synthesizer
from tests.paint.scenes import bits, crack, dot, feature, featured, ready
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


@pytest.mark.parametrize("mesh", ["sphere.obj", "spot.obj"])
@pytest.mark.parametrize("radius", [14.0, 20.0])
@pytest.mark.parametrize("transition", [0.0, 6.0])
def test_an_area_is_covered_and_nothing_leaks(mesh, radius, transition):
    doc = document(mesh)
    area = dot(doc, AT, radius)
    found = paint(doc, area, transition=transition, orientation="search")
    # a larger area than the sample's feature needs several patches
    assert found.reached >= (0.9 if radius < 15 else 0.85) * found.area
    assert found.constraint < 0.4 * found.constraint_before
    inside = wanted(doc, area, 0.0) > 0.5
    away = signed_distance(doc.engine.net, inside, 30.0)
    shown = feature(doc, everyone(doc)) > 0.5
    beyond = shown & (away > transition / 2 + 4)
    assert beyond.sum() <= 0.02 * inside.sum()
    assert not shown[away > 12].any()
    assert found.notes == ()


def test_the_surface_stays_covered_and_sound():
    doc = document("spot.obj")
    paint(doc, radius=20.0)
    state = doc.engine.state
    assert (state.patch >= 0).all()
    for index, sample in enumerate(doc.samples):
        mine = doc.quilt().sample == index
        at = doc.quilt().source[mine]
        high, wide = sample.mask.shape
        assert (at > -1).all() and (at[:, 0] < wide).all() and (at[:, 1] < high).all()


def faces_about(doc: Document, vertex: int, radius: float) -> np.ndarray:
    mesh = doc.prepared.mesh
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    away = np.linalg.norm(middle - doc.prepared.dense.vertices[vertex], axis=1)
    return np.flatnonzero(away < radius * doc.engine.step).astype(np.int32)


def test_faces_are_painted():
    doc = document()
    area = Area(faces=faces_about(doc, AT, 18.0))
    found = paint(doc, area, orientation="search")
    inside = wanted(doc, area, 0.0) > 0.5
    assert found.area == pytest.approx(inside.sum(), rel=0.02)
    assert found.reached >= 0.85 * found.area
    shown = feature(doc, everyone(doc)) > 0.5
    assert (shown & ~inside).sum() < 0.25 * inside.sum()


def test_dense_vertices_are_painted_as_the_stroke_that_covers_them():
    doc = document()
    inside = np.flatnonzero(wanted(doc, dot(doc, AT, 16.0), 0.0) > 0.5).astype(np.int32)
    rate = doc.prepared.dense.size
    found = paint(doc, Area(vertices=inside, rate=rate), orientation="search")
    assert abs(found.area - len(inside)) <= 0.02 * len(inside)
    assert found.reached >= 0.85 * found.area


def test_one_region_of_a_mesh():
    """The mesh has none of its own, so its one region is all of it: as everywhere."""
    one, other = document(), document()
    found = paint(one, Area(region="all"), work_patch=24)
    same = paint(other, Area(everywhere=True), work_patch=24)
    assert found == same
    assert bits(one) == bits(other)


def test_everywhere_is_painted_with_a_feature_that_fills_its_patches():
    doc = document()
    found = paint(doc, Area(everywhere=True), sample=OTHER)
    assert found.area == len(everyone(doc))
    assert found.reached > 0.6 * found.area
    assert (feature(doc, everyone(doc)) > 0.5).mean() > 0.6


def test_a_line_follows_its_stroke():
    """Median angle between the sample's line and the stroke, over what shows of the line."""
    off = []
    for turn in np.radians([0, 40, 90, 140]):
        doc = document(scale=1.0)
        stroke = arc(doc, radius=5.0, turn=float(turn))
        found = paint(
            doc, Area(strokes=(stroke,)), sample=LINE, orientation="stroke", transition=None
        )
        assert found.reached > 0.5 * found.area
        off.append(np.median(deviations(doc, stroke)))
    assert max(off) < 15, off


def deviations(doc: Document, stroke: Stroke) -> np.ndarray:
    """Degrees between the sample's main axis and the stroke where the line shows inside it."""
    engine, dense = doc.engine, doc.prepared.dense
    state = engine.state
    near = wanted(doc, Area(strokes=(stroke,)), 0.0) > 0.5
    there = near & (feature(doc, everyone(doc)) > 0.5) & (state.sample == LINE)
    vertices = np.flatnonzero(there)
    assert len(vertices) > 60
    closest = np.linalg.norm(
        dense.vertices[vertices][:, None] - stroke.points[None], axis=2
    ).argmin(axis=1)
    way = np.gradient(stroke.points, axis=0)[closest]
    field = np.asarray(doc.prepared.field.tangents[vertices], np.float64)
    up = np.asarray(dense.normals[vertices], np.float64)
    across = np.cross(up, field)
    heading = np.arctan2((way * across).sum(axis=1), (way * field).sum(axis=1))
    # the sample's +column axis lies at `angle` from the field
    axis = state.angle[vertices] + engine.palette.axis(LINE)
    apart = np.abs((axis - heading + np.pi / 2) % np.pi - np.pi / 2)
    return np.degrees(apart)


def test_at_its_middle_a_patch_lies_exactly_along_the_stroke():
    """Also where the field turns within the patch, so that its median is another direction."""
    doc = document("spot.obj")
    engine, dense = doc.engine, doc.prepared.dense
    edit = doc.admit(PaintEdit(area=dot(doc, AT), sample=LINE, orientation="stroke"))
    bent = 0
    with engine.recording(edit.uid):
        painter = Painter(engine, edit)
        for vertex in range(0, len(dense.vertices), 211):
            flat = engine.flattener.flatten(vertex, 20)
            lay = lay_along_field(engine.net, engine.flattener.local, flat, bend=0.25)
            engine.flattener.release(flat)
            bent += abs(np.angle(lay.turn[0])) > 0.1
            field = np.asarray(doc.prepared.field.tangents[vertex], np.float64)
            across = np.cross(np.asarray(dense.normals[vertex], np.float64), field)
            for heading in (0.0, 0.7, 2.5):
                way = np.cos(heading) * field + np.sin(heading) * across
                for turn in painter._along(lay, way):
                    angle = lay.angles(np.full(len(lay.plane), np.exp(1j * turn)))[0]
                    off = angle + engine.palette.axis(LINE) - heading
                    assert abs((off + np.pi / 2) % np.pi - np.pi / 2) < 1e-4  # tangents are f4
        engine.finish()
    assert bent >= 3


def test_along_the_field_nothing_is_turned():
    doc = document(scale=1.0)
    paint(doc, Area(strokes=(arc(doc, radius=8.0),)), sample=LINE, orientation="field")
    state = doc.engine.state
    painted = (state.sample == LINE) & (feature(doc, everyone(doc)) > 0.5)
    assert painted.sum() > 60
    angle = np.abs((state.angle[painted] + np.pi) % (2 * np.pi) - np.pi)
    assert np.degrees(np.median(angle)) < 25


def test_orientation_is_searched_where_the_background_has_none():
    assert document().engine.isotropic(BIG)
    made = {}
    for orientation in ("auto", "search", "field"):
        doc = document()
        paint(doc, orientation=orientation)
        made[orientation] = bits(doc)
    assert made["auto"] == made["search"] != made["field"]


def test_pressure_narrows_a_stroke():
    doc = document(scale=1.0)
    fading = np.concatenate([np.ones(20), np.full(20, 0.3)])
    strokes = {
        "full": arc(doc, radius=12.0),
        "fading": arc(doc, radius=12.0, pressure=fading),
        "none": arc(doc, radius=12.0, pressure=np.zeros(40)),
    }
    area = {}
    for name in ("full", "fading"):
        area[name] = paint(doc, Area(strokes=(strokes[name],))).area
        doc.undo()
    assert 0.45 * area["full"] < area["fading"] < 0.8 * area["full"]
    before = bits(doc)
    with pytest.raises(InvalidEdit, match="cover no vertex"):
        paint(doc, Area(strokes=(strokes["none"],)))
    assert bits(doc) == before and not doc.layers


def test_a_soft_brush_widens_its_zone():
    doc = document()
    sharp = paint(doc, Area(strokes=(arc(doc, radius=12.0, degrees=20),)), transition=0.0)
    doc.undo()
    soft = paint(
        doc, Area(strokes=(arc(doc, radius=12.0, degrees=20, hardness=0.5),)), transition=0.0
    )
    assert soft.area == pytest.approx(sharp.area, rel=0.05)  # the zone is centred on the edge
    # D of nothing painted is Σ m_0, which has the same sum but a wider foot
    target = wanted(doc, doc.layers[-1].edit.area, 0.0)
    assert ((target > 0) & (target < 1)).sum() > 0.3 * sharp.area


def test_two_samples_of_one_document():
    """Each edit reaches its area with its own sample's feature; the other's does not count."""
    doc = document()
    area = dot(doc, AT, 16.0)
    paint(doc, area, orientation="search")
    found = paint(doc, area, sample=OTHER, orientation="search", transition=0.0)
    assert found.constraint_before > 0.95 * found.area
    assert found.reached > 0.7 * found.area
    inside = wanted(doc, area, 0.0) > 0.5
    assert (doc.engine.state.sample[inside] == OTHER).mean() > 0.7


@pytest.mark.parametrize("radius", [10, 20])
def test_the_radius_of_patches_is_obeyed(monkeypatch, radius):
    sizes = []
    real = compose.Composer.patch

    def noted(composer, vertex, levels, *given, **knobs):
        sizes.append(levels)
        return real(composer, vertex, levels, *given, **knobs)

    monkeypatch.setattr(compose.Composer, "patch", noted)
    doc = document()
    found = paint(doc, Area(strokes=(arc(doc, radius=12.0),)), work_patch=radius)
    assert set(sizes) <= {radius, max(int(0.7 * radius), LEAST)} and radius in sizes
    assert found.patches <= found.tries <= len(sizes)


def test_filling_ends_where_enough_is_reached():
    doc = document()
    found = paint(doc, radius=20.0, orientation="search", transition=0.0, weight=2.0)
    assert found.reached >= min(ENOUGH, 0.9) * found.area
    assert found.tries < 60


def test_what_cannot_be_reached_is_said():
    """A brush of a few steps, a feature many times as wide: nothing fits."""
    doc = document(scale=1.0)
    found = paint(doc, radius=3.0, transition=0.0)
    assert found.reached < 0.5 * found.area
    assert any("of the area is as wanted" in note for note in found.notes)


def test_strokes_beside_the_surface_are_refused():
    doc = document()
    far = Stroke(doc.prepared.dense.vertices[:1] + 50.0, doc.engine.step)
    before = bits(doc)
    with pytest.raises(InvalidEdit, match="cover no vertex"):
        paint(doc, Area(strokes=(far,)))
    assert bits(doc) == before


def test_winding_lines_are_painted_as_well():
    """A crack of the shared scenes with its own half-width as brush."""
    sample = featured("cracked", crack())
    prepared = ready("sphere.obj", 128)
    knobs = QuiltParameters(features=False, work_patch=16)
    made = Synthesizer(prepared.dense, prepared.field, sample, knobs)
    made.run()
    doc = Document(Engine.over(prepared, (sample,), made))
    half = doc.engine.palette.half_width(0)
    found = paint(
        doc, Area(strokes=(arc(doc, radius=half),)), transition=None, orientation="search"
    )
    assert found.reached > 0.6 * found.area
    assert found.constraint < found.constraint_before


def test_no_place_is_densest_where_nothing_weighs():
    """A seamless edit has nothing to mend."""
    doc = document("spot.obj")
    edit = doc.admit(PaintEdit(area=dot(doc, AT), sample=LINE))
    with doc.engine.recording(edit.uid):
        painter = Painter(doc.engine, edit)
        some = np.arange(5, dtype=np.int32)
        assert painter._densest(some, np.zeros(5), 4.0) == (-1, 0.0)
        vertex, total = painter._densest(some, np.array([0.0, 0, 3, 0, 0]), 4.0)
        assert vertex in some and total == 3
        assert painter._densest(some[:0]) == (-1, 0.0)
        doc.engine.finish()
