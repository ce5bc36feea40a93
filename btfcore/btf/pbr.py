"""A PBR texture set: the maps that artists own, as plain arrays ready for baking."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from btfcore.errors import InvalidBtf
from btfcore.types import F4, Frozen

SINGLE = ("height", "roughness", "metallic", "ao", "mask")


@dataclass(frozen=True, eq=False)
class PbrSet(Frozen):
    """Aligned maps of one size (H, W), row 0 on top; every map but the albedo may be None.

    albedo (H, W, 3) f4 linear base colour in 0–1; height (H, W) f4 in 0–1, 1 nearest to the
    viewer; normal (H, W, 3) f4 unit vectors in the local frame (x = +column, y = -row, z =
    outward: the "OpenGL" convention); roughness, metallic, ao (ambient occlusion, 1 = open)
    and mask (the feature) (H, W) f4 in 0–1. depth : how far height 1 lies above height 0, in
    texels, or None where only the baker can tell. tiles : opposite borders fit each other.
    texel_size : edge of a texel in millimetres, or None.
    Raises `InvalidBtf` where sizes differ or values are not finite.
    """

    name: str
    albedo: F4
    height: F4 | None = None
    normal: F4 | None = None
    roughness: F4 | None = None
    metallic: F4 | None = None
    ao: F4 | None = None
    mask: F4 | None = None
    depth: float | None = None
    tiles: bool = True
    texel_size: float | None = None
    licence: str = ""
    citation: str = ""
    origin: str = ""
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        """Check shapes and values, then lock the arrays."""
        if self.albedo.ndim != 3 or self.albedo.shape[2] != 3 or self.albedo.size == 0:
            raise InvalidBtf(f"{self.name}: an albedo map of shape {self.albedo.shape}")
        height, width = self.albedo.shape[:2]
        for item in fields(self):
            value = getattr(self, item.name)
            if not isinstance(value, np.ndarray):
                continue
            wanted = (height, width) if item.name in SINGLE else (height, width, 3)
            if value.shape != wanted:
                raise InvalidBtf(
                    f"{self.name}: the {item.name} map has shape {value.shape}, not {wanted}"
                )
            if not np.isfinite(value).all():
                wrong = int((~np.isfinite(value)).sum())
                raise InvalidBtf(f"{self.name}: {wrong} values of the {item.name} map not finite")
        super().__post_init__()

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of every map."""
        height, width, _ = self.albedo.shape
        return height, width
