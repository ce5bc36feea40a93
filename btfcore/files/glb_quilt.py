"""The quilting map inside a decorated GLB, so that the file alone can be lit anew with samples.

It lies in a buffer view of its own, described under ``asset.extras.patina.quilt``; viewers pass
over it. Each array is packed by itself: differences from row to row where whole numbers grow
along the rows, bytes sorted by significance, zlib.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.errors import InvalidQuilt
from btfcore.files.gltf import Attached, place
from btfcore.files.quilt_npz import StoredQuilt, check_quilt
from btfcore.types import F8, I4, DenseMesh, Field, Quilt

KEY = "quilt"
_FORMAT, _VERSION = "patina-quilt", 1
_LARGEST_SIDE = 8192  # of an atlas
_MOST_FACES = 4  # a vertex; a closed dense mesh has two
_DENSEST = 1040  # bytes that zlib can make of one

# name: (dtype, columns or 0 for a plain vector, counted by vertices, differences are stored)
_ARRAYS: dict[str, tuple[str, int, bool, bool]] = {
    "vertices": ("<f4", 3, True, False),
    "normals": ("<f4", 3, True, False),
    "tangents": ("<f4", 3, True, False),
    "faces": ("<i4", 3, False, True),
    "texel": ("<i4", 2, True, True),
    "chart": ("<i4", 0, True, True),
    "source": ("<f4", 2, True, False),
    "angle": ("<f4", 0, True, False),
    "sample": ("<u2", 0, True, False),
    "patch": ("<i4", 0, True, True),
}


@dataclass(frozen=True, eq=False)
class AttachedQuilt:
    """What was read: a quilt, the chart (N,) i4 of each vertex, and the atlas's side in texels."""

    quilt: StoredQuilt
    chart: I4
    size: int


def attach_quilt(dense: DenseMesh, field: Field, quilt: Quilt, positions: F8) -> Attached:
    """Pack a quilt with the dense mesh and field that it lies on, for `write_glb`.

    positions (n, 3): of the surface that is written; dense vertices are stored in single floats
    in the coordinates that the file has them in.
    """
    owner: dict[str, object] = {"tangents": field}
    owner |= dict.fromkeys(("normals", "faces", "texel", "chart"), dense)
    owner |= dict.fromkeys(("source", "angle", "sample", "patch"), quilt)
    put = place(positions)
    local = (dense.vertices - np.array(put.origin)) / put.scale
    parts, lengths = [], {}
    for name, (dtype, _, _, differences) in _ARRAYS.items():
        values = local if name == "vertices" else getattr(owner[name], name)
        data = _packed(np.ascontiguousarray(values, dtype), differences)
        parts.append(data)
        lengths[name] = len(data)
    description = {
        "format": _FORMAT, "version": _VERSION, "size": dense.size,
        "vertices": len(dense.vertices), "faces": len(dense.faces), "bytes": lengths,
    }  # fmt: skip
    return Attached(description, b"".join(parts))


def attached_quilt(
    description: Any, data: bytes, origin: F8, scale: float, where: str
) -> AttachedQuilt:
    """Unpack what `attach_quilt` packed; nothing is trusted.

    origin (3,), scale: world = origin + scale · stored. where : names the file in errors. Raises
    `InvalidQuilt`, before anything is allocated for sizes that cannot be, and as
    `btfcore.files.quilt_npz.read_quilt_npz` does for values.
    """
    count, faces, size, lengths = _described(description, len(data), where)
    arrays: dict[str, NDArray[Any]] = {}
    begin = 0
    for name, (dtype, columns, per_vertex, differences) in _ARRAYS.items():
        part = data[begin : begin + lengths[name]]
        begin += lengths[name]
        rows = count if per_vertex else faces
        shape = (rows, columns) if columns else (rows,)
        arrays[name] = _unpacked(part, np.dtype(dtype), shape, differences, name, where)
    chart = arrays.pop("chart")
    with np.errstate(over="ignore", invalid="ignore"):
        arrays["vertices"] = origin + scale * arrays["vertices"].astype(np.float64)
    check_quilt(arrays, where)
    if arrays["texel"].max() >= size:
        raise InvalidQuilt(f"{where}: texel {int(arrays['texel'].max())} of an atlas of {size}")
    return AttachedQuilt(StoredQuilt(**arrays), chart, size)


# --- inside


def _described(description: Any, length: int, where: str) -> tuple[int, int, int, dict[str, int]]:
    if not isinstance(description, dict) or description.get("format") != _FORMAT:
        raise InvalidQuilt(f"{where}: its quilt is not described as {_FORMAT}")
    if description.get("version") != _VERSION:
        raise InvalidQuilt(
            f"{where}: its quilt is of version {description.get('version')!r}, this program"
            f" reads {_VERSION}"
        )
    size = _whole(description.get("size"), 1, _LARGEST_SIDE, "side", where)
    count = _whole(description.get("vertices"), 1, size * size, "number of vertices", where)
    faces = _whole(description.get("faces"), 1, _MOST_FACES * count, "number of faces", where)
    told = description.get("bytes")
    if not isinstance(told, dict) or sorted(told) != sorted(_ARRAYS):
        raise InvalidQuilt(f"{where}: its quilt does not have the {len(_ARRAYS)} arrays of one")
    lengths = {name: _whole(told[name], 1, length, f"length of {name}", where) for name in told}
    if sum(lengths.values()) != length:
        raise InvalidQuilt(
            f"{where}: its quilt has {length} bytes, the arrays {sum(lengths.values())}"
        )
    return count, faces, size, lengths


def _whole(value: Any, low: int, high: int, what: str, where: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        shown = repr(value)[:40]
        raise InvalidQuilt(f"{where}: its quilt has the {what} {shown}, {low} to {high} can be")
    return value


def _packed(values: NDArray[Any], differences: bool) -> bytes:
    if differences:  # wraps around, and back again on reading
        values = np.concatenate([values[:1], np.diff(values, axis=0)])
    raw = np.frombuffer(values.tobytes(), np.uint8).reshape(-1, values.dtype.itemsize)
    return zlib.compress(np.ascontiguousarray(raw.T).tobytes(), 6)


def _unpacked(
    data: bytes, dtype: np.dtype[Any], shape: tuple[int, ...], differences: bool, name: str,
    where: str,
) -> NDArray[Any]:  # fmt: skip
    wanted = int(np.prod(shape, dtype=np.int64)) * dtype.itemsize
    if wanted > _DENSEST * len(data) + 64:
        raise InvalidQuilt(f"{where}: {len(data)} bytes cannot be the {wanted} of {name}")
    stream = zlib.decompressobj()
    try:
        raw = stream.decompress(data, wanted + 1)
    except zlib.error as error:
        raise InvalidQuilt(f"{where}: {name} cannot be unpacked: {error}") from error
    if len(raw) != wanted or not stream.eof or stream.unused_data:
        raise InvalidQuilt(f"{where}: {name} unpacks to {len(raw)} bytes or more, not {wanted}")
    turned = np.frombuffer(raw, np.uint8).reshape(dtype.itemsize, -1).T
    values = np.ascontiguousarray(turned).view(dtype).reshape(shape)
    if differences:
        return np.cumsum(values, axis=0, dtype=dtype)
    return values
