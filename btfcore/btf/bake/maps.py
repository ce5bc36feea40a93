"""PBR sets of another size: reduced or enlarged, or a window of one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from btfcore.btf.bake.depth import AGREES, dequantized, fitted_depth
from btfcore.btf.bake.slopes import normals_of_slopes, slopes_of_normals
from btfcore.btf.pbr import PbrSet
from btfcore.errors import InvalidParameter
from btfcore.types import F8

LARGEST = 16384


def resized(pbr: PbrSet, size: int, *, roughen: bool = True) -> PbrSet:
    """Return a set whose longer edge has `size` texels, the other in proportion.

    Maps are averaged over areas where they shrink and interpolated linearly where they grow;
    8-bit heights lose their steps before (`depth.dequantized`). Normals are averaged as
    slopes, so that they still are those of the averaged heights. roughen : the spread of the
    slopes within a texel is added to GGX's alpha² (for a set with a roughness map), so that a
    surface looks as rough from far as it is. Depth and texel size follow; a depth that only the
    normals tell is fitted before, since small maps tell it less well, and then noted.

    Raises `InvalidParameter` for a size outside 1–16384.
    """
    if not 1 <= size <= LARGEST:
        raise InvalidParameter(f"{pbr.name}: a size of {size} texels, where 1 to {LARGEST} can be")
    rows, columns = pbr.shape
    ratio = size / max(rows, columns)
    target = max(1, round(rows * ratio)), max(1, round(columns * ratio))
    if target == pbr.shape:
        return pbr
    down = _weights(rows, target[0], tiles=pbr.tiles)
    across = _weights(columns, target[1], tiles=pbr.tiles)

    def scaled(values: NDArray[Any]) -> F8:
        wide = values.reshape(rows, -1).astype(np.float64)
        once = (down @ wide).reshape(target[0], columns, -1)
        flat = once.transpose(1, 0, 2).reshape(columns, -1)
        twice = (across @ flat).reshape(target[1], target[0], -1).transpose(1, 0, 2)
        return twice if values.ndim == 3 else twice[..., 0]

    new: dict[str, Any] = {}
    for name in ("albedo", "height", "roughness", "metallic", "ao", "mask"):
        values = getattr(pbr, name)
        if values is None:
            continue
        if name == "height":
            values = dequantized(values, tiles=pbr.tiles)
        new[name] = np.ascontiguousarray(scaled(values), np.float32)
    if pbr.normal is not None:
        slopes = slopes_of_normals(pbr.normal)
        mean = scaled(slopes)
        new["normal"] = np.ascontiguousarray(normals_of_slopes(mean), np.float32)
        if roughen and pbr.roughness is not None:
            spread = np.maximum(scaled(slopes**2) - mean**2, 0).sum(axis=2)
            alpha = np.sqrt(new["roughness"].astype(np.float64) ** 4 + spread)
            new["roughness"] = np.sqrt(np.minimum(alpha, 1)).astype(np.float32)
    depth, notes = pbr.depth, pbr.notes
    if depth is None and pbr.height is not None and pbr.normal is not None:
        even = dequantized(pbr.height, tiles=pbr.tiles)
        fit = fitted_depth(even, pbr.normal, tiles=pbr.tiles)
        if fit.match >= AGREES and fit.depth <= max(pbr.shape):
            depth = fit.depth
            notes = (*notes, f"at {columns} x {rows} texels: {fit.note}")
    return replace(
        pbr,
        **new,
        notes=notes,
        depth=None if depth is None else depth * ratio,
        texel_size=None if pbr.texel_size is None else pbr.texel_size / ratio,
    )


def cropped(pbr: PbrSet, rows: slice, columns: slice) -> PbrSet:
    """Return the window `rows` × `columns` (step 1) of a set; it no longer tiles.

    Raises `InvalidParameter` where the window is empty or has another step.
    """
    height, width = pbr.shape
    window = slice(*rows.indices(height)), slice(*columns.indices(width))
    size = window[0].stop - window[0].start, window[1].stop - window[1].start
    if min(size) <= 0 or window[0].step != 1 or window[1].step != 1:
        raise InvalidParameter(
            f"{pbr.name}: a window of {size[1]} x {size[0]} texels out of {width} x {height}"
        )
    new: dict[str, Any] = {
        name: getattr(pbr, name)[window].copy()
        for name in ("albedo", "height", "normal", "roughness", "metallic", "ao", "mask")
        if getattr(pbr, name) is not None
    }
    return replace(pbr, **new, tiles=False)


def _weights(old: int, new: int, *, tiles: bool) -> csr_array:
    """Matrix (new, old) that averages over the areas of wider texels, or interpolates."""
    if new < old:
        edge = np.arange(new + 1) * (old / new)
        edge[-1] = old
        starts, stops = np.floor(edge[:-1]).astype(int), np.ceil(edge[1:]).astype(int)
        row = np.repeat(np.arange(new), stops - starts)
        column = np.concatenate([np.arange(a, b) for a, b in zip(starts, stops, strict=True)])
        share = np.minimum(column + 1, edge[row + 1]) - np.maximum(column, edge[row])
        return csr_array((share * new / old, (row, column)), shape=(new, old))
    centre = (np.arange(new) + 0.5) * old / new - 0.5
    first = np.floor(centre).astype(int)
    right = centre - first
    column = np.stack([first, first + 1], axis=1)
    column = column % old if tiles else np.clip(column, 0, old - 1)
    row = np.repeat(np.arange(new), 2)
    share = np.stack([1 - right, right], axis=1)
    return csr_array((share.ravel(), (row, column.ravel())), shape=(new, old))
