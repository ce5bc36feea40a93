"""The feature of a sample (an imperfection) made ready for painting (Zhou §IV).

Masks are drawn for other ends than painting: cracks one texel wide leave nothing that a cut
between texels could take, and specks of noise would count as features of their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label

from btfcore.btf.factor.symmetric import add_gram, eigen, product
from btfcore.errors import InvalidImage
from btfcore.types import F4, F8, I4, Frozen

B1 = NDArray[np.bool_]

SPECK = 8  # texels; what has fewer is noise, and so are holes of fewer
SPECK_SHARE = 0.01  # of the largest part, below which a part is noise as well
THICKEN = 6.0  # texels that a line is thickened by on each side
THIN, THICK = 2.0, 8.0  # half-widths up to which it is, and from which on it is not
SOFT, SOFT_THICK = 4.0, 2.0  # width in texels of the edge of a thickened part, of another
MOST_SHARE = 0.6  # of the sample that thickening may fill
MARGIN = 4  # texels around a feature that do not count as background when light is evened out
TILES = 24  # along the shorter side, whose means the light is fitted to
DEGREE = 2  # of its polynomial: what varies faster is the pattern's own
_ROUND = np.ones((3, 3), np.bool_)  # texels that touch at a corner hang together


@dataclass(frozen=True)
class Component:
    """A connected part of a feature.

    area in texels; centre (column, row); box: (left, top, right, bottom), the last two one
    beyond; border: the sides of the sample that it touches.
    """

    area: int
    centre: tuple[float, float]
    box: tuple[int, int, int, int]
    border: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Feature(Frozen):
    """A prepared mask (H, W) f4 in 0–1, above ½ on the feature, and what is known of it.

    half_width: median half-width in texels of the mask as prepared, drawn_half_width: as it
    was drawn; labels (H, W) i4: which component, -1 outside; components: by falling area;
    notes: sentences fit for a user.
    """

    mask: F4
    half_width: float
    drawn_half_width: float
    labels: I4
    components: tuple[Component, ...]
    notes: tuple[str, ...] = ()


def check_mask(name: str, mask: F4, shape: tuple[int, int]) -> None:
    """Refuse a mask that does not fit `shape` (H, W), is empty (≤ ½ everywhere) or is full.

    Raises `InvalidImage` with both sizes, or the share of the feature.
    """
    if mask.shape != shape:
        size = " x ".join(str(side) for side in mask.shape[::-1])
        raise InvalidImage(f"{name}: a mask of {size} texels for a sample of {shape[1]} x"
                           f" {shape[0]}")  # fmt: skip
    wrong = int((~((mask >= 0) & (mask <= 1))).sum())  # also counts NaN
    if wrong:
        raise InvalidImage(f"{name}: {wrong} values of the mask lie outside 0–1 or are not finite")
    inside = mask > 0.5
    share = float(inside.mean())
    if not inside.any():
        raise InvalidImage(
            f"{name}: the mask is empty: 0 % of it is feature (above 0.5; its brightest texel is"
            f" {float(mask.max()):.3g})"
        )
    if np.count_nonzero(~inside) < _fewest(inside.size):
        raise InvalidImage(f"{name}: the mask is full: {100 * share:.2f} % of it is feature")


def _fewest(texels: int) -> float:
    """How many texels of background a sample needs: what no noise looks like."""
    return max(min(SPECK, 0.05 * texels), 1.0)


def prepared(mask: F4, *, name: str = "mask", thicken: float = THICKEN) -> Feature:
    """Make a mask (H, W) f4 in 0–1 ready for painting.

    Above ½ is feature. Parts of less than 8 texels, or that have less than 1 % of the largest
    and no other near them, are specks and go; so do holes of less than 8 texels. Parts of a
    half-width up to 2 texels (cracks, scratches) are thickened by `thicken` texels on each side,
    thicker ones by less, and none from 8 on. Edges are linear ramps, 4 texels wide where
    thickened and 2 elsewhere. Where lines would fill more than 60 % of the sample they are
    thickened by less.

    Raises `InvalidImage` for a mask that is empty or full.
    """
    check_mask(name, mask, mask.shape[:2])
    inside = mask > 0.5
    notes: list[str] = []
    inside, gone = _without_specks(inside, thicken)
    if inside.all():
        raise InvalidImage(f"{name}: the mask is full: but for specks, 100 % of it is feature")
    if gone:
        notes.append(f"left out {gone} speck{'s' * (gone > 1)} of the mask")
    labels, parts = components(inside)
    widths = [half_width(labels[_window(part)] == number) for number, part in enumerate(parts)]
    areas = np.array([part.area for part in parts], np.float64)
    drawn = _weighted_median(np.array(widths), areas)
    grown = thicken
    while True:
        soft = _soft(labels, widths, grown)
        share = float((soft > 0.5).mean())
        if share <= MOST_SHARE or grown < 1:
            break
        grown -= 1
    if grown < thicken and min(widths) < THICK:
        notes.append(f"thickened its lines by {grown:g} texels only, lest they fill the sample")
    labels, parts = components(soft > 0.5)
    sides = sorted({side for part in parts for side in part.border})
    if sides:
        notes.append(
            f"the feature touches the sample's border ({', '.join(sides)}): a copy of it ends"
            " there in a straight edge"
        )
    return Feature(soft, half_width(soft > 0.5), drawn, labels, parts, tuple(notes))


def components(inside: B1) -> tuple[I4, tuple[Component, ...]]:
    """Connected parts (8 neighbours) of a mask (H, W) bool, by falling area, ties by rows.

    Returns the number of each texel's part, (H, W) i4, -1 outside, and the parts.
    """
    found, count = label(inside, _ROUND)
    height, width = inside.shape
    row, column = np.nonzero(found)
    which = found[row, column] - 1
    area = np.bincount(which, minlength=count)
    low, high = np.full((2, count), max(height, width)), np.full((2, count), -1)
    for axis, at in enumerate((column, row)):
        np.minimum.at(low[axis], which, at)
        np.maximum.at(high[axis], which, at)
    middle = [np.bincount(which, at, count) / np.maximum(area, 1) for at in (column, row)]
    order = np.argsort(-area, kind="stable")
    rank = np.empty(count + 1, np.int32)
    rank[0] = -1
    rank[order + 1] = np.arange(count)
    parts = []
    for each in order.tolist():
        left, top = int(low[0, each]), int(low[1, each])
        right, bottom = int(high[0, each]) + 1, int(high[1, each]) + 1
        touched = (left == 0, top == 0, right == width, bottom == height)
        border = tuple(
            side for side, yes in zip(("left", "top", "right", "bottom"), touched, strict=True)
            if yes
        )  # fmt: skip
        centre = (float(middle[0][each]), float(middle[1][each]))
        parts.append(Component(int(area[each]), centre, (left, top, right, bottom), border))
    return rank[found], tuple(parts)


def half_width(inside: B1) -> float:
    """Half-width in texels of a feature (H, W) bool; 0 where there is none.

    The largest radius whose disks, where they fit into the feature, cover half of its area
    (the median of its granulometry, Matheron 1975; local thickness, Hildebrand & Rüegsegger
    1997): of a strip half its width, of a disk its radius, to about half a texel. The sample's
    border counts as no edge. A feature that is everywhere has no width, `inf`.
    """
    if not inside.any():
        return 0.0
    if inside.all():
        return float("inf")
    reach = np.asarray(distance_transform_edt(inside), np.float64)
    radii = np.unique(reach[inside])
    half = np.count_nonzero(inside) / 2
    low, high = 0, len(radii) - 1  # disks of the smallest radius cover all
    while low < high:
        middle = (low + high + 1) // 2
        away = distance_transform_edt(reach < radii[middle])
        if np.count_nonzero(away < radii[middle]) >= half:
            low = middle
        else:
            high = middle - 1
    # between a texel and the nearest one outside, the edge lies half a texel short of that
    return float(radii[low]) - 0.5


def _without_specks(inside: B1, near: float) -> tuple[B1, int]:
    """Leave out parts, then fill holes, that are noise; returns how many parts went.

    Parts that lie within 2 · `near` texels of each other are judged together, as the pieces
    of a broken line: the thickened line has no gaps. Something always stays.
    """
    found, count = label(inside, _ROUND)
    area = np.bincount(found.ravel(), minlength=count + 1)
    area[0] = 0
    kept = area >= min(SPECK, int(area.max()))
    kept[0] = False
    group, groups = label(distance_transform_edt(~kept[found]) <= near, _ROUND)
    size = np.bincount(group.ravel(), weights=kept[found].ravel(), minlength=groups + 1)
    size[0] = 0
    clean = kept[found] & (size >= SPECK_SHARE * size.max())[group]
    holes, many = label(~clean)
    small = np.bincount(holes.ravel(), minlength=many + 1) < _fewest(inside.size)
    small[0] = False
    return clean | small[holes], count - label(clean, _ROUND)[1]


def _soft(labels: I4, widths: list[float], thicken: float) -> F4:
    """Thicken every part by what its half-width asks for, with a linear edge."""
    lacks = np.clip((THICK - np.array(widths)) / (THICK - THIN), 0.0, 1.0)
    # whole texels, so that there are few different distances to compute
    grown = np.rint(lacks * thicken).astype(np.int64)
    soft = np.zeros(labels.shape, np.float32)
    for amount in np.unique(grown).tolist():
        inside = np.isin(labels, np.flatnonzero(grown == amount))
        distance = np.asarray(distance_transform_edt(~inside), np.float64) - 0.5
        within = np.asarray(distance_transform_edt(inside), np.float64) - 0.5
        away = np.where(inside, -within, distance)
        ramp = SOFT_THICK + (SOFT - SOFT_THICK) * min(amount / THICKEN, 1.0)
        np.maximum(soft, np.clip(0.5 + (amount - away) / ramp, 0.0, 1.0), out=soft)
    return soft


def _window(part: Component) -> tuple[slice, slice]:
    left, top, right, bottom = part.box
    return slice(max(top - 1, 0), bottom + 1), slice(max(left - 1, 0), right + 1)


def _weighted_median(values: F8, weights: F8) -> float:
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][int(np.searchsorted(total, total[-1] / 2))])


def flat_fielded(colour: F4, mask: F4 | None = None) -> F4:
    """Take slow gradients of the lighting out of a picture (H, W, 3) f4 ≥ 0; same shape.

    Best of linear radiance, where light is a factor. Each channel is divided by a polynomial
    of the second degree, fitted to the logarithms of the means of about 24 × 24 tiles of the
    background: the feature (mask (H, W) above ½, None: there is none) and 4 texels around it do
    not count, so that a dark stain stays as dark. Where the fit would go beyond what it is on
    the background it is held there. The background's mean stays what it was.
    """
    height, width, channels = colour.shape
    ground = np.ones((height, width), np.bool_)
    if mask is not None and (mask > 0.5).any():
        ground = np.asarray(distance_transform_edt(mask <= 0.5)) > MARGIN
        if not ground.any():
            ground = mask <= 0.5
    side = max(min(height, width) // TILES, 1)
    row, column = np.nonzero(ground)
    across = -(-width // side)
    tile = (row // side) * across + column // side
    count = np.bincount(tile)
    used = np.flatnonzero(count >= max(side * side // 2, 1))
    if len(used) == 0:
        return colour
    place = [np.bincount(tile, at)[used] / count[used] for at in (column, row)]
    basis = _powers(place[0] / max(width - 1, 1), place[1] / max(height - 1, 1))
    whole = _powers(
        np.tile(np.arange(width) / max(width - 1, 1), height),
        np.repeat(np.arange(height) / max(height - 1, 1), width),
    )
    flat = np.empty_like(colour)
    for k in range(channels):
        mean = np.bincount(tile, colour[row, column, k].astype(np.float64))[used] / count[used]
        floor = max(1e-3 * float(mean.max()), 1e-12)
        light = np.log(np.maximum(mean, floor))
        fit = _fitted(basis, light)
        shade = product(whole, fit[:, None]).reshape(height, width)
        low, high = float(shade[ground].min()), float(shade[ground].max())
        even = colour[..., k] / np.exp(np.clip(shade, low, high))
        total = float(even[ground].sum())
        before = float(colour[..., k][ground].sum(dtype=np.float64))
        flat[..., k] = even * (before / total if total > 0 else 1.0)
    return flat


def _powers(x: F8, y: F8) -> F8:
    """Monomials (n, m) up to `DEGREE` of positions in 0–1, about their middle."""
    x, y = 2 * x - 1, 2 * y - 1
    powers = [x**i * y**j for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    return np.stack(powers, axis=1)


def _fitted(basis: F8, values: F8) -> F8:
    """Least-squares coefficients (m,); what the tiles do not tell apart stays 0."""
    gram = np.zeros((basis.shape[1],) * 2)
    add_gram(basis, gram)
    size, vectors = eigen(gram)
    told = size > 1e-6 * size[0]
    right = product(basis.T, values[:, None])
    vectors = np.ascontiguousarray(vectors[:, told])
    turned_right = product(vectors.T, right) / size[told, None]
    return product(vectors, turned_right)[:, 0]
