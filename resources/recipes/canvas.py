"""The sheet a recipe draws on: finer than the sample, periodic, measured in texels."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

from btfcore.btf.pbr import PbrSet
from btfcore.types import F4, F8

ORIGIN = "made for Patina, recipe {}"
_SPREAD = 0.5  # share of the slopes' variance inside a texel that turns into roughness
_WIDEST = 0.35  # largest squared GGX width that hidden slopes may add


@dataclass(frozen=True)
class Canvas:
    """A periodic square of `size` texels with `fine` × `fine` drawing samples a texel.

    detail : how many texels a side of the finished maps fall on one texel of the sample; maps
    finer than the sample are baked and then averaged, which softens shadows and glints.
    """

    size: int
    seed: int = 0
    fine: int = 4
    detail: int = 1

    @property
    def side(self) -> int:
        """Drawing samples along an edge."""
        return self.size * self.fine

    def rng(self, what: str) -> np.random.Generator:
        """Random numbers for one purpose, independent of the order of the calls."""
        return np.random.default_rng([self.seed, zlib.crc32(what.encode())])

    def grid(self) -> tuple[F8, F8]:
        """Rows (side, 1) and columns (1, side) of the drawing samples' centres, in texels."""
        line = (np.arange(self.side) + 0.5) / self.fine
        return line[:, None], line[None, :]

    def coarse(self, field: F8) -> F8:
        """Mean of a drawn field (side, side[, C]) over every texel of the maps."""
        rest, count, each = field.shape[2:], self.size * self.detail, self.fine // self.detail
        blocks = field.reshape(count, each, count, each, *rest)
        return blocks.mean(axis=(1, 3))

    def slopes(self, height: F8) -> tuple[F8, F8]:
        """Rise of `height` (texels) per texel along rows and along columns."""
        scale = self.fine / 2
        down = (np.roll(height, -1, 0) - np.roll(height, 1, 0)) * scale
        right = (np.roll(height, -1, 1) - np.roll(height, 1, 1)) * scale
        return down, right

    def finish(
        self,
        name: str,
        *,
        albedo: F8,
        height: F8,
        roughness: F8,
        metallic: F8 | None = None,
        ao: F8 | None = None,
        mask: F8 | None = None,
        texel_size: float,
        notes: tuple[str, ...] = (),
    ) -> PbrSet:
        """Return the drawn maps as a `PbrSet` of `size` × `detail` texels a side.

        height is in texels. What slopes vary within a texel widens its highlight: half their
        variance is added to the squared GGX width, which is roughness to the fourth power.
        """
        low = self.coarse(height)
        floor, top = float(low.min()), float(low.max())
        depth = max(top - floor, 1e-6)  # in texels of the sample
        hidden = sum(
            self.coarse(slope**2) - self.coarse(slope) ** 2 for slope in self.slopes(height)
        )
        width = self.coarse(roughness**2) ** 2 + np.minimum(_SPREAD * hidden, _WIDEST)
        return PbrSet(
            name,
            albedo=_map(self.coarse(albedo), 0.0, 0.95),
            height=_map((low - floor) / depth),
            roughness=_map(width**0.25, 0.15, 1.0),
            metallic=None if metallic is None else _map(self.coarse(metallic)),
            ao=None if ao is None else _map(self.coarse(ao)),
            mask=None if mask is None else _map(self.coarse(mask)),
            depth=depth * self.detail,
            tiles=True,
            texel_size=texel_size / self.detail,
            licence="CC0",
            citation="",
            origin=ORIGIN.format(name),
            notes=notes,
        )


def _map(field: F8, low: float = 0.0, high: float = 1.0) -> F4:
    return np.clip(field, low, high).astype(np.float32)
