"""Wall time, CPU time and peak memory of each phase of a run, children included."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypedDict


class PhaseFigures(TypedDict):
    """Seconds on the clock, seconds of CPU (children included), peak resident MiB."""

    wall_s: float
    cpu_s: float
    peak_mb: float


class PhaseClock:
    """Collects the figures of named phases; a phase entered twice adds up."""

    def __init__(self) -> None:
        """Start with no phase."""
        self.figures: dict[str, PhaseFigures] = {}

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Measure what runs inside."""
        _reset_peak()
        wall, cpu = time.perf_counter(), _cpu_seconds()
        try:
            yield
        finally:
            before = self.figures.get(name, PhaseFigures(wall_s=0.0, cpu_s=0.0, peak_mb=0.0))
            self.figures[name] = PhaseFigures(
                wall_s=round(before["wall_s"] + time.perf_counter() - wall, 4),
                cpu_s=round(before["cpu_s"] + _cpu_seconds() - cpu, 4),
                peak_mb=round(max(before["peak_mb"], _peak_mb()), 1),
            )


def _cpu_seconds() -> float:
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _reset_peak() -> None:
    """Let Linux count the peak anew; elsewhere the peak is that of the whole run so far."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        pass


def _peak_mb() -> float:
    try:
        for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024
    except OSError:
        pass
    try:
        import resource
    except ImportError:  # Windows
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1024 if sys.platform != "darwin" else 1024 * 1024)
