"""Cast shadows that are remembered: a ray is sent once for every surfel and light.

Which lights reach a surfel does not depend on the eye, so that shadows stay while a view turns.
"""

from __future__ import annotations

import time
from concurrent.futures import Executor

import numpy as np
from numpy.typing import NDArray

from btfcore.render.cast import Caster
from btfcore.render.lights import Lights
from btfcore.types import F4, I4

U1 = NDArray[np.uint8]

UNKNOWN = 2  # else 1 where the light arrives, 0 where it does not
_RAY_S = 1e-6  # that one ray takes until one was measured
_KEEP = 0.3  # of a new measurement
_LEAST = 512  # surfels at a time, below which calls cost more than rays


class ShadowCache:
    """Shadows of one surface's surfels under the lights of the present, from one thread.

    Lights in place of an environment cast none: all of theirs arrives.
    """

    def __init__(self, caster: Caster, pool: Executor | None = None) -> None:
        """Remember nothing yet; `pool`: threads that share the rays."""
        self._caster, self._pool = caster, pool
        self._known: dict[bytes, U1] = {}
        self._ray_s = _RAY_S

    def shade(self, lights: Lights, chosen: I4) -> F4:
        """Share (L, n) f4, 0 or 1, of each light that reaches the surfels `chosen` (n,)."""
        out = np.ones((len(lights), len(chosen)), np.float32)
        for number, state in enumerate(self._states(lights)):
            found = state[chosen]
            lacking = np.flatnonzero(found == UNKNOWN)
            if len(lacking):
                found[lacking] = state[chosen[lacking]] = self._cast(
                    lights.direction[number], chosen[lacking]
                )
            out[number] = found
        return out

    def complete(self, lights: Lights, budget_s: float) -> bool:
        """Send rays of all surfels for about `budget_s`; return whether none is left to send.

        Some are sent however little time there is.
        """
        start, begun = time.perf_counter(), False
        for number, state in enumerate(self._states(lights)):
            lacking = np.flatnonzero(state == UNKNOWN)
            while len(lacking):
                left = budget_s - (time.perf_counter() - start)
                if begun and left <= 0:
                    return False
                begun = True
                now, lacking = np.split(lacking, [self.affordable(1, max(left, 0.0))])
                state[now] = self._cast(lights.direction[number], now)
        return True

    def everywhere(self, lights: Lights) -> F4:
        """Share (L, N) f4 of all surfels, of the lights that cast shadows; see `complete`."""
        count = len(lights) - lights.sampled
        everything = np.arange(len(self._caster.origins), dtype=np.int32)
        return self.shade(lights, everything)[:count]

    def seconds(self, lights: Lights, chosen: I4) -> float:
        """Seconds that the rays which `shade` has to send are expected to take."""
        lacking = sum(np.count_nonzero(each[chosen] == UNKNOWN) for each in self._states(lights))
        return self._ray_s * float(lacking)

    def affordable(self, lights: int, budget_s: float) -> int:
        """Surfels whose rays to so many lights are expected to take `budget_s`."""
        return max(_LEAST, int(budget_s / (self._ray_s * max(lights, 1))))

    def share(self, lights: Lights) -> float:
        """Share of all rays that were sent."""
        states = self._states(lights)
        counts = [np.count_nonzero(each != UNKNOWN) / max(len(each), 1) for each in states]
        return float(np.mean(counts)) if counts else 1.0

    def _states(self, lights: Lights) -> list[U1]:
        """What is known of each light that casts shadows; others are forgotten."""
        keys = [
            direction.tobytes() for direction in lights.direction[: len(lights) - lights.sampled]
        ]
        count = len(self._caster.origins)
        self._known = {
            key: self._known[key] if key in self._known else np.full(count, UNKNOWN, np.uint8)
            for key in keys
        }
        return [self._known[key] for key in keys]

    def _cast(self, direction: NDArray[np.float64], chosen: NDArray[np.integer]) -> U1:
        start = time.perf_counter()
        one = Lights(direction[None].copy(), np.ones((1, 3)))
        found = self._caster.visibility(one, chosen, pool=self._pool)[0]
        spent = (time.perf_counter() - start) / len(chosen)
        self._ray_s += _KEEP * (min(spent, 1e-3) - self._ray_s)
        return found.astype(np.uint8)
