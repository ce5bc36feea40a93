"""glTF 2.0 binary files (GLB): one surface, one material, one embedded texture."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import btfcore
from btfcore.errors import OutputFailed
from btfcore.files.atomic import write_bytes
from btfcore.files.surface import ExportSurface
from btfcore.types import F4, F8, I4

_FLOAT, _USHORT, _UINT = 5126, 5123, 5125
_VERTICES, _INDICES = 34962, 34963
_LINEAR, _LINEAR_MIPMAP_LINEAR, _CLAMP_TO_EDGE = 9729, 9987, 33071


@dataclass(frozen=True)
class Attached:
    """Bytes that travel in a buffer view of their own, which other programs pass over.

    description : JSON values by which they are found and read again, next to "bufferView".
    """

    description: Mapping[str, Any]
    data: bytes


def write_glb(
    path: str | Path,
    surface: ExportSurface,
    texture_png: bytes,
    *,
    name: str = "decorated",
    roughness: float = 0.9,
    extras: Mapping[str, Any] | None = None,
    attached: Mapping[str, Attached] | None = None,
) -> None:
    """Write a GLB with positions, normals, tangents, uv and the PNG as base colour.

    Positions are single floats, so a mesh far from the origin, or of a size near the ends of
    their range, is moved and scaled to the origin and its node takes it back. `extras` (JSON
    values) are kept under ``asset.extras``, and so are descriptions of what is `attached`, by
    name. Raises `OutputFailed`, as `atomic_output` does
    and where no triangle is left in single precision.
    """
    write_bytes(
        path, encode_glb(surface, texture_png, name, roughness, extras or {}, attached or {})
    )


def encode_glb(
    surface: ExportSurface,
    texture_png: bytes,
    name: str,
    roughness: float,
    extras: Mapping[str, Any],
    attached: Mapping[str, Attached],
) -> bytes:
    """Bytes of the file that `write_glb` writes."""
    placed = place(surface.positions)
    faces = drop_collapsed(placed.positions, surface.faces)
    if len(faces) == 0:
        raise OutputFailed(f"all {len(surface.faces)} triangles collapse in single precision")
    name = name.encode("utf-8", "replace").decode("utf-8")  # file names may hold lone surrogates
    binary = _Binary()
    attributes = {
        "POSITION": binary.accessor(placed.positions, "VEC3", _VERTICES, bounds=True),
        "NORMAL": binary.accessor(surface.normals, "VEC3", _VERTICES),
        "TANGENT": binary.accessor(surface.tangents, "VEC4", _VERTICES),
        "TEXCOORD_0": binary.accessor(surface.uv, "VEC2", _VERTICES),
    }
    # the largest u16 restarts primitives and names no vertex
    narrow = np.uint16 if len(surface.positions) <= 65535 else np.uint32
    indices = binary.accessor(faces.reshape(-1).astype(narrow), "SCALAR", _INDICES)
    image = binary.view(texture_png, None)
    more = {
        key: {**each.description, "bufferView": binary.view(each.data, None)}
        for key, each in attached.items()
    }
    node: dict[str, Any] = {"mesh": 0, "name": name}
    if placed.scale != 1.0:
        node["scale"] = [placed.scale] * 3
    if any(placed.origin):
        node["translation"] = list(placed.origin)
    document = {
        "asset": {
            "version": "2.0",
            "generator": f"Patina {btfcore.__version__}",
            "extras": {"patina": {"version": btfcore.__version__, **extras, **more}},
        },
        "scene": 0,
        "scenes": [{"nodes": [0], "name": name}],
        "nodes": [node],
        "meshes": [
            {
                "name": name,
                "primitives": [{"attributes": attributes, "indices": indices, "material": 0}],
            }
        ],
        "materials": [
            {
                "name": name,
                "doubleSided": not surface.closed,
                "pbrMetallicRoughness": {
                    "baseColorTexture": {"index": 0},
                    "metallicFactor": 0.0,
                    "roughnessFactor": roughness,
                },
            }
        ],
        "textures": [{"sampler": 0, "source": 0}],
        "images": [{"bufferView": image, "mimeType": "image/png", "name": name}],
        "samplers": [
            {
                "magFilter": _LINEAR,
                "minFilter": _LINEAR_MIPMAP_LINEAR,
                "wrapS": _CLAMP_TO_EDGE,
                "wrapT": _CLAMP_TO_EDGE,
            }
        ],
        "accessors": binary.accessors,
        "bufferViews": binary.views,
        "buffers": [{"byteLength": len(binary.data)}],
    }
    return _container(document, bytes(binary.data))


@dataclass(frozen=True, eq=False)
class Placed:
    """Positions (n, 3) f4 with world = origin + scale · position."""

    positions: F4
    origin: tuple[float, float, float]
    scale: float


def place(positions: F8) -> Placed:
    """Bring positions into the range where single floats are exact enough.

    They are moved where they lie more than 16 diagonals from the origin (rounding would pass
    1e-6 of the diagonal), scaled by a power of two where the diagonal leaves 1e-12 … 1e12.
    """
    low, high = positions.min(axis=0), positions.max(axis=0)
    diagonal = float(np.linalg.norm(high - low))
    far = float(np.abs(positions).max()) > 16 * diagonal
    centre = (low + high) / 2 if far else np.zeros(3)
    usual = 1e-12 <= diagonal <= 1e12 or diagonal == 0
    scale = 1.0 if usual else float(2.0 ** np.round(np.log2(diagonal)))
    moved = ((positions - centre) / scale).astype(np.float32)
    return Placed(moved, (float(centre[0]), float(centre[1]), float(centre[2])), scale)


def drop_collapsed(positions: NDArray[np.floating], faces: I4) -> I4:
    """Faces less those of which two corners coincide: (m', 3) i4.

    Only these: their edges fall together, so that no crack opens where they go.
    """
    a, b, c = (positions[faces[:, corner]] for corner in range(3))
    same = (a == b).all(axis=1) | (b == c).all(axis=1) | (c == a).all(axis=1)
    return faces[~same]


class _Binary:
    """The binary chunk as it grows, with the views and accessors that describe it."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def view(self, data: bytes, target: int | None) -> int:
        """Append bytes at a multiple of four; returns the buffer view's index."""
        self.data.extend(bytes(-len(self.data) % 4))
        view: dict[str, Any] = {
            "buffer": 0,
            "byteOffset": len(self.data),
            "byteLength": len(data),
        }
        if target is not None:
            view["target"] = target
        self.data.extend(data)
        self.views.append(view)
        return len(self.views) - 1

    def accessor(
        self, values: NDArray[Any], kind: str, target: int, *, bounds: bool = False
    ) -> int:
        """Append an array as little-endian; returns the accessor's index."""
        component = {"f4": _FLOAT, "u2": _USHORT, "u4": _UINT}[values.dtype.str[1:]]
        little = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
        accessor: dict[str, Any] = {
            "bufferView": self.view(little.tobytes(), target),
            "componentType": component,
            "count": len(values),
            "type": kind,
        }
        if bounds:
            accessor["min"] = values.min(axis=0).astype(float).tolist()
            accessor["max"] = values.max(axis=0).astype(float).tolist()
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def _container(document: dict[str, Any], binary: bytes) -> bytes:
    """GLB container, version 2: header, JSON chunk, binary chunk, all padded to four bytes."""
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode("utf-8")
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    total = 12 + 8 + len(text) + 8 + len(binary)
    return b"".join(
        [
            struct.pack("<4sII", b"glTF", 2, total),
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(binary), b"BIN\0"),
            binary,
        ]
    )
