"""The manifest of a project: a versioned schema, checked before anything is believed."""

from __future__ import annotations

import json
from dataclasses import fields
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from btfcore.errors import InvalidProject
from btfcore.files.edits_schema import path_of
from btfcore.files.package.manifest import Manifest as BtfManifest
from btfcore.files.package.manifest import Text
from btfcore.files.project.migrate import migrated
from btfcore.quilt.parameters import QuiltParameters

FORMAT = "patina-project"
VERSION = 1
LARGEST_MANIFEST = 32 << 20
LARGEST_RATE = 8192
MOST_SAMPLES = 1000
MOST_VERTICES = LARGEST_RATE**2
KNOBS = frozenset(item.name for item in fields(QuiltParameters))
CONVENTIONS = (
    "Numbers are little-endian, tensors are safetensors. mesh: vertices (V, 3) and faces (F, 3)"
    " of the input, region (F), and the atlas: uv (F, 3, 2) as (column, row) in texels and chart"
    " (F). dense: one vertex per covered texel of the atlas, texel (N, 2) as (row, column), face"
    " and bary: where on the input it lies, tangents and singularities of the orientation"
    " field. quilt: the background, below all edits: source (N, 2) as (column, row) in the grid"
    " of the vertex's sample, angle, sample, patch (-1: bare). A ghost belongs to a half-edge,"
    " numbered by its first vertex and then its last: where its patch continued would put the"
    " other end. It is stored for the half-edges of ghost_slots; elsewhere it is the other end's"
    " source where both are of one patch, and 0 where not. edits: of all edits in a row, the"
    " vertices that each wrote, their values after it, and the vertices that it read with the"
    " constraint m_0 that it wanted there; before_*,"
    " writers and read_writers only for edits that do not fit the ground which the visible ones"
    " below them make."
)

_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Figure = Annotated[float, Field(allow_inf_nan=False)] | None  # None: not a number
_Size = Annotated[int, Field(ge=0, le=MOST_VERTICES * 16)]
_Count = Annotated[int, Field(ge=0, lt=2**31)]
_Rows = Annotated[int, Field(ge=1, le=MOST_VERTICES * 2)]
_Side = Annotated[int, Field(ge=1, le=1 << 15)]


class _Entry(BaseModel):
    model_config = ConfigDict(strict=True, extra="ignore")


class MeshEntry(_Entry):
    """Counts of the input mesh, and the names of its regions."""

    vertices: _Rows
    faces: _Rows
    regions: Annotated[list[Text], Field(max_length=1 << 16)] = []
    labelled: bool = False


class DenseEntry(_Entry):
    """Counts of the dense mesh; size: side of the atlas in texels."""

    vertices: Annotated[int, Field(ge=1, le=MOST_VERTICES)]
    faces: _Rows
    grid_faces: _Size
    size: Annotated[int, Field(ge=1, le=LARGEST_RATE)]
    singularities: _Size = 0


class ParametersEntry(_Entry):
    """Knobs of the quilting, see `btfcore.quilt.parameters`, which checks their ranges."""

    model_config = ConfigDict(strict=True, extra="allow")


class QuiltEntry(_Entry):
    """Counts of the background; patches: of the background, counter: of patch numbers."""

    patches: _Count
    counter: _Count
    half_edges: _Size
    ghosts: _Size


class SampleEntry(_Entry):
    """A sample: size, scale, and its material, whose tensors are beside it."""

    name: Text
    title: Text = ""
    height: _Side
    width: _Side
    channels: Annotated[int, Field(ge=1, le=1 << 12)]
    tiles: bool = False
    masked: bool = False
    scale: Annotated[float, Field(ge=1e-4, le=1e4)] = 1.0  # times the parameters'
    file: Text = ""
    material: BtfManifest | None = None
    rank: _Count = 0


class PlanEntry(_Entry):
    """Which sample has which region; pairs of regions whose border is not as the others."""

    names: Annotated[list[Text], Field(min_length=1, max_length=1 << 16)]
    files: Annotated[list[Text], Field(min_length=1, max_length=MOST_SAMPLES)]
    scales: Annotated[list[_Finite], Field(min_length=1, max_length=MOST_SAMPLES)]
    sample: Annotated[list[_Count], Field(min_length=1, max_length=1 << 16)]
    hard: bool
    pairs: Annotated[list[Annotated[list[_Count], Field(min_length=2, max_length=2)]], Field()] = []
    kinds: list[bool] = []
    notes: list[Text] = []


class ReportEntry(_Entry):
    """Figures of an edit, see `btfcore.paint.engine.Report`."""

    patches: _Count = 0
    tries: _Count = 0
    area: _Count = 0
    reached: _Count = 0
    weight: _Figure = 0.0
    constraint: _Figure = 0.0
    constraint_before: _Figure = 0.0
    smooth: _Figure = 0.0
    smooth_before: _Figure = 0.0
    seam: _Figure = 0.0
    seam_before: _Figure = 0.0
    notes: list[Text] = []


class DeltaEntry(_Entry):
    """How many rows of the edits' tensors belong to one edit's delta."""

    token: Annotated[int, Field(ge=-1, lt=2**31)]
    vertices: _Size
    reads: _Size
    ghosts: _Size
    plain: bool
    before_ghosts: _Size = 0


class EditEntry(_Entry):
    """What a project knows of an edit beyond the edit itself."""

    uid: _Count
    delta: DeltaEntry | None = None
    report: ReportEntry | None = None


class ProjectManifest(_Entry):
    """Everything about a project but its arrays and edits."""

    format: Literal["patina-project"]
    version: Literal[1]
    token: Annotated[str, Field(pattern="^[0-9a-f]{32}$")]
    written_by: Text = ""
    mesh: MeshEntry
    dense: DenseEntry
    parameters: ParametersEntry
    quilt: QuiltEntry
    samples: Annotated[list[SampleEntry], Field(min_length=1, max_length=MOST_SAMPLES)]
    plan: PlanEntry | None = None
    edits: Annotated[list[EditEntry], Field(max_length=32_000)] = []
    next_uid: _Count = 0
    tokens: _Count = 0
    conventions: Text = CONVENTIONS


def to_json(manifest: ProjectManifest) -> bytes:
    """Return the manifest as indented JSON."""
    return json.dumps(manifest.model_dump(), indent=1, allow_nan=False).encode()


def from_json(text: bytes, where: str) -> tuple[ProjectManifest, tuple[str, ...]]:
    """Read a manifest of this version or, by `migrate`, of an older one; with notes.

    Raises `InvalidProject`, beginning with `where`, for anything that does not fit the schema.
    """
    value = parsed(text, where)
    version = value.get("version")
    if type(version) is not int:  # True is no number of a version
        raise InvalidProject(f"{where}: manifest field version: {version!r:.60} is no number")
    if version > VERSION:
        raise InvalidProject(
            f"{where}: version {version} of the project format is newer than {VERSION}, the"
            " newest that this Patina reads"
        )
    notes: tuple[str, ...] = ()
    if version != VERSION:
        value = migrated(value, version, VERSION, where)
        notes = (f"migrated from version {version} of the project format to {VERSION}",)
    try:
        manifest = ProjectManifest.model_validate(value)
    except (ValidationError, RecursionError) as error:
        if isinstance(error, RecursionError):
            raise InvalidProject(f"{where}: its manifest is nested too deeply") from None
        raise InvalidProject(f"{where}: manifest field {told(error)}") from None
    unknown = [path_of(path) for path in _unknown(value, ProjectManifest)]
    unknown += [f"parameters.{name}" for name in value["parameters"] if name not in KNOBS]
    if unknown:
        listed = ", ".join(unknown[:8]) + (f" and {len(unknown) - 8} more" if unknown[8:] else "")
        notes += (f"ignored unknown manifest fields: {listed}",)
    return manifest, notes


def told(error: ValidationError) -> str:
    """Path, value and reason of the first of a validation's errors."""
    first = error.errors(include_url=False)[0]
    shown = "" if isinstance(first["input"], (list, dict)) else f"{first['input']!r:.60}; "
    return f"{path_of(first['loc'])}: {shown}{first['msg']}"


def parsed(text: bytes, where: str) -> dict[str, Any]:
    """JSON object that says that it is a project; raises `InvalidProject`."""
    try:
        value = json.loads(text.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InvalidProject(f"{where}: its manifest is no JSON: {error}") from None
    if not isinstance(value, dict) or value.get("format") != FORMAT:
        raise InvalidProject(f"{where}: its manifest does not say that it is a {FORMAT}")
    return value


def _unknown(value: Any, model: type[BaseModel]) -> list[tuple[str | int, ...]]:
    """Paths of keys that no schema knows, one level down as well."""
    found: list[tuple[str | int, ...]] = [(key,) for key in value if key not in model.model_fields]
    inner: dict[str, type[BaseModel]] = {
        "mesh": MeshEntry, "dense": DenseEntry, "quilt": QuiltEntry, "plan": PlanEntry,
        "samples": SampleEntry, "edits": EditEntry, "delta": DeltaEntry, "report": ReportEntry,
        "material": BtfManifest,
    }  # fmt: skip
    for key, each in inner.items():
        part = value.get(key) if key in model.model_fields else None
        if isinstance(part, dict):
            found += [(key, *path) for path in _unknown(part, each)]
        elif isinstance(part, list):
            for at, one in enumerate(part):
                found += [(key, at, *path) for path in _unknown(one, each)]
    return found
