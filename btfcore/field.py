"""The orientation field that the texture follows (Zhou §III-B, "Vector Field")."""

from __future__ import annotations

import numpy as np

from btfcore.clusters import Clusters, gather_clusters, neighbours
from btfcore.connection import face_indices
from btfcore.guide import Guide, read_guide, spanned
from btfcore.progress import Progress, between, silent
from btfcore.spread import blended, filled
from btfcore.types import F4, F8, I4, DenseMesh, Field, Mesh
from btfcore.upright import upright_tangents

__all__ = ["Guide", "orientation_field", "read_guide", "singularities"]

LEAST_PART = 0.05  # tangential part of a unit guide vector below which it says nothing


def orientation_field(
    dense: DenseMesh,
    mesh: Mesh,
    *,
    guide: Guide | None = None,
    up: tuple[float, float, float] = (0.0, 1.0, 0.0),
    away: tuple[float, float, float] = (0.0, 0.0, -1.0),
    progress: Progress = silent,
) -> Field:
    """Give every vertex of `dense` a unit tangent: where the sample's +column points.

    With a guide: its directions interpolated in space, projected and normalised; where the
    tangential part is below 0.05 the neighbours are carried on instead. Without: the smoothest
    field of every component, upright as far as that is cheap: t = n × s leans towards `up` on
    walls and towards `away` (from the viewer) on floors. The defaults are the axes of OBJ and
    glTF files; they are made orthogonal to each other.

    mesh : what `dense` was made from; its diagonal is the unit of a guide's distances.
    Raises `InvalidGuide`. Tangents are orthogonal to `dense.normals` to 1e-6.
    """
    progress(0.0, "orientation field")
    normals = _unit_normals(dense.normals)
    progress(0.0, "orientation field")
    clusters = gather_clusters(dense, normals, progress=between(progress, 0.0, 0.3))
    progress(0.3, "orientation field")
    if guide is not None:
        drawn = spanned(guide, dense.vertices, diagonal=mesh.diagonal)
        tangents = _tangential(drawn, normals)
        tangents = filled(clusters.indptr, clusters.indices, normals, tangents)
        blank = ~tangents.any(axis=1)
    else:
        tangents, blank = np.zeros_like(normals), np.ones(len(normals), bool)
    if blank.any():  # also pieces on which the guide has no tangential part at all
        axes = _axes(up, away)
        progress(0.4, "orientation field")
        solved = upright_tangents(clusters, up=axes[0], away=axes[1])
        progress(0.8, "orientation field")
        spread = _spread(clusters, dense, normals, solved, between(progress, 0.8, 0.9))
        tangents = np.where(np.reshape(blank, (-1, 1)), spread, tangents)
    progress(0.9, "orientation field")
    single = tangents.astype(np.float32)
    progress(0.92, "orientation field")
    index = face_indices(
        normals.astype(np.float32), single, dense.faces, progress=between(progress, 0.92, 1.0)
    )
    field = Field(single, _centres(dense, index))
    progress(1.0, "orientation field")
    return field


def singularities(dense: DenseMesh, tangents: F4) -> F8:
    """Centres (S, 3) f8 of the triangles around which `tangents` turn around."""
    normals = _unit_normals(dense.normals).astype(np.float32)
    return _centres(dense, face_indices(normals, tangents, dense.faces))


def _centres(dense: DenseMesh, index: I4) -> F8:
    """Middles of the faces whose index is not 0."""
    return dense.vertices[dense.faces[index != 0]].mean(axis=1)


def _axes(up: tuple[float, float, float], away: tuple[float, float, float]) -> F8:
    """Return unit `up`, and the part of `away` across it."""
    first = np.asarray(up, np.float64) / np.linalg.norm(up)
    rest = np.asarray(away, np.float64)
    second = rest - first * (first @ rest)
    return np.stack([first, second / np.linalg.norm(second)])


def _unit_normals(normals: F4) -> F8:
    """Normalise in f8; +z where a degenerate surface gave no normal."""
    out = normals.astype(np.float64)
    length = np.linalg.norm(out, axis=1)
    lost = ~(length > 1e-6)
    out[lost], length[lost] = (0.0, 0.0, 1.0), 1.0
    return out / length[:, None]


def _tangential(vectors: F8, normals: F8) -> F8:
    """Project to the tangent planes and normalise; 0 where less than `LEAST_PART` is left."""
    flat = vectors - normals * (vectors * normals).sum(axis=1)[:, None]
    length = np.linalg.norm(flat, axis=1)
    good = length > LEAST_PART
    return np.where(good[:, None], flat / np.maximum(length, 1e-12)[:, None], 0.0)


def _spread(
    clusters: Clusters, dense: DenseMesh, normals: F8, tangents: F8, progress: Progress
) -> F8:
    """Tangents of the vertices, blended from those of their own and the touching clusters."""
    indptr, indices = neighbours(clusters.edges, len(clusters.area))
    reach = np.maximum(2.0 * clusters.spacing, 1e-300)
    return blended(
        clusters.of, indptr, indices, clusters.points, clusters.normals, clusters.area, tangents,
        dense.vertices, normals, reach, progress=progress,
    )  # fmt: skip
