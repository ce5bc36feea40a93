"""The schema of an edits file: every knob of `btfcore.paint.edits`, checked field by field."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

FORMAT = "patina-edits"
VERSION = 1
MOST_EDITS = 32_000
MOST_POINTS = 100_000
MOST_INDICES = 1 << 26
LONGEST_NAME = 4096
_SHOWN = 60  # characters of a wrong value that a message shows

_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
_Point = Annotated[list[_Finite], Field(min_length=3, max_length=3)]
_Points = Annotated[list[_Point], Field(min_length=1, max_length=MOST_POINTS)]
_Shares = Annotated[list[_Share], Field(min_length=1, max_length=MOST_POINTS)]
_Index = Annotated[int, Field(ge=0, lt=2**31)]
_Indices = Annotated[list[_Index], Field(min_length=1, max_length=MOST_INDICES)]
_Name = Annotated[str, Field(min_length=1, max_length=256)]
_File = Annotated[str, Field(min_length=1, max_length=4096)]
_Scale = Annotated[float, Field(ge=0.01, le=100)]
_Seed = Annotated[int, Field(ge=0, lt=2**32)]
_Weight = Annotated[float, Field(ge=0, le=1e3, description="λ of the constraint energy")]


class _Entry(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid")


class StrokeEntry(_Entry):
    """One movement of the brush; points and radius in world units."""

    points: _Points
    radius: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    normals: _Points | None = None
    pressure: _Shares | None = None
    hardness: _Share = 1.0


class AreaEntry(_Entry):
    """Where an edit applies: the union of its parts."""

    strokes: Annotated[list[StrokeEntry], Field(max_length=MOST_POINTS)] = []
    faces: _Indices | None = None
    region: _Name | None = None
    everywhere: bool = False
    vertices: _Indices | None = None
    rate: Annotated[int, Field(ge=1, lt=2**31)] | None = None


class SymmetryEntry(_Entry):
    """Images that are made along with an edit."""

    mirror: Annotated[str, Field(max_length=3, pattern="^[xyz]*$")] = ""
    radial: Annotated[int, Field(ge=1, le=64)] = 1
    axis: Literal["x", "y", "z"] = "y"
    origin: _Point | None = None


class _Edit(_Entry):
    name: Annotated[str, Field(max_length=LONGEST_NAME)] = ""
    visible: bool = True
    seed: _Seed = 0
    symmetry: SymmetryEntry = SymmetryEntry()


class PaintEntry(_Edit):
    """Foreground synthesis of a sample's feature over an area."""

    kind: Literal["paint"]
    sample: _Name
    area: AreaEntry
    weight: _Weight = 0.5
    transition: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    orientation: Literal["auto", "field", "search", "stroke"] = "auto"
    protect: bool = True
    work_patch: Annotated[int, Field(ge=4, le=200)] | None = None


class StampEntry(_Edit):
    """Verbatim copy of a sample's feature."""

    kind: Literal["stamp"]
    sample: _Name
    point: _Point
    normal: _Point | None = None
    rotation: Annotated[float, Field(ge=-1e6, le=1e6)] = 0.0
    scale: Annotated[float, Field(ge=0.05, le=20)] = 1.0
    feature: _Index | None = 0
    weight: _Weight = 0.5
    protect: bool = True


class EraseEntry(_Edit):
    """Bring the background back."""

    kind: Literal["erase"]
    area: AreaEntry


class RepairEntry(_Edit):
    """Synthesise an area anew."""

    kind: Literal["repair"]
    area: AreaEntry
    protect: bool = True


class RequiltEntry(_Edit):
    """Cut the seams in an area again."""

    kind: Literal["requilt"]
    area: AreaEntry
    tries: Annotated[int, Field(ge=1, le=10_000)] = 12


AnyEntry = PaintEntry | StampEntry | EraseEntry | RepairEntry | RequiltEntry
ENTRIES: dict[str, type[AnyEntry]] = {
    "paint": PaintEntry,
    "stamp": StampEntry,
    "erase": EraseEntry,
    "repair": RepairEntry,
    "requilt": RequiltEntry,
}


class SampleEntry(_Entry):
    """A sample to paint with; paths are relative to the edits file."""

    file: _File
    mask: _File | None = None
    flat: bool = False
    scale: _Scale = 1.0


class BackgroundEntry(_Entry):
    """The sample that covers a bare mesh; features of its mask are left out."""

    sample: _File
    mask: _File | None = None
    flat: bool = False
    scale: _Scale = 1.0
    seed: _Seed = 0


class FileEntry(_Entry):
    """A file of edits, to be made in the order given."""

    format: Literal["patina-edits"]
    version: Literal[1]
    background: BackgroundEntry | None = None
    samples: Annotated[dict[_Name, SampleEntry], Field(max_length=1000)] = {}
    edits: Annotated[
        list[Annotated[AnyEntry, Field(discriminator="kind")]], Field(max_length=MOST_EDITS)
    ] = []


_PARTS: dict[str, type[BaseModel]] = {
    "area": AreaEntry,
    "strokes": StrokeEntry,
    "symmetry": SymmetryEntry,
    "background": BackgroundEntry,
    "samples": SampleEntry,
}


def told(detail: Any) -> str:
    """One sentence of a pydantic error: the field by its path, the value, what it should be."""
    loc = list(detail["loc"])
    model: type[BaseModel] = FileEntry
    parts: list[str | int] = []
    for place, part in enumerate(loc):
        if place == 2 and loc[0] == "edits" and part in ENTRIES:
            model = ENTRIES[str(part)]  # the kind, which pydantic puts into the path
            continue
        if isinstance(part, str) and part in _PARTS:
            model = _PARTS[part]
        parts.append(part)
    where, value = path_of(parts), detail.get("input")
    kind = detail["type"]
    if kind == "extra_forbidden":
        return f"{where}: there is no such field{nearest(str(parts[-1]), model.model_fields)}"
    if kind == "missing":
        return f"{where}: it is missing"
    if kind == "union_tag_not_found":
        return f"{where}.kind: it is missing; there are {', '.join(ENTRIES)}"
    if kind == "union_tag_invalid":
        name = str(detail["ctx"]["tag"])
        return f"{where}.kind: {name[:_SHOWN]!r}; there are {', '.join(ENTRIES)}" + nearest(
            name, ENTRIES
        )
    text = str(detail["msg"]).replace("Input should be", "it should be")
    return f"{where}: {_shown(value)}; {text}"


def path_of(parts: Sequence[str | int]) -> str:
    """Return a path in the form edits[2].area.strokes[0].pressure[5]."""
    text = ""
    for part in parts:
        text += f"[{part}]" if isinstance(part, int) else f".{part[:_SHOWN]}"
    return text.removeprefix(".") or "the file"


def nearest(name: str, known: Any) -> str:
    """Say which of the names `known` may be meant, or all of them."""
    names = list(known)
    close = difflib.get_close_matches(name[:256], names, n=1)
    return f"; {close[0]!r} is meant?" if close else f"; there are {', '.join(names[:20])}"


def _shown(value: Any) -> str:
    if isinstance(value, (list, dict)):
        what = "list" if isinstance(value, list) else "object"
        return f"{what} of {len(value):,}"
    text = repr(value)
    return text if len(text) <= _SHOWN else text[:_SHOWN] + "…"
