"""Whether the lights of a sample can tell the basis functions apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.btf.harmonics.basis import (
    KINDS,
    LARGEST_ORDER,
    degrees,
    evaluate,
    functions,
    unit_directions,
)
from btfcore.btf.harmonics.linear import svd
from btfcore.errors import InvalidParameter
from btfcore.types import F8

LIMIT = 1e4
_ANGLE = 1e-4  # radians; azimuths closer than that are one
_VANISHES = 1e-8  # a function whose values under all lights are that small beside the largest


@dataclass(frozen=True)
class Conditioning:
    """How well n lights determine the M functions of an order and kind.

    rank : singular values of the (n, M) matrix of function values above 1/limit of the
    largest; condition : largest over smallest (inf where there are fewer lights than
    functions); azimuths : distinct azimuths among the lights off the pole; vanishing :
    the angular parts, such as "sin 6φ", of functions that are zero under every light.
    """

    order: int
    kind: str
    lights: int
    rank: int
    condition: float
    azimuths: int
    vanishing: tuple[str, ...]
    limit: float

    @property
    def functions(self) -> int:
        """Number M of basis functions."""
        return functions(self.order)

    @property
    def sound(self) -> bool:
        """Whether the lights determine every function within the limit."""
        return self.rank == self.functions


def conditioning(
    lights: F8, order: int, kind: str = "spherical", *, limit: float = LIMIT
) -> Conditioning:
    """Measure how unit `lights` (n, 3) determine the functions of `order` and `kind`.

    Raises `InvalidParameter` for an unknown kind, an order outside 0 … 6 or a limit below 1.
    """
    if not limit >= 1:
        raise InvalidParameter(f"a limit of {limit} on the condition, where at least 1 is needed")
    values = evaluate(lights, order, kind)
    _, singular, _ = svd(values)
    rank = int((singular > singular[0] / limit).sum())
    few = len(lights) < values.shape[1] or singular[-1] == 0
    size = np.sqrt((values**2).mean(axis=0))
    names = [
        f"{'sin' if m < 0 else 'cos'} {abs(m)}φ"
        for (_, m), value in zip(degrees(order), size, strict=True)
        if m and value < _VANISHES * size.max()
    ]
    return Conditioning(
        order=order,
        kind=kind,
        lights=len(lights),
        rank=rank,
        condition=np.inf if few else float(singular[0] / singular[-1]),
        azimuths=_azimuths(lights),
        vanishing=tuple(dict.fromkeys(names)),
        limit=limit,
    )


def check_order(
    lights: F8,
    order: int,
    kind: str = "spherical",
    *,
    limit: float = LIMIT,
    singular: str = "refuse",
    name: str = "lights",
) -> Conditioning:
    """Return the conditioning of a fit, refusing one that the lights do not determine.

    An order must stay below half the azimuths of the light rings, and the condition number of
    the matrix of function values below `limit` (design: 1e4). singular : "refuse" raises
    `InvalidParameter` with the numbers and what would do; "regularise" lets it pass.
    Lights that are no unit vectors are refused too, and unknown kinds, orders and limits.
    """
    if singular not in ("refuse", "regularise"):
        raise InvalidParameter(f"singular={singular!r}; there are 'refuse' and 'regularise'")
    lights = unit_directions(name, lights)
    found = conditioning(lights, order, kind, limit=limit)
    if found.sound or singular == "regularise":
        return found
    raise InvalidParameter(f"{name}: {explain(found)}; {_advice(lights, found)}")


def explain(found: Conditioning) -> str:
    """Say in numbers what is wrong with a combination that is not sound."""
    large = "infinite" if found.condition > 1e15 else f"{found.condition:.2g}"
    text = (
        f"{found.kind} harmonics of order {found.order} are {found.functions} functions, but only"
        f" {found.rank} of their combinations are told apart by the"
        f" {found.lights} light{'s' if found.lights > 1 else ''} (condition {large}, limit"
        f" {found.limit:.0e})"
    )
    if found.azimuths <= 2 * found.order and found.azimuths > 1:
        text += f"; the lights stand on {found.azimuths} azimuths, and the order must stay below"
        text += f" half of that, {found.azimuths / 2:g}"
        if found.vanishing:
            text += f": {' and '.join(found.vanishing)} is zero under all of them"
    return text


def _advice(lights: F8, found: Conditioning) -> str:
    """Name the largest sound order of either kind, and the way to fit all the same."""
    best = [f"{largest_order(lights, kind, limit=found.limit)} ({kind})" for kind in KINDS]
    return f"sound are orders up to {' or '.join(best)}; singular='regularise' fits all the same"


def largest_order(
    lights: F8, kind: str = "spherical", *, limit: float = LIMIT, below: int = LARGEST_ORDER
) -> int:
    """Return the largest order up to `below` that the lights determine; 0 is always sound."""
    for order in range(below, 0, -1):
        if conditioning(lights, order, kind, limit=limit).sound:
            return order
    return 0


def _azimuths(lights: F8) -> int:
    """Count distinct azimuths, the pole left out; 1 where nothing else is there."""
    off = np.hypot(lights[:, 0], lights[:, 1]) > 1e-3
    angle = np.sort(np.arctan2(lights[off, 1], lights[off, 0]))
    if len(angle) == 0:
        return 1
    gaps = np.diff(angle, append=angle[0] + 2 * np.pi)
    return max(1, int((gaps > _ANGLE).sum()))
