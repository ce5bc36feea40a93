"""The safetensors layout: a length, a JSON header, and the tensors' bytes one after another."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.errors import InvalidBtf, PatinaError

LARGEST_HEADER = 1 << 20
_KINDS = {
    "F64": "<f8", "F32": "<f4", "F16": "<f2", "I32": "<i4", "U8": "|u1", "U16": "<u2",
}  # fmt: skip
_NAMES = {np.dtype(code): name for name, code in _KINDS.items()}
Shape = tuple[int, ...]


@dataclass(frozen=True)
class Tensor:
    """Where a tensor lies: kind of number, shape, first byte after the header, size in bytes."""

    dtype: np.dtype[Any]
    shape: Shape
    start: int
    size: int


def header(tensors: Mapping[str, tuple[np.dtype[Any], Shape]]) -> bytes:
    """Length and header for tensors that follow in the order given, without gaps."""
    entries, place = {}, 0
    for name, (dtype, shape) in tensors.items():
        size = math.prod(shape) * dtype.itemsize
        entries[name] = {
            "dtype": _NAMES[dtype],
            "shape": list(shape),
            "data_offsets": [place, place + size],
        }
        place += size
    text = json.dumps(entries, separators=(",", ":")).encode()
    text += b" " * (-(8 + len(text)) % 64)  # the tensors begin at a multiple of 64 bytes
    return struct.pack("<Q", len(text)) + text


def parse(
    head: bytes, total: int, where: str, error: type[PatinaError] = InvalidBtf
) -> tuple[dict[str, Tensor], int]:
    """Tensors of a header, and the byte at which their data begins.

    head : the file's first bytes, at least the header; total : the file's size. Raises
    `error`, beginning with `where`, where sizes, kinds or offsets do not fit.
    """
    if total < 8 or len(head) < 8:
        raise error(f"{where}: {total} bytes are too few for a tensor file")
    (length,) = struct.unpack("<Q", head[:8])
    if length > min(LARGEST_HEADER, total - 8):
        raise error(f"{where}: a tensor header of {length:,} bytes in a file of {total:,} bytes")
    try:
        entries = json.loads(head[8 : 8 + length].decode("utf-8"))
        if not isinstance(entries, dict):
            raise ValueError("not an object")
        entries.pop("__metadata__", None)
        found = {name: _tensor(name, entry, total - 8 - length) for name, entry in entries.items()}
    except (ValueError, KeyError, TypeError, RecursionError, UnicodeDecodeError) as why:
        raise error(f"{where}: the tensor header makes no sense: {why}") from None
    place = 0
    for name, tensor in sorted(found.items(), key=lambda item: item[1].start):
        if tensor.start != place:
            raise error(f"{where}: tensor {name!r} begins at {tensor.start}, not at {place}")
        place += tensor.size
    if place != total - 8 - length:
        raise error(f"{where}: the tensors have {place:,} bytes, the file {total - 8 - length:,}")
    return found, 8 + length


def _tensor(name: str, entry: Any, room: int) -> Tensor:
    dtype = np.dtype(_KINDS[entry["dtype"]])
    shape = tuple(entry["shape"])
    start, stop = entry["data_offsets"]
    if not all(type(value) is int and value >= 0 for value in (*shape, start, stop)):
        raise ValueError(f"tensor {name!r} has a size or place that is no whole number")
    if len(shape) > 8 or stop > room or start > stop:
        raise ValueError(f"tensor {name!r} lies at {start} … {stop} in {room} bytes")
    size = math.prod(shape) * dtype.itemsize
    if size != stop - start or size == 0:
        raise ValueError(f"tensor {name!r} of shape {shape} has {stop - start} bytes, not {size}")
    return Tensor(dtype, shape, start, size)


def kinds(arrays: Mapping[str, NDArray[Any]]) -> dict[str, tuple[np.dtype[Any], Shape]]:
    """Kinds and shapes of arrays, for `header`."""
    return {name: (array.dtype, array.shape) for name, array in arrays.items()}


def chunks(arrays: Iterable[NDArray[Any]], *, most: int = 1 << 24) -> Iterable[bytes]:
    """Yield the arrays' bytes in pieces of at most `most` bytes."""
    for array in arrays:
        flat = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
        for start in range(0, len(flat), most):
            yield flat[start : start + most].tobytes()
