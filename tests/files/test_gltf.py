"""Laws of the GLB, read back by trimesh and judged by the Khronos validator."""

import io
import json
import struct

import numpy as np
import pytest
import trimesh
from PIL import Image

from btfcore.errors import OutputFailed
from btfcore.files.gltf import write_glb
from btfcore.files.png import encode_png
from btfcore.files.surface import ExportSurface, export_dense, export_input
from btfcore.types import Atlas, Mesh
from tests.boxes import box


def noise(size=64):
    return np.random.default_rng(0).integers(0, 256, (size, size, 3)).astype(np.uint8)


def single_triangle():
    mesh = Mesh(np.array([[0, 0, 0], [2.0, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]], np.int32))
    uv = np.array([[[3.0, 30], [40, 30], [3, 12]]])
    return Atlas(mesh, uv, np.zeros(1, np.int32), 64)


def loose_triangles(count=100):
    random = np.random.default_rng(7)
    mesh = Mesh(random.random((3 * count, 3)), np.arange(3 * count, dtype=np.int32).reshape(-1, 3))
    at = np.stack(np.divmod(np.arange(count), 10), axis=1)[:, None] * 12.0
    uv = at + [[1, 9], [9, 9], [1, 1]]
    return Atlas(mesh, uv, np.arange(count, dtype=np.int32), 128)


def document(path):
    """JSON and binary chunk of a GLB, by struct alone."""
    data = path.read_bytes()
    magic, version, total = struct.unpack_from("<4sII", data)
    assert (magic, version, total) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON" and size % 4 == 0
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def surfaces():
    atlas, dense = box(12)
    yield "cube", export_input(atlas.mesh, atlas)
    yield "dense", export_dense(dense)
    yield "triangle", export_input(single_triangle().mesh, single_triangle())
    yield "soup", export_input(loose_triangles().mesh, loose_triangles())
    atlas, _ = box(12, centre=(1e7, -2e7, 3e7), edge=3.0)
    yield "far", export_input(atlas.mesh, atlas)
    for edge in (1e30, 1e-30):
        atlas, _ = box(12, edge=edge)
        yield f"edge {edge:g}", export_input(atlas.mesh, atlas)


SURFACES = dict(surfaces())


@pytest.mark.parametrize("name", SURFACES)
def test_positions_faces_and_pixels_come_back(tmp_path, name):
    surface = SURFACES[name]
    image = noise()
    write_glb(tmp_path / "out.glb", surface, encode_png(image), name=name)
    scene = trimesh.load_scene(tmp_path / "out.glb", process=False)
    (found,) = scene.dump()
    extent = np.ptp(surface.positions, axis=0).max()
    assert len(found.faces) == len(surface.faces)
    error = found.vertices[found.faces] - surface.positions[surface.faces]
    assert np.abs(error).max() <= 1e-6 * extent
    material = found.visual.material
    assert np.array_equal(np.asarray(material.baseColorTexture), image)
    assert material.metallicFactor == 0
    np.testing.assert_allclose(
        found.visual.uv, np.stack([surface.uv[:, 0], 1 - surface.uv[:, 1]], axis=1), atol=1e-6
    )
    (own,) = scene.geometry.values()  # before the node's scale, which trimesh's normals resent
    np.testing.assert_allclose(own.vertex_normals, surface.normals, atol=1e-5)


@pytest.mark.parametrize("name", SURFACES)
def test_the_khronos_validator_finds_nothing(tmp_path, gltf_issues, name):
    surface = SURFACES[name]
    write_glb(tmp_path / "out.glb", surface, encode_png(noise()), name=name)
    assert gltf_issues(tmp_path / "out.glb") == []


def test_the_validator_itself_is_awake(tmp_path, gltf_issues):
    surface = export_input(single_triangle().mesh, single_triangle())
    crooked = ExportSurface(**{**vars(surface), "normals": surface.normals * 2})
    write_glb(tmp_path / "out.glb", crooked, encode_png(noise()))
    assert gltf_issues(tmp_path / "out.glb")


def test_the_header_says_what_viewers_need(tmp_path):
    surface = export_input(single_triangle().mesh, single_triangle())
    image = noise()
    write_glb(
        tmp_path / "out.glb", surface, encode_png(image), name="größe \udcff", extras={"seed": 7}
    )
    head, binary = document(tmp_path / "out.glb")
    assert head["asset"]["generator"].startswith("Patina ")
    assert head["asset"]["extras"]["patina"]["seed"] == 7
    assert head["materials"][0]["doubleSided"] is True
    assert head["samplers"] == [
        {"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}
    ]
    view = head["bufferViews"][head["images"][0]["bufferView"]]
    png = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(png))), image)
    assert all(view["byteOffset"] % 4 == 0 for view in head["bufferViews"])
    json.dumps(head, ensure_ascii=False).encode("utf-8")


@pytest.mark.parametrize(("count", "component"), [(65535, 5123), (65536, 5125)])
def test_indices_are_as_narrow_as_can_be(tmp_path, count, component):
    random = np.random.default_rng(0)
    faces = np.array([[0, 1, count - 1]], np.int32)
    surface = ExportSurface(
        random.random((count, 3)),
        np.tile(np.float32([0, 0, 1]), (count, 1)),
        np.tile(np.float32([1, 0, 0, 1]), (count, 1)),
        random.random((count, 2)).astype(np.float32),
        faces,
        np.arange(count, dtype=np.int32),
        False,
    )
    write_glb(tmp_path / "out.glb", surface, encode_png(noise(4)))
    head, _ = document(tmp_path / "out.glb")
    index = head["accessors"][head["meshes"][0]["primitives"][0]["indices"]]
    assert index["componentType"] == component


def test_collapsed_triangles_are_left_out_and_nothing_else(tmp_path):
    atlas = single_triangle()
    vertices = np.concatenate([atlas.mesh.vertices, [[2.0, 0, 0], [1e-30, 0, 0]]])
    faces = np.array([[0, 1, 2], [1, 3, 2], [0, 4, 2]], np.int32)
    mesh = Mesh(vertices, faces)
    full = Atlas(mesh, np.repeat(atlas.uv, 3, axis=0), np.zeros(3, np.int32), 64)
    surface = export_input(mesh, full)
    write_glb(tmp_path / "out.glb", surface, encode_png(noise()))
    (found,) = trimesh.load_scene(tmp_path / "out.glb", process=False).dump()
    assert len(found.faces) == 2  # 1e-30 is no zero, and stays
    empty = ExportSurface(**{**vars(surface), "faces": surface.faces[1:2]})
    with pytest.raises(OutputFailed, match="all 1 triangles"):
        write_glb(tmp_path / "none.glb", empty, encode_png(noise()))
    assert not (tmp_path / "none.glb").exists()


def test_the_same_input_gives_the_same_bytes(tmp_path):
    for name in ("a.glb", "b.glb"):
        atlas, _ = box(8)
        write_glb(tmp_path / name, export_input(atlas.mesh, atlas), encode_png(noise()))
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()
