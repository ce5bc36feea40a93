"""Reads a mesh file into a clean mesh, or says by name what is wrong with the file."""

from __future__ import annotations

from pathlib import Path

from btfcore.errors import GuardedFailure, InvalidMesh
from btfcore.guard import Arrays, Options, run_guarded
from btfcore.mesh.regions import WAYS, Regions, component_regions, read_labels, regions_of
from btfcore.mesh.repair import repair
from btfcore.mesh.topology import statistics
from btfcore.progress import Progress, between, silent
from btfcore.types import ImportReport, Mesh

SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf")
_LARGEST_FILE = 1 << 30
_MOST_FACES = 4_000_000
_POINTER = b"version https://git-lfs"


def read_mesh(
    path: str | Path,
    *,
    limit_s: float = 120,
    limit_mb: int = 8192,
    regions: str | Path = "auto",
    progress: Progress = silent,
) -> tuple[Mesh, ImportReport]:
    """Read an OBJ, PLY, STL, OFF, GLB or glTF file and repair what it holds.

    The file is parsed in a guarded child within `limit_s` seconds and `limit_mb` MiB; scenes
    come in as one mesh in world space; textures are never opened, and a glTF may only name
    files in its own folder. Polygons are cut into triangle fans. See `btfcore.mesh.repair`
    for what is mended; the report's notes say what was.

    regions : "materials", "parts" (objects, groups, nodes), "components", "auto" (materials
    where there are several, else parts), or a file with a label for every face, see
    `btfcore.mesh.regions.read_labels`. They end up in the mesh's `region`.

    Raises `InvalidMesh` where the file is missing, no mesh, larger than 1 GiB, holds more
    than 4 million triangles or none that has an area; `InvalidRegions` where labels do not
    fit; `GuardedFailure` where the parser
    crashed or outgrew its limits. Messages begin with the file's name.
    """
    file = Path(path)
    labelled = str(regions) not in WAYS
    try:
        _check_file(file)
        arrays, options = run_guarded(
            "btfcore.mesh.trimesh_door:read",
            {},
            {"path": str(file.resolve()), "by_face": labelled},
            limit_s=limit_s,
            limit_mb=limit_mb,
            progress=between(progress, 0.0, 0.6),
            label=f"reading {file.name}",
        )
        if len(arrays["faces"]) > _MOST_FACES:
            raise InvalidMesh(
                f"the file holds {len(arrays['faces']):,} triangles, up to {_MOST_FACES:,}"
                " can be handled: simplify the mesh first"
            )
        progress(0.6, f"repairing {file.name}")
        found = _regions(arrays, options, Path(regions) if labelled else str(regions))
        mesh, notes = repair(
            arrays["vertices"], arrays["faces"], regions=found,
            progress=between(progress, 0.6, 1.0),
        )  # fmt: skip
        if str(regions) == "components":
            named = component_regions(mesh.faces)
            mesh = Mesh(mesh.vertices, mesh.faces, named.label, named.names)
    except InvalidMesh as error:
        raise InvalidMesh(f"{file.name}: {error}") from error
    except GuardedFailure as error:
        raise GuardedFailure(f"{file.name}: {error}") from error
    progress(1.0, f"read {file.name}")
    counts = statistics(mesh.vertices, mesh.faces)
    return mesh, ImportReport(str(file), counts, (*options["notes"], *notes))


def _regions(arrays: Arrays, options: Options, regions: str | Path) -> Regions | None:
    """Regions of the faces as they were read."""
    if isinstance(regions, Path):
        found = read_labels(regions, int(options["faces"]))
        return Regions(found.label[arrays["face"]], found.names)
    if regions == "components":
        return None
    return regions_of(
        regions, arrays["material"], options["materials"], arrays["part"], options["parts"]
    )


def _check_file(file: Path) -> None:
    """Refuse what is no mesh file at a glance, before a process is started for it."""
    try:
        if not file.exists():
            raise InvalidMesh(f"there is no such file in {file.absolute().parent}")
        if file.is_dir():
            raise InvalidMesh("this is a folder, not a mesh file")
        if not file.is_file():
            raise InvalidMesh("this is no regular file")
        size = file.stat().st_size
        suffix = file.suffix.lower()
        if suffix not in SUFFIXES:
            known = " ".join(SUFFIXES)
            raise InvalidMesh(f"the ending {file.suffix!r} is unknown, known are {known}")
        if size == 0:
            raise InvalidMesh("the file is empty (0 bytes)")
        if size > _LARGEST_FILE:
            raise InvalidMesh(f"the file has {size:,} bytes, up to {_LARGEST_FILE:,} are read")
        with file.open("rb") as stream:
            head = stream.read(64)
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        raise InvalidMesh(f"the file cannot be opened: {error}") from error
    if head.startswith(_POINTER):
        raise InvalidMesh("this is a Git LFS pointer, not the mesh itself: run `git lfs pull`")
    if suffix == ".glb" and head[:4] != b"glTF":
        raise InvalidMesh(f"this is no GLB file: it begins with {head[:4]!r}, not b'glTF'")
    if suffix == ".ply" and not head.startswith(b"ply"):
        raise InvalidMesh(f"this is no PLY file: it begins with {head[:3]!r}, not b'ply'")
