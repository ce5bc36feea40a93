"""Lists of four numbers laid out in two-dimensional float textures, and how shaders read them.

A list of n texels fills the rows of a texture whose width is a power of two, so that a shader
splits the place in the list by a shift and a mask.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from btfcore.errors import InvalidParameter
from btfcore.types import F4, Frozen

LARGEST = 8192  # side of a texture that every card of the last fifteen years has


@dataclass(frozen=True, eq=False)
class List(Frozen):
    """A list of four-vectors as a texture: image (rows, 2^shift, 4) f4."""

    image: F4
    shift: int


def listed(parts: list[F4], largest: int = LARGEST) -> List:
    """Lay out arrays (n_i, 4) one after the other; raises `InvalidParameter` for too many."""
    count = sum(len(part) for part in parts)
    shift = shift_of(count, largest)
    width = 1 << shift
    image = np.zeros((max(-(-count // width), 1), width, 4), np.float32)
    flat = image.reshape(-1, 4)
    place = 0
    for part in parts:
        flat[place : place + len(part)] = part
        place += len(part)
    return List(image, shift)


def shift_of(count: int, largest: int = LARGEST) -> int:
    """Logarithm of the width that holds `count` texels; raises `InvalidParameter`."""
    shift = 0
    while (1 << (2 * shift)) < count:
        shift += 1
    if (1 << shift) > largest:
        raise InvalidParameter(
            f"{count} texels of four numbers, where a texture of {largest} x {largest} is the limit"
        )
    return shift


def in_fours(rows: NDArray[np.floating]) -> F4:
    """Rows (n, K) padded with zeros to (n, ⌈K/4⌉, 4) f4."""
    count, width = rows.shape
    blocks = -(-width // 4)
    out = np.zeros((count, blocks * 4), np.float32)
    out[:, :width] = rows
    return out.reshape(count, blocks, 4)
