"""Work on all cores whose result does not depend on how many there are."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from btfcore.progress import Progress, silent

Item = TypeVar("Item")


def spread(
    task: Callable[[Item], None],
    items: Sequence[Item],
    *,
    threads: int,
    progress: Progress = silent,
    label: str = "",
) -> None:
    """Call `task` with every item, each of which writes what no other reads or writes.

    What a task raises is raised here; that, and an exception from `progress`, leaves out the
    items that were not begun.
    """
    pool = ThreadPoolExecutor(threads)
    try:
        for done, _ in enumerate(pool.map(task, items), start=1):
            progress(done / len(items), label)
    finally:
        pool.shutdown(cancel_futures=True)


def cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
