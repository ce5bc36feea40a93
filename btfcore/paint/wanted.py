"""What an edit wants where: m_0 on demand, and the features that were there before it."""

from __future__ import annotations

import numpy as np
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
