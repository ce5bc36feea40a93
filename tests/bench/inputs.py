"""What the benchmarks run on: shipped meshes and samples, and the real ones where present."""

from __future__ import annotations

from pathlib import Path

from btfcore.errors import InvalidParameter
from btfcore.pipeline import load_mesh, load_sample, prepare, synthesizer
from btfcore.quilt.parameters import QuiltParameters
from btfcore.types import Sample
from tests.bench.table import ROOT
from tests.bench.woven import woven_sample

FOLDERS = (ROOT / "resources", ROOT.parent / "shared" / "data")


def find(name: str) -> Path | None:
    """Path of an input by its file name; None where neither folder has it."""
    for folder in FOLDERS:
        for path in sorted(folder.rglob(name)):
            return path
    return None


def present(names: list[str]) -> tuple[list[str], str]:
    """Those of `names` that can be found, and a sentence about the others."""
    there = [name for name in names if find(name) is not None]
    absent = [name for name in names if name not in there]
    if not there:
        raise InvalidParameter(f"none of the benchmark's inputs is here: {', '.join(names)}")
    return there, f"Not here and left out: {', '.join(absent)}." if absent else ""


def quilting_sample(name: str) -> Sample:
    """Return a sample by its file name; "woven" is the baked weave of `tests.bench.woven`."""
    return woven_sample() if name == "woven" else load_sample(found(name))


def warm_up(*, quilting: bool = True) -> None:
    """Compile every kernel on the smallest real work, both ways of quilting included."""
    sample = load_sample(found("brick_red.png"))
    for name in ("sphere.obj", "open_box.obj"):  # boundaries have kernels of their own
        prepared = prepare(load_mesh(found(name))[0], rate=64)
        for literal in (False, True) if quilting else ():
            synthesizer(prepared, sample, QuiltParameters(literal=literal)).run()


def found(name: str) -> Path:
    """Path of an input that must be there."""
    path = find(name)
    if path is None:
        raise InvalidParameter(f"the benchmark's input {name} is not here")
    return path
