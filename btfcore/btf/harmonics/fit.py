"""Spherical harmonics over the light, then PCA over everything else (Furukawa §2, eq. 1)."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext

import numpy as np

from btfcore.btf.harmonics.basis import evaluate, functions
from btfcore.btf.harmonics.conditioning import LIMIT
from btfcore.btf.harmonics.errors import ErrorSums
from btfcore.btf.harmonics.linear import cores, product, svd
from btfcore.btf.harmonics.operators import RIDGE, FitParameters, view_operators
from btfcore.btf.harmonics.pca import Axes, Moments, principal_axes
from btfcore.btf.harmonics.store import WeightStore
from btfcore.btf.harmonics.sweep import Sweep, by_texel, by_vector
from btfcore.btf.harmonics.values import HarmonicFactors
from btfcore.btf.materialize import materialize
from btfcore.btf.sample import BtfSample
from btfcore.errors import InvalidParameter
from btfcore.progress import Progress, between, silent
from btfcore.types import F8, I8

METRICS = ("radiance", "coefficients")
COMPONENTS = 16


def fit_harmonics(
    sample: BtfSample,
    *,
    order: int = 4,
    kind: str = "spherical",
    components: int = COMPONENTS,
    quadrature: str = "least_squares",
    ridge: float = RIDGE,
    weighting: str = "uniform",
    singular: str = "refuse",
    side: int = 32,
    below: str = "black",
    centred: bool = True,
    metric: str = "radiance",
    samples: int | None = None,
    seed: int = 0,
    half: bool = False,
    errors: bool = True,
    memory_mb: float = 2048,
    threads: int | None = None,
    progress: Progress = silent,
) -> HarmonicFactors:
    """Fit T(v, l, s, t, c) ≈ Σ_m (mean_mc + Σ_k W_k(v, s, t) b_kmc) Y_m(l) (Furukawa eq. 1).

    order 0 … 6, kind, quadrature, ridge, weighting, singular, side, below : how the
    coefficients of one (view, texel, colour) are found, see `operators.FitParameters`.
    components : number K ≥ 1 of principal components; fewer where the vectors span fewer.
    centred : take the mean vector off first; the paper's equation has none.
    metric : what PCA keeps. "radiance": the difference seen under the sample's lights, and
    distances of weights are (up to one factor) root mean square differences of radiance;
    "coefficients": that of the coefficients, as in the paper.
    samples : find the axes from so many vectors, drawn with `seed` (the paper's saving);
    None takes all. half : keep weights as half floats, scaled together so that none overflows.
    errors : measure them, which doubles the work of the second pass.
    memory_mb : what the work may hold in MiB; images are read twice, in bands of rows where a
    whole view does not fit, and weights over half of it go to an unnamed temporary file.
    threads : None for all cores; the result has the same bits for any number.

    The paper taken literally is quadrature="cubemap", metric="coefficients", centred=False and
    some number of `samples`.

    Raises `InvalidParameter` for knobs out of range and for an order that the lights do not
    determine, `InvalidBtf` where a view has no image; `progress` may raise `Cancelled`.
    """
    parameters = FitParameters(order, kind, quadrature, ridge, weighting, singular, side, below)
    _check(components, metric, samples, memory_mb, threads)
    operators, notes = view_operators(sample, parameters)
    sample = materialize(sample, memory_mb=memory_mb / 2, progress=between(progress, 0, 0.2))
    sweep = Sweep(
        sample,
        operators,
        functions=functions(order),
        components=components,
        memory_mb=memory_mb / 2,
    )
    number = cores() if threads is None else threads
    with ThreadPoolExecutor(number) if number > 1 else nullcontext() as pool:
        chosen = _drawn(sample, samples, seed)
        moments, largest = _gather(sweep, order, chosen, pool, between(progress, 0.2, 0.5))
        of = _metric(sample.lights, order, kind) if metric == "radiance" else None
        axes = principal_axes(moments, components, centred=centred, metric=of)
        shape = (len(sample.views), *sample.shape, len(axes.encode))
        store = WeightStore(shape, half=half, memory_mb=memory_mb / 2)
        scale = _scale(largest, axes) if half else 1.0
        sums = ErrorSums(sample) if errors else None
        _project(sweep, axes, scale, store, sums, pool, between(progress, 0.5, 1.0))
    return HarmonicFactors(
        name=sample.name,
        weights=store.weights(),
        components=(axes.decode * scale).T.reshape(-1, functions(order), 3).copy(),
        mean=axes.mean.reshape(-1, 3),
        views=sample.views.copy(),
        order=order,
        kind=kind,
        variances=axes.variances,
        errors=sums.result() if sums is not None else None,
        notes=notes,
    )


def _check(
    components: int, metric: str, samples: int | None, memory_mb: float, threads: int | None
) -> None:
    if components < 1:
        raise InvalidParameter(f"{components} components, where at least 1 is needed")
    if metric not in METRICS:
        raise InvalidParameter(f"metric={metric!r}; there are {' and '.join(METRICS)}")
    if samples is not None and samples < 1:
        raise InvalidParameter(f"{samples} vectors sampled, where at least 1 is needed")
    if not 1 <= memory_mb < np.inf:
        raise InvalidParameter(f"{memory_mb} MiB of memory, where at least 1 is needed")
    if threads is not None and threads < 1:
        raise InvalidParameter(f"{threads} threads, where at least 1 is needed")


def _drawn(sample: BtfSample, samples: int | None, seed: int) -> I8 | None:
    """Ascending numbers of the vectors, (view, row, column) flat, that PCA looks at."""
    total = len(sample.views) * int(np.prod(sample.shape))
    if samples is None or samples >= total:
        return None
    return np.sort(np.random.default_rng(seed).choice(total, samples, replace=False))


def _gather(
    sweep: Sweep, order: int, chosen: I8 | None, pool: ThreadPoolExecutor | None, progress: Progress
) -> tuple[Moments, float]:
    """Moments of the coefficient vectors, and the largest length among all of them."""
    moments, largest = Moments(3 * functions(order)), 0.0
    for band in sweep.bands(pool, progress, "fitting harmonics"):
        vectors = by_vector(band.coefficients)
        largest = max(largest, float((vectors * vectors).sum(axis=0).max()))
        if chosen is not None:
            first, last = np.searchsorted(chosen, [band.start, band.start + band.texels])
            vectors = vectors[:, chosen[first:last] - band.start]
        moments.add(vectors, pool=pool)
    return moments, float(np.sqrt(largest))


def _project(
    sweep: Sweep,
    axes: Axes,
    scale: float,
    store: WeightStore,
    sums: ErrorSums | None,
    pool: ThreadPoolExecutor | None,
    progress: Progress,
) -> None:
    """Fill the store, and measure what they stand for against the images."""
    for band in sweep.bands(pool, progress, "projecting on components"):
        vectors = by_vector(band.coefficients) - axes.mean[:, None]
        found = product(axes.encode, vectors, pool=pool) / scale
        stored = store.put(band.view, band.rows, found)
        if sums is not None:
            again = product(axes.decode * scale, stored, pool=pool) + axes.mean[:, None]
            sums.add(band, by_texel(again), pool)


def _metric(lights: F8, order: int, kind: str) -> F8:
    """Root (R, 3M) of the mean over the lights of what a vector of coefficients looks like."""
    _, singular, right = svd(evaluate(lights, order, kind))
    kept = singular > singular[0] / LIMIT
    root = (right * singular / np.sqrt(len(lights))).T[kept]
    return np.kron(root, np.eye(3))


def _scale(largest: float, axes: Axes) -> float:
    """Power of two that brings every weight below 2^15, and small ones away from 0."""
    length = np.sqrt((axes.encode**2).sum(axis=1).max())
    bound = length * (largest + np.sqrt((axes.mean**2).sum()))
    return float(2.0 ** (np.ceil(np.log2(bound)) - 15)) if bound > 0 else 1.0
