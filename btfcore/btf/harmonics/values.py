"""What the harmonic fit returns: weights over texels, components over the light, errors."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.harmonics.basis import check_basis, functions
from btfcore.errors import InvalidBtf
from btfcore.types import F8, Frozen


@dataclass(frozen=True, eq=False)
class HarmonicErrors(Frozen):
    """Errors of a fit against the images that it was made from; all norms in f8.

    truncation : relative L2 error of the series before PCA; pca : of what PCA then drops,
    over the same norm; total : of both together (for unweighted least squares without ridge
    total² = truncation² + pca²). They are of linear radiance before negative values are cut.
    srgb_truncation, srgb : root mean square of the sRGB-coded difference, the mean over the
    images; srgb_worst : of the worst image, worst : its (view, light).
    per_view (V, 3) f8 : truncation, pca and total of every view.
    """

    truncation: float
    pca: float
    total: float
    srgb_truncation: float
    srgb: float
    srgb_worst: float
    worst: tuple[int, int]
    per_view: F8


@dataclass(frozen=True, eq=False)
class HarmonicFactors(Frozen):
    """T(v, l, s, t, c) ≈ Σ_m (mean_mc + Σ_k W_k(v, s, t) b_kmc) Y_m(l), linear radiance.

    Furukawa §2 eq. 1, in which there is no mean: it is 0 where the fit was not centred.
    weights (V, H, W, K) f4 or f2, maybe a mapped file: W_k; components (K, M, 3) f8: b_kmc;
    mean (M, 3) f8. views (V, 3) f8: unit view directions; order, kind: of the functions Y_m
    (`basis.evaluate`), M = (order + 1)². variances (R,) f8, R ≤ 3M: of the vectors along
    all principal axes, descending, those that were dropped included. errors : None where they
    were not measured. notes : sentences fit for a user.
    Raises `InvalidBtf` where the shapes contradict each other.
    """

    name: str
    weights: NDArray[Any]
    components: F8
    mean: F8
    views: F8
    order: int
    kind: str
    variances: F8
    errors: HarmonicErrors | None = None
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        """Check the shapes against each other, then lock the arrays."""
        check_basis(self.order, self.kind)
        count = functions(self.order)
        if self.weights.ndim != 4 or self.weights.dtype not in (np.float32, np.float16):
            raise InvalidBtf(
                f"{self.name}: weights of shape {self.weights.shape} and {self.weights.dtype},"
                " where (V, H, W, K) f4 or f2 are needed"
            )
        views, _, _, rank = self.weights.shape
        for what, array, shape in (
            ("components", self.components, (rank, count, 3)),
            ("mean", self.mean, (count, 3)),
            ("views", self.views, (views, 3)),
        ):
            if array.shape != shape:
                raise InvalidBtf(f"{self.name}: {what} of shape {array.shape}, not {shape}")
        super().__post_init__()

    @property
    def rank(self) -> int:
        """Number K of components."""
        return self.weights.shape[3]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of every image."""
        return self.weights.shape[1], self.weights.shape[2]
