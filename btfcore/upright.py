"""The smoothest direction field of a surface, turned upright as far as that is cheap.

Knöppel et al. 2013 (Globally Optimal Direction Fields, for directions of one fold) give the
start; it is then pulled, under unit length, towards the direction in which the picture
stands upright (Zhou §III-B leaves the field to the user; this one serves who draws none).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, diags_array

from btfcore.clusters import Clusters
from btfcore.connection import C16, frames, transports
from btfcore.hermitian import HermitianSolver, dissected
from btfcore.types import F8

PULLS = (0.0, 3.0, 10.0)  # weights of uprightness against smoothness, tried in turn
COMPLIANCE = 12.0  # pull + inertia; one factorisation serves every pull
DEARER, SPARE = 2.5, 4.0  # a pull may raise the smoothness energy by this factor and sum
LEAST_UPRIGHT = 0.5  # mean cosine to upright below which straight is better than half turned
SHIFT = 1e-3  # keeps the smoothest field's system regular where a parallel field exists
AWAY_SHARE = 0.1  # how much "away from the viewer" counts where "up" says nothing
SKEW = np.array([0.48, 0.6, 0.64])  # no mesh is symmetric about this direction


def upright_tangents(clusters: Clusters, *, up: F8, away: F8) -> F8:
    """Solve every component by itself; unit tangents (C, 3) f8, one per cluster.

    up, away : (3,) f8, unit and orthogonal. A picture stands upright where t = n × s is the
    projection of `up`; where that vanishes, as on floors, `away` decides.
    """
    s, t = frames(clusters.normals)
    energy, mass = _energy(clusters)
    floor = AWAY_SHARE * (clusters.normals @ up) ** 2
    wish = np.cross(up, clusters.normals) + floor[:, None] * np.cross(away, clusters.normals)
    skew = np.stack([np.cross(up, away), up, away], axis=1) @ SKEW
    target = _coordinates(wish, s, t)
    start = target + 0.3 * _coordinates(skew, s, t)
    order = dissected(clusters.points, clusters.edges)
    rest = HermitianSolver(csc_array(energy + diags_array(SHIFT * mass)), order)
    smooth = _smoothest(rest, mass, clusters, start)
    drive = HermitianSolver(csc_array(energy + diags_array(COMPLIANCE * mass)), order)
    smooth = _turned(smooth, target, mass, clusters)
    direction = _pulled(energy, drive, mass, clusters, smooth, target)
    return s * direction.real[:, None] + t * direction.imag[:, None]


def _coordinates(vectors: F8, s: F8, t: F8) -> C16:
    """Tangential parts as complex numbers."""
    return (vectors * s).sum(axis=1) + 1j * (vectors * t).sum(axis=1)


def _unit(values: C16) -> C16:
    """Divide each by its length; 1 where that is nothing."""
    length = np.abs(values)
    # the smoothest field fades by orders of magnitude along ears and tails: it still points
    return np.where(length > 1e-250, values / np.maximum(length, 1e-250), 1.0)


def _energy(clusters: Clusters) -> tuple[csc_array, F8]:
    """Make the cluster graph's connection Laplacian, Hermitian (C, C), and its lumped mass.

    Masses of a component sum to 4π, so that every eigenvalue is that of the component scaled
    to the area of the unit sphere.
    """
    count = len(clusters.area)
    tail, head = clusters.edges.T
    turn = transports(clusters.normals, clusters.edges)
    weight = np.where(turn != 0, clusters.weight, 0.0)
    values = np.concatenate([weight, weight, -weight * turn, -weight * turn.conj()])
    rows, columns = np.concatenate([tail, head, head, tail]), np.concatenate([tail, head] * 2)
    laplacian = csc_array(coo_array((values, (rows, columns)), shape=(count, count)))
    whole = np.bincount(clusters.component, clusters.area)
    return laplacian, 4 * np.pi * clusters.area / whole[clusters.component]


def _sums(values: NDArray, clusters: Clusters) -> NDArray:
    """Sum over the components, (components,), real or complex."""
    real = np.bincount(clusters.component, values.real)
    if np.iscomplexobj(values):
        return real + 1j * np.bincount(clusters.component, values.imag)
    return real


def _smoothest(solver: HermitianSolver, mass: F8, clusters: Clusters, start: C16) -> C16:
    """Inverse iteration towards the smallest eigenvector of every component at once."""
    field = start
    for _ in range(15):
        field = solver.solve(mass * field)
        norm = np.sqrt(_sums(mass * np.abs(field) ** 2, clusters))
        field = field / np.maximum(norm, 1e-300)[clusters.component]
    return field


def _turned(field: C16, target: C16, mass: F8, clusters: Clusters) -> C16:
    """Turn each component by the one angle that brings it closest to the target."""
    best = _unit(_sums(mass * target * field.conj(), clusters))
    return field * best[clusters.component]


def _pulled(
    energy: csc_array,
    solver: HermitianSolver,
    mass: F8,
    clusters: Clusters,
    field: C16,
    target: C16,
) -> C16:
    """Pull each component as strongly as leaves it smooth enough; unit directions.

    Every step minimises smoothness + pull ∫|u - target|² + inertia ∫|u - u_before|² and scales
    to unit length; a singularity moves or vanishes with its partner, but is not made lightly.
    """
    field = _unit(field)
    for pull in PULLS:
        for _ in range(10):
            aim = pull * target + (COMPLIANCE - pull) * field
            field = _unit(solver.solve(mass * aim))
        if pull == 0.0:
            field = _unit(_turned(field, target, mass, clusters))
        cost = _sums(np.real(field.conj() * np.asarray(energy @ field)), clusters)
        if pull == 0.0:
            calmest, kept = cost, field
            continue
        upright = _sums(mass * (target.conj() * field).real, clusters)
        most = _sums(mass * np.abs(target), clusters)
        good = (cost <= DEARER * calmest + SPARE) & (upright >= LEAST_UPRIGHT * most)
        kept = np.where(good[clusters.component], field, kept)
    return kept
