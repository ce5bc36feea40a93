"""Atlas, dense mesh and field: run time and error for several meshes and rates."""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields

from btfcore.mesh.topology import statistics
from btfcore.phases import PhaseClock
from btfcore.pipeline import load_mesh, prepare
from btfcore.report import surface_distance
from tests.bench.inputs import found, present, warm_up
from tests.bench.measures import mean_turn, uprightness
from tests.bench.table import machine, markdown, publish

MESHES = ["bunny.obj", "spot.obj", "cat.obj", "3holes.off", "fandisk.obj", "stanford-bunny.obj"]
RATES = (256, 512, 1024)
NOTE = """Seconds are wall / CPU. *sound*: no non-manifold edge, and as many boundary loops as
the input; *mean* and *max*: distance to the input over its diagonal, at vertices and face centres;
*sing.*: singularities of the field; *turn*: mean angle between the field at an edge's two ends
in degrees; *upright*: mean cosine between the picture's up and the projected +y."""


@dataclass(frozen=True)
class Row:
    """One mesh at one rate."""

    mesh: str
    rate: int
    faces_in: int
    vertices: int
    charts: int
    atlas_s: str
    dense_s: str
    field_s: str
    sound: bool
    euler: str
    mean: float
    max: float
    sing: int
    turn: float
    upright: float


def run(meshes: list[str], rates: tuple[int, ...]) -> list[Row]:
    """Measure every mesh at every rate, warm."""
    warm_up(quilting=False)
    rows = []
    for name in meshes:
        mesh, report = load_mesh(found(name))
        for rate in rates:
            clock = PhaseClock()
            prepared = prepare(mesh, rate=rate, clock=clock)
            dense = prepared.dense
            now, before = statistics(dense.vertices, dense.faces), report.statistics
            mean, largest = surface_distance(dense, mesh)
            rows.append(
                Row(
                    mesh=name,
                    rate=rate,
                    faces_in=before.faces,
                    vertices=now.vertices,
                    charts=int(prepared.atlas.chart.max()) + 1,
                    atlas_s=seconds(clock, "atlas"),
                    dense_s=seconds(clock, "dense"),
                    field_s=seconds(clock, "field"),
                    sound=now.boundary_loops == before.boundary_loops
                    and now.nonmanifold_edges == 0,
                    euler=f"{before.euler} → {now.euler}",
                    mean=mean,
                    max=largest,
                    sing=len(prepared.field.singularities),
                    turn=mean_turn(dense, prepared.field),
                    upright=uprightness(dense, prepared.field),
                )
            )
    return rows


def seconds(clock: PhaseClock, phase: str) -> str:
    """Wall and CPU seconds of a phase."""
    figures = clock.figures[phase]
    return f"{figures['wall_s']:.2f} / {figures['cpu_s']:.2f}"


def main(*, write: bool = False, quick: bool = False) -> None:
    """Print the table; `quick` keeps to one mesh and the two smaller rates."""
    meshes, absent = present(["spot.obj"] if quick else MESHES)
    rows = run(meshes, RATES[:2] if quick else RATES)
    columns = [field.name.replace("_s", " s").replace("_", " ") for field in fields(Row)]
    table = markdown(columns, [astuple(row) for row in rows])
    parts = ["## Atlas, dense mesh and field", machine(), table, NOTE, absent]
    publish("dense", "\n\n".join(part for part in parts if part), write=write)
