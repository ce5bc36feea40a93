"""How a whole run grows with the number of vertices: time, memory, seams, and the bits."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, fields

import numpy as np

from btfcore.phases import PhaseClock
from btfcore.pipeline import load_mesh, prepare, synthesizer
from btfcore.quilt.measure import measure_seams
from btfcore.quilt.parameters import QuiltParameters
from btfcore.types import Quilt, Sample
from tests.bench.inputs import found, present, quilting_sample, warm_up
from tests.bench.table import ROOT, machine, markdown, publish

MESH, SAMPLE = "bunny.obj", "woven"
RATES, QUICK = (256, 512, 1024, 2048), (128, 256)
LARGEST = 4096  # only where `FULL` is set: it takes minutes
FULL = "PATINA_BENCH_FULL"
THREADS = (1, 2)
STAGES = ("atlas", "dense", "field", "quilt")
POOLS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
NOTE = """Whole runs with atlas, dense mesh, field and quilt, warm, reading the files left out;
the sample is a baked plain weave of 128² texels and 12×8×12×8 directions, factorised to 40
channels. Stages are wall / CPU seconds; *peak*: resident MiB of the process that quilts, the
interpreter included, at its highest; *per edge* and *per vertex*: seam cost, as under Quilting."""


@dataclass(frozen=True)
class Row:
    """One whole run at one rate."""

    rate: int
    vertices: int
    patches: int
    wall_s: float
    cpu_s: float
    atlas: str
    dense: str
    field: str
    quilt: str
    peak: int
    covered: float
    per_edge: float
    per_vertex: float


@dataclass(frozen=True)
class Run:
    """A row, and the stages' seconds that exponents are fitted to."""

    row: Row
    clock: PhaseClock


def run(mesh: str, sample: Sample, rates: Iterable[int], *, seed: int = 0) -> list[Run]:
    """Measure whole runs on a mesh file; the kernels must be warm."""
    loaded = load_mesh(found(mesh))[0]
    done = []
    for rate in rates:
        clock = PhaseClock()
        prepared = prepare(loaded, rate=rate, clock=clock)
        with clock.phase("quilt"):
            engine = synthesizer(prepared, sample, QuiltParameters(seed=seed))
            quilt = engine.run()
        seams = measure_seams(engine.net, engine.state, engine.grid)
        figures = [clock.figures[stage] for stage in STAGES]
        row = Row(
            rate=rate,
            vertices=len(quilt.patch),
            patches=engine.statistics.patches,
            wall_s=sum(each["wall_s"] for each in figures),
            cpu_s=sum(each["cpu_s"] for each in figures),
            **{
                stage: f"{each['wall_s']:.2f} / {each['cpu_s']:.2f}"
                for stage, each in zip(STAGES, figures, strict=True)
            },  # type: ignore[arg-type]
            peak=round(max(each["peak_mb"] for each in figures)),
            covered=float((quilt.patch >= 0).mean()),
            per_edge=seams.per_edge,
            per_vertex=seams.per_vertex,
        )
        done.append(Run(row, clock))
    return done


def exponent(counts: Sequence[float], seconds: Sequence[float]) -> float:
    """Slope of log seconds over log counts by least squares: time ~ counts to this power."""
    x, y = np.log(np.asarray(counts, float)), np.log(np.asarray(seconds, float))
    x = x - x.mean()
    return float((x * y).sum() / (x * x).sum())


def exponents(runs: Sequence[Run]) -> str:
    """Table of the exponents of N in the quilting's and the whole run's seconds."""
    counts = [each.row.vertices for each in runs]
    quilts = [each.clock.figures["quilt"] for each in runs]
    rows = [
        (
            f"N^ over {runs[0].row.rate}² … {runs[-1].row.rate}²",
            exponent(counts, [each["wall_s"] for each in quilts]),
            exponent(counts, [each["cpu_s"] for each in quilts]),
            exponent(counts, [each.row.wall_s for each in runs]),
            exponent(counts, [each.row.cpu_s for each in runs]),
        )
    ]
    columns = ("exponent", "quilt, wall", "quilt, CPU", "whole, wall", "whole, CPU")
    return markdown(columns, rows)


def digest(quilt: Quilt) -> str:
    """Hash of a quilt's bits: sources, patches and angles."""
    total = hashlib.sha256()
    for values in (quilt.source, quilt.patch, quilt.angle):
        total.update(np.ascontiguousarray(values).tobytes())
    return total.hexdigest()


def fingerprint(mesh: str, sample: str, rate: int) -> str:
    """Hash of a whole run's quilt, made in this process."""
    prepared = prepare(load_mesh(found(mesh))[0], rate=rate)
    return digest(synthesizer(prepared, quilting_sample(sample), QuiltParameters()).run())


def fingerprints(mesh: str, sample: str, rate: int) -> dict[int, str]:
    """Hash of the quilt for each number of threads of `THREADS`, each in a fresh process."""
    code = (
        "import sys; from tests.bench.growth import fingerprint;"
        f" sys.stdout.write(fingerprint({mesh!r}, {sample!r}, {rate}))"
    )
    found_ = {}
    for threads in THREADS:
        pools = dict.fromkeys(POOLS, str(threads))
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=ROOT, env={**os.environ, **pools},
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode:
            raise RuntimeError(f"the run with {threads} threads failed:\n{done.stderr}")
        found_[threads] = done.stdout.strip()
    return found_


def main(*, write: bool = False, quick: bool = False) -> None:
    """Print the tables; `quick` keeps to the small rates, `PATINA_BENCH_FULL=1` adds 4096².

    Raises `SystemExit` after printing where the numbers of threads give other bits.
    """
    (mesh,), _ = present([MESH])
    rates = QUICK if quick else (*RATES, LARGEST) if os.environ.get(FULL) else RATES
    sample = quilting_sample(SAMPLE)
    warm_up()
    run("sphere.obj", sample, [64])  # 40 channels have kernels of their own
    runs = run(mesh, sample, rates)
    columns = [item.name.replace("_s", " s").replace("_", " ") for item in fields(Row)]
    hashes = fingerprints(mesh, SAMPLE, rates[0])
    same = len(set(hashes.values())) == 1
    bits = (
        f"Bits of source, patch and angle at {rates[0]}² with"
        f" {' and '.join(map(str, THREADS))} threads: {'identical' if same else 'DIFFERENT'}"
        f" ({', '.join(value[:12] for value in hashes.values())})."
    )
    # past 2048² memory traffic would be fitted, not the algorithm
    fitted = exponents([each for each in runs if each.row.rate <= max(RATES)])
    rows = markdown(columns, [astuple(each.row) for each in runs])
    parts = [f"## Growth: {MESH} with the woven sample", machine(), rows, fitted, bits, NOTE]
    publish("growth", "\n\n".join(parts), write=write)
    if not same:
        raise SystemExit("the quilt depends on the number of threads")
