"""The quilting map as an NPZ file: plain arrays that numpy alone can read."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from btfcore.errors import InvalidQuilt
from btfcore.files.atomic import atomic_output
from btfcore.types import F4, F8, I4, U2, DenseMesh, Field, Frozen, Quilt

_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest date a zip member can have
# name: (dtype, columns or 0 for a plain vector, counted by vertices rather than faces)
_ARRAYS: dict[str, tuple[str, int, bool]] = {
    "vertices": ("<f8", 3, True),
    "normals": ("<f4", 3, True),
    "tangents": ("<f4", 3, True),
    "faces": ("<i4", 3, False),
    "texel": ("<i4", 2, True),
    "source": ("<f4", 2, True),
    "angle": ("<f4", 0, True),
    "sample": ("<u2", 0, True),
    "patch": ("<i4", 0, True),
}


@dataclass(frozen=True, eq=False)
class StoredQuilt(Frozen):
    """What the NPZ holds, as `DenseMesh`, `Field` and `Quilt` define it.

    vertices (N, 3) f8; normals, tangents (N, 3) f4; faces (G, 3) i4; texel (N, 2) i4 (row,
    column); source (N, 2) f4 (column, row); angle (N,) f4; sample (N,) u2; patch (N,) i4.
    """

    vertices: F8
    normals: F4
    tangents: F4
    faces: I4
    texel: I4
    source: F4
    angle: F4
    sample: U2
    patch: I4


def write_quilt_npz(path: str | Path, dense: DenseMesh, field: Field, quilt: Quilt) -> None:
    """Write a quilt with the dense mesh and field that it lies on.

    The same values give the same bytes: members are stored uncompressed, in a fixed order and
    with a fixed date. Raises `OutputFailed` as `atomic_output` does.
    """
    owner: dict[str, object] = {"tangents": field}
    owner |= dict.fromkeys(("vertices", "normals", "faces", "texel"), dense)
    owner |= dict.fromkeys(("source", "angle", "sample", "patch"), quilt)
    with atomic_output(path) as handle, zipfile.ZipFile(handle, "w") as archive:
        for name, (dtype, _, _) in _ARRAYS.items():
            member = zipfile.ZipInfo(f"{name}.npy", date_time=_EPOCH)
            member.create_system = 3  # the same bytes from Windows too
            values = np.ascontiguousarray(getattr(owner[name], name), dtype)
            with archive.open(member, "w", force_zip64=True) as stream:
                npy.write_array(stream, values, version=(1, 0), allow_pickle=False)


def read_quilt_npz(path: str | Path) -> StoredQuilt:
    """Read what `write_quilt_npz` wrote; nothing in the file is trusted.

    Raises `InvalidQuilt`, naming the array and the number, for a file that is missing, no zip
    or has other members; for wrong types, shapes or counts; for values that are not finite,
    frames that are not unit, indices out of range and texels named twice.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            _check_members(archive, path)
            arrays = {name: _read_member(archive, name, path) for name in _ARRAYS}
    except (OSError, zipfile.BadZipFile, ValueError, RuntimeError, EOFError) as error:
        raise InvalidQuilt(f"cannot read {path}: {error}") from error
    check_quilt(arrays, path)
    return StoredQuilt(**arrays)


def _check_members(archive: zipfile.ZipFile, path: str | Path) -> None:
    names = sorted(member.filename for member in archive.infolist())
    wanted = sorted(f"{name}.npy" for name in _ARRAYS)
    if names != wanted:
        missing = sorted(set(wanted) - set(names))
        raise InvalidQuilt(
            f"{path} holds {len(names)} members, not the {len(wanted)} of a quilt"
            + (f"; {', '.join(missing)} missing" if missing else "")
        )
    for member in archive.infolist():
        if member.compress_type != zipfile.ZIP_STORED:  # a compressed one may be a bomb
            raise InvalidQuilt(f"{path}: {member.filename} is compressed; quilts are stored plain")


def _read_member(archive: zipfile.ZipFile, name: str, path: str | Path) -> NDArray[Any]:
    dtype, columns, _ = _ARRAYS[name]
    member = archive.getinfo(f"{name}.npy")
    with archive.open(member) as stream:
        shape, fortran, found = _header(stream)
        if found != np.dtype(dtype) or fortran:
            raise InvalidQuilt(f"{path}: {name} is {found}, not {np.dtype(dtype)} by rows")
        if len(shape) != 1 + bool(columns) or (columns and shape[1] != columns):
            raise InvalidQuilt(f"{path}: {name} has shape {shape}")
        size = int(np.prod([int(side) for side in shape], dtype=object)) * found.itemsize
        held = member.file_size - stream.tell()
        if size != held:  # checked before anything of that size is allocated
            raise InvalidQuilt(f"{path}: {name} of shape {shape} needs {size} bytes, not {held}")
        data = stream.read()
    return np.frombuffer(data, found).reshape(shape)


def _header(stream: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, Fortran order and dtype of an NPY stream; only format 1.0 is written by us."""
    if npy.read_magic(stream) != (1, 0):
        raise ValueError("not NPY format 1.0")
    return npy.read_array_header_1_0(stream)


def check_quilt(arrays: dict[str, NDArray[Any]], path: str | Path) -> None:
    """Raise `InvalidQuilt` where arrays of the right types and columns contradict each other."""
    count = len(arrays["vertices"])
    if count == 0 or len(arrays["faces"]) == 0:
        raise InvalidQuilt(f"{path}: {count} vertices and {len(arrays['faces'])} faces")
    for name, (dtype, _, per_vertex) in _ARRAYS.items():
        values = arrays[name]
        if per_vertex and len(values) != count:
            raise InvalidQuilt(f"{path}: {len(values)} rows of {name} for {count} vertices")
        if dtype[1] == "f" and not np.isfinite(values).all():
            wrong = int((~np.isfinite(values)).sum())
            raise InvalidQuilt(f"{path}: {wrong} values of {name} are not finite")
    for name in ("normals", "tangents"):
        length = np.linalg.norm(arrays[name].astype(np.float64), axis=1)
        worst = float(length[np.abs(length - 1).argmax()])
        if abs(worst - 1) > 1e-3:
            raise InvalidQuilt(f"{path}: {name} of length {worst:g}, not 1")
    faces, texel = arrays["faces"], arrays["texel"]
    if faces.min() < 0 or faces.max() >= count:
        raise InvalidQuilt(f"{path}: faces name {faces.min()}..{faces.max()} of {count} vertices")
    if texel.min() < 0:
        raise InvalidQuilt(f"{path}: texel {int(texel.min())} is negative")
    order = texel[np.lexsort(texel.T)]
    twice = int((order[1:] == order[:-1]).all(axis=1).sum())
    if twice:
        raise InvalidQuilt(f"{path}: {twice} texels belong to two vertices")
    if arrays["patch"].min() < -1:
        raise InvalidQuilt(f"{path}: patch {int(arrays['patch'].min())} is below -1")
