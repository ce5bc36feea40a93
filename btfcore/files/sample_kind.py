"""Finds out which kind of sample a path holds, and where in a folder or zip it lies."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from btfcore.btf.readers.decode import IMAGES
from btfcore.btf.readers.entries import Entry
from btfcore.btf.readers.listing import FileSet, list_files
from btfcore.btf.readers.pbr_names import grouped
from btfcore.errors import InvalidBtf

WORDS = {
    "package": "package",
    "bonn": "Bonn file",
    "ptm": "PTM",
    "named": "images named by their angles",
    "table": "images with a table of directions",
    "pbr": "PBR set",
    "image": "image",
}
_FILES = {".btfz": "package", ".btf": "bonn", ".ptm": "ptm"}
_TABLES, _DIRECTIONS = (".lp", ".csv"), "directions.csv"
_LAYERS = (".png", ".jpg", ".jpeg")
_ANGLE = re.compile(r"(?<![a-z])(tl|pl|tv|pv)[ _-]?\d", re.IGNORECASE)
_LISTED = 8


@dataclass(frozen=True)
class Found:
    """A sample: its kind (a key of `WORDS`), and the file or folder that its reader is given."""

    kind: str
    path: Path


@dataclass(frozen=True)
class _Candidate:
    """Something in a folder that may be meant: its kind, folder ("" or "…/") and name there."""

    kind: str
    folder: str
    name: str = ""

    @property
    def words(self) -> str:
        """What to call it in a message."""
        return f"{(self.folder + self.name).rstrip('/') or 'its own files'} ({WORDS[self.kind]})"


def find_sample(path: Path) -> Found:
    """Tell by content and names what `path` holds.

    In a folder or zip one sample must be found, at whatever depth; a single package, Bonn, PTM
    or image file in a folder counts as one. Raises `InvalidBtf`, beginning with the name of
    `path`, where there is nothing, several samples (they are listed) or one among other folders
    of images, and what reading a damaged or hostile zip's directory raises.
    """
    try:
        if not path.exists():
            raise InvalidBtf(f"{path.name}: there is no such file or folder in {path.parent}")
        head = b"" if path.is_dir() else _head(path)
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        raise InvalidBtf(f"{path.name!r}: cannot be opened: {error}") from error
    suffix = path.suffix.lower()
    if head[:4] == b"PK\3\4" and (suffix == ".btfz" or head[30:43] == b"manifest.json"):
        return Found("package", path)
    if path.is_dir() or head[:4] in (b"PK\3\4", b"PK\5\6") or suffix == ".zip":
        return _inside(path)
    if suffix == ".btfz":
        return Found("package", path)
    if head.startswith((b"PTM_", b"#HSH")) or suffix == ".ptm":
        return Found("ptm", path)
    # a file that claims to be Bonn's is told what is wrong with its signature
    if suffix == ".btf" or (head[:1] == b"!" and suffix not in IMAGES):
        return Found("bonn", path)
    return Found("table" if suffix in _TABLES else "image", path)


def _inside(path: Path) -> Found:
    """Find the one sample in a folder or zip."""
    files = list_files(path)
    name = path.name or path.absolute().name
    images = files.ending(*IMAGES)
    found = _candidates(files, images)
    if not found:
        return _lone(path, name, files, images)
    if len(found) > 1:
        listed = ", ".join(one.words for one in found[:_LISTED])
        more = f" and {len(found) - _LISTED} more" if len(found) > _LISTED else ""
        advice = "name the folder or file that is meant"
        sets = [one.folder for one in found if one.kind == "pbr"]
        if len(set(sets)) < len(sets):
            advice += " (or one of the maps, for `patina sample bake`)"
        raise InvalidBtf(f"{name}: holds {len(found)} samples, {listed}{more}: {advice}")
    one = found[0]
    beside = _beside(one.folder, images)
    if beside:
        raise InvalidBtf(
            f"{name}: holds {one.words}, but also images in {', '.join(beside[:_LISTED])}:"
            " name the folder or file that is meant"
        )
    if one.kind in _FILES.values() and one.name and files.archive:
        raise InvalidBtf(f"{name}: {one.words} lies in the zip: unpack it first")
    if files.archive or one.kind == "named":  # folders below may state angles
        return Found(one.kind, path)
    return Found(one.kind, path / one.folder / ("" if one.kind == "pbr" else one.name))


def _candidates(files: FileSet, images: list[Entry]) -> list[_Candidate]:
    """Return what may be a sample.

    In one folder a PTM comes before images with names, these before tables and PBR sets, and
    all of these before package, Bonn and PTM files, which can be named themselves.
    """
    layers = {entry.name.rpartition(".")[0].lower() for entry in files.ending(*_LAYERS)}
    found = [
        _Candidate("ptm", _folder(entry))
        for entry in files.entries
        if entry.base.lower() == "info.json" and _has_layers(_folder(entry).lower(), layers)
    ]
    stated = [_folder(entry) for entry in images if _states_angles(entry)]
    taken = [one.folder for one in found]
    if stated:
        found.append(_Candidate("named", _common(stated)))
        taken.append(found[-1].folder)
    sets: dict[str, list[str]] = {}
    for roles in grouped(images).values():
        first = roles["albedo"][0]
        if not any(_folder(first.entry).startswith(other) for other in taken):
            sets.setdefault(_folder(first.entry), []).append(first.label)
    tables = [] if stated or not images else files.ending(*_TABLES)
    for entry in tables:
        folder, sure = _folder(entry), entry.suffix == ".lp" or entry.base.lower() == _DIRECTIONS
        below = any(image.name.startswith(folder) for image in images)
        if below and folder not in taken and (sure or folder not in sets):
            found.append(_Candidate("table", folder))
            taken.append(folder)
            sets.pop(folder, None)
    for folder, labels in sets.items():
        alone = folder and not labels[1:]  # then it is called by its folder
        found += [_Candidate("pbr", folder, "" if alone else label) for label in labels]
    taken += sets
    found += [
        _Candidate(_FILES[entry.suffix], _folder(entry), entry.base)
        for entry in files.ending(*_FILES)
        if _folder(entry) not in taken
    ]
    return found


def _has_layers(folder: str, layers: set[str]) -> bool:
    return {f"{folder}layer1", f"{folder}layer2"} <= layers or f"{folder}plane_0" in layers


def _lone(path: Path, name: str, files: FileSet, images: list[Entry]) -> Found:
    """Take a folder's only image, or say what is missing."""
    if len(images) == 1 and not files.archive:
        return Found("image", path / images[0].name)
    what = "zip" if files.archive else "folder"
    if not images:
        raise InvalidBtf(f"{name}: the {what} holds no sample and no images{_told(files)}")
    raise InvalidBtf(
        f"{name}: the {what} holds no sample: {len(images):,} images, none named by its angles"
        " (tl… pl… tv… pv…), no table of directions (.lp, .csv) beside them, and no colour map"
        f" with another map of a PBR set{_told(files)}"
    )


def _told(files: FileSet) -> str:
    return "".join(f"; {note}" for note in files.notes)


def _beside(folder: str, images: list[Entry]) -> list[str]:
    """Top folders with images that are neither in `folder` or below it, nor above it."""
    other = {_folder(entry) for entry in images}
    apart = {each for each in other if not (each.startswith(folder) or folder.startswith(each))}
    top = folder.split("/")[0]
    tops = ((each.split("/")[0], each.rstrip("/")) for each in apart)
    return sorted({whole if first == top else first for first, whole in tops})


def _folder(entry: Entry) -> str:
    return entry.name[: len(entry.name) - len(entry.base)]


def _states_angles(entry: Entry) -> bool:
    """Whether a name states all four angles, and the image's own at least one of them."""
    keys = {key.lower() for key in _ANGLE.findall(entry.name)}
    return len(keys) == 4 and _ANGLE.search(entry.base) is not None


def _common(folders: list[str]) -> str:
    """Return the deepest folder that holds all of `folders` ("" or ending with "/")."""
    first, last = min(folders), max(folders)
    parts = []
    for one, other in zip(first.split("/")[:-1], last.split("/")[:-1], strict=False):
        if one != other:
            break
        parts.append(one + "/")
    return "".join(parts)


def _head(path: Path) -> bytes:
    if not path.is_file():
        raise InvalidBtf(f"{path.name}: this is no regular file")
    with path.open("rb") as stream:
        head = stream.read(64)
    if not head:
        raise InvalidBtf(f"{path.name}: the file is empty (0 bytes)")
    if head.startswith(b"version https://git-lfs"):
        raise InvalidBtf(
            f"{path.name}: this is a Git LFS pointer, not the sample itself: run `git lfs pull`"
        )
    return head
