"""A hash table that counts undirected edges, for numba kernels."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.types import I4, I8

_EMPTY = -1


@njit(cache=True)
def new_table(expected: int) -> tuple[I8, I4]:
    """Keys and counts with room for `expected` distinct edges."""
    room = 16
    while room < 3 * expected:
        room *= 2
    return np.full(room, _EMPTY, np.int64), np.zeros(room, np.int32)


@njit(cache=True)
def _mixed(key: np.int64) -> np.int64:
    """Spread a key's bits (the odd constant nearest to 2**64 over the golden ratio)."""
    mixed = key * np.int64(-7046029254386353131)
    return mixed ^ (mixed >> np.int64(29))


@njit(cache=True)
def _slot(keys: I8, one: int, other: int) -> np.int64:
    low, high = (one, other) if one < other else (other, one)
    key = (np.int64(low) << 32) | np.int64(high)
    slot = _mixed(key) & (len(keys) - 1)
    while keys[slot] != _EMPTY and keys[slot] != key:
        slot = (slot + 1) & (len(keys) - 1)
    if keys[slot] == _EMPTY:
        keys[slot] = key
    return slot


@njit(cache=True)
def count_edge(keys: I8, counts: I4, one: int, other: int, change: int) -> None:
    """Add `change` to an edge's count."""
    counts[_slot(keys, one, other)] += change


@njit(cache=True)
def edge_count(keys: I8, counts: I4, one: int, other: int) -> int:
    """How often an edge was counted."""
    low, high = (one, other) if one < other else (other, one)
    key = (np.int64(low) << 32) | np.int64(high)
    slot = _mixed(key) & (len(keys) - 1)
    while keys[slot] != _EMPTY:
        if keys[slot] == key:
            return int(counts[slot])
        slot = (slot + 1) & (len(keys) - 1)
    return 0
