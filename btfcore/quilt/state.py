"""The quilt under construction: coordinates, ghosts and patch ids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.patch.connectivity import Connectivity
from btfcore.quilt.grid import SampleGrid
from btfcore.quilt.layout import Layout
from btfcore.quilt.sheet import Sheet
from btfcore.types import F4, F8, I4, U2, Quilt


@dataclass(eq=False)
class QuiltState:
    """Mutable arrays of one synthesis, in grid coordinates.

    source (N, 2) f4; patch (N,) i4, -1 where bare; ghost (M, 2) f4: per half-edge i→j the
    coordinate that i's patch would have at j; angle (N,) f4 (see `btfcore.types.Quilt`);
    sample (N,) u2: sample of every synthesised vertex; layout: where which sample may go,
    None where there is one.
    """

    source: F4
    patch: I4
    ghost: F4
    angle: F4
    sample: U2
    layout: Layout | None = None
    patches: int = 0

    @classmethod
    def bare(cls, net: Connectivity, layout: Layout | None = None) -> QuiltState:
        """State with nothing synthesised."""
        count = len(net.indptr) - 1
        return cls(
            np.zeros((count, 2), np.float32),
            np.full(count, -1, np.int32),
            np.zeros((len(net.indices), 2), np.float32),
            np.zeros(count, np.float32),
            np.zeros(count, np.uint16),
            layout,
        )

    def home(self, vertex: int) -> int:
        """Sample that a patch around `vertex` takes."""
        return 0 if self.layout is None else int(self.layout.home[vertex])

    def allowed(self, mine: int) -> NDArray[np.bool_] | None:
        """Vertices (N,) that may take sample `mine`; None: all."""
        return None if self.layout is None else self.layout.allowed[mine]

    def bare_for(self, vertices: I4) -> NDArray[np.bool_]:
        """Which of a patch's vertices are bare and may take the sample of the first."""
        bare: NDArray[np.bool_] = self.patch[vertices] < 0
        allowed = self.allowed(self.home(int(vertices[0])))
        return bare if allowed is None else bare & allowed[vertices]

    def known_to(self, vertices: I4) -> NDArray[np.bool_]:
        """Which of a patch's vertices are synthesised from the sample of the first."""
        known: NDArray[np.bool_] = self.patch[vertices] >= 0
        if self.layout is not None:
            known &= self.sample[vertices] == self.home(int(vertices[0]))
        return known

    def beside(self, vertices: I4) -> bool:
        """Whether a patch touches another sample than that of its first vertex."""
        others = (self.patch[vertices] >= 0) & ~self.known_to(vertices)
        return bool(others.any())

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
        self.sample[vertices] = self.home(int(order[0]))
        self.patch[vertices] = self.patches
        _set_ghosts(net.indptr, net.indices, vertices, local, place, self.ghost)
        self.patches += 1
        return was_bare

    def quilt(self, grid: SampleGrid | Sheet) -> Quilt:
        """Frozen copy, each vertex in its own sample's coordinates."""
        grids = grid.grids if isinstance(grid, Sheet) else (grid,)
        source = grids[0].to_sample(self.source)
        for index in range(1, len(grids)):
            mine = self.sample == index
            source[mine] = grids[index].to_sample(self.source[mine])
        return Quilt(source.copy(), self.angle.copy(), self.sample.copy(), self.patch.copy())


@njit(cache=True)
def _set_ghosts(indptr, indices, vertices, local, place, ghost):  # type: ignore[no-untyped-def]
    for vertex in vertices:
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = local[indices[slot]]
            ghost[slot, 0] = place[other, 0]
            ghost[slot, 1] = place[other, 1]
