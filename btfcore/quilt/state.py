"""The quilt under construction: coordinates, ghosts and patch ids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.patch.connectivity import Connectivity
from btfcore.quilt.grid import SampleGrid
from btfcore.types import F4, F8, I4, Quilt


@dataclass(eq=False)
class QuiltState:
    """Mutable arrays of one synthesis, in grid coordinates.

    source (N, 2) f4; patch (N,) i4, -1 where bare; ghost (M, 2) f4: per half-edge i→j the
    coordinate that i's patch would have at j; angle (N,) f4 (see `btfcore.types.Quilt`).
    """

    source: F4
    patch: I4
    ghost: F4
    angle: F4
    patches: int = 0

    @classmethod
    def bare(cls, net: Connectivity) -> QuiltState:
        """State with nothing synthesised."""
        count = len(net.indptr) - 1
        return cls(
            np.zeros((count, 2), np.float32),
            np.full(count, -1, np.int32),
            np.zeros((len(net.indices), 2), np.float32),
            np.zeros(count, np.float32),
        )

    def accept(
        self,
        net: Connectivity,
        order: I4,
        local: I4,
        place: F4,
        fresh: NDArray[np.bool_],
        angle: F8,
    ) -> I4:
        """Give the `fresh` vertices of a patch their new coordinates.

        place (n, 2) f4 and angle (inner,) as placed. Returns the vertices that were bare.
        """
        mine = np.flatnonzero(fresh)
        vertices = order[mine]
        was_bare = vertices[self.patch[vertices] < 0]
        self.source[vertices] = place[mine]
        self.angle[vertices] = angle[mine]
        self.patch[vertices] = self.patches
        _set_ghosts(net.indptr, net.indices, vertices, local, place, self.ghost)
        self.patches += 1
        return was_bare

    def quilt(self, grid: SampleGrid) -> Quilt:
        """Frozen copy in sample coordinates."""
        source = grid.to_sample(self.source)
        sample = np.zeros(len(source), np.uint16)
        return Quilt(source.copy(), self.angle.copy(), sample, self.patch.copy())


@njit(cache=True)
def _set_ghosts(indptr, indices, vertices, local, place, ghost):  # type: ignore[no-untyped-def]
    for vertex in vertices:
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = local[indices[slot]]
            ghost[slot, 0] = place[other, 0]
            ghost[slot, 1] = place[other, 1]
