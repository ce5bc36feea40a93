"""Repair gives a clean manifold for any triangles, or names what is wrong."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from btfcore.errors import InvalidMesh
from btfcore.mesh.duplicates import drop_repeated
from btfcore.mesh.flips import flat_faces
from btfcore.mesh.repair import repair
from btfcore.mesh.split import split_nonmanifold
from btfcore.mesh.topology import components, edges, is_manifold, statistics
from btfcore.mesh.winding import agree
from tests.mesh import shapes

CLOSED = [shapes.TETRAHEDRON, shapes.torus(), shapes.sphere(), shapes.cube()]


def assert_clean(mesh):
    assert is_manifold(mesh.faces)
    assert np.isfinite(mesh.vertices).all()
    assert len(np.unique(mesh.faces)) == len(mesh.vertices)
    extent = np.ptp(mesh.vertices, axis=0).max()
    assert len(flat_faces(mesh.vertices, mesh.faces, 1e-12 * extent)) == 0


def soup_of(vertices, faces):
    """Every triangle with corners of its own, as STL files have them."""
    return vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)


@settings(deadline=None, max_examples=150)
@given(st.integers(0, 2**32 - 1), st.integers(3, 9), st.integers(1, 40))
def test_any_soup_becomes_manifold_or_is_refused(seed, places, rows):
    rng = np.random.default_rng(seed)
    vertices = rng.integers(0, 3, (places, 3)).astype(float)
    faces = rng.integers(0, places, (rows, 3))
    try:
        mesh, _ = repair(vertices, faces)
    except InvalidMesh as error:
        assert "no triangle is left" in str(error) or "extent is 0 units" in str(error)
        return
    assert_clean(mesh)
    given_places = {tuple(v) for v in vertices}
    assert all(tuple(v) in given_places for v in mesh.vertices)


@pytest.mark.parametrize("shape", CLOSED)
def test_a_closed_surface_survives_splitting_shuffling_and_random_winding(shape):
    rng = np.random.default_rng(5)
    vertices, faces = soup_of(*shape)
    faces = faces[rng.permutation(len(faces))]
    turned = rng.random(len(faces)) < 0.5
    faces[turned] = faces[turned, ::-1]
    mesh, notes = repair(vertices, faces)
    assert_clean(mesh)
    before, after = statistics(*shape), statistics(mesh.vertices, mesh.faces)
    assert after == before
    assert shapes.volume(mesh.vertices, mesh.faces) == pytest.approx(shapes.volume(*shape))
    assert any("reversed" in note for note in notes)


@pytest.mark.parametrize("shape", [*CLOSED, shapes.grid(5, 7)])
def test_a_clean_mesh_comes_back_as_it_was(shape):
    mesh, notes = repair(*shape)
    assert notes == ()
    assert np.array_equal(mesh.vertices, shape[0])
    assert np.array_equal(mesh.faces, shape[1])


def test_an_open_surface_keeps_its_borders_and_its_winding():
    vertices, faces = shapes.grid(6, 6)
    mesh, _ = repair(*soup_of(vertices, faces[:, ::-1]))
    assert statistics(mesh.vertices, mesh.faces).boundary_edges == 20
    corner = mesh.vertices[mesh.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert (normal[:, 2] < 0).all()


def test_a_moebius_strip_is_cut_once():
    mesh, _ = repair(*shapes.moebius())
    assert_clean(mesh)
    assert len(mesh.faces) == 40
    assert components(mesh.faces).max() == 0
    assert statistics(mesh.vertices, mesh.faces).euler == 1


@pytest.mark.parametrize("shift", [(1, 1, 0), (1, 1, 1)])
def test_cubes_that_touch_come_apart_and_stay_closed(shift):
    mesh, notes = repair(*shapes.together(shapes.cube(), shapes.cube(shift)))
    found = statistics(mesh.vertices, mesh.faces)
    assert (found.components, found.boundary_edges, found.euler) == (2, 0, 4)
    assert any("merely touch" in note for note in notes)


def test_three_sheets_at_one_edge_come_apart_without_loss():
    vertices = np.array([[0.0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]])
    mesh, _ = repair(vertices, [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert_clean(mesh)
    assert len(mesh.faces) == 3


def test_a_wing_leaves_the_body_whole():
    vertices, faces = shapes.torus()
    wing = [[faces[40, 0], faces[40, 1], len(vertices)]]
    mesh, _ = repair(np.concatenate([vertices, [[0, 0, 9.0]]]), np.concatenate([faces, wing]))
    assert_clean(mesh)
    found = statistics(mesh.vertices, mesh.faces)
    assert (found.components, found.boundary_edges, found.euler) == (2, 3, 1)


def test_an_edge_of_very_many_faces_takes_no_time():
    angle = np.linspace(0, 6, 50_001)
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    tips = np.arange(len(rim)) + 2
    faces = np.stack([np.zeros_like(tips), np.ones_like(tips), tips], axis=1)
    faces[::3] = faces[::3, [1, 0, 2]]
    mesh, _ = repair(np.concatenate([[[0, 0, 0], [0, 0, 1.0]], rim]), faces)
    assert_clean(mesh)
    assert len(mesh.faces) == 50_001


def test_flat_faces_equal_their_plain_twin():
    rng = np.random.default_rng(8)
    vertices = rng.integers(0, 4, (40, 3)) * np.array([1.0, 1.0, 1e-3])
    faces = rng.integers(0, 40, (500, 3)).astype(np.int32)
    for height in (0.0, 1e-3, 0.5):
        plain = []
        for number, (a, b, c) in enumerate(vertices[faces]):
            longest = max(np.linalg.norm(b - a), np.linalg.norm(c - b), np.linalg.norm(a - c))
            doubled = np.linalg.norm(np.cross(b - a, c - b))
            if doubled <= height * longest:
                plain.append(number)
        assert flat_faces(vertices, faces, height).tolist() == plain


def test_a_cap_without_area_is_flipped_and_the_surface_stays_closed():
    vertices, faces = shapes.TETRAHEDRON
    # vertex 4 halves edge 0-1 for one of its two faces only: the other gets a cap
    vertices = np.concatenate([vertices, [[0.5, 0, 0]]])
    faces = np.array([[0, 2, 4], [4, 2, 1], [0, 4, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    mesh, notes = repair(vertices, faces)
    assert_clean(mesh)
    assert statistics(mesh.vertices, mesh.faces).boundary_edges == 0
    assert "edges flipped at faces without area: 1" in notes


def test_an_edge_of_almost_no_length_is_collapsed():
    vertices, faces = shapes.torus()
    twice = np.concatenate([vertices, [vertices[0] * (1 + 1e-14)]])
    fan = np.flatnonzero((faces == 0).any(axis=1))[:3]
    moved = faces.copy()
    moved[fan] = np.where(faces[fan] == 0, len(vertices), faces[fan])
    pairs, counts = edges(moved)
    gap = pairs[counts == 1]
    ends = sorted({int(v) for v in gap.reshape(-1)} - {0, len(vertices)})
    needles = [[0, len(vertices), end] for end in ends]
    mesh, notes = repair(twice, np.concatenate([moved, needles]))
    assert statistics(mesh.vertices, mesh.faces) == statistics(vertices, faces)
    assert any("edges without length" in note for note in notes)


def test_fans_over_concave_polygons_are_laid_flat():
    outline = np.array([[0, 0], [1, 3], [4, 4], [1, 5], [0, 8], [-1, 5], [-4, 4], [-1, 3.0]])
    vertices = np.concatenate([outline, np.zeros((8, 1))], axis=1)
    for start in range(8):
        order = np.roll(np.arange(8), -start)
        faces = [[order[0], order[k], order[k + 1]] for k in range(1, 7)]
        mesh, _ = repair(vertices, faces)
        corner = mesh.vertices[mesh.faces]
        doubled = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2]
        assert (doubled > 0).all()
        assert doubled.sum() == pytest.approx(32)
        assert statistics(mesh.vertices, mesh.faces).boundary_edges == 8


def test_duplicates_go_and_folds_leave_the_rest_closed():
    vertices, faces = shapes.torus()
    copies = np.concatenate([faces, faces[3:5], np.roll(faces[7:8], 1, axis=1)])
    assert drop_repeated(copies.astype(np.int32))[1:] == (3, 0)
    fold = np.array([[*faces[0, :2], len(vertices)], [*faces[0, 1::-1], len(vertices)]])
    outside = np.concatenate([vertices, [[5.0, 5, 5]]])
    mesh, notes = repair(outside, np.concatenate([faces, fold]))
    assert statistics(mesh.vertices, mesh.faces) == statistics(vertices, faces)
    assert "dropped faces of folds without thickness: 2" in notes


def test_a_double_sided_sheet_keeps_one_side():
    vertices, faces = shapes.grid(4, 4)
    mesh, _ = repair(vertices, np.concatenate([faces, faces[:, ::-1]]))
    assert np.array_equal(mesh.faces, faces)


def test_faces_that_are_not_finite_go():
    vertices, faces = shapes.grid(4, 4)
    vertices[5] = np.nan
    vertices[10, 1] = np.inf
    mesh, notes = repair(vertices, faces)
    assert_clean(mesh)
    touched = int(np.isin(faces, [5, 10]).any(axis=1).sum())
    assert notes[0] == f"dropped faces with corners that are not finite: {touched}"


@pytest.mark.parametrize(
    ("vertices", "faces", "words"),
    [
        (np.zeros((3, 3)), [[0, 1, 3]], "0..3, the mesh has 3"),
        (np.zeros((3, 3)), [[0, 1, -1]], "-1..1"),
        (np.zeros((3, 3)), np.array([[0, 1, 2**32]]), "4294967296"),
        (np.zeros((3, 3)), [[0, 1, 2]], "extent is 0"),
        (np.zeros((3, 2)), [[0, 1, 2]], "shape"),
        (np.eye(3), np.empty((0, 3), int), "no triangle"),
        (np.full((3, 3), np.nan), [[0, 1, 2]], "finite"),
        (np.eye(3), [[0, 1, 1]], "no triangle is left"),
        (np.outer([0, 1, 2], [1, 1, 1]), [[0, 1, 2]], "zero area"),
        (np.eye(3) * 1e30, [[0, 1, 2]], "1e+30"),
        (np.eye(3) * 1e-30, [[0, 1, 2]], "1e-30"),
        (np.eye(3) * 1e308 * [[1], [-1], [1]], [[0, 1, 2]], "e+308"),
        (np.eye(3) + 1e13, [[0, 1, 2]], "1e+13"),
    ],
)
def test_what_cannot_be_mended_is_refused_with_its_number(vertices, faces, words):
    with pytest.raises(InvalidMesh, match=words.replace("+", r"\+").replace(".", r"\.")):
        repair(vertices, faces)


@pytest.mark.parametrize(("scale", "shift"), [(1e-10, 0), (1e10, 0), (1, 1e7), (1e-3, 10)])
def test_extreme_scales_and_far_origins_work(scale, shift):
    vertices, faces = shapes.torus()
    mesh, notes = repair(vertices * scale + shift, faces)
    assert notes == ()
    assert np.array_equal(mesh.faces, faces)


def plain_agree(faces):
    """Twin of `winding.agree` for surfaces that can agree: relax until nothing changes."""
    faces = faces.copy()
    done = {0}
    while len(done) < len(faces):
        for one in list(done):
            for other in set(range(len(faces))) - done:
                if len(set(faces[one]) & set(faces[other])) == 2:
                    ahead = {(a, b) for a, b in zip(faces[one], np.roll(faces[one], -1))}  # noqa: B905
                    theirs = {(a, b) for a, b in zip(faces[other], np.roll(faces[other], -1))}  # noqa: B905
                    if ahead & theirs:
                        faces[other] = faces[other, ::-1]
                    done.add(other)
    return faces


def test_winding_equals_its_plain_twin():
    rng = np.random.default_rng(2)
    faces = shapes.grid(4, 4)[1].astype(np.int32)
    turned = rng.permutation(len(faces))[: len(faces) // 3]
    faces[turned] = faces[turned, ::-1]
    mine, count = agree(faces)
    assert count == len(turned)
    plain = plain_agree(faces)

    def normalised(array):
        return [tuple(np.roll(row, -row.argmin())) for row in array]

    flipped = normalised(plain[:, ::-1])
    assert normalised(mine) in (normalised(plain), flipped)


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 2**32 - 1))
def test_splitting_keeps_every_face_at_its_place(seed):
    rng = np.random.default_rng(seed)
    vertices = rng.normal(size=(7, 3))
    faces = np.unique(np.sort([rng.choice(7, 3, replace=False) for _ in range(20)]), axis=0)
    faces, _ = agree(faces.astype(np.int32))
    split, source = split_nonmanifold(vertices, faces)
    assert is_manifold(split)
    assert np.array_equal(source[split], faces)
