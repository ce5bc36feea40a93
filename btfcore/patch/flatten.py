"""The cascade that turns a work patch into a plane piece (Zhou §III-B, "Work Patch/Image")."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from btfcore.patch.connectivity import Connectivity
from btfcore.patch.distortion import extend, sound_levels
from btfcore.patch.expmap import exponential_map
from btfcore.patch.grow import grow, release
from btfcore.patch.lscm import lscm, patch_faces
from btfcore.patch.relax import relax
from btfcore.types import F8, I4, DenseMesh, Field

SHRINK = 0.8  # Zhou §III-B, "Hierarchical Search"
SMALLEST = 4
BAD_AREA = 0.005  # share of the area that may break T_d: zipper slivers always do
STRETCH = 1.3
STRETCHED = 0.06  # share of edges that may be longer or shorter by more than STRETCH
LOOSE_AREA, LOOSE_STRETCHED = 0.1, 0.5  # the same for patches of no more than SMALLEST levels
TRIES, SELDOM = 60, 20  # LSCM is tried so often, then only if one in SELDOM succeeded
MAX_VERTICES = 60_000


@dataclass(eq=False)
class FlatPatch:
    """A work patch in its plane.

    order (n,) i4: vertices by breadth-first level, the last level being the ring of ghosts
    around the patch proper; start: where each level begins in it (see `grow`); inner: how
    many vertices belong to the patch proper; plane (n, 2) f8 in
    dense-mesh steps, x and y right-handed seen from outside; kind: how it was flattened;
    shrinks: how often the radius had to be cut; reason: why it is smaller than asked for, ""
    where it is not (see `btfcore.quilt.ledger`).
    """

    order: I4
    start: I4
    inner: int
    plane: F8
    kind: str
    radius: int
    shrinks: int
    reason: str = ""


Trim = Callable[[I4, I4, F8, int], int]


class Flattener:
    """Flattens patches of one dense mesh; keeps the vertex → patch position table."""

    def __init__(
        self,
        dense: DenseMesh,
        field: Field,
        net: Connectivity,
        *,
        max_distortion: float = 4.0,
        literal: bool = False,
    ) -> None:
        """Prepare for `dense`; `literal` takes LSCM wherever a patch leaves its chart."""
        self.dense, self.field, self.net = dense, field, net
        self.bound = max_distortion
        self.literal = literal
        self.local: I4 = np.full(len(dense.vertices), -1, np.int32)
        self._texel = np.ascontiguousarray(dense.texel, np.int32)
        self._chart = np.ascontiguousarray(dense.chart, np.int32)
        self._texel_steps = _texel_in_steps(net, dense)
        self._reason = self._cause = ""
        self._tries = self._rescues = 0  # of LSCM, and how many of them succeeded

    @cached_property
    def _step(self) -> float:
        """Dense-mesh step; only LSCM, which most runs never call, asks for it."""
        return self.dense.step or 1.0

    def restart(self) -> None:
        """Forget how LSCM fared, so that what follows does not depend on what went before."""
        self._tries = self._rescues = 0

    def release(self, patch: FlatPatch) -> None:
        """Forget the patch's vertices; call it once done with `local`."""
        release(patch.order, self.local)

    def hold(self, patch: FlatPatch) -> None:
        """Map a patch's vertices again, after `release` of whatever was held."""
        self.local[patch.order] = np.arange(len(patch.order), dtype=np.int32)

    def flatten(self, seed: int, radius: int, trim: Trim | None = None) -> FlatPatch:
        """Work patch of at most `radius` levels around `seed`; smaller where it must be.

        `trim(order, start, plane, radius)` may ask for a smaller radius once a first map is
        known, before any work goes into mending it. `self.local` maps the patch's vertices to
        their position in `order` until `release`.
        """
        net, local = self.net, self.local
        order, start = grow(net.indptr, net.indices, seed, radius + 1, local, MAX_VERTICES)
        wanted = max(len(start) - 3, 1)  # the last level is the ghosts'
        self._reason = "component" if wanted < radius and len(order) <= MAX_VERTICES else ""
        plane = _in_chart(
            net.indptr, net.indices, order, local, self._texel, self._chart, self._texel_steps
        )
        if len(plane):
            radius = wanted if trim is None else trim(order, start, plane, wanted)
            self._reason = "field" if radius < wanted else self._reason
            return self._cut(order, start, plane, "chart", radius, 0)
        if self.literal:
            return self._paper(order, start, wanted)
        plane, _ = exponential_map(net.indptr, net.indices, net.edge, net.turn, order, start, local)
        if trim is not None:
            whole, wanted = wanted, trim(order, start, plane, wanted)
            self._reason = "field" if wanted < whole else self._reason
            whole = int(start[min(wanted + 2, len(start) - 1)])
            release(order[whole:], local)
            order, plane = order[:whole], plane[:whole]
            start = start[: min(wanted + 2, len(start) - 1) + 1]
        sound = self._sound(order, start, plane)
        kind = "expmap"
        if sound < wanted + 1 and len(order) > 8:
            relaxed = relax(net.indptr, net.indices, net.edge, order, local, plane, 2, 12)
            better = self._sound(order, start, relaxed)
            if better > sound:
                plane, sound, kind = relaxed, better, "relaxed"
        if sound <= min(wanted // 2, 2 * SMALLEST):
            return self._rescue(order, start, plane, kind, wanted, sound)
        return self._shrink(order, start, plane, kind, wanted, sound)

    def _rescue(
        self, order: I4, start: I4, plane: F8, kind: str, wanted: int, sound: int
    ) -> FlatPatch:
        """Where the map breaks near its centre, try LSCM on a patch of twice the sound size."""
        size = min(max(2 * sound, 2 * SMALLEST), wanted)
        whole = int(start[min(size + 2, len(start) - 1)])
        release(order[whole:], self.local)
        order, plane = order[:whole], plane[:whole]
        start = start[: min(size + 2, len(start) - 1) + 1]
        if self._tries < TRIES or self._rescues * SELDOM >= self._tries:
            self._tries += 1
            conformal = self._lscm(order)
            better = 0 if conformal is None else self._sound(order, start, conformal)
            if conformal is not None and better > sound:
                plane, sound, kind = conformal, better, "lscm"
                self._rescues += 1
        patch = self._shrink(order, start, plane, kind, size, sound)
        patch.shrinks += wanted > size
        return patch

    def _shrink(
        self, order: I4, start: I4, plane: F8, kind: str, wanted: int, sound: int
    ) -> FlatPatch:
        """Cut the radius by 0.8 until patch and ghost ring are sound; below 4, step by step.

        Where the surface bends within a few steps nothing is flat: a patch of the smallest
        size is let pass while it is not torn and not folded, lest the surface shatter.
        """
        shrinks, size = 0, wanted
        if size + 1 > sound and size > 1:
            self._reason = self._cause
        if not self.literal and sound <= SMALLEST < wanted:
            loose = self._sound(order, start, plane, LOOSE_AREA, LOOSE_STRETCHED)
            sound = max(sound, min(loose, SMALLEST + 1))
        while size + 1 > sound and size > 1:
            size = max(int(size * SHRINK), SMALLEST) if size > SMALLEST else size - 1
            shrinks += 1
        return self._cut(order, start, plane, kind, size, shrinks)

    def _cut(
        self, order: I4, start: I4, plane: F8, kind: str, size: int, shrinks: int
    ) -> FlatPatch:
        levels = len(start) - 2
        inner = int(start[min(size + 1, levels + 1)])
        whole = int(start[min(size + 2, levels + 1)])
        release(order[whole:], self.local)
        start = start[: min(size + 2, levels + 1) + 1]
        return FlatPatch(
            order[:whole], start, inner, plane[:whole], kind, size, shrinks, self._reason
        )

    def _paper(self, order: I4, start: I4, wanted: int) -> FlatPatch:
        """The paper's loop: LSCM at this radius, and again at 0.8 of it while too distorted."""
        size, shrinks = wanted, 0
        while True:
            patch = self._cut(order, start, np.zeros((len(order), 2)), "lscm", size, shrinks)
            shorter = start[: min(size + 2, len(start) - 1) + 1]
            plane = self._lscm(patch.order)
            sound = 0 if plane is None else self._sound(patch.order, shorter, plane)
            if plane is not None and sound >= min(size + 1, len(shorter) - 2):
                patch.plane = plane
                return patch
            if size <= SMALLEST:
                break
            size, shrinks = max(int(size * SHRINK), SMALLEST), shrinks + 1
            self._reason = self._cause
        net = self.net  # the paper does not say what follows its smallest size
        plane, _ = exponential_map(
            net.indptr, net.indices, net.edge, net.turn, patch.order, shorter, self.local
        )
        sound = self._sound(patch.order, shorter, plane)
        return self._shrink(patch.order, shorter, plane, "expmap", size, sound)

    def _sound(
        self,
        order: I4,
        start: I4,
        plane: F8,
        share: float = BAD_AREA,
        stretched: float = STRETCHED,
    ) -> int:
        net = self.net
        if not np.isfinite(plane).all():
            self._cause = "tear"
            return 0
        sound, torn = sound_levels(
            net.indptr, net.indices, net.face_ptr, net.face_of, net.faces, net.area,
            net.edge, order, start, self.local, plane, self.bound, share,
            STRETCH, 1.0 if self.literal else stretched,
        )  # fmt: skip
        self._cause = "tear" if sound + 1 >= torn else "distortion"
        return int(sound)

    def _lscm(self, order: I4) -> F8 | None:
        net, seed = self.net, int(order[0])
        faces = patch_faces(net.faces, net.face_ptr, net.face_of, order, self.local)
        points = self.dense.vertices[order] / self._step
        normal = np.asarray(self.dense.normals[seed], np.float64)
        plane = lscm(points, faces, normal, np.asarray(self.field.tangents[seed], np.float64))
        if plane is None or np.isfinite(plane).all():
            return plane
        return np.asarray(extend(net.indptr, net.indices, net.edge, order, self.local, plane))


def _texel_in_steps(net: Connectivity, dense: DenseMesh) -> float:
    """Side of a texel in dense-mesh steps, from the grid's triangles (half a texel each)."""
    grid = net.area[: dense.grid_faces]
    return float(np.sqrt(2 * grid.mean(dtype=np.float64))) if len(grid) else 1.0


@njit(cache=True)
def _in_chart(indptr, indices, order, local, texel, chart, side):  # type: ignore[no-untyped-def]
    """Texel coordinates (n, 2) where the whole patch is a piece of one chart, else (0, 2)."""
    seed = order[0]
    for vertex in order:
        if chart[vertex] != chart[seed]:
            return np.empty((0, 2), np.float64)
    for vertex in order:
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = indices[slot]
            if local[other] >= 0 and (
                abs(texel[other, 0] - texel[vertex, 0]) > 1
                or abs(texel[other, 1] - texel[vertex, 1]) > 1
            ):
                return np.empty((0, 2), np.float64)  # the chart is zippered to itself here
    plane = np.empty((len(order), 2), np.float64)
    for here in range(len(order)):
        plane[here, 0] = (texel[order[here], 1] - texel[seed, 1]) * side
        plane[here, 1] = -(texel[order[here], 0] - texel[seed, 0]) * side
    return plane
