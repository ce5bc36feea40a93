"""Linear algebra on one thread: what OpenBLAS rounds depends on how many it shares work among."""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Callable, Iterator
from functools import cache

import numpy as np

# as numpy's own wheels call them, and as distributions do
_NAMES = (
    "scipy_openblas_{}_num_threads64_",
    "scipy_openblas_{}_num_threads",
    "openblas_{}_num_threads64_",
    "openblas_{}_num_threads",
)


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Let numpy's OpenBLAS use one thread within the block; other libraries are left alone.

    The setting is that of the process: work of other threads is slower meanwhile, no more.
    """
    door = _door()
    if door is None:
        yield
        return
    read, write = door
    before = read()
    write(1)
    try:
        yield
    finally:
        write(before)


@cache
def _door() -> tuple[Callable[[], int], Callable[[int], None]] | None:
    """OpenBLAS' functions that tell and set the number of threads, None where there are none."""
    try:
        # looks into the libraries that numpy itself is linked with
        library = ctypes.CDLL(np._core._multiarray_umath.__file__)  # type: ignore[attr-defined]
    except (AttributeError, OSError):
        return None
    for name in _NAMES:
        try:
            return library[name.format("get")], library[name.format("set")]
        except AttributeError:
            continue
    return None
