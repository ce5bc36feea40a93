"""Lays charts flat as rigidly as possible (local-global, Liu et al. 2008), all at once.

The plane is that of complex numbers, seen from outside, +y up. Each face has a shape: its
edges laid into the plane with the first one along +x. A chart vertex is a fan of corners
within one chart, so that a chart may touch itself without being glued there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import coo_array

from btfcore.mesh.topology import fans
from btfcore.types import F8, I4, I8, Mesh

C16 = NDArray[np.complex128]
Flags = NDArray[np.bool_]
_EXACT = 1e-12  # square of the residual at which the solver stops, of the force
_THIN = 1e-3  # least height of a face over its longest edge, as far as weights go


@dataclass(frozen=True)
class Net:
    """Faces joined within charts.

    twin (3F,) i4, -1 also between charts; corner (F, 3) i4: chart vertex of
    every corner, 0 … count-1; shape (F, 3) c16: edge k from corner k to corner k + 1, laid
    flat; weight (F, 3) f8: half the cotangent opposite edge k.
    """

    twin: I4
    corner: I4
    count: int
    shape: C16
    weight: F8


def face_shapes(mesh: Mesh) -> tuple[C16, F8]:
    """Edges of every face laid flat (F, 3) c16, and their cotangent weights (F, 3) f8."""
    point = mesh.vertices[mesh.faces]
    one, two = point[:, 1] - point[:, 0], point[:, 2] - point[:, 0]
    length = np.linalg.norm(one, axis=1)
    safe = np.maximum(length, np.finfo(float).tiny)
    height = np.linalg.norm(np.cross(one, two), axis=1) / safe
    tip = (one * two).sum(axis=1) / safe + 1j * height
    shape = np.stack([length + 0j, tip - length, -tip], axis=1)
    longest = np.abs(shape).max(axis=1) ** 2
    twice = np.maximum(length * height, np.maximum(_THIN * longest, np.finfo(float).tiny))
    inner = np.stack([shape[:, 1] * shape[:, 2].conj(), shape[:, 2] * shape[:, 0].conj(),
                      shape[:, 0] * shape[:, 1].conj()], axis=1)  # fmt: skip
    return shape, -inner.real / twice[:, None] / 2


def net(chart: I4, twin: I4, shape: C16, weight: F8, subset: I8 | None = None) -> Net:
    """Join faces that share an edge and a chart.

    twin : (3F,) i4 of the whole mesh. subset : faces to take, whole charts; default all.
    """
    if subset is None:
        subset = np.arange(len(chart))
    local = np.full(len(chart), -1, np.int32)
    local[subset] = np.arange(len(subset))
    other = twin.reshape(-1, 3)[subset]
    inside = (other >= 0) & (chart[np.maximum(other, 0) // 3] == chart[subset][:, None])
    joined = np.where(inside, 3 * local[other // 3] + other % 3, -1).astype(np.int32).ravel()
    corner, count = fans(joined)
    return Net(joined, corner.reshape(-1, 3), count, shape[subset], weight[subset])


def mean_positions(some: Net, place: C16, use: Flags) -> tuple[C16, Flags]:
    """Chart vertices at the mean of their corners' places (F, 3) c16 over the faces `use`.

    Returns positions (N,) c16 and which vertices have one.
    """
    chosen = some.corner[use].ravel()
    where = place[use].ravel()
    number = np.bincount(chosen, minlength=some.count)
    position = np.zeros(some.count, np.complex128)
    position.real = np.bincount(chosen, where.real, some.count)
    position.imag = np.bincount(chosen, where.imag, some.count)
    return position / np.maximum(number, 1), number > 0


def unfold(some: Net, position: C16, known: Flags) -> None:
    """Give every vertex a position, in place: hinge faces onto what lies flat already.

    A chart without two neighbouring known vertices starts with its first face.
    """
    _unfold(some.corner, some.twin, some.shape, position, known)


def relax(some: Net, position: C16, *, rounds: int = 6, steps: int = 40) -> C16:
    """Positions that keep faces as rigid as possible, from a start (N,) c16.

    Each of `rounds` turns every face's shape to fit, then solves for the positions by at
    most `steps` conjugate gradients.
    """
    first, second = some.corner, np.roll(some.corner, -1, axis=1)
    i, j, w = first.ravel(), second.ravel(), some.weight.ravel()
    matrix = coo_array(
        (np.concatenate([-w, -w, w, w]),
         (np.concatenate([i, j, i, j]), np.concatenate([j, i, i, j]))),
        shape=(some.count, some.count),
    ).tocsr()  # fmt: skip
    matrix.sort_indices()
    inverse = 1 / np.maximum(matrix.diagonal(), np.finfo(float).tiny)
    position = position.copy()
    place = position.view(np.float64).reshape(-1, 2)
    force = np.empty_like(position)
    for _ in range(rounds):
        _forces(some.corner, some.shape, some.weight, position, force)
        _solve(matrix.indptr, matrix.indices, matrix.data, inverse,
               force.view(np.float64).reshape(-1, 2), place, steps)  # fmt: skip
    return position


@njit(cache=True)
def _unfold(corner: I4, twin: I4, shape: C16, position: C16, known: Flags) -> None:
    faces = len(corner)
    done = np.zeros(faces, np.bool_)
    queue = np.empty(faces, np.int32)
    tail = 0
    for f in range(faces):
        if known[corner[f, 0]] and known[corner[f, 1]] and known[corner[f, 2]]:
            done[f] = True
            queue[tail] = f
            tail += 1
    head = 0
    for begin in range(faces + 1):
        while head < tail:
            f = queue[head]
            head += 1
            for k in range(3):
                other = twin[3 * f + k]
                if other < 0 or done[other // 3]:
                    continue
                g, m = other // 3, other % 3
                done[g] = True
                queue[tail] = g
                tail += 1
                a, b, c = corner[g, m], corner[g, (m + 1) % 3], corner[g, (m + 2) % 3]
                if not known[c]:
                    edge = position[b] - position[a]
                    ratio = shape[g, (m + 2) % 3] / shape[g, m] if abs(shape[g, m]) > 0 else 0j
                    if abs(edge) == 0:
                        edge, ratio = 1.0 + 0j, shape[g, (m + 2) % 3]
                    size = abs(shape[g, m]) / abs(edge) if abs(shape[g, m]) > 0 else 1.0
                    position[c] = position[a] - edge * size * ratio
                    known[c] = True
        if begin < faces and not done[begin]:
            at = 0j
            for k in range(3):
                if not known[corner[begin, k]]:
                    position[corner[begin, k]] = at
                    known[corner[begin, k]] = True
                at += shape[begin, k]
            done[begin] = True
            queue[tail] = begin
            tail += 1


@njit(cache=True)
def _forces(corner: I4, shape: C16, weight: F8, position: C16, force: C16) -> None:
    """Local step and right-hand side: the best turn of each face, applied to its edges."""
    force[:] = 0
    for f in range(len(corner)):
        fit = 0j
        for k in range(3):
            edge = position[corner[f, (k + 1) % 3]] - position[corner[f, k]]
            fit += weight[f, k] * edge * np.conj(shape[f, k])
        size = abs(fit)
        if size == 0:
            continue
        turn = fit / size
        for k in range(3):
            pull = weight[f, k] * turn * shape[f, k]
            force[corner[f, (k + 1) % 3]] += pull
            force[corner[f, k]] -= pull


@njit(cache=True)
def _solve(
    indptr: I4, indices: I4, data: F8, inverse: F8, force: F8, place: F8, steps: int
) -> None:
    """Jacobi-preconditioned conjugate gradients for both coordinates at once, (N, 2) f8."""
    count = len(place)
    residual = np.empty_like(place)
    direction = np.empty_like(place)
    product = np.empty_like(place)
    now, goal = 0.0, 0.0
    for i in range(count):
        x, y = force[i, 0], force[i, 1]
        goal += (x * x + y * y) * inverse[i]
        for at in range(indptr[i], indptr[i + 1]):
            x -= data[at] * place[indices[at], 0]
            y -= data[at] * place[indices[at], 1]
        residual[i, 0], residual[i, 1] = x, y
        direction[i, 0], direction[i, 1] = x * inverse[i], y * inverse[i]
        now += (x * x + y * y) * inverse[i]
    goal *= _EXACT
    for _ in range(steps):
        if now <= goal:
            return
        curvature = 0.0
        for i in range(count):
            x, y = 0.0, 0.0
            for at in range(indptr[i], indptr[i + 1]):
                x += data[at] * direction[indices[at], 0]
                y += data[at] * direction[indices[at], 1]
            product[i, 0], product[i, 1] = x, y
            curvature += x * direction[i, 0] + y * direction[i, 1]
        if curvature <= 0:
            return
        step = now / curvature
        before, now = now, 0.0
        for i in range(count):
            place[i, 0] += step * direction[i, 0]
            place[i, 1] += step * direction[i, 1]
            x = residual[i, 0] - step * product[i, 0]
            y = residual[i, 1] - step * product[i, 1]
            residual[i, 0], residual[i, 1] = x, y
            now += (x * x + y * y) * inverse[i]
        onward = now / before
        for i in range(count):
            direction[i, 0] = residual[i, 0] * inverse[i] + onward * direction[i, 0]
            direction[i, 1] = residual[i, 1] * inverse[i] + onward * direction[i, 1]
