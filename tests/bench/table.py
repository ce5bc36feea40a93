"""Tables of figures, the machine that they come from, and the page that keeps them."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Sequence
from datetime import date
from pathlib import Path
from typing import Any

from btfcore.report import versions

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "benchmarks.md"
HEAD = """# Benchmarks

Written by `make bench ARGS=--write`, never by hand. Every figure is from one warm run (a small
run before it has compiled the kernels). Wall seconds depend on what else the machine does; CPU
seconds, child processes included, do so less.
"""


def markdown(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Lay out a Markdown table, padded so that it can be read as plain text too."""
    cells = [list(columns), *([_text(value) for value in row] for row in rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(columns))]

    def line(row: Sequence[str]) -> str:
        first = row[0].ljust(widths[0])
        rest = (value.rjust(width) for value, width in zip(row[1:], widths[1:], strict=True))
        return "| " + " | ".join([first, *rest]) + " |"

    rule = ["-" * widths[0], *("-" * (width - 1) + ":" for width in widths[1:])]
    return "\n".join([line(cells[0]), line(rule), *(line(row) for row in cells[1:])])


def _text(value: Any) -> str:
    """Whole numbers with thousands separated, others with three significant digits."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, float):
        return f"{value:.1e}" if 0 < abs(value) < 5e-4 else f"{value:.3g}"
    return str(value)


def machine() -> str:
    """One line about processor, memory and versions."""
    name = platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
        name = models[0] if models else name
    except OSError:  # no such file but on Linux
        pass
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    found = versions()
    of = ", ".join(f"{key} {found[key]}" for key in ("numpy", "scipy", "numba", "xatlas"))
    system = f"{platform.system()}, Python {found['python']}, Patina {found['patina']}, {of}"
    return f"{name}, {cores} cores, {system}; {date.today().isoformat()}."


def publish(stage: str, text: str, *, write: bool) -> None:
    """Print a stage's section; with `write` also put it in its place in docs/benchmarks.md."""
    print(text)
    if not write:
        return
    start, stop = f"<!-- {stage}: begin -->", f"<!-- {stage}: end -->"
    page = PAGE.read_text(encoding="utf-8") if PAGE.exists() else HEAD
    if start not in page:
        page += f"\n{start}\n{stop}\n"
    before, rest = page.split(start, 1)
    after = rest.split(stop, 1)[1]
    PAGE.parent.mkdir(exist_ok=True)
    PAGE.write_text(f"{before}{start}\n{text}\n{stop}{after}", encoding="utf-8")
    print(f"\nwritten to {PAGE.relative_to(ROOT)}")
