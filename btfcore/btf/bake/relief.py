"""The relief that a PBR set describes, with all that shading asks of a point on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from btfcore.btf.bake.depth import AGREES, DepthFit, dequantized, fitted_depth
from btfcore.btf.bake.slopes import (
    integrated,
    normals_of_slopes,
    slopes_of_height,
    slopes_of_normals,
)
from btfcore.btf.pbr import PbrSet
from btfcore.errors import InvalidParameter
from btfcore.types import F4, F8, Frozen

Plane = Literal["mean", "top"]

FRACTION = 1 / 50  # of the longer edge: depth of a height map that nothing tells the depth of
DEEPEST = 10  # times the longer edge; more is a mistake and would be traced for hours
SHARPEST = 0.01  # GGX alpha: a lobe as narrow as a lamp is wide, and safe in single precision

# Channels of `Relief.maps`.
NORMAL, DIFFUSE, MIRROR = 0, 3, 6  # three each
EDGE, ALPHA, OPEN = 9, 10, 11
CHANNELS = 12


@dataclass(frozen=True, eq=False)
class Relief(Frozen):
    """A height field (h, w) that repeats for ever, and its material.

    height f4 in texels; ceiling f4: highest corner of the cell that begins at each texel; maps
    (h, w, 12) f4: shading normal, diffuse albedo, reflectance at normal incidence (3 each), at
    grazing incidence, GGX alpha, openness. level (3,) f8: the reference plane's height, the
    highest, the lowest. coat (2,) f4: reflectance of dielectrics at normal and at grazing
    incidence. shape : rows and columns of the images; a set that does not tile is
    continued by its mirror images, so that h and w are twice as large. depth : height of a
    value of 1 in texels. notes : what was decided, fit for a user.
    """

    height: F4
    ceiling: F4
    maps: F4
    level: F8
    coat: F4
    shape: tuple[int, int]
    depth: float
    notes: tuple[str, ...] = ()

    @property
    def flat(self) -> bool:
        """Whether there is nothing to trace."""
        return bool(self.level[1] == self.level[2])


def relief(
    pbr: PbrSet,
    *,
    depth: Literal["auto"] | float = "auto",
    plane: Plane = "mean",
    integrate: bool = False,
    roughness: float = 0.7,
    reflectance: float = 0.04,
) -> Relief:
    """Return the relief of a PBR set; the knobs are those of `build.baked`.

    Raises `InvalidParameter` for a depth below 0 or above ten times the longer edge, and for a
    roughness or reflectance outside 0–1.
    """
    for label, value in (("roughness", roughness), ("reflectance", reflectance)):
        if not 0 <= value <= 1:
            raise InvalidParameter(f"{pbr.name}: a {label} of {value}, where 0 to 1 can be")
    if plane not in ("mean", "top"):
        raise InvalidParameter(f"{pbr.name}: the plane {plane!r}, where mean and top can be")
    notes: list[str] = []
    slopes = None if pbr.normal is None else slopes_of_normals(pbr.normal)
    deep = 0.0
    height = np.zeros(pbr.shape)
    if pbr.height is not None:
        even = dequantized(pbr.height, tiles=pbr.tiles)
        level = np.ptp(even) == 0
        deep = _depth(pbr, depth, even, [] if level else notes)
        notes += _contradictions(pbr, even)
        if level:
            notes.append("the height map is the same everywhere: the relief is flat")
        height = even.astype(np.float64) * deep
    elif slopes is not None and integrate:
        height = integrated(slopes, tiles=pbr.tiles)
        deep = float(np.ptp(height))
        notes.append(f"the normal map was integrated to a relief {deep:.2f} texels deep")
    else:
        notes.append("there is no height map: no parallax and no cast shadows")
        if pbr.ao is not None:
            notes.append("the occlusion map darkens the light, for want of cast shadows")
    if slopes is None:
        slopes = slopes_of_height(height, tiles=pbr.tiles)
    maps = _maps(pbr, normals_of_slopes(slopes), roughness, reflectance)
    if pbr.height is not None or integrate:
        maps[..., OPEN] = 1  # what occludes is traced
    level = np.array([height.mean(), height.max(), height.min()])
    if plane == "top":
        level[0] = level[1]
    if not pbr.tiles:
        height, maps = _doubled(height, maps)
    single = np.ascontiguousarray(height, np.float32)
    level[1:] = single.max(), single.min()
    coat = np.array([reflectance, _edge(np.float32(reflectance))], np.float32)
    return Relief(single, ceiling(single), maps, level, coat, pbr.shape, deep, tuple(notes))


def ceiling(height: F4) -> F4:
    """Highest corner of the cell that begins at each texel of a repeating field (h, w)."""
    beside = np.maximum(height, np.roll(height, -1, axis=1))
    return np.maximum(beside, np.roll(beside, -1, axis=0))


def _depth(pbr: PbrSet, wanted: Literal["auto"] | float, even: F4, notes: list[str]) -> float:
    longest = max(pbr.shape)
    value = pbr.depth if wanted == "auto" else wanted
    if value is not None:
        if isinstance(value, str) or not 0 <= value <= DEEPEST * longest:
            raise InvalidParameter(
                f"{pbr.name}: a depth of {value} texels, where 0 to {DEEPEST * longest} can be"
            )
        return float(value)
    fit = DepthFit(0.0, (0.0, 0.0))
    if pbr.normal is not None:
        fit = fitted_depth(even, pbr.normal, tiles=pbr.tiles)
    if fit.match >= AGREES and fit.depth <= longest:
        notes.append(fit.note)
        return fit.depth
    deep = longest * FRACTION
    why = "nothing tells it" if pbr.normal is None else "the normal map does not match"
    notes.append(f"depth {deep:.2f} texels, 1/{round(1 / FRACTION)} of the longer edge: {why}")
    return deep


def _contradictions(pbr: PbrSet, even: F4) -> list[str]:
    """Notes about height and normals that describe different reliefs; both are used as they are."""
    if pbr.normal is None:
        return []
    along, up = fitted_depth(even, pbr.normal, tiles=pbr.tiles).correlation
    notes = []
    if along <= -AGREES:
        notes.append("the height map seems to be white in the pits: the normal map contradicts it")
    if up * (-1 if along <= -AGREES else 1) <= -AGREES:
        notes.append("the normal map's green seems to point down: the height map contradicts it")
    return notes


def _maps(pbr: PbrSet, normal: F8, roughness: float, reflectance: float) -> F4:
    maps = np.empty((*pbr.shape, CHANNELS), np.float32)
    albedo = np.clip(pbr.albedo, 0, 1)
    metal = np.zeros(pbr.shape) if pbr.metallic is None else np.clip(pbr.metallic, 0, 1)
    rough = np.full(pbr.shape, roughness) if pbr.roughness is None else pbr.roughness
    metal = metal[..., None]
    mirror = reflectance * (1 - metal) + albedo * metal
    maps[..., NORMAL : NORMAL + 3] = normal
    maps[..., DIFFUSE : DIFFUSE + 3] = albedo * (1 - metal)
    maps[..., MIRROR : MIRROR + 3] = mirror
    maps[..., EDGE] = _edge(mirror.max(axis=2))
    maps[..., ALPHA] = np.maximum(np.clip(rough, 0, 1) ** 2, SHARPEST)
    maps[..., OPEN] = 1 if pbr.ao is None else np.clip(pbr.ao, 0, 1)
    return maps


def _edge(mirror: Any) -> Any:
    """Reflectance at grazing incidence: what reflects nothing straight on does not shine there."""
    return np.clip(50 * mirror, 0, 1)


def _doubled(height: F8, maps: F4) -> tuple[F8, F4]:
    """Continue a field by its mirror images, whose normals are mirrored too."""
    turned = maps[:, ::-1].copy()
    turned[..., NORMAL] *= -1
    maps = np.concatenate([maps, turned], axis=1)
    turned = maps[::-1].copy()
    turned[..., NORMAL + 1] *= -1
    height = np.concatenate([height, height[:, ::-1]], axis=1)
    return np.concatenate([height, height[::-1]], axis=0), np.concatenate([maps, turned], axis=0)
