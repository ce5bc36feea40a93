"""The linear maps from radiance under the lights of a view to coefficients of harmonics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.btf.harmonics.basis import evaluate, functions, unit_directions
from btfcore.btf.harmonics.conditioning import LIMIT, check_order, explain
from btfcore.btf.harmonics.cubemap import light_angles, quadrature
from btfcore.btf.harmonics.linear import product, svd
from btfcore.btf.sample import BtfSample
from btfcore.errors import InvalidBtf, InvalidParameter
from btfcore.types import F8, I8

RIDGE = 1e-3


@dataclass(frozen=True)
class FitParameters:
    """How coefficients are found from radiance.

    order, kind : of the functions. quadrature : "least_squares", with `ridge` λ in units of
    tr(AᵀA) / M, `weighting` of the lights "uniform" or by their "solid_angle", and `singular`
    combinations to "refuse" or "regularise"; or "cubemap", the paper's sum over a cube map of
    `side` with directions `below` the horizon "black" or "mirrored". Raises
    `InvalidParameter` for values out of range.
    """

    order: int = 4
    kind: str = "spherical"
    quadrature: str = "least_squares"
    ridge: float = RIDGE
    weighting: str = "uniform"
    singular: str = "refuse"
    side: int = 32
    below: str = "black"

    def __post_init__(self) -> None:
        """Check the values that nothing further on checks."""
        if self.quadrature not in ("least_squares", "cubemap"):
            raise InvalidParameter(
                f"quadrature={self.quadrature!r}; there are 'least_squares' and 'cubemap'"
            )
        if self.weighting not in ("uniform", "solid_angle"):
            raise InvalidParameter(
                f"weighting={self.weighting!r}; there are 'uniform' and 'solid_angle'"
            )
        if not 0 <= self.ridge < np.inf:
            raise InvalidParameter(f"a ridge of {self.ridge}, where a number from 0 up is needed")


@dataclass(frozen=True)
class ViewOperator:
    """How one view is fitted: `images` (n,) of the stack are those under lights `lights` (n,).

    solve (M, n) takes their radiance to coefficients, design (n, M) takes those back.
    """

    lights: I8
    images: I8
    solve: F8
    design: F8


def least_squares(
    lights: F8,
    order: int,
    kind: str = "spherical",
    *,
    ridge: float = RIDGE,
    weights: F8 | None = None,
    limit: float = LIMIT,
) -> F8:
    """Linear map (M, L) from radiance under `lights` (L, 3) to coefficients, by least squares.

    Minimises Σ_l w_l (Σ_m c_m Y_m(l) - T_l)² + λ |c|² with λ = ridge · tr(AᵀWA) / M. What
    the lights determine `limit` times worse than the best-determined combination of functions
    is left at 0, so that singular combinations give the smallest solution. weights (L,) > 0.
    """
    values = evaluate(lights, order, kind)
    root = np.ones(len(lights)) if weights is None else np.sqrt(weights)
    left, singular, right = svd(values * root[:, None])
    penalty = ridge * float((singular**2).sum()) / values.shape[1]
    kept = singular > singular[0] / limit
    safe = np.where(kept, singular, 1)
    factor = np.where(kept, safe / (safe**2 + penalty), 0)
    return product(right * factor, np.ascontiguousarray(left.T)) * root


def view_operators(
    sample: BtfSample, parameters: FitParameters
) -> tuple[list[ViewOperator], tuple[str, ...]]:
    """Operators of all views, and notes on what was regularised or is missing.

    A view is fitted from the images that it has; views with the same lights share arrays.
    Raises `InvalidBtf` where a view has none, and `InvalidParameter` for a combination of
    order and lights that is singular, unless it is to be regularised.
    """
    made: dict[bytes, tuple[F8, F8]] = {}
    singular: dict[bytes, str] = {}
    out = []
    for view in range(len(sample.views)):
        there = np.flatnonzero(sample.index[view] >= 0)
        if len(there) == 0:
            raise InvalidBtf(f"{sample.name}: view {view} has no image under any light")
        key = there.tobytes()
        if key not in made:
            where = sample.name
            if len(there) < len(sample.lights):
                where += f": view {view}, {len(sample.lights) - len(there)} images missing"
            made[key], note = _operator(sample.lights[there], parameters, where)
            singular.update({key: note} if note else {})
        solve, design = made[key]
        images = sample.index[view, there].astype(np.int64)
        out.append(ViewOperator(there, images, solve, design))
    notes = [f"{note}: regularised" for note in dict.fromkeys(singular.values())]
    if sample.missing:
        notes.append(f"{sample.missing} images are missing; views are fitted from those they have")
    return out, tuple(notes)


def _operator(lights: F8, p: FitParameters, where: str) -> tuple[tuple[F8, F8], str]:
    design = evaluate(lights, p.order, p.kind)
    if p.quadrature == "cubemap":
        return (quadrature(lights, p.order, p.kind, side=p.side, below=p.below), design), ""
    found = check_order(lights, p.order, p.kind, singular=p.singular, name=where)
    weights = light_angles(lights) if p.weighting == "solid_angle" else None
    if weights is not None:
        weights = np.maximum(weights, weights.max() * 1e-6)
    solve = least_squares(lights, p.order, p.kind, ridge=p.ridge, weights=weights)
    return (solve, design), "" if found.sound else explain(found)


def coefficients(
    radiance: F8, lights: F8, parameters: FitParameters = FitParameters(), *, name: str = "lights"
) -> F8:
    """Coefficients (M, …) of radiance (L, …) under unit `lights` (L, 3): one fit, no PCA.

    Raises `InvalidParameter` where the shapes differ, values are not finite, lights are no
    unit vectors or the combination is refused.
    """
    values, lights = np.asarray(radiance), unit_directions(name, lights)
    if len(values) != len(lights):
        raise InvalidParameter(f"{name}: {len(values)} values for {len(lights)} lights")
    bad = int((~np.isfinite(values)).sum())
    if bad:
        raise InvalidParameter(f"{name}: {bad} of {values.size} values are not finite")
    (solve, _), _ = _operator(lights, parameters, name)
    flat = np.ascontiguousarray(values.reshape(len(lights), -1), np.float64)
    return product(solve, flat).reshape(functions(parameters.order), *values.shape[1:])
