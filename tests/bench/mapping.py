"""Zhou's figure 2: quilting on the dense mesh against mapping the input mesh's triangles."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import astuple, dataclass, fields

import numpy as np
from scipy.spatial import cKDTree

from btfcore.mesh.topology import vertex_normals
from btfcore.patch.connectivity import Connectivity
from btfcore.patch.resample import look_up
from btfcore.pipeline import load_mesh, prepare, synthesizer
from btfcore.quilt.grid import SampleGrid, sample_grid
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.state import QuiltState
from btfcore.types import F8, DenseMesh, Prepared, Quilt, Sample
from tests.bench.inputs import find, found, present, quilting_sample, warm_up
from tests.bench.pattern import Mapping as TriangleMapping
from tests.bench.pattern import PatternMapper, jumps
from tests.bench.table import ROOT, machine, markdown, publish

# mesh, sample, rate; the rate sets the size of a texel on the mesh, for both methods
CASES = (
    ("bunny.obj", "woven", 512),
    ("bunny.obj", "woven", 1024),
    ("bunny.obj", "gravel.png", 1024),
    ("bunny.obj", "stone_wall.png", 1024),
    ("stanford-bunny.obj", "woven", 512),
    ("stanford-bunny.obj", "woven", 1024),
)
QUICK = (("spot.obj", "brick_red.png", 256),)
SEEDS = (0, 1, 2)
DRAWN = ("spot.obj", "woven", 1024)  # a mesh whose pictures anybody may use
PICTURE = ROOT / "docs" / "gallery" / "figure2.jpg"
NOTE = """Means of three seeds. Both methods have the same mesh, field, sample, size of texel,
channels, area of a work patch and number of placements; placements are registered below the
texel in both, rigidly in pattern mapping, while quilting also bends patches and lets them give
(decision 0015). *pattern mapping*: the input mesh's own triangles get texture coordinates, and a
graph cut on its dual lets seams run along its edges only, without a bound on how far a piece may
leave the field (Zhou §III-A, after hierarchical pattern mapping); *triangle*: mean edge of the
input mesh in texels; *length*: texels of seam per 1,000 square texels of surface; *step*: mean of
what is seen across the seams, ‖A − B‖, over the sample's mean texel difference; *cost*: both
together, the integral of ‖A − B‖ along all seams per square texel over the distance of random
texels; *angle*: median deviation from the field in degrees."""


@dataclass(frozen=True, eq=False)
class Case:
    """What every method gets: a prepared mesh, a sample (also as a grid), and the knobs."""

    prepared: Prepared
    sample: Sample
    grid: SampleGrid
    parameters: QuiltParameters

    @property
    def texel(self) -> float:
        """A grid texel in world units."""
        return self.prepared.dense.step * self.grid.unit


@dataclass(frozen=True, eq=False)
class Result:
    """What a method made of a case.

    quilt: on the case's dense mesh, to be drawn; length: of all seams in texels; cost: integral
    of ‖A − B‖ along them, in the grid's channels; NaN where a method knows no seams.
    """

    quilt: Quilt
    patches: int
    cpu_s: float
    length: float
    cost: float


Method = Callable[[Case], Result]


def pattern_mapping(case: Case) -> Result:
    """Map the input mesh's triangles."""
    prepared, dense = case.prepared, case.prepared.dense
    began = time.process_time()
    mapper = PatternMapper(
        prepared.mesh, tangents_at(prepared), case.grid, case.parameters, dense.step
    )
    mapping = mapper.run()
    spent = time.process_time() - began
    length, cost = triangle_seams(mapper, mapping)
    return Result(drawn(case, mapper, mapping), mapper.patches, spent, length, cost)


def quilting(case: Case) -> Result:
    """Quilt the dense mesh."""
    began = time.process_time()
    engine = synthesizer(case.prepared, case.sample, case.parameters)
    quilt = engine.run()
    spent = time.process_time() - began
    length, cost = dense_seams(case.prepared.dense, engine.net, engine.state, engine.grid)
    return Result(quilt, engine.statistics.patches, spent, length, cost)


# What is compared; a further method takes a `Case` and returns a `Result`.
METHODS: dict[str, Method] = {"pattern mapping": pattern_mapping, "quilting": quilting}


def tangents_at(prepared: Prepared) -> F8:
    """Tangents (V, 3) of the orientation field at the input mesh's vertices."""
    mesh, dense = prepared.mesh, prepared.dense
    near = cKDTree(dense.vertices).query(mesh.vertices)[1]
    normals = vertex_normals(mesh.vertices, mesh.faces)
    tangents = prepared.field.tangents[near].astype(np.float64)
    tangents -= normals * (tangents * normals).sum(axis=1)[:, None]
    length = np.linalg.norm(tangents, axis=1)
    aside = np.cross(normals, [0.31, 0.47, 0.83])  # where the field stands on end
    tangents = np.where((length > 1e-3)[:, None], tangents, aside)
    return np.asarray(tangents / np.linalg.norm(tangents, axis=1)[:, None], np.float64)


def drawn(case: Case, mapper: PatternMapper, mapping: TriangleMapping) -> Quilt:
    """Texture coordinates of triangles as a quilting map of the dense mesh, to be drawn."""
    dense, grid = case.prepared.dense, case.grid
    corner = mapping.source[dense.face].astype(np.float64)
    source = grid.to_sample((corner * dense.bary[:, :, None]).sum(axis=1))
    image = mapping.source[..., 0].astype(np.float64) - 1j * mapping.source[..., 1]  # rows go down
    one, two = image[:, 1] - image[:, 0], image[:, 2] - image[:, 0]
    turn = np.angle(mapper.field_in(np.arange(len(image)), one, two))
    angle = -turn[dense.face].astype(np.float32)
    return Quilt(source, angle, np.zeros(len(source), np.uint16), mapping.patch[dense.face])


def triangle_seams(mapper: PatternMapper, mapping: TriangleMapping) -> tuple[float, float]:
    """Length and cost of the seams along the input mesh's edges."""
    twin, patch = mapper.twin, mapping.patch
    half = np.flatnonzero((twin >= 0) & (np.arange(len(twin)) < twin))
    half = half[patch[half // 3] != patch[twin[half] // 3]]
    other = twin[half]
    ours, theirs = (
        np.stack([mapping.source[at // 3, at % 3], mapping.source[at // 3, (at + 1) % 3]], axis=1)
        for at in (half, other)
    )
    length = mapper.length[half]
    return float(length.sum()), float(jumps(mapper.grid, ours, theirs[:, ::-1], length).sum())


def dense_seams(
    dense: DenseMesh, net: Connectivity, state: QuiltState, grid: SampleGrid
) -> tuple[float, float]:
    """Length and cost of a quilt's seams, taken as lines between the dense mesh's vertices.

    In a triangle the line joins the middles of the edges between two patches (three of them
    meet in its centre), so it is the zigzag, which is rather too long than too short.
    """
    tail = np.repeat(np.arange(len(net.indptr) - 1, dtype=np.int64), np.diff(net.indptr))
    head = net.indices.astype(np.int64)
    apart = np.flatnonzero(state.patch[tail] != state.patch[head])
    there = look_up(grid.cut, state.ghost[apart]).astype(np.float64)
    here = look_up(grid.cut, state.source[head[apart]]).astype(np.float64)
    step = np.sqrt(((there - here) ** 2).sum(axis=1))
    key = tail[apart] * len(state.patch) + head[apart]  # ascending, as rows are sorted
    faces = dense.faces.astype(np.int64)
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1)  # (G, 3, 2)
    cross = state.patch[ends[..., 0]] != state.patch[ends[..., 1]]
    torn = cross.any(axis=1)
    ends, cross = ends[torn], cross[torn]
    value = np.zeros(cross.shape)
    for one, two in ((0, 1), (1, 0)):
        wanted = ends[..., one][cross] * len(state.patch) + ends[..., two][cross]
        value[cross] += step[np.searchsorted(key, wanted)] / 2
    points = dense.vertices / (dense.step * grid.unit)
    middle = points[ends].mean(axis=2)
    count = cross.sum(axis=1)
    # from the triangle's seam point to the middle of each edge that the seam crosses
    hub = (middle * cross[..., None]).sum(axis=1) / count[:, None]
    length = np.linalg.norm(middle - hub[:, None], axis=2) * cross
    return float(length.sum()), float((length * value).sum())


@dataclass(frozen=True)
class Row:
    """One method on one case."""

    mesh: str
    sample: str
    rate: int
    triangle: float
    method: str
    patches: int
    cpu_s: float
    length: float
    step: float
    cost: float
    angle: float


def case_of(mesh: str, sample: str, rate: int, *, seed: int = 0) -> Case:
    """Prepare a case by its inputs' names."""
    prepared = prepare(load_mesh(found(mesh))[0], rate=rate)
    picture = quilting_sample(sample)
    parameters = QuiltParameters(seed=seed)
    grid = sample_grid(picture, match_channels=parameters.match_channels)
    return Case(prepared, picture, grid, parameters)


def figures(case: Case, result: Result) -> tuple[float, float, float, float]:
    """Length per 1,000 square texels, step in texel differences, cost per square texel, angle."""
    dense, grid = case.prepared.dense, case.grid
    area = len(dense.vertices) * dense.step**2 / case.texel**2
    step = result.cost / max(result.length, 1e-12) / max(grid.texel_difference, 1e-12)
    cost = result.cost / area / max(grid.random_difference, 1e-12)
    angle = float(np.median(np.abs(np.degrees(result.quilt.angle.astype(np.float64)))))
    return 1000 * result.length / area, step, cost, angle


def edge_texels(case: Case) -> float:
    """Mean edge of the input mesh in texels."""
    corner = case.prepared.mesh.vertices[case.prepared.mesh.faces]
    lengths = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2)
    return float(lengths.mean()) / case.texel


def run(
    cases: tuple[tuple[str, str, int], ...],
    methods: Mapping[str, Method] | None = None,
    seeds: tuple[int, ...] = SEEDS,
) -> list[Row]:
    """Run every method on every case, means over seeds."""
    rows = []
    for mesh, sample, rate in cases:
        case = case_of(mesh, sample, rate)
        for name, method in (METHODS if methods is None else methods).items():
            measured = []
            for seed in seeds:
                seeded = Case(case.prepared, case.sample, case.grid, QuiltParameters(seed=seed))
                result = method(seeded)
                measured.append((result.patches, result.cpu_s, *figures(seeded, result)))
            patches, *others = np.mean(measured, axis=0).tolist()
            rows.append(Row(mesh, sample, rate, edge_texels(case), name, round(patches), *others))
    return rows


def main(
    *, write: bool = False, quick: bool = False, methods: Mapping[str, Method] | None = None
) -> None:
    """Print the table; with `write` also draw the picture of the gallery."""
    cases = QUICK if quick else CASES
    names = sorted({case[0] for case in cases} | {case[1] for case in cases if case[1] != "woven"})
    _, absent = present(names)
    warm_up(quilting=False)
    kept = tuple(case for case in cases if find(case[0]) and (case[1] == "woven" or find(case[1])))
    run((("sphere.obj", "brick_red.png", 64), ("sphere.obj", "woven", 64)), methods, (0,))
    rows = run(kept, methods, SEEDS[:1] if quick else SEEDS)
    columns = [item.name.replace("_s", " s") for item in fields(Row)]
    table = markdown(columns, [astuple(row) for row in rows])
    parts = ["## Dense mesh against the input mesh's triangles", machine(), table, NOTE, absent]
    publish("mapping", "\n\n".join(part for part in parts if part), write=write)
    if write and not quick:
        from tests.bench.mapping_picture import write_picture

        write_picture(PICTURE, case_of(*DRAWN), METHODS if methods is None else methods)
