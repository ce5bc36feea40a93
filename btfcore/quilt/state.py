"""The quilt under construction: coordinates, ghosts and patch ids."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.errors import InvalidQuilt
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
    patches: int = 0
    sample: U2 = field(default_factory=lambda: np.zeros(0, np.uint16))
    layout: Layout | None = None

    def __post_init__(self) -> None:
        """Take the first sample where none is named."""
        if len(self.sample) != len(self.patch):
            self.sample = np.zeros(len(self.patch), np.uint16)

    @classmethod
    def bare(cls, net: Connectivity, layout: Layout | None = None) -> QuiltState:
        """State with nothing synthesised."""
        count = len(net.indptr) - 1
        return cls(
            np.zeros((count, 2), np.float32),
            np.full(count, -1, np.int32),
            np.zeros((len(net.indices), 2), np.float32),
            np.zeros(count, np.float32),
            layout=layout,
        )

    @classmethod
    def from_quilt(
        cls,
        net: Connectivity,
        grid: SampleGrid | Sheet,
        quilt: Quilt,
        layout: Layout | None = None,
    ) -> QuiltState:
        """State of a stored quilt, whose ghosts are extrapolated.

        A ghost is where the patch's own vertices around it would put it, each by the linear
        map that fits its neighbours best, the rotation by its angle where it has too few.
        Raises `InvalidQuilt` where the quilt has another number of vertices, or positions that
        are not of its sample, or steps that are not of this scale, or samples where the
        layout does not allow them.
        """
        count = len(net.indptr) - 1
        if len(quilt.patch) != count:
            raise InvalidQuilt(f"a quilt of {len(quilt.patch)} vertices, the mesh has {count}")
        state = cls.bare(net, layout)
        covered = quilt.patch >= 0
        grids = grid.grids if isinstance(grid, Sheet) else (grid,)
        most = int(quilt.sample[covered].max(initial=0))
        if most >= len(grids):
            given = "only one is" if len(grids) == 1 else f"{len(grids)} are"
            raise InvalidQuilt(f"the quilt names sample {most}, {given} given")
        if layout is not None:
            strays = ~layout.allowed[quilt.sample[covered], np.flatnonzero(covered)]
            if strays.any():
                raise InvalidQuilt(
                    f"{int(strays.sum())} vertices have a sample of another region: the quilt"
                    " was made with other regions or borders"
                )
        for index, each in enumerate(grids):
            mine = covered & (quilt.sample == index)
            source = quilt.source[mine]
            # a little beyond the border, as rounding and reduced samples have it
            slack = 1.0 + 0.5 / each.shrink
            limit = each.to_sample(np.array([each.cut.shape[1::-1]], np.float64) - 1)[0]
            beyond = ((source < -slack) | (source > limit + slack)).any(axis=1)
            if beyond.any():
                raise InvalidQuilt(
                    f"{int(beyond.sum())} of {len(source)} positions lie outside a sample of"
                    f" {limit[0] + 1:.0f} x {limit[1] + 1:.0f} texels: the quilt is of another one"
                )
            state.source[mine] = each.from_sample(source)
        state.sample[covered] = quilt.sample[covered]
        state.angle[covered], state.patch[:] = quilt.angle[covered], quilt.patch
        state.patches = int(quilt.patch.max(initial=-1)) + 1
        stretch = _extrapolate(
            net.indptr, net.indices, net.edge, state.source, state.angle, state.patch,
            state.sample, np.array([1.0 / each.unit for each in grids]), state.ghost,
        )  # fmt: skip
        if not 0.5 < stretch < 2.0:
            raise InvalidQuilt(
                f"the quilt's pattern is {1 / max(stretch, 1e-9):.3g} times as large as asked for:"
                " it was made at another scale"
            )
        return state

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
        sample: int | None = None,
    ) -> I4:
        """Give the `fresh` vertices of a patch their new coordinates.

        place (n, 2) f4 and angle (inner,) as placed; sample: what was placed, None: the home
        sample of the patch's first vertex. Returns the vertices that were bare.
        """
        mine = np.flatnonzero(fresh)
        vertices = order[mine]
        was_bare = vertices[self.patch[vertices] < 0]
        self.source[vertices] = place[mine]
        self.angle[vertices] = angle[mine]
        self.sample[vertices] = self.home(int(order[0])) if sample is None else sample
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


@njit(cache=True)
def _extrapolate(  # type: ignore[no-untyped-def]
    indptr, indices, edge, source, angle, patch, sample, units, ghost
):
    """Ghosts of a whole quilt; returns the mean step found over the step expected.

    units (R,): grid texels per dense-mesh step of each sample.
    """
    count = len(patch)
    linear = np.zeros((count, 4))
    found = expected = 0.0
    for i in range(count):
        if patch[i] < 0:
            continue
        unit = units[sample[i]]
        c, s = np.cos(angle[i]) * unit, np.sin(angle[i]) * unit
        # least squares for (dx, dy) = L (es, et), held to the rotation by a small weight:
        # the sum of e eᵀ inverted, times the sum of (d - R e) eᵀ, plus R
        hold = 1e-3
        a00, a01, a11 = hold, 0.0, hold
        b00 = b01 = b10 = b11 = 0.0
        for slot in range(indptr[i], indptr[i + 1]):
            j = indices[slot]
            if patch[j] != patch[i]:
                continue
            es, et = np.float64(edge[slot, 0]), np.float64(edge[slot, 1])
            px, py = c * es + s * et, s * es - c * et
            dx = np.float64(source[j, 0]) - source[i, 0]
            dy = np.float64(source[j, 1]) - source[i, 1]
            found += np.sqrt(dx * dx + dy * dy)
            expected += np.sqrt(px * px + py * py)
            a00 += es * es
            a01 += es * et
            a11 += et * et
            b00 += (dx - px) * es
            b01 += (dx - px) * et
            b10 += (dy - py) * es
            b11 += (dy - py) * et
        det = a00 * a11 - a01 * a01
        linear[i, 0] = c + (b00 * a11 - b01 * a01) / det
        linear[i, 1] = s + (b01 * a00 - b00 * a01) / det
        linear[i, 2] = s + (b10 * a11 - b11 * a01) / det
        linear[i, 3] = -c + (b11 * a00 - b10 * a01) / det
    for i in range(count):
        if patch[i] < 0:
            continue
        for slot in range(indptr[i], indptr[i + 1]):
            j = indices[slot]
            if patch[j] == patch[i]:
                ghost[slot] = source[j]
                continue
            x = y = 0.0
            seen = 0
            for near in range(indptr[j], indptr[j + 1]):  # all of the patch that touch j agree
                k = indices[near]
                if patch[k] != patch[i]:
                    continue
                for back in range(indptr[k], indptr[k + 1]):
                    if indices[back] == j:
                        es, et = edge[back, 0], edge[back, 1]
                        x += source[k, 0] + linear[k, 0] * es + linear[k, 1] * et
                        y += source[k, 1] + linear[k, 2] * es + linear[k, 3] * et
                        seen += 1
            ghost[slot, 0], ghost[slot, 1] = x / seen, y / seen
    return found / expected if expected > 0.0 else 1.0
