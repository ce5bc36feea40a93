"""The list of the samples that ship."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from btfcore.btf.pbr import PbrSet
from resources.recipes.brick import brick
from resources.recipes.canvas import Canvas
from resources.recipes.cracked import cracked_brick
from resources.recipes.gravel import gravel
from resources.recipes.knit import pulled_knit, wool_knit
from resources.recipes.leather import leather
from resources.recipes.linen import linen, stained_linen
from resources.recipes.moss import mossy_stone
from resources.recipes.paint import painted_metal
from resources.recipes.rust import rusty_paint
from resources.recipes.scratched import scratched_varnish
from resources.recipes.stone import stone
from resources.recipes.wood import varnished_wood


@dataclass(frozen=True)
class Recipe:
    """One sample: its drawing, edge in texels, seed and number of factors.

    base : name of the sample whose material surrounds the imperfection, or "" where there is
    none.
    """

    name: str
    draw: Callable[[Canvas], PbrSet]
    size: int
    seed: int
    rank: int
    base: str = ""

    def maps(self, detail: int = 1) -> PbrSet:
        """Draw the maps, `detail` times finer than the sample."""
        return self.draw(Canvas(self.size, self.seed, detail=detail))


RECIPES = {
    each.name: each
    for each in (
        Recipe("brick", brick, 192, 5, 30),
        Recipe("gravel", gravel, 128, 8, 40),
        Recipe("knit", wool_knit, 128, 1, 38),
        Recipe("leather", leather, 128, 7, 26),
        Recipe("linen", linen, 128, 2, 36),
        Recipe("painted-metal", painted_metal, 128, 3, 16),
        Recipe("stone", stone, 128, 6, 36),
        Recipe("varnished-wood", varnished_wood, 128, 4, 12),
        Recipe("cracked-brick", cracked_brick, 192, 15, 30, "brick"),
        Recipe("mossy-stone", mossy_stone, 192, 16, 36, "stone"),
        Recipe("pulled-knit", pulled_knit, 192, 11, 36, "knit"),
        Recipe("rusty-paint", rusty_paint, 192, 13, 22, "painted-metal"),
        Recipe("scratched-varnish", scratched_varnish, 192, 14, 16, "varnished-wood"),
        Recipe("stained-linen", stained_linen, 192, 12, 28, "linen"),
    )
}
