"""The way of the pointer over the surface, without gaps and broken at silhouettes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from app.picking import Hits, Picker, View
from btfcore.errors import InvalidParameter
from btfcore.types import F8, Frozen

COARSE = 2.0  # pixels between the first samples
FINE = 1 / 32  # pixels: what is still apart there is a jump
RIM = 0.5  # pixels to which the end of a surface is found
MOST = 20_000  # samples between two events


@dataclass(frozen=True, eq=False)
class Run(Frozen):
    """A stretch of the way that lies on the surface without a jump, n ≥ 1 samples.

    hits of them; pixel (n, 2) f8; pressure (n,) f8. joined : it goes on where the way was
    before, so the first sample belongs to the stroke that was there; else a new one begins.
    """

    hits: Hits
    pixel: F8
    pressure: F8
    joined: bool

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.pressure)


def along(
    picker: Picker,
    view: View,
    start: tuple[float, float],
    end: tuple[float, float],
    spacing: float,
    *,
    pressure: tuple[float, float] = (1.0, 1.0),
    whole: bool = True,
) -> list[Run]:
    """Samples of the straight way in the picture from pixel `start` to `end`, in its order.

    Neighbours of one run are no farther apart than `spacing` in world units (or two pixels, where
    that is more), and rarely closer than half of it. A run ends where the surface does, and where
    it jumps, as at a silhouette. The sample at `start` itself is left out: it is the end of what
    came before, and a first run that goes on from it is `joined`. whole : `end` is a sample even if
    it is closer than that to the one before. pressure : at both ends, linear between. Raises
    `InvalidParameter` where `spacing` is not above 0.
    """
    if not 0 < spacing < math.inf:
        raise InvalidParameter(f"the spacing along a stroke is {spacing:g}; it must be above 0")
    begin = np.asarray(start, np.float64)
    way = np.asarray(end, np.float64) - begin
    length = float(np.linalg.norm(way))
    if not math.isfinite(length):
        return []
    share, hits, limit = _samples(picker, view, begin, way, length, spacing / 2)
    runs: list[Run] = []
    for first, last in _stretches(hits, limit):
        chosen = _thinned(hits.position[first:last], limit) + first
        if last < len(share) or whole:
            if chosen[-1] != last - 1:
                chosen = np.append(chosen, last - 1)
        joined = first == 0
        if joined:  # the sample at `start`
            chosen = chosen[1:]
        if len(chosen):
            at = share[chosen]
            runs.append(
                Run(
                    hits.take(chosen),
                    begin + at[:, None] * way,
                    pressure[0] + at * (pressure[1] - pressure[0]),
                    joined,
                )
            )
    return runs


def _samples(
    picker: Picker, view: View, begin: F8, way: F8, length: float, limit: float
) -> tuple[F8, Hits, F8]:
    """Shares of the way (n,), ascending, what is hit there, and how far neighbours may be apart.

    Intervals are halved, all at once, until what is in them is close enough or a jump.
    """
    share = np.linspace(0.0, 1.0, max(math.ceil(min(length / COARSE, MOST / 4)), 1) + 1)
    hits = picker.pick(view, begin + share[:, None] * way)
    while True:
        on, gap = hits.on, np.diff(share) * length
        # a pixel's own size, where that is coarser than the spacing
        depth = np.where(on, hits.depth, 0.0)
        least = picker.pixel_size(view, 1.0) * np.maximum(depth[1:], depth[:-1])
        allowed = np.maximum(limit, least)
        apart = np.linalg.norm(np.diff(hits.position, axis=0), axis=1)
        both, one = on[1:] & on[:-1], on[1:] ^ on[:-1]
        wanted = (both & (apart > allowed) & (gap > FINE)) | (one & (gap > RIM))
        place = np.flatnonzero(wanted)
        if len(place) == 0 or len(share) + len(place) > MOST:
            return share, hits, allowed
        middle = (share[place] + share[place + 1]) / 2
        found = picker.pick(view, begin + middle[:, None] * way)
        order = np.argsort(np.concatenate([share, middle]), kind="stable")
        share = np.concatenate([share, middle])[order]
        hits = _joined(hits, found).take(order)


def _stretches(hits: Hits, limit: F8) -> list[tuple[int, int]]:
    """Bounds [first, last) of the samples that lie on the surface without a jump."""
    apart = np.linalg.norm(np.diff(hits.position, axis=0), axis=1)
    together = hits.on[1:] & hits.on[:-1] & (apart <= limit)
    begins = np.flatnonzero(hits.on & np.append(True, ~together))
    ends = np.flatnonzero(hits.on & np.append(~together, True)) + 1
    return [(int(a), int(b)) for a, b in zip(begins, ends, strict=True)]


def _thinned(points: F8, limit: F8) -> np.ndarray:
    """Numbers of the points that are farther than the limit from the last chosen one."""
    chosen = [0]
    least = float(limit.min())
    for n in range(1, len(points)):
        if math.dist(points[n], points[chosen[-1]]) >= least:
            chosen.append(n)
    return np.array(chosen)


def _joined(one: Hits, two: Hits) -> Hits:
    pairs = ((getattr(one, name), getattr(two, name)) for name in Hits.__dataclass_fields__)
    return Hits(*(np.concatenate(pair) for pair in pairs))


class Trail:
    """The samples of one drag: `begin`, `move` as often as the pointer does, `end`.

    Each returns the runs that came with it. The camera may move meanwhile: the way goes on from
    the same place of the surface.
    """

    def __init__(self, picker: Picker, spacing: float) -> None:
        """Sample the way at every `spacing` world units."""
        self._picker, self._spacing = picker, spacing
        self._view: View | None = None
        self._pixel, self._pressure = (0.0, 0.0), 1.0  # of the last sample
        self._last = 1.0  # pressure, of the last event
        self._position: F8 | None = None  # of the last sample; None off the surface

    def begin(self, view: View, pixel: tuple[float, float], pressure: float = 1.0) -> list[Run]:
        """Put the pointer down: one run of one sample, or none off the surface."""
        places = np.array([pixel], np.float64)
        hits = self._picker.pick(view, places)
        self._view, self._pixel, self._pressure = view, pixel, pressure
        self._last = pressure
        self._position = hits.position[0] if hits.on[0] else None
        return [Run(hits, places, np.array([pressure]), False)] if hits.on[0] else []

    def move(self, view: View, pixel: tuple[float, float], pressure: float = 1.0) -> list[Run]:
        """Go on to `pixel`; nothing comes while it is closer than the spacing."""
        return self._go(view, pixel, pressure, whole=False)

    def end(
        self, view: View, pixel: tuple[float, float], pressure: float | None = None
    ) -> list[Run]:
        """Go on to `pixel`, which becomes a sample however close, and stop there.

        pressure : None: the last one.
        """
        pressure = self._last if pressure is None else pressure
        moved = pixel != self._pixel or view != self._view
        return self._go(view, pixel, pressure, whole=True) if moved else []

    def _go(
        self, view: View, pixel: tuple[float, float], pressure: float, *, whole: bool
    ) -> list[Run]:
        if self._view is None:
            return self.begin(view, pixel, pressure)
        self._last = pressure
        if view != self._view and self._position is not None:
            if not self._picker.visible(view, self._position)[0]:
                return self.begin(view, pixel, pressure)
            column, row, _ = self._picker.pixels(view, self._position)
            self._pixel = (float(column), float(row))
        self._view = view
        runs = along(
            self._picker, view, self._pixel, pixel, self._spacing,
            pressure=(self._pressure, pressure), whole=whole,
        )  # fmt: skip
        if self._picker.pick(view, np.array([pixel], np.float64)).on[0]:
            if runs:  # on from the last sample, so that small steps add up
                last = runs[-1]
                self._pixel = (float(last.pixel[-1, 0]), float(last.pixel[-1, 1]))
                self._pressure = float(last.pressure[-1])
                self._position = last.hits.position[-1]
        else:
            self._pixel, self._pressure, self._position = pixel, pressure, None
        return runs
