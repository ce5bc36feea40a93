"""Refuses glTF and GLB files that reach outside their folder or that would be misread."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from btfcore.errors import InvalidMesh

_UNREADABLE = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
_JSON_CHUNK = 0x4E4F534A
_TRIANGLE_MODES = (4, 5)
_FAN = 6


def check_gltf(data: bytes, path: Path) -> None:
    """Check the JSON of a glTF or GLB file before a parser acts upon it.

    data : the file's bytes; path : where it lies. Raises `InvalidMesh` for a broken container,
    buffers outside the file's own folder (addresses, absolute paths, ``..``, links that lead
    out), compressed or sparse geometry, and where no primitive consists of triangles.
    """
    header = gltf_header(data, path)
    for item in _list(header, "buffers"):  # images are never opened
        if "uri" in item:
            _check_uri(item["uri"], path)
    _check_tree(header)
    used = {name for mesh in _list(header, "meshes") for p in _list(mesh, "primitives")
            for name in p.get("extensions", {})}  # fmt: skip
    used |= set(_list(header, "extensionsRequired"))
    for name in _UNREADABLE:
        if name in used:
            raise InvalidMesh(f"its geometry is compressed with {name}, which cannot be read")
    _check_primitives(header)


def gltf_header(data: bytes, path: Path) -> dict[str, Any]:
    """JSON of a glTF or GLB file; raises `InvalidMesh` where there is none."""
    if path.suffix.lower() == ".glb":
        if len(data) < 20:
            raise InvalidMesh(f"the GLB file has {len(data)} bytes, its head alone needs 20")
        _, version, length, chunk, kind = struct.unpack("<5I", data[:20])
        if version != 2:
            raise InvalidMesh(f"the GLB file has version {version}, only 2 can be read")
        if length > len(data):
            raise InvalidMesh(f"the GLB file is cut off: {len(data)} of {length} bytes are there")
        if kind != _JSON_CHUNK or 20 + chunk > len(data):
            raise InvalidMesh("the GLB file does not begin with a whole JSON chunk")
        data = data[20 : 20 + chunk]
    try:
        header = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise InvalidMesh(f"its JSON cannot be parsed: {error}") from error
    if not isinstance(header, dict) or "asset" not in header:
        raise InvalidMesh("its JSON is no glTF: it has no 'asset'")
    return header


def _list(holder: dict[str, Any], key: str) -> list[Any]:
    value = holder.get(key, [])
    if not isinstance(value, list):
        raise InvalidMesh(f"its {key!r} is no list")
    return value


def _check_uri(uri: Any, path: Path) -> None:
    if not isinstance(uri, str):
        raise InvalidMesh(f"it names a file by {uri!r}, which is no text")
    if uri.startswith("data:"):
        return
    name = unquote(uri)
    inside = Path(path.parent, name).resolve().is_relative_to(path.parent.resolve())
    if ":" in name or "\\" in name or name.startswith("/") or not inside:
        raise InvalidMesh(f"it refers to {uri[:80]!r} outside its own folder, which is refused")


def _check_tree(header: dict[str, Any]) -> None:
    """Refuse nodes with two parents, which rules out cycles below the roots as well."""
    nodes = _list(header, "nodes")
    parents = [0] * len(nodes)
    roots = [root for scene in _list(header, "scenes") for root in _list(scene, "nodes")]
    for child in [child for node in nodes for child in _list(node, "children")] + roots:
        if not isinstance(child, int) or not 0 <= child < len(nodes):
            raise InvalidMesh(f"it names node {child!r} of {len(nodes)}")
    for node in nodes:
        for child in _list(node, "children"):
            parents[child] += 1
            if parents[child] > 1:
                raise InvalidMesh(f"its node {child} has more than one parent")
    for root in roots:
        if parents[root]:
            raise InvalidMesh(f"its node {root} is a root and a child at once")


def _check_primitives(header: dict[str, Any]) -> None:
    """Refuse what the parser would read as zeros or skip without a word."""
    accessors = _list(header, "accessors")
    modes = set()
    for mesh in _list(header, "meshes"):
        for primitive in _list(mesh, "primitives"):
            modes.add(primitive.get("mode", 4))
            names = [primitive.get("attributes", {}).get("POSITION"), primitive.get("indices")]
            for index in names:
                if index is None:
                    continue
                if not isinstance(index, int) or not 0 <= index < len(accessors):
                    raise InvalidMesh(f"it names accessor {index!r} of {len(accessors)}")
                if "sparse" in accessors[index]:
                    raise InvalidMesh(f"its accessor {index} is sparse, which cannot be read")
                if accessors[index].get("normalized"):
                    raise InvalidMesh(f"its accessor {index} is normalized, which cannot be read")
    if _FAN in modes:
        raise InvalidMesh("some of its primitives are triangle fans, which cannot be read")
    if not modes.intersection(_TRIANGLE_MODES):
        raise InvalidMesh(f"it holds no triangles (primitive modes {sorted(modes, key=str)})")
