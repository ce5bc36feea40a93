"""Real spherical harmonics and their hemispherical kin, evaluated for many directions at once."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from btfcore.errors import InvalidParameter
from btfcore.types import F8

LARGEST_ORDER = 6
_UNIT = 1e-4
KINDS = ("spherical", "hemispherical")


def functions(order: int) -> int:
    """Number M = (order + 1)² of basis functions up to and with degree `order`."""
    return (order + 1) ** 2


def degrees(order: int) -> list[tuple[int, int]]:
    """Degree l and signed azimuthal number of every function; (l, m) stands at l² + l + m."""
    return [(degree, m) for degree in range(order + 1) for m in range(-degree, degree + 1)]


def check_basis(order: int, kind: str) -> None:
    """Raise `InvalidParameter` unless `order` is 0 … 6 and `kind` one of `KINDS`."""
    if kind not in KINDS:
        raise InvalidParameter(f"harmonics of kind {kind!r}; there are {' and '.join(KINDS)} ones")
    if not 0 <= order <= LARGEST_ORDER or order != int(order):
        raise InvalidParameter(f"harmonics of order {order}, where 0 … {LARGEST_ORDER} are allowed")


def unit_directions(name: str, lights: ArrayLike) -> F8:
    """Return `lights` as (n, 3) f8; raises `InvalidParameter` unless all are unit vectors."""
    directions = np.atleast_2d(np.asarray(lights, np.float64))
    if directions.ndim != 2 or directions.shape[1] != 3 or len(directions) == 0:
        raise InvalidParameter(f"{name}: lights of shape {directions.shape}, not (n, 3)")
    length = np.linalg.norm(directions, axis=1)
    wrong = ~(np.abs(length - 1) < _UNIT)
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        raise InvalidParameter(
            f"{name}: light {first} is no unit vector, its length is {length[first]:.6g}"
        )
    return directions


def evaluate(directions: F8, order: int, kind: str = "spherical") -> F8:
    """Values (n, M) f8 of the basis functions Y_m in unit `directions` (n, 3).

    Function l² + l + m is N P_l^|m|(z) times √2 cos mφ for m > 0 and √2 sin |m|φ for m < 0,
    without the alternating sign (-1)^m, so that functions 1 … 3 of the spherical kind are
    √(3/4π) times y, z and x.

    "spherical" : orthonormal over the sphere. "hemispherical" : orthonormal over the upper
    half, after Gautron, Křivánek, Pattanaik, Bouatouch, "A novel hemispherical basis for
    accurate and efficient rendering", EGSR 2004: the Legendre functions of 2z - 1, scaled by
    √2; directions below the horizon count as lying on it.

    Raises `InvalidParameter` for an unknown kind or an order outside 0 … 6.
    """
    check_basis(order, kind)
    x, y, z = np.asarray(directions, np.float64).T
    if kind == "spherical":
        height, stretch, scale = z, np.ones_like(z), np.sqrt(1 / (4 * np.pi))
    else:
        # sin θ' / sin θ, with cos θ' = 2z - 1, written so that the pole needs no care
        z = np.clip(z, 0, 1)
        height, stretch, scale = 2 * z - 1, 2 * np.sqrt(z / (1 + z)), np.sqrt(1 / (2 * np.pi))
    first, second = _recurrence(order)
    out = np.empty((len(z), functions(order)))
    # Legendre functions over sin^m θ are polynomials in z, and sin^m θ e^{imφ} one in x + iy:
    # no angle is ever formed. Upwards in the degree the recurrence is the stable one.
    turn = np.full(len(z), scale, np.complex128)
    around = (x + 1j * y) * stretch
    for m in range(order + 1):
        if m:
            turn = turn * around * np.sqrt((2 * m + 1) / (2 * m))
        before, now = np.zeros_like(z), np.ones_like(z)
        for degree in range(m, order + 1):
            if degree > m:
                a, b = first[degree, m], second[degree, m]
                before, now = now, a * (height * now - b * before)
            middle = degree * degree + degree
            if m == 0:
                out[:, middle] = turn.real * now
            else:
                out[:, middle + m] = np.sqrt(2) * turn.real * now
                out[:, middle - m] = np.sqrt(2) * turn.imag * now
    return out


@lru_cache
def _recurrence(order: int) -> tuple[F8, F8]:
    """Factors a and b of P_l = a (z P_{l-1} - b P_{l-2}) for normalised functions, by (l, m)."""
    degree, m = np.mgrid[: order + 1, : order + 1].astype(np.float64)
    lower = degree - 1
    over = np.maximum(degree**2 - m**2, 1)
    first = np.sqrt(np.maximum(4 * degree**2 - 1, 0) / over)
    second = np.sqrt(np.maximum(lower**2 - m**2, 0) / np.maximum(4 * lower**2 - 1, 1))
    return first, second
