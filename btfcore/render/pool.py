"""Work split in slices over threads; what comes out does not depend on how many there are."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import lru_cache

BLOCK = 64  # surfels that a kernel handles at once; slices are whole multiples of it
_SLICES = 4  # a thread: late ones even out what a busy core lost
_LEAST = 16 * BLOCK  # surfels below which a thread costs more than it brings


def threads() -> int:
    """How many threads there can be: the cores that this process may use."""
    try:
        return max(1, len(os.sched_getaffinity(0)))
    except AttributeError:  # not on every system
        return max(1, os.cpu_count() or 1)


@lru_cache
def shared_pool() -> ThreadPoolExecutor | None:
    """Return the threads that all rendering shares, made on first use; None on one core."""
    count = threads()
    return ThreadPoolExecutor(count, thread_name_prefix="render") if count > 1 else None


def in_slices(work: Callable[[int, int], object], count: int, pool: Executor | None) -> None:
    """Call `work(begin, end)` for slices of 0 … count that do not overlap, and wait for all.

    work : lets go of the interpreter's lock where it matters, and writes only what is its own.
    pool : threads to do it, of which the caller must be none; None: the calling thread. What a
    slice raises is raised here.
    """
    if pool is None or count <= _LEAST:
        if count:
            work(0, count)
        return
    step = -(-count // (_SLICES * threads()))
    step = max(_LEAST, -(-step // BLOCK) * BLOCK)
    waiting = [
        pool.submit(work, begin, min(begin + step, count)) for begin in range(0, count, step)
    ]
    for each in waiting:
        each.exception()  # all have ended before one of them may raise
    for each in waiting:
        each.result()
