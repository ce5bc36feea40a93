"""Patina and other planar synthesisers on the same work: time and all measures side by side."""

from __future__ import annotations

import resource
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from btfcore.errors import InvalidParameter, PatinaError
from btfcore.patch.resample import look_up
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.synthesize import Synthesizer
from btfcore.types import F4
from tests.bench.planar import PlanarMeasures, measure_plane
from tests.bench.plane_work import flat_grid, load, pictures, sample_of, save
from tests.bench.table import machine, markdown, publish

SIDE = 512
SEEDS = (0, 1, 2)
LONGEST_S = 600
BASELINES = Path(__file__).resolve().parent / "baselines"
# A plane needs no bending, and whole texels are copied as they are; nothing limits its patches
# but the sample, so that they are larger and may be cut in a wider overlap.
PLANE = QuiltParameters(work_patch=68, band=32, sway=0.0, bend=0.0)
WAYS = {"Patina": PLANE, "Patina, reuse 4": replace(PLANE, reuse=4.0)}
NOTE = """A sample of 128² pixels, spread over 512². *CPU s*: user and system seconds; of
Patina warm, tables of the grid included; of a program all of its process, *start* being what it
takes to load its libraries and do nothing. *patch-NN*: RMSE of each 11 × 11 patch of the output to
its nearest in the sample, over the sample's deviation; *seam*: 95 % quantile of the same; *copied
side*: of the pieces copied verbatim, in pixels; *use*: how evenly the sample is used (1: all
alike); *self-repeat*: share of 31 × 31 patches found again 49 or more pixels away. A lower patch-NN
with larger copied side or self-repeat is no better picture: read them together. *reuse*: places
taken before are avoided. Mean of three seeds where the program takes a seed. *quoted, other
machine*: measured elsewhere on the same samples, for orientation; their times do not compare."""
# name: (CPU s, patch-NN, copied side, self-repeat) of brick and of gravel
QUOTED = {
    "Embark texture-synthesis": (("15–16.5", 0.236, 17, 0.05), ("15–16.5", 0.442, 27, 0.02)),
    "graphcut in C++": (("48–53", 0.074, 71, 0.55), ("48–53", 0.125, 83, 0.53)),
    "image quilting in C++": (("1.19", 0.090, 31, 0.61), ("1.19", 0.206, 61, 0.28)),
    "resynthesizer": (("2.5–7.5", 0.149, 36, 0.29), ("2.5–7.5", 0.250, 58, 0.26)),
}


@dataclass(frozen=True)
class Peer:
    """A program: `command` with {in}, {out} and perhaps {size}, {seed}; `start` does nothing."""

    name: str
    command: tuple[str, ...]
    start: tuple[str, ...] = ()

    @classmethod
    def of(cls, text: str) -> Peer:
        """Read "NAME=command {in} {out}"; raises `InvalidParameter`."""
        name, sign, command = text.partition("=")
        parts = tuple(shlex.split(command))
        named = {mark for mark in ("{in}", "{out}") if any(mark in part for part in parts)}
        if not (name.strip() and sign and len(named) == 2):
            raise InvalidParameter(
                f'peer {text!r} is not of the form "NAME=command {{in}} {{out}}"'
            )
        return cls(name.strip(), parts)

    @property
    def seeds(self) -> tuple[int, ...]:
        """One run, or three where the command takes a seed."""
        return SEEDS if any("{seed}" in part for part in self.command) else SEEDS[:1]


@dataclass(frozen=True)
class Run:
    """One output: CPU seconds, and its measures."""

    cpu_s: float
    measures: PlanarMeasures


def shipped(python: str) -> list[Peer]:
    """Our own small baselines and the resynthesizer, run by the interpreter `python`."""
    script, filler = str(BASELINES / "image_quilting.py"), str(BASELINES / "resynthesize.py")
    tail = ("{in}", "{out}", "--size", "{size}", "--seed", "{seed}")
    peers = [
        Peer(f"image quilting, {title}", (python, script, name, *tail),
             (python, script, name, "--start"))
        for title, name in (("OpenCV", "opencv"), ("scikit-image", "skimage"))
    ]  # fmt: skip
    return [
        *peers,
        Peer("resynthesizer, PyPI", (python, filler, "{in}", "{out}", "--size", "{size}"),
             (python, filler, "--start")),
    ]  # fmt: skip


def child_seconds(command: Sequence[str]) -> float:
    """CPU seconds of a finished child process; raises `InvalidParameter` where it fails."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=LONGEST_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise InvalidParameter(f"{command[0]}: {error}") from error
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        said = done.stderr.strip().splitlines() or ["nothing on stderr"]
        raise InvalidParameter(f"exit status {done.returncode}, {said[-1]}")
    return (after.ru_utime - before.ru_utime) + (after.ru_stime - before.ru_stime)


def run_peer(peer: Peer, sample: F4, folder: Path, *, size: int) -> list[Run]:
    """Run a program once a seed; raises `InvalidParameter` or `InvalidImage`."""
    source, target = folder / "sample.png", folder / "output.png"
    save(source, sample)
    runs = []
    for seed in peer.seeds:
        target.unlink(missing_ok=True)
        marks = {"{in}": source, "{out}": target, "{size}": size, "{seed}": seed}
        command = []
        for part in peer.command:
            for mark, value in marks.items():
                part = part.replace(mark, str(value))
            command.append(part)
        seconds = child_seconds(command)
        if not target.exists():
            raise InvalidParameter("it ended well but wrote no output")
        output = load(target)
        if min(output.shape[:2]) < size:
            raise InvalidParameter(
                f"its output has {output.shape[1]} x {output.shape[0]} pixels, not {size} x {size}"
            )
        runs.append(Run(seconds, measure_plane(sample, output[:size, :size])))
    return runs


def run_patina(
    sample: F4, *, size: int, seeds: Sequence[int] = SEEDS, parameters: QuiltParameters = PLANE
) -> list[Run]:
    """Quilt a flat grid, warm; the grid is made outside the time, all tables within."""
    dense, field = flat_grid(size)
    picture = sample_of("sample", sample)
    Synthesizer(*flat_grid(64), picture, parameters).run()
    runs = []
    for seed in seeds:
        began = time.process_time()
        quilt = Synthesizer(dense, field, picture, replace(parameters, seed=seed)).run()
        colour = look_up(sample, quilt.source).reshape(size, size, 3)
        seconds = time.process_time() - began
        eight_bits = np.round(colour * 255).astype(np.float32) / np.float32(255)
        runs.append(Run(seconds, measure_plane(sample, eight_bits)))
    return runs


def row(name: str, picture: str, start: float | str, runs: list[Run]) -> tuple[object, ...]:
    """Means over the runs, in the table's order."""
    measures = [run.measures for run in runs]

    def mean(key: str) -> float:
        return float(np.mean([getattr(each, key) for each in measures]))

    return (
        name, picture, len(runs), float(np.mean([run.cpu_s for run in runs])), start,
        mean("patch_nn"), mean("seam"), round(mean("copied_side")), mean("source_use"),
        mean("self_repeat"),
    )  # fmt: skip


def quoted() -> list[tuple[object, ...]]:
    """Rows of figures measured elsewhere; what was not measured is left open."""
    return [
        (f"{name} (quoted, other machine)", picture, "", seconds, "", error, "", side, "", again)
        for name, both in QUOTED.items()
        for picture, (seconds, error, side, again) in zip(("brick", "gravel"), both, strict=True)
    ]


def main(
    *, write: bool, quick: bool, peers: Sequence[str] = (), python: Path | None = None
) -> None:
    """Print the table; `quick` takes a quarter of the area, one seed and no quoted figures.

    `peers` are more programs as "NAME=command {in} {out}"; `python` is the interpreter that has
    the packages of the shipped baselines.
    """
    size = SIDE // 2 if quick else SIDE
    seeds = SEEDS[:1] if quick else SEEDS
    asked = [Peer.of(text) for text in peers]
    samples, origin = pictures()
    rows: list[tuple[object, ...]] = []
    absent = []
    loaded = {
        name: np.asarray(image, np.float32) / np.float32(255) for name, image in samples.items()
    }
    for way, parameters in WAYS.items():
        for name, sample in loaded.items():
            runs = run_patina(sample, size=size, seeds=seeds, parameters=parameters)
            rows.append(row(way, name, "", runs))
    with tempfile.TemporaryDirectory() as folder:
        for peer in [*shipped(str(python or sys.executable)), *asked]:
            try:
                start = child_seconds(peer.start) if peer.start else ""
                for name, sample in loaded.items():
                    runs = run_peer(peer, sample, Path(folder), size=size)
                    rows.append(row(peer.name, name, start, runs))
            except PatinaError as error:
                absent.append(f"{peer.name} ({error})")
    if not quick and origin.startswith("scikit-image"):
        rows += quoted()
    columns = ("peer", "sample", "runs", "CPU s", "start", "patch-NN", "seam", "copied side",
               "use", "self-repeat")  # fmt: skip
    left_out = f"Not here, or failed, and left out: {'; '.join(absent)}." if absent else ""
    parts = ["## Peers on a plane", machine(), markdown(columns, rows), NOTE,
             f"Samples: {origin}.", left_out]  # fmt: skip
    publish("peers", "\n\n".join(part for part in parts if part), write=write)
