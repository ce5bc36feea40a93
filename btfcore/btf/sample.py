"""A BTF: images of a material under pairs of view and light, and its factorised form."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from btfcore.btf.stack import ArrayStack, CropStack, ImageStack, SubsetStack
from btfcore.errors import InvalidBtf
from btfcore.types import F4, F8, I4, Frozen

NORMAL = np.array([[0.0, 0.0, 1.0]])
_UNIT = 1e-4
_SAME = 1e-5  # radians; closer directions are one and the same


@dataclass(frozen=True)
class Encoding:
    """How radiance was coded before factorising; distances are measured in coded values.

    name : "linear", "sqrt", "log" or "logluma" (log-luminance with chroma ratios).
    epsilon : what is added before a logarithm. knee : radiance above which highlights were
    compressed before coding (decoding undoes it), or None.
    """

    name: str = "sqrt"
    epsilon: float = 1e-3
    knee: float | None = None


@dataclass(frozen=True, eq=False)
class BtfFactors(Frozen):
    """f(x, v, l) ≈ Σ_k g_k(x) p_k(v, l) in coded values (Zhou §III-B, "Handling BTF Values").

    weights (H, W, K) f4: geometry maps times singular values, so that their Euclidean
    distance is the coded BTF's own; basis (J, 3, K) f4: eigen point-appearance functions,
    orthonormal over images × colours, image j being that of `BtfSample.index`; mean (J, 3) f4:
    added to the sum; singular (K,) f8, descending; error: relative L2 error in coded values;
    notes: sentences fit for a user, such as that a wanted error was not reached.
    """

    weights: F4
    basis: F4
    mean: F4
    singular: F8
    encoding: Encoding
    error: float = float("nan")
    notes: tuple[str, ...] = field(default=())

    @property
    def rank(self) -> int:
        """Number K of factors."""
        return self.weights.shape[2]


@dataclass(frozen=True, eq=False)
class BtfSample(Frozen):
    """Images × (view, light) directions of one material sample.

    stack : J images (H, W) of linear Rec. 709 radiance, HDR, row 0 on top.
    views (V, 3), lights (L, 3) f8: unit vectors away from the surface in the local frame
    (s = +column, t = -row, n = normal). index (V, L) i4: image of the pair, -1 where missing.
    mask (H, W) f4 in 0–1: the feature (imperfection), or None. tiles : opposite borders fit.
    texel_size : edge of a texel in millimetres, None where unknown. cosine : the values
    include the cosine of the light's polar angle. factors : where the sample came factorised.
    Raises `InvalidBtf` where the parts contradict each other.
    """

    name: str
    stack: ImageStack
    views: F8
    lights: F8
    index: I4
    mask: F4 | None = None
    tiles: bool = False
    texel_size: float | None = None
    cosine: bool = True
    licence: str = ""
    citation: str = ""
    origin: str = ""
    notes: tuple[str, ...] = field(default=())
    factors: BtfFactors | None = None

    def __post_init__(self) -> None:
        """Check the parts against each other, then lock the arrays."""
        _check_directions(self.name, "view", self.views)
        _check_directions(self.name, "light", self.lights)
        _check_index(self)
        count, height, width = self.stack.shape
        if self.mask is not None and self.mask.shape != (height, width):
            raise InvalidBtf(
                f"{self.name}: a mask of {self.mask.shape[1]} x {self.mask.shape[0]} texels for"
                f" images of {width} x {height}"
            )
        if self.texel_size is not None and not 0 < self.texel_size < np.inf:
            raise InvalidBtf(f"{self.name}: a texel size of {self.texel_size} mm")
        if self.factors is not None and self.factors.basis.shape[0] != count:
            raise InvalidBtf(
                f"{self.name}: factors of {self.factors.basis.shape[0]} images for {count}"
            )
        super().__post_init__()

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of every image."""
        return self.stack.shape[1], self.stack.shape[2]

    @property
    def images(self) -> int:
        """Number J of images."""
        return self.stack.shape[0]

    @property
    def missing(self) -> int:
        """Number of (view, light) pairs without an image."""
        return int((self.index < 0).sum())

    @property
    def is_image(self) -> bool:
        """Whether this is an ordinary picture: one view, one light."""
        return self.images == 1

    def pairs(self) -> I4:
        """Return view and light of every image, (J, 2) i4."""
        out = np.empty((self.images, 2), np.int32)
        view, light = np.nonzero(self.index >= 0)
        out[self.index[view, light]] = np.stack([view, light], axis=1)
        return out

    def image(self, view: int, light: int) -> F4:
        """Radiance (H, W, 3) f4 of one pair; raises `InvalidBtf` where it is missing."""
        number = int(self.index[view, light])
        if number < 0:
            raise InvalidBtf(f"{self.name}: no image of view {view} under light {light}")
        return self.stack.read([number])[0]


def full_index(views: int, lights: int) -> I4:
    """Index (V, L) i4 of a complete set in which the light runs fastest."""
    return np.arange(views * lights, dtype=np.int32).reshape(views, lights)


def from_picture(name: str, colours: ArrayLike, **details: object) -> BtfSample:
    """Return an ordinary picture (H, W, 3) as a BTF of one view and one light.

    u1 and u2 are sRGB-coded, floats linear; `details` are further fields of `BtfSample`.
    """
    stack = ArrayStack(np.asarray(colours)[None])
    return BtfSample(name, stack, NORMAL.copy(), NORMAL.copy(), full_index(1, 1), **details)  # type: ignore[arg-type]


def cropped(sample: BtfSample, rows: slice, columns: slice) -> BtfSample:
    """Return the window `rows` × `columns` of a sample; it no longer tiles."""
    stack = CropStack(sample.stack, rows, columns)
    mask = None if sample.mask is None else sample.mask[rows, columns].copy()
    factors = sample.factors
    if factors is not None:
        factors = replace(factors, weights=factors.weights[rows, columns].copy())
    return replace(sample, stack=stack, mask=mask, factors=factors, tiles=False)


def subset(sample: BtfSample, views: ArrayLike, lights: ArrayLike) -> BtfSample:
    """Return the sample under some of its views and lights only."""
    chosen = np.ix_(np.asarray(views, np.int64), np.asarray(lights, np.int64))
    old = sample.index[chosen]
    index = np.full(old.shape, -1, np.int32)
    index[old >= 0] = np.arange((old >= 0).sum())
    numbers = old[old >= 0]
    factors = sample.factors
    if factors is not None:
        factors = replace(factors, basis=factors.basis[numbers], mean=factors.mean[numbers])
    return replace(
        sample,
        stack=SubsetStack(sample.stack, numbers),
        views=sample.views[np.asarray(views, np.int64)],
        lights=sample.lights[np.asarray(lights, np.int64)],
        index=index,
        factors=factors,
    )


def _check_directions(name: str, kind: str, directions: F8) -> None:
    if directions.ndim != 2 or directions.shape[1] != 3 or len(directions) == 0:
        raise InvalidBtf(f"{name}: {kind} directions of shape {directions.shape}, not (n, 3)")
    length = np.linalg.norm(directions, axis=1)
    wrong = ~(np.abs(length - 1) < _UNIT)
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        raise InvalidBtf(f"{name}: {kind} {first} is no unit vector, its length is {length[first]}")
    if (directions[:, 2] < -_UNIT).any():
        first = int(np.argmin(directions[:, 2]))
        raise InvalidBtf(
            f"{name}: {kind} {first} lies below the horizon (z = {directions[first, 2]:.4f})"
        )
    if len(directions) > 1:
        from scipy.spatial import cKDTree

        near = cKDTree(directions).query_pairs(_SAME)
        if near:
            one, two = min(near)
            raise InvalidBtf(
                f"{name}: {kind}s {one} and {two} are the same direction, and {len(near)} pairs"
                " of directions are repeated in all"
            )


def _check_index(sample: BtfSample) -> None:
    name, index, count = sample.name, sample.index, sample.stack.shape[0]
    if index.shape != (len(sample.views), len(sample.lights)):
        raise InvalidBtf(
            f"{name}: an index of shape {index.shape} for {len(sample.views)} views and"
            f" {len(sample.lights)} lights"
        )
    used = np.sort(index[index >= 0])
    if not np.array_equal(used, np.arange(count)):
        raise InvalidBtf(
            f"{name}: the index names {len(used)} images, each of the {count} images must be"
            " named once"
        )
