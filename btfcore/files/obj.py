"""Wavefront OBJ with its material (MTL) and texture (PNG) beside it."""

from __future__ import annotations

import re
import unicodedata
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import btfcore
from btfcore.errors import OutputFailed
from btfcore.files.atomic import atomic_group
from btfcore.files.gltf import drop_collapsed
from btfcore.files.surface import ExportSurface
from btfcore.progress import Progress, silent

_ROWS = 1 << 16  # lines formatted at a time


def write_obj(
    path: str | Path,
    surface: ExportSurface,
    texture_png: bytes,
    *,
    progress: Progress = silent,
) -> tuple[Path, ...]:
    """Write `path` and, in the same folder, the material and texture it refers to.

    Returns the three paths, OBJ first. Positions are written once per vertex of the mesh, so
    that splits at chart borders do not tear it; coordinates keep nine digits relative to the
    mesh's size, wherever it lies. All three files are whole before any is renamed, the OBJ
    last. Raises `OutputFailed` as `atomic_output` does.
    """
    obj, mtl, png = obj_files(path)
    with atomic_group([png, mtl, obj]) as (image, material, model):
        image.write(texture_png)
        material.write(_material(png.name).encode("ascii"))
        for share, text in _model(surface, mtl.name):
            progress(share, "writing OBJ")
            model.write(text.encode("ascii"))
    return obj, mtl, png


def obj_files(path: str | Path) -> tuple[Path, Path, Path]:
    """Paths of the OBJ, MTL and PNG that `write_obj` writes for `path`.

    Many readers split references at blanks or take them for Latin-1, so the companions'
    names are plain ASCII, told apart by a checksum where that changed them.
    """
    obj = Path(path)
    plain = unicodedata.normalize("NFKD", obj.stem).encode("ascii", "ignore").decode("ascii")
    plain = re.sub(r"[^A-Za-z0-9._-]+", "_", plain)[:80].lstrip("-.") or "model"
    if plain != obj.stem:
        plain += f"-{zlib.crc32(obj.stem.encode('utf-8', 'surrogateescape')):08x}"
    return obj, obj.with_name(f"{plain}.mtl"), obj.with_name(f"{plain}_colour.png")


def _material(image: str) -> str:
    lines = [
        f"# Patina {btfcore.__version__}",
        "newmtl quilt",
        "Ka 1 1 1",
        "Kd 1 1 1",
        "Ks 0 0 0",
        "illum 1",
        f"map_Kd {image}",
    ]
    return "\n".join(lines) + "\n"


def _model(surface: ExportSurface, material: str) -> Iterator[tuple[float, str]]:
    """Yield the OBJ's text in pieces, each with the share of lines before it."""
    count = int(surface.origin.max()) + 1
    used = np.zeros(count, bool)
    used[surface.origin] = True
    points = np.zeros((count, 3))
    points[surface.origin] = surface.positions
    number = np.cumsum(used)  # OBJ counts from 1
    faces = drop_collapsed(surface.positions, surface.faces)
    if len(faces) == 0:
        raise OutputFailed(f"all {len(surface.faces)} triangles have coinciding corners")
    corner = np.stack([number[surface.origin[faces]], faces + 1, faces + 1], axis=2)
    upright = surface.uv.astype(np.float64) * [1.0, -1.0] + [0.0, 1.0]  # v runs up in OBJ
    digits = _digits(surface.positions)
    tables: list[tuple[str, NDArray[np.generic]]] = [
        ("v" + f" %.{digits}g" * 3, points[used]),
        ("vt %.8g %.8g", upright),
        ("vn %.6g %.6g %.6g", surface.normals),
        ("f %d/%d/%d %d/%d/%d %d/%d/%d", corner.reshape(-1, 9)),
    ]
    total = sum(len(rows) for _, rows in tables)
    head = f"# Patina {btfcore.__version__}\nmtllib {material}\no quilt\n"
    yield 0.0, head
    done = 0
    for line, rows in tables:
        if line.startswith("f"):
            yield done / total, "usemtl quilt\n"
        for start in range(0, len(rows), _ROWS):
            piece = rows[start : start + _ROWS]
            yield (done + start) / total, (line + "\n") * len(piece) % tuple(piece.ravel().tolist())
        done += len(rows)


def _digits(positions: NDArray[np.float64]) -> int:
    """Significant digits that keep nine relative to the mesh's own size (at most 17)."""
    size = float(np.ptp(positions, axis=0).max())
    reach = float(np.abs(positions).max())
    if size == 0 or reach <= size:
        return 9
    return min(9 + int(np.ceil(np.log10(reach / size))), 17)
