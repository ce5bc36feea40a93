"""Regions go with their faces from the file through the repair."""

import json

import numpy as np
import pytest

from btfcore.errors import InvalidRegions
from btfcore.mesh.obj_groups import obj_groups
from btfcore.mesh.reader import read_mesh
from btfcore.mesh.regions import NAMELESS, Regions, component_regions, read_labels, regions_of
from btfcore.mesh.repair import repair
from tests.mesh import shapes

OBJ = """v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 2 0 0
v 2 1 0
v 3 0 0
v 3 1 0
v 4 0.5 0
o Body
usemtl Wood
f 1 2 3 4
usemtl Metal sheet
f 2 5 6 3
g Tip
usemtl Wood
f 5 7 9 8 6
"""


@pytest.fixture
def obj(tmp_path):
    path = tmp_path / "groups.obj"
    path.write_text(OBJ)
    return path


def at(mesh):
    """Region's name by the middle of each face."""
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    return middle, np.array(mesh.region_names)[mesh.region]


@pytest.mark.parametrize(
    ("way", "names"),
    [
        ("auto", ["Wood", "Metal sheet", "Wood"]),
        ("materials", ["Wood", "Metal sheet", "Wood"]),
        ("parts", ["Body", "Body", "Body/Tip"]),
    ],
)
def test_an_obj_has_the_regions_of_its_statements(obj, way, names):
    mesh, _ = read_mesh(obj, regions=way)
    middle, name = at(mesh)
    assert len(mesh.faces) == 7
    assert (name == np.array(names)[np.clip(middle[:, 0].astype(int), 0, 2)]).all()


def test_an_obj_is_the_same_surface_with_and_without_its_statements(obj, tmp_path):
    plain = tmp_path / "plain.obj"
    kept = [line for line in OBJ.splitlines() if not line.startswith(("o ", "g ", "usemtl"))]
    plain.write_text("\n".join(kept))
    one, two = read_mesh(obj)[0], read_mesh(plain)[0]
    assert two.region is None and two.region_names == ()
    assert np.array_equal(one.vertices, two.vertices)
    assert {frozenset(face) for face in one.faces.tolist()} == {
        frozenset(face) for face in two.faces.tolist()
    }


def test_one_group_needs_no_regions():
    assert obj_groups(b"v 0 0 0\no Box\nusemtl Grey\nf 1 2 3\n") is None
    assert obj_groups(b"v 0 0 0\nf 1 2 3\n") is None
    assert obj_groups(b"usemtl A\nf 1 2\nusemtl B\nf 1 2 3\n") is None, "the parser shall judge"


@pytest.mark.parametrize("suffix", [".json", ".npy"])
def test_labels_count_the_faces_of_the_file(obj, tmp_path, suffix):
    path = tmp_path / f"labels{suffix}"
    labels = [7, 3, 7]
    np.save(path, labels) if suffix == ".npy" else path.write_text(json.dumps(labels))
    mesh, _ = read_mesh(obj, regions=path)
    middle, name = at(mesh)
    assert mesh.region_names == ("3", "7")
    assert (name == np.array(["7", "3", "7"])[np.clip(middle[:, 0].astype(int), 0, 2)]).all()


def test_labels_may_be_names(obj, tmp_path):
    path = tmp_path / "labels.json"
    path.write_text(json.dumps(["b", "a", "b"]))
    assert read_mesh(obj, regions=path)[0].region_names == ("b", "a")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("[1, 2]", "2 labels, but the mesh file has 3 faces"),
        ("[1, 2, 3, 4, 5, 6, 7]", "7 labels, but the mesh file has 3 faces"),
        ("[1, -2, 0]", "label -2 of face 1 is negative"),
        ("[1, 2.5, 0]", "label '2.5' of face 1 is no whole number"),
        ("[1, true, 0]", "label 'True' of face 1"),
        ('["a", 1, 0]', "label 'a' of face 0"),
        ("[1, 1e400, 0]", "'inf' of face 1"),
        (f"[{10**30}, 1, 0]", "too large"),
        ("[]", "not a list of one label per face"),
        ('{"a": 1}', "not a list"),
        ("[1, 2", "this is no JSON"),
        ("[" * 100_000, "this is no JSON"),
    ],
)
def test_labels_that_do_not_fit_are_named(obj, tmp_path, content, reason):
    path = tmp_path / "labels.json"
    path.write_text(content)
    with pytest.raises(InvalidRegions, match="labels.json") as caught:
        read_mesh(obj, regions=path)
    assert reason in str(caught.value)


@pytest.mark.parametrize(
    "values",
    [
        np.zeros((3, 1), np.int64),
        np.zeros(3),
        np.array([None, 1, 2]),
        np.array(["a", "b", "c"]),
        np.full(3, 2**63, np.uint64),
    ],
)
def test_arrays_of_another_kind_are_refused(tmp_path, values):
    path = tmp_path / "labels.npy"
    np.save(path, values, allow_pickle=True)
    with pytest.raises(InvalidRegions, match="labels.npy"):
        read_labels(path, 3)


def test_other_ways_are_listed(obj, tmp_path):
    with pytest.raises(InvalidRegions, match="auto, materials, parts, components"):
        read_mesh(obj, regions="colours")
    with pytest.raises(InvalidRegions, match="cannot be opened"):
        read_mesh(obj, regions=tmp_path / "absent.npy")
    (tmp_path / "broken.npy").write_bytes(b"\x93NUMPY\x01\x00")
    with pytest.raises(InvalidRegions, match="no array"):
        read_mesh(obj, regions=tmp_path / "broken.npy")


def test_names_that_occur_twice_are_one_region():
    index, none = np.array([0, 1, 2, -1], np.int32), np.full(4, -1, np.int32)
    found = regions_of("auto", index, ["a", "b", "a"], none, [])
    assert found.names == ("a", "b", NAMELESS) and found.label.tolist() == [0, 1, 0, 2]
    assert regions_of("auto", none, [], none, []) is None
    assert regions_of("parts", index, ["a", "b", "a"], none, []).names == (NAMELESS,)


def test_components_come_largest_first():
    small, large = shapes.cube(), shapes.sphere()
    _, faces = shapes.together(small, (large[0] + 9, large[1]))
    found = component_regions(np.asarray(faces, np.int32))
    assert found.names == ("1", "2")
    assert (found.label[: len(small[1])] == 1).all() and (found.label[len(small[1]) :] == 0).all()


def test_regions_stay_with_their_places_through_every_repair():
    """Holes of the list, copies, flat faces, reversals and flips leave labels where they were."""
    random = np.random.default_rng(4)
    vertices, faces = shapes.sphere(12, 18)
    label = (vertices[faces].mean(axis=1)[:, 2] > 0.05).astype(np.int32)
    # T-junctions without area, which are mended by flips
    edge = faces[:, [0, 1]]
    caps = random.choice(len(faces), 12, replace=False)
    middle = vertices[edge[caps]].mean(axis=1)
    number = np.arange(len(vertices), len(vertices) + len(caps))
    cap = np.stack([edge[caps, 1], edge[caps, 0], number], axis=1)
    halves = np.concatenate(
        [
            np.stack([edge[caps, 0], number, faces[caps, 2]], axis=1),
            np.stack([number, edge[caps, 1], faces[caps, 2]], axis=1),
        ]
    )
    rest = np.delete(faces, caps, axis=0)
    points = np.concatenate([vertices, middle, [[np.nan] * 3]])
    broken = np.array([[0, 1, len(points) - 1]])
    soup = np.concatenate([rest, halves, cap, rest[:40], broken])
    own = np.concatenate(
        [np.delete(label, caps), label[caps], label[caps], 1 - label[caps],
         np.delete(label, caps)[:40], [0]]
    )  # fmt: skip
    order = random.permutation(len(soup))
    order = np.concatenate([order[order < len(rest)], order[order >= len(rest)]])
    flipped = random.random(len(soup)) < 0.3
    soup[flipped] = soup[flipped][:, ::-1]
    mesh, notes = repair(
        points, soup[order].astype(np.int32),
        regions=Regions(own[order].astype(np.int32), ("low", "high")),
    )  # fmt: skip
    assert any("flipped" in note for note in notes), notes
    assert any("duplicate" in note for note in notes)
    assert mesh.region is not None and len(mesh.region) == len(mesh.faces)
    height = mesh.vertices[mesh.faces].mean(axis=1)[:, 2]
    clear = np.abs(height - 0.05) > 0.1
    assert np.array_equal(mesh.region[clear], (height > 0.05).astype(int)[clear])
    assert mesh.region_names == ("low", "high")


def test_a_real_glb_has_regions_by_node_and_by_component(data):
    mesh, _ = read_mesh(data / "meshes" / "shaderball.glb")
    assert mesh.region_names == ("Calibration_Mesh", "Preview_Mesh")
    assert np.bincount(mesh.region).tolist() == [17456, 70808]
    mesh, _ = read_mesh(data / "meshes" / "shaderball.glb", regions="components")
    assert np.bincount(mesh.region).tolist() == [54064, 16744, 12288, 5168]


def test_a_glb_of_several_primitives_has_regions_by_material(tmp_path):
    path = tmp_path / "two.gltf"
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "<f4")
    (tmp_path / "two.bin").write_bytes(
        corners.tobytes()
        + np.array([0, 1, 2], "<u4").tobytes()
        + np.array([1, 3, 2], "<u4").tobytes()
    )
    views = [(0, 48), (48, 12), (60, 12)]
    accessor = {"componentType": 5125, "count": 3, "type": "SCALAR"}
    path.write_text(
        json.dumps(
            {
                "asset": {"version": "2.0"},
                "scene": 0,
                "scenes": [{"nodes": [0]}],
                "nodes": [{"mesh": 0, "name": "thing"}],
                "materials": [{"name": "Skin"}, {"name": "Bone"}],
                "meshes": [
                    {
                        "name": "thing",
                        "primitives": [
                            {"attributes": {"POSITION": 0}, "indices": 1, "material": 1},
                            {"attributes": {"POSITION": 0}, "indices": 2, "material": 0},
                        ],
                    }
                ],
                "buffers": [{"uri": "two.bin", "byteLength": 72}],
                "bufferViews": [
                    {"buffer": 0, "byteOffset": start, "byteLength": size} for start, size in views
                ],
                "accessors": [
                    {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                     "min": [0, 0, 0], "max": [1, 1, 0]},
                    {"bufferView": 1, **accessor},
                    {"bufferView": 2, **accessor},
                ],
            }
        )
    )  # fmt: skip
    mesh, _ = read_mesh(path)
    middle, name = at(mesh)
    assert (name == np.where(middle.sum(axis=1) < 1, "Bone", "Skin")).all()
    assert len(mesh.vertices) == 4, "they stay one connected surface"
