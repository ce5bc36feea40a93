"""The only door to trimesh; runs in a guarded child, never in the program itself.

Only the parsers are wanted here. trimesh treats the libraries below as optional, and without
them it loads four times as fast and cannot open images or addresses.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import numpy as np

from btfcore.errors import InvalidMesh
from btfcore.guard import Arrays, Options
from btfcore.mesh.gltf_check import check_gltf
from btfcore.mesh.obj_text import tidy_obj
from btfcore.mesh.ply import read_ply

_UNWANTED = ("scipy", "networkx", "PIL", "shapely", "rtree", "lxml", "requests", "httpx")


def read(arrays: Arrays, options: Options) -> tuple[Arrays, Options]:
    """Guarded task: parse the file at options["path"].

    Returns vertices (V, 3) f8 in world space and faces (F, 3) i4 in range, and
    options["notes"]. Raises `InvalidMesh` with the parser's own words where it gave up.
    """
    path = Path(options["path"])
    kind = path.suffix.lower()[1:]
    notes: list[str] = []
    try:
        if kind == "ply":
            parts = [read_ply(path.read_bytes())]
        else:
            parts = _parts(path, kind, notes)
    except (InvalidMesh, MemoryError):
        raise
    except Exception as error:  # parsers meet broken files with any exception there is
        reason = f"{type(error).__name__}: {error}".replace("\n", " ")[:300]
        raise InvalidMesh(f"the {kind.upper()} data cannot be parsed ({reason})") from error
    vertices, faces = _joined(parts)
    return {"vertices": vertices, "faces": faces}, {"notes": notes}


def _parts(path: Path, kind: str, notes: list[str]) -> list[tuple[Any, Any]]:
    """Load a scene and return (vertices in world space, faces) of every triangle mesh in it."""
    for name in _UNWANTED:
        sys.modules[name] = None  # type: ignore[assignment]
    import trimesh

    data = path.read_bytes()
    if kind == "obj":
        data = tidy_obj(data)
    if kind == "stl":
        data = _whole_stl(data)
    if kind in ("glb", "gltf"):
        check_gltf(data, path)
        loaded = trimesh.load_scene(path, process=False, skip_materials=True)
    else:
        loaded = trimesh.load_scene(
            io.BytesIO(data), file_type=kind, process=False, skip_materials=True
        )
    placed = [loaded.graph[node] for node in loaded.graph.nodes_geometry]
    if not placed and loaded.geometry:
        notes.append("the scene shows nothing, so all meshes of the file were taken")
        placed = [(np.eye(4), key) for key in loaded.geometry]
    parts = []
    for matrix, key in placed:
        geometry = loaded.geometry[key]
        faces = getattr(geometry, "faces", None)
        if faces is None or len(faces) == 0:
            notes.append(f"left out {key!r}: it has no triangles")
            continue
        matrix = np.asarray(matrix, np.float64)
        vertices = np.asarray(geometry.vertices, np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        mirrored = np.linalg.det(matrix[:3, :3]) < 0
        faces = np.asarray(faces)
        parts.append((vertices, faces[:, ::-1] if mirrored else faces))
    return parts


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
