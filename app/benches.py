"""Door to the benchmarks, which live beside the tests of a source checkout."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

from btfcore.errors import InvalidParameter

STAGES = (
    "dense", "quilt", "growth", "shortcuts", "mapping", "peers", "bake", "factorize", "harmonics",
    "interpolation", "paint", "render",
)  # fmt: skip


def run_bench(stage: str, *, write: bool, quick: bool, **options: Any) -> None:
    """Run ``tests.bench.STAGE``; raises `InvalidParameter` for a stage that is not there.

    `options` are those of one stage alone; others refuse them where they are set.
    """
    if stage not in STAGES:
        raise InvalidParameter(f"no benchmark {stage!r}; there are {', '.join(STAGES)}")
    options = {name: value for name, value in options.items() if value}
    if options and stage != "peers":
        raise InvalidParameter(f"benchmark {stage!r} knows no option {', '.join(sorted(options))}")
    root = Path(__file__).resolve().parent.parent
    if not (root / "tests" / "bench").is_dir():
        raise InvalidParameter(
            "benchmarks need a source checkout: the installed package has no tests/bench"
        )
    sys.path.insert(0, str(root))
    importlib.import_module(f"tests.bench.{stage}").main(write=write, quick=quick, **options)
