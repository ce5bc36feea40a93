"""Fills seams with strips of triangles and nodes with fans (Zhou §III-A, MCGIM zippering).

The result is correct by construction as a surface: which half-edges meet is written down
while the triangles are made, never guessed from vertex numbers. So triangles may still repeat
a vertex or an edge here; `btfcore.dense.flips` puts that right.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.dense.check import Flags
from btfcore.dense.corners import Corners
from btfcore.dense.walk import Walks
from btfcore.types import F8, I4

WALL, OPEN, POINT = -1, -2, -3  # what lies beyond a half-edge that has no partner
_ALIAS = -8  # codes up to here name another port
_CELLS = 4_000_000  # of the dynamic programme; longer arcs are kept in a band
_BAND = 64


def zip_seams(points: F8, walks: Walks, corners: Corners, pieces: int) -> tuple[I4, I4, I4]:
    """Triangles between the walks and who is opposite whom.

    points (N, 3) f8. Returns faces (M, 3) i4; twin (3M,) i4: the opposite half-edge
    (3 face + k, from corner k to k + 1), WALL where a walk's edge lies beyond, OPEN at the
    surface's boundary and POINT where a side has shrunk to nothing (`without_points` takes
    these out); cross (C,) i4: the open half-edge by which the boundary goes on from a corner
    to the next one about its node, OPEN where an edge without any triangle does, POINT where
    both corners are one (used at nodes on the boundary only).
    """
    chains, first, sizes, mine = _chains(walks.vertex, walks.start, pieces, *_arcs(corners))
    faces, twin, port = _strips(np.ascontiguousarray(points), chains, first, sizes)
    return _nodes(np.ascontiguousarray(points), walks.vertex, corners.place, corners.mate,
                  corners.around, mine, port, faces, twin)  # fmt: skip


def _arcs(corners: Corners) -> tuple[I4, I4, I4, I4]:
    piece = np.repeat(np.arange(len(corners.start) - 1, dtype=np.int32), np.diff(corners.start))
    return corners.place, corners.steps, corners.mate, piece


@njit(cache=True)
def _chains(
    vertex: I4, start: I4, pieces: int, place: I4, steps: I4, mate: I4, piece: I4
) -> tuple[I4, I4, I4, I4]:
    """Both rows of vertices of every strip: (rows, first (S, 2), length (S, 2), strip of arc).

    Row 0 runs along its walk, row 1 against its own, from the same node to the same node.
    Strips of arcs come first, then one for each hole, which is zipped to itself.
    """
    holes = len(start) - 1 - pieces
    strips = total = 0
    for arc in range(len(place)):
        if mate[arc] >= 0:
            strips += mate[arc] > arc
            total += steps[arc] + 1
    for hole in range(holes):
        total += start[pieces + hole + 1] - start[pieces + hole] + 2
    rows = np.empty(total, np.int32)
    first = np.zeros((strips + holes, 2), np.int32)
    size = np.zeros((strips + holes, 2), np.int32)
    strip_of = np.full(len(place), -1, np.int32)
    at = strip = 0
    for arc in range(len(place)):
        if mate[arc] <= arc:
            continue
        for side in range(2):
            here = arc if side == 0 else mate[arc]
            begin = start[piece[here]]
            length = start[piece[here] + 1] - begin
            first[strip, side], size[strip, side] = at, steps[here] + 1
            for step in range(steps[here] + 1):
                along = step if side == 0 else steps[here] - step
                rows[at] = vertex[begin + (place[here] - begin + along) % length]
                at += 1
            strip_of[here] = strip
        strip += 1
    for hole in range(holes):
        begin = start[pieces + hole]
        length = start[pieces + hole + 1] - begin
        half = length // 2
        first[strip, 0], size[strip, 0] = at, half + 1
        for step in range(half + 1):
            rows[at] = vertex[begin + step]
            at += 1
        first[strip, 1], size[strip, 1] = at, length - half + 1
        for step in range(length - half + 1):
            rows[at] = vertex[begin + (length - step) % length]
            at += 1
        strip += 1
    return rows, first, size, strip_of


@njit(cache=True)
def zip_rows(points: F8, one: I4, other: I4) -> Flags:
    """Cheapest way to zip two rows of vertices by the total length of the cross edges.

    one (m + 1,), other (n + 1,) vertices. Returns (m + n,) bool: at each step whether row
    `one` moves on (a triangle of two of its vertices), else row `other`.
    """
    m, n = len(one) - 1, len(other) - 1
    reach = n if (m + 1) * (n + 1) <= _CELLS else max(_BAND, _CELLS // (2 * (m + 1)))
    cost = np.full(n + 1, np.inf)
    choice = np.zeros((m + 1, min(2 * reach + 2, n + 1)), np.bool_)
    scale = 0.0
    for i in range(m + 1):
        scale = max(scale, np.abs(points[one[i]] - points[other[0]]).max())
    for i in range(m + 1):
        middle = i * n // max(m, 1)
        low, high = max(middle - reach, 0), min(middle + reach, n)
        if m == 0 or reach >= n:
            low, high = 0, n
        for j in range(low):
            cost[j] = np.inf
        for j in range(low, high + 1):
            length = 0.0
            for axis in range(3):
                length += (points[one[i], axis] - points[other[j], axis]) ** 2
            length = np.sqrt(length) if one[i] != other[j] else 8 * scale
            if i == 0 and j == 0:
                cost[0] = length
                continue
            above = cost[j] if i > 0 else np.inf
            left = cost[j - 1] if j > low else np.inf
            choice[i, j - low] = above <= left
            cost[j] = min(above, left) + length
        for j in range(high + 1, n + 1):
            cost[j] = np.inf
    moves = np.empty(m + n, np.bool_)
    i, j = m, n
    for step in range(m + n - 1, -1, -1):
        middle = i * n // max(m, 1)
        low = 0 if m == 0 or reach >= n else max(middle - reach, 0)
        moves[step] = i > 0 and (j == 0 or choice[i, j - low])
        if moves[step]:
            i -= 1
        else:
            j -= 1
    return moves


@njit(cache=True)
def _strips(points: F8, rows: I4, first: I4, size: I4) -> tuple[I4, I4, I4]:
    """Triangles of all strips, partners, and each strip's half-edges at its two ends."""
    total = 0
    for strip in range(len(size)):
        total += size[strip, 0] + size[strip, 1] - 2
    faces = np.empty((total, 3), np.int32)
    twin = np.full(3 * total, WALL, np.int32)
    port = np.full((len(size), 2), -1, np.int32)
    face = 0
    for strip in range(len(size)):
        one = rows[first[strip, 0] : first[strip, 0] + size[strip, 0]]
        other = rows[first[strip, 1] : first[strip, 1] + size[strip, 1]]
        moves = zip_rows(points, one, other)
        i = j = 0
        open_edge = -1
        for step in range(len(moves)):
            if moves[step]:
                faces[face, 0], faces[face, 1], faces[face, 2] = one[i + 1], one[i], other[j]
                i += 1
                into, out = 3 * face + 1, 3 * face + 2
            else:
                faces[face, 0], faces[face, 1], faces[face, 2] = other[j], other[j + 1], one[i]
                j += 1
                into, out = 3 * face + 2, 3 * face + 1
            if step == 0:
                port[strip, 0] = into
            else:
                twin[into], twin[open_edge] = open_edge, into
            open_edge = out
            face += 1
        port[strip, 1] = open_edge
    return faces, twin, port


@njit(cache=True)
def _nodes(
    points: F8, vertex: I4, place: I4, mate: I4, around: I4, strip_of: I4, port: I4,
    faces: I4, twin: I4,
) -> tuple[I4, I4, I4]:  # fmt: skip
    """Fill the nodes with fans and join everything that meets at the strips' ends."""
    strips = len(port)
    outside = np.full(2 * strips, POINT, np.int32)
    back = np.full(len(place), -1, np.int32)
    for corner in range(len(place)):
        if around[corner] >= 0:
            back[around[corner]] = corner
    room = len(faces) + len(place)
    more = np.empty((room, 3), np.int32)
    more[: len(faces)] = faces
    beyond = np.full(3 * room, WALL, np.int32)
    beyond[: len(twin)] = twin
    count = len(faces)
    done = np.zeros(len(place), np.bool_)
    ring = np.empty(len(place), np.int32)
    for corner in range(len(place)):
        if done[corner]:
            continue
        here = corner
        while back[here] >= 0 and back[here] != corner:
            here = back[here]
        closed = back[here] >= 0
        if closed:
            here = corner
        length = 0
        while here >= 0 and not done[here]:
            done[here] = True
            ring[length] = here
            length += 1
            here = around[here]
        if not closed:
            for k in range(length - 1):
                outside[_port(ring[k], mate, strip_of)] = OPEN
        elif length == 2:
            one, other = _port(ring[0], mate, strip_of), _port(ring[1], mate, strip_of)
            outside[one], outside[other] = _ALIAS - other, _ALIAS - one
        elif length > 2:
            count = _fan(points, vertex, place, mate, strip_of, ring[:length], outside, more,
                         beyond, count)  # fmt: skip
    for face_half in range(3 * len(faces), 3 * count):  # sides of nodes name their port
        if beyond[face_half] <= _ALIAS:
            beyond[face_half] = _within(_ALIAS - beyond[face_half], port, outside)
    for strip in range(strips):
        for end in range(2):
            if port[strip, end] >= 0:
                beyond[port[strip, end]] = _beyond(2 * strip + end, port, outside)
    cross = np.full(len(place), POINT, np.int32)
    for corner in range(len(place)):
        if mate[corner] >= 0:
            cross[corner] = _within(_port(corner, mate, strip_of), port, outside)
    return more[:count].copy(), beyond[: 3 * count].copy(), cross


@njit(cache=True)
def _port(arc: int, mate: I4, strip_of: I4) -> int:
    """Return the end of its strip at which an arc begins."""
    return 2 * strip_of[arc] + (mate[arc] < arc)


@njit(cache=True)
def _within(port_id: int, port: I4, outside: I4) -> int:
    """Half-edge that the strip shows at a port; an empty strip shows its other end's outside."""
    half = port[port_id // 2, port_id % 2]
    return half if half >= 0 else _beyond(port_id ^ 1, port, outside)


@njit(cache=True)
def _beyond(port_id: int, port: I4, outside: I4) -> int:
    """Half-edge or code that lies outside a port."""
    for _ in range(len(outside)):
        code = outside[port_id]
        if code > _ALIAS:
            return code
        port_id = _ALIAS - code
        if port[port_id // 2, port_id % 2] >= 0:
            return port[port_id // 2, port_id % 2]
        port_id ^= 1
    return POINT  # a ring of empty strips: nothing is there


@njit(cache=True)
def _fan(
    points: F8, vertex: I4, place: I4, mate: I4, strip_of: I4, ring: I4, outside: I4,
    faces: I4, twin: I4, count: int,
) -> int:  # fmt: skip
    """Triangulate the polygon of a node from the corner that makes the shortest diagonals."""
    sides = len(ring)
    best, apex = np.inf, 0
    for k in range(sides):
        total = 0.0
        for other in range(sides):
            a, b = vertex[place[ring[k]]], vertex[place[ring[other]]]
            total += np.sqrt(((points[a] - points[b]) ** 2).sum())
        if total < best:
            best, apex = total, k
    for k in range(1, sides - 1):
        # the ring runs clockwise about the hole to fill: take it backwards
        one, two = ring[(apex - k) % sides], ring[(apex - k - 1) % sides]
        faces[count, 0] = vertex[place[ring[apex]]]
        faces[count, 1], faces[count, 2] = vertex[place[one]], vertex[place[two]]
        _side(3 * count + 1, two, mate, strip_of, outside, twin)
        if k == 1:
            _side(3 * count, one, mate, strip_of, outside, twin)
        else:
            twin[3 * count], twin[3 * count - 1] = 3 * count - 1, 3 * count
        if k == sides - 2:
            _side(3 * count + 2, ring[apex], mate, strip_of, outside, twin)
        count += 1
    return count


@njit(cache=True)
def _side(half: int, arc: int, mate: I4, strip_of: I4, outside: I4, twin: I4) -> None:
    port_id = _port(arc, mate, strip_of)
    outside[port_id], twin[half] = half, _ALIAS - port_id


@njit(cache=True)
def without_points(faces: I4, twin: I4, gone: Flags) -> tuple[I4, I4]:
    """Take out triangles of which one side has shrunk to a point; their other sides meet.

    gone (M,) bool: triangles that are left out in any case; it is written to.
    """
    stack = np.empty(len(twin), np.int32)
    count = 0
    for half in range(len(twin)):
        if twin[half] == POINT:
            stack[count] = half
            count += 1
    while count:
        count -= 1
        half = stack[count]
        face, k = half // 3, half % 3
        if gone[face]:
            continue
        gone[face] = True
        one, other = twin[3 * face + (k + 1) % 3], twin[3 * face + (k + 2) % 3]
        for here, there in ((one, other), (other, one)):
            if here >= 0 and here // 3 != face:
                twin[here] = there
                if there == POINT:
                    stack[count] = here
                    count += 1
    index = np.cumsum(~gone).astype(np.int32) - 1
    out = np.empty(3 * (len(faces) - gone.sum()), np.int32)
    for half in range(len(twin)):
        if not gone[half // 3]:
            there = twin[half]
            out[3 * index[half // 3] + half % 3] = (
                3 * index[there // 3] + there % 3 if there >= 0 else there
            )
    return faces[~gone], out
