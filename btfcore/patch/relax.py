"""Local-global relaxation of a flattened patch towards isometry.

Alternates the best rotation per vertex with a Poisson solve for the coordinates, solved by a
few conjugate-gradient steps (Liu et al. 2008, "A local/global approach to mesh
parameterization", with spokes instead of triangles).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.types import F4, F8, I4


@njit(cache=True)
def relax(
    indptr: I4,
    indices: I4,
    edge: F4,
    order: I4,
    local: I4,
    plane: F8,
    rounds: int,
    steps: int,
) -> F8:
    """Return coordinates (n, 2) f8 nearer to isometry than `plane`; the centre stays put."""
    count = len(order)
    point = plane[:, 0] + 1j * plane[:, 1]
    turn = np.empty(count, np.complex128)
    wanted = np.empty(count, np.complex128)
    for _ in range(rounds):
        for here in range(count):
            vertex = order[here]
            total = 0j
            for slot in range(indptr[vertex], indptr[vertex + 1]):
                other = local[indices[slot]]
                if other >= 0:
                    vector = edge[slot, 0] - 1j * edge[slot, 1]
                    total += vector * (point[other] - point[here])
            size = abs(total)
            turn[here] = total / size if size > 1e-12 else 1.0 + 0j
        wanted[:] = 0j
        for here in range(count):
            vertex = order[here]
            for slot in range(indptr[vertex], indptr[vertex + 1]):
                other = local[indices[slot]]
                if other >= 0:
                    half = 0.5 * turn[here] * (edge[slot, 0] + 1j * edge[slot, 1])
                    wanted[other] += half
                    wanted[here] -= half
        _conjugate_gradient(indptr, indices, order, local, point, wanted, steps)
    result = np.empty((count, 2), np.float64)
    result[:, 0] = point.real - point[0].real
    result[:, 1] = point.imag - point[0].imag
    return result


@njit(cache=True)
def _laplacian(indptr, indices, order, local, point, out):  # type: ignore[no-untyped-def]
    for here in range(len(order)):
        vertex = order[here]
        total = 0j
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = local[indices[slot]]
            if other >= 0:
                total += point[here] - point[other]
        out[here] = total


@njit(cache=True)
def _conjugate_gradient(indptr, indices, order, local, point, wanted, steps):  # type: ignore[no-untyped-def]
    """Improve ``L point = wanted`` in place; consistent though L is singular."""
    count = len(order)
    product = np.empty(count, np.complex128)
    _laplacian(indptr, indices, order, local, point, product)
    residual = wanted - product
    direction = residual.copy()
    energy = 0.0
    for here in range(count):
        energy += residual[here].real ** 2 + residual[here].imag ** 2
    for _ in range(steps):
        if energy < 1e-18 * count:
            break
        _laplacian(indptr, indices, order, local, direction, product)
        along = 0.0
        for here in range(count):
            along += (direction[here].conjugate() * product[here]).real
        if along <= 0.0:
            break
        stride = energy / along
        fresh = 0.0
        for here in range(count):
            point[here] += stride * direction[here]
            residual[here] -= stride * product[here]
            fresh += residual[here].real ** 2 + residual[here].imag ** 2
        ratio = fresh / energy
        energy = fresh
        for here in range(count):
            direction[here] = residual[here] + ratio * direction[here]
