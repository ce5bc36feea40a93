"""Numbers of a project checked against each other; what is wrong is a `ValueError` in words."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from btfcore.files.edits_schema import path_of
from btfcore.files.project import schema
from btfcore.quilt.layout import Borders, Layout
from btfcore.quilt.parameters import QuiltParameters
from btfcore.regions import Plan
from btfcore.types import Atlas, DenseMesh, Field, Mesh, Prepared

Arrays = Mapping[str, NDArray[Any]]


def surface(manifest: schema.ProjectManifest, mesh: Arrays, dense: Arrays) -> Prepared:
    """Return the prepared mesh after checking every index."""
    names = tuple(manifest.mesh.regions)
    vertices, faces, size = manifest.mesh.vertices, manifest.mesh.faces, manifest.dense.size
    count, wide = manifest.dense.vertices, manifest.dense.faces
    _within("faces of the mesh", mesh["faces"], 0, vertices - 1)
    _within("charts of the mesh", mesh["chart"], 0, faces - 1)
    region = mesh.get("region")
    if region is not None:
        _within("regions", region, 0, len(names) - 1)
    _within("faces of the dense mesh", dense["faces"], 0, count - 1)
    _within("texels", dense["texel"], 0, size - 1)
    _within("charts of the dense mesh", dense["chart"], 0, faces - 1)
    _within("input faces of the dense mesh", dense["face"], 0, faces - 1)
    if manifest.dense.grid_faces > wide:
        raise ValueError(f"{manifest.dense.grid_faces} faces inside charts, of {wide}")
    place = dense["texel"][:, 0].astype(np.int64) * size + dense["texel"][:, 1]
    taken = np.zeros(size * size, bool)
    taken[place] = True
    twice = len(place) - int(taken.sum())
    if twice:
        raise ValueError(f"{twice} texels belong to two vertices")
    for name in ("normals", "tangents"):
        length = np.sqrt((dense[name].astype(np.float64) ** 2).sum(axis=1))
        if not length.max() < 1.01:  # where triangles have no area they may be 0
            raise ValueError(f"{name} of length {length.max():g}, not 1")
    shape = Mesh(mesh["vertices"], mesh["faces"], region, names)
    return Prepared(
        shape,
        Atlas(shape, mesh["uv"], mesh["chart"], size),
        DenseMesh(
            dense["vertices"], dense["normals"], dense["faces"], dense["texel"], dense["chart"],
            dense["face"], dense["bary"], size, manifest.dense.grid_faces,
        ),
        Field(dense["tangents"], dense.get("singularities", np.zeros((0, 3)))),
    )  # fmt: skip


def parameters(entry: schema.ParametersEntry) -> QuiltParameters:
    """Knobs of the quilting; raises `InvalidParameter` for ranges, `ValueError` for kinds."""
    given = {name: value for name, value in entry.model_dump().items() if name in schema.KNOBS}
    try:  # by way of JSON, in which a tuple is a list
        return TypeAdapter(QuiltParameters).validate_json(json.dumps(given), strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = path_of(("parameters", *first["loc"]))
        raise ValueError(f"manifest field {where}: {first['msg']}") from None


def plan(manifest: schema.ProjectManifest) -> Plan | None:
    """Return the plan of the regions, where there is one."""
    entry = manifest.plan
    if entry is None:
        return None
    names = tuple(manifest.mesh.regions) or ("all",)
    if tuple(entry.names) != names or len(entry.sample) != len(names):
        raise ValueError(f"a plan of {len(entry.names)} regions, the mesh has {len(names)}")
    if not len(entry.files) == len(entry.scales) <= len(manifest.samples):
        raise ValueError(
            f"a plan of {len(entry.files)} files and {len(entry.scales)} scales for"
            f" {len(manifest.samples)} samples"
        )
    sample, pairs = np.array(entry.sample), np.array(entry.pairs, np.int64).reshape(-1, 2)
    # numbered without gaps: the quilt's layout needs each
    if not np.array_equal(np.unique(sample), np.arange(len(entry.files))):
        raise ValueError(f"regions name {len(np.unique(sample))} of {len(entry.files)} samples")
    _within("regions of a border", pairs, 0, len(names) - 1)
    if len(entry.kinds) != len(pairs):
        raise ValueError(f"{len(entry.kinds)} kinds of {len(pairs)} borders")
    return Plan(
        names, tuple(Path(file) for file in entry.files), tuple(entry.scales),
        tuple(entry.sample),
        Borders(entry.hard, pairs.astype(np.int32), np.array(entry.kinds, bool)),
        tuple(entry.notes),
    )  # fmt: skip


def names(manifest: schema.ProjectManifest) -> None:
    """Check that numbers given once are given once."""
    for what, given in (
        ("sample", [each.name for each in manifest.samples]),
        ("edit", [each.uid for each in manifest.edits]),
        ("delta", [each.delta.token for each in manifest.edits if each.delta is not None]),
    ):
        if len(set(given)) != len(given):
            raise ValueError(f"two of {len(given)} {what}s have the same name or number")
    for edit in manifest.edits:
        if edit.uid >= manifest.next_uid:
            raise ValueError(f"edit {edit.uid}, the next is to be {manifest.next_uid}")
        if edit.delta is not None and not 0 < edit.delta.token <= manifest.tokens:
            raise ValueError(f"delta {edit.delta.token} of {manifest.tokens}")


def quilt(manifest: schema.ProjectManifest, here: Arrays, layout: Layout | None) -> None:
    """Check the background's indices."""
    _within("patches", here["patch"], -1, manifest.quilt.patches - 1)
    _samples(here["sample"], manifest)
    if layout is not None:
        covered = np.flatnonzero(here["patch"] >= 0)
        mine = here["sample"][covered]
        _within("samples of regions", mine, 0, len(layout.allowed) - 1)
        strays = int((~layout.allowed[mine, covered]).sum())
        if strays:
            raise ValueError(f"{strays} vertices have a sample of another region")
    slots = here.get("ghost_slots")
    if slots is not None:
        _within("half-edges", slots, 0, manifest.quilt.half_edges - 1)


def edits(manifest: schema.ProjectManifest, here: Arrays) -> None:
    """Check the indices of the edits' values."""
    for prefix in ("", "before_"):
        if f"{prefix}patch" in here:
            _within("patches of edits", here[f"{prefix}patch"], -1, 2**31 - 1)
            _samples(here[f"{prefix}sample"], manifest)
    if "wanted" in here:
        _within("m_0", here["wanted"], 0, 1)
    for name in ("writers", "read_writers"):
        if name in here:
            _within(name, here[name], -1, 2**31 - 1)


def _samples(values: NDArray[Any], manifest: schema.ProjectManifest) -> None:
    _within("samples", values, 0, len(manifest.samples) - 1)


def _within(what: str, values: NDArray[Any], low: int, high: int) -> None:
    if values.size and not low <= values.min() <= values.max() <= high:
        raise ValueError(f"{what} {values.min()} … {values.max()}, outside {low} … {high}")
