"""Placements that carry on the patches which are there already.

Matching asks for one piece of the sample that agrees with all of the surroundings. A patch
that grows over its neighbour agrees with itself alone, and perfectly: the expansion move of
Boykov, Veksler & Zabih (2001, §5) with the labels that the surface has.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from btfcore.quilt.matching import Placement
from btfcore.quilt.state import QuiltState
from btfcore.types import I4

FEWEST = 12  # vertices that fix a turn well enough


def extensions(
    state: QuiltState, order: I4, plane: NDArray[np.complex128], most: int
) -> list[Placement]:
    """The `most` patches that hold most of the vertices `order` (n,), laid out over `plane`.

    plane (n,) complex: the vertices about the patch's centre in grid texels, y up. Each
    placement is the least-squares rigid motion to the patch's coordinates (Horn 1987, in the
    plane); equally large patches come in the order of their ids. `cost` is the mean squared
    distance in texels.
    """
    patch = state.patch[order]
    ids, counts = np.unique(patch[patch >= 0], return_counts=True)
    found = []
    for index in np.argsort(-counts, kind="stable")[:most]:
        if counts[index] < FEWEST:
            break
        mine = patch == ids[index]
        here = plane[mine]
        at = state.source[order[mine]].astype(np.float64)
        there = at[:, 0] - 1j * at[:, 1]
        middle, target = here.mean(), there.mean()
        turn = float(np.angle(((there - target) * (here - middle).conj()).sum()))
        centre = target - np.exp(1j * turn) * middle
        left = np.abs(centre + np.exp(1j * turn) * here - there) ** 2
        found.append(Placement(float(centre.real), -float(centre.imag), float(left.mean()), turn))
    return found
