"""Surfels that meet given local views and lights, and materials of every kind."""

import numpy as np

from btfcore.btf.harmonics.fit import fit_harmonics
from btfcore.render.lights import directional
from btfcore.render.material import factor_material, harmonic_material, raw_material
from btfcore.render.surfels import Surfels
from tests.render.shaded import factored, pictured

AT_ORIGIN = np.array([0.0, 0.0, 0.0, 1.0])
UP = directional([0.0, 0.0, 1.0])


def arranged(views, lights, source):
    """Surfels that an eye at the origin and a light along +z meet from given local directions.

    views, lights (n, 3): unit, in the surfels' own frames. So one call answers a whole sweep.
    """
    views, lights = np.atleast_2d(views), np.atleast_2d(lights)
    count = len(lights)
    frame = _turns(lights).astype(np.float32)
    # the eye is where the local view points, at distance 1
    away = np.einsum("nij,ni->nj", frame.astype(np.float64), views)
    return Surfels(
        -away.astype(np.float32), frame,
        np.broadcast_to(np.asarray(source, np.float32), (count, 2)).copy(),
        np.zeros(count, np.uint16),
    )  # fmt: skip


def _turns(vectors):
    """Rotations (n, 3, 3) that take +z to unit vectors: two reflections each."""
    pole = np.where(vectors[:, 2:] > 0, -1.0, 1.0) * [0.0, 0.0, 1.0]
    first = np.eye(3) - 2 * pole[:, :, None] * pole[:, None, :]  # +z to -z, whichever the pole
    axis = vectors - np.array([0.0, 0.0, -1.0])
    low = vectors[:, 2] <= 0
    # from -z to the vector by a mirror; where that is degenerate from +z, with a mirror before
    axis[low] = vectors[low] - [0.0, 0.0, 1.0]
    first[low] = np.diag([1.0, -1.0, 1.0])
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    second = np.eye(3) - 2 * axis[:, :, None] * axis[:, None, :]
    return second @ first


def every_material(directions="6x2x5x2"):
    """Name and material of every representation, code and interpolation."""
    methods = ("grid", "barycentric", "nearest4", "nearest")
    for method in methods:
        yield f"sqrt {method}", factor_material(factored(directions=directions), method=method)
        yield f"raw {method}", raw_material(pictured(directions=directions), method=method)
    for code in ("linear", "log", "logluma"):
        sample = factored(directions=directions, encoding=code, tiles=True, cosine=False)
        yield code, factor_material(sample)
    yield "sqrt with a knee", factor_material(factored(directions=directions, knee=0.5))
    sample = pictured(directions="6x3x6x3")
    for kind in ("spherical", "hemispherical"):
        fitted = fit_harmonics(sample, order=2, kind=kind, errors=False)
        yield f"{kind} harmonics", harmonic_material(fitted, sample)
