"""Products, Gram matrices and a small SVD over the kernels, shared out to threads."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.harmonics.kernels import TILE, add_gram, add_product, orthogonalise
from btfcore.types import F8

PART = 32 * TILE


def cores() -> int:
    """Number of processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def shared(pool: ThreadPoolExecutor | None, work: Callable[[int], None], count: int) -> None:
    """Call work(0) … work(count - 1), in any order; the first error is raised."""
    if pool is None or count < 2:
        for number in range(count):
            work(number)
    else:
        for done in [pool.submit(work, number) for number in range(count)]:
            done.result()


def product(
    matrix: F8,
    columns: NDArray[Any],
    *,
    out: F8 | None = None,
    pool: ThreadPoolExecutor | None = None,
) -> F8:
    """Return `matrix` (A, B) f8 times `columns` (B, N) f4 or f8, added to `out` if given."""
    matrix = np.ascontiguousarray(matrix)
    if out is None:
        out = np.zeros((len(matrix), columns.shape[1]))
    total, result = columns.shape[1], out

    def work(part: int) -> None:
        add_product(matrix, columns, result, part * PART, min((part + 1) * PART, total))

    shared(pool, work, -(-total // PART))
    return result


def gram(columns: F8, *, pool: ThreadPoolExecutor | None = None) -> F8:
    """Return Σ c cᵀ (D, D) over the columns c of `columns` (D, N)."""
    size, total = columns.shape
    count = -(-total // PART)
    parts = np.zeros((count, size, size))

    def work(part: int) -> None:
        add_gram(columns, parts[part], part * PART, min((part + 1) * PART, total))

    shared(pool, work, count)
    upper = parts.sum(axis=0)
    return upper + np.triu(upper, 1).T


def svd(matrix: F8) -> tuple[F8, F8, F8]:
    """U (m, n), descending s (n,) and V (n, n) of a small (m, n) matrix = U diag(s) Vᵀ.

    Columns of U that belong to s = 0 are zero. Of every column of V the entry of largest size
    is positive.
    """
    columns = np.ascontiguousarray(matrix.T, np.float64).copy()
    turns = np.eye(len(columns))
    orthogonalise(columns, turns)
    length = np.sqrt((columns * columns).sum(axis=1))
    order = np.argsort(-length, kind="stable")
    columns, turns, length = columns[order], turns[order], length[order]
    largest = np.abs(turns).argmax(axis=1)
    sign = np.where(turns[np.arange(len(turns)), largest] < 0, -1.0, 1.0)
    safe = np.where(length > 0, length, 1)
    return (columns * (sign / safe)[:, None]).T.copy(), length, (turns * sign[:, None]).T.copy()
