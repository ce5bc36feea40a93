"""Images of a relief that are made when they are asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from btfcore.btf.bake.bounce import Bounce
from btfcore.btf.bake.horizon import horizons
from btfcore.btf.bake.lamps import lamps
from btfcore.btf.bake.relief import Relief
from btfcore.btf.bake.shade import LANES, LOWEST, ROWS, blocks, look, shade
from btfcore.btf.bake.spread import cores, spread
from btfcore.btf.bake.trace import trace
from btfcore.progress import Progress, silent
from btfcore.types import F4, F8, I8

BAND = 4096  # texels of one piece of work: small enough for the cache, and to cancel between
_KEPT_MB = 256.0  # of a view's hits and horizons kept for the next read


@dataclass(frozen=True, eq=False)
class _Seen:
    """A band of a view: points hit, their material, and horizons as far as they are known."""

    x: F8
    y: F8
    surface: F4
    horizon: F4
    known: I8


class BakedStack:
    """Images of a relief, image v * L + l showing view v under light l; an `ImageStack`.

    Reading costs ray marching once per view and one horizon per view and azimuth of the
    lights; the last view's are kept, as far as they fit into 256 MiB, so that consecutive
    reads share them. Bits do not depend on what is read together, nor on `threads` (None: one
    per core).
    """

    dear = True

    def __init__(
        self,
        relief: Relief,
        views: F8,
        lights: F8,
        *,
        shadows: bool = True,
        parallax: bool = True,
        bounce: bool = False,
        threads: int | None = None,
    ) -> None:
        """Prepare to render `relief` seen from `views` (V, 3) and lit from `lights` (L, 3)."""
        self._relief = relief
        self._views = views
        self._lamps = lamps(lights)
        self._shadows = shadows and not relief.flat
        self._parallax = parallax and not relief.flat
        self._bounce = Bounce(relief, shadows=self._shadows) if bounce else None
        self._threads = threads or cores()
        self._kept: dict[tuple[int, int], _Seen] = {}

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of images, rows, columns."""
        return len(self._views) * len(self._lamps.lights), *self._relief.shape

    def prepare(self, lights: I8 | None = None, *, progress: Progress = silent) -> None:
        """Gather the bounced light of `lights` (n,), or of all, which `read` does where needed."""
        if self._bounce is not None:
            every = np.arange(len(self._lamps.lights)) if lights is None else lights
            self._bounce.prepare(self._lamps, every, threads=self._threads, progress=progress)

    def read(self, numbers: ArrayLike) -> F4:
        """Images `numbers` (n,) as (n, H, W, 3) f4 linear radiance."""
        wanted = np.asarray(numbers, np.int64).reshape(-1)
        count, height, width = self.shape
        texels = height * width
        wanted = np.where(wanted < 0, wanted + count, wanted)
        view, light = np.divmod(wanted, len(self._lamps.lights))
        out = np.empty((len(wanted), texels, 3), np.float32)
        if len(wanted) == 0:
            return out.reshape(0, height, width, 3)
        if wanted.min() < 0 or wanted.max() >= count:
            raise IndexError(f"images {wanted.min()} to {wanted.max()} of {count}")
        self.prepare(np.unique(light))
        last = int(view[-1])
        kept, self._kept = self._kept, {}
        work = [
            (int(one), first, kept.get((int(one), first)), np.flatnonzero(view == one))
            for one in np.unique(view)
            for first in range(0, texels, BAND)
        ]
        keep = texels * (ROWS + 4 + len(self._lamps.steps)) * 4 <= _KEPT_MB * 2**20

        def one_band(item: tuple[int, int, _Seen | None, I8]) -> None:
            one, first, seen, places = item
            stop = min(first + BAND, texels)
            seen = seen or self._look(one, first, stop)
            self._light(one, seen, light[places], out, places, (first, stop))
            if keep and one == last:
                self._kept[one, first] = seen

        spread(one_band, work, threads=self._threads)
        return out.reshape(len(wanted), height, width, 3)

    def _look(self, view: int, first: int, stop: int) -> _Seen:
        """Trace a band of texels of a view and fetch what is seen there."""
        relief, direction = self._relief, self._views[view]
        count, width = stop - first, relief.shape[1]
        x, y = np.empty(count), np.empty(count)
        if self._parallax:
            run = direction[:2] * [1, -1] / max(direction[2], LOWEST)
            trace(relief.height, relief.ceiling, first, width, run, relief.level, x, y)
        else:
            row, column = np.divmod(np.arange(first, stop), width)
            x[:], y[:] = column, row
        surface = np.zeros((blocks(count), ROWS, LANES), np.float32)
        look(relief.maps, x, y, direction.astype(np.float32), relief.coat, surface)
        horizon = np.zeros((len(self._lamps.steps), count), np.float32)
        return _Seen(x, y, surface, horizon, np.zeros(len(horizon), np.int64))

    def _light(
        self, view: int, seen: _Seen, light: I8, out: F4, places: I8, texels: tuple[int, int]
    ) -> None:
        """Fill in a band of the images `places` (n,) of a view under the lights `light` (n,)."""
        relief, lit = self._relief, self._lamps
        way = lit.way[light]
        if self._shadows:
            new = np.unique(way[seen.known[way] == 0])
            if len(new):
                rows = np.empty((len(new), len(seen.x)), np.float32)
                horizons(
                    relief.height,
                    relief.ceiling,
                    relief.level[1],
                    seen.x,
                    seen.y,
                    lit.steps[new],
                    lit.reach[new],
                    rows,
                )
                seen.horizon[new] = rows
                seen.known[new] = 1
        direction = self._views[view].astype(np.float32)
        shade(
            seen.surface,
            seen.horizon,
            way,
            lit.tangent[light],
            direction,
            relief.coat,
            lit.lights[light],
            out,
            places,
            np.array(texels),
        )
        if self._bounce is not None:
            self._bounce.add(seen.x, seen.y, seen.surface, light, out, places, texels[0])
