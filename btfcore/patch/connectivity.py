"""Vertex adjacency of a dense mesh and the discrete connection along its edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from btfcore.progress import Progress, between, blocks, silent
from btfcore.types import F4, I4, I8, DenseMesh, Field, Frozen

_MANY = 1 << 18  # vertices or faces handled between two calls of progress
_LABEL = "joining neighbours"


@dataclass(frozen=True, eq=False)
class Connectivity(Frozen):
    """Neighbours of every vertex in compressed rows, with geometry per directed edge i→j.

    indptr (N+1,) i4, indices (M,) i4 sorted within a row; face_ptr (N+1,) and face_of (3G,)
    i4: faces at every vertex. edge (M, 2) f4: the vector to j in i's frame (s = field
    tangent, t = n × s), in dense-mesh steps, its length being the 3-D length; turn (M, 2) f4:
    (cos, sin) of the angle that takes directions of j's frame into i's frame by parallel
    transport. area (G,) f4: face areas in square steps.
    """

    indptr: I4
    indices: I4
    face_ptr: I4
    face_of: I4
    faces: I4
    edge: F4
    turn: F4
    area: F4


def connect(dense: DenseMesh, field: Field, *, progress: Progress = silent) -> Connectivity:
    """Adjacency and connection of `dense`, frames taken from `field`."""
    faces = np.ascontiguousarray(dense.faces, np.int32)
    indptr, indices = adjacency(faces, len(dense.vertices), progress=between(progress, 0.0, 0.3))
    progress(0.3, _LABEL)
    face_ptr, face_of = faces_at_vertices(faces, len(dense.vertices))
    progress(0.35, _LABEL)
    points = dense.vertices - dense.vertices.mean(axis=0)
    area = _areas(points, faces)
    # two triangles make a square step; vertices would count a border's half squares whole
    step = float(np.sqrt(2 * area.sum() / max(len(faces), 1))) or 1.0  # single texels: no area
    progress(0.4, _LABEL)
    points /= step
    edge = np.empty((len(indices), 2), np.float32)
    turn = np.empty((len(indices), 2), np.float32)
    for begin, end in blocks(len(points), _MANY // 2, progress, _LABEL, 0.45, 1.0):
        _connection(indptr, indices, points, dense.normals, field.tangents, begin, end, edge, turn)
    area = (area / step**2).astype(np.float32)
    return Connectivity(indptr, indices, face_ptr, face_of, faces, edge, turn, area)


def adjacency(faces: I4, count: int, *, progress: Progress = silent) -> tuple[I4, I4]:
    """Sorted neighbours of each of `count` vertices as (indptr, indices), by counting sort."""
    start = np.zeros(count + 1, np.int64)
    for begin, end in blocks(len(faces), 4 * _MANY, progress, _LABEL, 0.0, 0.1):
        _count_ends(faces[begin:end], start)
    np.cumsum(start, out=start)
    fill, loose = start[:-1].copy(), np.empty(start[count], np.int32)
    for begin, end in blocks(len(faces), 2 * _MANY, progress, _LABEL, 0.1, 0.5):
        _list_ends(faces[begin:end], fill, loose)
    indptr = np.zeros(count + 1, np.int32)
    for begin, end in blocks(count, 2 * _MANY, progress, _LABEL, 0.5, 0.9):
        _sort_rows(start, begin, end, loose, indptr)
    np.cumsum(indptr, out=indptr)
    indices = np.empty(indptr[count], np.int32)
    for begin, end in blocks(count, 4 * _MANY, progress, _LABEL, 0.9, 1.0):
        _copy_rows(start, begin, end, loose, indptr, indices)
    return indptr, indices


@njit(cache=True)
def _count_ends(faces: I4, start: I8) -> None:
    """Count two neighbours of each corner, one place later in `start`."""
    for face in range(len(faces)):
        for corner in range(3):
            start[faces[face, corner] + 1] += 2


@njit(cache=True)
def _list_ends(faces: I4, fill: I8, loose: I4) -> None:
    """Write both neighbours of each corner into its vertex's row."""
    for face in range(len(faces)):
        for corner in range(3):
            vertex = faces[face, corner]
            for other in (faces[face, (corner + 1) % 3], faces[face, (corner + 2) % 3]):
                loose[fill[vertex]] = other
                fill[vertex] += 1


@njit(cache=True)
def _sort_rows(start: I8, begin: int, end: int, loose: I4, indptr: I4) -> None:
    """Sort the rows of `loose`; the number of distinct entries goes one place later."""
    for vertex in range(begin, end):
        low, high = start[vertex], start[vertex + 1]
        for index in range(low + 1, high):  # insertion sort: rows are short
            value = loose[index]
            place = index
            while place > low and loose[place - 1] > value:
                loose[place] = loose[place - 1]
                place -= 1
            loose[place] = value
        distinct = 0
        for index in range(low, high):
            if index == low or loose[index] != loose[index - 1]:
                distinct += 1
        indptr[vertex + 1] = distinct


@njit(cache=True)
def _copy_rows(start: I8, begin: int, end: int, loose: I4, indptr: I4, indices: I4) -> None:
    """Copy the distinct entries of sorted rows."""
    for vertex in range(begin, end):
        slot = indptr[vertex]
        for index in range(start[vertex], start[vertex + 1]):
            if index == start[vertex] or loose[index] != loose[index - 1]:
                indices[slot] = loose[index]
                slot += 1


@njit(cache=True)
def faces_at_vertices(faces: I4, count: int) -> tuple[I4, I4]:
    """Faces at each of `count` vertices as (face_ptr, face_of), ascending within a row."""
    pointer = np.zeros(count + 1, np.int32)
    for face in range(len(faces)):
        for corner in range(3):
            pointer[faces[face, corner] + 1] += 1
    for vertex in range(count):
        pointer[vertex + 1] += pointer[vertex]
    fill = pointer[:-1].copy()
    face_of = np.empty(pointer[count], np.int32)
    for face in range(len(faces)):
        for corner in range(3):
            vertex = faces[face, corner]
            face_of[fill[vertex]] = face
            fill[vertex] += 1
    return pointer, face_of


def turning_rate(
    indptr: I4, indices: I4, edge: F4, turn: F4, rounds: int, *, progress: Progress = silent
) -> F4:
    """How fast the field turns at every vertex, radians per step, mean of the edges' rates.

    `rounds` of averaging over neighbours spread it to about √rounds levels; an edge counts no
    more than 0.3, lest a singularity drown its neighbourhood.
    """
    count, label = len(indptr) - 1, "how fast the field turns"
    rate = np.zeros(count, np.float32)
    for begin, end in blocks(count, 2 * _MANY, progress, label, 0.0, 0.5):
        _own_rate(indptr, edge, turn, begin, end, rate)
    for number in range(rounds):
        old = rate.copy()
        share = 0.5 + 0.5 * number / rounds
        for begin, end in blocks(count, 8 * _MANY, progress, label, share, share):
            _mean_rate(indptr, indices, old, begin, end, rate)
    return rate


@njit(cache=True)
def _own_rate(indptr: I4, edge: F4, turn: F4, begin: int, end: int, rate: F4) -> None:
    for vertex in range(begin, end):
        total = 0.0
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            length = np.sqrt(edge[slot, 0] ** 2 + edge[slot, 1] ** 2)
            angle = abs(np.arctan2(turn[slot, 1], turn[slot, 0]))
            total += min(angle / max(length, 1e-3), 0.3)
        rate[vertex] = total / max(indptr[vertex + 1] - indptr[vertex], 1)


@njit(cache=True)
def _mean_rate(indptr: I4, indices: I4, old: F4, begin: int, end: int, rate: F4) -> None:
    for vertex in range(begin, end):
        total = old[vertex]
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            total += old[indices[slot]]
        rate[vertex] = total / (indptr[vertex + 1] - indptr[vertex] + 1)


@njit(cache=True)
def _areas(points, faces):  # type: ignore[no-untyped-def]
    """Areas (G,) f8 of the faces."""
    area = np.empty(len(faces), np.float64)
    for face in range(len(faces)):
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        x0, y0 = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
        z0, z1 = points[b, 2] - points[a, 2], points[c, 2] - points[a, 2]
        x1, y1 = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1]
        x, y, z = y0 * z1 - z0 * y1, z0 * x1 - x0 * z1, x0 * y1 - y0 * x1
        area[face] = 0.5 * np.sqrt(x * x + y * y + z * z)
    return area


@njit(cache=True)
def _in_frame(x, y, z, tangent, normal, length):  # type: ignore[no-untyped-def]
    """(x, y, z) in the frame (tangent, normal × tangent), stretched back to `length`."""
    bx = normal[1] * tangent[2] - normal[2] * tangent[1]
    by = normal[2] * tangent[0] - normal[0] * tangent[2]
    bz = normal[0] * tangent[1] - normal[1] * tangent[0]
    s = x * tangent[0] + y * tangent[1] + z * tangent[2]
    t = x * bx + y * by + z * bz
    short = np.sqrt(s * s + t * t)
    if short > 1e-6 * length:
        return s * length / short, t * length / short
    return s, t


@njit(cache=True)
def _transport(from_tangent, from_normal, tangent, normal):  # type: ignore[no-untyped-def]
    """(cos, sin) of the angle, in the frame at `normal`, of `from_tangent` carried there."""
    along = (
        from_normal[0] * normal[0] + from_normal[1] * normal[1] + from_normal[2] * normal[2]
    ) + 1.0
    if along < 1e-6:  # opposite normals: no shortest rotation exists
        return 1.0, 0.0
    tilt = (
        from_tangent[0] * normal[0] + from_tangent[1] * normal[1] + from_tangent[2] * normal[2]
    ) / along
    x = from_tangent[0] - tilt * (from_normal[0] + normal[0])
    y = from_tangent[1] - tilt * (from_normal[1] + normal[1])
    z = from_tangent[2] - tilt * (from_normal[2] + normal[2])
    cos, sin = _in_frame(x, y, z, tangent, normal, 1.0)
    return cos, sin


@njit(cache=True)
def _connection(  # type: ignore[no-untyped-def]
    indptr, indices, points, normals, tangents, begin, end, edge, turn
):
    for i in range(begin, end):
        for slot in range(indptr[i], indptr[i + 1]):
            j = indices[slot]
            x = points[j, 0] - points[i, 0]
            y = points[j, 1] - points[i, 1]
            z = points[j, 2] - points[i, 2]
            length = np.sqrt(x * x + y * y + z * z)
            s0, t0 = _in_frame(x, y, z, tangents[i], normals[i], length)
            s1, t1 = _in_frame(x, y, z, tangents[j], normals[j], length)
            cos, sin = _transport(tangents[j], normals[j], tangents[i], normals[i])
            # the mean of both ends' views of the edge makes the map exact on developables
            s = s0 + cos * s1 - sin * t1
            t = t0 + sin * s1 + cos * t1
            both = np.sqrt(s * s + t * t)
            if both > 1e-6 * length:
                s, t = s * length / both, t * length / both
            else:
                s, t = s0, t0
            edge[slot, 0], edge[slot, 1] = s, t
            turn[slot, 0], turn[slot, 1] = cos, sin
