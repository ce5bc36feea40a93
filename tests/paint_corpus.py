"""Paints on every mesh of the data folder and of the library: all kinds of edits, then undo.

``python tests/paint_corpus.py [--rate 128] [--only WORD]``: a row per mesh on stdout, exit
status 1 where an edit crashed, raised the energy, left a bare or infinite value, changed a vertex
that it did not claim, or where a replay or undo gave other bits.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from btfcore.errors import PatinaError  # noqa: E402 - after the path is set
from btfcore.paint.document import Document  # noqa: E402
from btfcore.paint.edits import (  # noqa: E402
    AnyEdit,
    Area,
    EraseEdit,
    PaintEdit,
    RepairEdit,
    RequiltEdit,
    StampEdit,
    Stroke,
    Symmetry,
    kind_of,
)
from btfcore.paint.engine import Engine  # noqa: E402
from btfcore.pipeline import load_mesh, prepare, synthesizer  # noqa: E402
from btfcore.quilt.parameters import QuiltParameters  # noqa: E402
from btfcore.types import Mesh, Sample  # noqa: E402

DATA = ROOT.parent / "shared" / "data" / "meshes"
SHIPPED = ROOT / "resources" / "meshes"
SAMPLES = ("cracked-brick.btfz", "mossy-stone.btfz")
NEVER_RISES = ("paint", "requilt")  # kinds whose energy is E alone, nothing being forced
ROUNDING = 1e-6


def edits_on(document: Document, seed: int = 1) -> Iterator[AnyEdit]:
    """One edit of each kind at random places, from much smaller to larger than the patches."""
    engine = document.engine
    vertices = document.prepared.dense.vertices
    normals = np.asarray(document.prepared.dense.normals, np.float64)
    random = np.random.default_rng(seed)
    for number in range(6):
        at = int(random.integers(len(vertices)))
        along = random.normal(size=3)
        along -= normals[at] * float((along * normals[at]).sum())
        along /= np.linalg.norm(along) + 1e-9
        length = random.uniform(0.05, 0.4) * document.prepared.mesh.diagonal
        points = vertices[at] + np.linspace(0, length, 12)[:, None] * along
        area = Area(strokes=(Stroke(points, engine.step * random.uniform(0.3, 14)),))
        mirrored = Symmetry(mirror=("", "x", "xyz")[number % 3], radial=(1, 3)[number % 2])
        place = (float(points[0, 0]), float(points[0, 1]), float(points[0, 2]))
        scale = float(random.uniform(0.4, 2))
        yield (
            PaintEdit(area=area, sample=0, symmetry=mirrored),
            StampEdit(point=place, sample=0, rotation=30.0, scale=scale, symmetry=mirrored),
            EraseEdit(area=area),
            RepairEdit(area=area, seed=number),
            RequiltEdit(area=Area(everywhere=True)),
            PaintEdit(
                area=Area(everywhere=True) if len(vertices) < 8000 else area,
                sample=0,
                orientation="stroke",
            ),
        )[number]


def faults_of(document: Document, edit: AnyEdit) -> list[str]:
    """Make an edit; what is wrong with what it did. A named error must leave no trace."""
    engine = document.engine
    before = engine.copy()
    try:
        document.add(edit)
    except PatinaError:
        changed = len(engine.differences(before))
        return [f"{changed} vertices changed by an edit that failed"] if changed else []
    result = document.layers[-1].result
    assert result is not None
    report, state = result.report, engine.state
    found = []
    strays = np.setdiff1d(engine.differences(before), result.delta.vertices)
    if len(strays):
        found.append(f"{len(strays)} vertices changed that it does not claim")
    old = report.weight * report.constraint_before + report.smooth_before
    new = report.weight * report.constraint + report.smooth
    if not np.isfinite([old, new]).all():
        found.append(f"energies {old} and {new}")
    if kind_of(edit) in NEVER_RISES and new > old * (1 + ROUNDING) + ROUNDING:
        found.append(f"its energy rose from {old:.6g} to {new:.6g}")
    if ((state.patch < 0) & (before.patch >= 0)).any():
        found.append("it left bare vertices")
    if not (np.isfinite(state.source).all() and np.isfinite(state.ghost).all()):
        found.append("it left positions that are not finite")
    return found


def painted(mesh: Mesh, sample: Sample, rate: int) -> list[str]:
    """Make all edits on a mesh, replay and undo them; what went wrong."""
    prepared = prepare(mesh, rate=rate)
    made = synthesizer(prepared, sample, QuiltParameters(features=False))
    made.run()
    document = Document(Engine.over(prepared, [sample], made))
    background = document.engine.copy()
    found = []
    for edit in edits_on(document):
        found += [f"{kind_of(edit)}: {fault}" for fault in faults_of(document, edit)]
    if len(document.replay()):
        found.append("a replay gave other bits")
    while document.undo_label:
        document.undo()
    if len(document.engine.differences(background)):
        found.append("undo did not give the background back")
    return found


def main() -> int:
    """Paint on everything and return the exit status."""
    from btfcore.btf.joint import common_channels
    from btfcore.samples import load_paint_sample

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rate", type=int, default=128)
    parser.add_argument("--only", default="", help="meshes whose name holds this word")
    chosen = parser.parse_args()
    folder = ROOT / "resources" / "samples"
    samples = [common_channels([load_paint_sample(folder / name)[0]])[0][0] for name in SAMPLES]
    count = wrong = 0
    for path in [*sorted(DATA.glob("*")), *sorted(SHIPPED.glob("*.obj"))]:
        if chosen.only not in path.name:
            continue
        try:
            mesh, _ = load_mesh(path)
        except PatinaError:
            continue  # `tests/corpus.py` looks at these
        for sample in samples:
            began = time.monotonic()
            try:
                found = painted(mesh, sample, chosen.rate)
            except PatinaError as error:
                found = [] if len(mesh.faces) < 2 else [f"cannot be painted on: {error}"]
            except Exception as error:  # a crash is a fault of one mesh, not of the others
                found = [f"{type(error).__name__}: {error}"]
            count += 1
            wrong += bool(found)
            seconds = time.monotonic() - began
            row = f"{path.name:26} {sample.name:14} {seconds:6.1f} s  {'; '.join(found) or 'ok'}"
            sys.stdout.write(row + "\n")
            sys.stdout.flush()
    sys.stdout.write(f"{count} paintings, {wrong} at fault\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
