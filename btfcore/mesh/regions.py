"""Regions of a mesh: by material, by part, by connected component, or by a file of labels."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from btfcore.errors import InvalidRegions
from btfcore.mesh.topology import components
from btfcore.types import I4, Frozen

WAYS = ("auto", "materials", "parts", "components")
NAMELESS = "(none)"  # faces that stand before the first material or group
_LARGEST_FILE = 1 << 28


@dataclass(frozen=True, eq=False)
class Regions(Frozen):
    """label (F,) i4: region of every face, 0 … R-1; names: what each is called."""

    label: I4
    names: tuple[str, ...]


def regions_of(
    way: str,
    material: I4,
    material_names: Sequence[str],
    part: I4,
    part_names: Sequence[str],
) -> Regions | None:
    """Regions (F,) by "materials" or "parts"; "auto" takes materials where there are several.

    material, part (F,) i4 index the names, -1 where a face has none. None where "auto" finds
    less than two of either. Names that occur twice are one region.
    """
    found = {
        "materials": _named(material, material_names),
        "parts": _named(part, part_names),
    }
    if way != "auto":
        return found[way]
    return next((each for each in found.values() if len(each.names) > 1), None)


def component_regions(faces: I4) -> Regions:
    """One region per connected component, named "1", "2", … from the one of most faces on."""
    label = components(faces)
    order = np.argsort(-np.bincount(label), kind="stable")
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order))
    return Regions(rank[label], tuple(str(index + 1) for index in range(len(order))))


def read_labels(path: Path, faces: int) -> Regions:
    """Read the labels of `faces` faces from a JSON or NPY file.

    JSON: a list of region names, or of whole numbers from 0 on; NPY: whole numbers. Regions
    are numbered in the order of their numbers, or as their names first appear. Raises
    `InvalidRegions` for a file that cannot be read, labels of another kind, negative ones,
    and another count than the mesh file's faces.
    """
    if path.suffix.lower() not in (".json", ".npy"):
        raise InvalidRegions(
            f"{path.name!r} tells no regions: labels end in .json or .npy, other ways are"
            f" {', '.join(WAYS)}"
        )
    try:
        size = path.stat().st_size
        if size > _LARGEST_FILE:
            raise InvalidRegions(
                f"{path.name}: the file has {size:,} bytes, up to {_LARGEST_FILE:,} are read"
            )
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        raise InvalidRegions(f"{path.name}: the labels cannot be opened: {error}") from error
    names = None
    if path.suffix.lower() == ".npy":
        labels = _npy(data, path.name)
    else:
        labels, names = _json(data, path.name)
    if len(labels) != faces:
        raise InvalidRegions(
            f"{path.name}: {len(labels):,} labels, but the mesh file has {faces:,} faces"
        )
    if len(labels) and labels.min() < 0:
        place = int(np.flatnonzero(labels < 0)[0])
        raise InvalidRegions(f"{path.name}: label {labels[place]} of face {place} is negative")
    if names is not None:
        return Regions(labels.astype(np.int32), names)
    values, index = np.unique(labels, return_inverse=True)
    return Regions(index.reshape(-1).astype(np.int32), tuple(str(value) for value in values))


def _named(index: I4, names: Sequence[str]) -> Regions:
    """Regions by name; equal names are one, and faces without get one of their own."""
    known: dict[str, int] = {}
    table = np.array(
        [known.setdefault(name or NAMELESS, len(known)) for name in (*names, NAMELESS)], np.int32
    )
    used, label = np.unique(table[index], return_inverse=True)
    called = list(known)
    return Regions(label.reshape(-1).astype(np.int32), tuple(called[each] for each in used))


def _npy(data: bytes, name: str) -> NDArray[np.int64]:
    try:
        values = npy.read_array(io.BytesIO(data), allow_pickle=False)
    except (ValueError, OSError, EOFError, MemoryError) as error:
        raise InvalidRegions(f"{name}: no array can be read: {error}") from error
    if values.ndim != 1 or values.dtype.kind not in "iu":
        raise InvalidRegions(
            f"{name}: an array of shape {values.shape} and type {values.dtype}, not (F,) of"
            " whole numbers"
        )
    if values.dtype.kind == "u" and len(values) and int(values.max()) > 2**62:
        raise InvalidRegions(f"{name}: label {values.max()} is too large")
    return values.astype(np.int64)


def _json(data: bytes, name: str) -> tuple[NDArray[np.int64], tuple[str, ...] | None]:
    try:
        values = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise InvalidRegions(f"{name}: this is no JSON: {error}") from error
    if not isinstance(values, list) or not values:
        raise InvalidRegions(f"{name}: not a list of one label per face")
    if all(type(value) is str for value in values):
        known: dict[str, int] = {}
        labels = [known.setdefault(value, len(known)) for value in values]
        return np.array(labels, np.int64), tuple(known)
    for place, value in enumerate(values):
        if type(value) is not int:
            raise InvalidRegions(
                f"{name}: label {str(value)[:40]!r} of face {place} is no whole number, and not"
                " all labels are names"
            )
        if abs(value) > 2**62:
            raise InvalidRegions(f"{name}: label {value} of face {place} is too large")
    return np.array(values, np.int64), None
