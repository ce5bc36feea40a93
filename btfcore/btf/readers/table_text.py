"""The text of a directions table, .lp or CSV, as rows of numbers; every line is checked."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass

import numpy as np

from btfcore.btf.readers.conditions import from_angles
from btfcore.btf.readers.entries import MOST_ENTRIES, unsafe
from btfcore.errors import InvalidBtf
from btfcore.types import F8

LARGEST_TEXT = 1 << 26
_LONGEST_LINE = 4096
_OFF = 1e-3  # lengths further from 1 are worth a note
_FILE = ("file", "filename", "file_name", "name", "image", "path")
_ANGLES = {
    "theta_view": ("theta_view", "theta_v", "view_theta", "tv"),
    "phi_view": ("phi_view", "phi_v", "view_phi", "pv"),
    "theta_light": ("theta_light", "theta_l", "light_theta", "tl"),
    "phi_light": ("phi_light", "phi_l", "light_phi", "pl"),
}
_VECTORS = {
    "v": (("vx", "vy", "vz"), ("view_x", "view_y", "view_z")),
    "l": (("lx", "ly", "lz"), ("light_x", "light_y", "light_z"), ("x", "y", "z")),
}


@dataclass(frozen=True, eq=False)
class Table:
    """names (J,) of the images, their line numbers, views and lights (J, 3) f8 unit vectors."""

    names: tuple[str, ...]
    lines: tuple[int, ...]
    views: F8
    lights: F8
    notes: tuple[str, ...]


def parse_lp(where: str, data: bytes) -> Table:
    """Parse a light list: a line with the count, then `name x y z` (light vectors), one view.

    Names may hold blanks. Vectors are normalised, with a note where a length is off by more
    than 1e-3. Raises `InvalidBtf`, beginning with `where` and the line, for anything else.
    """
    lines = [(number, text) for number, text in _lines(where, data) if text.strip()]
    first = lines[0][1].strip() if lines else ""
    if not first.isdecimal() or len(first) > 9:
        raise InvalidBtf(
            f"{where}: line 1 is not the number of images that a light list begins with"
        )
    count = int(first)
    if count != len(lines) - 1 or count == 0:
        raise InvalidBtf(f"{where}: announces {count:,} images, lists {len(lines) - 1:,}")
    names, numbers, vectors = [], [], []
    for number, text in lines[1:]:
        words = text.rsplit(None, 3)
        if len(words) != 4:
            raise InvalidBtf(f"{where}, line {number}: {text.strip()[:80]!r} is not `name x y z`")
        names.append(_name(where, number, words[0]))
        numbers.append(number)
        vectors.append([_number(where, number, word) for word in words[1:]])
    notes: list[str] = []
    lights = _units(where, "light", numbers, np.array(vectors), notes)
    views = np.tile([0.0, 0.0, 1.0], (count, 1))
    return Table(tuple(names), tuple(numbers), views, lights, tuple(notes))


def parse_csv(where: str, data: bytes) -> Table:
    """Parse a CSV table with a header: a file column, and directions of view and light.

    Directions are columns theta_view, phi_view, theta_light, phi_light in degrees (theta_v …,
    tv … will do), or vectors vx, vy, vz, lx, ly, lz (x, y, z for lights alone); without view
    columns the view is the normal. Other columns are ignored, as are lines that begin with
    "#". Comma, semicolon or tab. Raises `InvalidBtf` with `where` and the line.
    """
    lines = [
        (number, text)
        for number, text in _lines(where, data)
        if text.strip() and not text.lstrip().startswith("#")
    ]
    if len(lines) < 2:
        raise InvalidBtf(f"{where}: a table needs a header and a line for each image")
    mark = max(",;\t", key=lines[0][1].count)
    rows = [(number, _split(where, number, text, mark)) for number, text in lines]
    header = [cell.strip().lower() for cell in rows[0][1]]
    file = next((header.index(name) for name in _FILE if name in header), None)
    if file is None:
        raise InvalidBtf(f"{where}, line {rows[0][0]}: no column `file` among {header[:12]}")
    names, numbers, cells = [], [], []
    for number, row in rows[1:]:
        if len(row) < len(header):
            raise InvalidBtf(f"{where}, line {number}: {len(row)} cells for {len(header)} columns")
        names.append(_name(where, number, row[file].strip()))
        numbers.append(number)
        cells.append(row)
    notes: list[str] = []
    views = _direction(where, "view", header, numbers, cells, notes)
    lights = _direction(where, "light", header, numbers, cells, notes)
    if lights is None:
        raise InvalidBtf(
            f"{where}, line {rows[0][0]}: no light columns (theta_light, phi_light or lx, ly, lz)"
            f" among {header[:12]}"
        )
    if views is None:
        views = np.tile([0.0, 0.0, 1.0], (len(names), 1))
        notes.append("states no views: taken from straight above")
    return Table(tuple(names), tuple(numbers), views, lights, tuple(notes))


def _direction(
    where: str,
    kind: str,
    header: list[str],
    numbers: list[int],
    cells: list[list[str]],
    notes: list[str],
) -> F8 | None:
    def column(place: int) -> list[float]:
        return [
            _number(where, number, row[place]) for number, row in zip(numbers, cells, strict=True)
        ]

    places = [
        next((header.index(name) for name in _ANGLES[f"{part}_{kind}"] if name in header), None)
        for part in ("theta", "phi")
    ]
    if places[0] is not None and places[1] is not None:
        theta, phi = np.array(column(places[0])), np.array(column(places[1]))
        wrong = (theta < 0) | (theta > 90)
        if wrong.any():
            first = int(np.flatnonzero(wrong)[0])
            raise InvalidBtf(
                f"{where}, line {numbers[first]}: a polar angle of {theta[first]:g}°, it reaches"
                " from 0 to 90"
            )
        return from_angles(theta, phi)
    for triple in _VECTORS[kind[0]]:
        if all(name in header for name in triple):
            vectors = np.array([column(header.index(name)) for name in triple]).T
            return _units(where, kind, numbers, vectors, notes)
    return None


def _units(where: str, kind: str, numbers: list[int], vectors: F8, notes: list[str]) -> F8:
    largest = np.abs(vectors).max(axis=1)
    wrong = ~(largest > 1e-12) | (vectors[:, 2] < -1e-4 * largest)
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        raise InvalidBtf(
            f"{where}, line {numbers[first]}: {tuple(vectors[first].tolist())} is no {kind} above"
            " the surface"
        )
    scaled = vectors / largest[:, None]
    length = np.linalg.norm(scaled, axis=1)
    off = np.abs(length * largest - 1)
    if off.max() > _OFF:
        notes.append(
            f"normalised {int((off > _OFF).sum())} {kind} vectors, whose lengths are off 1 by up"
            f" to {off.max():.3g}"
        )
    return scaled / length[:, None]


def _lines(where: str, data: bytes) -> list[tuple[int, str]]:
    if len(data) > LARGEST_TEXT:
        raise InvalidBtf(
            f"{where}: a table of {len(data):,} bytes, up to {LARGEST_TEXT:,} are read"
        )
    if b"\0" in data:
        raise InvalidBtf(f"{where}: holds null characters, it is no text")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if len(lines) > 2 * MOST_ENTRIES:
        raise InvalidBtf(f"{where}: {len(lines):,} lines, up to {2 * MOST_ENTRIES:,} are read")
    for number, line in enumerate(lines, 1):
        if len(line) > _LONGEST_LINE:
            raise InvalidBtf(f"{where}, line {number}: {len(line):,} characters")
    return list(enumerate(lines, 1))


def _split(where: str, number: int, text: str, mark: str) -> list[str]:
    try:
        return next(csv.reader(io.StringIO(text), delimiter=mark, strict=True))
    except (csv.Error, StopIteration) as error:
        raise InvalidBtf(f"{where}, line {number}: {error or 'nothing in it'}") from error


def _name(where: str, number: int, name: str) -> str:
    plain = name.replace("\\", "/").removeprefix("./")
    reason = unsafe(plain)
    if reason:
        raise InvalidBtf(
            f"{where}, line {number}: the name {name[:100]!r} {reason}; names are relative to the"
            " table's folder"
        )
    return plain


def _number(where: str, number: int, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or "_" in word:
        raise InvalidBtf(f"{where}, line {number}: {word.strip()[:40]!r} is no number")
    return value
