"""What a sample is rendered from: tables over nodes of view and light, and maps over texels.

A direction is looked up as at most four nodes (`DirectionInterpolator.node_weights`): the
sample's own directions, and a made-up one on the normal where a grid has none there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from btfcore.btf.harmonics.values import HarmonicFactors
from btfcore.btf.interpolation.interpolator import DirectionInterpolator
from btfcore.btf.interpolation.pairs import nearest_images
from btfcore.btf.interpolation.radiance import prepared
from btfcore.btf.sample import BtfFactors, BtfSample, Encoding, from_picture
from btfcore.errors import InvalidBtf, InvalidParameter
from btfcore.progress import Progress, silent
from btfcore.types import F4, I4, Frozen

REPRESENTATIONS = ("auto", "factors", "raw", "harmonics")
RANK = 40  # factors of a sample that comes without
_GREY = 0.2140  # linear radiance of the grey that bare surfaces are drawn in


@dataclass(frozen=True, eq=False)
class FactorMaterial(Frozen):
    """Coded radiance Σ_ab α_a β_b (Σ_k table[a, b, c, k] w_k + table[a, b, c, K]), then decoded.

    weights (H, W, K) f4: w; table (A, B, 3, K + 1) f4 over nodes of view and light, the last
    column the mean; views, lights: what the nodes and their shares α, β are found with;
    encoding: undone after blending; cosine: radiance includes that of the light's angle.
    """

    name: str
    weights: F4
    table: F4
    views: DirectionInterpolator
    lights: DirectionInterpolator
    encoding: Encoding
    tiles: bool = False
    cosine: bool = True

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of texels."""
        return self.weights.shape[0], self.weights.shape[1]

    @property
    def rank(self) -> int:
        """Number K of factors."""
        return self.weights.shape[2]


@dataclass(frozen=True, eq=False)
class RawMaterial(Frozen):
    """Radiance Σ_ab α_a β_b images[a, b] (Tong §5 and §6, 4 × 4 images a vertex).

    images (A, B, H, W, 3) f4 linear radiance of every pair of nodes.
    """

    name: str
    images: F4
    views: DirectionInterpolator
    lights: DirectionInterpolator
    tiles: bool = False
    cosine: bool = True

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of texels."""
        return self.images.shape[2], self.images.shape[3]


@dataclass(frozen=True, eq=False)
class HarmonicMaterial(Frozen):
    """Radiance Σ_m (Σ_k w_k components[k, m] + components[K, m]) Y_m(l) (Furukawa §2 eq. 1).

    weights (A, H, W, K) f4 of every view node, blended by their shares; components
    (K + 1, M, 3) f4, the last the mean. order, kind: of the functions Y_m. horizon: cosine of
    the polar angle of the outermost light that it was fitted to.
    """

    name: str
    weights: F4
    components: F4
    views: DirectionInterpolator
    order: int
    kind: str
    horizon: float
    tiles: bool = False

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of texels."""
        return self.weights.shape[1], self.weights.shape[2]

    @property
    def rank(self) -> int:
        """Number K of components."""
        return self.weights.shape[3]


Material = FactorMaterial | RawMaterial | HarmonicMaterial


def material(
    sample: BtfSample,
    *,
    representation: str = "auto",
    method: str = "auto",
    memory_mb: float = 2048,
    progress: Progress = silent,
) -> Material:
    """Return what `sample` is rendered from.

    representation : "factors" (factorised here where it is not yet; a picture's factors are
    its colours), "raw" (its images; a factorised sample's are those of its factors),
    "harmonics" (fitted here, with their default knobs; a picture stays one), or "auto": factors.
    method : how directions are interpolated, see `btfcore.btf.interpolation.interpolator.prepare`.
    Raises `InvalidParameter`, `InvalidBtf`.
    """
    if representation not in REPRESENTATIONS:
        raise InvalidParameter(
            f"no representation {representation!r}; there are {', '.join(REPRESENTATIONS)}"
        )
    if representation == "raw":
        return raw_material(sample, method=method, memory_mb=memory_mb)
    if representation == "harmonics" and not sample.is_image:
        from btfcore.btf.harmonics.fit import fit_harmonics

        fitted = fit_harmonics(sample, errors=False, memory_mb=memory_mb, progress=progress)
        return harmonic_material(fitted, sample, method=method)
    if sample.factors is None and not sample.is_image:
        from btfcore.btf.factor.svd import factorize

        made = factorize(sample, rank=RANK, memory_mb=memory_mb, progress=progress)
        sample = replace(sample, factors=made)
    return factor_material(sample, method=method)


def factor_material(sample: BtfSample, *, method: str = "auto") -> FactorMaterial:
    """Return what a factorised sample or an ordinary picture is rendered from.

    A picture is Lambertian: its linear colours, dimmed by the light's cosine. Raises
    `InvalidBtf` for a BTF that is not factorised, `InvalidParameter` for the method.
    """
    views, lights = prepared(sample, method)
    factors = sample.factors
    if factors is None:
        if not sample.is_image:
            raise InvalidBtf(f"{sample.name}: it must be factorised to be rendered from factors")
        factors = _own_colours(sample)
    index = _complete(sample)
    rows = np.concatenate([factors.basis, factors.mean[..., None]], axis=2).astype(np.float32)
    table = _with_poles(rows[index], views, lights)
    return FactorMaterial(
        sample.name, np.ascontiguousarray(factors.weights, np.float32), table, views, lights,
        factors.encoding, sample.tiles, sample.cosine,
    )  # fmt: skip


def raw_material(
    sample: BtfSample, *, method: str = "auto", memory_mb: float = 2048
) -> RawMaterial:
    """Return a sample's images, ready to be rendered; raises `InvalidParameter` for too many."""
    views, lights = prepared(sample, method)
    nodes = len(views.mix) * len(lights.mix)
    height, width = sample.shape
    needed = nodes * height * width * 12 / 2**20
    if needed > memory_mb:
        raise InvalidParameter(
            f"{sample.name}: {nodes} images of {width} x {height} texels need {needed:.0f} MiB,"
            f" {memory_mb:.0f} are allowed; render it from factors"
        )
    index = _complete(sample)
    images = np.empty((*index.shape, height, width, 3), np.float32)
    for view, row in enumerate(index):
        images[view] = sample.stack.read(row)
    return RawMaterial(
        sample.name, _with_poles(images, views, lights), views, lights, sample.tiles,
        sample.cosine,
    )  # fmt: skip


def harmonic_material(
    factors: HarmonicFactors, sample: BtfSample, *, method: str = "auto"
) -> HarmonicMaterial:
    """Return what a sample's harmonics are rendered from; raises `InvalidParameter`."""
    if len(factors.views) != len(sample.views) or factors.shape != sample.shape:
        raise InvalidParameter(
            f"{sample.name}: harmonics of {len(factors.views)} views and {factors.shape} texels"
            f" for a sample of {len(sample.views)} and {sample.shape}"
        )
    views, _ = prepared(sample, method)
    weights = _with_pole(np.asarray(factors.weights, np.float32), views)
    components = np.concatenate([factors.components, factors.mean[None]]).astype(np.float32)
    return HarmonicMaterial(
        sample.name, weights, components, views, factors.order, factors.kind,
        max(float(sample.lights[:, 2].min()), 1e-3), sample.tiles,
    )  # fmt: skip


def truncated(material: FactorMaterial, rank: int) -> FactorMaterial:
    """Return the material with its first `rank` factors only, the best of that number."""
    if not 0 <= rank <= material.rank:
        raise InvalidParameter(f"{material.name}: {rank} of {material.rank} factors")
    table = np.concatenate([material.table[..., :rank], material.table[..., -1:]], axis=3)
    return replace(
        material, weights=np.ascontiguousarray(material.weights[..., :rank]), table=table
    )


def bare_material() -> FactorMaterial:
    """Return what bare surfels are rendered from: a grey that is dimmed by the light's cosine."""
    return factor_material(from_picture("bare", np.full((1, 1, 3), _GREY, np.float32)))


# --- inside


def _own_colours(sample: BtfSample) -> BtfFactors:
    colours = sample.stack.read([0])[0]
    return BtfFactors(
        colours, np.eye(3, dtype=np.float32)[None], np.zeros((1, 3), np.float32), np.ones(3),
        Encoding("linear"), 0.0,
    )  # fmt: skip


def _complete(sample: BtfSample) -> I4:
    """Image (V, L) of every pair; those that are missing take the nearest there is.

    Filled once rather than renormalised per query, so that radiance stays continuous.
    """
    index = sample.index.copy()
    view, light = np.nonzero(index < 0)
    if len(view):
        index[view, light] = nearest_images(sample, view, light)
    return index


def _with_poles(values: Any, views: DirectionInterpolator, lights: DirectionInterpolator) -> F4:
    """Values (V, L, …) over directions, with those of made-up nodes: (A, B, …) f4."""
    full = _with_pole(values, views)
    swapped = _with_pole(np.swapaxes(full, 0, 1), lights)
    return np.ascontiguousarray(np.swapaxes(swapped, 0, 1))


def _with_pole(values: F4, directions: DirectionInterpolator) -> F4:
    """Values (D, …) with the mean of the first ring at the end where that is a node."""
    mix = directions.mix
    if len(mix) == len(values):
        return values
    ring = np.flatnonzero(mix[-1])
    mean = values[ring].mean(axis=0, dtype=np.float64)
    return np.concatenate([values, mean[None].astype(np.float32)])
