"""What a dense mesh keeps of its input, counted from its arrays alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.dense.check import Counts, dense_counts, input_counts
from btfcore.dense.cut import label_parts
from btfcore.mesh.topology import statistics, twins
from btfcore.types import DenseMesh, Mesh, MeshStatistics


@dataclass(frozen=True)
class DenseDiagnostics:
    """How faithful a dense mesh is.

    statistics : counts of the dense mesh; components : of the input; absent : components
    without any dense face; altered : components whose Euler number or boundary loops differ;
    unused : vertices without a face; bad_vertices : where it is no manifold; folded :
    triangles that look against the surface's normals at their corners; notes : sentences fit
    for a user, empty where all is well.
    """

    statistics: MeshStatistics
    components: int
    absent: int
    altered: int
    unused: int
    bad_vertices: int
    folded: int
    notes: tuple[str, ...]


def dense_diagnostics(dense: DenseMesh, mesh: Mesh) -> DenseDiagnostics:
    """Compare a dense mesh with the (manifold) input mesh it was sampled from."""
    twin = twins(mesh.faces)
    component, count = label_parts(twin)
    target = input_counts(mesh.faces, twin, component, len(mesh.vertices))
    everywhere = np.ones(len(dense.vertices), bool)
    reached, wrong = dense_counts(dense.faces, everywhere, component[dense.face], count)
    absent = reached.faces == 0
    altered = ~absent & ((reached.euler != target.euler) | (reached.loops != target.loops))
    unused = len(dense.vertices) - len(np.unique(dense.faces))
    corner = dense.vertices[dense.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    against = (normal * dense.normals[dense.faces].sum(axis=1)).sum(axis=1) < 0
    return DenseDiagnostics(
        statistics(dense.vertices, dense.faces),
        count,
        int(absent.sum()),
        int(altered.sum()),
        unused,
        int(wrong.sum()),
        int(against.sum()),
        tuple(_notes(dense.size, target, reached, absent, altered)),
    )


def _notes(
    size: int, target: Counts, reached: Counts, absent: np.ndarray, altered: np.ndarray
) -> list[str]:
    notes = []
    if absent.any():
        notes.append(
            f"{int(absent.sum())} of {len(absent)} parts of the mesh are too small for a rate of"
            f" {size} and stay without texture: raise the rate"
        )
    opened = altered & (target.loops == 0) & (reached.loops > 0)
    if opened.any():
        notes.append(
            f"{int(opened.sum())} closed parts are open at a rate of {size}: raise the rate"
        )
    if (altered & ~opened).any():
        notes.append(
            f"holes or handles of {int((altered & ~opened).sum())} parts are too small for a rate"
            f" of {size}: raise the rate"
        )
    return notes
