"""The connected parts of a sample's feature, each to be stamped by itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.ndimage import distance_transform_edt

from btfcore.btf.feature import components
from btfcore.errors import InvalidEdit
from btfcore.types import F4, Frozen

INSIDE = 0.5
SHOWN = 0.05  # m_S above which a texel belongs to the part's soft edge


@dataclass(frozen=True, eq=False)
class Part(Frozen):
    """One part, or all: alpha (h, w) f4 its m_S on the sample's grid, 0 elsewhere.

    centre: middle (column, row) of the box around it; radius: of the circle about the centre
    that holds it, in grid texels; cut: it touches the sample's border, so it ends there
    as if cut off.
    """

    alpha: F4
    centre: tuple[float, float]
    radius: float
    cut: bool


def parts_of(feature: F4, name: str) -> tuple[Part, ...]:
    """All parts of a mask (h, w) f4 by falling area; the last one is all of them together.

    Every texel of a soft edge belongs to the nearest part. Raises `InvalidEdit` where there is
    no feature.
    """
    labels, found = components(feature > INSIDE)
    if not found:
        raise InvalidEdit(f"sample {name!r} has no feature: its mask is empty or missing")
    _, nearest = distance_transform_edt(labels < 0, return_indices=True)
    owner = labels[nearest[0], nearest[1]]
    alphas = [np.where(owner == index, feature, np.float32(0.0)) for index in range(len(found))]
    return tuple(_part(alpha) for alpha in (*alphas, feature.copy()))


def _part(alpha: F4) -> Part:
    rows, columns = np.nonzero(alpha > SHOWN)
    height, width = alpha.shape
    middle = (columns.min() + columns.max()) / 2, (rows.min() + rows.max()) / 2
    reach = np.sqrt(((columns - middle[0]) ** 2 + (rows - middle[1]) ** 2).max())
    cut = bool(
        rows.min() == 0 or columns.min() == 0
        or rows.max() == height - 1 or columns.max() == width - 1
    )  # fmt: skip
    return Part(np.ascontiguousarray(alpha, np.float32), middle, float(reach), cut)


@njit(cache=True)
def alpha_at(alpha: F4, place: F4) -> F4:
    """Bilinear m_S (n,) f4 of a part at (column, row) (n, 2); 0 outside the sample."""
    height, width = alpha.shape
    found = np.zeros(len(place), np.float32)
    for index in range(len(place)):
        x, y = place[index, 0], place[index, 1]
        if x < 0 or y < 0 or x > width - 1 or y > height - 1:
            continue
        column, row = min(int(x), max(width - 2, 0)), min(int(y), max(height - 2, 0))
        right, below = min(column + 1, width - 1), min(row + 1, height - 1)
        fx, fy = x - column, y - row
        upper = alpha[row, column] * (1 - fx) + alpha[row, right] * fx
        lower = alpha[below, column] * (1 - fx) + alpha[below, right] * fx
        found[index] = upper * (1 - fy) + lower * fy
    return found
