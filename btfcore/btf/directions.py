"""Light and view directions: angles, the layouts of the papers and of Bonn, tables of one's own.

A direction is a unit vector away from the surface in the local frame (s = +column, t = -row,
n = normal): theta is the angle from n, phi runs from s towards t. Layouts list their directions
ring by ring from the normal outwards, each ring by rising phi.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from btfcore.errors import InvalidBtf, InvalidParameter
from btfcore.types import F8, Frozen

SAME = 1e-5  # radians; closer directions are one and the same
HORIZON = -1e-4  # z of a unit vector below which nothing is seen or lit
STEEPEST, FLATTEST = 5.0, 75.0  # degrees; outermost rings of the papers' layouts
MOST = 4096  # directions of a kind
LARGEST_TABLE = 1 << 20  # bytes

_BONN_RINGS = {
    # theta, number of azimuths, first azimuth; in degrees
    "ubo81": ((0, 1, 0), (15, 6, 0), (30, 12, 0), (45, 18, 0), (60, 20, 0), (75, 24, 0)),
    "ubo151": (
        *((0, 1, 0), (11, 6, 15), (23.5, 12, 0), (30, 12, 15), (37.5, 12, 0)),
        *((45, 18, 0), (52.5, 18, 7.5), (60, 24, 0), (67.5, 24, 7.5), (75, 24, 0)),
    ),
}
LAYOUTS = ("12x8x12x8", "12x5x12x5", *_BONN_RINGS)
_GRID = re.compile(r"([0-9]{1,4})x([0-9]{1,4})x([0-9]{1,4})x([0-9]{1,4})")
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?")
_KINDS = ("view", "light", "both")


@dataclass(frozen=True, eq=False)
class Layout(Frozen):
    """Which directions a sample is seen and lit from: views (V, 3), lights (L, 3) f8 unit."""

    name: str
    views: F8
    lights: F8


def from_angles(theta: ArrayLike, phi: ArrayLike) -> F8:
    """Unit vectors (…, 3) f8 of angles in radians; `theta` and `phi` are broadcast."""
    polar, azimuth = np.broadcast_arrays(np.asarray(theta, float), np.asarray(phi, float))
    across = np.sin(polar)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), np.cos(polar)], axis=-1)


def to_angles(directions: ArrayLike) -> tuple[F8, F8]:
    """Angles (theta, phi) in radians of vectors (…, 3) of any length; phi in -pi … pi, 0 on n."""
    x, y, z = np.moveaxis(np.asarray(directions, float), -1, 0)
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)


def angle_between(one: ArrayLike, other: ArrayLike) -> F8:
    """Angles in radians between unit vectors (…, 3), exact for small and for large ones."""
    first, second = np.asarray(one, float), np.asarray(other, float)
    apart, along = first - second, first + second
    return 2 * np.arctan2(np.linalg.norm(apart, axis=-1), np.linalg.norm(along, axis=-1))


def repeated(directions: F8) -> list[tuple[int, int]]:
    """Pairs (i, j), i < j, of unit vectors (n, 3) that are less than `SAME` apart."""
    pairs: list[tuple[int, int]] = []
    for start in range(0, len(directions), 256):
        block = directions[start : start + 256]
        # the chord, as 1 - cos would leave half the digits
        apart = np.linalg.norm(block[:, None] - directions[None, start:], axis=2)
        one, two = np.nonzero(apart < SAME)
        pairs += [(int(i) + start, int(j) + start) for i, j in zip(one, two, strict=True) if i < j]
    return pairs


def rings(table: Sequence[tuple[float, int, float]]) -> F8:
    """Directions (n, 3) f8 on rings (theta, number of azimuths, first azimuth), in degrees."""
    parts = []
    for theta, count, first in table:
        phi = first + 360.0 * np.arange(count) / count
        parts.append(from_angles(np.radians(theta), np.radians(phi)))
    return np.concatenate(parts)


def layout(name: str) -> Layout:
    """Return the layout of that name; views and lights of all but AxBxCxD are the same.

    "AxBxCxD" has A azimuths from 0 on B rings for the views, C on D for the lights. The rings
    lie evenly from 5 to 75 degrees (a lone one at 40): "12x8x12x8" is Zhou's resolution
    (§III-B, "Handling BTF Values"), "12x5x12x5" Tong's (§1), whose paper names no angles.
    "ubo81" is that of UBO2003 and ATRIUM, "ubo151" that of UBO2014, in the order of their files.
    Raises `InvalidParameter` for other names and for more than 4096 directions.
    """
    if name in _BONN_RINGS:
        directions = rings(_BONN_RINGS[name])
        return Layout(name, directions, directions.copy())
    match = _GRID.fullmatch(name)
    if match is None:
        raise InvalidParameter(
            f"there is no layout {name[:60]!r}; there are {', '.join(LAYOUTS)}, and AxBxCxD for A"
            " azimuths on B rings of views and C on D of lights"
        )
    numbers = [int(part) for part in match.groups()]
    for count, kind in ((numbers[0] * numbers[1], "views"), (numbers[2] * numbers[3], "lights")):
        if not 1 <= count <= MOST:
            raise InvalidParameter(f"layout {name}: {count} {kind}, where 1 to {MOST} can be")
    return Layout(name, _even(*numbers[:2]), _even(*numbers[2:]))


def _even(azimuths: int, count: int) -> F8:
    if count == 1:
        return rings([((STEEPEST + FLATTEST) / 2, azimuths, 0.0)])
    return rings(
        [(float(theta), azimuths, 0.0) for theta in np.linspace(STEEPEST, FLATTEST, count)]
    )


def read_layout(path: str | Path) -> Layout:
    """Read directions from a small text table; its name is the file's.

    The first line names the columns: `theta,phi` in degrees or `x,y,z` (any length but 0),
    and maybe `kind`, which is view, light or both (the default). Columns are separated by
    commas, semicolons, tabs or spaces; empty lines and those that begin with # are skipped.
    Where the table has lights only, the view is from above; where it has views only, so is
    the light.

    Raises `InvalidBtf` with the file's name and the line: for a file over 1 MiB, text that is
    not UTF-8, unknown columns, anything but numbers in them, directions below the horizon,
    repeated ones, none, or more than 4096 of a kind.
    """
    file = Path(path)
    lines = _lines(file)
    if not lines:
        raise InvalidBtf(f"{file.name}: the table is empty")
    (start, header), rows = lines[0], lines[1:]
    separator = next((mark for mark in (",", ";", "\t") if mark in header), None)
    columns = [cell.strip().lower() for cell in header.split(separator)]
    polar = _polar(f"{file.name}: line {start}", columns)
    found: dict[str, list[tuple[int, F8]]] = {"view": [], "light": []}
    for number, line in rows:
        where = f"{file.name}: line {number}"
        cells = [cell.strip() for cell in line.split(separator)]
        if len(cells) != len(columns):
            raise InvalidBtf(f"{where}: {len(cells)} columns, the first line has {len(columns)}")
        row = dict(zip(columns, cells, strict=True))
        kind = row.get("kind", "both").lower()
        if kind not in _KINDS:
            raise InvalidBtf(f"{where}: kind is {kind[:40]!r}, where {', '.join(_KINDS)} can be")
        direction = _direction(where, row, polar)
        for one in ("view", "light"):
            if kind in (one, "both"):
                found[one].append((number, direction))
                if len(found[one]) > MOST:
                    raise InvalidBtf(f"{where}: more than {MOST} {one}s")
    if not found["view"] and not found["light"]:
        raise InvalidBtf(f"{file.name}: the table has a first line but no directions")
    return Layout(file.name, _table(file.name, "view", found), _table(file.name, "light", found))


def _lines(file: Path) -> list[tuple[int, str]]:
    """Lines with their numbers, without empty ones and comments."""
    try:
        with file.open("rb") as stream:
            raw = stream.read(LARGEST_TABLE + 1)
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidBtf(f"{file.name}: byte {error.start} is no UTF-8 text") from error
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        raise InvalidBtf(f"{file.name}: the table cannot be read: {error}") from error
    if len(raw) > LARGEST_TABLE:
        raise InvalidBtf(f"{file.name}: a table of directions has at most {LARGEST_TABLE:,} bytes")
    numbered = enumerate((line.strip() for line in text.split("\n")), start=1)
    return [(number, line) for number, line in numbered if line and not line.startswith("#")]


def _polar(where: str, columns: list[str]) -> bool:
    """Whether the columns hold angles; refuse any but the two forms."""
    wanted = sorted(set(columns) - {"kind"})
    if len(set(columns)) == len(columns) and wanted in (["phi", "theta"], ["x", "y", "z"]):
        return "theta" in columns
    raise InvalidBtf(
        f"{where}: the columns are {', '.join(columns)[:120]}; they should be theta, phi or"
        " x, y, z, and maybe kind"
    )


def _direction(where: str, row: dict[str, str], polar: bool) -> F8:
    values = []
    for column in ("theta", "phi") if polar else ("x", "y", "z"):
        if len(row[column]) > 40 or not _NUMBER.fullmatch(row[column]):
            raise InvalidBtf(f"{where}: {column} is {row[column][:40]!r}, not a number")
        values.append(float(row[column]))
    if polar:
        theta, phi = values
        if not (0 <= theta <= 90 and abs(phi) <= 360):
            raise InvalidBtf(
                f"{where}: theta {theta:g} and phi {phi:g} degrees, where 0 to 90 and -360 to 360"
                " can be"
            )
        return from_angles(np.radians(theta), np.radians(phi))
    vector = np.array(values)
    largest = np.abs(vector).max()
    if not 0 < largest < np.inf:
        raise InvalidBtf(f"{where}: the vector {values} has no direction")
    unit = vector / largest
    unit /= np.linalg.norm(unit)
    if unit[2] < 0:
        raise InvalidBtf(f"{where}: the direction lies below the horizon (z = {unit[2]:.4f})")
    return unit


def _table(name: str, kind: str, found: dict[str, list[tuple[int, F8]]]) -> F8:
    entries = found[kind]
    if not entries:
        return np.array([[0.0, 0.0, 1.0]])
    directions = np.array([direction for _, direction in entries])
    again = repeated(directions)
    if again:
        one, two = again[0]
        raise InvalidBtf(
            f"{name}: line {entries[two][0]} repeats the {kind} of line {entries[one][0]};"
            f" {len(again)} pairs of {kind}s are the same in all"
        )
    return directions
