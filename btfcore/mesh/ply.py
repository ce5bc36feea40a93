"""Reads PLY files: ASCII and binary, polygons of mixed size, triangle strips.

trimesh refuses binary files whose polygons differ in size, which modelling programs write.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.errors import InvalidMesh

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_POLYGON_LISTS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class _Property:
    name: str
    kind: np.dtype[Any]
    counter: np.dtype[Any] | None  # type of a list's length; None for a plain value


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: tuple[_Property, ...]


def read_ply(data: bytes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (V, 3) f8 and triangles (F, 3) i8 of a PLY file given as bytes.

    Polygons become fans, strips (-1 restarts one) become triangles. Indices are not checked
    against V. Raises `InvalidMesh` where the header is broken or the data ends early.
    """
    encoding, elements, start = _header(data)
    if encoding == "ascii":
        text = data[start:].decode("ascii", "replace")
        # numbers are doubles in text; a list's length is one of them
        source = np.fromstring(text, sep=" ", dtype=np.float64).tobytes()
        elements = [_as_doubles(element) for element in elements]
    else:
        source = data[start:]
    vertices = np.empty((0, 3))
    faces = [np.empty((0, 3), np.int64)]
    at = 0
    for element in elements:
        columns, at = _read_element(source, at, element)
        if element.name == "vertex":
            vertices = _positions(element, columns)
        for name in _POLYGON_LISTS:
            if element.name == "face" and name in columns:
                faces.append(_fans(*columns[name]))
            if element.name == "tristrips" and name in columns:
                faces.append(_strips(*columns[name]))
    return vertices, np.concatenate(faces)


def _header(data: bytes) -> tuple[str, list[_Element], int]:
    end = data.find(b"end_header", 0, 1 << 20)
    if not data.startswith(b"ply") or end < 0:
        raise InvalidMesh("the PLY header has no beginning or no end")
    newline = data.find(b"\n", end)
    start = newline + 1 if newline >= 0 else len(data)
    encoding, elements = "", []
    for line in data[:end].decode("ascii", "replace").splitlines()[1:]:
        words = line.split()
        try:
            match words:
                case ["format", name, *_]:
                    _ORDERS[name]  # an unknown format is a KeyError like any other word
                    encoding = name
                case ["element", name, count]:
                    elements.append(_Element(name, int(count), ()))
                case ["property", "list", counter, kind, name]:
                    one = _Property(name, _kind(kind, encoding), _kind(counter, encoding))
                    elements[-1] = _with(elements[-1], one)
                case ["property", kind, name]:
                    elements[-1] = _with(elements[-1], _Property(name, _kind(kind, encoding), None))
                case ["comment" | "obj_info", *_] | []:
                    pass
                case _:
                    raise ValueError(line)
        except (ValueError, KeyError, IndexError) as error:
            raise InvalidMesh(f"PLY header line {line[:80]!r} makes no sense") from error
    if not encoding:
        raise InvalidMesh("the PLY header names no format")
    return encoding, elements, start


def _kind(name: str, encoding: str) -> np.dtype[Any]:
    return np.dtype(_ORDERS[encoding] + _TYPES[name])


def _with(element: _Element, one: _Property) -> _Element:
    return _Element(element.name, element.count, (*element.properties, one))


def _as_doubles(element: _Element) -> _Element:
    double = np.dtype("f8")
    changed = (
        _Property(p.name, double, None if p.counter is None else double) for p in element.properties
    )
    return _Element(element.name, element.count, tuple(changed))


def _read_element(source: bytes, at: int, element: _Element) -> tuple[dict[str, Any], int]:
    """Columns of one element, and where the next begins.

    A plain property gives its values, a list (lengths (count,) i8, all values in one row).
    """
    smallest = sum((p.counter or p.kind).itemsize for p in element.properties)
    if element.count < 0 or element.count * smallest > len(source) - at:
        raise InvalidMesh(
            f"PLY data ends early: {element.count} rows of {element.name!r} do not fit"
            f" in {len(source) - at} bytes"
        )
    if element.count == 0 or not element.properties:
        return {}, at
    uniform = _read_uniform(source, at, element)
    return uniform if uniform is not None else _read_ragged(source, at, element)


def _read_uniform(source: bytes, at: int, element: _Element) -> tuple[dict[str, Any], int] | None:
    """Read rows of equal length at once; None where some list's lengths differ."""
    fields: list[Any] = []
    place = at
    for number, one in enumerate(element.properties):
        if one.counter is None:
            fields.append((f"v{number}", one.kind))
        else:
            length = _length(source, place, one)
            place += one.counter.itemsize
            fields += [(f"n{number}", one.counter), (f"v{number}", one.kind, (length,))]
        place = at + np.dtype(fields).itemsize
        if place > len(source):
            return None
    row = np.dtype(fields)
    if at + element.count * row.itemsize > len(source):
        return None
    table = np.frombuffer(source, row, element.count, at)
    columns: dict[str, Any] = {}
    for number, one in enumerate(element.properties):
        values = table[f"v{number}"]
        if one.counter is None:
            columns[one.name] = values
            continue
        lengths = table[f"n{number}"].astype(np.int64)
        if (lengths != lengths[0]).any():
            return None
        columns[one.name] = lengths, values.reshape(-1)
    return columns, at + element.count * row.itemsize


def _read_ragged(source: bytes, at: int, element: _Element) -> tuple[dict[str, Any], int]:
    """Walk the rows one by one, then gather each column."""
    starts = np.empty((len(element.properties), element.count), np.int64)
    lengths = np.ones_like(starts)
    for row in range(element.count):
        for number, one in enumerate(element.properties):
            if one.counter is not None:
                lengths[number, row] = _length(source, at, one)
                at += one.counter.itemsize
            starts[number, row] = at
            at += int(lengths[number, row]) * one.kind.itemsize
    if at > len(source):
        raise InvalidMesh(f"PLY data ends early, within {element.name!r}")
    raw = np.frombuffer(source, np.uint8)
    columns: dict[str, Any] = {}
    for number, one in enumerate(element.properties):
        size = lengths[number] * one.kind.itemsize
        first = np.cumsum(size) - size
        byte = np.arange(int(size.sum())) + np.repeat(starts[number] - first, size)
        values = raw[byte].view(one.kind)
        columns[one.name] = values if one.counter is None else (lengths[number], values)
    return columns, at


def _length(source: bytes, at: int, one: _Property) -> int:
    assert one.counter is not None
    if at + one.counter.itemsize > len(source):
        raise InvalidMesh(f"PLY data ends early, within the list {one.name!r}")
    length = float(np.frombuffer(source, one.counter, 1, at)[0])
    if not (length.is_integer() and 0 <= length <= len(source)):
        raise InvalidMesh(f"PLY list {one.name!r} claims {length:g} entries")
    return int(length)


def _positions(element: _Element, columns: dict[str, Any]) -> NDArray[np.float64]:
    if element.count == 0:
        return np.empty((0, 3))
    missing = [axis for axis in "xyz" if axis not in columns]
    if missing:
        raise InvalidMesh(f"PLY vertices have no {', '.join(missing)}")
    return np.stack([columns[axis].astype(np.float64) for axis in "xyz"], axis=1)


def _fans(lengths: NDArray[Any], values: NDArray[Any]) -> NDArray[np.int64]:
    """Triangles of polygons: corner 0 with every later side."""
    first = np.cumsum(lengths) - lengths
    sides = np.maximum(lengths - 2, 0)
    apex = np.repeat(first, sides)
    step = np.arange(len(apex)) - np.repeat(np.cumsum(sides) - sides, sides) + 1
    corners = np.stack([apex, apex + step, apex + step + 1], axis=1)
    return np.asarray(values[corners], np.int64)


def _strips(lengths: NDArray[Any], values: NDArray[Any]) -> NDArray[np.int64]:
    """Triangles of strips, every second one reversed so that all are wound alike."""
    triangles = []
    for strip in np.split(values.astype(np.int64), np.cumsum(lengths)[:-1]):
        for run in np.split(strip, np.flatnonzero(strip < 0)):
            run = run[run >= 0]
            if len(run) >= 3:
                three = np.stack([run[:-2], run[1:-1], run[2:]], axis=1)
                three[1::2] = three[1::2, ::-1]
                triangles.append(three)
    return np.concatenate(triangles) if triangles else np.empty((0, 3), np.int64)
