"""Where on one dense mesh the vertices of another lie that samples the same surface.

Neighbouring vertices lie on neighbouring triangles, so each search goes on from where the last
one ended and stays on its sheet of the surface; a k-d tree starts it anew where the next vertex
is far away, and again where a search got stuck.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from btfcore.patch.connectivity import faces_at_vertices
from btfcore.progress import Progress, blocks, silent
from btfcore.types import F4, F8, I4, DenseMesh

_LABEL = "carrying the quilt over"
_MANY = 1 << 17  # vertices between two calls of progress
_STARTS = 8  # vertices near a point that a search is started from
_FACING = 0.3  # cosine of normals below which a triangle counts as farther away
_OTHER_SIDE = 2.0  # steps that a triangle counts as farther away per cosine below that
_AT = 0.1  # steps above a triangle within which it is taken without looking further
_LEAP = 2.0  # steps between two vertices beyond which the search starts anew
_FAR = 0.35  # steps beyond which a search may be stuck


class Surface(NamedTuple):
    """Triangles of a dense mesh with what finding a place on them needs.

    vertices (N, 3) f8; faces (G, 3) i4, a vertex without any being a triangle of its own;
    facing (G, 3) f8 unit normals; face_ptr, face_of: faces at every vertex; step.
    """

    vertices: F8
    faces: I4
    facing: F8
    face_ptr: I4
    face_of: I4
    step: float


def surface(dense: DenseMesh) -> Surface:
    """Tables of `dense`."""
    count = len(dense.vertices)
    lone = np.ones(count, bool)
    lone[dense.faces.ravel()] = False
    alone = np.flatnonzero(lone)
    faces = np.concatenate([dense.faces, np.repeat(alone, 3).reshape(-1, 3)]).astype(np.int32)
    facing, area = _facing(dense.vertices, dense.normals, faces)
    step = float(np.sqrt(area / max(count, 1)))
    return Surface(dense.vertices, faces, facing, *faces_at_vertices(faces, count), step)


@njit(cache=True)
def _facing(vertices, normals, faces):  # type: ignore[no-untyped-def]
    """Unit normals (G, 3) f8 of faces, those of a vertex where they have none, and the area."""
    out, area = np.empty(faces.shape), 0.0
    for face in range(len(faces)):
        a, b, c = vertices[faces[face, 0]], vertices[faces[face, 1]], vertices[faces[face, 2]]
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        wx, wy, wz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        x, y, z = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        length = np.sqrt(x * x + y * y + z * z)
        area += length / 2
        long = ux * ux + uy * uy + uz * uz + wx * wx + wy * wy + wz * wz
        if length > 1e-9 * long:  # of slivers nothing can be said of which way they look
            out[face, 0], out[face, 1], out[face, 2] = x / length, y / length, z / length
        else:
            out[face] = normals[faces[face, 0]]
    return out, area


def locate(on: Surface, new: DenseMesh, *, progress: Progress = silent) -> tuple[I4, F4]:
    """Face (n,) i4 of `on` nearest to each vertex of `new`, and the place there.

    The place is (n, 3) f4 barycentric coordinates of the nearest point (Ericson, Real-Time
    Collision Detection, §5.1.5), all within 0–1. Triangles that look away from the vertex's
    normal count as farther away, so that the two sides of a thin wall do not mix.
    """
    count = len(new.vertices)
    face, weight = np.zeros(count, np.int32), np.zeros((count, 3), np.float32)
    tree = cKDTree(on.vertices)
    for begin, end in blocks(count, _MANY, progress, _LABEL):
        points, normals = new.vertices[begin:end], new.normals[begin:end]
        cost = np.empty(len(points))
        out = (face[begin:end], weight[begin:end], cost)
        jump = np.ones(len(points), bool)
        jump[1:] = ((points[1:] - points[:-1]) ** 2).sum(axis=1) > (_LEAP * on.step) ** 2
        jump[1:] |= np.einsum("ik,ik->i", normals[1:], normals[:-1]) < 0.5
        _search_all(on, points, normals, jump, _starts(tree, points[jump]), *out)
        some = np.flatnonzero((cost > (_FAR * on.step) ** 2) & ~jump)
        if len(some):
            _search_again(on, points, normals, some, _starts(tree, points[some]), *out)
    return face, weight


def _starts(tree: cKDTree, points: F8) -> I4:
    """Vertices (n, _STARTS) i4 near each point."""
    most = min(_STARTS, tree.n)
    _, near = tree.query(points, k=most)
    return np.asarray(near, np.int32).reshape(len(points), most)


@njit(cache=True)
def _closest(on, face, x, y, z, out):  # type: ignore[no-untyped-def]
    """Squared distance from a point to a face; `out` (3,) gets the place's coordinates."""
    a, b, c = on.faces[face, 0], on.faces[face, 1], on.faces[face, 2]
    v = on.vertices
    ux, uy, uz = v[b, 0] - v[a, 0], v[b, 1] - v[a, 1], v[b, 2] - v[a, 2]
    wx, wy, wz = v[c, 0] - v[a, 0], v[c, 1] - v[a, 1], v[c, 2] - v[a, 2]
    px, py, pz = x - v[a, 0], y - v[a, 1], z - v[a, 2]
    d1, d2 = ux * px + uy * py + uz * pz, wx * px + wy * py + wz * pz
    uu, uw, ww = (
        ux * ux + uy * uy + uz * uz,
        ux * wx + uy * wy + uz * wz,
        wx * wx + wy * wy + wz * wz,
    )
    d3, d4 = d1 - uu, d2 - uw  # the same from b, and from c
    d5, d6 = d1 - uw, d2 - ww
    vc, vb, va = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    opposite = False  # on the edge opposite to a, where 1 - s - t is 0 but for rounding
    if d1 <= 0 and d2 <= 0:
        s, t = 0.0, 0.0
    elif d3 >= 0 and d4 <= d3:
        s, t = 1.0, 0.0
    elif d6 >= 0 and d5 <= d6:
        s, t = 0.0, 1.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        s, t = d1 / (d1 - d3), 0.0
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        s, t = 0.0, d2 / (d2 - d6)
    elif va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        s, opposite = 1 - t, True
    else:
        whole = va + vb + vc
        s, t = vb / whole, vc / whole
    out[0], out[1], out[2] = (0.0 if opposite else 1 - s - t), s, t
    px, py, pz = px - s * ux - t * wx, py - s * uy - t * wy, pz - s * uz - t * wz
    return px * px + py * py + pz * pz


@njit(cache=True)
def _cost(on, face, point, normal, out):  # type: ignore[no-untyped-def]
    """Squared distance, larger where the face looks away."""
    away = _FACING
    for axis in range(3):
        away -= on.facing[face, axis] * normal[axis]
    cost = _closest(on, face, point[0], point[1], point[2], out)
    if away > 0:
        cost += (_OTHER_SIDE * away * on.step) ** 2
    return cost


@njit(cache=True)
def _descend(on, face, point, normal, best, trial):  # type: ignore[no-untyped-def]
    """Walk from `face` to the best face around; returns (face, cost), `best` its place."""
    near = (_AT * on.step) ** 2
    cost = _cost(on, face, point, normal, best)
    while not (cost < near and min(best[0], best[1], best[2]) > 0):
        before = face
        first = 0  # the corner nearest to the point most likely touches the face sought
        for corner in range(1, 3):
            if best[corner] > best[first]:
                first = corner
        for turn in range(3):
            vertex = on.faces[before, (first + turn) % 3]
            for slot in range(on.face_ptr[vertex], on.face_ptr[vertex + 1]):
                other = on.face_of[slot]
                if other == before:
                    continue
                here = _cost(on, other, point, normal, trial)
                if here < cost:
                    cost, face = here, other
                    best[:] = trial
                    if cost < near and min(best[0], best[1], best[2]) > 0:
                        return face, cost
        if face == before:
            break
    return face, cost


@njit(cache=True)
def _search(on, starts, point, normal, best, trial, place):  # type: ignore[no-untyped-def]
    """Descend from the faces at each of `starts`; (face, cost), `place` the best's."""
    face, cost = -1, np.inf
    for vertex in starts:
        first = on.face_of[on.face_ptr[vertex]]
        found, here = _descend(on, first, point, normal, best, trial)
        if here < cost:
            face, cost = found, here
            place[:] = best
    return face, cost


@njit(cache=True)
def _search_all(on, points, normals, jump, starts, face, weight, cost):  # type: ignore[no-untyped-def]
    best, trial, place = np.empty(3), np.empty(3), np.empty(3)
    row, now = 0, -1
    for index in range(len(points)):
        if jump[index]:
            now, cost[index] = _search(
                on, starts[row], points[index], normals[index], best, trial, place
            )
            row += 1
        else:
            now, cost[index] = _descend(on, now, points[index], normals[index], place, trial)
        face[index] = now
        weight[index] = place


@njit(cache=True)
def _search_again(on, points, normals, some, starts, face, weight, cost):  # type: ignore[no-untyped-def]
    best, trial, place = np.empty(3), np.empty(3), np.empty(3)
    for row, index in enumerate(some):
        found, here = _search(on, starts[row], points[index], normals[index], best, trial, place)
        if here < cost[index]:
            face[index], cost[index] = found, here
            weight[index] = place
