"""The atlas of a mesh: charts, flattened to true size and packed (Zhou §III-A)."""

from __future__ import annotations

import numpy as np

from btfcore.dense.charts import Charts, true_to_size
from btfcore.dense.flatten import flatten_charts
from btfcore.dense.labels import fill
from btfcore.dense.pack import pack
from btfcore.dense.segment import segment
from btfcore.dense.transfer import transfer
from btfcore.errors import AtlasFailed, GuardedFailure
from btfcore.guard import Arrays, Options, run_guarded
from btfcore.mesh.topology import components, twins
from btfcore.progress import Progress, between, silent
from btfcore.types import Atlas, Mesh

_DIRECT = 8000  # faces of a component up to which xatlas gets it as it is: super-linear time
_PROXY = 5000  # faces of the proxy that it is given instead of larger meshes
_COST = 8.0  # bound on a chart's cost in xatlas
_LABEL = "cutting the surface into charts"


def build_atlas(
    mesh: Mesh, *, rate: int, limit_s: float = 40.0, progress: Progress = silent
) -> Atlas:
    """Atlas of `mesh` itself in a rate x rate image; deterministic.

    mesh : manifold, perhaps with boundary and of many components, coherently wound. `limit_s`
    bounds the time of the helper process that runs foreign code. See `chart_mesh` and `pack`;
    to pack the same charts at another rate, call these two. Raises `AtlasFailed` where the
    image has fewer texels than the mesh has charts.
    """
    charts = chart_mesh(mesh, limit_s=limit_s, progress=between(progress, 0.0, 0.85))
    progress(0.85, "packing charts")
    atlas = pack(charts, rate=rate, progress=between(progress, 0.85, 1.0))
    progress(1.0, "packing charts")
    return atlas


def chart_mesh(mesh: Mesh, *, limit_s: float = 40.0, progress: Progress = silent) -> Charts:
    """Cut `mesh` into charts and flatten each to true size, whatever the sampling rate.

    Small meshes go to xatlas as they are, larger ones as a decimated proxy whose charts are
    carried over. Where the helper process crashes, hangs or fails, charts are grown from face
    normals instead.
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    size = max(float((high - low).max()), np.finfo(float).tiny)
    unit = Mesh((mesh.vertices - low) / size - (high - low) / (2 * size), mesh.faces)
    charts = _chart_unit(unit, limit_s, progress)
    return Charts(mesh, charts.uv * size, charts.chart)


def _chart_unit(mesh: Mesh, limit_s: float, progress: Progress) -> Charts:
    """Chart a mesh whose longest side is 1, centred at the origin."""
    foreign = between(progress, 0.0, 0.7)
    try:
        if np.bincount(components(mesh.faces)).max() <= _DIRECT:
            task = "btfcore.dense.xatlas_door:chart_mesh"
            found = _run(task, mesh, limit_s, foreign)
            return _flattened(mesh, found, between(progress, 0.7, 1.0))
        task = "btfcore.dense.xatlas_door:chart_proxy"
        found = _run(task, mesh, limit_s, foreign)
        few = Mesh(found["vertices"], found["faces"])
        proxy = _flattened(few, found, between(progress, 0.7, 0.8))
        chart, uv, usable = transfer(
            proxy, mesh, found["nearest"], progress=between(progress, 0.8, 0.85)
        )
    except (GuardedFailure, AtlasFailed):
        progress(0.7, _LABEL)
        chart, uv, usable = segment(mesh)
        return flatten_charts(mesh, chart, uv, usable=usable, progress=between(progress, 0.7, 1.0))
    return flatten_charts(mesh, chart, uv, usable=usable, progress=between(progress, 0.85, 1.0))


def _run(task: str, mesh: Mesh, limit_s: float, progress: Progress) -> Arrays:
    arrays: Arrays = {"vertices": mesh.vertices, "faces": mesh.faces}
    options: Options = {"max_cost": _COST, "faces": _PROXY}
    found, _ = run_guarded(task, arrays, options, limit_s=limit_s, progress=progress, label=_LABEL)
    if not np.isfinite(found["uv"]).all() or found["chart"].max(initial=-1) < 0:
        raise AtlasFailed("xatlas made no charts")
    return found


def _flattened(mesh: Mesh, found: Arrays, progress: Progress) -> Charts:
    """Sound charts of xatlas's own mesh; faces that it left out join their neighbours."""
    placed = found["chart"] >= 0
    chart = fill(found["chart"], twins(mesh.faces))
    uv = true_to_size(mesh, found["uv"], chart)
    return flatten_charts(mesh, chart, uv, usable=placed, progress=progress)
