"""Decorated GLBs read back for rendering: the surface as we wrote it, and the quilt on it."""

from __future__ import annotations

import json
import os
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.errors import InvalidMesh, InvalidQuilt
from btfcore.files.glb_quilt import KEY, AttachedQuilt, attached_quilt
from btfcore.files.quilt_npz import StoredQuilt, read_quilt_npz
from btfcore.files.surface import ExportSurface
from btfcore.types import F8, I4, DenseMesh, Field, Quilt

_LARGEST_TEXT = 1 << 24  # bytes of the JSON chunk; ours has a few thousand
_LARGEST_FILE = 1 << 32
_PNG = b"\x89PNG\r\n\x1a\n"
_TYPES = {5126: "<f4", 5125: "<u4", 5123: "<u2"}
_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_ELSEWHERE = 4.0  # dense steps between surface and quilt from which they are of other meshes


@dataclass(frozen=True, eq=False)
class DecoratedGlb:
    """A decorated surface with its quilt.

    dense : as stored; `face` is -1 and `bary` 0, which no file holds, and all faces count as
    zippered.
    """

    surface: ExportSurface
    dense: DenseMesh
    field: Field
    quilt: Quilt


def read_decorated_glb(path: str | Path, quilt: str | Path | None = None) -> DecoratedGlb:
    """Read a GLB that `write_glb` wrote, with the quilt attached to it or that of an NPZ file.

    Nothing in the files is trusted. Raises `InvalidMesh` for what is no such GLB, `InvalidQuilt`
    where there is no quilt, it is damaged, or it lies on another mesh.
    """
    given = Path(path)
    document, binary = _chunks(given)
    surface, origin, scale = _surface(document, binary, given.name)
    if quilt is not None:
        stored = read_quilt_npz(quilt)
        size = _atlas_side(document, binary, given.name)
        highest = int(stored.texel.max())
        if highest >= size:
            raise InvalidQuilt(f"{quilt}: texel {highest}, the atlas of {given.name} has {size}")
        found = AttachedQuilt(stored, _charts(stored), size)
    else:
        found = _attached(document, binary, origin, scale, given.name)
    dense = _dense(found)
    _check_together(surface, dense, given.name)
    kept = found.quilt
    field = Field(kept.tangents, np.zeros((0, 3)))
    return DecoratedGlb(
        surface, dense, field, Quilt(kept.source, kept.angle, kept.sample, kept.patch)
    )


# --- inside


def _chunks(path: Path) -> tuple[dict[str, Any], bytes]:
    """JSON and binary chunk; raises `InvalidMesh`."""
    try:
        size = os.stat(path).st_size
        if size > _LARGEST_FILE:
            raise InvalidMesh(f"{path.name} has {size:,} bytes, a GLB at most {_LARGEST_FILE:,}")
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        raise InvalidMesh(f"cannot read {path.name}: {error}") from error
    if len(data) < 28 or data[:4] != b"glTF":
        raise InvalidMesh(f"{path.name} is no GLB file")
    version, total, length, kind = struct.unpack_from("<III4s", data, 4)
    if version != 2 or total != len(data) or kind != b"JSON":
        raise InvalidMesh(f"{path.name}: a GLB of version {version} and {total} bytes is damaged")
    if length > min(_LARGEST_TEXT, len(data) - 28) or length % 4:
        raise InvalidMesh(f"{path.name}: {length} bytes of JSON in a file of {len(data)}")
    try:
        document = json.loads(data[20 : 20 + length])
    except (ValueError, RecursionError) as error:
        raise InvalidMesh(f"{path.name}: its JSON cannot be read: {error}") from error
    held, kind = struct.unpack_from("<I4s", data, 20 + length)
    begin = 28 + length
    if kind != b"BIN\0" or begin + held > len(data) or not isinstance(document, dict):
        raise InvalidMesh(f"{path.name}: {held} bytes of data in a file of {len(data)}")
    return document, data[begin : begin + held]


def _item(document: Any, path: str, name: str) -> Any:
    """Value under keys and numbers like "meshes/0/primitives"; raises `InvalidMesh`."""
    value = document
    for key in path.split("/"):
        try:
            value = value[int(key) if isinstance(value, list) else key]
        except (KeyError, IndexError, TypeError, ValueError):
            raise InvalidMesh(f"{name}: no {path} in it; it is no mesh decorated by us") from None
    return value


def _lone(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 1


def _number(value: Any, what: str, name: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 1 << 32:
        raise InvalidMesh(f"{name}: {what} is {value!r:.40}")
    return value


def _view(document: dict[str, Any], binary: bytes, number: Any, name: str) -> bytes:
    view = _item(document, f"bufferViews/{_number(number, 'a buffer view', name)}", name)
    if not isinstance(view, dict) or view.get("buffer") != 0 or "byteStride" in view:
        raise InvalidMesh(f"{name}: buffer view {number} is not as we write them")
    begin = _number(view.get("byteOffset", 0), "an offset", name)
    length = _number(view.get("byteLength"), "a length", name)
    if begin + length > len(binary):
        raise InvalidMesh(f"{name}: bytes up to {begin + length} of {len(binary)} are named")
    return binary[begin : begin + length]


def _array(
    document: dict[str, Any], binary: bytes, number: Any, kinds: tuple[str, ...], columns: int,
    name: str,
) -> NDArray[Any]:  # fmt: skip
    accessor = _item(document, f"accessors/{_number(number, 'an accessor', name)}", name)
    told = accessor if isinstance(accessor, dict) else {}
    kind, shape = told.get("componentType"), told.get("type")
    dtype = _TYPES.get(kind) if isinstance(kind, int) else None
    found = _COLUMNS.get(shape) if isinstance(shape, str) else None
    if dtype not in kinds or found != columns or "sparse" in told or told.get("byteOffset"):
        raise InvalidMesh(f"{name}: accessor {number} is not as we write them")
    count = _number(told.get("count"), "a count", name)
    data = _view(document, binary, told.get("bufferView"), name)
    if count * columns * np.dtype(dtype).itemsize != len(data):
        raise InvalidMesh(f"{name}: accessor {number} counts {count} in {len(data)} bytes")
    return np.frombuffer(data, dtype).reshape((count, columns) if columns > 1 else (count,))


def _surface(document: dict[str, Any], binary: bytes, name: str) -> tuple[ExportSurface, F8, float]:
    """Surface in world coordinates, and the node's translation and scale."""
    primitive = _item(document, "meshes/0/primitives/0", name)
    several = ("meshes", "nodes", "meshes/0/primitives")
    if not all(_lone(_item(document, each, name)) for each in several):
        raise InvalidMesh(f"{name} has several meshes or nodes; one decorated mesh is rendered")

    def read(attribute: str, columns: int) -> NDArray[Any]:
        number = _item(primitive, f"attributes/{attribute}", name)
        return _array(document, binary, number, ("<f4",), columns, name)

    stored, normals = read("POSITION", 3), read("NORMAL", 3)
    tangents, uv = read("TANGENT", 4), read("TEXCOORD_0", 2)
    indices = _array(
        document, binary, _item(primitive, "indices", name), ("<u4", "<u2"), 1, name
    ).astype(np.int64)
    count = len(stored)
    if not len(normals) == len(tangents) == len(uv) == count or len(indices) % 3:
        raise InvalidMesh(f"{name}: its attributes count {count}, {len(normals)}, {len(uv)}")
    if len(indices) == 0 or indices.max() >= count:
        raise InvalidMesh(f"{name}: {len(indices)} corners name vertices of {count}")
    for what, values in (("positions", stored), ("normals", normals), ("coordinates", uv)):
        if not np.isfinite(values).all():
            raise InvalidMesh(f"{name}: {int((~np.isfinite(values)).sum())} {what} not finite")
    origin, scale = _moved(_item(document, "nodes/0", name), name)
    faces: I4 = indices.reshape(-1, 3).astype(np.int32)
    material = _item(document, "materials/0", name)
    closed = isinstance(material, dict) and material.get("doubleSided") is False
    surface = ExportSurface(
        origin + scale * stored.astype(np.float64), normals, tangents, uv, faces,
        np.arange(count, dtype=np.int32), closed,
    )  # fmt: skip
    return surface, origin, scale


def _moved(node: Any, name: str) -> tuple[F8, float]:
    """Translation and uniform scale of the node."""
    told = node if isinstance(node, dict) else {}
    if "matrix" in told or "rotation" in told:
        raise InvalidMesh(f"{name}: its node is turned; another program has changed the file")
    try:
        origin = np.array(told.get("translation", [0.0, 0.0, 0.0]), np.float64).reshape(3)
        scale = np.array(told.get("scale", [1.0, 1.0, 1.0]), np.float64).reshape(3)
    except (TypeError, ValueError, OverflowError):
        raise InvalidMesh(f"{name}: its node is moved in a way that cannot be read") from None
    fair = np.isfinite(origin).all() and np.isfinite(scale).all() and scale[0] > 0
    if not fair or not (scale == scale[0]).all():
        raise InvalidMesh(f"{name}: its node is scaled by {scale.tolist()}")
    return origin, float(scale[0])


def _atlas_side(document: dict[str, Any], binary: bytes, name: str) -> int:
    """Side of the square PNG that is the texture, from its header."""
    data = _view(document, binary, _item(document, "images/0/bufferView", name), name)
    if data[:8] != _PNG or len(data) < 24:
        raise InvalidMesh(f"{name}: its texture is no PNG")
    width, height = struct.unpack(">II", data[16:24])
    if width != height or not 1 <= width <= 8192:
        raise InvalidMesh(f"{name}: its texture has {width} x {height} pixels, no atlas of ours")
    return int(width)


def _attached(
    document: dict[str, Any], binary: bytes, origin: F8, scale: float, name: str
) -> AttachedQuilt:
    extras = document.get("asset", {})
    for key in ("extras", "patina", KEY):
        extras = extras.get(key) if isinstance(extras, dict) else None
    if not isinstance(extras, dict):
        raise InvalidQuilt(
            f"{name} holds no quilting map: write it with --relightable, or name the map (NPZ)"
            " that was saved beside it"
        )
    data = _view(document, binary, extras.get("bufferView"), name)
    return attached_quilt(extras, data, origin, scale, name)


def _charts(stored: StoredQuilt) -> I4:
    """Chart (N,) of every dense vertex: what hangs together by faces inside 2 x 2 texels."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    inside = np.ptp(stored.texel[stored.faces], axis=1).max(axis=1) <= 1
    face = stored.faces[inside]
    rows, columns = face[:, :2].reshape(-1), face[:, 1:].reshape(-1)
    count = len(stored.vertices)
    graph = coo_matrix((np.ones(len(rows), np.int8), (rows, columns)), (count, count))
    return connected_components(graph, directed=False)[1].astype(np.int32)


def _dense(found: AttachedQuilt) -> DenseMesh:
    kept = found.quilt
    count = len(kept.vertices)
    return DenseMesh(
        kept.vertices, kept.normals, kept.faces, kept.texel, found.chart,
        np.full(count, -1, np.int32), np.zeros((count, 3), np.float32), found.size, 0,
    )  # fmt: skip


def _check_together(surface: ExportSurface, dense: DenseMesh, name: str) -> None:
    """Raise `InvalidQuilt` where the texels at the surface's corners lie somewhere else."""
    owner = np.full((dense.size, dense.size), -1, np.int64)
    owner[dense.texel[:, 0], dense.texel[:, 1]] = np.arange(len(dense.texel))
    place = np.rint(surface.uv.astype(np.float64) * dense.size - 0.5)
    column, row = np.clip(place, 0, dense.size - 1).astype(np.int64).T
    hit = np.flatnonzero(owner[row, column] >= 0)
    if len(hit) == 0:
        raise InvalidQuilt(f"{name}: no corner of the mesh lies on a texel of the quilt")
    away = dense.vertices[owner[row[hit], column[hit]]] - surface.positions[hit]
    apart = float(np.median(np.linalg.norm(away, axis=1)))
    if not apart <= _ELSEWHERE * dense.step:
        raise InvalidQuilt(
            f"the quilt is of another mesh than {name}: texels lie {apart:.3g} away from it"
        )
