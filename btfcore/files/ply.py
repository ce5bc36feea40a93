"""Binary PLY with a colour per vertex."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import btfcore
from btfcore.errors import InvalidParameter
from btfcore.files.atomic import atomic_output
from btfcore.files.gltf import place
from btfcore.progress import Progress, blocks, silent
from btfcore.types import F4, F8, I4

_MANY = 1 << 19  # rows written between two calls of progress


def write_ply(
    path: str | Path, vertices: F8, normals: F4, colours: NDArray[np.uint8], faces: I4,
    *, progress: Progress = silent,
) -> None:  # fmt: skip
    """Write vertices (N, 3), unit normals (N, 3), 8-bit colours (N, 3) and faces (G, 3).

    Binary little-endian. Coordinates are single floats where these are exact enough, doubles
    where the mesh lies far from the origin or near the ends of their range. Raises
    `OutputFailed` as `atomic_output` does.
    """
    if not len(vertices) == len(normals) == len(colours):
        raise InvalidParameter(
            f"{len(vertices)} vertices, {len(normals)} normals and {len(colours)} colours"
        )
    progress(0.0, "writing PLY")
    placed = place(np.stack([vertices.min(axis=0), vertices.max(axis=0)]))  # by the box alone
    plain = placed.scale == 1.0 and not any(placed.origin)
    number, word = ("<f4", "float") if plain else ("<f8", "double")
    row = [("position", number, 3), ("normal", "<f4", 3), ("colour", "u1", 3)]
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment Patina {btfcore.__version__}",
        f"element vertex {len(vertices)}",
        *(f"property {word} {axis}" for axis in "xyz"),
        *(f"property float n{axis}" for axis in "xyz"),
        *(f"property uchar {band}" for band in ("red", "green", "blue")),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    with atomic_output(path) as handle:
        handle.write(("\n".join(header) + "\n").encode("ascii"))
        for begin, end in blocks(len(vertices), _MANY, progress, "writing PLY", 0.1, 0.5):
            rows = np.empty(end - begin, row)
            rows["position"], rows["normal"] = vertices[begin:end], normals[begin:end]
            rows["colour"] = colours[begin:end]
            handle.write(rows.tobytes())
        for begin, end in blocks(len(faces), _MANY, progress, "writing PLY", 0.5, 1.0):
            lists = np.empty(end - begin, [("count", "u1"), ("corner", "<i4", 3)])
            lists["count"], lists["corner"] = 3, faces[begin:end]
            handle.write(lists.tobytes())
