"""The one door for decorated meshes: the file's suffix chooses the format."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from btfcore.errors import InvalidParameter
from btfcore.files.atomic import check_writable
from btfcore.files.gltf import Attached, write_glb
from btfcore.files.obj import obj_files, write_obj
from btfcore.files.ply import write_ply
from btfcore.files.png import encode_png
from btfcore.files.surface import export_dense, export_input
from btfcore.progress import Progress, between, silent
from btfcore.render.texture import atlas_texture, quantise
from btfcore.types import F4, F8, I4, Atlas, DenseMesh, Mesh

SUFFIXES = (".glb", ".obj", ".ply")


def check_output(path: str | Path, *, suffixes: Sequence[str] = SUFFIXES) -> Path:
    """Refuse before long work what would be refused after it; leaves nothing behind.

    Raises `InvalidParameter` for a suffix that is not in `suffixes` (upper case is accepted),
    `OutputFailed` where the folder is missing or not writable or the name is a directory.
    """
    given = Path(path)
    suffix = given.suffix.lower()
    if suffix not in suffixes:
        what = f"the unknown suffix {given.suffix!r}" if suffix else "no suffix"
        raise InvalidParameter(f"output {given} has {what}; known: {', '.join(suffixes)}")
    for each in obj_files(given) if suffix == ".obj" else (given,):
        check_writable(each)
    return given


def export(
    path: str | Path,
    mesh: Mesh,
    atlas: Atlas,
    dense: DenseMesh,
    colours: F4,
    *,
    dense_shape: bool = False,
    source: I4 | None = None,
    extras: Mapping[str, Any] | None = None,
    attached: Callable[[F8], Mapping[str, Attached]] | None = None,
    progress: Progress = silent,
) -> tuple[Path, ...]:
    """Write the decorated mesh to `path`; returns the files written, `path` first.

    colours : (N, 3) f4, sRGB-coded 0–1, per dense vertex. GLB and OBJ carry the input mesh
    with the atlas as texture, or the dense mesh where `dense_shape`; PLY has colours per
    vertex, hence always the dense mesh. `source` is `gutter_source(dense)` where the caller
    has it already; `extras` (JSON values) travel in the GLB, and so does what `attached` makes
    for the surface's positions (n, 3). `progress` is not called once
    files are in place, so that cancelling leaves nothing. Raises like `check_output`.
    """
    given = check_output(path)
    if given.suffix.lower() == ".ply":
        progress(0.1, "writing PLY")
        write_ply(
            given, dense.vertices, dense.normals, quantise(colours), dense.faces,
            progress=between(progress, 0.1, 1.0),
        )  # fmt: skip
        return (given,)
    progress(0.0, "filling the gutter")
    texture = atlas_texture(dense, colours, source=source, progress=between(progress, 0.0, 0.2))
    progress(0.2, "normals and tangents")
    part = between(progress, 0.2, 0.4)
    surface = (
        export_dense(dense, progress=part)
        if dense_shape
        else export_input(mesh, atlas, progress=part)
    )
    progress(0.4, "encoding the texture")
    png = encode_png(texture, progress=lambda fraction, label: progress(0.4, label))
    progress(0.5, "writing")
    if given.suffix.lower() == ".obj":
        return write_obj(given, surface, png, progress=between(progress, 0.5, 1.0))
    more = None if attached is None else attached(surface.positions)
    write_glb(given, surface, png, name=given.stem, extras=extras, attached=more)
    return (given,)
