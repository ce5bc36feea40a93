"""What an edit wants where: m_0 on demand, and the features that were there before it."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.paint.delta import slots_of
from btfcore.paint.engine import Engine
from btfcore.types import F8, I4

FEATURE = 0.05  # m_S above which a vertex shows something of a feature


class Before:
    """Features of any sample as they were before the running edit wrote anything.

    Ask about vertices before they are written: the first answer is remembered.
    """

    def __init__(self, engine: Engine) -> None:
        """Remember nothing yet."""
        self._engine = engine
        count = len(engine.state.patch)
        self._value = np.zeros(count, np.float32)
        self._seen = np.zeros(count, np.bool_)

    def feature(self, vertices: I4) -> F8:
        """m_S (n,) f8 of what `vertices` showed."""
        fresh = vertices[~self._seen[vertices]]
        if len(fresh):
            state = self._engine.state
            found = self._engine.palette.feature_at(state.sample[fresh], state.source[fresh])
            found = np.where(state.patch[fresh] >= 0, found, np.float32(0.0))
            self._value[fresh] = found
            self._seen[fresh] = True
        return self._value[vertices].astype(np.float64)


def rings(engine: Engine, vertices: I4, count: int) -> I4:
    """`vertices` and those up to `count` edges away, ascending."""
    net = engine.net
    inside = np.zeros(len(net.indptr) - 1, np.bool_)
    inside[vertices] = True
    edge = vertices
    for _ in range(count):
        edge = neighbours(engine, edge)
        edge = edge[~inside[edge]]
        inside[edge] = True
    return np.flatnonzero(inside).astype(np.int32)


def neighbours(engine: Engine, vertices: I4) -> I4:
    """Vertices joined to any of `vertices`, each once, ascending."""
    return np.unique(engine.net.indices[slots_of(engine.net.indptr, vertices)])


def mask_of(engine: Engine, vertices: I4) -> NDArray[np.bool_]:
    """Flags (N,) of `vertices`."""
    flags = np.zeros(len(engine.net.indptr) - 1, np.bool_)
    flags[vertices] = True
    return flags


def foreign_of(engine: Engine) -> NDArray[np.bool_]:
    """Vertices (N,) synthesised from a sample that is no background there."""
    state = engine.state
    if state.layout is None:
        return (state.patch >= 0) & (state.sample != 0)
    allowed = state.layout.allowed
    known = np.minimum(state.sample, len(allowed) - 1)
    own = (state.sample < len(allowed)) & allowed[known, np.arange(len(known))]
    return (state.patch >= 0) & ~own


def orphans(
    engine: Engine,
    before: Before,
    unwanted: NDArray[np.bool_],
    foreign: NDArray[np.bool_],
    reach: int,
) -> I4:
    """Pieces of foreign background that are left without a feature, ascending.

    Connected `foreign` vertices (N,) that touch those that are `unwanted` (N,), show none by half,
    and lie within `reach` edges of them.
    """
    net, stray = engine.net, foreign & ~unwanted
    begin = neighbours(engine, np.flatnonzero(unwanted).astype(np.int32))
    found = edge = begin[stray[begin]]
    seen = mask_of(engine, found)
    for _ in range(reach - 1):
        edge = neighbours(engine, edge)
        edge = edge[stray[edge] & ~seen[edge]]
        if not len(edge):
            break
        seen[edge] = True
        found = np.concatenate([found, edge])
    if not len(found):
        return found
    engine.recorder.reads(neighbours(engine, found))
    engine.recorder.reads(found)
    kept = before.feature(found) > 0.5
    if len(edge):  # reached the end: what goes on beyond is kept
        ahead = neighbours(engine, edge)
        beyond = mask_of(engine, ahead[stray[ahead] & ~seen[ahead]])
        kept |= _touching(net.indptr, net.indices, found, beyond)
    alone = _without(net.indptr, net.indices, found, kept, np.full(len(seen), -1, np.int32))
    return np.sort(found[alone])


@njit(cache=True)
def _touching(indptr, indices, vertices, inside):  # type: ignore[no-untyped-def]
    """Which of `vertices` (n,) have a neighbour `inside` (N,)."""
    found = np.zeros(len(vertices), np.bool_)
    for index in range(len(vertices)):
        for slot in range(indptr[vertices[index]], indptr[vertices[index] + 1]):
            if inside[indices[slot]]:
                found[index] = True
    return found


@njit(cache=True)
def _without(indptr, indices, vertices, marked, local):  # type: ignore[no-untyped-def]
    """Which of `vertices` (n,) are joined to none that is `marked` (n,); local (N,): -1."""
    for index in range(len(vertices)):
        local[vertices[index]] = index
    reached = marked.copy()
    queue = np.empty(len(vertices), np.int32)
    head = tail = 0
    for index in range(len(vertices)):
        if marked[index]:
            queue[tail] = index
            tail += 1
    while head < tail:
        vertex = vertices[queue[head]]
        head += 1
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            other = local[indices[slot]]
            if other >= 0 and not reached[other]:
                reached[other] = True
                queue[tail] = other
                tail += 1
    return ~reached
