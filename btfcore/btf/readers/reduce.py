"""Averages images by area, a strip at a time, so that 8k maps need no second full copy."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.colour import srgb_to_linear
from btfcore.types import F4, F8


def area_reduced(values: NDArray[Any], height: int, width: int, coded: bool) -> F4:
    """Mean of `values` (H, W[, C]) over each of `height` x `width` equal cells; f4.

    Integers are taken as 0–1 of their range, floats as they are; `coded` ones are sRGB and
    linearised first. A cell's border weighs the texels that it cuts by the part inside, so
    the overall mean is kept, also where an image is enlarged.
    """
    if values.shape[:2] == (height, width):
        return _linear(values, coded)
    rest = values.shape[2:]
    middle = np.empty((height, values.shape[1], *rest), np.float32)
    for row, (start, weight) in enumerate(_weights(values.shape[0], height)):
        strip = _linear(values[start : start + len(weight)], coded)
        middle[row] = np.tensordot(weight, strip, axes=(0, 0))
    out = np.empty((height, width, *rest), np.float32)
    for column, (start, weight) in enumerate(_weights(values.shape[1], width)):
        strip = middle[:, start : start + len(weight)]
        out[:, column] = np.tensordot(weight, strip, axes=(0, 1))
    return out


def _weights(old: int, new: int) -> list[tuple[int, F8]]:
    """First texel and the weights, with sum 1, of each of `new` cells over `old` texels."""
    edges = np.arange(new + 1) * (old / new)
    out = []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        first = int(low)
        places = np.arange(first, min(old, max(first + 1, int(np.ceil(high - 1e-9)))))
        weight = np.minimum(places + 1, high) - np.maximum(places, low)
        out.append((first, weight / weight.sum()))
    return out


def _linear(block: NDArray[Any], coded: bool) -> F4:
    if coded:
        return srgb_to_linear(block)
    if block.dtype.kind == "u":
        return block.astype(np.float32) / np.float32(np.iinfo(block.dtype).max)
    return block.astype(np.float32)
