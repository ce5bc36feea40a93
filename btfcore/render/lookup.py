"""Directions of many surfels as nodes of a sample's tables and their shares, fast.

The same rules as `btfcore.render.reference` in single floats, a block of surfels at a time: loops
over a block have no branches, so that they vectorise. On rings there are no calls of the C
library either; other ways to interpolate are asked through their own kernels.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.btf.interpolation.barycentric import _barycentric
from btfcore.btf.interpolation.nearest import _nearest
from btfcore.render.lookup_tables import Lookup
from btfcore.render.pool import BLOCK
from btfcore.render.rows import locked
from btfcore.render.surfels import Surfels
from btfcore.types import F4, F8, I4

SLOTS = 4  # nodes of a query
_QUARTER, _HALF, _WHOLE = (np.float32(np.pi / k) for k in (4, 2, 0.5))
_EIGHTH = np.float32(np.tan(np.pi / 8))
_A3, _A5 = np.float32(-3.33329491539e-1), np.float32(1.99777106478e-1)
_A7, _A9 = np.float32(-1.38776856032e-1), np.float32(8.05374449538e-2)
_ZERO, _ONE = np.float32(0), np.float32(1)
_TINY, _HUGE = np.float32(1e-36), np.float32(1e36)


class Points(NamedTuple):
    """Surfels as kernels take them: position, frame, source; see `btfcore.render.surfels`."""

    position: F4
    frame: F4
    source: F4


class Task(NamedTuple):
    """Which surfels to work on: numbers[rows[i]]; results go to row rows[i].

    numbers (n,) i8; rows (m,) i4; place (n, 3) f4: where each is looked at, (0, 3): at itself.
    """

    numbers: NDArray[np.int64]
    rows: I4
    place: F4


class Scratch(NamedTuple):
    """Room for a block's directions: vectors, angles, what the interpolators fill, results."""

    x: F4
    y: F4
    z: F4
    polar: F4
    azimuth: F4
    outer: F4
    along: F4
    cell: I4
    query: F4
    slot: I4
    slot_share: F4
    outside: NDArray[np.bool_]
    node: NDArray[np.int64]
    share: F4
    gain: F4


# --- kernels, for one block of `BLOCK` surfels. Blocks are always worked on as a whole, so that
# a surfel's bits depend on nothing but the surfel.


@njit(inline="always", error_model="numpy")
def _angle(y, x):  # type: ignore[no-untyped-def]
    """Angle of (x, y) in 0 … 2π, f4, to 3e-7 (the polynomial of Moshier's Cephes)."""
    across, up = abs(x), abs(y)
    flat = min(across, up) / max(max(across, up), _TINY)
    steep = flat > _EIGHTH
    t = (flat - _ONE) / (flat + _ONE) if steep else flat
    s = t * t
    angle = t + t * s * (_A3 + s * (_A5 + s * (_A7 + s * _A9)))
    angle = angle + _QUARTER if steep else angle
    angle = _HALF - angle if up > across else angle
    angle = np.float32(2) * _HALF - angle if x < _ZERO else angle
    return _WHOLE - angle if y < _ZERO else angle


@njit(cache=True, nogil=True, error_model="numpy")
def eyes_into(surfels, task, eye, begin, count, room):  # type: ignore[no-untyped-def]
    """Vectors (BLOCK,) f4 towards the eye in the frames of the task's surfels from `begin` on."""
    x, y, z = room.x, room.y, room.z
    position, frame, place = surfels.position, surfels.frame, task.place
    own = len(place) > 0
    for i in range(BLOCK):
        at = task.rows[begin + min(i, count - 1)]
        n = task.numbers[at]
        if own:
            px, py, pz = place[at, 0], place[at, 1], place[at, 2]
        else:
            px, py, pz = position[n, 0], position[n, 1], position[n, 2]
        dx = np.float32(eye[0] - eye[3] * px)
        dy = np.float32(eye[1] - eye[3] * py)
        dz = np.float32(eye[2] - eye[3] * pz)
        x[i] = frame[n, 0, 0] * dx + frame[n, 0, 1] * dy + frame[n, 0, 2] * dz
        y[i] = frame[n, 1, 0] * dx + frame[n, 1, 1] * dy + frame[n, 1, 2] * dz
        z[i] = frame[n, 2, 0] * dx + frame[n, 2, 1] * dy + frame[n, 2, 2] * dz


@njit(cache=True, nogil=True, error_model="numpy")
def lamps_into(surfels, task, direction, begin, count, room):  # type: ignore[no-untyped-def]
    """Vectors (BLOCK,) f4 of a light's direction (3,) f4 in the frames of the surfels."""
    x, y, z, frame = room.x, room.y, room.z, surfels.frame
    dx, dy, dz = direction[0], direction[1], direction[2]
    for i in range(BLOCK):
        n = task.numbers[task.rows[begin + min(i, count - 1)]]
        x[i] = frame[n, 0, 0] * dx + frame[n, 0, 1] * dy + frame[n, 0, 2] * dz
        y[i] = frame[n, 1, 0] * dx + frame[n, 1, 1] * dy + frame[n, 1, 2] * dz
        z[i] = frame[n, 2, 0] * dx + frame[n, 2, 1] * dy + frame[n, 2, 2] * dz


@njit(cache=True, nogil=True, error_model="numpy")
def unit_in_place(room, lift):  # type: ignore[no-untyped-def]
    """Normalise vectors (BLOCK,); what has no length becomes +s. lift: none below the horizon."""
    x, y, z = room.x, room.y, room.z
    for i in range(BLOCK):
        up = max(z[i], _ZERO) if lift else z[i]
        squared = x[i] * x[i] + y[i] * y[i] + up * up
        sound = squared > _TINY and squared < _HUGE
        shrink = _ONE / np.sqrt(squared if sound else _ONE)
        x[i] = x[i] * shrink if sound else _ONE
        y[i] = y[i] * shrink if sound else _ZERO
        z[i] = up * shrink if sound else _ZERO


@njit(cache=True, nogil=True, error_model="numpy")
def nodes_into(table, room):  # type: ignore[no-untyped-def]
    """Nodes (BLOCK, 4) i8 and shares (BLOCK, 4) f4 of unit vectors above the horizon."""
    x, y, z, node, share = room.x, room.y, room.z, room.node, room.share
    if table.way == 0:
        for i in range(BLOCK):
            room.polar[i] = _angle(np.sqrt(x[i] * x[i] + y[i] * y[i]), z[i])
        for i in range(BLOCK):
            room.azimuth[i] = _angle(y[i], x[i])
        if len(table.grid):
            _on_grid(table, room)
        else:
            _on_rings(table, room.polar, room.azimuth, node, share)
        return
    query, slot, slot_share = room.query, room.slot, room.slot_share
    for i in range(BLOCK):
        query[i, 0], query[i, 1], query[i, 2] = x[i], y[i], max(z[i], _ZERO)
    if table.way == 1:
        _barycentric(
            table.triangles, table.affine, table.edges, table.segment, table.low, table.scale,
            table.side, table.first, table.candidates, query, slot, slot_share, room.outside,
        )  # fmt: skip
    else:
        _nearest(table.points, table.own, query, slot, slot_share)
    for i in range(BLOCK):
        for k in range(SLOTS):
            there = k < slot.shape[1]
            node[i, k] = slot[i, k] if there else slot[i, 0]
            share[i, k] = slot_share[i, k] if there else _ZERO


@njit(cache=True, nogil=True, error_model="numpy")
def _on_grid(table, room):  # type: ignore[no-untyped-def]
    """As `_on_rings` for rings of the same azimuths: compares with all borders, never jumps."""
    rings, first = len(table.theta) - 1, 2  # the pole's own azimuth and its end come first
    around = table.grid.shape[1] - 1
    t, turned, cell = room.polar, room.azimuth, room.cell
    outer, along = room.outer, room.along
    origin = table.origin[1]
    for i in range(BLOCK):
        turned[i] = turned[i] - origin + (_WHOLE if turned[i] < origin else _ZERO)
        cell[i] = 0
        outer[i] = t[i] * table.gap[0]
        along[i] = turned[i] * table.inverse[first]
    for k in range(1, rings):
        low, gap = table.theta[k], table.gap[k] if k < rings - 1 else _ZERO
        for i in range(BLOCK):
            past = t[i] >= low
            cell[i] += np.int32(around + 1) if past else np.int32(0)
            outer[i] = (t[i] - low) * gap if past else outer[i]
    for k in range(1, around):
        low, gap = table.phi[first + k], table.inverse[first + k]
        for i in range(BLOCK):
            past = turned[i] >= low
            cell[i] += np.int32(1) if past else np.int32(0)
            along[i] = (turned[i] - low) * gap if past else along[i]
    for i in range(BLOCK):
        outer[i] = min(max(outer[i], _ZERO), _ONE)
        along[i] = min(max(along[i], _ZERO), _ONE)
    flat = table.grid.reshape(-1)
    final = len(flat) - around - 1
    node, share = room.node, room.share
    for i in range(BLOCK):
        at = np.uintp(cell[i])
        after = at + np.uintp(around + 1) if cell[i] < final else at
        node[i, 0], node[i, 1] = flat[at], flat[at + np.uintp(1)]
        node[i, 2], node[i, 3] = flat[after], flat[after + np.uintp(1)]
        share[i, 0] = (_ONE - outer[i]) * (_ONE - along[i])
        share[i, 1] = (_ONE - outer[i]) * along[i]
        share[i, 2] = outer[i] * (_ONE - along[i])
        share[i, 3] = outer[i] * along[i]


@njit(cache=True, nogil=True, error_model="numpy")
def _on_rings(table, polar, azimuth, node, share):  # type: ignore[no-untyped-def]
    last = len(table.theta) - 2
    most = len(table.ring) - 1
    for i in range(BLOCK):
        t = polar[i]
        nearest = min(int(t * table.steep), most)
        ring = int(table.ring[nearest])
        # one step at most where the bins are fine enough, so that it is seldom guessed wrong
        ring += int(table.theta[ring + 1] <= t)
        while table.theta[ring + 1] <= t:
            ring += 1
        ring = min(ring, last)
        outer = (t - table.theta[ring]) * table.gap[ring]
        outer = min(max(outer, _ZERO), _ONE) if ring < last else _ZERO
        for side in range(2):
            here = min(ring + side, last)
            part = outer if side == 1 else _ONE - outer
            turned = azimuth[i] - table.origin[here]
            turned = turned + _WHOLE if turned < _ZERO else turned
            at = np.int64(table.at[table.first_bin[here] + np.int64(turned * table.pace[here])])
            at += np.int64(table.phi[at + 1] <= turned)
            while table.phi[at + 1] <= turned:
                at += 1
            along = min(max((turned - table.phi[at]) * table.inverse[at], _ZERO), _ONE)
            node[i, 2 * side] = table.member[at]
            node[i, 2 * side + 1] = table.member[at + 1]
            share[i, 2 * side] = part * (_ONE - along)
            share[i, 2 * side + 1] = part * along


@njit(cache=True, nogil=True, error_model="numpy")
def gains_into(table, cosine, room):  # type: ignore[no-untyped-def]
    """What the lights of a block give: their cosine, or 1 and its fading; 0 below the horizon."""
    z, gain = room.z, room.gain
    if not cosine:
        for i in range(BLOCK):
            gain[i] = max(z[i], _ZERO)
        return
    held = table.held
    if table.way != 1:
        for i in range(BLOCK):
            gain[i] = min(max(z[i], _ZERO) / held, _ONE)
        return
    for i in range(BLOCK):
        gain[i] = _ONE if z[i] > _ZERO else _ZERO
        if room.outside[i] and z[i] > _ZERO:
            u = v = 0.0
            for k in range(room.slot.shape[1]):
                u += room.slot_share[i, k] * table.chart[room.slot[i, k], 0]
                v += room.slot_share[i, k] * table.chart[room.slot[i, k], 1]
            squared = u * u + v * v
            edge = max((1.0 - squared) / (1.0 + squared), 1e-9)
            gain[i] = min(max(np.float32(z[i] / edge), _ZERO), _ONE)


@njit(cache=True, nogil=True, error_model="numpy")
def find_views(table, surfels, task, eye, begin, count, room):  # type: ignore[no-untyped-def]
    """Fill room.node and room.share for the views of a block."""
    eyes_into(surfels, task, eye, begin, count, room)
    unit_in_place(room, True)
    nodes_into(table, room)


@njit(cache=True, nogil=True, error_model="numpy")
def find_lights(table, surfels, task, direction, cosine, begin, count, room):  # type: ignore[no-untyped-def]
    """Fill room.node, room.share and room.gain for one light (3,) f4 on a block."""
    lamps_into(surfels, task, direction, begin, count, room)
    unit_in_place(room, False)
    nodes_into(table, room)
    gains_into(table, cosine, room)


# --- whole arrays


def points(surfels: Surfels) -> Points:
    """Return the surfels as kernels take them."""
    return Points(locked(surfels.position), locked(surfels.frame), locked(surfels.source))


def task(
    chosen: NDArray[Any], position: NDArray[Any] | None = None, rows: I4 | None = None
) -> Task:
    """Return all of `chosen`, or some `rows` of it, as kernels take them."""
    numbers = np.ascontiguousarray(chosen, np.int64)
    place = np.zeros((0, 3)) if position is None else position
    if rows is None:
        rows = np.arange(len(numbers), dtype=np.int32)
    return Task(locked(numbers), locked(rows), locked(np.ascontiguousarray(place, np.float32)))


def view_nodes(
    table: Lookup, surfels: Surfels, chosen: NDArray[Any], eye: F8, position: F4 | None = None
) -> tuple[NDArray[np.int64], F4]:
    """Nodes (n, 4) i8 and shares (n, 4) f4 of the directions towards `eye`, on one thread."""
    node, share = np.empty((len(chosen), SLOTS), np.int64), np.empty((len(chosen), SLOTS), "f4")
    _views(table, points(surfels), task(chosen, position), scaled_eye(eye), node, share)
    return node, share


def light_nodes(
    table: Lookup, surfels: Surfels, chosen: NDArray[Any], direction: F8, *, cosine: bool
) -> tuple[NDArray[np.int64], F4, F4]:
    """Nodes and shares (n, 4) of a light's directions, and what it gives (n,) f4."""
    node, share = np.empty((len(chosen), SLOTS), np.int64), np.empty((len(chosen), SLOTS), "f4")
    gain = np.empty(len(chosen), np.float32)
    toward = np.asarray(direction, np.float32)
    _lights(table, points(surfels), task(chosen), toward, cosine, node, share, gain)
    return node, share, gain


def scaled_eye(eye: F8) -> F8:
    """Homogeneous coordinates of the same eye, (4,) f8, the greatest of them 1."""
    largest = float(np.abs(eye).max())
    return np.asarray(eye, np.float64) / (largest if 0 < largest < np.inf else 1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def scratch(slots):  # type: ignore[no-untyped-def]
    """Room for blocks of directions that are found in `slots` of a `Lookup`."""
    return Scratch(
        np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32),
        np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32),
        np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32), np.empty(BLOCK, np.int32),
        np.empty((BLOCK, 3), np.float32), np.empty((BLOCK, slots), np.int32),
        np.empty((BLOCK, slots), np.float32), np.zeros(BLOCK, np.bool_),
        np.empty((BLOCK, 4), np.int64), np.empty((BLOCK, 4), np.float32),
        np.empty(BLOCK, np.float32),
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _views(table, surfels, task, eye, node, share):  # type: ignore[no-untyped-def]
    room = scratch(table.slots)
    for begin in range(0, len(task.rows), BLOCK):
        count = min(BLOCK, len(task.rows) - begin)
        find_views(table, surfels, task, eye, begin, count, room)
        node[begin : begin + count] = room.node[:count]
        share[begin : begin + count] = room.share[:count]


@njit(cache=True, nogil=True, error_model="numpy")
def _lights(table, surfels, task, direction, cosine, node, share, gain):  # type: ignore[no-untyped-def]
    room = scratch(table.slots)
    for begin in range(0, len(task.rows), BLOCK):
        count = min(BLOCK, len(task.rows) - begin)
        find_lights(table, surfels, task, direction, cosine, begin, count, room)
        node[begin : begin + count] = room.node[:count]
        share[begin : begin + count] = room.share[:count]
        gain[begin : begin + count] = room.gain[:count]
