"""The only door to trimesh; runs in a guarded child, never in the program itself.

Only the parsers are wanted here. trimesh treats the libraries below as optional, and without
them it loads four times as fast and cannot open images or addresses.
"""

from __future__ import annotations

import io
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from btfcore.errors import InvalidMesh
from btfcore.guard import Arrays, Options
from btfcore.mesh.gltf_check import check_gltf, gltf_header
from btfcore.mesh.obj_groups import ObjGroups, obj_groups
from btfcore.mesh.obj_text import tidy_obj
from btfcore.mesh.ply import read_ply

_LOADED = (0, 1, 4, 5)  # primitive modes that the parser makes geometry of
_UNWANTED = ("scipy", "networkx", "PIL", "shapely", "rtree", "lxml", "requests", "httpx")


def read(arrays: Arrays, options: Options) -> tuple[Arrays, Options]:
    """Guarded task: parse the file at options["path"].

    Returns vertices (V, 3) f8 in world space and faces (F, 3) i4 in range; face, material and
    part (F,) i4, the face of the file that each triangle comes from and its groups, -1 where
    it has none; and options "notes", "faces" (how many the file has; with options["by_face"]
    polygons of an OBJ count as one), "materials" and "parts" (their names). Raises
    `InvalidMesh` with the parser's own words where it gave up.
    """
    path = Path(options["path"])
    kind = path.suffix.lower()[1:]
    notes: list[str] = []
    try:
        if kind == "ply":
            read_in = _Scene([read_ply(path.read_bytes())])
        else:
            read_in = _parts(path, kind, notes, bool(options.get("by_face")))
    except (InvalidMesh, MemoryError):
        raise
    except Exception as error:  # parsers meet broken files with any exception there is
        reason = f"{type(error).__name__}: {error}".replace("\n", " ")[:300]
        raise InvalidMesh(f"the {kind.upper()} data cannot be parsed ({reason})") from error
    vertices, faces = _joined(read_in.parts)
    groups = read_in.groups
    sizes = [len(triangles) for _, triangles in read_in.parts]
    if groups is not None and len(groups.face) == len(faces):
        face, material, part = groups.face, groups.material, groups.part
        count, materials, names = groups.faces, groups.material_names, groups.part_names
    else:
        face = np.arange(len(faces), dtype=np.int32)
        part = np.repeat(np.arange(len(sizes), dtype=np.int32), sizes)
        count, material = len(faces), part
        materials, names = tuple(read_in.materials), tuple(read_in.names)
        if not names:
            material = part = np.full(len(faces), -1, np.int32)
    found = {"notes": notes, "faces": count, "materials": materials, "parts": names}
    arrays = {"vertices": vertices, "faces": faces, "face": face}
    return arrays | {"material": material, "part": part}, found


@dataclass
class _Scene:
    """What a file shows.

    parts: (vertices in world space, faces) of every triangle mesh; names, materials: what
    each and its material is called; groups: those of an OBJ file, which is one part.
    """

    parts: list[tuple[Any, Any]]
    names: list[str] = field(default_factory=list)
    materials: list[str] = field(default_factory=list)
    groups: ObjGroups | None = None


def _parts(path: Path, kind: str, notes: list[str], by_face: bool) -> _Scene:
    """Load a scene."""
    for name in _UNWANTED:
        sys.modules[name] = None  # type: ignore[assignment]
    import trimesh

    data, groups = path.read_bytes(), None
    material: dict[str, str] = {}
    if kind == "obj":
        data = tidy_obj(data)
        groups = obj_groups(data, always=by_face)
        data = data if groups is None else groups.text
    if kind == "stl":
        data = _whole_stl(data)
    if kind in ("glb", "gltf"):
        check_gltf(data, path)
        loaded = trimesh.load_scene(path, process=False, skip_materials=True)
        material = _materials(gltf_header(data, path), list(loaded.geometry))
    else:
        loaded = trimesh.load_scene(
            io.BytesIO(data), file_type=kind, process=False, skip_materials=True
        )
    nodes = list(loaded.graph.nodes_geometry)
    placed = [loaded.graph[node] for node in nodes]
    if not placed and loaded.geometry:
        notes.append("the scene shows nothing, so all meshes of the file were taken")
        nodes = list(loaded.geometry)
        placed = [(np.eye(4), key) for key in nodes]
    scene = _Scene([], groups=groups)
    for node, (matrix, key) in zip(nodes, placed, strict=True):
        geometry = loaded.geometry[key]
        faces = getattr(geometry, "faces", None)
        if faces is None or len(faces) == 0:
            notes.append(f"left out {key!r}: it has no triangles")
            continue
        matrix = np.asarray(matrix, np.float64)
        vertices = np.asarray(geometry.vertices, np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        mirrored = np.linalg.det(matrix[:3, :3]) < 0
        faces = np.asarray(faces)
        scene.parts.append((vertices, faces[:, ::-1] if mirrored else faces))
        scene.names.append(str(node))
        scene.materials.append(material.get(str(key), ""))
    return scene


def _materials(header: dict[str, Any], keys: list[str]) -> dict[str, str]:
    """Name of the material of each geometry of a glTF, where they can be told apart for sure."""
    known = [each.get("name", "") for each in header.get("materials", [])]
    found = []
    for mesh in header.get("meshes", []):
        for primitive in mesh["primitives"]:
            if primitive.get("mode", 4) in _LOADED:
                index = primitive.get("material")
                inside = isinstance(index, int) and 0 <= index < len(known)
                found.append((mesh.get("name", ""), known[index] if inside else ""))
    if len(found) != len(keys):
        return {}
    if not all(key.startswith(name) for key, (name, _) in zip(keys, found, strict=True)):
        return {}
    return {key: str(name) for key, (_, name) in zip(keys, found, strict=True)}


def _whole_stl(data: bytes) -> bytes:
    """Check a binary STL's length against its count; bytes after the last triangle go."""
    if b"facet" in data[:2000].lower() or len(data) < 84:
        return data  # text, or too short to be told apart: the parser decides
    count = int.from_bytes(data[80:84], "little")
    if 84 + 50 * count > len(data):
        raise InvalidMesh(
            f"the STL file claims {count:,} triangles, which take {84 + 50 * count:,} bytes;"
            f" it has {len(data):,}"
        )
    return data[: 84 + 50 * count]


def _joined(parts: list[tuple[Any, Any]]) -> tuple[Any, Any]:
    """Concatenate parts, checking what the faces of each name."""
    vertices, faces, count = [], [], 0
    for points, triangles in parts:
        if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(points):
            raise InvalidMesh(
                f"faces name vertices {triangles.min()}..{triangles.max()},"
                f" the mesh has {len(points)}"
            )
        vertices.append(np.asarray(points, np.float64).reshape(-1, 3))
        faces.append(np.asarray(triangles, np.int64).reshape(-1, 3) + count)
        count += len(points)
    if not count or not any(map(len, faces)):
        raise InvalidMesh("the file holds no triangle")
    return np.concatenate(vertices), np.concatenate(faces).astype(np.int32)
