"""Charts from face normals alone: what is used where xatlas crashes, hangs or gives up."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.dense.charts import surface_areas
from btfcore.dense.labels import absorb
from btfcore.dense.unwrap import Flags
from btfcore.mesh.topology import twins
from btfcore.types import F8, I4, I8, Mesh

_CONE = 0.6  # least cosine between a face and the mean normal of the chart it joins
_LEAST = 2e-4  # of the surface: smaller charts join a neighbour


def segment(mesh: Mesh) -> tuple[I4, F8, Flags]:
    """Grow charts of similar normals from large faces; never fails.

    Returns chart (F,) i4; uv (F, 3, 2) f8, each chart projected along its mean normal; and
    which faces are worth starting from, i.e. do not look away from that normal.
    """
    corner = mesh.vertices[mesh.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = surface_areas(mesh)
    unit = normal / np.maximum(2 * area, np.finfo(float).tiny)[:, None]
    twin = twins(mesh.faces)
    grown = _grow(unit, area, twin, np.lexsort((np.arange(len(area)), -area)))
    edges = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).ravel()
    chart = absorb(grown, twin, area, edges, least=_LEAST * float(area.sum()))
    count = int(chart.max()) + 1
    mean: F8 = np.zeros((count, 3))
    np.add.at(mean, chart, normal)
    long = np.linalg.norm(mean, axis=1) > 0
    mean[~long] = [0.0, 0.0, 1.0]
    mean /= np.linalg.norm(mean, axis=1)[:, None]
    axis = np.eye(3)[np.abs(mean).argmin(axis=1)]
    right = np.cross(axis, mean)
    right /= np.linalg.norm(right, axis=1)[:, None]
    frame = np.stack([right, -np.cross(mean, right)], axis=1)  # rows go down
    uv = np.einsum("fkx,fax->fka", corner, frame[chart])
    return chart, uv, (unit * mean[chart]).sum(axis=1) > _CONE / 2


@njit(cache=True)
def _grow(unit: F8, area: F8, twin: I4, seeds: I8) -> I4:
    label = np.full(len(area), -1, np.int32)
    queue = np.empty(len(area), np.int32)
    mean = np.zeros(3)
    count = 0
    for seed in seeds:
        if label[seed] >= 0:
            continue
        label[seed] = count
        queue[0] = seed
        head, tail = 0, 1
        mean[:] = unit[seed] * area[seed]
        while head < tail:
            f = queue[head]
            head += 1
            for k in range(3):
                other = twin[3 * f + k]
                if other < 0 or label[other // 3] >= 0:
                    continue
                g = other // 3
                size = np.sqrt((mean * mean).sum())
                if (unit[g] * mean).sum() < _CONE * size:
                    continue
                if (unit[g] * unit[seed]).sum() < _CONE:
                    continue
                label[g] = count
                mean += unit[g] * area[g]
                queue[tail] = g
                tail += 1
        count += 1
    return label
