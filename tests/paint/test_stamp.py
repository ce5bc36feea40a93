"""Stamps: the preview is what is merged, the rest of the sample and what is there stay out."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.errors import InvalidEdit
from btfcore.paint.document import Document
from btfcore.paint.edits import PaintEdit, StampEdit, Symmetry
from btfcore.paint.engine import Engine
from btfcore.paint.parts import SHOWN, alpha_at, parts_of
from btfcore.paint.wanted import rings
from btfcore.patch.connectivity import connect
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.state import QuiltState
from btfcore.types import Prepared
from tests.paint import scenes
from tests.surfaces import constant_field, plane, sphere


def stamp(doc, at, **more):
    dense = doc.prepared.dense
    point = tuple(float(x) for x in dense.vertices[at])
    normal = tuple(float(x) for x in dense.normals[at])
    knobs = {"sample": 1, "feature": 0, "name": "mark", **more}
    return StampEdit(**{"point": point, "normal": normal, **knobs})


def covered(dense, *samples):
    """Document on a surface that shows one texel of the first sample's background everywhere."""
    field = constant_field(dense)
    mesh = scenes.ready().mesh  # for the symmetry's middle only
    prepared = Prepared(mesh, scenes.ready().atlas, dense, field)
    net = connect(dense, field)
    state = QuiltState.bare(net)
    state.patch[:], state.patches = 0, 1
    state.source[:], state.ghost[:] = 5.0, 5.0
    return Document(Engine(prepared, samples, net, state, QuiltParameters(features=False)))


@pytest.fixture(scope="module")
def flat():
    """A plane of 121 x 121 vertices, one step being one texel."""
    return plane(121, 121)


def test_the_feature_lies_on_a_plane_as_in_the_sample(flat):
    doc = covered(flat, scenes.cracked(), scenes.spotted())
    row, column, turn, scale = 60.3, 58.75, 30.0, 1.4
    edit = StampEdit(
        point=(column, -row, 0.0), normal=(0, 0, 1.0), sample=1, feature=0, rotation=turn,
        scale=scale,
    )  # fmt: skip
    part = doc.engine.part(1, 0)
    (shown,) = doc.preview(edit)
    away = flat.vertices[shown.vertices][:, :2] - [column, -row]
    away = away / flat.step
    angle = np.radians(turn)
    along = away @ [np.cos(angle), np.sin(angle)]
    up = away @ [-np.sin(angle), np.cos(angle)]
    wanted = np.stack([part.centre[0] + along / scale, part.centre[1] - up / scale], 1)
    assert np.abs(shown.source - wanted).max() < 0.01
    assert np.abs(shown.alpha - alpha_at(part.alpha, shown.source)).max() == 0
    area = np.pi * 11**2 * (scale * flat.step) ** 2
    assert abs((shown.alpha > 0.5).sum() - area) < 0.06 * area


def test_a_preview_follows_the_cursor_by_fractions_of_a_vertex(flat):
    doc = covered(flat, scenes.cracked(), scenes.spotted())
    places = []
    for step in range(11):
        edit = StampEdit(
            point=(60 + 0.1 * step, -60.0, 0.0), normal=(0, 0, 1.0), sample=1, feature=0
        )
        (shown,) = doc.preview(edit)
        at = np.flatnonzero(shown.vertices == 60 * 121 + 60)[0]
        places.append(shown.source[at])
    moved = np.diff(np.array(places), axis=0)
    assert np.abs(moved - [-0.1, 0.0]).max() < 0.01


@pytest.mark.parametrize("kind", ["plain", "turned", "small", "mirrored", "all"])
def test_what_is_merged_is_the_preview_bit_for_bit(kind):
    doc = scenes.document()
    doc.add(PaintEdit(area=scenes.dot(doc, 700), sample=0))
    knobs = {
        "plain": {}, "turned": {"rotation": 77.0}, "small": {"scale": 0.6},
        "mirrored": {"symmetry": Symmetry(mirror="x")}, "all": {"feature": None, "scale": 0.4},
    }[kind]  # fmt: skip
    side = int(doc.prepared.dense.vertices[:, 0].argmax())  # far from its mirror image
    edit = stamp(doc, side if kind == "mirrored" else 700, **knobs)
    shown = doc.preview(edit)
    assert len(shown) == (2 if kind == "mirrored" else 1)
    before = scenes.bits(doc)
    doc.preview(edit)
    assert scenes.bits(doc) == before
    doc.add(edit)
    state = doc.engine.state
    taken = np.zeros(len(state.patch), bool)
    for part in shown:
        feature = part.alpha > 0.5
        vertices = part.vertices[feature]
        assert len(vertices) > 20
        assert (state.sample[vertices] == 1).all()
        assert state.source[vertices].tobytes() == part.source[feature].tobytes()
        taken[vertices] = True
    report = doc.layers[-1].result.report
    assert report.reached == report.area == taken.sum()


def test_a_preview_does_not_depend_on_those_before_it():
    doc, other = scenes.document(), scenes.document()
    for at in range(500, 3000, 97):
        doc.preview(stamp(doc, at, scale=0.5 + at % 3))
    for at in (500, 2925, 700):
        one, two = doc.preview(stamp(doc, at))[0], other.preview(stamp(other, at))[0]
        assert one.vertices.tolist() == two.vertices.tolist()
        assert one.source.tobytes() == two.source.tobytes()


def near_spots():
    """Two discs four texels apart."""
    return scenes.featured("pair", scenes.blots((40, 48, 10), (60, 48, 6)), 2, tint=0.1)


def test_other_features_of_the_sample_stay_out(flat):
    doc = covered(flat, scenes.cracked(), near_spots())
    edit = StampEdit(point=(60.0, -60.0, 0.0), normal=(0, 0, 1.0), sample=1, feature=0)
    doc.add(edit)
    result = doc.layers[-1].result
    source = doc.engine.state.source
    mine = result.delta.vertices
    part, others = doc.engine.part(1, 0), doc.engine.part(1, 1)
    assert (alpha_at(part.alpha, source[mine]) > 0.5).sum() > 250
    assert alpha_at(others.alpha, source[mine]).max() <= SHOWN
    doc.change(0, feature=None)
    mine = doc.layers[-1].result.delta.vertices
    assert (alpha_at(others.alpha, source[mine]) > 0.5).sum() > 80


@pytest.mark.parametrize("protect", [True, False])
def test_features_that_are_there_are_protected_from_its_background(flat, protect):
    doc = covered(flat, scenes.cracked(), scenes.spotted())
    doc.add(StampEdit(point=(60.0, -60.0, 0.0), normal=(0, 0, 1.0), sample=1, feature=0))
    there = np.flatnonzero(scenes.feature(doc, np.arange(121 * 121, dtype=np.int32)) > 0.5)
    kept = doc.engine.copy()
    beside = StampEdit(
        point=(66.0, -60.0, 0.0), normal=(0, 0, 1.0), sample=1, feature=1, protect=protect,
        weight=0.0,
    )  # fmt: skip
    (shown,) = doc.preview(beside)
    doc.add(beside)
    lost = np.intersect1d(there, doc.engine.differences(kept))
    asked = rings(doc.engine, shown.vertices[shown.alpha > 0.5], 1)
    assert len(lost) > 100  # where the new feature lies
    assert (len(np.setdiff1d(lost, asked)) == 0) == protect


def test_stamping_over_a_stamp_replaces_it(flat):
    doc = covered(flat, scenes.cracked(), scenes.spotted())
    edit = StampEdit(point=(60.0, -60.0, 0.0), normal=(0, 0, 1.0), sample=1, feature=0)
    doc.add(edit)
    doc.add(replace(edit, rotation=90.0, point=(63.0, -60.0, 0.0)))
    (shown,) = doc.preview(replace(edit, rotation=90.0, point=(63.0, -60.0, 0.0)))
    feature = shown.alpha > 0.5
    state = doc.engine.state
    assert state.source[shown.vertices[feature]].tobytes() == shown.source[feature].tobytes()


def test_a_crease_and_a_cut_feature_are_said(flat):
    doc = covered(flat, scenes.cracked(), scenes.spotted())
    doc.add(StampEdit(point=(60.0, -60.0, 0.0), sample=1, feature=0))
    assert doc.layers[-1].result.report.notes == ()
    doc.add(StampEdit(point=(60.0, -60.0, 0.0), sample=0, feature=0))
    notes = doc.layers[-1].result.report.notes
    assert any("touches the sample's border" in note for note in notes)
    doc.add(StampEdit(point=(3.0, -60.0, 0.0), sample=1, feature=0))
    notes = doc.layers[-1].result.report.notes
    assert any("% of the feature lies on the surface" in note for note in notes)
    ball = covered(sphere(3), scenes.cracked(), scenes.spotted())
    ball.add(StampEdit(point=(0.0, 0.0, 1.0), sample=1, feature=0, scale=0.3))
    assert ball.layers[-1].result.report.notes == ()
    ball.add(StampEdit(point=(0.0, 0.0, 1.0), sample=1, feature=0, scale=2.0))
    notes = ball.layers[-1].result.report.notes
    assert any("creased" in note for note in notes)


@pytest.mark.parametrize("level", [0, 1, 2])
def test_a_feature_larger_than_a_tiny_closed_surface_ends_well(level):
    doc = covered(sphere(level), scenes.cracked(), scenes.spotted())
    before = scenes.bits(doc)
    for scale in (0.05, 0.5, 2.0, 20.0):
        edit = stamp(doc, 0, scale=scale)
        (shown,) = doc.preview(edit)
        assert len(shown.vertices) and np.isfinite(shown.source).all()
        doc.add(edit)
        state = doc.engine.state
        assert np.isfinite(state.source).all() and np.isfinite(state.ghost).all()
        doc.undo()
    assert scenes.bits(doc) == before


def test_a_feature_too_large_to_be_mapped_is_an_error(flat, monkeypatch):
    monkeypatch.setattr("btfcore.paint.stamp.LIMIT", 500)
    doc = covered(flat, scenes.cracked(), scenes.spotted())
    edit = StampEdit(point=(60.0, -60.0, 0.0), sample=1, feature=0, scale=3.0, name="blot")
    for verb in (doc.add, doc.preview):
        with pytest.raises(InvalidEdit, match=r"blot: its feature spans \d+ steps .* 500 vertices"):
            verb(edit)
    assert doc.edits == ()


def test_stamps_that_do_not_fit_are_refused_by_name(flat):
    doc = covered(flat, scenes.cracked(), scenes.spotted(), replace(scenes.spotted(), mask=None))
    fine = StampEdit(point=(60.0, -60.0, 0.0), sample=1, feature=0, name="blot")
    for edit, words in (
        (replace(fine, point=(60.0, -60.0, 900.0)), "away from the surface"),
        (replace(fine, normal=(0.0, 0.0, -1.0)), "no surface that looks its way"),
        (replace(fine, sample=4), "blot names sample 4 of 3"),
        (replace(fine, sample=-1), "blot names sample -1 of 3"),
        (replace(fine, feature=3), "feature 3 of sample 'spotted', which has 3"),
        (replace(fine, sample=2), "has no feature: its mask is empty or missing"),
    ):
        for verb in (doc.add, doc.preview):
            with pytest.raises(InvalidEdit, match=words):
                verb(edit)
    doc.engine.state.patch[:] = -1
    assert len(doc.preview(fine)[0].vertices)
    with pytest.raises(InvalidEdit, match="blot: its feature meets nothing that is synthesised"):
        doc.add(fine)
    assert doc.edits == () and not doc.engine.busy


def test_parts_share_out_the_mask():
    mask = scenes.spotted().mask
    *alone, whole = parts_of(mask, "spotted")
    assert [int((part.alpha > 0.5).sum()) for part in alone] == sorted(
        (int((part.alpha > 0.5).sum()) for part in alone), reverse=True
    )
    assert np.array_equal(sum(part.alpha for part in alone), mask)
    assert np.array_equal(whole.alpha, mask)
    for part, (x, y, radius) in zip(alone, ((30, 34, 11), (70, 26, 7), (62, 70, 5)), strict=True):
        assert part.centre == (x, y) and not part.cut
        assert abs(part.radius - radius) < 1.5
        row, column = np.nonzero(part.alpha > SHOWN)
        assert np.hypot(column - x, row - y).max() <= part.radius + 1e-9
    (line, _) = parts_of(scenes.crack(), "line")
    assert line.cut
    with pytest.raises(InvalidEdit, match="'bare' has no feature"):
        parts_of(np.zeros((8, 8), np.float32), "bare")


def test_alpha_is_bilinear_and_nothing_outside():
    mask = np.random.default_rng(0).random((7, 9)).astype(np.float32)
    place = (np.random.default_rng(1).random((200, 2)) * 14 - 3).astype(np.float32)
    found = alpha_at(mask, place)
    for (x, y), value in zip(place.astype(float), found, strict=True):
        if not (0 <= x <= 8 and 0 <= y <= 6):
            assert value == 0
            continue
        column, row = min(int(x), 7), min(int(y), 5)
        fx, fy = x - column, y - row
        wanted = (
            (mask[row, column] * (1 - fx) + mask[row, column + 1] * fx) * (1 - fy)
            + (mask[row + 1, column] * (1 - fx) + mask[row + 1, column + 1] * fx) * fy
        )  # fmt: skip
        assert value == pytest.approx(wanted, abs=1e-5)
