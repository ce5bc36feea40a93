"""Runs the command line on every mesh of the data folder and on many bad inputs.

``python tests/corpus.py [--rate 256] [--limit 120] [--only WORD]``: one process per input, a
table on stdout, exit status 1 where a run crashed, hung, gave a NaN, an unnamed error, an
invalid result, or left a file behind that it should not have.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from btfcore.mesh.topology import is_manifold  # noqa: E402 - after the path is set
from tests.bad_inputs import EITHER, NAMED, RESULT, bad_images, bad_meshes, sphere_obj  # noqa: E402

DATA = ROOT.parent / "shared" / "data"
HEAD = ("input", "outcome", "s", "closed", "Euler", "mean dist", "max dist", "covered")
WIDTHS = (26, 13, 6, 12, 12, 9, 9, 8)


@dataclass
class Row:
    """Outcome of one run; `faults` is empty where all is well."""

    name: str
    outcome: str
    seconds: float
    cells: tuple[str, ...] = ()
    remark: str = ""
    faults: list[str] = field(default_factory=list)


def main() -> int:
    """Run everything and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rate", type=int, default=256)
    parser.add_argument("--limit", type=float, default=120, help="seconds per input")
    parser.add_argument("--only", default="", help="run inputs whose name holds this word")
    parser.add_argument("--made", action="store_true", help="leave the data folder out")
    chosen = parser.parse_args()
    rows: list[Row] = []
    with tempfile.TemporaryDirectory(prefix="patina-corpus-") as name:
        write_row(HEAD)
        for row in runs(Path(name), chosen):
            rows.append(row)
            show(row)
    faulty = [row for row in rows if row.faults]
    say(f"\n{len(rows)} inputs, {len(faulty)} at fault")
    return 1 if faulty or not rows else 0


def runs(scratch: Path, chosen: argparse.Namespace) -> Iterator[Row]:
    """Every run of the corpus in turn."""
    rate, limit, only = chosen.rate, chosen.limit, chosen.only
    sample, ball = scratch / "sample.png", scratch / "ball.obj"
    write_sample(sample)
    ball.write_text(sphere_obj())
    if DATA.is_dir() and not chosen.made:
        real = DATA / "textures" / "brick_gray512.png"
        for mesh in sorted((DATA / "meshes").iterdir()):
            if only in mesh.name:
                yield run(mesh.name, mesh, real, scratch, EITHER, rate, limit)
    elif not chosen.made:
        say("the folder of real inputs, ../shared/data, is not here: only made inputs run")
    for name, (mesh, ending) in bad_meshes(scratch / "meshes").items():
        if only in name:
            yield run(name, mesh, sample, scratch, ending, 64, limit)
    for name, (image, ending) in bad_images(scratch / "images").items():
        if only in name:
            yield run(name, ball, image, scratch, ending, 64, limit)
    for name, folder, output in unwritable(scratch):
        with folder as place:
            if only not in name:
                continue
            if place is None:
                say(f"{name:26} left out: the rights to try it are missing")
                continue
            before = sorted(os.listdir(place))
            row = run(name, ball, sample, scratch, NAMED, 128, limit, output=place / output)
            if sorted(os.listdir(place)) != before:
                row.faults.append(f"left behind {sorted(set(os.listdir(place)) - set(before))}")
            yield row


def run(
    name: str,
    mesh: Path,
    sample: Path,
    scratch: Path,
    ending: str,
    rate: int,
    limit: float,
    *,
    output: Path | None = None,
) -> Row:
    """Decorate `mesh` with `sample` in a process of its own and judge how it ends."""
    work = scratch / "run"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    target = output if output is not None else work / "out.glb"
    command = [sys.executable, "-m", "app", "decorate", str(mesh), str(sample), "-q"]
    command += ["-o", str(target), "--rate", str(rate), "--report", str(work / "report.json")]
    command += ["--save-quilt", str(work / "quilt.npz")]
    start = time.monotonic()
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        return Row(name, "HANG", limit, faults=[f"ran longer than {limit:g} s"])
    seconds = time.monotonic() - start
    said = done.stderr.decode("utf-8", "replace").strip()
    last = said.splitlines()[-1] if said else ""
    if done.returncode == 2 and last.startswith("patina: ") and "Traceback" not in said:
        row = Row(name, "named error", seconds, remark=last.removeprefix("patina: "))
        if output is None and sorted(path.name for path in work.iterdir()):
            row.faults.append("left files behind")
        if ending == RESULT:
            row.faults.append("a result was due")
        return row
    if done.returncode != 0:
        return Row(name, "CRASH", seconds, faults=[f"exit status {done.returncode}: {last}"])
    row = Row(name, "result", seconds)
    if ending == NAMED:
        row.faults.append("a named error was due")
    judge(row, target, work)
    return row


def judge(row: Row, target: Path, work: Path) -> None:
    """Check what a successful run wrote."""
    try:
        check_glb(target)
        report = json.loads((work / "report.json").read_text(), parse_constant=refuse_constant)
        with np.load(work / "quilt.npz") as stored:
            quilt = {key: stored[key] for key in stored.files}
    except (OSError, ValueError, KeyError, struct.error) as error:
        row.faults.append(f"{type(error).__name__}: {error}")
        return
    before, after = report["input"], report["dense"]
    covered = float((quilt["patch"] >= 0).mean())
    for key, values in quilt.items():
        if not np.isfinite(values).all():
            row.faults.append(f"{key} is not finite")
    if not is_manifold(quilt["faces"]):
        row.faults.append("the dense mesh is not manifold")
    # what repair took apart may hold pieces smaller than a texel, which may merge or vanish
    apart = any("taken apart" in note for note in before["notes"])
    if not apart and before["boundary_loops"] != after["boundary_loops"]:
        row.faults.append(f"boundary loops {before['boundary_loops']} → {after['boundary_loops']}")
    if not apart and before["euler"] != after["euler"]:
        row.faults.append(f"Euler number {before['euler']} → {after['euler']}")
    if covered < 1:
        row.faults.append(f"only {covered:.2%} covered")
    loops = after["boundary_loops"]
    row.cells = (
        "yes" if not loops else f"{loops} loops",
        f"{before['euler']} → {after['euler']}",
        f"{after['distance_mean']:.1e}",
        f"{after['distance_max']:.1e}",
        f"{covered:.1%}",
    )
    row.remark = "; ".join(before["notes"])


def check_glb(path: Path) -> None:
    """Whole container, strict JSON, finite positions."""
    data = path.read_bytes()
    magic, _, length, chunk = struct.unpack("<4sIII", data[:16])
    if magic != b"glTF" or length != len(data):
        raise ValueError(f"the GLB file has {len(data)} bytes and claims {length}")
    header = json.loads(data[20 : 20 + chunk], parse_constant=refuse_constant)
    views = header["bufferViews"]
    for primitive in header["meshes"][0]["primitives"]:
        accessor = header["accessors"][primitive["attributes"]["POSITION"]]
        offset = 28 + chunk + views[accessor["bufferView"]].get("byteOffset", 0)
        positions = np.frombuffer(data, "<f4", 3 * accessor["count"], offset)
        if not np.isfinite(positions).all():
            raise ValueError("positions are not finite")


def refuse_constant(word: str) -> Any:
    """NaN and infinities are no JSON."""
    raise ValueError(f"{word} in JSON")


@contextlib.contextmanager
def read_only(folder: Path) -> Iterator[Path | None]:
    """A folder nobody may write in; None for root, who may everywhere."""
    folder.mkdir()
    folder.chmod(0o500)
    try:
        yield None if os.access(folder, os.W_OK) else folder
    finally:
        folder.chmod(0o700)


@contextlib.contextmanager
def tiny_disk(folder: Path) -> Iterator[Path | None]:
    """A file system of 16 KiB; None where it cannot be mounted."""
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", str(folder)]
    try:
        mounted = subprocess.run(command, capture_output=True, check=False).returncode == 0
    except OSError:
        mounted = False
    try:
        yield folder if mounted else None
    finally:
        if mounted:
            subprocess.run(["umount", str(folder)], check=True)


def unwritable(scratch: Path) -> Iterator[tuple[str, Any, str]]:
    """Places where nothing can be written: name, folder as a context, output within it."""
    (scratch / "taken" / "out.glb").mkdir(parents=True)
    yield "output is a folder", contextlib.nullcontext(scratch / "taken"), "out.glb"
    yield "output in no folder", contextlib.nullcontext(scratch / "taken"), "missing/out.glb"
    yield "output of unknown kind", contextlib.nullcontext(scratch / "taken"), "out.fbx"
    yield "output not permitted", read_only(scratch / "closed"), "out.glb"
    yield "disk full during export", tiny_disk(scratch / "tiny"), "out.glb"


def write_sample(path: Path) -> None:
    """A small irregular texture."""
    from PIL import Image

    noise = np.random.default_rng(7).random((96, 96, 3))
    for axis in (0, 1):
        noise = sum(np.roll(noise, shift, axis) for shift in range(6)) / 6
    span = noise.max() - noise.min()
    Image.fromarray(((noise - noise.min()) / span * 255).astype(np.uint8)).save(path)


def show(row: Row) -> None:
    """Print one outcome: its figures, then what was said, then what is wrong."""
    cells = row.cells or ("",) * 5
    write_row((row.name, row.outcome, f"{row.seconds:.1f}", *cells))
    if row.remark:
        say(f"    {row.remark[:160]}")
    for fault in row.faults:
        say(f"  ✗ {fault}")


def write_row(cells: tuple[str, ...]) -> None:
    """One line of the table."""
    pairs = zip(cells, WIDTHS, strict=True)
    say("  ".join(f"{cell:{width}}" for cell, width in pairs).rstrip())


def say(text: str) -> None:
    """Write a line at once, also into a pipe."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    raise SystemExit(main())
