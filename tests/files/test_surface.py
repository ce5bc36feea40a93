"""Laws of the surfaces that go into files: splits, normals, tangents, texture coordinates."""

import numpy as np
import pytest

from btfcore.dense.build import build_dense_mesh
from btfcore.errors import InvalidParameter
from btfcore.files.surface import export_dense, export_input
from btfcore.files.tangents import vertex_tangents
from btfcore.render.texture import atlas_texture
from btfcore.types import Atlas, Mesh
from tests.boxes import bilinear, box, scatter
from tests.surfaces import grid_faces, sphere


def one_chart(mesh, size=64):
    """Atlas that ignores geometry: every face has its corners' x and y as texels."""
    flat = mesh.vertices[:, :2] - mesh.vertices[:, :2].min(axis=0)
    uv = flat / flat.max() * (size - 10) + 5
    return Atlas(mesh, uv[mesh.faces], np.zeros(len(mesh.faces), np.int32), size)


def test_a_cube_looks_like_a_cube():
    atlas, _ = box(8)
    surface = export_input(atlas.mesh, atlas)
    assert len(surface.positions) == 24
    corner = surface.positions[surface.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    for k in range(3):
        np.testing.assert_allclose(surface.normals[surface.faces[:, k]], normal, atol=1e-6)
    assert surface.closed


def test_a_sphere_in_one_chart_is_not_split_and_smooth():
    dense = sphere(3)
    mesh = Mesh(dense.vertices, dense.faces)
    surface = export_input(mesh, one_chart(mesh))
    assert len(surface.positions) == len(mesh.vertices)
    assert ((surface.normals * surface.positions).sum(axis=1) > 0.999).all()


def test_splits_follow_the_crease_angle():
    atlas, _ = box(8)
    mesh = atlas.mesh
    same = one_chart(mesh)
    assert len(export_input(mesh, same, crease_deg=100).positions) == 8
    assert len(export_input(mesh, same, crease_deg=80).positions) == 24


def test_every_corner_keeps_its_position_and_texture_coordinate():
    atlas, _ = box(8)
    surface = export_input(atlas.mesh, atlas)
    assert np.array_equal(surface.positions[surface.faces], atlas.mesh.vertices[atlas.mesh.faces])
    np.testing.assert_allclose(surface.uv[surface.faces], (atlas.uv + 0.5) / atlas.size, atol=1e-7)
    assert np.array_equal(surface.origin[surface.faces], atlas.mesh.faces)


@pytest.mark.parametrize("shape", ["input", "dense"])
def test_tangents_point_along_the_texture_and_stay_right_handed(shape):
    atlas, dense = box(8, edge=1e-6, centre=(5.0, 0, 0))
    surface = export_input(atlas.mesh, atlas) if shape == "input" else export_dense(dense)
    tangent, normal = surface.tangents[:, :3].astype(float), surface.normals.astype(float)
    np.testing.assert_allclose(np.linalg.norm(tangent, axis=1), 1, atol=1e-6)
    np.testing.assert_allclose((tangent * normal).sum(axis=1), 0, atol=1e-6)
    assert (surface.tangents[:, 3] == 1).all()
    if shape == "input":  # the cube's sides: s is the normal's axes rolled by one
        np.testing.assert_allclose(tangent, np.roll(normal, 1, axis=1), atol=1e-6)


def test_a_mirrored_texture_turns_the_sign_and_a_void_one_keeps_unit_tangents():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    normals = np.tile([0.0, 0, 1], (3, 1))
    faces = np.array([[0, 1, 2]], np.int32)
    upright = np.float32([[0, 1], [1, 1], [0, 0]])
    assert vertex_tangents(positions, normals, upright, faces).tolist() == [[1, 0, 0, 1]] * 3
    mirrored = upright * np.float32([-1, 1]) + np.float32([1, 0])
    assert vertex_tangents(positions, normals, mirrored, faces).tolist() == [[-1, 0, 0, -1]] * 3
    void = vertex_tangents(positions, normals, upright * 0, faces)
    np.testing.assert_allclose(np.linalg.norm(void[:, :3], axis=1), 1, atol=1e-6)
    assert (np.abs(void[:, 2]) < 1e-6).all()


def test_zippered_triangles_stay_in_one_chart_and_show_both_sides():
    _, dense = box(32)
    surface = export_dense(dense)
    assert surface.closed
    span = np.ptp(surface.uv[surface.faces], axis=1).max() * dense.size
    assert span < 4
    colours = dense.vertices.astype(np.float32) * 0.9 + 0.5
    image = atlas_texture(dense, colours)
    zipper = surface.faces[dense.grid_faces :]
    points, uv = scatter(surface.positions, zipper, surface.uv)
    column, row = (uv * dense.size - 0.5).T
    error = np.abs(bilinear(image, column, row) - 255 * (points * 0.9 + 0.5)).max(axis=1)
    assert error.mean() < 2
    assert (error > 20).mean() < 1e-3


def test_a_chart_that_borders_on_itself_is_not_spanned():
    around, high, side = 48, 20, 100
    turn = np.arange(around) / around * 2 * np.pi
    ring = np.stack([np.sin(turn), 0 * turn, np.cos(turn)], axis=1)
    levels = np.linspace(0, -2, high)
    vertices = (ring[None] + levels[:, None, None] * np.array([0, 1, 0])).reshape(-1, 3)
    faces = grid_faces(high, around, wrap=True).astype(np.int32)
    column, row = faces % around, faces // around
    wrapped = (np.ptp(column, axis=1) > 1)[:, None] & (column == 0)
    step = 2 * np.pi / around * (side - 8) / (2 * np.pi)
    uv = np.stack([4 + np.where(wrapped, around, column) * step, 4 + row * 30 / (high - 1)], -1)
    atlas = Atlas(Mesh(vertices, faces), uv, np.zeros(len(faces), np.int32), side)
    dense = build_dense_mesh(atlas)
    surface = export_dense(dense)
    assert len(surface.positions) > len(dense.vertices)
    assert np.ptp(surface.uv[surface.faces], axis=1).max() * dense.size < 4


def test_an_atlas_of_another_mesh_and_lost_coordinates_are_refused():
    atlas, dense = box(8)
    with pytest.raises(InvalidParameter, match="12 faces"):
        export_input(Mesh(dense.vertices, dense.faces), atlas)
    broken = atlas.uv.copy()
    broken[3, 1, 0] = np.nan
    with pytest.raises(InvalidParameter, match="1 corners"):
        export_input(atlas.mesh, Atlas(atlas.mesh, broken, atlas.chart, atlas.size))
