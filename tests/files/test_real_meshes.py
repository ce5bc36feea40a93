"""From real mesh files to exported ones: the texture shows the dense mesh, seams and all."""

import numpy as np
import pytest
import trimesh

from btfcore.dense.atlas import build_atlas
from btfcore.dense.build import build_dense_mesh
from btfcore.files.export import export
from btfcore.files.surface import export_dense, export_input
from btfcore.mesh.reader import read_mesh
from btfcore.render.gutter import nearest_owner, texel_owner
from btfcore.render.texture import atlas_texture
from btfcore.types import Mesh
from tests.boxes import bilinear, scatter

RATE = 256
FILES = ("bunny.obj", "cube_no_bottom.obj", "fandisk.obj", "soup.stl", "triangle")


@pytest.fixture(scope="module")
def made(data):
    """Return a function that makes (mesh, atlas, dense) of a named file, once."""
    kept = {}

    def make(name):
        if name not in kept:
            if name == "triangle":
                corners = np.array([[0.0, 0, 0], [3, 0, 1], [1, 2, 0]])
                mesh = Mesh(corners, np.array([[0, 1, 2]], np.int32))
            else:
                mesh, _ = read_mesh(data / "meshes" / name)
            atlas = build_atlas(mesh, rate=RATE)
            kept[name] = mesh, atlas, build_dense_mesh(atlas)
        return kept[name]

    return make


def position_colours(mesh, points):
    """Colours that change smoothly over the mesh, 0–1."""
    low = mesh.vertices.min(axis=0)
    return (points - low) / np.ptp(mesh.vertices, axis=0).max()


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("shape", ["input", "dense"])
def test_the_textured_surface_agrees_with_the_dense_mesh(made, name, shape):
    mesh, atlas, dense = made(name)
    surface = export_input(mesh, atlas) if shape == "input" else export_dense(dense)
    colours = position_colours(mesh, dense.vertices).astype(np.float32)
    image = atlas_texture(dense, colours)
    points, uv = scatter(surface.positions, surface.faces, surface.uv, 40000)
    column, row = (uv * atlas.size - 0.5).T
    error = np.abs(bilinear(image, column, row) - 255 * position_colours(mesh, points)).max(axis=1)
    assert error.mean() < 2
    assert (error > 20).mean() < 1e-3


def test_crossing_the_seam_beats_dilation(made):
    mesh, atlas, dense = made("bunny.obj")
    wave = 2 * np.pi / (12 * dense.step)

    def shade(points):
        return 0.5 + 0.4 * np.sin(wave * points)

    owner = texel_owner(dense)
    points, uv = scatter(mesh.vertices[mesh.faces], None, atlas.uv, 60000)
    column, row = np.clip(np.floor(uv).astype(int), 0, atlas.size - 2).T
    ring = [owner[row + r, column + c] < 0 for r in (0, 1) for c in (0, 1)]
    border = np.any(ring, axis=0)
    errors = []
    for source in (None, nearest_owner(owner)):
        image = atlas_texture(dense, shade(dense.vertices).astype(np.float32), source=source)
        found = bilinear(image, uv[border, 0], uv[border, 1])
        errors.append(np.abs(found - 255 * shade(points[border])).mean())
    assert errors[0] < 0.75 * errors[1]


@pytest.mark.parametrize(
    ("name", "dense_shape"), [*((name, False) for name in FILES), ("bunny.obj", True)]
)
def test_the_khronos_validator_finds_nothing(made, tmp_path, gltf_issues, name, dense_shape):
    mesh, atlas, dense = made(name)
    colours = position_colours(mesh, dense.vertices).astype(np.float32)
    path = tmp_path / "out.glb"
    export(path, mesh, atlas, dense, colours, dense_shape=dense_shape)
    assert gltf_issues(path) == []


def test_the_dense_export_welds_to_a_closed_mesh(made, tmp_path):
    mesh, atlas, dense = made("bunny.obj")
    colours = position_colours(mesh, dense.vertices).astype(np.float32)
    for suffix in (".ply", ".obj", ".glb"):
        path = export(tmp_path / f"out{suffix}", mesh, atlas, dense, colours, dense_shape=True)[0]
        found = trimesh.load(path, force="mesh", process=False)
        found.merge_vertices(merge_tex=True, merge_norm=True)
        assert found.is_watertight, suffix
        assert found.euler_number == 2
