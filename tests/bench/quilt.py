"""Quilting: Patina's way against the paper's, on the same meshes and samples in one run."""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields, replace

import numpy as np

from btfcore.phases import PhaseClock
from btfcore.pipeline import load_mesh, load_sample, prepare, synthesizer
from btfcore.quilt.measure import measure_seams
from btfcore.quilt.parameters import QuiltParameters
from btfcore.types import Prepared, Sample
from tests.bench.inputs import find, found, present, warm_up
from tests.bench.measures import isometry
from tests.bench.table import machine, markdown, publish

# mesh, sample, rate, and whether the paper's way, which takes minutes, is run too
CASES = (
    ("bunny.obj", "brick_grey.png", 256, True),
    ("bunny.obj", "brick_grey.png", 512, True),
    ("bunny.obj", "brick_red.png", 512, True),
    ("bunny.obj", "gravel.png", 512, True),
    ("spot.obj", "brick_red.png", 512, True),
    ("torus.obj", "tiles_teal.png", 512, True),
    ("bunny.obj", "brick_grey.png", 1024, False),
    ("bunny.obj", "brick_red.png", 1024, False),
)
QUICK = (("spot.obj", "brick_red.png", 256, True),)
SEEDS = (0, 1, 2)  # one seed's seams differ by up to a tenth from another's
NOTE = """Means of three seeds.
*literal*: LSCM for every patch that crosses charts, 72 rotated copies of
the sample, matching on all channels, first placement only (`--literal`). *per edge*: seam cost
per seam edge over the sample's own mean texel difference; *per vertex*: seam cost per vertex over
the cost of random pairs; *angle*: median deviation from the field in degrees; *low*, *median*,
*high*: 2.5, 50 and 97.5 % of the singular values of surface → sample; *in 1.3*: triangles within
a factor 1.3; *mirrored*: share of mirrored triangles; *peak*: resident MiB, the interpreter
included."""


@dataclass(frozen=True)
class Row:
    """One way on one mesh with one sample."""

    mesh: str
    sample: str
    rate: int
    way: str
    patches: int
    wall_s: float
    cpu_s: float
    peak: int
    covered: float
    per_edge: float
    per_vertex: float
    angle: float
    low: float
    median: float
    high: float
    in_1_3: float
    mirrored: float


def run(cases: tuple[tuple[str, str, int, bool], ...]) -> list[Row]:
    """Measure every case, warm; the mesh is prepared outside the time."""
    warm_up()
    rows, prepared, last = [], None, None
    for mesh, sample, rate, both in cases:
        if prepared is None or last != (mesh, rate):
            prepared, last = prepare(load_mesh(found(mesh))[0], rate=rate), (mesh, rate)
        picture = load_sample(found(sample))
        ways = [("Patina", False), ("literal", True)] if both else [("Patina", False)]
        for name, literal in ways:
            seeds = [
                measure(prepared, picture, QuiltParameters(literal=literal, seed=seed))
                for seed in SEEDS
            ]
            rows.append(replace(mean(seeds), mesh=mesh, rate=rate, way=name))
    return rows


def mean(rows: list[Row]) -> Row:
    """Average the figures of several seeds; whole numbers stay whole."""
    averaged = {}
    for item in fields(Row):
        values = [getattr(row, item.name) for row in rows]
        if isinstance(values[0], int):
            averaged[item.name] = round(sum(values) / len(values))
        elif isinstance(values[0], float):
            averaged[item.name] = sum(values) / len(values)
    return replace(rows[0], **averaged)


def measure(prepared: Prepared, sample: Sample, parameters: QuiltParameters) -> Row:
    """Time one quilting, tables included, and measure its errors."""
    clock = PhaseClock()
    with clock.phase("quilt"):
        engine = synthesizer(prepared, sample, parameters)
        quilt = engine.run()
    seams = measure_seams(engine.net, engine.state, engine.grid)
    shape = isometry(prepared.dense, quilt, scale=parameters.scale)
    figures = clock.figures["quilt"]
    return Row(
        mesh="",
        sample=sample.name,
        rate=prepared.dense.size,
        way="",
        patches=engine.statistics.patches,
        wall_s=figures["wall_s"],
        cpu_s=figures["cpu_s"],
        peak=round(figures["peak_mb"]),
        covered=float((quilt.patch >= 0).mean()),
        per_edge=seams.per_edge,
        per_vertex=seams.per_vertex,
        angle=float(np.median(np.abs(np.degrees(quilt.angle.astype(np.float64))))),
        low=shape.low,
        median=shape.median,
        high=shape.high,
        in_1_3=shape.within,
        mirrored=shape.mirrored,
    )


def ratios(rows: list[Row]) -> str:
    """Print how many times quicker Patina's way is, and what its seams cost beside literal's."""
    lines = []
    for ours in rows:
        for theirs in rows:
            same = (ours.mesh, ours.sample, ours.rate) == (theirs.mesh, theirs.sample, theirs.rate)
            if same and (ours.way, theirs.way) == ("Patina", "literal"):
                lines.append(
                    (
                        f"{ours.mesh}, {ours.sample}, {ours.rate}²",
                        theirs.wall_s / max(ours.wall_s, 1e-9),
                        theirs.cpu_s / max(ours.cpu_s, 1e-9),
                        ours.per_vertex / max(theirs.per_vertex, 1e-9),
                        ours.per_edge / max(theirs.per_edge, 1e-9),
                    )
                )
    columns = ("case", "times quicker, wall", "CPU", "seam cost per vertex, Patina / literal",
               "per edge")  # fmt: skip
    return markdown(columns, lines)


def main(*, write: bool = False, quick: bool = False) -> None:
    """Print the tables; `quick` keeps to one small case."""
    cases = QUICK if quick else CASES
    _, absent = present(sorted({name for case in cases for name in case[:2]}))
    rows = run(tuple(case for case in cases if find(case[0]) and find(case[1])))
    columns = [
        field.name.replace("_s", " s").replace("in_1_3", "in 1.3").replace("_", " ")
        for field in fields(Row)
    ]
    table = markdown(columns, [astuple(row) for row in rows])
    parts = ["## Quilting", machine(), table, ratios(rows), NOTE, absent]
    publish("quilt", "\n\n".join(part for part in parts if part), write=write)
