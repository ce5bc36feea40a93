"""`make fuzz`: damaged sample files of every kind; each ends in a sample or a named error.

Usage: fuzz.py [--mutants N] [--seed S]. Each format gets an equal share; the run prints what it
found and fails when anything but a named error was raised or a mutant took over ten seconds.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

SLOW_S = 10.0
ENDLESS = 10**9


@dataclass
class Format:
    """A kind of file: its mutants, one after another, and the check of one of them."""

    name: str
    suffix: str
    mutants: Iterator[bytes]
    check: Callable[[bytes], bool]


def packages(folder: Path, seed: int) -> Iterator[Format]:
    """Our own packages, factorised and raw."""
    from tests.files.package import mutate

    path = folder / "mutant.btfz"

    def check(data: bytes) -> bool:
        path.write_bytes(data)
        return mutate.check(path)

    for kind, data in zip(("factors", "images"), mutate.originals(folder), strict=True):
        yield Format(f"package of {kind}", ".btfz", mutate.mutants(data, ENDLESS, seed), check)


def bonn(seed: int) -> Iterator[Format]:
    """DFMF, FMF, PVF and BDI in all their forms."""
    from tests.btf.bonn import mutate

    files = (data for _, data in mutate.mutants(seed, ENDLESS))
    yield Format("Bonn binaries", ".btf", files, lambda data: mutate.check(data) is not None)


def readers(folder: Path, seed: int) -> Iterator[Format]:
    """Zips, tables of directions, PTM files and their companions."""
    from tests.btf.readers import mutate

    for kind, data in mutate.seeds().items():
        check = partial(mutate.check, kind, folder=folder)
        yield Format(kind, f".{kind}", mutate.mutants(data, ENDLESS, seed), check)


def run(formats: list[Format], count: int) -> int:
    """Check `count` mutants, an equal share of each format; returns the number of faults."""
    faults = 0
    for form in formats:
        share, sound, slowest = -(-count // len(formats)), 0, 0.0
        for number, data in enumerate(islice(form.mutants, share)):
            start = time.perf_counter()
            try:
                sound += form.check(data)
                fault = ""
            except Exception:  # anything that is no named error is what we look for
                fault = traceback.format_exc()
            spent = time.perf_counter() - start
            slowest = max(slowest, spent)
            if spent > SLOW_S:
                fault += f"took {spent:.1f} s\n"
            if fault:
                faults += 1
                kept = Path(tempfile.gettempdir()) / f"fault-{faults}{form.suffix}"
                kept.write_bytes(data)
                print(f"FAULT in {form.name}, mutant {number}, kept as {kept}\n{fault}")
        print(
            f"{form.name:<20} {share:>6,} mutants, {sound:>6,} still a sample, slowest"
            f" {slowest * 1000:.0f} ms"
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{faults} faults; peak memory of the process {peak:.0f} MiB")
    return faults


def main() -> int:
    """Run over all formats; the exit status is 1 where there were faults."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=12_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="patina-fuzz-") as name:
        folder = Path(name)
        seed = options.seed
        formats = [*packages(folder, seed), *bonn(seed), *readers(folder, seed)]
        return int(run(formats, options.mutants) > 0)


if __name__ == "__main__":
    raise SystemExit(main())
