"""Projects from anywhere: a project or a named error, quickly and in little memory."""

import io
import json
import os
import pickle
import struct
import tracemalloc
import zipfile

import numpy as np
import pytest

from btfcore.errors import InvalidProject
from btfcore.files.project.read import project_token, read_project, verify
from btfcore.files.project.write import write_project
from tests.files.package.mutate import mutants, repacked
from tests.files.project.projects import differences, project


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    path = tmp_path_factory.mktemp("original") / "a.patina"
    write_project(path, project(True))
    return path.read_bytes()


def refused(tmp_path, data, message, readers=(read_project,)):
    path = tmp_path / "bad.patina"
    path.write_bytes(data)
    before = sorted(tmp_path.iterdir())
    for reader in readers:
        tracemalloc.start()
        try:
            with pytest.raises(InvalidProject, match=message) as caught:
                reader(path)
            assert tracemalloc.get_traced_memory()[1] < 100 << 20
        finally:
            tracemalloc.stop()
        assert str(caught.value).startswith("bad.patina: ")
    assert sorted(tmp_path.iterdir()) == before


def members(data):
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(parts, **options):
    """Zip of (name or ZipInfo, bytes) pairs."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", **options) as archive:
        for name, body in parts:
            archive.writestr(name, body)
    return out.getvalue()


def with_extra(data, name, body=b"x", **attributes):
    info = zipfile.ZipInfo(name)
    for key, value in attributes.items():
        setattr(info, key, value)
    return packed([*members(data).items(), (info, body)])


@pytest.mark.parametrize(
    ("name", "body", "message"),
    [
        ("state.pkl", b"x", "pickled objects"),
        ("state.PICKLE", b"x", "pickled objects"),
        ("arrays.npy", b"x", "pickled objects"),
        ("arrays.npz", b"x", "pickled objects"),
        ("note.txt", pickle.dumps({"a": 1}), "is a pickle"),
        ("note.txt", pickle.dumps([1], protocol=2), "is a pickle"),
        ("data.bin", b"\x93NUMPY\x01\x00", "array file"),
        ("inner.zip", packed([("a", b"b")]), "an archive"),
        ("inner", packed([]), "an archive"),
        ("../evil.json", b"x", "no plain name"),
        ("a/../../evil.json", b"x", "no plain name"),
        ("..", b"x", "no plain name"),
        ("/etc/passwd", b"x", "no plain name"),
        ("//host/share/x", b"x", "no plain name"),
        ("C:/windows/x", b"x", "no plain name"),
        ("C:x", b"x", "no plain name"),
        ("a\\..\\b", b"x", "no plain name"),
        ("\\\\host\\share", b"x", "no plain name"),
        ("folder/", b"", "no plain name"),
        ("a\nb", b"x", "no plain name"),
        ("manifest.json", b"{}", "two members"),
    ],
)
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_members_that_have_no_place_in_a_project(tmp_path, original, name, body, message):
    data = with_extra(original, name, body)
    refused(tmp_path, data, message, (read_project, verify, project_token))


def test_a_link_as_a_member(tmp_path, original):
    data = with_extra(original, "link", b"/etc/passwd", external_attr=0o120777 << 16)
    refused(tmp_path, data, "symbolic link")


def test_a_pickle_under_the_name_of_a_member(tmp_path, original):
    parts = members(original) | {"edits.json": pickle.dumps({"edits": []})}
    refused(tmp_path, packed(parts.items()), "edits.json' is a pickle")


def test_compressed_members(tmp_path, original):
    data = packed(members(original).items(), compression=zipfile.ZIP_DEFLATED)
    refused(tmp_path, data, "is compressed")
    bomb = packed([("manifest.json", bytes(1 << 28))], compression=zipfile.ZIP_DEFLATED)
    refused(tmp_path, bomb, "is compressed")


def test_an_encrypted_member(tmp_path, original):
    data = bytearray(original)
    place = data.find(b"PK\1\2")
    data[place + 8] |= 1
    refused(tmp_path, bytes(data), "encrypted")


def test_members_on_top_of_each_other(tmp_path, original):
    # two entries of the directory that lead to the same bytes
    data = with_extra(original, "one", b"x" * 50)
    directory = data.find(b"PK\1\2")
    end = data.rfind(b"PK\5\6")
    last = data.rfind(b"PK\1\2")
    again = bytearray(data[last:end])
    again[again.find(b"one") : again.find(b"one") + 3] = b"two"
    (count,) = struct.unpack_from("<H", data, end + 8)
    tail = bytearray(data[end:])
    struct.pack_into("<HHI", tail, 8, count + 1, count + 1, end - directory + len(again))
    refused(tmp_path, data[:end] + bytes(again) + bytes(tail), "overlap")


def test_too_many_members(tmp_path, original):
    parts = [*members(original).items(), *((f"x{at}", b"") for at in range(2100))]
    refused(tmp_path, packed(parts), "members listed")


def manifest_with(original, tmp_path, change):
    return repacked(original, tmp_path, manifest=change)


def changed(*path, to):
    def change(manifest):
        part = manifest
        for key in path[:-1]:
            part = part[key]
        part[path[-1]] = to
        return manifest

    return change


def without(*path):
    def change(manifest):
        part = manifest
        for key in path[:-1]:
            part = part[key]
        del part[path[-1]]
        return manifest

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (changed("version", to=2), "version 2 of the project format is newer than 1"),
        (changed("version", to=10**30), "is newer than 1"),
        (changed("version", to=-1), "version -1 of the project format is unknown"),
        (changed("version", to="1"), "manifest field version"),
        (changed("version", to=True), "manifest field version"),
        (changed("format", to="patina-btf-sample"), "does not say that it is a patina-project"),
        (changed("token", to="../x"), "token"),
        (changed("dense", "vertices", to=10**9), "dense.vertices: 1000000000"),
        (changed("dense", "vertices", to=-1), "dense.vertices: -1"),
        (changed("dense", "vertices", to=217), r"shape \(216, 3\), not float64 of \(217, 3\)"),
        (changed("dense", "size", to=9), "texels 2 … .*, outside 0 … 8"),
        (changed("mesh", "regions", to=[]), "regions 0 … 1, outside 0 … -1"),
        (changed("mesh", "vertices", to=7), "not float64 of"),
        (changed("quilt", "half_edges", to=5), "a quilt of 5 half-edges, the mesh has"),
        (changed("quilt", "patches", to=2), "patches -1 … 6, outside -1 … 1"),
        (changed("parameters", "seed", to=-1), "seed is -1"),
        (changed("parameters", "scale", to="big"), "parameters.scale"),
        (changed("parameters", "swing", to=[[1]]), "parameters.swing"),
        (changed("samples", to=[]), "samples"),
        (changed("samples", 0, "height", to=7), "not float32 of"),
        (changed("samples", 0, "rank", to=3), r"not float32 of \(6, 8, 3\)"),
        (changed("samples", 0, "material", "views", to=[[0.0, 0.0, 1.0]] * 5), "same direction"),
        (changed("samples", 0, "material", "encoding", "name", to="pickle"), "encoding.name"),
        (changed("samples", 1, "name", to="background"), "samples have the same name"),
        (changed("plan", "sample", to=[0, 0]), "regions name 1 of 2 samples"),
        (changed("plan", "sample", to=[0]), "a plan of 2 regions"),
        (changed("plan", "sample", to=[0, 5]), "regions name"),
        (changed("plan", "pairs", to=[[0, 2]]), "regions of a border 0 … 2"),
        (changed("plan", to=None), "half-edges"),
        (changed("edits", 0, "uid", to=12), "edit 12, the next is to be 12"),
        (changed("edits", 1, "uid", to=3), "edits have the same name or number"),
        (changed("edits", 0, "delta", "token", to=81), "delta 81 of 80"),
        (changed("edits", 0, "delta", "vertices", to=10**7), "tensor"),
        (changed("edits", 0, "delta", "ghosts", to=0), "tensor"),
        (changed("edits", 0, "report", "patches", to=-1), "edits.0.*patches"),
        (changed("edits", to=[]), "unknown tensor|edits"),
        (without("edits", 0), "tensor|edits"),
        (without("mesh"), "manifest field mesh"),
        (lambda manifest: [manifest], "does not say"),
        (lambda manifest: None, "does not say"),
    ],
)
def test_manifests_that_lie(tmp_path, original, change, message):
    refused(tmp_path, manifest_with(original, tmp_path, change), message)


def test_unknown_keys_and_members_are_told_and_ignored(tmp_path, original):
    def more(manifest):
        manifest["future"] = manifest["dense"]["colour"] = manifest["samples"][0]["x"] = 1
        manifest["parameters"]["knob"] = 3
        return manifest

    data = with_extra(manifest_with(original, tmp_path, more), "notes/readme.txt", b"hello")
    path = tmp_path / "new.patina"
    path.write_bytes(data)
    notes = " ".join(read_project(path).notes)
    for word in ("future", "dense.colour", "samples[0].x", "parameters.knob", "readme.txt"):
        assert word in notes


@pytest.mark.parametrize("name", ["mesh", "dense", "quilt", "edits", "samples/0001"])
def test_a_missing_member_is_named(tmp_path, original, name):
    parts = members(original)
    del parts[f"{name}.safetensors"]
    refused(tmp_path, packed(parts.items()), f"member '{name}.safetensors' is missing")


def test_other_missing_members_are_named(tmp_path, original):
    for name, message in (("manifest.json", "no manifest.json"), ("edits.json", "is missing")):
        parts = members(original)
        del parts[name]
        refused(tmp_path, packed(parts.items()), message)


def tensors(body):
    (length,) = struct.unpack("<Q", body[:8])
    return json.loads(body[8 : 8 + length]), 8 + length


def poked(data, member, tensor, kind, place, value):
    """The project with one number of a tensor changed, checksums fitting."""
    parts = members(data)
    body = bytearray(parts[member])
    table, start = tensors(body)
    size = np.dtype(kind).itemsize
    at = start + table[tensor]["data_offsets"][0] + place * size
    body[at : at + size] = np.array(value, kind).tobytes()
    parts[member] = bytes(body)
    return packed(parts.items())


NAN = float("nan")


@pytest.mark.parametrize(
    ("member", "tensor", "kind", "place", "value", "message"),
    [
        ("mesh", "faces", "<i4", 3, 8, "faces of the mesh 0 … 8, outside 0 … 7"),
        ("mesh", "faces", "<i4", 3, -1, "faces of the mesh -1"),
        ("mesh", "vertices", "<f8", 0, NAN, "1 values of 'vertices' are not finite"),
        ("mesh", "uv", "<f8", 0, np.inf, "1 values of 'uv' are not finite"),
        ("mesh", "region", "<i4", 0, 2, "regions 0 … 2"),
        ("mesh", "chart", "<i4", 0, 99, "charts of the mesh"),
        ("dense", "faces", "<i4", 0, 216, "faces of the dense mesh 0 … 216"),
        ("dense", "faces", "<i4", 0, 2**31 - 1, "faces of the dense mesh"),
        ("dense", "texel", "<i4", 0, -5, "texels -5"),
        ("dense", "texel", "<i4", 3, 2, "texels belong to two vertices"),
        ("dense", "face", "<i4", 0, 12, "input faces of the dense mesh 0 … 12"),
        ("dense", "normals", "<f4", 0, 9.0, "normals of length 9"),
        ("dense", "tangents", "<f4", 0, NAN, "not finite"),
        ("quilt", "sample", "<u2", 0, 2, "samples 0 … 2, outside 0 … 1"),
        ("quilt", "patch", "<i4", 0, -2, "patches -2"),
        ("quilt", "source", "<f4", 0, NAN, "not finite"),
        ("quilt", "ghost_slots", "<i4", 0, 10**6, "half-edges"),
        ("edits", "vertices", "<i4", 0, -1, "edit 0: vertices"),
        ("edits", "vertices", "<i4", 39, 216, "edit 0: vertices"),
        ("edits", "vertices", "<i4", 1, 215, "edit 0: vertices .* do not ascend"),
        ("edits", "reads", "<i4", 0, 300, "edit 0: reads"),
        ("edits", "sample", "<u2", 0, 9, "samples"),
        ("edits", "patch", "<i4", 0, -9, "patches of edits"),
        ("edits", "ghosts", "<f4", 0, NAN, "not finite"),
        ("edits", "ghost_slots", "<i4", 0, 5000, "edit 0: ghosts"),
        ("edits", "writers", "<i4", 0, -2, "writers"),
    ],
)
def test_numbers_out_of_range(tmp_path, original, member, tensor, kind, place, value, message):
    data = poked(original, f"{member}.safetensors", tensor, kind, place, value)
    refused(tmp_path, data, message)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"[" * 200_000, "no JSON"),
        (b'{"format":' * 50_000, "no JSON"),
        (b'{"format": "patina-project", "version": 1' + b', "a": [' * 30_000, "no JSON"),
        (b"\xff\xfe", "no JSON"),
        (b"", "no JSON"),
        (b"9" * 10_000, "no JSON|does not say"),
    ],
)
def test_json_that_is_deep_or_none(tmp_path, original, text, message):
    parts = members(original) | {"manifest.json": text}
    refused(tmp_path, packed(parts.items()), message)
    parts = members(original) | {"edits.json": text}
    refused(tmp_path, packed(parts.items()), "edits.json: ")


@pytest.mark.skipif(not hasattr(os, "pwrite"), reason="needs sparse files")
@pytest.mark.parametrize("name", ["manifest.json", "edits.json", "mesh.safetensors"])
def test_a_gigabyte_where_little_is_expected(tmp_path, original, name):
    """A member of 1 GB, sparse on the disk, is refused before it is read."""
    size = 1 << 30
    path = tmp_path / "bad.patina"
    parts = [(key, body) for key, body in members(original).items() if key != name]
    head = packed(parts)
    end = head.rfind(b"PK\5\6")
    directory = head.find(b"PK\1\2")
    local = struct.pack("<4s5H3I2H", b"PK\3\4", 20, 0, 0, 0, 0, 0, size, size, len(name), 0)
    local += name.encode()
    entry = struct.pack(
        "<4s6H3I5H2I", b"PK\1\2", 20, 20, 0, 0, 0, 0, 0, size, size, len(name), 0, 0, 0, 0, 0,
        directory,
    ) + name.encode()  # fmt: skip
    start = directory + len(local) + size
    count = len(parts) + 1
    length = end - directory + len(entry)
    tail = head[directory:end] + entry
    tail += struct.pack("<4s4H2IH", b"PK\5\6", 0, 0, count, count, length, start, 0)
    with path.open("wb") as stream:
        stream.write(head[:directory] + local)
        stream.seek(start)
        stream.write(tail)
    tracemalloc.start()
    try:
        with pytest.raises(InvalidProject, match=name.replace(".", r"\.")):
            read_project(path)
        assert tracemalloc.get_traced_memory()[1] < 300 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("data", [b"", b"PK", b"v 0 0 0\n", b"PK\5\6" + bytes(18)])
def test_what_is_no_project_at_all(tmp_path, data):
    refused(tmp_path, data, "no zip|no manifest")


def test_what_is_no_file(tmp_path):
    with pytest.raises(InvalidProject, match="no such file"):
        read_project(tmp_path / "nowhere.patina")
    with pytest.raises(InvalidProject, match="no such file"):
        read_project(tmp_path)
    with pytest.raises(InvalidProject, match="no such file|null"):
        read_project("nul\0.patina")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "bad.patina")
    with pytest.raises(InvalidProject, match="no such file"):
        read_project(tmp_path / "bad.patina")


def same(path, one):
    """Whether a file reads as the project `one`; False where it is refused by name."""
    try:
        found = read_project(path)
    except InvalidProject as error:
        assert path.name in str(error)
        return False
    assert differences(one, found) == []
    return True


def test_cut_off_anywhere_it_is_refused(tmp_path, original):
    path = tmp_path / "cut.patina"
    for length in {*range(0, len(original), 997), *range(len(original) - 700, len(original), 7)}:
        path.write_bytes(original[:length])
        with pytest.raises(InvalidProject, match="cut.patina"):
            read_project(path)


def test_a_byte_changed_anywhere_is_refused_or_changes_nothing(tmp_path, original):
    path = tmp_path / "flip.patina"
    path.write_bytes(original)
    one = read_project(path)
    places = np.random.default_rng(0).permutation(len(original))[:250]
    ends = np.arange(len(original) - 1200, len(original), 3)  # the zip's directory
    refusals = 0
    for place in (*places, *range(0, 120, 3), *ends):
        body = bytearray(original)
        body[place] ^= 1 << (int(place) % 8)
        path.write_bytes(bytes(body))
        refusals += not same(path, one)
    assert refusals > 400


def test_random_damage_is_refused_or_changes_nothing(tmp_path, original):
    path = tmp_path / "fuzz.patina"
    path.write_bytes(original)
    one = read_project(path)
    refusals = 0
    for body in mutants(original, 150, seed=1):
        path.write_bytes(bytes(body))
        refusals += not same(path, one)
    assert refusals > 100


def test_random_damage_with_fitting_checksums_reads_or_is_refused(tmp_path, original):
    """What a hostile writer can do: any bytes of any member, the checksums made to fit."""
    path = tmp_path / "forged.patina"
    whole, random = members(original), np.random.default_rng(2)
    names = sorted(whole)
    for _ in range(150):
        name = names[int(random.integers(len(names)))]
        body = bytearray(whole[name])
        for _ in range(int(random.integers(1, 4))):
            body[int(random.integers(len(body)))] = int(random.integers(256))
        path.write_bytes(packed((whole | {name: bytes(body)}).items()))
        try:
            found = read_project(path)
        except InvalidProject as error:
            assert "forged.patina" in str(error)
        else:
            assert np.isfinite(found.background.source).all()
