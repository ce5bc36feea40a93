"""What an edit changed and what it read: the unit of undo, of hiding and of replay.

A delta can be taken back and put on again without computing anything, as long as the vertices
that its edit read were last written by the same deltas as when it was computed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.patch.connectivity import Connectivity
from btfcore.quilt.state import QuiltState
from btfcore.types import F4, I4, U2, Frozen


@dataclass(frozen=True, eq=False)
class Values(Frozen):
    """The quilt at some vertices: source (n, 2), angle, sample, patch (n,), ghost (m, 2).

    ghost has the half-edges that leave the vertices, row by row.
    """

    source: F4
    angle: F4
    sample: U2
    patch: I4
    ghost: F4

    @property
    def nbytes(self) -> int:
        """Memory held."""
        return sum(
            each.nbytes for each in (self.source, self.angle, self.sample, self.patch, self.ghost)
        )


@dataclass(frozen=True, eq=False)
class Delta(Frozen):
    """Change of one edit.

    vertices (n,) i4, ascending: those written; before, after: their values; writers (n,) i4:
    tokens of the deltas that wrote them last before this one; reads (r,) i4, ascending: all
    vertices that the edit looked at, and read_writers (r,) i4 who had written those; wanted
    (r,) f4: the constraint m_0 at the vertices looked at; token: this delta's own.
    """

    vertices: I4
    before: Values
    after: Values
    writers: I4
    reads: I4
    read_writers: I4
    wanted: F4
    token: int

    def fits(self, writer: I4) -> bool:
        """Whether computing the edit on a quilt written by `writer` (N,) would give this delta."""
        return bool(np.array_equal(writer[self.reads], self.read_writers))

    def put_on(self, net: Connectivity, state: QuiltState, writer: I4) -> None:
        """Write the new values."""
        put(net, state, self.vertices, self.after)
        writer[self.vertices] = self.token

    def take_off(self, net: Connectivity, state: QuiltState, writer: I4) -> None:
        """Write the old values back; every bit is as it was."""
        put(net, state, self.vertices, self.before)
        writer[self.vertices] = self.writers

    @property
    def nbytes(self) -> int:
        """Memory held."""
        arrays = (self.vertices, self.writers, self.reads, self.read_writers, self.wanted)
        return sum(each.nbytes for each in arrays) + self.before.nbytes + self.after.nbytes


class Recorder:
    """Notes what an edit reads and writes while it is computed."""

    def __init__(self, net: Connectivity, state: QuiltState, writer: I4) -> None:
        """Begin with nothing noted."""
        self._net, self._state, self._writer = net, state, writer
        count = len(state.patch)
        self._read, self._written = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
        self._reads: list[I4] = []
        self._kept: list[tuple[I4, Values]] = []

    def reads(self, vertices: I4) -> None:
        """Note that `vertices` were looked at."""
        fresh = _new(vertices, self._read)
        if len(fresh):
            self._reads.append(fresh)

    def writes(self, vertices: I4) -> None:
        """Keep the values of `vertices`, which are about to be written."""
        self.reads(vertices)
        fresh = _new(vertices, self._written)
        if len(fresh):
            self._kept.append((fresh, values_of(self._net, self._state, fresh)))

    def written(self, vertices: I4) -> NDArray[np.bool_]:
        """Which of `vertices` (n,) the edit has written."""
        return self._written[vertices]

    @property
    def changed(self) -> I4:
        """Vertices written so far, in no order."""
        return np.concatenate([np.zeros(0, np.int32), *(part for part, _ in self._kept)])

    @property
    def looked(self) -> I4:
        """Vertices looked at so far, ascending."""
        return np.sort(np.concatenate([np.zeros(0, np.int32), *self._reads]))

    def undo(self) -> None:
        """Write all old values back."""
        for vertices, values in self._kept:
            put(self._net, self._state, vertices, values)
        self._kept.clear()
        self._written[:] = False

    def finish(self, token: int, wanted: F4 | None = None) -> Delta:
        """Return what was noted; vertices whose values are what they were are left out.

        wanted (r,): m_0 at the vertices `looked`; None: 0.
        """
        net, state, writer = self._net, self._state, self._writer
        changed = self.changed
        at = np.argsort(changed, kind="stable")
        vertices = changed[at]
        before = _gathered(net.indptr, self._kept, vertices, at)
        after = values_of(net, state, vertices)
        stay = _same(net.indptr, vertices, before, after)
        if stay.any():
            vertices, before, after = (
                vertices[~stay],
                _part(net.indptr, vertices, before, ~stay),
                _part(net.indptr, vertices, after, ~stay),
            )
        reads = self.looked
        writers, read_writers = writer[vertices], writer[reads]
        writer[vertices] = token
        wanted = np.zeros(len(reads), np.float32) if wanted is None else wanted
        return Delta(vertices, before, after, writers, reads, read_writers, wanted, token)


def values_of(net: Connectivity, state: QuiltState, vertices: I4) -> Values:
    """Copy of the quilt at `vertices` (n,)."""
    ghost = state.ghost[slots_of(net.indptr, vertices)]
    return Values(
        state.source[vertices], state.angle[vertices], state.sample[vertices],
        state.patch[vertices], ghost,
    )  # fmt: skip


def put(net: Connectivity, state: QuiltState, vertices: I4, values: Values) -> None:
    """Write `values` at `vertices`."""
    state.source[vertices], state.angle[vertices] = values.source, values.angle
    state.sample[vertices], state.patch[vertices] = values.sample, values.patch
    state.ghost[slots_of(net.indptr, vertices)] = values.ghost


@njit(cache=True)
def slots_of(indptr: I4, vertices: I4) -> I4:
    """Slots of the half-edges that leave `vertices`, row by row."""
    total = 0
    for vertex in vertices:
        total += indptr[vertex + 1] - indptr[vertex]
    slots = np.empty(total, np.int32)
    at = 0
    for vertex in vertices:
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            slots[at] = slot
            at += 1
    return slots


@njit(cache=True)
def _new(vertices, seen):  # type: ignore[no-untyped-def]
    """Those of `vertices` that are not marked in `seen` (N,), which they are afterwards."""
    fresh = np.empty(len(vertices), np.int32)
    count = 0
    for vertex in vertices:
        if not seen[vertex]:
            seen[vertex] = True
            fresh[count] = vertex
            count += 1
    return fresh[:count].copy()


def _gathered(
    indptr: I4, kept: list[tuple[I4, Values]], vertices: I4, at: NDArray[np.intp]
) -> Values:
    """Values of all parts in the order of `vertices`, which is `at` of the parts in a row."""
    if not kept:
        empty = np.zeros(0, np.float32)
        pair = np.zeros((0, 2), np.float32)
        return Values(pair, empty, np.zeros(0, np.uint16), np.zeros(0, np.int32), pair.copy())
    parts = [values for _, values in kept]
    whole = np.concatenate([part for part, _ in kept])
    row = indptr[whole + 1] - indptr[whole]
    first = np.concatenate([[0], np.cumsum(row)]).astype(np.int64)
    ghosts = np.concatenate([part.ghost for part in parts])
    length = row[at]
    begin = np.cumsum(length) - length
    slots = np.arange(int(length.sum())) - np.repeat(begin - first[:-1][at], length)
    return Values(
        np.concatenate([part.source for part in parts])[at],
        np.concatenate([part.angle for part in parts])[at],
        np.concatenate([part.sample for part in parts])[at],
        np.concatenate([part.patch for part in parts])[at],
        ghosts[slots],
    )


def _rows(indptr: I4, vertices: I4) -> I4:
    """Vertex position (m,) of every half-edge that leaves `vertices`."""
    length = indptr[vertices + 1] - indptr[vertices]
    return np.repeat(np.arange(len(vertices), dtype=np.int32), length)


def _same(indptr: I4, vertices: I4, before: Values, after: Values) -> NDArray[np.bool_]:
    """Vertices (n,) all of whose values are the same bits."""
    same = (_bits(before.source) == _bits(after.source)).all(axis=1)
    same &= _bits(before.angle) == _bits(after.angle)
    same &= (before.sample == after.sample) & (before.patch == after.patch)
    other = (_bits(before.ghost) != _bits(after.ghost)).any(axis=1)
    same[_rows(indptr, vertices)[other]] = False
    return np.asarray(same)


def _bits(values: F4) -> NDArray[np.uint32]:
    """Numbers as their bits, in which 0 and -0 differ and NaN is itself."""
    return np.ascontiguousarray(values).view(np.uint32)


def _part(indptr: I4, vertices: I4, values: Values, stay: NDArray[np.bool_]) -> Values:
    """Values at some of `vertices`."""
    rows = stay[_rows(indptr, vertices)]
    return Values(
        values.source[stay], values.angle[stay], values.sample[stay], values.patch[stay],
        values.ghost[rows],
    )  # fmt: skip
