"""A polynomial texture map as a stack of images: evaluated for each light when asked for."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from btfcore.btf.colour import srgb_to_linear
from btfcore.errors import InvalidParameter
from btfcore.types import F4, F8

_ROWS_AT_ONCE = 1 << 20  # texels


class PtmStack:
    """One view, as many images as `lights` (L, 3) f8.

    For a light l the value is Σ_k (c_k − bias_k) scale_k b_k / 255 with b = (lu², lv², lu lv,
    lu, lv, 1), lu and lv being l's first two components (Malzbender et al. 2001, eq. 5).
    coefficients : c, u1, (H, W, 6) for the luminance, which `colours` (H, W, 3) u1 / 255
    are multiplied by, or (3, H, W, 6) for red, green and blue by themselves; may be a mapped
    file. coded : values are sRGB-coded and linearised after evaluation. Negative ones are 0.
    """

    def __init__(
        self,
        coefficients: NDArray[np.uint8],
        colours: NDArray[np.uint8] | None,
        *,
        scale: F8,
        bias: F8,
        lights: F8,
        coded: bool = True,
    ) -> None:
        """Refer to the arrays; raises `InvalidParameter` for shapes that do not fit."""
        planes = coefficients if colours is None else coefficients[None]
        if planes.ndim != 4 or planes.shape[3] != 6 or len(planes) != (3 if colours is None else 1):
            raise InvalidParameter(f"PTM coefficients of shape {coefficients.shape}")
        if colours is not None and colours.shape != (*planes.shape[1:3], 3):
            raise InvalidParameter(f"PTM colours of shape {colours.shape} for {planes.shape}")
        self._planes = planes
        self._colours = colours
        self._coded = coded
        u, v = lights[:, 0], lights[:, 1]
        basis = np.stack([u * u, v * v, u * v, u, v, np.ones(len(lights))], axis=1)
        weights = basis * scale / 255
        self._weights = weights.astype(np.float32)  # (L, 6)
        self._offset = -(weights * bias).sum(axis=1)  # (L,)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of lights, rows, columns."""
        return len(self._weights), self._planes.shape[1], self._planes.shape[2]

    @property
    def dear(self) -> bool:
        """Reading computes."""
        return True

    def read(self, numbers: ArrayLike) -> F4:
        """Images under the lights `numbers` (n,), (n, H, W, 3) f4 linear radiance."""
        wanted = np.atleast_1d(np.asarray(numbers, np.int64))
        _, height, width = self.shape
        out = np.empty((len(wanted), height, width, 3), np.float32)
        step = max(1, _ROWS_AT_ONCE // width)
        for top in range(0, height, step):
            rows = slice(top, min(top + step, height))
            planes = self._planes[:, rows].astype(np.float32)
            colours = None
            if self._colours is not None:
                colours = self._colours[rows].astype(np.float32) / np.float32(255)
            for place, light in enumerate(wanted.tolist()):
                out[place, rows] = self._evaluated(planes, colours, light)
        return out

    def _evaluated(self, planes: F4, colours: F4 | None, light: int) -> F4:
        value = np.full(planes.shape[:3], self._offset[light], np.float32)
        for term in range(6):  # summed in this order, whatever BLAS would do
            value += planes[..., term] * self._weights[light, term]
        np.maximum(value, 0, out=value)
        rgb = np.moveaxis(value, 0, 2) if colours is None else value[0, :, :, None] * colours
        return srgb_to_linear(rgb) if self._coded else rgb
