"""The report of a run: versions, counts, distances, seams and times, as plain JSON."""

from __future__ import annotations

import platform
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from btfcore import __version__
from btfcore.pipeline import Decorated
from btfcore.types import DenseMesh, Mesh, Prepared

LIBRARIES = ("numpy", "scipy", "numba", "PyMaxflow", "xatlas", "libigl", "trimesh", "pillow")


def run_report(done: Decorated) -> dict[str, Any]:
    """Everything worth knowing about a finished run; figures in the units of the docstrings.

    `seams.per_edge` is the mean of ½ V_pq (Zhou §IV-A) over the sample's mean texel
    difference, `seams.per_vertex` their sum per vertex over the mean difference of random
    texels. `quilt.worst_patches` are described in `btfcore.quilt.ledger`.
    """
    from btfcore.quilt.ledger import reductions, worst_patches
    from btfcore.quilt.measure import measure_seams

    engine, prepared = done.engine, done.prepared
    seams = measure_seams(engine.net, engine.state, engine.sheet)
    counts = engine.statistics
    angle = np.abs(np.degrees(done.quilt.angle.astype(np.float64)))
    return {
        "versions": versions(),
        "seed": engine.parameters.seed,
        "parameters": asdict(engine.parameters),
        "input": {
            "path": done.imported.path,
            "diagonal": prepared.mesh.diagonal,
            **asdict(done.imported.statistics),
            "notes": list(done.imported.notes),
        },
        "sample": {
            "name": done.sample.name,
            "height": done.sample.colour.shape[0],
            "width": done.sample.colour.shape[1],
            "notes": list(done.sample_notes),
        },
        "dense": dense_report(prepared),
        "field": {"singularities": len(prepared.field.singularities)},
        "quilt": {
            "work_patch": engine.radius,
            "patches": counts.patches,
            "patches_by_kind": {
                "in_chart": counts.kinds["chart"],
                "exponential_map": counts.kinds["expmap"] + counts.kinds["relaxed"],
                "exponential_map_relaxed": counts.kinds["relaxed"],
                "lscm": counts.kinds["lscm"],
            },
            "shrinks": counts.shrinks,
            "trims_for_the_field": counts.trims,
            "cuts": counts.cuts,
            "patches_continued": engine.continued,
            "reduced_for": reductions(engine.ledger),
            "worst_patches": worst_patches(engine, prepared.dense, prepared.field),
            "covered": counts.covered,
            "orientation_error_deg": {
                "median": float(np.median(angle)),
                "p90": float(np.quantile(angle, 0.9)),
            },
        },
        "seams": asdict(seams),
        **(region_report(done) if done.plan is not None else {}),
        "refinement": None if done.refinement is None else asdict(done.refinement),
        "phases": done.clock.figures,
    }


def region_report(done: Decorated) -> dict[str, Any]:
    """Regions with their samples, and the seams of each sample and of the soft borders.

    Hard borders are no seams and are counted nowhere; `vertices` of a region are those of the
    dense mesh on it, of a sample those that show it.
    """
    from btfcore.quilt.measure import measure_by_sample
    from btfcore.regions import region_table, vertex_regions

    plan, engine, quilt = done.plan, done.engine, done.quilt
    assert plan is not None
    parts, borders = measure_by_sample(engine.net, engine.state, engine.sheet)
    region = vertex_regions(done.prepared.mesh, done.prepared.dense)
    count = np.bincount(region, minlength=len(plan.names))
    own = np.asarray(plan.sample)[region] == quilt.sample
    regions = [
        row | {
            "vertices": int(count[each]),
            "sample": plan.files[plan.sample[each]].name,
            "kept": float(own[region == each].mean()) if count[each] else None,
        }
        for each, row in enumerate(region_table(done.prepared.mesh))
    ]  # fmt: skip
    shown = np.bincount(quilt.sample[quilt.patch >= 0], minlength=len(parts))
    samples = [
        {
            "name": sample.name,
            "file": file.name,
            "scale": scale,
            "height": sample.colour.shape[0],
            "width": sample.colour.shape[1],
            "work_patch": radius,
            "vertices": int(vertices),
            "seams": asdict(part),
        }
        for sample, file, scale, radius, vertices, part in zip(
            done.samples, plan.files, plan.scales, engine.radii, shown, parts, strict=True
        )
    ]
    return {"regions": regions, "samples": samples, "soft_borders": asdict(borders)}


def dense_report(prepared: Prepared) -> dict[str, Any]:
    """Counts of the dense mesh, and its distance to the input over the diagonal."""
    from btfcore.mesh.topology import statistics

    dense = prepared.dense
    mean, largest = surface_distance(dense, prepared.mesh)
    return {
        "rate": dense.size,
        **asdict(statistics(dense.vertices, dense.faces)),
        "charts": int(prepared.atlas.chart.max()) + 1,
        "step": dense.step,
        "distance_mean": mean,
        "distance_max": largest,
    }


def surface_distance(dense: DenseMesh, mesh: Mesh) -> tuple[float, float]:
    """Mean and largest distance over the diagonal, at vertices and at face centres.

    The vertices lie on the input by construction; the centres show what the triangles miss.
    """
    from btfcore.mesh.distance import distance_to_mesh

    centres = dense.vertices[dense.faces].mean(axis=1)
    points = np.concatenate([dense.vertices, centres])
    if len(points) > 400_000:  # the mean needs no more; the maximum keeps to this subset
        points = points[:: len(points) // 400_000 + 1]
    distance = distance_to_mesh(points, mesh) / mesh.diagonal
    return float(distance.mean(dtype=np.float64)), float(distance.max())


def versions() -> dict[str, str]:
    """Versions of Patina, Python, the platform and the libraries that decide a result."""
    found = {"patina": __version__, "python": platform.python_version()}
    found["platform"] = f"{platform.system()} {platform.machine()}"
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "absent"
    return found
