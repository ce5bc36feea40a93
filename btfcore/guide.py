"""Vectors drawn by the user, and the field that they span (Zhou §III-B)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import RBFInterpolator

from btfcore.errors import InvalidGuide
from btfcore.types import F8, Frozen

LARGEST_FILE = 16 << 20
MOST_ENTRIES = 100_000
MOST_CENTRES = 1000
FARTHEST = 1e4  # in mesh diagonals; a vector farther away acts from this distance


@dataclass(frozen=True, eq=False)
class Guide(Frozen):
    """Where the sample's +column (rightwards in the picture) shall point.

    positions (k, 3) f8 in world units; directions (k, 3) f8, of any length but zero.
    """

    positions: F8
    directions: F8


def read_guide(path: str | Path) -> Guide:
    """Read a JSON list of ``{"position": [x, y, z], "direction": [x, y, z]}``.

    Other keys are ignored. Raises `InvalidGuide`, naming the file, the entry (from 0) and the
    number that is wrong.
    """
    source = Path(path)
    try:
        size = source.stat().st_size
        if size > LARGEST_FILE:
            raise InvalidGuide(f"{source} has {size} bytes; a guide may have {LARGEST_FILE}")
        entries = json.loads(source.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InvalidGuide(f"cannot read the guide {source}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise InvalidGuide(f"{source} is not JSON: {error}") from error
    if not isinstance(entries, list):
        raise InvalidGuide(f"{source} holds a JSON {_kind(entries)}, not a list of vectors")
    if not 0 < len(entries) <= MOST_ENTRIES:
        raise InvalidGuide(f"{source} lists {len(entries)} vectors, not 1 … {MOST_ENTRIES}")
    rows = np.empty((len(entries), 2, 3))
    for index, entry in enumerate(entries):
        place = f"{source}, entry {index}"
        if not isinstance(entry, dict):
            raise InvalidGuide(f"{place} is a JSON {_kind(entry)}, not an object")
        rows[index, 0] = _triple(entry, "position", place)
        rows[index, 1] = _triple(entry, "direction", place)
        if not rows[index, 1].any():
            raise InvalidGuide(f"{place}: direction is {entry['direction']}, which has no length")
    return Guide(rows[:, 0].copy(), rows[:, 1].copy())


def _kind(value: Any) -> str:
    names = {dict: "object", list: "list", str: "string", bool: "boolean", type(None): "null"}
    return names.get(type(value), "number")


def _triple(entry: dict[str, Any], key: str, place: str) -> list[float]:
    """Three finite numbers, or a named error."""
    if key not in entry:
        raise InvalidGuide(f"{place} has no {key!r}")
    values = entry[key]
    if not isinstance(values, list) or len(values) != 3:
        found = f"{len(values)} numbers" if isinstance(values, list) else f"a {_kind(values)}"
        raise InvalidGuide(f"{place}: {key} is {found}, not 3 numbers")
    out = []
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InvalidGuide(f"{place}: {key} holds a {_kind(value)}, not a number")
        try:
            number = float(value)
        except OverflowError:
            number = np.inf
        if not np.isfinite(number):
            raise InvalidGuide(f"{place}: {key} holds {number}, which is not finite")
        out.append(number)
    return out


def spanned(guide: Guide, points: F8, *, diagonal: float) -> F8:
    """Interpolate the guide's unit directions at `points` (N, 3), not yet tangential; (N, 3).

    Radial basis functions ‖x‖ with a constant (biharmonic in space): they work for any number
    of vectors in any position, keep a constant guide constant and do not grow far away.
    `diagonal` is the mesh's. Vectors at one place are averaged, and so are, in the cells of
    the finest grid that is coarse enough, more than 1,000 of them. Raises `InvalidGuide`.
    """
    _check(guide)
    centre, unit = points.mean(axis=0), max(diagonal, 1e-300)
    places = np.clip((guide.positions - centre) / unit, -FARTHEST, FARTHEST)
    directions = guide.directions / np.abs(guide.directions).max(axis=1, keepdims=True)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    cell = 1e-6
    while True:
        keys = np.floor(places / cell + 0.5)
        _, group = np.unique(keys, axis=0, return_inverse=True)
        group = group.reshape(-1)
        if group.max() < MOST_CENTRES:
            break
        cell = 1e-3 if cell < 1e-3 else 1.5 * cell
    times = np.bincount(group)[:, None]
    centres = np.stack([np.bincount(group, places[:, k]) for k in range(3)], axis=1) / times
    values = np.stack([np.bincount(group, directions[:, k]) for k in range(3)], axis=1) / times
    basis = RBFInterpolator(centres, values, kernel="linear", degree=0)
    out: F8 = basis((points - centre) / unit)
    return out


def _check(guide: Guide) -> None:
    """Guides made in memory pass the same door as those read from files."""
    shape = guide.positions.shape
    if len(shape) != 2 or shape[1] != 3 or shape[0] == 0 or guide.directions.shape != shape:
        other = guide.directions.shape
        raise InvalidGuide(f"positions {shape} and directions {other} are not both (k, 3), k > 0")
    for name, values in (("position", guide.positions), ("direction", guide.directions)):
        bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if len(bad):
            raise InvalidGuide(f"guide entry {bad[0]}: {name} {values[bad[0]]} is not finite")
    bad = np.flatnonzero(~guide.directions.any(axis=1))
    if len(bad):
        raise InvalidGuide(f"guide entry {bad[0]}: direction has no length")
