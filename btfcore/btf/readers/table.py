"""Image folders and zips with a table of directions: light lists (.lp) and CSV."""

from __future__ import annotations

from pathlib import Path

from btfcore.btf.readers.conditions import arrange, missing_note
from btfcore.btf.readers.decode import IMAGES
from btfcore.btf.readers.entries import Entry
from btfcore.btf.readers.image_files import ImageFiles, check_colour, coding_note, probed
from btfcore.btf.readers.listing import FileSet, is_zip, list_files, pick_files
from btfcore.btf.readers.members import read_bytes
from btfcore.btf.readers.table_text import LARGEST_TEXT, Table, parse_csv, parse_lp
from btfcore.btf.sample import BtfSample
from btfcore.errors import InvalidBtf, PatinaError

_SUFFIXES = (".lp", ".csv")


def looks_like_table(path: str | Path) -> bool:
    """Whether `path` is a .lp or .csv file, or a folder or zip with one and with images."""
    given = Path(path)
    try:
        if given.is_file() and not is_zip(given):
            return given.suffix.lower() in _SUFFIXES
        files = list_files(given)
    except (PatinaError, OSError, ValueError):
        return False
    return bool(files.ending(*_SUFFIXES) and files.ending(*IMAGES))


def read_table(path: str | Path, *, colour: str = "auto") -> BtfSample:
    """Read images with a directions table; `path` is the table, its folder, or a zip of both.

    .lp : the number of images, then `name x y z` lines; one view, from straight above. CSV: see
    `btfcore.btf.readers.table_text.parse_csv`. x runs along +column, y up in the picture, z
    towards the viewer. Names are relative to the table's folder and stay inside it; images
    that the table does not name are passed over. One image is decoded now, the others on
    reading; colour as in `read_named_images`, without UTIA's rule.

    Raises `InvalidBtf`, with the line's number, where the table contradicts itself, names what
    is not there or lies outside, repeats a condition or an image, or several tables are found;
    `InvalidImage` where the first image cannot be read.
    """
    check_colour(colour)
    given = Path(path)
    if given.is_file() and not is_zip(given):
        if given.suffix.lower() not in _SUFFIXES:
            raise InvalidBtf(f"{given.name}: a directions table ends with .lp or .csv")
        folder = given.absolute().parent
        entry = Entry(given.name, given.stat().st_size)
        table = _parsed(folder, entry)
        return _sample(given.stem, pick_files(folder, table.names), entry, table, colour)
    files = list_files(given)
    found = files.ending(*_SUFFIXES)
    chosen = [entry for entry in found if entry.base.lower() == "directions.csv"] or found
    if len(chosen) != 1:
        names = ", ".join(entry.name for entry in chosen[:5]) or "none"
        raise InvalidBtf(
            f"{files.name}: one directions table (.lp or .csv) is needed, found {names}"
        )
    return read_listed(files, chosen[0], colour)


def read_listed(files: FileSet, entry: Entry, colour: str) -> BtfSample:
    """Read the images that the table `entry` of `files` names; see `read_table`."""
    return _sample(files.name, files, entry, _parsed(files.place, entry), colour)


def _parsed(place: Path, entry: Entry) -> Table:
    parse = parse_lp if entry.suffix == ".lp" else parse_csv
    return parse(entry.name, read_bytes(place, entry, most=LARGEST_TEXT))


def _sample(name: str, files: FileSet, entry: Entry, table: Table, colour: str) -> BtfSample:
    images = _found(files, entry, table)
    try:
        conditions = arrange(table.views, table.lights, [image.name for image in images])
    except InvalidBtf as error:
        raise InvalidBtf(f"{entry.name}: {error}") from None
    ordered = [images[number] for number in conditions.order]
    first = probed(files, ordered[0])
    return BtfSample(
        name,
        ImageFiles(files, ordered, first, colour=colour),
        conditions.views,
        conditions.lights,
        conditions.index,
        origin=f"directions table {entry.base}",
        notes=(
            *files.notes,
            *table.notes,
            *missing_note(conditions),
            *first.notes,
            coding_note(first, colour),
        ),
    )


def _found(files: FileSet, table: Entry, rows: Table) -> list[Entry]:
    """Return the entry of every row: its exact name, or one that differs in case only."""
    folder = table.name[: len(table.name) - len(table.base)]
    exact = {each.name: each for each in files.entries}
    loose: dict[str, list[Entry]] = {}
    for each in files.entries:
        loose.setdefault(each.name.casefold(), []).append(each)
    used: dict[str, int] = {}
    out = []
    for name, line in zip(rows.names, rows.lines, strict=True):
        wanted = folder + name
        similar = loose.get(wanted.casefold(), [])
        found = exact.get(wanted) or (similar[0] if len(similar) == 1 else None)
        if found is None:
            raise InvalidBtf(f"{table.name}, line {line}: there is no {name[:100]!r} beside it")
        if found.suffix not in IMAGES:
            raise InvalidBtf(f"{table.name}, line {line}: {name[:100]!r} is no image file")
        if used.setdefault(found.name, line) != line:
            raise InvalidBtf(
                f"{table.name}, line {line}: {name[:100]!r} stands in line {used[found.name]} too"
            )
        out.append(found)
    return out
