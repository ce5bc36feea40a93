"""Writes a project as one file; whatever interrupts it, the old file or the new one is whole."""

from __future__ import annotations

import secrets
import zipfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from btfcore import __version__
from btfcore.errors import InvalidParameter, InvalidProject, OutputFailed, ProjectChanged
from btfcore.files.atomic import verified_output
from btfcore.files.edits_json import Script
from btfcore.files.edits_json import to_json as edits_text
from btfcore.files.package.container import add_member
from btfcore.files.package.tensors import chunks, header, kinds
from btfcore.files.package.write import manifest_of
from btfcore.files.png import encode_png
from btfcore.files.project import schema
from btfcore.files.project.changes import AFTER, gathered, odd_ghosts
from btfcore.files.project.layout import (
    DENSE,
    EDIT_ARRAYS,
    EDITS,
    MANIFEST,
    MESH,
    PREVIEW,
    QUILT,
    material_of,
    netting,
    sample_member,
)  # fmt: skip
from btfcore.files.project.read import project_token, verify
from btfcore.files.project.value import Material, Project
from btfcore.patch.connectivity import Connectivity
from btfcore.progress import Progress, silent
from btfcore.regions import Plan

SUFFIX = ".patina"
BACKUP = ".bak"
_DENSE = ("vertices", "normals", "faces", "texel", "chart", "face", "bary")
Arrays = dict[str, NDArray[Any]]


def write_project(
    path: str | Path,
    project: Project,
    *,
    preview: NDArray[np.uint8] | None = None,
    expected: str | None = None,
    progress: Progress = silent,
) -> str:
    """Write `project` under `path` and return the new token of its save.

    The bytes go to a temporary file beside it, which is synced, opened again and verified; the
    older file becomes NAME.patina.bak, and the new one takes its place. preview : (h, w, 3) u8
    sRGB picture. expected : token of the project that was opened; where the file on disk has
    another one by now, `ProjectChanged` is raised and nothing is written. Raises
    `InvalidParameter` for another suffix, `OutputFailed` where the file cannot be written or
    does not read back, `InvalidEdit` where the edits are more than a project holds.
    """
    path = Path(path)
    if path.suffix.lower() != SUFFIX:
        raise InvalidParameter(f"{path.name}: a project ends in {SUFFIX}")
    _check_unchanged(path, expected)
    progress(0.0, "saving")
    token = secrets.token_hex(16)
    layout, net = project.background.layout, project.net
    if net is None:
        layout, net = netting(project.prepared, project.plan, project.parameters)
    try:
        manifest, arrays = _contents(project, net, token)
    except ValidationError as error:
        raise OutputFailed(f"cannot write {path}: its {schema.told(error)}") from None
    edits = edits_text(
        Script(
            tuple(each.edit for each in project.edits),
            tuple(each.name for each in project.materials),
        )
    )
    text = schema.to_json(manifest)
    if len(text) > schema.LARGEST_MANIFEST:
        raise OutputFailed(f"cannot write {path}: a manifest of {len(text):,} bytes")

    def check(file: Path) -> None:
        progress(0.8, "verifying")
        try:
            verify(file, (layout, net))
        except InvalidProject as error:
            raise OutputFailed(f"cannot write {path}: it does not read back: {error}") from None
        _check_unchanged(path, expected)

    with verified_output(path, check, backup=path.name + BACKUP) as handle:
        with zipfile.ZipFile(handle, "w") as archive:
            add_member(archive, handle, MANIFEST, len(text), [text])
            if preview is not None:
                png = encode_png(preview)
                add_member(archive, handle, PREVIEW, len(png), [png])
            add_member(archive, handle, EDITS, len(edits), [edits])
            for at, (name, each) in enumerate(arrays.items()):
                progress(0.1 + 0.7 * at / len(arrays), "saving")
                _add_arrays(archive, handle, name, each)
    return token


def _check_unchanged(path: Path, expected: str | None) -> None:
    if expected is None or not path.exists():
        return
    try:
        found = project_token(path)
    except InvalidProject as error:
        raise ProjectChanged(f"{path}: on disk there is another file now: {error}") from None
    if found != expected:
        raise ProjectChanged(
            f"{path} was saved by another Patina since it was opened here (save"
            f" {found[:8]}, not {expected[:8]}); save under another name to keep both"
        )


def _add_arrays(
    archive: zipfile.ZipFile, handle: BinaryIO, name: str, arrays: Mapping[str, NDArray[Any]]
) -> None:
    # widest numbers first, so that all lie aligned; empty arrays are left out
    order = sorted(arrays, key=lambda key: -arrays[key].dtype.itemsize)
    kept = {key: arrays[key] for key in order if arrays[key].size}
    head = header(kinds(kept))
    size = len(head) + sum(each.nbytes for each in kept.values())
    if kept:
        add_member(archive, handle, name, size, [head, *chunks(kept.values())])


def _contents(
    project: Project, net: Connectivity, token: str
) -> tuple[schema.ProjectManifest, dict[str, Arrays]]:
    """Return the manifest, and the arrays of every member."""
    prepared, quilt = project.prepared, project.background
    mesh, atlas, dense = prepared.mesh, prepared.atlas, prepared.dense
    if len(net.indices) != len(quilt.ghost):
        raise InvalidParameter(
            f"a quilt of {len(quilt.ghost)} half-edges, the mesh and its plan have"
            f" {len(net.indices)}"
        )
    slots, ghosts = odd_ghosts(net, quilt)
    deltas, changes = gathered(net, quilt, project.edits)
    members: dict[str, Arrays] = {
        MESH: {
            "vertices": mesh.vertices, "faces": mesh.faces, "uv": atlas.uv, "chart": atlas.chart,
            **({} if mesh.region is None else {"region": mesh.region}),
        },
        DENSE: {
            **{name: getattr(dense, name) for name in _DENSE},
            "tangents": prepared.field.tangents, "singularities": prepared.field.singularities,
        },
        QUILT: {
            **{name: getattr(quilt, name) for name in AFTER}, "ghost_slots": slots,
            "ghosts": ghosts,
        },
        EDIT_ARRAYS: changes,
    }  # fmt: skip
    samples = []
    for at, material in enumerate(project.materials):
        entry, members[sample_member(at)] = _sample(material)
        samples.append(entry)
    edits = [
        schema.EditEntry(
            uid=each.edit.uid, delta=delta,
            report=None if each.figures is None else schema.ReportEntry(
                **{name: _plain(value) for name, value in each.figures.items()}
            ),
        )
        for each, delta in zip(project.edits, deltas, strict=True)
    ]  # fmt: skip
    manifest = schema.ProjectManifest(
        format=schema.FORMAT,  # type: ignore[arg-type]
        version=schema.VERSION,  # type: ignore[arg-type]
        token=token,
        written_by=f"patina {__version__}",
        mesh=schema.MeshEntry(
            vertices=len(mesh.vertices), faces=len(mesh.faces),
            regions=list(mesh.region_names), labelled=mesh.region is not None,
        ),
        dense=schema.DenseEntry(
            vertices=len(dense.vertices), faces=len(dense.faces), grid_faces=int(dense.grid_faces),
            size=int(dense.size), singularities=len(prepared.field.singularities),
        ),
        parameters=schema.ParametersEntry(
            **{name: _plain(value) for name, value in asdict(project.parameters).items()}
        ),
        quilt=schema.QuiltEntry(
            patches=int(quilt.patches), counter=int(project.patches), half_edges=len(net.indices),
            ghosts=len(slots),
        ),
        samples=samples,
        plan=None if project.plan is None else _plan(project.plan),
        edits=edits,
        next_uid=project.next_uid,
        tokens=project.tokens,
    )  # fmt: skip
    return manifest, members


def _plain(value: Any) -> Any:
    """JSON value of a figure or knob; None for what is not a number."""
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _plan(plan: Plan) -> schema.PlanEntry:
    return schema.PlanEntry(  # files without their folders, which are nobody's business
        names=list(plan.names), files=[file.name for file in plan.files],
        scales=[float(scale) for scale in plan.scales], sample=[int(each) for each in plan.sample],
        hard=plan.borders.hard, pairs=plan.borders.pairs.tolist(),
        kinds=plan.borders.kinds.tolist(), notes=list(plan.notes),
    )  # fmt: skip


def _sample(material: Material) -> tuple[schema.SampleEntry, Arrays]:
    sample = material.sample
    height, width, channels = sample.channels.shape
    arrays: Arrays = {"colour": sample.colour}
    if not np.array_equal(sample.channels, sample.colour):  # a picture is compared by its colours
        arrays["channels"] = sample.channels
    if sample.mask is not None:
        arrays["mask"] = sample.mask
    btf, rank = material.btf, 0
    if btf is not None and btf.factors is None and not btf.is_image:
        btf = None  # thousands of images do not travel with a project
    if btf is not None:
        if btf.factors is not None:
            rank = btf.factors.rank
        arrays |= material_of(btf)
    entry = schema.SampleEntry(
        name=material.name, title=sample.name[:4096], height=height, width=width,
        channels=channels, tiles=sample.tiles, masked=sample.mask is not None,
        scale=float(material.scale), file=material.file[:4096],
        material=None if btf is None else manifest_of(btf, btf.factors), rank=rank,
    )  # fmt: skip
    return entry, {name: _shortest(array) for name, array in arrays.items()}


def _shortest(array: NDArray[Any]) -> NDArray[Any]:
    """Return f4 values as f2 where every bit survives, as those from a package do."""
    if array.dtype != np.float32:
        return array
    with np.errstate(over="ignore"):
        short = array.astype(np.float16)
    same = np.array_equal(short.astype(np.float32).view(np.uint32), array.view(np.uint32))
    return short if same else array
