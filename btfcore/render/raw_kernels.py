"""Radiance from a sample's own images: at most sixteen of them, each bilinear (Tong §6)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from btfcore.render.factor_kernels import add_light, corners, store
from btfcore.render.lookup import find_lights, find_views, scratch
from btfcore.render.lookup_tables import Lookup, lookup
from btfcore.render.material import RawMaterial
from btfcore.render.pool import BLOCK
from btfcore.render.rows import locked
from btfcore.types import F4

_ZERO = np.float32(0)


class RawTables(NamedTuple):
    """A `RawMaterial` as kernels take it: images (A·B, H·W, 3) f4, `nodes` being B."""

    images: F4
    nodes: int
    height: int
    across: int
    tiles: bool
    cosine: bool
    views: Lookup
    lights: Lookup


def raw_tables(material: RawMaterial) -> RawTables:
    """Lay a material out; its images are not copied."""
    views, lights, height, width, _ = material.images.shape
    images = np.ascontiguousarray(material.images, np.float32)
    return RawTables(
        locked(images.reshape(views * lights, height * width, 3)), lights, height, width,
        material.tiles, material.cosine, lookup(material.views),
        lookup(material.lights),
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def raw_slice(surfels, task, begin, end, eye, lights, visible, made, out):  # type: ignore[no-untyped-def]
    """Write the radiance of the task's rows begin … end; see `factor_slice`."""
    views, lamps = scratch(made.views.slots), scratch(made.lights.slots)
    found, sums = np.zeros((3, BLOCK), np.float32), np.empty((BLOCK, 3), np.float32)
    images = made.images
    for start in range(begin, end, BLOCK):
        count = min(BLOCK, end - start)
        find_views(made.views, surfels, task, eye, start, count, views)
        sums[:] = _ZERO
        for light in range(len(lights[0])):
            find_lights(
                made.lights, surfels, task, lights[0][light], made.cosine, start, count, lamps
            )
            for i in range(count):
                if not lamps.gain[i] > _ZERO:
                    continue
                n = task.numbers[task.rows[start + i]]
                at, part = corners(
                    surfels.source[n, 0], surfels.source[n, 1], made.height, made.across,
                    made.tiles,
                )  # fmt: skip
                red, green, blue = _ZERO, _ZERO, _ZERO
                for a in range(4):
                    for b in range(4):
                        share = views.share[i, a] * lamps.share[i, b]
                        if share == _ZERO:
                            continue
                        image = images[views.node[i, a] * made.nodes + lamps.node[i, b]]
                        for corner in range(4):
                            weight = share * part[corner]
                            red += weight * image[at[corner], 0]
                            green += weight * image[at[corner], 1]
                            blue += weight * image[at[corner], 2]
                found[0, i], found[1, i], found[2, i] = red, green, blue
            add_light(found, lamps.gain, lights[1][light], visible, light, task, start, count, sums)
        store(sums, task, start, count, out)
