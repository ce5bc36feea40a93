"""Image sets whose file names state the angles: UBO2003, ATRIUM, UTIA; folders and zips."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from btfcore.btf.readers.conditions import arrange, from_angles, missing_note
from btfcore.btf.readers.decode import IMAGES, Raw
from btfcore.btf.readers.entries import Entry
from btfcore.btf.readers.image_files import ImageFiles, check_colour, coding_note, probed
from btfcore.btf.readers.listing import FileSet, list_files
from btfcore.btf.readers.snap import snapped
from btfcore.btf.sample import BtfSample
from btfcore.errors import InvalidBtf, PatinaError

TABLE = "directions.csv"
_ANGLE = re.compile(r"(?<![a-z])(tl|pl|tv|pv)[ _-]?(\d+(?:\.\d+)?)", re.IGNORECASE)
_UTIA = re.compile(r"tl\d+_pl\d+_tv\d+_pv\d+", re.IGNORECASE)
_KEYS = ("tv", "pv", "tl", "pl")


def looks_like_named_images(path: str | Path) -> bool:
    """Whether a folder or zip archive holds an image whose name states the four angles."""
    try:
        return any(_stated(entry) for entry in list_files(path).ending(*IMAGES))
    except PatinaError:
        return False


def read_named_images(path: str | Path, *, colour: str = "auto") -> BtfSample:
    """Read a folder or zip of images named `tlTTT plPPP tvTTT pvPPP` (degrees, any order).

    Folders may lie in between; angles that the file's name lacks may stand in its folder's.
    θ runs from the surface normal, φ from +column towards up; θ = 0 is one direction, whatever
    φ says. One image is decoded now (its size must be that of all), the others on reading.

    colour : "srgb", "linear", "xyz", or "auto": 8- and 16-bit images are sRGB-coded; float
    images are CIE XYZ (D65) where their channels or chromaticities say so, or where names
    follow UTIA's `tl000_pl000_tv000_pv000.exr` and nothing says otherwise; else linear
    Rec. 709. A note tells what was taken. A `directions.csv` beside the images (our own
    writer's, for angles that are not whole degrees) is followed instead of the names.
    Conditions without an image are noted and get index -1; lights that stepped aside are put
    back (`btfcore.btf.readers.snap`).

    Raises `InvalidBtf` where two images state the same condition (both are named), an angle
    makes no sense, or a folder or archive is damaged or hostile; `InvalidImage` where the first
    image cannot be read; `InvalidParameter` for another `colour`.
    """
    check_colour(colour)
    files = list_files(path)
    tables = [entry for entry in files.ending(".csv") if entry.base.lower() == TABLE]
    if tables:
        from btfcore.btf.readers.table import read_listed

        return read_listed(files, min(tables, key=lambda entry: entry.name.count("/")), colour)
    return _sample(files, colour)


def _sample(files: FileSet, colour: str) -> BtfSample:
    images = files.ending(*IMAGES)
    stated = [(entry, angles) for entry in images if (angles := _stated(entry))]
    if not stated:
        raise InvalidBtf(
            f"{files.name}: none of its {len(images)} images is named like"
            " `tl075 pl345 tv060 pv015.jpg`" + "".join(f"; {note}" for note in files.notes)
        )
    entries = [entry for entry, _ in stated]
    notes = list(files.notes)
    if len(images) > len(stated):
        notes.append(f"passed over {len(images) - len(stated)} images named in another way")
    degrees = np.array([angles for _, angles in stated])
    _check(files, entries, degrees)
    views = from_angles(degrees[:, 0], degrees[:, 1])
    lights = from_angles(degrees[:, 2], degrees[:, 3])
    try:
        conditions = arrange(views, lights, [entry.name for entry in entries])
    except InvalidBtf as error:
        raise InvalidBtf(f"{files.name}: {error}") from None
    conditions, moved = snapped(conditions)
    notes += [moved] if moved else []
    notes += missing_note(conditions)
    ordered = [entries[number] for number in conditions.order]
    first = probed(files, ordered[0])
    floats = _floats(first, ordered[0])
    notes += first.notes
    notes.append(coding_note(first, colour, floats))
    return BtfSample(
        files.name,
        ImageFiles(files, ordered, first, colour=colour, floats=floats),
        conditions.views,
        conditions.lights,
        conditions.index,
        origin="image names",
        notes=tuple(notes),
    )


def _floats(first: Raw, entry: Entry) -> str:
    """What float images without a word about it hold, by the rule of `read_named_images`."""
    utia = entry.suffix == ".exr" and _UTIA.search(entry.base)
    return "xyz" if utia and first.meaning != "rec709" else "linear"


def _stated(entry: Entry) -> tuple[float, ...] | None:
    """θ view, φ view, θ light, φ light in degrees, or None where the name does not say."""
    found: dict[str, float] = {}
    for part in (entry.base, *reversed(entry.name.split("/")[:-1])):
        for key, value in _ANGLE.findall(part):
            found.setdefault(key.lower(), float(value))
        if len(found) == 4:
            return tuple(found[key] for key in _KEYS)
        if not found:
            return None  # the image's own name has to state something
    return None


def _check(files: FileSet, entries: list[Entry], angles: np.ndarray) -> None:
    wrong = (angles[:, [0, 2]] > 90).any(axis=1) | (angles[:, [1, 3]] > 360).any(axis=1)
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        stated = ", ".join(
            f"{key} {value:g}" for key, value in zip(_KEYS, angles[first], strict=True)
        )
        raise InvalidBtf(
            f"{files.name}: {entries[first].name} states {stated}; polar angles reach from 0 to"
            f" 90 and azimuths to 360 degrees ({int(wrong.sum())} images are off)"
        )
