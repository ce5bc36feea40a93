"""A quilt carried to another sampling rate is the same picture."""

from pathlib import Path

import numpy as np
import pytest

from btfcore.errors import Cancelled, InvalidParameter, InvalidQuilt
from btfcore.patch.connectivity import connect
from btfcore.pipeline import load_mesh, prepare
from btfcore.quilt.layout import Borders, lay_out
from btfcore.quilt.measure import measure_seams
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.sheet import sheet_of
from btfcore.quilt.state import QuiltState
from btfcore.quilt.synthesize import Synthesizer
from btfcore.quilt.transfer import transfer
from btfcore.quilt.transfer_locate import locate, surface
from btfcore.render.texture import vertex_colours
from btfcore.types import Quilt
from tests.quilt.test_several_samples import factors, halves, same
from tests.surfaces import (
    blobs,
    constant_field,
    random_field,
    sphere,
)  # fmt: skip

MESHES = Path(__file__).parents[2] / "resources" / "meshes"
KNOBS = QuiltParameters(work_patch=10)


@pytest.fixture(scope="module")
def balls():
    """Spheres of three rates with unlike fields, and their connectivities."""
    made = {}
    for level, way in ((4, (0, 0, 1.0)), (5, (0.1, 0, 1.0)), (6, (0, 1.0, 0.3))):
        dense = sphere(level)
        field = constant_field(dense, way)
        made[level] = dense, field, connect(dense, field)
    return made


@pytest.fixture(scope="module")
def spots():
    """Spot at three rates, and a quilt of the middle one: (prepared by rate, engine, quilt)."""
    mesh, _ = load_mesh(MESHES / "spot.obj")
    made = {rate: prepare(mesh, rate=rate) for rate in (96, 160, 480)}
    engine = Synthesizer(made[160].dense, made[160].field, blobs(), KNOBS)
    return made, engine, engine.run()


def quilted(ball, samples, *, hard=None, **knobs):
    dense, field, net = ball
    parameters = QuiltParameters(work_patch=10, **knobs)
    layout = None
    if hard is not None:
        layout = lay_out(net, halves(dense), [0, 1], Borders.all(hard), parameters.border)
    engine = Synthesizer(dense, field, samples, parameters, net=net, layout=layout)
    return engine, engine.run()


def carry(old, engine, quilt, new, **options):
    return transfer(*old[:2], engine.net, quilt, engine.sheet, *new[:2], **options)


def within(dense, quilt):
    """Edges (n, 2) inside patches."""
    edges = np.concatenate([dense.faces[:, [i, (i + 1) % 3]] for i in range(3)])
    patch = quilt.patch[edges]
    return edges[(patch[:, 0] == patch[:, 1]) & (patch[:, 0] >= 0)]


def stretch(dense, quilt):
    """Sample texels per world unit along the edges inside patches."""
    one, two = within(dense, quilt).T
    away = quilt.source[one].astype(float) - quilt.source[two]
    return np.linalg.norm(away, axis=1) / np.linalg.norm(
        dense.vertices[one] - dense.vertices[two], axis=1
    )


def off_angle(dense, field, quilt):
    """Radians between the angles and the turn of the map on the faces inside patches."""
    patch = quilt.patch[dense.faces]
    faces = dense.faces[(patch == patch[:, :1]).all(axis=1) & (patch[:, 0] >= 0)]
    first = faces[:, 0]
    s = field.tangents[first].astype(float)
    t = np.cross(dense.normals[first], s)
    a = np.zeros((len(faces), 2, 2))
    b = np.zeros((len(faces), 2, 2))
    for k in (1, 2):
        edge = dense.vertices[faces[:, k]] - dense.vertices[first]
        a[:, k - 1] = np.stack([(edge * s).sum(axis=1), (edge * t).sum(axis=1)], axis=1)
        b[:, k - 1] = quilt.source[faces[:, k]].astype(float) - quilt.source[first]
    sound = np.linalg.det(a) > 0.3 * dense.step**2  # slivers tell no direction
    slope = np.linalg.solve(a[sound], b[sound])
    found = np.arctan2(slope[:, 1, 0] + slope[:, 0, 1], slope[:, 0, 0] - slope[:, 1, 1])
    return np.abs(np.angle(np.exp(1j * (found - quilt.angle[first[sound]]))))


def inside(quilt, samples):
    for index, sample in enumerate(samples):
        at = quilt.source[(quilt.sample == index) & (quilt.patch >= 0)]
        height, width = sample.colour.shape[:2]
        assert (at >= 0).all() and (at <= [width - 1, height - 1]).all()


@pytest.mark.parametrize("scale", [0.6, 1.0, 1.7])
@pytest.mark.parametrize("stored", [True, False])
def test_at_the_same_rate_nothing_changes(balls, scale, stored):
    engine, quilt = quilted(balls[5], blobs(), scale=scale)
    again = carry(balls[5], engine, quilt if stored else engine.state, balls[5])
    for name in ("source", "sample", "patch"):
        assert getattr(again, name).tobytes() == getattr(quilt, name).tobytes()
    turned = np.angle(np.exp(1j * (again.angle - quilt.angle.astype(float))))
    assert np.abs(turned).max() < 1e-5


def test_cutting_again_at_the_same_rate_moves_nothing(balls):
    """Every vertex lies on an old one, whose patch alone it knows in full."""
    engine, quilt = quilted(balls[5], blobs())
    again = carry(balls[5], engine, quilt, balls[5], seams=engine.sheet)
    assert (again.patch == quilt.patch).mean() > 0.9 and (again.patch >= 0).all()


def test_only_directions_in_the_world_count(balls):
    """Another field turns the angles by as much as it differs, and changes nothing else."""
    dense, field, net = balls[5]
    engine, quilt = quilted(balls[5], blobs())
    other = random_field(dense)
    again = transfer(dense, field, net, quilt, engine.sheet, dense, other)
    assert np.array_equal(again.source, quilt.source) and np.array_equal(again.patch, quilt.patch)

    def columns(tangents, angle):
        s = tangents.astype(float)
        t = np.cross(dense.normals.astype(float), s)
        return np.cos(angle)[:, None] * s + np.sin(angle)[:, None] * t

    np.testing.assert_allclose(
        columns(other.tangents, again.angle), columns(field.tangents, quilt.angle), atol=1e-5
    )


@pytest.mark.parametrize("rate", [96, 480])
@pytest.mark.parametrize("again", [False, True])
def test_the_picture_is_the_same(spots, rate, again):
    made, engine, quilt = spots
    old, new = made[160], made[rate]
    scale = rate / 160
    seams = sheet_of([blobs()], [scale], match_channels=4) if again else None
    out = transfer(
        old.dense, old.field, engine.net, quilt, engine.sheet, new.dense, new.field, seams=seams
    )
    assert (out.patch >= 0).all() and np.isfinite(out.source).all() and np.isfinite(out.angle).all()
    inside(out, [blobs()])
    # every patch has its share of the surface
    area = [np.bincount(q.patch, minlength=quilt.patch.max() + 1) for q in (quilt, out)]
    share = [each / each.sum() for each in area]
    assert (area[1][area[0] > 12] > 0).all()
    assert np.abs(share[1] - share[0]).max() < 0.004
    large = share[0] > 0.01
    assert np.abs(share[1][large] / share[0][large] - 1).max() < (0.25 if rate == 96 else 0.13)
    # as large, and turned as its angles say
    before, after = (np.percentile(stretch(p.dense, q), [10, 50, 90]) for p, q in
                     ((old, quilt), (new, out)))  # fmt: skip
    np.testing.assert_allclose(after, before, rtol=0.04)
    assert np.median(off_angle(new.dense, new.field, out)) < np.radians(1.5)
    assert np.percentile(off_angle(new.dense, new.field, out), 95) < np.radians(12)
    # the colours at the old vertices, read off the new mesh
    on = surface(new.dense)
    face, weight = locate(on, old.dense)
    corner = on.faces[face]
    read = np.einsum("nk,nkc->nc", weight, vertex_colours(out, [blobs()])[corner])
    error = ((read - vertex_colours(quilt, [blobs()])) ** 2).sum(axis=1)
    kept = (out.patch[corner] == quilt.patch[:, None]).all(axis=1)
    assert kept.mean() > (0.6 if rate == 96 else 0.85 if again else 0.99)
    assert np.sqrt(error[kept].mean()) < (0.04 if rate == 96 else 0.01)
    if rate == 480 and not again:
        assert np.sqrt(error.mean()) < 0.02


def test_there_and_back_gives_the_same_quilt(spots):
    made, engine, quilt = spots
    old, new = made[160], made[480]
    there = transfer(old.dense, old.field, engine.net, quilt, engine.sheet, new.dense, new.field)
    fine = sheet_of([blobs()], [3.0], match_channels=4)
    net = connect(new.dense, new.field)
    back = transfer(new.dense, new.field, net, there, fine, old.dense, old.field)
    kept = back.patch == quilt.patch
    assert kept.mean() > 0.99
    away = np.linalg.norm(back.source - quilt.source, axis=1)[kept]
    assert np.percentile(away, 99) < 0.1 and np.median(away) < 0.01
    turned = np.angle(np.exp(1j * (back.angle - quilt.angle.astype(float))))[kept]
    assert np.median(np.abs(turned)) < 0.01


def test_seams_cut_again_are_cheaper_and_stay_put(spots):
    made, engine, quilt = spots
    old, new = made[160], made[480]
    fine = sheet_of([blobs()], [3.0], match_channels=4)
    given = (old.dense, old.field, engine.net, engine.state, engine.sheet, new.dense, new.field)
    carried, cut = transfer(*given), transfer(*given, seams=fine)
    net = connect(new.dense, new.field)
    before, after = (
        measure_seams(net, QuiltState.from_quilt(net, fine, each), fine) for each in (carried, cut)
    )
    assert after.per_edge < 0.95 * before.per_edge
    assert after.per_vertex < 0.95 * before.per_vertex
    moved = carried.patch != cut.patch
    assert 0 < moved.mean() < 0.1
    # only within the old triangles that a seam crosses
    on = surface(old.dense)
    patch = quilt.patch[on.faces[locate(on, new.dense)[0]]]
    assert (patch[moved] == cut.patch[moved][:, None]).any(axis=1).all()
    assert same(cut, transfer(*given, seams=fine))


@pytest.mark.parametrize("level", [4, 6])
@pytest.mark.parametrize("again", [False, True])
def test_bare_parts_stay_bare(balls, level, again):
    dense, field, net = balls[5]
    engine = Synthesizer(dense, field, blobs(), KNOBS, net=net)

    def stop(fraction, label):
        if fraction > 0.6:
            raise Cancelled

    with pytest.raises(Cancelled):
        engine.run(progress=stop)
    quilt = engine.state.quilt(engine.sheet)
    bare = (quilt.patch < 0).mean()
    assert 0.1 < bare < 0.9
    seams = engine.sheet if again else None
    out = carry(balls[5], engine, quilt, balls[level], seams=seams)
    assert (out.patch < 0).mean() == pytest.approx(bare, abs=0.02)
    on = surface(dense)
    corner = quilt.patch[on.faces[locate(on, balls[level][0])[0]]]
    assert (out.patch[(corner < 0).all(axis=1)] < 0).all()
    assert (out.patch[(corner >= 0).all(axis=1)] >= 0).all()
    nothing = QuiltState.bare(net).quilt(engine.sheet)
    assert (carry(balls[5], engine, nothing, balls[level]).patch == -1).all()


@pytest.mark.parametrize("level", [4, 5, 6])
@pytest.mark.parametrize("again", [False, True])
def test_several_samples_keep_hard_borders_to_the_vertex(balls, level, again):
    samples = [blobs(), factors()]
    engine, quilt = quilted(balls[5], samples, hard=True)
    new = balls[level]
    allowed = np.stack([halves(new[0]) == index for index in (0, 1)])
    sheet = sheet_of(samples, [1.0, 1.0], match_channels=4) if again else None
    out = carry(balls[5], engine, engine.state, new, seams=sheet, allowed=allowed)
    assert (out.patch >= 0).all()
    assert np.array_equal(out.sample, halves(new[0]))
    inside(out, samples)
    owner = np.zeros(quilt.patch.max() + 1, int)
    owner[quilt.patch] = quilt.sample
    assert np.array_equal(out.sample, owner[out.patch])


@pytest.mark.parametrize("hard", [True, False])
def test_samples_go_with_their_patches(balls, hard):
    samples = [blobs(), factors()]
    engine, quilt = quilted(balls[5], samples, hard=hard)
    sheet = sheet_of(samples, [2.0, 2.0], match_channels=4)
    out = carry(balls[5], engine, engine.state, balls[6], seams=sheet)
    owner = np.zeros(quilt.patch.max() + 1, int)
    owner[quilt.patch] = quilt.sample
    assert np.array_equal(out.sample, owner[out.patch])
    inside(out, samples)
    share = [np.bincount(each.sample) / len(each.sample) for each in (quilt, out)]
    np.testing.assert_allclose(*share, atol=0.01)


def test_places_are_the_nearest_of_all_triangles(balls):
    """Against a search through every triangle, by dense sampling of each."""
    old, new = balls[4][0], balls[5][0]
    on = surface(old)
    face, weight = locate(on, new)
    assert (weight >= 0).all() and np.abs(weight.sum(axis=1) - 1).max() < 1e-6
    found = np.einsum("nk,nkd->nd", weight, old.vertices[old.faces[face]])
    found = np.linalg.norm(found - new.vertices, axis=1)
    grid = np.array([(i, j, 12 - i - j) for i in range(13) for j in range(13 - i)]) / 12
    cloud = np.einsum("mk,gkd->gmd", grid, old.vertices[old.faces]).reshape(-1, 3)
    for vertex in range(0, len(new.vertices), 97):
        least = np.linalg.norm(cloud - new.vertices[vertex], axis=1).min()
        assert found[vertex] <= least + 1e-9


def test_patches_positions_and_angles_against_a_twin(balls):
    """Plain numpy, vertex by vertex; one bare patch, one of another sample."""
    dense, field, net = balls[5]
    engine, quilt = quilted(balls[5], [blobs(), factors()], hard=False)
    state = engine.state
    state.patch[state.patch == state.patch[17]] = -1
    new, onto = balls[6][:2]
    out = transfer(dense, field, net, state, engine.sheet, new, onto)
    tails = np.repeat(np.arange(len(dense.vertices)), np.diff(net.indptr))
    ghosts = dict(zip(zip(tails, net.indices, strict=True), state.ghost, strict=True))
    normals = dense.normals.astype(float)
    s = field.tangents.astype(float)
    turn = quilt.angle.astype(float)[:, None]
    columns = np.cos(turn) * s + np.sin(turn) * np.cross(normals, s)
    face, weight = locate(surface(dense), new)
    seen = 0
    for vertex in range(0, len(new.vertices), 7):
        corners, w = dense.faces[face[vertex]], weight[vertex].astype(float)
        patch = state.patch[corners]
        share = {p: w[patch == p].sum() for p in patch.tolist()}
        best = max(share, key=lambda p: share[p])
        if best < 0:
            assert out.patch[vertex] == -1
            continue
        mine = corners[patch == best]
        at = [
            state.source[k] if k in mine else np.mean([ghosts[m, k] for m in mine], axis=0)
            for k in corners
        ]
        here = w @ np.array(at, float)
        if out.patch[vertex] != best:  # as much of another's, or its continuation ends before
            limit = np.array(engine.sheet.frames[state.sample[mine[0]], [2, 1]]) - 1
            ends = (here < 0).any() or (here > limit).any()
            assert ends or share[best] - share[int(out.patch[vertex])] < 1e-6
            continue
        assert out.sample[vertex] == state.sample[mine[0]]
        # midpoints of edges lie a hair beyond both of their triangles
        np.testing.assert_allclose(out.source[vertex], here, atol=0.06)
        n = new.normals[vertex].astype(float)
        way = sum(
            max(w[corners == k][0], 1e-6)
            * (columns[k] - (n @ columns[k]) / (1 + n @ normals[k]) * (n + normals[k]))
            for k in mine
        )
        t = onto.tangents[vertex].astype(float)
        angle = np.arctan2(way @ np.cross(n, t), way @ t)
        assert abs(np.angle(np.exp(1j * (angle - out.angle[vertex])))) < 1e-3
        seen += 1
    assert seen > 0.9 * (out.patch[::7] >= 0).sum()


def test_what_does_not_fit_is_named(balls):
    dense, field, net = balls[4]
    engine, quilt = quilted(balls[4], blobs())
    fine, other = balls[5][:2]
    with pytest.raises(InvalidParameter, match="2562 tangents"):
        transfer(dense, field, net, quilt, engine.sheet, fine, field)
    with pytest.raises(InvalidParameter, match=r"\(1, 3\)"):
        carry(balls[4], engine, quilt, balls[5], allowed=np.ones((1, 3), bool))
    with pytest.raises(InvalidParameter, match="2 samples at the new scale, 1 at the old"):
        two = sheet_of([blobs(), blobs()], [1.0, 1.0], match_channels=4)
        carry(balls[4], engine, quilt, balls[5], seams=two)
    with pytest.raises(InvalidQuilt, match="names sample 3, only 1"):
        wrong = Quilt(quilt.source, quilt.angle, quilt.sample + np.uint16(3), quilt.patch)
        carry(balls[4], engine, wrong, balls[5])
    with pytest.raises(InvalidQuilt, match="a quilt of 2562 vertices, the mesh has 10242"):
        transfer(fine, other, net, quilt, engine.sheet, dense, field)
    calls = []

    def stop(fraction, label):
        calls.append(fraction)
        if fraction > 0.5:
            raise Cancelled

    with pytest.raises(Cancelled):
        carry(balls[4], engine, quilt, balls[5], progress=stop)
    assert calls == sorted(calls)
