"""Factorising BTFs: which code of radiance, and run time against error."""

from __future__ import annotations

import importlib.util
import os
import time
from collections.abc import Iterable, Iterator
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse.linalg import svds

from btfcore.btf.bake.build import baked
from btfcore.btf.factor.encoding import EPSILON, encode
from btfcore.btf.factor.errors import factor_errors, held_out_errors
from btfcore.btf.factor.knee import choose_knee
from btfcore.btf.factor.optimum import optimal_errors
from btfcore.btf.factor.svd import factorize
from btfcore.btf.materialize import materialize
from btfcore.btf.sample import BtfSample, Encoding, cropped
from btfcore.files.samples import directions_of, open_sample, read_pbr_sized
from tests.bench.inputs import FOLDERS, find
from tests.bench.plot import line_plot
from tests.bench.table import ROOT, machine, markdown, publish
from tests.btf.factor.bounded import Case, outcome
from tests.btf.factor.sets import material

GALLERY = ROOT / "docs" / "gallery"
# and how deep their relief is made, in texels of 128; None: as deep as the set says
SETS = {"pbr_seaside_rocks": None, "pbr_rustymetal": None, "pbr_wool": 8.0, "pbr_bark": 8.0,
        "pbr_facade": 8.0, "rti_leaf_lrgb_ptm_512": None}  # fmt: skip
LAYOUT, QUICK_LAYOUT = "12x8x12x8", "6x4x6x4"
RANK = 40
NOTE = """Rank 40 unless told. *rel. L2*: √(Σ error² / Σ value²) of linear radiance; *RMSE*: mean
over images of the root mean square error of sRGB-coded colours, *worst* that of the worst image,
*held out* that of a quarter of the texels, in blocks of 8², that had no part in the factorisation;
*SSIM* on sRGB luminance. *regret*: by how much the RMSE is above that of the sample's best code,
mean over the samples where that is above 0.001; *greatest* of these, and *L2 over best* the median
of the same for linear radiance. *above optimum*: error in coded values over that of an exact SVD of
the crop. Seconds are CPU seconds of all threads, reading and coding included."""


@dataclass(frozen=True)
class Code:
    """One encoding of one sample."""

    sample: str
    encoding: str
    epsilon: float
    knee: str
    rel_L2: float
    RMSE: float
    worst: float
    SSIM: float


@dataclass(frozen=True)
class Speed:
    """One way to the factors of one sample."""

    method: str
    oversample: int
    passes: int
    texels: int
    images: int
    cpu_s: float
    above_optimum_percent: float


@dataclass(frozen=True)
class Rank:
    """The errors of one rank."""

    sample: str
    rank: int
    MiB: float
    rel_L2: float
    RMSE: float
    worst: float
    SSIM: float


@dataclass(frozen=True)
class Left:
    """The default's errors on all texels, and on texels that had no part in it."""

    sample: str
    encoding: str
    RMSE: float
    held_out: float
    auto_rank: int
    wanted_RMSE: float


@dataclass(frozen=True)
class Bound:
    """Memory beyond what was used before, for generated sets larger than the bound."""

    source: str
    images: int
    coded_MiB: float
    bound_MiB: float
    grown_MiB: float
    cpu_s: float


def inputs(size: int, edge: int, layout: str, names: Iterable[str]) -> Iterator[BtfSample]:
    """Samples in memory: baked texture sets and the relightable leaf, those that are here.

    Baked at `size` texels a side, of which the middle `edge` are kept.
    """
    for name in names:
        for path in sorted(path for folder in FOLDERS for path in folder.rglob(name)):
            depth = SETS[name]
            if depth is None:
                sample = open_sample(path, layout=layout, size=size)
            else:
                pbr, found = read_pbr_sized(path, size), directions_of(layout)
                sample = baked(pbr, *found, depth=depth * size / 128)
            height, width = sample.shape
            top, left = max(height - edge, 0) // 2, max(width - edge, 0) // 2
            window = (slice(top, top + edge), slice(left, left + edge))
            short = name.removeprefix("pbr_").split("_lrgb")[0]
            yield materialize(replace(cropped(sample, *window), name=short), memory_mb=4096)


def encodings(sample: BtfSample, *, quick: bool) -> Iterator[Encoding]:
    """Every code that is compared."""
    if quick:
        yield from (Encoding("linear"), Encoding("sqrt"), Encoding("log", EPSILON))
        return
    above = choose_knee(sample.stack).above
    yield from (Encoding("linear"), Encoding("linear", knee=above))
    yield from (Encoding("sqrt"), Encoding("sqrt", knee=above))
    yield from (Encoding("log", epsilon) for epsilon in (1e-3, 0.01, 0.03, 0.1))
    yield Encoding("log", EPSILON, above)
    yield from (Encoding("logluma", epsilon) for epsilon in (0.01, 0.03))


def codes(samples: list[BtfSample], *, every: int, quick: bool) -> list[Code]:
    """Compare the codes on every sample."""
    rows = []
    for sample in samples:
        for code in (*encodings(sample, quick=quick), "auto"):
            factors = factorize(sample, rank=RANK, encoding=code)
            found = factor_errors(sample, factors, every=every)
            used = factors.encoding
            rows.append(
                Code(
                    sample=sample.name,
                    encoding=f"auto: {used.name}" if code == "auto" else used.name,
                    epsilon=used.epsilon if used.name.startswith("log") else float("nan"),
                    knee="-" if used.knee is None else f"{used.knee:.3g}",
                    rel_L2=found.rel_l2,
                    RMSE=found.srgb_rmse,
                    worst=found.srgb_rmse_worst,
                    SSIM=found.ssim,
                )
            )
    return rows


def regrets(rows: list[Code]) -> str:
    """Table of how far each code is above the best of its sample, on the mean."""
    best = {row.sample: min(r.RMSE for r in rows if r.sample == row.sample) for row in rows}
    if max(best.values()) > 0.001:  # what nobody sees decides nothing
        rows = [row for row in rows if best[row.sample] > 0.001]
    dark = {row.sample: min(r.rel_L2 for r in rows if r.sample == row.sample) for row in rows}
    groups: dict[tuple[str, str, str], list[Code]] = {}
    for row in rows:
        name = row.encoding.split(":")[0]
        epsilon = "-" if name == "auto" or np.isnan(row.epsilon) else f"{row.epsilon:g}"
        knee = "-" if name == "auto" or row.knee == "-" else "yes"
        groups.setdefault((name, epsilon, knee), []).append(row)
    lines: list[tuple[Any, ...]] = []
    for key, group in groups.items():
        regret = np.mean([row.RMSE / best[row.sample] - 1 for row in group])
        most = np.max([row.RMSE / best[row.sample] - 1 for row in group])
        light = np.median([row.rel_L2 / dark[row.sample] for row in group])
        similar = np.mean([row.SSIM for row in group])
        lines.append((*key, f"{regret:.1%}", f"{most:.1%}", float(light), float(similar)))
    lines.sort(key=lambda line: float(line[3].rstrip("%")))
    head = ("encoding", "epsilon", "knee", "regret", "greatest", "L2 over best", "SSIM")
    return markdown(head, lines)


def timed(work: Any) -> tuple[Any, float]:
    """What `work` returns, and its CPU seconds."""
    start = time.process_time()
    out = work()
    return out, time.process_time() - start


def speeds(sample: BtfSample, crop: BtfSample) -> list[Speed]:
    """Time on the whole sample, error against the optimum on the crop, and other methods."""
    code = Encoding("sqrt")
    optimum = float(optimal_errors(crop, [RANK], code)[0])
    rows = []
    for oversample, passes in ((10, 1), (40, 1), (10, 2), (24, 2), (40, 2), (80, 2), (40, 3)):
        knobs = {"rank": RANK, "encoding": code, "oversample": oversample, "passes": passes}
        factors = factorize(crop, **knobs)
        error = factor_errors(crop, factors, pictures=False).rel_l2_coded
        seconds = timed(lambda: factorize(sample, **knobs))[1]  # noqa: B023
        rows.append(
            Speed(
                "ours", oversample, passes, _texels(sample), sample.images, seconds,
                100 * (error / optimum - 1),
            )
        )  # fmt: skip
    # the others on the crop, in memory and coded already, and ours on the same
    seconds = timed(lambda: factorize(crop, rank=RANK, encoding=code))[1]
    rows.append(
        Speed("ours", 40, 2, _texels(crop), crop.images, seconds, rows[4].above_optimum_percent)
    )
    coded = encode(crop.stack.read(np.arange(crop.images)), code)
    matrix = coded.reshape(crop.images, -1, 3).transpose(1, 0, 2).reshape(_texels(crop), -1)
    norm = np.linalg.norm(matrix.astype(np.float64))
    matrix = matrix - matrix.mean(axis=0, dtype=np.float64).astype(np.float32)
    energy = float((matrix.astype(np.float64) ** 2).sum())
    values, seconds = timed(lambda: svds(matrix, k=RANK, return_singular_vectors=False))
    rows.append(_other("scipy svds", crop, values, seconds, energy, norm, optimum))
    if importlib.util.find_spec("sklearn") is not None:
        from sklearn.utils.extmath import randomized_svd

        (_, values, _), seconds = timed(
            lambda: randomized_svd(matrix, RANK, n_oversamples=40, n_iter=1, random_state=0)
        )
        rows.append(_other("sklearn", crop, values, seconds, energy, norm, optimum))
    return rows


def _other(
    method: str, crop: BtfSample, values: Any, seconds: float, energy: float, norm: float,
    optimum: float,
) -> Speed:  # fmt: skip
    kept = float((np.asarray(values, np.float64) ** 2).sum())
    error = np.sqrt(max(energy - kept, 0)) / norm
    return Speed(
        method, 0, 0, _texels(crop), crop.images, seconds, float(100 * (error / optimum - 1))
    )


def _texels(sample: BtfSample) -> int:
    return sample.shape[0] * sample.shape[1]


def ranks(samples: list[BtfSample], *, every: int, upto: int) -> list[Rank]:
    """Errors of prefixes of one factorisation, and what "auto" takes for an RMSE of 0.02."""
    rows = []
    for sample in samples:
        factors = factorize(sample, rank=upto)
        tried = [rank for rank in (5, 10, 20, 40, 80, 120) if rank <= factors.rank]
        for rank in tried:
            found = factor_errors(sample, factors, rank=rank, every=every)
            floats = rank * (_texels(sample) + 3 * sample.images) + 3 * sample.images
            rows.append(
                Rank(
                    sample.name, rank, floats * 2 / 2**20, found.rel_l2, found.srgb_rmse,
                    found.srgb_rmse_worst, found.ssim,
                )
            )  # fmt: skip
    return rows


def left_out(samples: list[BtfSample]) -> list[Left]:
    """Compare texels that took part with texels that did not; and let the rank be found."""
    rows = []
    for sample in samples:
        factors = factorize(sample, rank=RANK)
        inside = factor_errors(sample, factors, every=4, pictures=False).srgb_rmse
        outside = held_out_errors(sample, rank=RANK, encoding=factors.encoding).srgb_rmse
        goal = 0.01
        found = factorize(sample, rank="auto", rmse=goal)
        rows.append(Left(sample.name, factors.encoding.name, inside, outside, found.rank, goal))
    return rows


def means(samples: list[BtfSample]) -> str:
    """What taking the mean over texels off gains, by exact SVDs of crops."""
    lines = []
    for sample in samples:
        crop = cropped(sample, slice(0, 32), slice(0, 32))
        for tried in (5, 10, 40):
            off, on = (
                float(optimal_errors(crop, [tried], Encoding("sqrt"), centred=centred)[0])
                for centred in (True, False)
            )
            lines.append((sample.name, tried, on, off, off / on))
    return markdown(("sample", "rank", "with mean", "mean off", "ratio"), lines)


def bounds(*, quick: bool) -> list[Bound]:
    """Run generated sets of 151 × 151 images, larger than the bound, in processes of their own."""
    if not Path("/proc/self/clear_refs").exists():
        return []
    views, memory = (30, 64.0) if quick else (151, 512.0)
    rows = []
    for source in ("file",) if quick else ("file", "formula", "dear formula"):
        case = Case(views, views, 128, memory_mb=memory, source=source)
        found = outcome(case)
        rows.append(
            Bound(source, views * views, found.coded_mb, memory, found.grown_mb, found.cpu_s)
        )
    return rows


def table(kind: type, rows: list[Any]) -> str:
    """Markdown of rows of one dataclass."""
    return markdown(
        [field.name.replace("_", " ") for field in fields(kind)], [astuple(row) for row in rows]
    )


def main(*, write: bool = False, quick: bool = False) -> None:
    """Print the tables; `quick` keeps to one small sample and few images."""
    factorize(material(12), rank=4, oversample=4)  # compile
    size, edge, layout = (32, 32, QUICK_LAYOUT) if quick else (128, 64, LAYOUT)
    names = list(SETS)[:1] if quick else list(SETS)
    samples = list(inputs(size, edge, layout, names)) or [material(32)]
    absent = sorted({name for name in names if find(name) is None})
    every = 4 if quick else 8
    compared = codes(samples, every=every, quick=quick)
    first = samples[0]
    whole = first if quick else next(inputs(size, size, layout, names), first)
    crop = cropped(first, slice(0, 24), slice(0, 24)) if quick else first
    found = speeds(whole, crop)
    by_rank = ranks(samples, every=every, upto=80 if quick else 120)
    parts = [
        "## Factorisation",
        machine(),
        f"Baked at {size}², layout {layout}, {edge}² of it taken; one image in {every} compared.",
        "### Codes of radiance",
        regrets(compared),
        table(Code, compared),
        "### Rank",
        table(Rank, by_rank),
        "### Held out, and rank=auto",
        table(Left, left_out(samples)),
        "### Time against error",
        table(Speed, found),
        "### Means",
        means(samples),
        "### Memory",
        table(Bound, bounds(quick=quick)),
        NOTE,
        f"Not here and left out: {', '.join(absent)}." if absent else "",
    ]
    if write and not quick:
        _plots(by_rank, found)
        parts.insert(
            parts.index("### Rank") + 1, "![error over rank](gallery/bench-factorize-rank.svg)"
        )
        parts.insert(
            parts.index("### Time against error") + 1,
            "![time over error](gallery/bench-factorize-time.svg)",
        )
    publish("factorize", "\n\n".join(part for part in parts if part), write=write)


def _plots(by_rank: list[Rank], found: list[Speed]) -> None:
    names = dict.fromkeys(row.sample for row in by_rank)
    series = {
        name: (
            [row.rank for row in by_rank if row.sample == name],
            [row.RMSE for row in by_rank if row.sample == name],
        )
        for name in names
    }
    line_plot(
        GALLERY / "bench-factorize-rank.svg", series, x_label="factors",
        y_label="mean sRGB RMSE", title="Error over rank", log_x=True, log_y=True,
    )  # fmt: skip
    mine = [row for row in found if row.method == "ours"][:-1]
    by_passes = {
        f"{passes} passes": (
            [row.cpu_s for row in mine if row.passes == passes],
            [row.above_optimum_percent for row in mine if row.passes == passes],
        )
        for passes in (1, 2, 3)
    }
    line_plot(
        GALLERY / "bench-factorize-time.svg", by_passes, x_label="CPU seconds",
        y_label="% above the optimum", title="Oversampling and passes", log_y=True,
    )  # fmt: skip


if __name__ == "__main__":
    main(quick="PATINA_QUICK" in os.environ)
