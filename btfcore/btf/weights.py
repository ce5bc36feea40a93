"""How much each view and each light counts when a BTF's texels are compared."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from btfcore.btf.solid_angle import solid_angles
from btfcore.errors import InvalidParameter
from btfcore.types import F8

PRESETS = ("uniform", "solid-angle", "frontal")
LARGEST_FILE = 1 << 20  # bytes

Weights = str | Path | ArrayLike | None


def direction_weights(wanted: Weights, directions: F8, *, name: str, kind: str) -> F8 | None:
    """Weights (n,) f8 ≥ 0 of unit directions (n, 3), or None where all count alike.

    wanted : None or "uniform"; "solid-angle", the part of the hemisphere that is nearest to
    each direction; "frontal", the cosine of its angle from the normal; a CSV or JSON file
    (`read_weights`); or the numbers themselves. name and kind ("view", "light") are for the
    messages. Only ratios matter.

    Raises `InvalidParameter` where a preset or file is not there, or where the weights are not
    one a direction, not finite, negative, or all 0.
    """
    if wanted is None or (isinstance(wanted, str) and wanted == "uniform"):
        return None
    where = f"{name}: {kind} weights"
    if isinstance(wanted, str) and wanted == "solid-angle":
        values = solid_angles(directions)
    elif isinstance(wanted, str) and wanted == "frontal":
        values = np.maximum(directions[:, 2], 0.0)
    elif isinstance(wanted, (str, Path)):
        where += f" of {Path(wanted).name}"
        values = read_weights(wanted)
    else:
        values = np.array(wanted, np.float64)
    return _checked(where, values, len(directions), kind)


def _checked(where: str, values: F8, count: int, kind: str) -> F8:
    if values.ndim != 1 or len(values) != count:
        raise InvalidParameter(
            f"{where}: {values.size} numbers of shape {values.shape} for {count} {kind}s"
        )
    for wrong, what in ((~np.isfinite(values), "not finite"), (values < 0, "negative")):
        if wrong.any():
            first = int(np.flatnonzero(wrong)[0])
            raise InvalidParameter(
                f"{where}: number {first} is {values[first]:g}, and {int(wrong.sum())} of"
                f" {count} are {what}"
            )
    if not (values > 0).any():
        raise InvalidParameter(f"{where}: all {count} are 0")
    return values / values.max()  # lest sums of squares overflow


def read_weights(path: str | Path) -> F8:
    """Numbers (n,) f8 of a file: a JSON list, or text with one or more a line.

    In a text file (.csv, .txt) numbers are parted by commas, semicolons or spaces; a first line
    "weight", empty lines and those that begin with # are skipped. The order is that of the
    sample's directions. Raises `InvalidParameter` with the file's name and the line.
    """
    file = Path(path)
    if file.suffix.lower() not in (".csv", ".txt", ".json"):
        raise InvalidParameter(
            f"weights {str(path)[:80]!r}: neither one of {', '.join(PRESETS)} nor a .csv, .txt or"
            " .json file"
        )
    try:
        with file.open("rb") as stream:
            raw = stream.read(LARGEST_FILE + 1)
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidParameter(f"{file.name}: byte {error.start} is no UTF-8 text") from error
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        raise InvalidParameter(f"{file.name}: the weights cannot be read: {error}") from error
    if len(raw) > LARGEST_FILE:
        raise InvalidParameter(f"{file.name}: weights have at most {LARGEST_FILE:,} bytes")
    return _from_json(file.name, text) if file.suffix.lower() == ".json" else _from_text(file, text)


def _from_json(name: str, text: str) -> F8:
    try:
        values = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InvalidParameter(f"{name}: no JSON: {str(error)[:120]}") from error
    if not isinstance(values, list):
        raise InvalidParameter(f"{name}: a list of numbers is needed, not {type(values).__name__}")
    for place, value in enumerate(values):
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise InvalidParameter(f"{name}: entry {place} is {str(value)[:40]!r}, not a number")
    try:
        return np.array(values, np.float64)
    except OverflowError as error:  # an integer of hundreds of digits
        raise InvalidParameter(f"{name}: a number is too large: {error}") from error


def _from_text(file: Path, text: str) -> F8:
    values = []
    started = False
    for number, line in enumerate(text.split("\n"), start=1):
        cells = line.replace(",", " ").replace(";", " ").split()
        if not cells or cells[0].startswith("#"):
            continue
        if not started and [cell.lower() for cell in cells] in (["weight"], ["weights"]):
            started = True
            continue
        started = True
        for cell in cells:
            try:
                values.append(float(cell))
            except ValueError:
                raise InvalidParameter(
                    f"{file.name}: line {number}: {cell[:40]!r} is not a number"
                ) from None
    return np.array(values, np.float64)
