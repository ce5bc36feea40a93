"""How lengths are shown and typed: in the mesh's own units, or in those of a ruler."""

from __future__ import annotations

import math
import re

from btfcore.errors import InvalidParameter

METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
UNITS = ("model", *METRES)

_LENGTH = re.compile(r"\s*([-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d{1,3})?)\s*(\w*)\s*")


def length_text(length: float, unit: str, metres: float = 1.0) -> str:
    """Four digits of a length in the mesh's units, and its unit.

    unit : one of `UNITS`; metres : how long one unit of the mesh is. Without a ruler's unit
    there is only the number. Raises `InvalidParameter` for another unit.
    """
    if unit == "model":
        return f"{length:.4g}"
    return f"{length * metres / _ruler(unit):.4g} {unit}"


def parse_length(text: str, unit: str, metres: float = 1.0) -> float:
    """Length in the mesh's units of "12", "12 mm", "1,2cm"; a bare number is in `unit`.

    Raises `InvalidParameter` for other text and what is not finite.
    """
    found = _LENGTH.fullmatch(text[:80])
    if found is None:
        raise InvalidParameter(f"{text[:40]!r} is no length")
    value, named = float(found[1].replace(",", ".")), found[2] or unit
    if not math.isfinite(value):
        raise InvalidParameter(f"{text[:40]!r} is no length")
    return value if named == "model" else value * _ruler(named) / metres


def _ruler(unit: str) -> float:
    if unit not in METRES:
        raise InvalidParameter(f"the unit {unit[:40]!r} is none of {', '.join(UNITS)}")
    return METRES[unit]
