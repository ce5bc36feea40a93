"""Contraction at control points: tables are blended at a few points, and weights everywhere.

View and light turn slowly over a surface, factors do not. So the rows of a factor table are
blended where an input vertex and a patch meet (the patches' frames differ, hence both), or also
at the middles of edges, and carried to the surfels between by barycentric shares. What is left
for each surfel are three rows instead of sixteen and no look-up but the light's height. That is
an approximation: how good it is depends on how finely the mesh is divided, so measure it.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.btf.factor.elementary import decode_rows
from btfcore.errors import InvalidParameter
from btfcore.mesh.topology import vertex_normals
from btfcore.render.evaluate import Evaluator, by_sample, checked_out, checked_shapes
from btfcore.render.factor_kernels import (
    GREATEST,
    FactorTables,
    add_light,
    coded_into,
    row_into,
    texels_into,
)
from btfcore.render.lights import Lights
from btfcore.render.lookup import find_lights, find_views, points, scaled_eye, scratch, task
from btfcore.render.pool import BLOCK, in_slices
from btfcore.render.rows import aligned, blend
from btfcore.render.surfels import BARE, Placement, Surfels, turned_frames
from btfcore.types import F4, F8, I4, I8, DenseMesh, Frozen, Mesh, Quilt

_ZERO, _ONE = np.float32(0), np.float32(1)


@dataclass(frozen=True, eq=False)
class ControlPoints(Frozen):
    """Control points and what each surfel takes from them.

    surfels : the points themselves (C of them), each with its patch's frame, carried to the
    normal there. corner (n, 3) i4: the three around each surfel; share (n, 3) f4 ≥ 0, of sum 1.
    """

    surfels: Surfels
    corner: I4
    share: F4


def control_points(
    mesh: Mesh,
    dense: DenseMesh,
    quilt: Quilt,
    surfels: Surfels,
    place: Placement,
    *,
    midpoints: bool = False,
) -> ControlPoints:
    """One for every input vertex and patch around it; with `midpoints` for every edge too.

    mesh : the one that `dense.face` and `dense.bary` speak of. Raises `InvalidParameter` where
    the arrays are of different meshes.
    """
    if not len(dense.face) == len(quilt.patch) == len(surfels):
        raise InvalidParameter(
            f"a dense mesh of {len(dense.face)} vertices, a quilt of {len(quilt.patch)} and"
            f" {len(surfels)} surfels"
        )
    ends, share = _corners(mesh, dense, midpoints)
    count = len(mesh.vertices)
    patches = int(quilt.patch.max(initial=-1)) + 2
    low, high = ends.min(axis=2), ends.max(axis=2)
    key = (low * count + high) * patches + quilt.patch[:, None] + 1
    found, corner_of = np.unique(key, return_inverse=True)
    corner: I4 = corner_of.reshape(-1, 3).astype(np.int32)
    pair, patch = np.divmod(found, patches)
    one, two = np.divmod(pair, count)
    normals = vertex_normals(mesh.vertices, mesh.faces)
    along = np.zeros((len(found), 3))
    sample = np.full(len(found), BARE, np.uint16)
    _carry(surfels.frame, surfels.sample, corner, share, along, sample)
    frame = turned_frames(
        (normals[one] + normals[two]).astype(np.float32), along.astype(np.float32),
        np.zeros(len(found)),
    )  # fmt: skip
    position = place.to_scene((mesh.vertices[one] + mesh.vertices[two]) / 2)
    points = Surfels(
        position.astype(np.float32), frame, np.zeros((len(found), 2), np.float32), sample
    )
    return ControlPoints(points, corner, share)


class ControlEvaluator:
    """An `Evaluator` that contracts at control points; holds buffers, so for one thread at once."""

    def __init__(self, evaluator: Evaluator, control: ControlPoints) -> None:
        """Keep both; nothing is computed yet."""
        self._evaluator, self._control = evaluator, control
        self._rows = aligned((0,))

    def radiance(
        self,
        surfels: Surfels,
        eye: F8,
        lights: Lights,
        chosen: NDArray[Any] | None = None,
        *,
        visible: F4 | None = None,
        out: F4 | None = None,
        pool: Executor | None = None,
    ) -> F4:
        """Approximate radiance (n, 3) f4 of surfels towards `eye`; see `Evaluator.radiance`.

        Attached shadows are exact. Materials that are no factors, and bare surfels, are
        evaluated in full.
        """
        numbers = np.arange(len(surfels)) if chosen is None else np.asarray(chosen)
        numbers = np.ascontiguousarray(numbers, np.int64)
        if len(surfels) != len(self._control.corner):
            raise InvalidParameter(
                f"{len(surfels)} surfels, control points of {len(self._control.corner)}"
            )
        out = checked_out(out, len(numbers))
        seen = checked_shapes(len(numbers), len(lights), None, visible)
        for number, rows in by_sample(surfels, numbers, len(self._evaluator.materials)):
            made = self._evaluator.made(number)
            if isinstance(made, FactorTables) and number < len(self._evaluator.materials):
                self._contracted(made, surfels, numbers, rows, eye, lights, seen, out, pool)
            else:
                work = self._evaluator.worker(
                    number, surfels, numbers, rows, eye, lights, None, seen, out
                )
                in_slices(work, len(rows), pool)
        return out

    def _contracted(
        self,
        made: FactorTables,
        surfels: Surfels,
        numbers: I8,
        rows: I4,
        eye: F8,
        lights: Lights,
        visible: F4,
        out: F4,
        pool: Executor | None,
    ) -> None:
        control = self._control
        needed = np.empty(len(control.surfels), np.int64)
        slot = np.empty(len(control.surfels), np.int32)
        needed = needed[: _needed(control.corner, numbers, rows, slot, needed)]
        size = len(needed) * made.width
        if size > len(self._rows):
            self._rows = aligned((size,))
        table, asked, here = self._rows, task(needed), points(control.surfels)
        where, which, seen_from = points(surfels), task(numbers, None, rows), scaled_eye(eye)
        if not len(lights):
            out[rows] = 0
        for light in range(len(lights)):
            toward = lights.direction[light].astype(np.float32)
            strength = lights.intensity[light].astype(np.float32)

            def contract(begin: int, end: int, toward: F4 = toward) -> None:
                contract_slice(here, asked, begin, end, seen_from, toward, made, table)

            lamp = (toward, strength, light)

            def spread(begin: int, end: int, lamp: tuple[F4, F4, int] = lamp) -> None:
                spread_slice(
                    where, which, begin, end, control.corner, control.share, slot, table, *lamp,
                    visible, made, out,
                )  # fmt: skip

            in_slices(contract, len(needed), pool)
            in_slices(spread, len(rows), pool)


def _corners(mesh: Mesh, dense: DenseMesh, midpoints: bool) -> tuple[I8, F4]:
    """Control points (n, 3, 2) as pairs of input vertices (twice the same: a vertex), shares."""
    corner = mesh.faces[dense.face].astype(np.int64)
    share = np.maximum(dense.bary.astype(np.float64), 0.0)
    share /= share.sum(axis=1, keepdims=True)
    if not midpoints:
        return np.stack([corner, corner], axis=2), share.astype(np.float32)
    # The middle triangle has the middles of the edges opposite to corners 0, 1, 2; those
    # around it have one corner and the middles of the two edges there.
    ends = np.stack([np.roll(corner, -1, axis=1), np.roll(corner, -2, axis=1)], axis=2)
    inner = 1 - 2 * share
    near = share.argmax(axis=1)
    outer = np.flatnonzero(share[np.arange(len(share)), near] > 0.5)
    own = near[outer]
    ends[outer, own] = corner[outer, own, None]
    # at the corner 2 s - 1; the middle of the edge towards another corner, twice its share
    own_share = 2 * share[outer, own] - 1
    after, before = (own + 1) % 3, (own + 2) % 3
    inner[outer, own] = own_share
    inner[outer, before] = 2 * share[outer, after]  # the middle opposite `before` is to `after`
    inner[outer, after] = 2 * share[outer, before]
    return ends, inner.astype(np.float32)


# --- kernels


@njit(cache=True, nogil=True)
def _carry(frame, sample, corner, share, along, samples):  # type: ignore[no-untyped-def]
    """Sum the surfels' s at the control points, and name the samples there."""
    for i in range(len(corner)):
        for k in range(3):
            c = corner[i, k]
            samples[c] = sample[i]
            for axis in range(3):
                along[c, axis] += (share[i, k] + 1e-6) * frame[i, 0, axis]


@njit(cache=True, nogil=True)
def _needed(corner, numbers, rows, slot, needed):  # type: ignore[no-untyped-def]
    """List the control points of the surfels numbers[rows]; slot: place in that list."""
    slot[:] = 0
    for row in rows:
        n = numbers[row]
        slot[corner[n, 0]] = slot[corner[n, 1]] = slot[corner[n, 2]] = 1
    count = 0
    for c in range(len(slot)):
        used = slot[c]
        slot[c] = count
        needed[count] = c
        count += used
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def contract_slice(control, task, begin, end, eye, direction, made, out):  # type: ignore[no-untyped-def]
    """Blend the table's rows for control points begin … end under one light into `out`."""
    views, lamps = scratch(made.views.slots), scratch(made.lights.slots)
    for start in range(begin, end, BLOCK):
        count = min(BLOCK, end - start)
        find_views(made.views, control, task, eye, start, count, views)
        find_lights(made.lights, control, task, direction, made.cosine, start, count, lamps)
        for i in range(count):
            row_into(
                made.table, made.nodes, made.width, views, lamps, i, out,
                (start + i) * made.width,
            )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def spread_slice(  # type: ignore[no-untyped-def]
    surfels, task, begin, end, corner, share, slot, table, direction, strength, light, visible,
    made, out,
):  # fmt: skip
    """Add radiance under one light, from contracted rows, to `out`, which light 0 begins."""
    rank, width = made.rank, made.width
    gain, row = np.empty(BLOCK, np.float32), np.zeros(width, np.float32)
    weights = np.zeros(BLOCK * rank, np.float32)
    coded, sums = np.zeros((3, BLOCK), np.float32), np.empty((BLOCK, 3), np.float32)
    frame = surfels.frame
    for start in range(begin, end, BLOCK):
        count = min(BLOCK, end - start)
        for i in range(count):
            n = task.numbers[task.rows[start + i]]
            x, y, z = frame[n, 2, 0], frame[n, 2, 1], frame[n, 2, 2]
            height = x * direction[0] + y * direction[1] + z * direction[2]
            gain[i] = min(max(height / made.lights.held, _ZERO), _ONE)
            if not made.cosine:
                gain[i] = max(height, _ZERO)
        texels_into(
            made.weights, rank, made.height, made.across, made.tiles, surfels, task, start, count,
            weights,
        )  # fmt: skip
        for i in range(count):
            if gain[i] > _ZERO:
                n = task.numbers[task.rows[start + i]]
                blend(
                    table,
                    (
                        np.int64(slot[corner[n, 0]]) * width, np.int64(slot[corner[n, 1]]) * width,
                        np.int64(slot[corner[n, 2]]) * width,
                    ),
                    (share[n, 0], share[n, 1], share[n, 2]),
                    row, 0, width,
                )  # fmt: skip
                coded_into(row, weights, rank, coded, i)
        decode_rows(coded[0], coded[1], coded[2], made.kind, made.epsilon, made.knee)
        sums[:] = _ZERO
        add_light(coded, gain, strength, visible, light, task, start, count, sums)
        for i in range(count):
            at = task.rows[start + i]
            for colour in range(3):
                value = sums[i, colour] + (out[at, colour] if light > 0 else _ZERO)
                out[at, colour] = min(value, GREATEST) if value > _ZERO else _ZERO
