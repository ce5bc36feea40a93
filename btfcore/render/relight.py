"""A decorated surface under light that moves: an image of its atlas, as good as time allows.

While something moves a frame is evaluated in the cheapest of `MODES` that it needs; at rest the
rest is filled in by slices until every visible texel has its full value. What did not change is
not evaluated again, and of a mode in use its error is measured.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from btfcore.errors import InvalidParameter
from btfcore.progress import Progress, silent
from btfcore.render.backing import Backing, Followed
from btfcore.render.copying import gather_texels, grouped, scatter
from btfcore.render.gutter import gutter_source
from btfcore.render.lights import NONE, Lights, alike
from btfcore.render.material import Material
from btfcore.render.pool import in_slices, shared_pool
from btfcore.render.shadow_cache import ShadowCache
from btfcore.render.surfels import Placement, placement, rewrite, surfels
from btfcore.render.tonemap import develop, displayed
from btfcore.types import F4, F8, I4, Prepared, Quilt

U1 = NDArray[np.uint8]

# By falling quality; cuts of rank are slower than control points and err twice as much.
MODES = ("full", "midpoints", "control", "half")
PROBES = 2000  # surfels on which the error of a mode is measured
_SLICE = 1 << 14  # surfels evaluated between two looks at the clock, fewer where lights are many
_KEEP = 0.3  # of a newly measured pace in the mean
# of a better mode's time that a worse one may take at most
_WORTH = {"full": 1.0, "midpoints": 0.8, "control": 0.8, "half": 0.5}
_GROUND_S = 2e-4  # what any evaluation costs before its first surfel
# Seconds a surfel and light, before there is a measured one.
_GUESS = {"full": 1.4e-7, "midpoints": 5e-8, "control": 3e-8, "half": 4e-8}


@dataclass(frozen=True)
class Quality:
    """What is in the image: mode, its error as sRGB RMSE, lights used, share of full values."""

    mode: str = "full"
    error: float = 0.0
    lights: int = 0
    done: float = 1.0


class Relighter:
    """The image of one decorated surface's atlas; asked for again and again.

    Everything is set by `look`, `light` and `expose`, drawn by `draw` and completed by `refine`;
    all of that from one thread. `image` (size, size, 3) u8, row 0 on top, is always the same
    array. Texels that cannot be seen keep what they had: they are in no picture drawn by
    bilinear filtering without mip levels. `everything` asks for those too.
    """

    def __init__(
        self,
        prepared: Prepared,
        quilt: Quilt,
        materials: Sequence[Material],
        *,
        gutter: I4 | None = None,
        place: Placement | None = None,
        pool: Executor | None = None,
        seed: int = 0,
        progress: Progress = silent,
    ) -> None:
        """Prepare for a quilt on a prepared mesh; `materials` by sample number.

        gutter : what `gutter_source` returned. place : scene coordinates, by default those of
        the mesh. pool : threads to work with, by default those that all rendering shares.
        Raises `InvalidParameter` where the quilt names a sample that is not there.
        """
        dense = prepared.dense
        self._prepared = prepared
        progress(0.0, "preparing the light")
        self.place = place if place is not None else placement(prepared.mesh.vertices)
        self.surfels = surfels(dense, prepared.field, quilt, self.place)
        self.size = dense.size
        self.step = dense.step  # of a texel on the surface, in world units
        self._pool = pool if pool is not None else shared_pool()
        self.gutter = gutter if gutter is not None else gutter_source(dense)
        self.materials = tuple(materials)
        self._backing = Backing(
            prepared, quilt, materials, self.surfels, self.gutter, self.place, self._pool, progress
        )
        count = len(self.surfels)
        self._values = np.zeros((0, 3), np.float32)  # radiance of the chosen, in their order
        self._codes = np.zeros((0, 3), np.uint8)
        self._held = 0  # so many of the chosen have values of the present state at all
        self._coded = np.zeros((count, 3), np.uint8)
        self.image: U1 = np.zeros((self.size, self.size, 3), np.uint8)
        self._keys = np.random.default_rng(seed).permutation(count)
        self._half: tuple[I4, I4, I4] | None = None
        self._eye: F8 = np.array([0.0, 0.0, 1.0, 0.0])
        self._lights, self._moving = NONE, NONE
        self._exposure, self._curve, self._shadows = 0.0, "clip", False
        self._everything = False
        self._chosen: I4 = np.zeros(0, np.int32)
        self._culled = self._lit = self._shown = False  # what of the present state was done
        self._next = 0  # so many of the chosen have their full values
        self._quality = Quality()
        self._measured = True
        self._cost = dict(_GUESS)
        self._pace = 1.0  # of this machine now, over what `_cost` says
        self._spent = 0.0

    # --- what is asked for

    def look(self, eye: F8) -> None:
        """Look from `eye` (4,): homogeneous scene coordinates, w = 0 from far away."""
        eye = np.asarray(eye, np.float64)
        if eye.shape != (4,) or not np.isfinite(eye).all():
            raise InvalidParameter(f"an eye at {eye.tolist()}, where 4 finite numbers are needed")
        if not np.array_equal(eye, self._eye):
            self._eye = eye.copy()
            self._culled = self._lit = self._shown = False

    def light(self, lights: Lights, *, moving: Lights | None = None, shadows: bool = False) -> None:
        """Light the surface; `moving`: fewer lights that may do while something moves.

        shadows : those of `lights` that stand for no environment cast shadows at full quality.
        """
        moving = lights if moving is None else moving
        same = alike(lights, self._lights) and alike(moving, self._moving)
        if not same or shadows is not self._shadows:
            self._lights, self._moving, self._shadows = lights, moving, shadows
            self._lit = self._shown = False

    def expose(self, exposure: float, curve: str = "clip") -> None:
        """Show radiance by stops and a curve of `btfcore.render.tonemap`; evaluates nothing.

        Raises `InvalidParameter`.
        """
        if (exposure, curve) != (self._exposure, self._curve):
            displayed(np.zeros(3, np.float32), exposure, curve)  # raises for what cannot be
            self._exposure, self._curve = exposure, curve
            self._shown = False

    def everything(self, wanted: bool) -> None:
        """Light what cannot be seen too, for pictures drawn with mip levels."""
        if wanted is not self._everything:
            self._everything = wanted
            self._culled = self._lit = self._shown = False

    def followed(self, quilt: Quilt) -> Followed:
        """Prepare, in any thread, what modes by whole patches need of an edited quilt."""
        return self._backing.followed(quilt)

    def follow(self, made: Followed) -> None:
        """Take the whole of an edited quilt, whose changes `update` was told."""
        self._backing.follow(made)
        self._half = (*made.halves, np.full(len(made.halves[1]), -1, np.int32))

    def update(self, vertices: I4, part: Quilt) -> None:
        """Show the values `part` of `vertices` (n,): the quilt is being painted.

        Raises `InvalidParameter` where `part` names a sample that is not among the materials.
        """
        highest = int(part.sample[part.patch >= 0].max(initial=0))
        if highest >= len(self.materials):
            raise InvalidParameter(
                f"the quilt names sample {highest}, the light knows {len(self.materials)}"
            )
        normals, tangents = self._prepared.dense.normals, self._prepared.field.tangents
        rewrite(self.surfels, vertices, part, normals[vertices], tangents[vertices])
        mark = np.zeros(len(self.surfels), np.bool_)
        mark[vertices] = True
        rows = np.flatnonzero(mark[self._chosen[: self._held]]) if self._culled else vertices[:0]
        if len(rows):
            self._values[rows] = self._full_values(self._chosen[rows])
            self._shown = False

    # --- what is done

    @property
    def modes(self) -> tuple[str, ...]:
        """Modes that there are for this surface, the best first."""
        return tuple(mode for mode in MODES if self._backing.offers(mode))

    @property
    def lights(self) -> Lights:
        """What `light` was given last."""
        return self._lights

    @property
    def shadows(self) -> ShadowCache:
        """Which lights reach the surfels."""
        return self._backing.shadows

    @property
    def visible(self) -> I4:
        """Surfels (n,) i4 that count for the present eye."""
        self._cull()
        return self._chosen

    @property
    def finished(self) -> bool:
        """The image holds the full values of everything that counts."""
        return self._culled and self._lit and self._shown and self._next == len(self._chosen)

    def draw(self, budget_s: float = 0.02, *, mode: str | None = None) -> bool:
        """Bring the image up to date within about `budget_s`; return whether it changed.

        mode : one of `modes` instead of the best that is expected to take no longer.
        Raises `InvalidParameter` for a mode that there is not.
        """
        if mode is not None and mode not in self.modes:
            raise InvalidParameter(f"no mode {mode!r} here; there are {', '.join(self.modes)}")
        if self._lit and mode in (None, self._quality.mode):
            return self._show()
        self._cull()
        used = mode if mode is not None else self._affordable(budget_s)
        start = time.perf_counter()
        lights = self._lights if used == "full" else self._moving
        self._evaluate(used, lights)
        spent = time.perf_counter() - start
        work = len(self._chosen) * max(len(lights), 1)
        if work:  # what slows one mode down slows all of them
            self._spent = max(spent - _GROUND_S, 1e-6) / work
            self._pace += _KEEP * (self._spent / self._cost[used] - self._pace)
        self._held = len(self._chosen)
        self._next = self._held if used == "full" else 0
        self._quality = Quality(used, 0.0, len(lights), float(used == "full"))
        self._measured = used == "full"
        self._lit, self._shown = True, False
        return self._show()

    def refine(self, budget_s: float = 0.01) -> bool:
        """Go on with full values until `budget_s` is used up; return whether all are there."""
        start = time.perf_counter()
        self._cull()
        if not self._lit:
            self._next = self._held = 0
            self._lit = True
            self._shown = False
        begin = self._next
        step = max(1 << 10, _SLICE // max(len(self._lights), 1))
        if self._shadows:
            casting = len(self._lights) - self._lights.sampled
            step = min(step, self._backing.shadows.affordable(casting, budget_s / 2))
        while self._next < len(self._chosen):
            part = slice(self._next, min(self._next + step, len(self._chosen)))
            self._full(part)
            self._next = part.stop
            self._held = max(self._held, part.stop)
            if time.perf_counter() - start >= budget_s:
                break
        total = max(len(self._chosen), 1)
        if self._next == len(self._chosen):
            self._quality = Quality("full", 0.0, len(self._lights), 1.0)
            self._measured = True
        else:
            self._quality = replace(self._quality, done=self._next / total)
            self._measured = False
        if self._next > begin:
            self._shown = False
        return self._next == len(self._chosen)

    def show(self) -> bool:
        """Put what `refine` found into the image; return whether it changed."""
        return self._show()

    def finish(self) -> U1:
        """Return the image of full quality, however long that takes."""
        while not self.refine(1.0):
            pass
        self._show()
        return self.image

    def quality(self) -> Quality:
        """Say what the image holds; the error is measured where the mode is not the full one."""
        if not self._measured and self._lit:
            self._quality = replace(self._quality, error=self._error())
            self._measured = True
        return self._quality

    def warm_up(self, lights: Lights, *, progress: Progress = silent) -> None:
        """Compile what is not compiled yet and measure every mode, so that no frame waits for it.

        Afterwards the surface is lit by `lights`; nothing of it is in the image yet.
        """
        self.light(lights)
        self._backing.shadows.shade(lights, self.visible[:1])
        for number, mode in enumerate(self.modes):
            progress(0.5 + 0.5 * number / len(self.modes), "preparing the light")
            least = np.inf
            for again in range(4):
                self._lit = False
                self.draw(mode=mode)
                self.quality()
                if again:  # compiled by now
                    least = min(least, self._spent)
            self._cost[mode] = least
        self._pace = 1.0
        self._lit = self._shown = False

    # --- inside

    def _cull(self) -> None:
        if self._culled:
            return
        if self._everything:
            self._chosen = np.arange(len(self.surfels), dtype=np.int32)
        else:
            self._chosen = self._backing.seen(self._eye)
        self._culled, self._lit, self._shown = True, False, False
        self._held = 0
        if len(self._values) != len(self._chosen):
            self._values = np.empty((len(self._chosen), 3), np.float32)
            self._codes = np.empty((len(self._chosen), 3), np.uint8)

    def _affordable(self, budget_s: float) -> str:
        """The best mode that fits the budget; else a worse one only where that saves much."""
        taken, least = "", np.inf
        for mode in self.modes:
            lights = self._lights if mode == "full" else self._moving
            work = len(self._chosen) * max(len(lights), 1)
            cost = _GROUND_S + self._pace * self._cost[mode] * work
            if mode == "full" and self._shadows:
                cost += self._backing.shadows.seconds(lights, self._chosen)
            if cost < _WORTH[mode] * least:
                taken = mode
            least = min(least, cost)
            if cost <= budget_s:
                break
        return taken

    def _evaluate(self, mode: str, lights: Lights) -> None:
        chosen, out = self._chosen, self._values
        if mode == "half":
            group, first, slot = self._halves()
            wanted = np.empty(len(chosen), np.int32)
            place = np.empty(len(chosen), np.int32)
            found = wanted[: grouped(chosen, group, slot, wanted, place)]
            values = self._backing.radiance("full", first[found], self._eye, lights)
            np.take(values, place, axis=0, out=out)
            return
        shade = self._shade(chosen) if mode == "full" else None
        self._backing.radiance(mode, chosen, self._eye, lights, shade, out=out)

    def _shade(self, chosen: I4) -> F4 | None:
        return self._backing.shadows.shade(self._lights, chosen) if self._shadows else None

    def _full_values(self, chosen: I4) -> F4:
        shade = self._shade(chosen)
        return self._backing.radiance("full", chosen, self._eye, self._lights, shade)

    def _full(self, part: slice) -> None:
        chosen = self._chosen[part]
        shade = self._shade(chosen)
        self._backing.radiance(
            "full", chosen, self._eye, self._lights, shade, out=self._values[part]
        )

    def _halves(self) -> tuple[I4, I4, I4]:
        """Group of every surfel, 2 x 2 texels of one patch each, one surfel of each, and marks."""
        if self._half is None:
            group, first = self._backing.halves()
            self._half = group, first, np.full(len(first), -1, np.int32)
        return self._half

    def _show(self) -> bool:
        if self._shown or not self._lit:
            return False
        chosen, codes = self._chosen[: self._held], self._codes

        def code(begin: int, end: int) -> None:
            part = codes[begin:end]
            develop(self._values[begin:end], self._exposure, self._curve, out=part)
            scatter(part, chosen, begin, end, self._coded)

        def gather(begin: int, end: int) -> None:
            gather_texels(self.gutter, self._coded, begin, end, self.image)

        in_slices(code, len(chosen), self._pool)
        in_slices(gather, self.size * self.size, self._pool)
        self._shown = True
        return True

    def _error(self) -> float:
        count = len(self._chosen)
        if count == 0:
            return 0.0
        # the same ones as long as they are seen
        rows = np.flatnonzero(self._keys[self._chosen] < PROBES / count * len(self._keys))
        rows = rows[rows < self._held] if (rows < self._held).any() else np.zeros(1, np.int64)
        probes = self._chosen[rows]
        wanted = self._full_values(probes)
        one = displayed(self._values[rows], self._exposure, self._curve).astype(np.float64)
        two = displayed(wanted, self._exposure, self._curve).astype(np.float64)
        return float(np.sqrt(((one - two) ** 2).mean()))
