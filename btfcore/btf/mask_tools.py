"""Drawing a sample's mask by hand: brush, lasso, growing, feathering, and what came of it.

A mask is (H, W) f4 in 0–1, above ½ on the feature; positions are (column, row) in texels,
whole numbers at texel centres. Every function returns a new mask. Where the sample tiles
(`tiles`), what leaves at one border comes in at the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import distance_transform_edt, gaussian_filter

from btfcore.btf.feature import THIN, check_mask, prepared
from btfcore.errors import InvalidImage, InvalidParameter
from btfcore.types import F4, F8

LEAST_RADIUS, MOST_RADIUS = 0.5, 1024.0  # texels
MOST_GROWTH = 256.0  # texels
MOST_REPORTED = 1 << 22  # texels
MOST_PERIODS = 4  # how far beyond a tile's border a shape may reach, in tiles


@dataclass(frozen=True)
class MaskReport:
    """What a mask is worth for painting.

    share : of texels above ½, in 0–1; half_width: median of the feature in texels, nan where
    it has none or is not known; usable: painting takes it; notes: sentences for a user.
    """

    share: float
    half_width: float
    usable: bool
    notes: tuple[str, ...] = ()


def brush(
    mask: F4,
    path: ArrayLike,
    *,
    radius: float = 8.0,
    hardness: float = 0.8,
    remove: bool = False,
    tiles: bool = False,
) -> F4:
    """Draw a stroke of a round brush, or take it away.

    path : (n, 2) positions of a polyline, or (n, 3) with a factor on the radius (a pen's
    pressure) that changes linearly between them; one position is a dab. radius : of the
    contour ½ in texels, 0.5–1024, whatever the hardness. hardness : 1 is an edge one texel
    wide, 0 falls linearly from the middle to twice the radius.

    Adding takes the greater of mask and stroke, removing the smaller of mask and 1 - stroke, so
    that a stroke drawn in pieces, or twice, is the stroke drawn once. Nothing changes beyond
    `reach` of the path. Raises `InvalidParameter`.
    """
    points = np.asarray(path, np.float64)
    if points.ndim != 2 or points.shape[1] not in (2, 3) or len(points) == 0:
        raise InvalidParameter(f"a stroke of shape {points.shape}, not (n, 2) or (n, 3)")
    _check_range("brush radius", radius, LEAST_RADIUS, MOST_RADIUS)
    _check_range("hardness", hardness, 0.0, 1.0)
    factor = points[:, 2] if points.shape[1] == 3 else np.ones(len(points))
    if not ((factor >= 0) & (factor <= 1)).all():
        raise InvalidParameter(f"pressures from {factor.min()} to {factor.max()}, not in 0–1")
    _check_near(points[:, :2], mask.shape)
    whole = np.empty((len(points), 3))
    whole[:, :2] = points[:, :2]
    whole[:, 2] = np.maximum(factor * radius, LEAST_RADIUS)
    from btfcore.btf.mask_kernels import draw_segments

    out = mask.copy()
    draw_segments(out, whole, hardness, remove, tiles)
    return out


def reach(radius: float, hardness: float) -> float:
    """How far from its path a brush changes anything, in texels."""
    return radius + max(radius * (1 - hardness), 0.5)


def lasso(mask: F4, outline: ArrayLike, *, remove: bool = False, tiles: bool = False) -> F4:
    """Fill a closed outline (n, 2), or take it away; its last point joins its first.

    A texel counts by the area of it that lies inside, exactly where the outline does not cross
    itself: the mean winding number over the texel, its size at most 1 (as smooth rasterisers of
    fonts accumulate it). So both lobes of an eight are inside. Raises `InvalidParameter`.
    """
    points = np.asarray(outline, np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3:
        raise InvalidParameter(f"an outline of shape {points.shape}, not (3 or more, 2)")
    _check_near(points, mask.shape)
    return combined(mask, polygon_coverage(points, mask.shape, tiles=tiles), remove=remove)


def polygon_coverage(points: F8, shape: tuple[int, int], *, tiles: bool = False) -> F4:
    """Area of each texel (H, W) f4 inside a closed polygon (n, 2), see `lasso`."""
    out = np.zeros(shape, np.float32)
    height, width = shape
    low = points.min(axis=0) + 0.5
    high = points.max(axis=0) + 0.5
    across, down = range(1), range(1)
    if tiles:
        across = range(int(low[0] // width), int(high[0] // width) + 1)
        down = range(int(low[1] // height), int(high[1] // height) + 1)
    for i in down:
        for j in across:
            _add_coverage(out, points + 0.5 - np.array([j * width, i * height]))
    return out


def combined(mask: F4, selection: F4, *, remove: bool = False) -> F4:
    """Mask with a selection (H, W) f4 in 0–1 added (the greater) or removed (min with 1 - s)."""
    if selection.shape != mask.shape:
        raise InvalidParameter(f"a selection of shape {selection.shape} for a mask {mask.shape}")
    return np.minimum(mask, 1 - selection) if remove else np.maximum(mask, selection)


def inverted(mask: F4) -> F4:
    """Feature and background exchanged."""
    return 1 - mask


def grown(mask: F4, texels: float, *, tiles: bool = False) -> F4:
    """Move the contour ½ outward by `texels` (-256 to 256), inward where negative.

    Growing only adds: within the distance to what is above ½ the mask becomes 1, with an edge
    one texel wide, and elsewhere stays as soft as it was. Shrinking is growing the background.
    The sample's border is no edge. Raises `InvalidParameter`.
    """
    _check_range("growth", texels, -MOST_GROWTH, MOST_GROWTH)
    if texels < 0:
        return 1 - grown(1 - mask, -texels, tiles=tiles)
    inside = mask > 0.5
    if texels == 0 or not inside.any():
        return mask.copy()
    margin = int(np.ceil(texels)) + 2 if tiles else 0
    around = np.pad(inside, margin, mode="wrap")
    away = np.asarray(distance_transform_edt(~around), np.float32)
    if margin:
        away = away[margin:-margin, margin:-margin]
    return np.maximum(mask, np.clip(np.float32(texels + 1) - away, 0, 1)).astype(np.float32)


def feathered(mask: F4, texels: float, *, tiles: bool = False) -> F4:
    """Soften edges by a Gaussian whose standard deviation is `texels` (0–256).

    Straight edges stay where they are; lines thinner than about 1.3 `texels` sink below ½.
    Raises `InvalidParameter`.
    """
    _check_range("feathering", texels, 0.0, MOST_GROWTH)
    if texels == 0:
        return mask.copy()
    soft = gaussian_filter(mask, texels, mode="grid-wrap" if tiles else "nearest", truncate=3.0)
    return np.clip(soft, 0, 1).astype(np.float32)


def report(mask: F4, *, name: str = "mask") -> MaskReport:
    """Say what painting will make of a mask, see `btfcore.btf.feature.prepared`.

    Of more than 2^22 texels (2048 x 2048) it is only said whether they are empty or full: more
    would take many seconds.
    """
    share = float((mask > 0.5).mean())
    try:
        check_mask(name, mask, mask.shape)
        if mask.size > MOST_REPORTED:
            return MaskReport(share, float("nan"), True)
        feature = prepared(mask, name=name)
    except InvalidImage as error:
        return MaskReport(share, float("nan"), False, (str(error),))
    notes = feature.notes
    if feature.drawn_half_width <= THIN:
        notes = (
            f"its lines are only {2 * feature.drawn_half_width:.1f} texels wide: they are"
            f" thickened to {2 * feature.half_width:.1f} for painting",
            *notes,
        )
    return MaskReport(share, feature.drawn_half_width, True, notes)


def _add_coverage(out: F4, points: F8) -> None:
    """Raise `out` (H, W) to the coverage by a polygon in which texel (0, 0) spans 0–1."""
    from btfcore.btf.mask_kernels import winding_area

    height, width = out.shape
    for axis, limit in ((0, width), (1, height)):
        points = _clipped(_clipped(points, axis, 0.0, 1.0), axis, float(limit), -1.0)
    if len(points) < 3:
        return
    left, top = np.floor(points.min(axis=0)).astype(int)
    right, bottom = np.ceil(points.max(axis=0)).astype(int)
    if right <= left or bottom <= top:
        return
    steps = np.zeros((bottom - top, right - left + 2))
    winding_area(np.ascontiguousarray(points - np.array([left, top])), steps)
    area = np.minimum(np.abs(np.cumsum(steps, axis=1)[:, :-2]), 1.0)
    area[area < 1e-12] = 0.0  # rounding of the running sum
    window = out[top:bottom, left:right]
    np.maximum(window, area.astype(np.float32), out=window)


def _clipped(points: F8, axis: int, limit: float, sign: float) -> F8:
    """Part of a closed polygon with sign · (coordinate - limit) ≥ 0 (Sutherland & Hodgman)."""
    if len(points) == 0:
        return points
    away = sign * (points[:, axis] - limit)
    if (away >= 0).all():
        return points
    before, from_ = np.roll(points, 1, axis=0), np.roll(away, 1)
    crossing = (away >= 0) != (from_ >= 0)
    share = np.divide(from_, from_ - away, out=np.zeros_like(away), where=crossing)
    on = before + share[:, None] * (points - before)
    on[:, axis] = limit
    # each point is preceded by where its edge crosses the line, if it does
    both = np.stack([on, points], axis=1).reshape(-1, 2)
    return both[np.stack([crossing, away >= 0], axis=1).ravel()]


def _check_range(what: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:  # also NaN
        raise InvalidParameter(f"{what} {value:g} is outside {low:g}–{high:g}")


def _check_near(points: F8, shape: tuple[int, ...]) -> None:
    """Refuse positions that are not finite or many tiles away: they would take for ever."""
    most = MOST_PERIODS * np.array([shape[1], shape[0]]) + 2 * MOST_RADIUS
    wrong = ~(np.abs(points) <= most)
    if wrong.any():
        first = int(np.flatnonzero(wrong.any(axis=1))[0])
        raise InvalidParameter(
            f"point {first} at ({points[first, 0]:g}, {points[first, 1]:g}) lies far outside a"
            f" sample of {shape[1]} x {shape[0]} texels"
        )
