"""Sums of rows in vector registers against plain numpy, and slices of work."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numba import njit

from btfcore.render.pool import BLOCK, in_slices, shared_pool, threads
from btfcore.render.rows import LANES, aligned, blend, blend_more, blend_plain, dot, locked, padded
from btfcore.types import F4


@njit
def _three(table, starts, shares, out, begin, width):  # type: ignore[no-untyped-def]
    blend(
        table, (starts[0], starts[1], starts[2]), (shares[0], shares[1], shares[2]), out, begin,
        width,
    )  # fmt: skip


@njit
def _more(table, start, share, out, begin, width):  # type: ignore[no-untyped-def]
    blend_more(table, (start,), (share,), out, begin, width)


@njit
def _product(one, first, two, second, width):  # type: ignore[no-untyped-def]
    return dot(one, first, two, second, width)


@pytest.mark.parametrize("width", [0, 8, 24, 128])
def test_blended_rows_are_the_weighted_sum(width: int) -> None:
    rng = np.random.default_rng(width)
    table = rng.normal(size=1000).astype(np.float32)
    starts, shares = np.array([3, 500, 8]), rng.random(3, dtype=np.float32)
    out: F4 = np.full(width + 20, 7, np.float32)
    _three(table, starts, shares, out, 5, width)
    wanted = blend_plain(table, starts, shares, width)
    assert np.allclose(out[5 : 5 + width], wanted, atol=1e-6)
    _more(table, 40, shares[0], out, 5, width)
    wanted += blend_plain(table, np.array([40]), shares[:1], width)
    assert np.allclose(out[5 : 5 + width], wanted, atol=1e-6)
    assert (out[:5] == 7).all()
    assert (out[5 + width :] == 7).all()


@pytest.mark.parametrize("width", [0, 8, 40])
def test_dots_are_the_sum_of_products(width: int) -> None:
    rng = np.random.default_rng(width)
    one, two = rng.normal(size=(2, 100)).astype(np.float32)
    found = _product(one, 3, two, 17, width)
    wanted = (one[3 : 3 + width].astype(np.float64) * two[17 : 17 + width]).sum()
    assert abs(found - wanted) < 1e-5


def test_rows_are_whole_vectors_on_lines_of_the_cache() -> None:
    assert [padded(n) for n in (0, 1, LANES, LANES + 1)] == [0, LANES, LANES, 2 * LANES]
    for shape in ((3,), (5, 8), (0,)):
        room = aligned(shape)
        assert room.shape == shape
        assert not room.any()
    assert aligned((100,)).ctypes.data % 64 == 0
    assert not locked(aligned((3,))).flags.writeable


@pytest.mark.parametrize("count", [0, 1, BLOCK, 16 * BLOCK + 1, 100_000])
def test_slices_cover_everything_once(count: int) -> None:
    done = np.zeros(count, np.int64)

    def work(begin: int, end: int) -> None:
        assert begin % BLOCK == 0
        done[begin:end] += 1

    in_slices(work, count, None)
    with ThreadPoolExecutor(3) as pool:
        in_slices(work, count, pool)
    assert (done == 2).all()


def test_an_error_of_a_slice_comes_out_when_all_have_ended() -> None:
    ended = []

    def work(begin: int, end: int) -> None:
        ended.append(begin)
        if begin == 0:
            raise ValueError("no")

    with ThreadPoolExecutor(2) as pool, pytest.raises(ValueError, match="no"):
        in_slices(work, 100_000, pool)
    assert len(ended) > 1


def test_the_shared_pool_is_one_and_the_same() -> None:
    assert shared_pool() is shared_pool()
    assert (shared_pool() is None) == (threads() == 1)
