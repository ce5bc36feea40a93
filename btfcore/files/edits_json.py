"""Edits as a JSON file: a script that paints without a window.

See docs/edits.md for the format and docs/edits.schema.json for its JSON Schema.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from btfcore.errors import InvalidEdit
from btfcore.files.edits_schema import (
    ENTRIES,
    FORMAT,
    LONGEST_NAME,
    VERSION,
    AreaEntry,
    FileEntry,
    nearest,
    told,
)
from btfcore.paint.edits import KINDS, AnyEdit, Area, Edit, Stroke, Symmetry, kind_of

LARGEST = 128 << 20
BACKGROUND = "background"  # by this name edits call the background's sample
_ELSEWHERE = re.compile(r"^(//|\\\\|[A-Za-z][A-Za-z0-9+.-]+:)")  # hosts and URLs, not C:


@dataclass(frozen=True)
class Source:
    """Where a sample comes from: its name, files, whether it is flat-fielded, its scale.

    drawn : (H, W) f4 in 0–1, a mask that lies in no file; it goes before `mask`.
    """

    name: str
    file: Path
    mask: Path | None = None
    flat: bool = False
    scale: float = 1.0
    drawn: NDArray[np.float32] | None = field(default=None, compare=False)


@dataclass(frozen=True, eq=False)
class Script:
    """What an edits file holds.

    edits: their `sample` is an index into `names`; names: of all samples that edits call, those
    in `sources` being brought by the file itself; seed: of the background's synthesis; where:
    name of the file.
    """

    edits: tuple[AnyEdit, ...]
    names: tuple[str, ...] = ()
    background: Source | None = None
    seed: int = 0
    sources: tuple[Source, ...] = ()
    where: str = ""

    def place(self, at: int) -> str:
        """How a message calls one of the edits."""
        return f"{self.where}: edits[{at}]" if self.where else f"edits[{at}]"

    def check_names(self, known: Sequence[str]) -> None:
        """Raise `InvalidEdit` where an edit calls a sample that is neither here nor `known`."""
        names = (*known, *(each.name for each in self.sources))
        for at, edit in enumerate(self.edits):
            number = getattr(edit, "sample", None)
            if number is not None and self.names[number] not in names:
                name = self.names[number]
                raise InvalidEdit(
                    f"{self.place(at)}.sample: there is no sample {name!r}{nearest(name, names)}"
                )

    def check_files(self) -> None:
        """Raise `InvalidEdit` where a file that the script brings is not there."""
        given = [("background", self.background)] if self.background is not None else []
        given += [(f"samples.{each.name}", each) for each in self.sources]
        for where, source in given:
            for what, file in (("file", source.file), ("mask", source.mask)):
                if file is not None and not file.exists():
                    what = "sample" if (where, what) == ("background", "file") else what
                    place = f"{self.where}: " if self.where else ""
                    raise InvalidEdit(f"{place}{where}.{what}: there is no file {file}")


def read_edits(path: str | Path) -> Script:
    """Read an edits file; paths in it are taken from its folder.

    Raises `InvalidEdit`, naming the file, the field by its path, and the value.
    """
    path = Path(path)
    try:
        if not path.is_file():
            raise InvalidEdit(f"{path}: there is no such file")
        size = path.stat().st_size
        if size > LARGEST:
            raise InvalidEdit(f"{path.name}: {size:,} bytes, up to {LARGEST:,} are read")
        with path.open("rb") as stream:
            data = stream.read(LARGEST + 1)
    except (OSError, ValueError) as error:
        raise InvalidEdit(f"{str(path)!r}: cannot be read: {error}") from error
    try:
        return replace(from_json(data, path.parent), where=path.name)
    except InvalidEdit as error:
        raise InvalidEdit(f"{path.name}: {error}") from None


def from_json(data: bytes, folder: Path = Path()) -> Script:
    """Read the text of an edits file; raises `InvalidEdit`."""
    if len(data) > LARGEST:
        raise InvalidEdit(f"{len(data):,} bytes of edits, up to {LARGEST:,} are read")
    try:
        value = json.loads(data.decode("utf-8-sig"), object_pairs_hook=_once)
    except (ValueError, RecursionError) as error:
        raise InvalidEdit(f"this is no JSON: {error}") from None
    if not isinstance(value, dict) or value.get("format") != FORMAT:
        raise InvalidEdit(f'format: the file does not begin with "format": "{FORMAT}"')
    version = value.get("version")
    if type(version) is not int or version < 1:  # True is no number of a version
        raise InvalidEdit(f"version: {version!r:.60}; it should be {VERSION}")
    if version > VERSION:
        raise InvalidEdit(f"version: {version} is newer than {VERSION}, the newest that is read")
    try:
        entry = FileEntry.model_validate(value)
    except (ValidationError, RecursionError) as error:
        if isinstance(error, RecursionError):
            raise InvalidEdit("the file is nested too deeply") from None
        details = error.errors(include_url=False)
        # a misspelt field is also a missing one: tell of the spelling
        details.sort(key=lambda each: each["type"] != "extra_forbidden")
        more = f" (and {len(details) - 1} more)" if len(details) > 1 else ""
        raise InvalidEdit(told(details[0]) + more) from None
    return _script(entry, folder)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Object of `pairs`; a key given twice would lose one of its values in silence."""
    found = dict(pairs)
    if len(found) != len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {twice[:60]!r} is given twice in one object")
    return found


def _script(entry: FileEntry, folder: Path) -> Script:
    background, seed = None, 0
    if entry.background is not None:
        given = entry.background
        background = Source(
            BACKGROUND, _file(folder, given.sample, "background.sample"),
            None if given.mask is None else _file(folder, given.mask, "background.mask"),
            given.flat, given.scale,
        )  # fmt: skip
        seed = given.seed
    sources = []
    for name, sample in entry.samples.items():
        if name == BACKGROUND:
            raise InvalidEdit(f"samples.{name}: that is the background's own name")
        mask = None
        if sample.mask is not None:
            mask = _file(folder, sample.mask, f"samples.{name}.mask")
        file = _file(folder, sample.file, f"samples.{name}.file")
        sources.append(Source(name, file, mask, sample.flat, sample.scale))
    names: dict[str, int] = {}
    edits = [edit_of(each, f"edits[{at}]", names) for at, each in enumerate(entry.edits)]
    return Script(tuple(edits), tuple(names), background, seed, tuple(sources))


def _file(folder: Path, name: str, where: str) -> Path:
    if _ELSEWHERE.match(name) or "\0" in name:
        raise InvalidEdit(f"{where}: {name[:60]!r} is no path of a file on this machine")
    return folder / name


def edit_of(entry: Any, where: str, names: dict[str, int]) -> AnyEdit:
    """Edit of a checked entry; its sample's name is put into `names` (name → number)."""
    knobs: dict[str, Any] = {}
    kind = KINDS[entry.kind]
    for name in (item.name for item in fields(kind) if item.name != "uid"):
        value = getattr(entry, name)
        if name == "sample":
            value = names.setdefault(value, len(names))
        elif name == "area":
            value = _area(value, f"{where}.area")
        elif name == "symmetry":
            origin = None if value.origin is None else tuple(value.origin)
            with _At(f"{where}.symmetry"):
                value = Symmetry(value.mirror, value.radial, value.axis, origin)
        elif name in ("point", "normal") and value is not None:
            value = tuple(value)
        knobs[name] = value
    with _At(where):
        return kind(**knobs)


class _At:
    """Puts a path before the errors raised inside."""

    def __init__(self, where: str) -> None:
        self._where = where

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if isinstance(error, InvalidEdit) and not str(error).startswith("edits["):
            raise InvalidEdit(f"{self._where}: {error}") from None


def _area(entry: AreaEntry, where: str) -> Area:
    strokes = []
    for at, each in enumerate(entry.strokes):
        with _At(f"{where}.strokes[{at}]"):
            strokes.append(
                Stroke(
                    np.array(each.points, np.float64), each.radius, _reals(each.normals),
                    _reals(each.pressure), each.hardness,
                )
            )  # fmt: skip
    with _At(where):
        return Area(
            tuple(strokes), _whole(entry.faces), entry.region, entry.everywhere,
            _whole(entry.vertices), entry.rate,
        )  # fmt: skip


def _reals(values: Any) -> NDArray[np.float64] | None:
    return None if values is None else np.array(values, np.float64)


def _whole(values: list[int] | None) -> NDArray[np.int32] | None:
    return None if values is None else np.array(values, np.int32)


def to_json(script: Script, folder: Path | None = None) -> bytes:
    """Text of an edits file that reads back as the same edits, every bit of every number.

    folder: where the file will lie; paths inside it are written relative to it. Raises
    `InvalidEdit` where the file would be larger than is read.
    """
    out: dict[str, Any] = {"format": FORMAT, "version": VERSION}
    if script.background is not None:
        given = _sample(script.background, folder)
        out["background"] = {"sample": given.pop("file"), **given, "seed": script.seed}
    out["samples"] = {each.name: _sample(each, folder) for each in script.sources}
    out["edits"] = [entry_of(each, script.names) for each in script.edits]
    try:
        text = json.dumps(out, ensure_ascii=False, allow_nan=False, separators=(",", ": "))
    except ValueError as error:
        raise InvalidEdit(f"an edit has a number that is not finite: {error}") from None
    data = text.encode("utf-8", "replace")
    if len(data) > LARGEST:
        raise InvalidEdit(f"{len(data):,} bytes of edits, up to {LARGEST:,} can be stored")
    return data


def _sample(source: Source, folder: Path | None) -> dict[str, Any]:
    def name(path: Path | None) -> str | None:
        if path is None:
            return None
        if folder is not None and path.is_relative_to(folder):
            path = path.relative_to(folder)
        return path.as_posix()

    return {
        "file": name(source.file), "mask": name(source.mask), "flat": source.flat,
        "scale": source.scale,
    }  # fmt: skip


def entry_of(edit: Edit, names: Sequence[str]) -> dict[str, Any]:
    """JSON values of an edit; its sample by name."""
    kind = kind_of(edit)
    out: dict[str, Any] = {"kind": kind}
    for name in ENTRIES[kind].model_fields:
        if name != "kind":
            value = getattr(edit, name)
            out[name] = names[value] if name == "sample" else _plain(value)
    out["name"] = out["name"][:LONGEST_NAME]
    return out


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist() or None
    if isinstance(value, (Area, Stroke, Symmetry)):
        return {item.name: _plain(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    if isinstance(value, np.generic):
        return value.item()
    return value


def schema_text() -> str:
    """Text of docs/edits.schema.json."""
    schema = FileEntry.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "Patina edits"
    return json.dumps(schema, indent=1, ensure_ascii=False, sort_keys=True) + "\n"
