"""Carries charts from a coarse proxy over to the mesh that it stands for."""

from __future__ import annotations

import numpy as np

from btfcore.dense.charts import Charts, surface_areas
from btfcore.dense.labels import absorb, fill, smooth
from btfcore.dense.unwrap import Flags
from btfcore.mesh.topology import twins
from btfcore.progress import Progress, silent
from btfcore.types import F8, I4, Mesh

_LABEL = "carrying charts over"
_FACING = 0.3  # least cosine between a face's normal and its proxy face's
_LEAST = 1e-3  # of the surface: smaller pieces join a neighbour


def transfer(
    proxy: Charts, mesh: Mesh, nearest: I4, *, progress: Progress = silent
) -> tuple[I4, F8, Flags]:
    """Chart and rough layout for every face of `mesh` from its nearest proxy face.

    nearest (F,) i4. Returns chart (F,) i4 in connected pieces, uv (F, 3, 2) f8, and whether
    the uv of a face are worth starting from: they are not where its nearest proxy face looks
    elsewhere or belongs to another chart than the piece that absorbed it.
    """
    frame, normal = _frames(proxy.mesh)
    corner = mesh.vertices[mesh.faces]
    own = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(own, axis=1)
    facing = (own * normal[nearest]).sum(axis=1) >= _FACING * length
    origin = np.where(facing, proxy.chart[nearest], -1).astype(np.int32)
    progress(0.2, _LABEL)
    twin = twins(mesh.faces)
    area = surface_areas(mesh)
    edges = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).ravel()
    progress(0.4, _LABEL)
    chart = smooth(fill(origin, twin), twin)
    progress(0.6, _LABEL)
    chart = absorb(chart, twin, area, edges, least=_LEAST * float(area.sum()))
    progress(0.8, _LABEL)
    main = _heaviest(chart, origin, area)
    uv = _laid_out(proxy, frame, corner, nearest)
    return chart, uv, (origin >= 0) & (origin == main[chart])


def _frames(mesh: Mesh) -> tuple[F8, F8]:
    """Tangent along edge 0 and across (F, 2, 3), and unit normals (F, 3)."""
    corner = mesh.vertices[mesh.faces]
    one, two = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    tiny = np.finfo(float).tiny
    along = one / np.maximum(np.linalg.norm(one, axis=1), tiny)[:, None]
    normal = np.cross(one, two)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), tiny)[:, None]
    return np.stack([along, np.cross(normal, along)], axis=1), normal


def _heaviest(chart: I4, origin: I4, area: F8) -> I4:
    """Origin with the largest area in every chart, (C,) i4, -1 where none has one."""
    count, kinds = int(chart.max()) + 1, int(origin.max()) + 2
    key, inverse = np.unique(chart.astype(np.int64) * kinds + origin + 1, return_inverse=True)
    weight = np.bincount(inverse, area)
    weight[key % kinds == 0] = -1
    order = np.lexsort((-(key % kinds), weight, key // kinds))
    main = np.full(count, -1, np.int32)
    main[key[order] // kinds] = key[order] % kinds - 1  # the last of each chart stays
    return main


def _laid_out(proxy: Charts, frame: F8, corner: F8, nearest: I4) -> F8:
    """Corners of faces moved into the plane along with their nearest proxy faces."""
    flat = proxy.uv[:, 1] - proxy.uv[:, 0]
    size = np.maximum(np.linalg.norm(flat, axis=1), np.finfo(float).tiny)[:, None]
    right = flat / size
    up = np.stack([right[:, 1], -right[:, 0]], axis=1)  # rows go down, charts are not mirrored
    begin = proxy.mesh.vertices[proxy.mesh.faces[:, 0]]
    local = np.einsum("fkx,fax->fka", corner - begin[nearest][:, None], frame[nearest])
    return (
        proxy.uv[nearest, 0][:, None]
        + local[..., :1] * right[nearest][:, None]
        + local[..., 1:] * up[nearest][:, None]
    )
