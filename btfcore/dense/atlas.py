"""The atlas of a mesh: charts, flattened to true size and packed (Zhou §III-A)."""

from __future__ import annotations

from btfcore.dense.charts import Charts, true_to_size
from btfcore.dense.pack import pack
from btfcore.guard import run_guarded
from btfcore.progress import Progress, between, silent
from btfcore.types import Atlas, Mesh


def build_atlas(
    mesh: Mesh, *, rate: int, limit_s: float = 60.0, progress: Progress = silent
) -> Atlas:
    """Atlas of `mesh` itself in a rate x rate image; deterministic.

    mesh : manifold, perhaps with boundary and of many components, coherently wound. `limit_s`
    bounds the time of the helper process that runs foreign code. See `chart_mesh` and `pack`;
    to pack the same charts at another rate, call these two. Raises `AtlasFailed` where the
    image has too few texels.
    """
    charts = chart_mesh(mesh, limit_s=limit_s, progress=between(progress, 0.0, 0.8))
    progress(0.8, "packing charts")
    atlas = pack(charts, rate=rate)
    progress(1.0, "packed charts")
    return atlas


def chart_mesh(mesh: Mesh, *, limit_s: float = 60.0, progress: Progress = silent) -> Charts:
    """Cut `mesh` into charts and flatten each to true size, whatever the sampling rate."""
    arrays, _ = run_guarded(
        "btfcore.dense.xatlas_door:chart_mesh",
        {"vertices": mesh.vertices, "faces": mesh.faces},
        {"max_cost": 8.0},
        limit_s=limit_s,
        progress=progress,
        label="cutting the surface into charts",
    )
    return Charts(mesh, true_to_size(mesh, arrays["uv"], arrays["chart"]), arrays["chart"])
