"""Values between the texels of images: bilinear, periodic or held at the border."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.types import F4, F8


def bilinear(images: F4, where: F8, *, tiles: bool = False) -> F4:
    """Values (n, …, C) f4 of images (n, H, W, C) at positions (…, 2) as (column, row).

    Whole numbers are texel centres and give the texels' own values, bit for bit. Outside the
    centres' rectangle the image repeats with `tiles`; otherwise the nearest border counts.
    """
    _, height, width, _ = images.shape
    column, right, across = _between(where[..., 0], width, tiles)
    row, below, down = _between(where[..., 1], height, tiles)
    upper = _mixed(images[:, row, column], images[:, row, right], across)
    if not down.any():
        return upper
    return _mixed(upper, _mixed(images[:, below, column], images[:, below, right], across), down)


def _between(place: F8, size: int, tiles: bool) -> tuple[NDArray[Any], NDArray[Any], F4]:
    """Texels before and after positions along an axis, and the share of the one after."""
    inside = place % size if tiles else np.clip(place, 0, size - 1)
    before = np.minimum(np.floor(inside).astype(np.int64), size - 1)
    after = (before + 1) % size if tiles else np.minimum(before + 1, size - 1)
    return before, after, (inside - before).astype(np.float32)


def _mixed(one: F4, two: F4, share: F4) -> F4:
    if not share.any():
        return one
    return one + (two - one) * share[..., None]
