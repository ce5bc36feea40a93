"""Deltas of edits in few arrays: what can be told from the ground below is not stored.

A ghost is stored only where it is not what `expected` says, which is between patches. Values
before an edit, and who wrote them, are those of the ground below it; for hidden edits whose
ground has changed since they were computed they are stored too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.files.project.schema import DeltaEntry
from btfcore.files.project.value import StoredEdit
from btfcore.paint.delta import Delta, Values, put, slots_of, values_of
from btfcore.patch.connectivity import Connectivity
from btfcore.quilt.state import QuiltState
from btfcore.types import F4, I4

Arrays = dict[str, NDArray[Any]]
Kinds = dict[str, tuple[np.dtype[Any], tuple[int, ...]]]
AFTER = {"source": (np.float32, 2), "angle": (np.float32, 0), "sample": (np.uint16, 0)} | {
    "patch": (np.int32, 0)
}


def expected(net: Connectivity, state: QuiltState, slots: I4 | None = None) -> F4:
    """Ghosts (n, 2) f4 of half-edges `slots` (n,) as one patch at both ends would have them.

    That is the other end's source; 0 where the two are of different patches, or bare. slots:
    None for all.
    """
    if slots is None:
        tail = np.repeat(np.arange(len(net.indptr) - 1), np.diff(net.indptr))
        head = net.indices
    else:
        tail = np.searchsorted(net.indptr, slots, side="right") - 1
        head = net.indices[slots]
    one = (state.patch[tail] == state.patch[head]) & (state.patch[tail] >= 0)
    return np.where(one[:, None], state.source[head], np.float32(0))


def odd_ghosts(net: Connectivity, state: QuiltState, slots: I4 | None = None) -> tuple[I4, F4]:
    """Places (m,) i4 in `slots` whose ghosts are not as `expected`, and these ghosts (m, 2)."""
    ghost = state.ghost if slots is None else state.ghost[slots]
    odd = (bits(ghost) != bits(expected(net, state, slots))).any(axis=1)
    places = np.flatnonzero(odd).astype(np.int32)
    return places, ghost[places]


def bits(values: NDArray[Any]) -> NDArray[Any]:
    """Return floats as whole numbers, so that comparing them compares every bit."""
    values = np.ascontiguousarray(values)
    return (
        values.view(np.dtype(f"u{values.dtype.itemsize}")) if values.dtype.kind == "f" else values
    )


def same_values(one: Values, other: Values) -> bool:
    """Whether two values agree in every bit."""
    return all(
        np.array_equal(bits(getattr(one, name)), bits(getattr(other, name)))
        for name in (*AFTER, "ghost")
    )


@dataclass(eq=False)
class Ground:
    """The quilt below an edit, and who wrote it, built up edit by edit."""

    net: Connectivity
    state: QuiltState
    writer: I4

    @classmethod
    def over(cls, net: Connectivity, background: QuiltState) -> Ground:
        """Begin with a copy of the background."""
        state = QuiltState(
            background.source.copy(), background.patch.copy(), background.ghost.copy(),
            background.angle.copy(), background.patches, background.sample.copy(),
            background.layout,
        )  # fmt: skip
        return cls(net, state, np.full(len(state.patch), -1, np.int32))

    def fits(self, delta: Delta) -> bool:
        """Whether what the delta was made on is what is here."""
        return (
            delta.fits(self.writer)
            and np.array_equal(self.writer[delta.vertices], delta.writers)
            and same_values(values_of(self.net, self.state, delta.vertices), delta.before)
        )


def gathered(
    net: Connectivity, background: QuiltState, edits: Sequence[StoredEdit]
) -> tuple[list[DeltaEntry | None], Arrays]:
    """Counts of every edit's delta, and the arrays in which they lie in a row."""
    ground = Ground.over(net, background)
    parts: dict[str, list[NDArray[Any]]] = {}
    entries: list[DeltaEntry | None] = []
    for stored in edits:
        delta = stored.delta
        if delta is None:
            entries.append(None)
            continue
        plain = ground.fits(delta)
        here = values_of(net, ground.state, delta.vertices)
        slots = slots_of(net.indptr, delta.vertices)
        counts = {}
        for prefix, values in (("", delta.after), ("before_", delta.before)):
            if prefix and plain:
                continue
            put(net, ground.state, delta.vertices, values)
            places, ghosts = odd_ghosts(net, ground.state, slots)
            _add(parts, prefix, values, places, ghosts)
            counts[prefix] = len(places)
        for name in (
            "vertices",
            "reads",
            "wanted",
            *(() if plain else ("writers", "read_writers")),
        ):
            parts.setdefault(name, []).append(getattr(delta, name))
        on = stored.edit.visible
        put(net, ground.state, delta.vertices, delta.after if on else here)
        if on:
            ground.writer[delta.vertices] = delta.token
        entries.append(
            DeltaEntry(
                token=delta.token, vertices=len(delta.vertices), reads=len(delta.reads),
                ghosts=counts[""], plain=plain, before_ghosts=counts.get("before_", 0),
            )
        )  # fmt: skip
    return entries, {name: np.concatenate(each) for name, each in parts.items()}


def _add(
    parts: dict[str, list[NDArray[Any]]], prefix: str, values: Values, places: I4, ghosts: F4
) -> None:
    for name in AFTER:
        parts.setdefault(prefix + name, []).append(getattr(values, name))
    parts.setdefault(prefix + "ghost_slots", []).append(places)
    parts.setdefault(prefix + "ghosts", []).append(ghosts)


def shapes(
    entries: Sequence[DeltaEntry | None],
) -> Kinds:
    """Kind and shape of every array of `gathered`, of those that are not empty."""
    given = [each for each in entries if each is not None]
    own = [each for each in given if not each.plain]
    vertices, reads = (sum(getattr(e, name) for e in given) for name in ("vertices", "reads"))
    whole = np.dtype(np.int32)
    out: Kinds = {}
    for prefix, rows, ghosts in (
        ("", vertices, sum(each.ghosts for each in given)),
        ("before_", sum(e.vertices for e in own), sum(each.before_ghosts for each in own)),
    ):
        for name, (kind, columns) in AFTER.items():
            out[prefix + name] = (np.dtype(kind), (rows, columns) if columns else (rows,))
        out[prefix + "ghost_slots"] = (whole, (ghosts,))
        out[prefix + "ghosts"] = (np.dtype(np.float32), (ghosts, 2))
    out["vertices"], out["reads"] = (whole, (vertices,)), (whole, (reads,))
    out["wanted"] = (np.dtype(np.float32), (reads,))
    out["writers"] = (whole, (sum(each.vertices for each in own),))
    out["read_writers"] = (whole, (sum(each.reads for each in own),))
    return {name: each for name, each in out.items() if each[1][0]}


def scattered(
    net: Connectivity,
    background: QuiltState,
    entries: Sequence[tuple[DeltaEntry | None, bool]],
    arrays: Mapping[str, NDArray[Any]],
) -> Iterator[Delta | None]:
    """Yield deltas again, from counts and whether the edit is visible, bottom first.

    Raises `ValueError` saying what does not fit.
    """
    ground = Ground.over(net, background)
    take = _Rows(arrays)
    for at, (entry, visible) in enumerate(entries):
        if entry is None:
            yield None
            continue
        try:
            vertices = _ascending("vertices", take("vertices", entry.vertices), len(net.indptr) - 1)
            reads = _ascending("reads", take("reads", entry.reads), len(net.indptr) - 1)
            wanted = take("wanted", entry.reads, np.float32)
            here = values_of(net, ground.state, vertices)
            after = _values(ground, vertices, take, "", entry.vertices, entry.ghosts)
            if entry.plain:
                before, writers, read_writers = here, ground.writer[vertices], ground.writer[reads]
            else:
                before = _values(
                    ground, vertices, take, "before_", entry.vertices, entry.before_ghosts
                )
                writers = take("writers", entry.vertices)
                read_writers = take("read_writers", entry.reads)
        except ValueError as error:
            raise ValueError(f"edit {at}: {error}") from None
        put(net, ground.state, vertices, after if visible else here)
        if visible:
            ground.writer[vertices] = entry.token
        yield Delta(vertices, before, after, writers, reads, read_writers, wanted, entry.token)


class _Rows:
    """Takes rows of the arrays from the front."""

    def __init__(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        self._arrays = arrays
        self._at: dict[str, int] = {}

    def __call__(self, name: str, count: int, kind: Any = np.int32, columns: int = 0) -> Any:
        if count == 0:
            return np.zeros((0, columns) if columns else 0, kind)
        at = self._at.get(name, 0)
        self._at[name] = at + count
        return self._arrays[name][at : at + count].copy()


def _ascending(name: str, values: I4, most: int) -> I4:
    if len(values) and (values[0] < 0 or values[-1] >= most or (np.diff(values) <= 0).any()):
        raise ValueError(
            f"{name} {values.min()} … {values.max()} do not ascend within 0 … {most - 1}"
        )
    return values


def _values(ground: Ground, vertices: I4, take: _Rows, prefix: str, count: int, odd: int) -> Values:
    net, state = ground.net, ground.state
    parts = {
        name: take(prefix + name, count, kind, columns) for name, (kind, columns) in AFTER.items()
    }
    slots = slots_of(net.indptr, vertices)
    places = _ascending("ghosts", take(prefix + "ghost_slots", odd), max(len(slots), 1))
    ghosts = take(prefix + "ghosts", odd, np.float32, 2)
    state.source[vertices], state.patch[vertices] = parts["source"], parts["patch"]
    ghost = expected(net, state, slots)
    ghost[places] = ghosts
    return Values(parts["source"], parts["angle"], parts["sample"], parts["patch"], ghost)
