"""Choosing texels of a sample by their colour, to make a mask of them."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.ndimage import gaussian_filter

from btfcore.btf.colour import srgb_to_linear
from btfcore.errors import InvalidParameter
from btfcore.types import F4, F8

MOST_TOLERANCE = 150.0  # more than from black to any colour
MOST_SMOOTHING, MOST_EVENING = 16.0, 256.0  # texels
CELL = 1.0  # side of the cells of CIELAB in which `similar` counts colours
RARE = 0.02  # of the marked texels, those of the rarest colours, that `similar` leaves out
_ROWS = 256  # converted at a time, so that a large sample needs little more memory
_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
_WHITE = _XYZ.sum(axis=1)  # so that white is exactly L = 100, a = b = 0
_LINEAR_UP_TO = (6 / 29) ** 3


def cielab(colour: F4, *, smoothing: float = 0.0, evening: float = 0.0, tiles: bool = False) -> F4:
    """CIELAB (L*, a*, b*) under D65 (CIE 15:2004 §8.2.1) of sRGB-coded colours (H, W, 3); f4.

    Euclidean distance in it is the colour difference ΔE*ab: about 2.3 can just be seen.
    smoothing : standard deviation in texels (0–16) of a Gaussian over the result, which takes
    away grain. evening : standard deviation (0–256, 0: none) of the Gaussian whose result is
    taken away first, but for its mean: slow changes of light, and features wider than about
    that. Raises `InvalidParameter`.
    """
    if colour.ndim != 3 or colour.shape[2] != 3:
        raise InvalidParameter(f"colours of shape {colour.shape}, not (H, W, 3)")
    if not 0 <= smoothing <= MOST_SMOOTHING:
        raise InvalidParameter(f"smoothing {smoothing:g} is outside 0–{MOST_SMOOTHING:g}")
    if not 0 <= evening <= MOST_EVENING:
        raise InvalidParameter(f"evening {evening:g} is outside 0–{MOST_EVENING:g}")
    out = np.empty(colour.shape, np.float32)
    matrix = (_XYZ / _WHITE[:, None]).astype(np.float32)
    for start in range(0, len(colour), _ROWS):
        linear = srgb_to_linear(colour[start : start + _ROWS])
        xyz = np.einsum("ijc,kc->ijk", linear, matrix)
        bent = np.where(xyz > _LINEAR_UP_TO, np.cbrt(xyz), xyz * (841 / 108) + 4 / 29)
        lab = out[start : start + _ROWS]
        lab[..., 0] = 116 * bent[..., 1] - 16
        lab[..., 1] = 500 * (bent[..., 0] - bent[..., 1])
        lab[..., 2] = 200 * (bent[..., 1] - bent[..., 2])
    for k in range(3):
        channel = out[..., k]
        if evening > 0:
            slow = _blurred(channel, evening, tiles)
            channel += np.float32(slow.mean(dtype=np.float64)) - slow
        if smoothing > 0:
            channel[...] = _blurred(channel, smoothing, tiles)
    return out


def flood(
    lab: F4,
    seed: tuple[int, int],
    *,
    tolerance: float = 10.0,
    contiguous: bool = True,
    tiles: bool = False,
) -> F4:
    """Texels whose colour is like that of one (a "magic wand"), (H, W) f4 of 0 and 1.

    lab (H, W, 3) : see `cielab`. seed : (column, row) of the texel. tolerance : greatest
    ΔE*ab, 0–150. contiguous : only what hangs together with the seed, also by corners, and
    over the borders where it `tiles`. Raises `InvalidParameter`.
    """
    height, width = lab.shape[:2]
    column, row = seed
    if not (0 <= column < width and 0 <= row < height):
        raise InvalidParameter(
            f"texel ({column}, {row}) lies outside a sample of {width} x {height} texels"
        )
    _check_tolerance(tolerance)
    near = _near(lab, lab[row, column].astype(np.float64), tolerance)
    if contiguous:
        from btfcore.btf.mask_kernels import spread_flood

        near = spread_flood(near, row, column, tiles)
    return near.astype(np.float32)


def similar(lab: F4, mask: F4, *, tolerance: float = 3.0) -> F4:
    """All texels whose colour is like one of those marked, (H, W) f4 of 0 and 1.

    What is marked (above ½) stays so. Colours are counted in cells of CIELAB one unit wide;
    a texel is chosen whose cell lies within `tolerance` (ΔE*ab, 0–150) of a marked one's. The
    rarest colours, up to 2 % of what is marked, attract nothing: some background is always
    marked by mistake. Raises `InvalidParameter`.
    """
    from scipy.spatial import cKDTree

    _check_tolerance(tolerance)
    if mask.shape != lab.shape[:2]:
        raise InvalidParameter(f"a mask of shape {mask.shape} for colours {lab.shape[:2]}")
    marked = mask > 0.5
    if not marked.any():
        return np.zeros(mask.shape, np.float32)
    cell = np.rint(lab / np.float32(CELL)).astype(np.int64)
    key = (cell[..., 0] * 1024 + cell[..., 1] + 512) * 1024 + cell[..., 2] + 512
    keys, place, count = np.unique(key[marked], return_inverse=True, return_counts=True)
    order = np.argsort(count, kind="stable")
    rare = order[np.cumsum(count[order]) <= RARE * len(place)]
    common = np.delete(keys, rare)
    every, number = np.unique(key, return_inverse=True)
    away, _ = cKDTree(_cells(common)).query(_cells(every), distance_upper_bound=tolerance + 1e-9)
    chosen = np.isfinite(away)[number].reshape(mask.shape)
    return (chosen | marked).astype(np.float32)


def _blurred(channel: F4, sigma: float, tiles: bool) -> F4:
    mode: Literal["grid-wrap", "nearest"] = "grid-wrap" if tiles else "nearest"
    return np.asarray(gaussian_filter(channel, sigma, mode=mode, truncate=3.0))


def _near(lab: F4, colour: F8, tolerance: float) -> np.ndarray:
    """Where (H, W) bool the difference from one colour is at most `tolerance`."""
    squared = np.zeros(lab.shape[:2])
    for k in range(3):
        squared += (lab[..., k] - colour[k]) ** 2
    return squared <= tolerance * tolerance


def _cells(keys: np.ndarray) -> F8:
    """Colours (n, 3) of numbered cells."""
    a = keys // 1024 % 1024 - 512
    return np.stack([keys // (1024 * 1024), a, keys % 1024 - 512], axis=1) * CELL


def _check_tolerance(tolerance: float) -> None:
    if not 0 <= tolerance <= MOST_TOLERANCE:
        raise InvalidParameter(f"tolerance {tolerance:g} is outside 0–{MOST_TOLERANCE:g}")
