"""Reads a project; nothing in the file is trusted, and what is refused is refused by name."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from btfcore.errors import InvalidBtf, InvalidEdit, InvalidParameter, InvalidProject
from btfcore.files.edits_json import LARGEST as LARGEST_EDITS
from btfcore.files.edits_json import from_json as edits_from
from btfcore.files.package.container import Limits, Member, check_sum, members, read_member
from btfcore.files.package.tensors import LARGEST_HEADER, Tensor, parse
from btfcore.files.project import check, schema
from btfcore.files.project.changes import expected, scattered, shapes
from btfcore.files.project.layout import (
    DENSE,
    EDIT_ARRAYS,
    EDITS,
    MANIFEST,
    MESH,
    PREVIEW,
    QUILT,
    Arrays,
    Kinds,
    dense_kinds,
    material_from,
    mesh_kinds,
    netting,
    quilt_kinds,
    sample_kinds,
    sample_member,
)  # fmt: skip
from btfcore.files.project.value import Figures, Material, Project, StoredEdit
from btfcore.paint.edits import AnyEdit
from btfcore.patch.connectivity import Connectivity
from btfcore.progress import Progress, silent
from btfcore.quilt.layout import Layout
from btfcore.quilt.state import QuiltState
from btfcore.types import Sample

Netting = tuple[Layout | None, Connectivity]
LIMITS = Limits(members=2048, directory=1 << 19, error=InvalidProject, strict=True)
LARGEST_PREVIEW = 16 << 20
_PIECE = 1 << 24
_REFUSED = (".pkl", ".pickle", ".npy", ".npz", ".pt", ".pth", ".joblib", ".dill")


def read_project(path: str | Path, *, progress: Progress = silent) -> Project:
    """Read a project (.patina); every array is read once and compared with its checksum.

    Raises `InvalidProject`, beginning with the file's name, for anything that does not fit: the
    zip and its members' names, pickles, the manifest's schema and version, shapes that
    contradict it, indices out of range, numbers that are not finite, edits that make no sense.
    """
    path = Path(path)
    progress(0.0, "reading the project")
    try:
        return _Opened.of(path).project(progress)
    except MemoryError:
        raise InvalidProject(f"{path.name}: there is not enough memory to read it") from None
    except OSError as error:
        raise InvalidProject(f"{path.name}: cannot be read: {error.strerror or error}") from error


def verify(path: str | Path, known: Netting | None = None) -> None:
    """Read all of a project as `read_project` does, and compare every member's checksum.

    known : the layout and half-edges that its surface has, where they are at hand.
    """
    opened = _Opened.of(Path(path))
    for member in opened.found.values():
        check_sum(opened.path, member, LIMITS)
    opened.project(silent, known)


def project_token(path: str | Path) -> str:
    """Token of the save that a file came from; raises `InvalidProject`."""
    return _Opened.of(Path(path)).manifest.token


def project_preview(path: str | Path) -> bytes | None:
    """PNG that was saved with a project, not decoded; None without one, raises `InvalidProject`."""
    path = Path(path)
    member = members(path, LIMITS).get(PREVIEW)
    if member is None:
        return None
    return read_member(path, member, most=LARGEST_PREVIEW, limits=LIMITS)


def project_figures(path: str | Path) -> dict[str, object]:
    """Everything worth knowing about a project that its manifest tells; plain JSON."""
    opened = _Opened.of(Path(path))
    manifest, edits = opened.manifest, opened.edits()
    return {
        "written_by": manifest.written_by,
        "version": manifest.version,
        "save": manifest.token,
        "rate": manifest.dense.size,
        "faces": manifest.mesh.faces,
        "regions": manifest.mesh.regions,
        "vertices": manifest.dense.vertices,
        "patches": manifest.quilt.patches,
        "samples": [
            {
                "name": each.name, "width": each.width, "height": each.height,
                "channels": each.channels, "scale": each.scale, "feature": each.masked,
                "factors": each.rank or None, "file": each.file,
                "licence": "" if each.material is None else each.material.licence,
            }
            for each in manifest.samples
        ],
        "edits": [
            {
                "uid": one.uid, "name": edit.name, "visible": edit.visible,
                "changed": 0 if one.delta is None else one.delta.vertices,
            }
            for one, edit in zip(manifest.edits, edits, strict=True)
        ],
        "bytes": opened.path.stat().st_size,
        "notes": list(opened.notes),
    }  # fmt: skip


@dataclass(frozen=True)
class _Opened:
    """A project file whose members and manifest are checked."""

    path: Path
    found: dict[str, Member]
    manifest: schema.ProjectManifest
    notes: tuple[str, ...]

    @classmethod
    def of(cls, path: Path) -> _Opened:
        where = path.name
        try:
            if not path.is_file():  # a pipe would be waited for
                raise InvalidProject(f"{where}: there is no such file in {path.parent}")
        except (OSError, ValueError) as error:
            raise InvalidProject(f"{where!r:.200}: cannot be read: {error}") from error
        found = members(path, LIMITS)
        for member in found.values():
            _check_kind(path, member)
        if MANIFEST not in found:
            raise InvalidProject(f"{where}: no {MANIFEST} in it; this is no project")
        text = read_member(path, found[MANIFEST], most=schema.LARGEST_MANIFEST, limits=LIMITS)
        manifest, notes = schema.from_json(text, where)
        opened = cls(path, found, manifest, notes)
        known = {MANIFEST, PREVIEW, EDITS, *opened.kinds()}
        extra = sorted(set(found) - known)
        if extra:
            notes += (f"ignored {len(extra)} unknown members, the first is {extra[0][:80]!r}",)
        return replace(opened, notes=notes)

    def kinds(self) -> dict[str, tuple[Kinds, set[str]]]:
        """Arrays of every member, and which of them may be missing."""
        manifest = self.manifest
        out: dict[str, tuple[Kinds, set[str]]] = {
            MESH: (mesh_kinds(manifest), set()),
            DENSE: (dense_kinds(manifest), set()),
            QUILT: (quilt_kinds(manifest), set()),
            EDIT_ARRAYS: (shapes([each.delta for each in manifest.edits]), set()),
        }
        for at, entry in enumerate(manifest.samples):
            out[sample_member(at)] = sample_kinds(entry)
        return {
            name: ({key: each for key, each in kinds.items() if 0 not in each[1]}, optional)
            for name, (kinds, optional) in out.items()
        }

    def project(self, progress: Progress, known: Netting | None = None) -> Project:
        """Put the project together."""
        manifest = self.manifest
        arrays: dict[str, Arrays] = {}
        kinds = self.kinds()
        for at, (name, (wanted, optional)) in enumerate(kinds.items()):
            progress(0.6 * at / len(kinds), "reading the project")
            arrays[name] = self.load(name, wanted, optional)
        try:
            prepared = check.surface(manifest, arrays[MESH], arrays[DENSE])
            parameters = check.parameters(manifest.parameters)
            plan = check.plan(manifest)
            materials = tuple(
                self._material(entry, arrays[sample_member(at)])
                for at, entry in enumerate(manifest.samples)
            )
            check.names(manifest)
            progress(0.6, "joining neighbours")
            layout, net = known or netting(prepared, plan, parameters)
            background, edits = self._quilt(layout, net, arrays)
        except ValueError as error:
            raise InvalidProject(f"{self.path.name}: {error}") from None
        except (InvalidBtf, InvalidParameter, InvalidEdit) as error:
            raise InvalidProject(f"{self.path.name}: {error}") from None
        progress(1.0, "reading the project")
        return Project(
            prepared, parameters, materials, background, edits, manifest.next_uid,
            manifest.tokens, manifest.quilt.counter, plan, manifest.token, net, self.notes,
        )  # fmt: skip

    def _material(self, entry: schema.SampleEntry, arrays: Arrays) -> Material:
        colour = arrays["colour"]
        channels = arrays.get("channels", colour)
        sample = Sample(entry.title, colour, channels, entry.tiles, arrays.get("mask"))
        return Material(entry.name, sample, entry.scale, material_from(entry, arrays), entry.file)

    def _quilt(
        self, layout: Layout | None, net: Connectivity, arrays: dict[str, Arrays]
    ) -> tuple[QuiltState, tuple[StoredEdit, ...]]:
        manifest, here = self.manifest, arrays[QUILT]
        if len(net.indices) != manifest.quilt.half_edges:
            raise ValueError(
                f"a quilt of {manifest.quilt.half_edges:,} half-edges, the mesh has"
                f" {len(net.indices):,}"
            )
        check.quilt(manifest, here, layout)
        state = QuiltState(
            here["source"], here["patch"], np.zeros((len(net.indices), 2), np.float32),
            here["angle"], manifest.quilt.patches, here["sample"], layout,
        )  # fmt: skip
        slots = here.get("ghost_slots", np.zeros(0, np.int32))
        state.ghost[:] = expected(net, state)
        if len(slots):
            state.ghost[slots] = here["ghosts"]
        edits = self.edits()
        check.edits(manifest, arrays[EDIT_ARRAYS])
        entries = [
            (one.delta, edit.visible) for one, edit in zip(manifest.edits, edits, strict=True)
        ]
        stored = []
        for delta, edit, one in zip(
            scattered(net, state, entries, arrays[EDIT_ARRAYS]), edits, manifest.edits, strict=True
        ):
            stored.append(StoredEdit(replace(edit, uid=one.uid), delta, _figures(one.report)))
        return state, tuple(stored)

    def edits(self) -> list[AnyEdit]:
        """Edits as data, their samples numbered as the project's are."""
        if EDITS not in self.found:
            raise InvalidProject(f"{self.path.name}: member {EDITS!r} is missing")
        text = read_member(self.path, self.found[EDITS], most=LARGEST_EDITS, limits=LIMITS)
        try:
            script = edits_from(text)
            names = [each.name for each in self.manifest.samples]
            script.check_names(names)
        except InvalidEdit as error:
            raise InvalidProject(f"{self.path.name}: {EDITS}: {error}") from None
        if len(script.edits) != len(self.manifest.edits):
            raise InvalidProject(
                f"{self.path.name}: {len(script.edits)} edits, the manifest lists"
                f" {len(self.manifest.edits)}"
            )
        out: list[AnyEdit] = []
        for each in script.edits:
            number = getattr(each, "sample", None)
            known = {} if number is None else {"sample": names.index(script.names[number])}
            out.append(replace(each, **known))  # type: ignore[arg-type]
        return out

    # --- arrays

    def table(self, name: str, wanted: Kinds, optional: set[str]) -> dict[str, Tensor]:
        """Where the arrays of a member lie, after checking that they are those `wanted`."""
        member, where = self.found.get(name), f"{self.path.name}: {name}"
        if member is None:
            if not set(wanted) - optional:
                return {}
            raise InvalidProject(f"{self.path.name}: member {name!r} is missing")
        with self.path.open("rb") as stream:
            stream.seek(member.start)
            head = stream.read(min(member.size, LARGEST_HEADER + 8))
        table, start = parse(head, member.size, where, InvalidProject)
        for key, (dtype, shape) in wanted.items():
            if key not in table:
                if key in optional:
                    continue
                raise InvalidProject(f"{where}: tensor {key!r} is missing")
            found = table[key]
            short = dtype == np.float32 and found.dtype == np.float16
            if found.shape != shape or (found.dtype != dtype and not short):
                raise InvalidProject(
                    f"{where}: tensor {key!r} is {found.dtype} of shape {found.shape}, not"
                    f" {dtype} of {shape}"
                )
        unknown = sorted(set(table) - set(wanted))
        if unknown:
            raise InvalidProject(f"{where}: unknown tensor {unknown[0][:80]!r}")
        return {
            key: replace(each, start=each.start + start)
            for key, each in sorted(table.items(), key=lambda item: item[1].start)
        }

    def load(self, name: str, wanted: Kinds, optional: set[str]) -> Arrays:
        """Read a member's arrays, each into memory of its own, and compare the checksum."""
        table = self.table(name, wanted, optional)
        if not table:
            return {}
        member, out = self.found[name], Arrays()
        with self.path.open("rb") as stream:
            stream.seek(member.start)
            crc = zlib.crc32(stream.read(min(each.start for each in table.values())))
            for key, tensor in table.items():
                values = np.empty(tensor.shape, tensor.dtype)
                view = memoryview(values.reshape(-1).view(np.uint8).data)
                for begin in range(0, len(view), _PIECE):
                    piece = view[begin : begin + _PIECE]
                    if stream.readinto(piece) != len(piece):
                        raise InvalidProject(f"{self.path.name}: {name} is cut off")
                    crc = zlib.crc32(piece, crc)
                out[key] = values
        if crc != member.crc:
            raise InvalidProject(f"{self.path.name}: {name} is damaged: its checksum does not fit")
        for key, values in out.items():
            if values.dtype.kind == "f" and not np.isfinite(values).all():
                wrong = int((~np.isfinite(values)).sum())
                raise InvalidProject(
                    f"{self.path.name}: {name}: {wrong:,} values of {key!r} are not finite"
                )
            out[key] = values.astype(wanted[key][0], copy=False)
        return out


def _figures(report: schema.ReportEntry | None) -> Figures | None:
    if report is None:
        return None
    return {
        name: tuple(value) if isinstance(value, list) else np.nan if value is None else value
        for name, value in report.model_dump().items()
    }


def _check_kind(path: Path, member: Member) -> None:
    """Refuse pickles and archives inside the project, whatever they are called."""
    where = f"{path.name}: member {member.name[:80]!r}"
    if member.name.lower().endswith(_REFUSED):
        raise InvalidProject(f"{where} may hold pickled objects; a project has none")
    with path.open("rb") as stream:
        stream.seek(member.start)
        head = stream.read(min(8, member.size))
    # a tensor file begins with its header's length, whose upper bytes are 0
    if head[:1] == b"\x80" and head[1:2] in b"\x02\x03\x04\x05" and head[2:8] != bytes(6):
        raise InvalidProject(f"{where} is a pickle; a project has none")
    if head[:6] == b"\x93NUMPY" or head[:4] in (b"PK\3\4", b"PK\5\6", b"\x1f\x8b\x08\x08"):
        raise InvalidProject(f"{where} is an archive or array file of another kind")
