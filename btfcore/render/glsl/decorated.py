"""A whole decorated surface packed for a shader, or why it cannot be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from btfcore.errors import InvalidParameter
from btfcore.render.glsl.samples import PackedSamples, pack, unfit
from btfcore.render.glsl.surface import PackedMaps, pack_maps
from btfcore.render.material import Material
from btfcore.render.surfels import Surfels
from btfcore.types import I4, Frozen


@dataclass(frozen=True, eq=False)
class PackedSurface(Frozen):
    """What a shader draws a surface from."""

    samples: PackedSamples
    maps: PackedMaps


def pack_surface(
    materials: Sequence[Material], surfels: Surfels, gutter: I4
) -> PackedSurface | str:
    """Pack samples, by number, and an atlas; see `pack` and `pack_maps`.

    Returns the reason, as a part of a sentence, where a shader cannot draw them; raises
    nothing. Takes some tenths of a second for an atlas of 1024 x 1024.
    """
    reason = unfit(materials, size=len(gutter))
    if reason:
        return reason
    try:
        samples = pack(materials)
        return PackedSurface(samples, pack_maps(surfels, gutter, samples))
    except (InvalidParameter, MemoryError) as error:
        return str(error) or "there is not enough memory for its textures"
