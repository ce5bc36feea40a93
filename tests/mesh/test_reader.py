"""Reading mesh files: every format gives the same surface, every broken file a named error."""

import base64
import json
import os
import struct
import subprocess
import sys

import numpy as np
import pytest

from btfcore.errors import Cancelled, GuardedFailure, InvalidMesh
from btfcore.mesh.reader import read_mesh
from btfcore.mesh.topology import statistics
from tests.conftest import shared_data
from tests.mesh import shapes


def obj_text(vertices, faces):
    lines = ["v " + " ".join(map(repr, row)) for row in vertices.tolist()]
    return "\n".join(lines + ["f " + " ".join(str(i + 1) for i in row) for row in faces.tolist()])


def stl_bytes(vertices, faces):
    triangle = np.zeros(len(faces), [("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("a", "<u2")])
    triangle["corner"] = vertices[faces]
    return (
        b"solid by a careless writer".ljust(80) + struct.pack("<I", len(faces)) + triangle.tobytes()
    )


def gltf(vertices, faces, nodes, **changes):
    """JSON (as a dictionary) and binary chunk of a glTF with one mesh placed by `nodes`."""
    points, index = vertices.astype("<f4").tobytes(), faces.astype("<u4").tobytes()
    header = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(points) + len(index)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(points)},
            {"buffer": 0, "byteOffset": len(points), "byteLength": len(index)},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": faces.size, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": nodes,
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    return header | changes, points + index


def glb(header, binary):
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    body += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def write(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_every_format_gives_the_same_surface(tmp_path):
    vertices, faces = shapes.torus()
    vertices = vertices.astype(np.float32).astype(float)
    off = f"OFF\n{len(vertices)} {len(faces)} 0\n"
    off += "\n".join(" ".join(map(repr, row)) for row in vertices.tolist()) + "\n"
    off += "\n".join("3 " + " ".join(map(str, row)) for row in faces.tolist())
    header, binary = gltf(vertices, faces, [{"mesh": 0}])
    uri = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    embedded = header | {"buffers": [{"byteLength": len(binary), "uri": uri}]}
    files = [
        write(tmp_path / "torus.OBJ", obj_text(vertices, faces)),
        write(tmp_path / "torus.stl", stl_bytes(vertices, faces)),
        write(tmp_path / "torus.off", off),
        write(tmp_path / "torus.glb", glb(header, binary)),
        write(tmp_path / "Tórus mit Raum.gltf", json.dumps(embedded)),
    ]
    expected = statistics(vertices, faces)
    for file in files:
        mesh, report = read_mesh(file)
        assert report.statistics == expected, file
        assert report.notes == (), file
        assert np.ptp(mesh.vertices, axis=0) == pytest.approx(np.ptp(vertices, axis=0), rel=1e-6)
        assert shapes.volume(mesh.vertices, mesh.faces) == pytest.approx(
            shapes.volume(vertices, faces), rel=1e-5
        )


def test_stl_text_and_stl_with_bytes_at_the_end(tmp_path):
    vertices, faces = shapes.cube()
    corners = [f"vertex {x} {y} {z}" for x, y, z in vertices[faces.reshape(-1)].tolist()]
    text = "solid cube\n"
    for first in range(0, len(corners), 3):
        three = "\n".join(corners[first : first + 3])
        text += f"facet normal 0 0 0\nouter loop\n{three}\nendloop\nendfacet\n"
    write(tmp_path / "text.stl", text + "endsolid cube\n")
    write(tmp_path / "more.stl", stl_bytes(vertices, faces) + b"a careless postscript")
    for name in ("text.stl", "more.stl"):
        mesh, report = read_mesh(tmp_path / name)
        assert report.statistics == statistics(vertices, faces)
        assert shapes.volume(mesh.vertices, mesh.faces) == pytest.approx(1)


def test_a_scene_comes_in_world_space(tmp_path):
    nodes = [
        {"children": [1, 2], "translation": [10, 0, 0]},
        {"mesh": 0, "scale": [2, 2, 2]},
        {"mesh": 0, "scale": [-1, 1, 1], "translation": [0, 5, 0]},
    ]
    file = write(tmp_path / "two.glb", glb(*gltf(*shapes.cube(), nodes)))
    mesh, report = read_mesh(file)
    assert mesh.vertices.min(axis=0).tolist() == [9, 0, 0]
    assert mesh.vertices.max(axis=0).tolist() == [12, 6, 2]
    assert report.statistics.components == 2
    assert report.notes == ()  # the mirrored copy came in with its winding turned
    assert shapes.volume(mesh.vertices, mesh.faces) == pytest.approx(9)


def test_obj_dialects(tmp_path):
    lines = [
        "\ufeff# relative indices, quads, tabs, CRLF, continued lines, normals",
        "mtllib ../../secret.mtl",
        "o first",
        *("v\t0 0 0", "v 1 0 0", " v 1 1 0", "v 0 1 0", "vt 0 0", "vn 0 0 1"),
        "f -4/-1/-1 -3/-1/-1 \\",
        "-2/-1/-1 -1/-1/-1",
        "o second",
        *("v 0 0 5", "v 1 0 5", "v 1 1 5", "v 0 1 5", "v -1 0.5 5"),
        "f -5//1 -4//1 -3//1 -2//1 -1//1 # not 0 - or so",
    ]
    mesh, report = read_mesh(write(tmp_path / "dialect.obj", "\r\n".join(lines)))
    assert (report.statistics.faces, report.statistics.components) == (5, 2)
    assert sorted(set(mesh.vertices[:, 2].tolist())) == [0, 5]


def triangle_glb(**changes):
    vertices, faces = shapes.grid(2, 2)
    header, binary = gltf(vertices, faces, [{"mesh": 0}])
    for key, value in changes.items():
        header[key] = value
    return glb(header, binary)


def buffers(uri):
    return triangle_glb(buffers=[{"byteLength": 72, "uri": uri}])


GOOD = obj_text(*shapes.grid(2, 2))
BROKEN = {
    "empty.obj": (b"", "0 bytes"),
    "words.obj": ("nothing to see here", "no triangle"),
    "points.obj": ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no triangle"),
    "zero.obj": (GOOD + "\nf 0 1 2\n", "line 7 names vertex 0"),
    "range.obj": (GOOD + "\nf 1 2 9\n", "cannot be parsed"),
    "huge.obj": (GOOD + "\nf 1 2 4294967297\n", "cannot be parsed"),
    "back.obj": (GOOD + "\nf -1 -2 -9\n", "reaches back"),
    "comma.obj": ("v 0,5 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "cannot be parsed"),
    "nan.obj": ("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "finite"),
    "large.obj": ("v 1e30 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "1e+30"),
    "pointer.ply": ("version https://git-lfs.github.com/spec/v1\noid sha256:00\n", "LFS"),
    "text.glb": (GOOD, "b'glTF'"),
    "text.ply": (GOOD, "b'ply'"),
    "mesh.fbx": (GOOD, ".fbx"),
    "noending": (GOOD, "''"),
    "short.stl": (stl_bytes(*shapes.cube())[:-30], "12 triangles, which take 684 bytes"),
    "empty.stl": ("solid nothing\nendsolid nothing\n", "no triangle"),
    "many.off": ("OFF\n4000000000 4000000000 0\n0 0 0\n", "cannot be parsed"),
    "range.off": ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "outside the range"),
    "list.gltf": ("[1, 2]", "no glTF"),
    "deep.gltf": ("[" * 100_000, "JSON"),
    "short.glb": (triangle_glb()[:-9], "cut off"),
    "draco.glb": (triangle_glb(extensionsRequired=["KHR_draco_mesh_compression"]), "draco"),
    "etc.glb": (buffers("../../../etc/passwd"), "outside its own folder"),
    "coded.glb": (buffers("%2e%2e/x.bin"), "outside its own folder"),
    "file.glb": (buffers("file:///etc/passwd"), "outside its own folder"),
    "http.glb": (buffers("http://localhost/x.bin"), "outside its own folder"),
    "root.glb": (buffers("/etc/passwd"), "outside its own folder"),
    "cycle.glb": (
        triangle_glb(nodes=[{"mesh": 0, "children": [1]}, {"children": [0]}]),
        "root and a child",
    ),
    "lines.glb": (
        triangle_glb(meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "mode": 1}]}]),
        "no triangles",
    ),
    "fan.glb": (
        triangle_glb(meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "mode": 6}]}]),
        "triangle fans",
    ),
    "accessor.glb": (
        triangle_glb(meshes=[{"primitives": [{"attributes": {"POSITION": 7}}]}]),
        "accessor 7 of 2",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_refused_by_name(tmp_path, name):
    content, words = BROKEN[name]
    with pytest.raises(InvalidMesh) as caught:
        read_mesh(write(tmp_path / name, content))
    assert str(caught.value).startswith(f"{name}: ")
    assert words in str(caught.value)


def test_missing_files_folders_and_pipes(tmp_path):
    (tmp_path / "folder.obj").mkdir()
    cases = {"missing.obj": "no such file", "folder.obj": "folder", "a\0b.obj": "."}
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.obj")
        cases["pipe.obj"] = "no regular file"
    cases["n" * 300 + ".obj"] = "."
    for name, words in cases.items():
        with pytest.raises(InvalidMesh, match=words):
            read_mesh(tmp_path / name)


def test_a_link_out_of_the_folder_is_refused(tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    header, binary = gltf(*shapes.cube(), [{"mesh": 0}])
    write(tmp_path / "outside.bin", binary)
    (inner / "inside.bin").symlink_to(tmp_path / "outside.bin")
    header["buffers"][0]["uri"] = "inside.bin"
    with pytest.raises(InvalidMesh, match="outside its own folder"):
        read_mesh(write(inner / "scene.gltf", json.dumps(header)))
    (inner / "inside.bin").unlink()
    write(inner / "inside.bin", binary)
    assert read_mesh(inner / "scene.gltf")[1].statistics.euler == 2


def test_a_time_limit_and_cancelling_hold(tmp_path):
    file = write(tmp_path / "cube.obj", obj_text(*shapes.cube()))
    with pytest.raises(GuardedFailure, match="cube.obj"):
        read_mesh(file, limit_s=0)

    def stop(fraction, label):
        raise Cancelled

    with pytest.raises(Cancelled):
        read_mesh(file, progress=stop)


def test_the_program_itself_never_loads_trimesh(tmp_path):
    file = write(tmp_path / "cube.obj", obj_text(*shapes.cube()))
    code = (
        "import sys; from btfcore.mesh.reader import read_mesh; read_mesh(sys.argv[1]);"
        "sys.exit('trimesh' in sys.modules or 'PIL' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code, str(file)], check=True)


KNOWN = {
    "3holes.off": (-4, 0), "Duck.glb": (2, 0), "bunny.obj": (2, 0), "busted.STL": (2, 0),
    "camelhead.off": (1, 1), "cube_no_bottom.obj": (1, 1), "fertility.off": (-6, 0),
    "nancolor.obj": (2, 0), "notenoughindices.obj": (1, 1), "plane_holes.obj": (-25, 27),
    "shaderball.glb": (8, 0), "skull.obj": (-2, 0), "soup.stl": (100, 100),
    "spot_quads_uv.obj": (2, 0), "stanford-bunny.obj": (-3, 5), "torus.obj": (0, 0),
}  # fmt: skip


@pytest.mark.parametrize("name", KNOWN)
def test_real_meshes_keep_their_topology(name):
    mesh, report = read_mesh(shared_data() / "meshes" / name)
    found = report.statistics
    assert (found.euler, found.boundary_loops) == KNOWN[name]
    assert (found.nonmanifold_edges, len(mesh.faces)) == (0, found.faces)


@pytest.mark.parametrize("name", ["cycloidal.ply", "dragon_res2.ply"])
def test_crowded_scans_become_manifold_and_nearly_closed(name):
    _, report = read_mesh(shared_data() / "meshes" / name)
    assert report.statistics.nonmanifold_edges == 0
    assert report.statistics.boundary_edges < 1e-3 * report.statistics.faces
