"""Decorated GLBs hold their quilts: what is written comes back, and nothing in them is trusted."""

import json
import struct
import zlib

import numpy as np
import pytest

from btfcore.errors import InvalidMesh, InvalidParameter, InvalidQuilt
from btfcore.files.export import export
from btfcore.files.glb_quilt import KEY, attach_quilt, attached_quilt
from btfcore.files.glb_read import read_decorated_glb
from btfcore.files.quilt_npz import write_quilt_npz
from btfcore.files.surface import export_input
from btfcore.render.gutter import gutter_source
from btfcore.types import Field, Quilt
from tests.boxes import box

ORIGIN = np.zeros(3)


def decorated(**knobs):
    """A box, a field and a made-up quilt on it."""
    atlas, dense = box(12, **knobs)
    rng = np.random.default_rng(3)
    count = len(dense.vertices)
    across = rng.standard_normal((count, 3))
    normals = dense.normals.astype(np.float64)
    across -= (across * normals).sum(axis=1)[:, None] * normals
    across /= np.linalg.norm(across, axis=1)[:, None]
    field = Field(across.astype(np.float32), np.zeros((0, 3)))
    quilt = Quilt(
        rng.uniform(0, 90, (count, 2)).astype(np.float32),
        rng.uniform(-9, 9, count).astype(np.float32),
        rng.integers(0, 3, count).astype(np.uint16),
        np.sort(rng.integers(-1, 40, count)).astype(np.int32),
    )
    return atlas, dense, field, quilt


def written(path, atlas, dense, field, quilt, *, attach=True, dense_shape=False):
    colours = np.full((len(dense.vertices), 3), 0.5, np.float32)

    def attached(positions):
        return {KEY: attach_quilt(dense, field, quilt, positions)}

    export(path, atlas.mesh, atlas, dense, colours, dense_shape=dense_shape,
           attached=attached if attach else None)  # fmt: skip
    return path


@pytest.fixture
def glb(tmp_path):
    return written(tmp_path / "box.glb", *decorated())


def changed(path, change):
    """Rewrite a GLB after `change(document, binary)`, which may return another binary."""
    data = path.read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    document, binary = json.loads(data[20 : 20 + size]), bytearray(data[28 + size :])
    binary = bytes(change(document, binary) or binary)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(binary), len(text), 0x4E4F534A)
    path.write_bytes(head + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary)
    return path


def described(document):
    return document["asset"]["extras"]["patina"][KEY]


@pytest.mark.parametrize(
    "knobs", [{}, {"centre": (1e7, -2e7, 3e7), "edge": 3.0}, {"edge": 1e-30}, {"edge": 1e30}]
)
def test_quilt_and_surface_come_back(tmp_path, knobs):
    atlas, dense, field, quilt = decorated(**knobs)
    found = read_decorated_glb(written(tmp_path / "a.glb", atlas, dense, field, quilt))
    edge = knobs.get("edge", 1.0)
    for name in ("source", "angle", "sample", "patch"):
        assert np.array_equal(getattr(found.quilt, name), getattr(quilt, name)), name
    for name in ("normals", "faces", "texel", "chart"):
        assert np.array_equal(getattr(found.dense, name), getattr(dense, name)), name
    assert np.array_equal(found.field.tangents, field.tangents)
    assert found.dense.size == dense.size
    extent = np.ptp(dense.vertices, axis=0).max()
    assert np.abs(found.dense.vertices - dense.vertices).max() <= 1e-6 * extent
    surface = export_input(atlas.mesh, atlas)
    assert np.abs(found.surface.positions - surface.positions).max() <= 1e-6 * edge * 10
    assert np.array_equal(found.surface.faces, surface.faces)
    assert np.array_equal(found.surface.uv, surface.uv)
    assert found.surface.closed is surface.closed


def test_an_npz_beside_the_glb_is_as_good(tmp_path):
    atlas, dense, field, quilt = decorated()
    plain = written(tmp_path / "a.glb", atlas, dense, field, quilt, attach=False)
    write_quilt_npz(tmp_path / "q.npz", dense, field, quilt)
    found = read_decorated_glb(plain, tmp_path / "q.npz")
    assert np.array_equal(found.quilt.source, quilt.source)
    assert found.dense.size == dense.size
    # the charts have other numbers, but are the same charts, so the gutter is the same
    assert np.array_equal(gutter_source(found.dense), gutter_source(dense))
    with pytest.raises(InvalidQuilt, match="--relightable"):
        read_decorated_glb(plain)


def test_viewers_still_read_the_file(glb, gltf_issues):
    assert gltf_issues(glb) == []


def test_the_dense_shape_can_be_lit_too(tmp_path):
    path = written(tmp_path / "a.glb", *decorated(), dense_shape=True)
    assert len(read_decorated_glb(path).surface.faces) == len(read_decorated_glb(path).dense.faces)


def test_quilts_of_other_meshes_are_refused(tmp_path):
    atlas, dense, field, quilt = decorated(centre=(5.0, 0, 0))
    write_quilt_npz(tmp_path / "q.npz", dense, field, quilt)
    other = written(tmp_path / "a.glb", *decorated(), attach=False)
    with pytest.raises(InvalidQuilt, match="another mesh"):
        read_decorated_glb(other, tmp_path / "q.npz")


def test_only_glbs_take_a_quilt_along(tmp_path):
    from btfcore.pipeline import export as verb

    with pytest.raises(InvalidParameter, match=r"\.obj"):
        verb(tmp_path / "a.obj", None, None, (), relightable=True)


def set_in(*keys, to):
    def change(document, binary):
        target = document
        for key in keys[:-1]:
            target = target[key]
        target[keys[-1]] = to

    return change


def in_quilt(*keys, to):
    return set_in("asset", "extras", "patina", KEY, *keys, to=to)


@pytest.mark.parametrize(
    ("change", "error"),
    [
        (in_quilt("format", to="other"), InvalidQuilt),
        (in_quilt("version", to=2), InvalidQuilt),
        (in_quilt("size", to=1 << 20), InvalidQuilt),
        (in_quilt("size", to=True), InvalidQuilt),
        (in_quilt("size", to=2), InvalidQuilt),
        (in_quilt("vertices", to=1 << 40), InvalidQuilt),
        (in_quilt("vertices", to=-1), InvalidQuilt),
        (in_quilt("faces", to=10**9), InvalidQuilt),
        (in_quilt("faces", to=1.5), InvalidQuilt),
        (in_quilt("bytes", to={}), InvalidQuilt),
        (in_quilt("bytes", to=[1]), InvalidQuilt),
        (in_quilt("bytes", "angle", to=3), InvalidQuilt),
        (in_quilt("bytes", "angle", to=None), InvalidQuilt),
        (in_quilt("bufferView", to=0), InvalidQuilt),
        (in_quilt("bufferView", to=99), InvalidMesh),
        (in_quilt("bufferView", to="a"), InvalidMesh),
        (in_quilt("bufferView", to=-1), InvalidMesh),
        (set_in("asset", "extras", to=[]), InvalidQuilt),
        (set_in("asset", to=None), InvalidQuilt),
        (set_in("meshes", to=[]), InvalidMesh),
        (set_in("meshes", 0, "primitives", to={}), InvalidMesh),
        (set_in("nodes", to=None), InvalidMesh),
        (set_in("nodes", 0, "rotation", to=[0, 0, 0, 1]), InvalidMesh),
        (set_in("nodes", 0, "scale", to=[1, 2, 1]), InvalidMesh),
        (set_in("nodes", 0, "translation", to=["x", 0, 0]), InvalidMesh),
        (set_in("nodes", 0, "translation", to=[1e400, 0, 0]), InvalidMesh),
        (set_in("accessors", 0, "count", to=1 << 31), InvalidMesh),
        (set_in("accessors", 0, "componentType", to=5123), InvalidMesh),
        (set_in("accessors", 0, "type", to=["VEC3"]), InvalidMesh),
        (set_in("accessors", 0, "sparse", to={}), InvalidMesh),
        (set_in("bufferViews", 0, "byteLength", to=1 << 31), InvalidMesh),
        (set_in("bufferViews", 0, "byteOffset", to=-4), InvalidMesh),
        (set_in("bufferViews", 0, "byteStride", to=16), InvalidMesh),
        (set_in("bufferViews", 0, to=7), InvalidMesh),
        (set_in("meshes", 0, "primitives", 0, "indices", to=0), InvalidMesh),
    ],
)
def test_what_does_not_fit_is_refused_by_name(glb, change, error):
    with pytest.raises(error, match=r"box\.glb"):
        read_decorated_glb(changed(glb, change))


def test_every_cut_of_the_file_is_refused(glb):
    data = glb.read_bytes()
    for length in (*range(0, 40), *range(40, len(data), 997), len(data) - 1):
        glb.write_bytes(data[:length])
        with pytest.raises((InvalidMesh, InvalidQuilt)):
            read_decorated_glb(glb)


def test_turned_bits_raise_only_named_errors(glb):
    data = glb.read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(150):
        broken = bytearray(data)
        broken[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
        glb.write_bytes(broken)
        try:
            read_decorated_glb(glb)
        except (InvalidMesh, InvalidQuilt):
            refused += 1
    assert refused > 30


def test_bombs_are_never_unpacked():
    _, dense, field, quilt = decorated()
    whole = attach_quilt(dense, field, quilt, dense.vertices)
    bomb = zlib.compress(bytes(1 << 24), 9)
    lengths = dict(whole.description["bytes"])
    rest = whole.data[lengths["vertices"] :]
    told = {**whole.description, "bytes": {**lengths, "vertices": len(bomb)}}
    with pytest.raises(InvalidQuilt, match="vertices unpacks to"):
        attached_quilt(told, bomb + rest, ORIGIN, 1.0, "x")
    large = {**whole.description, "size": 8192, "vertices": 8192 * 8192}
    with pytest.raises(InvalidQuilt, match="cannot be the"):
        attached_quilt(large, whole.data, ORIGIN, 1.0, "x")


def test_values_are_checked_like_those_of_an_npz():
    _, dense, field, quilt = decorated()
    angle = quilt.angle.copy()
    angle[5] = np.nan
    bad = Quilt(quilt.source, angle, quilt.sample, quilt.patch)
    whole = attach_quilt(dense, field, bad, dense.vertices)
    with pytest.raises(InvalidQuilt, match="1 values of angle are not finite"):
        attached_quilt(whole.description, whole.data, ORIGIN, 1.0, "x")


def test_the_same_quilt_makes_the_same_bytes():
    _, dense, field, quilt = decorated()
    one, two = (attach_quilt(dense, field, quilt, dense.vertices) for _ in range(2))
    assert one == two
    assert len(one.data) < 60 * len(dense.vertices)
