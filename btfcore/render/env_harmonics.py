"""An environment map in real spherical harmonics, and how these are turned.

For what is rendered from harmonics (Furukawa §4): light and reflectance are then multiplied as
coefficients. Ringing of a small bright sun can be softened by a window.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from btfcore.btf.harmonics.basis import check_basis, degrees, evaluate
from btfcore.errors import InvalidParameter
from btfcore.render.environment import Environment
from btfcore.render.reference import quadrature
from btfcore.types import F8

WINDOWS = ("none", "hanning")
_BAND = 64  # rows of the map that are taken in double precision at a time
_UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # z, x, y to x, y, z


def environment_harmonics(environment: Environment, order: int = 4, *, window: str = "none") -> F8:
    """Coefficients (M, 3) f8, M = (order + 1)², of an environment in scene coordinates.

    c_m = ∫ E Y_m dω with the functions of `btfcore.btf.harmonics.basis.evaluate`, by Fejér's
    first rule over the polar angle: exact where the map is itself a sum of harmonics of
    degrees below H - order. window : "none", or "hanning": degree l is scaled by
    (1 + cos(πl / (order + 1))) / 2, which takes most of the ringing and some of the contrast
    (Sloan, "Stupid spherical harmonics tricks", 2008, windowing).
    Raises `InvalidParameter` for another window or order.
    """
    if window not in WINDOWS:
        raise InvalidParameter(f"window {window!r}; there are {' and '.join(WINDOWS)}")
    check_basis(order, "spherical")
    # around the vertical axis a map is a Fourier series in each row, so a basis whose polar axis
    # is vertical is summed up by rows and columns apart; then the axes are put back
    radiance = environment.radiance
    height, width = radiance.shape[:2]
    around = 2 * np.pi * ((np.arange(width) + 0.5) / width - 0.5)
    polar = np.pi * (np.arange(height) + 0.5) / height
    turns = np.arange(-order, order + 1)
    phase = np.outer(np.pi / 2 - around, np.abs(turns))  # from z to x
    waves = np.where(turns < 0, np.sin(phase), np.cos(phase))
    rows = np.empty((height, len(turns), 3))
    for start in range(0, height, _BAND):
        band = radiance[start : start + _BAND].astype(np.float64)
        rows[start : start + _BAND] = np.einsum("hwc,wm->hmc", band, waves)
    rows *= _row_shares(height)[:, None, None]
    meridian = np.stack([np.sin(polar), np.zeros(height), np.cos(polar)], axis=1)
    basis = evaluate(meridian, order)
    out = np.zeros(((order + 1) ** 2, 3))
    for number, (degree, m) in enumerate(degrees(order)):
        along = basis[:, degree * degree + degree + abs(m)]
        out[number] = np.einsum("h,hc->c", along, rows[:, order + m])
    out = rotated(out, _UPRIGHT)
    out *= environment.intensity
    if environment.rotation % 360.0:
        out = rotated_about_y(out, environment.rotation)
    return out if window == "none" else out * hanning(order)[:, None]


def hanning(order: int) -> F8:
    """Factors (M,) of the Hanning window: 1 for degree 0, falling to 0 beyond `order`."""
    degree = np.array([each for each, _ in degrees(order)])
    return (1 + np.cos(np.pi * degree / (order + 1))) / 2


def rotated(coefficients: F8, rotation: F8) -> F8:
    """Coefficients (M, …) of a function turned by `rotation` (3, 3): g(R d) = f(d).

    Exact (1e-13): harmonics of a degree stay among themselves. Raises `InvalidParameter`
    where that is no rotation, and for a number of coefficients that is no square of 1 … 7.
    """
    values = np.asarray(coefficients, np.float64)
    order = int(np.sqrt(len(values))) - 1
    if (order + 1) ** 2 != len(values):
        raise InvalidParameter(f"{len(values)} coefficients are no full orders of harmonics")
    matrix = np.asarray(rotation, np.float64)
    if matrix.shape != (3, 3) or not np.abs(matrix @ matrix.T - np.eye(3)).max() < 1e-9:
        raise InvalidParameter(f"no rotation: {matrix.tolist()}")
    check_basis(order, "spherical")
    return np.einsum("mk,k...->m...", _turning(order, matrix.tobytes()), values)


def rotated_about_y(coefficients: F8, angle: float) -> F8:
    """Coefficients (M, …) of a function turned by `angle` degrees about +y, from +z to +x."""
    turn = np.radians(angle % 360.0)
    c, s = np.cos(turn), np.sin(turn)
    return rotated(coefficients, np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]))


@lru_cache(maxsize=32)
def _turning(order: int, rotation: bytes) -> F8:
    """Matrix (M, M) of a rotation: ∫ Y_m(R d) Y_k(d) dω, exact by quadrature."""
    matrix = np.frombuffer(rotation).reshape(3, 3)
    points, share = quadrature(2 * order)
    after = evaluate(np.einsum("ij,qj->qi", matrix, points), order)
    return np.einsum("qm,qk,q->mk", after, evaluate(points, order), share)


def _row_shares(height: int) -> F8:
    """Solid angle (H,) that a texel of each row counts for (Fejér's first rule)."""
    polar = np.pi * (np.arange(height) + 0.5) / height
    even = np.arange(1, height // 2 + 1)
    series = np.cos(2 * np.outer(polar, even)) / (4 * even**2 - 1)
    return (2 / height) * (1 - 2 * series.sum(axis=1)) * np.pi / height
