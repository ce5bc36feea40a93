"""What a `Relighter` evaluates with: kernels, control points, culling and cast shadows.

All of it is prepared once for a decorated surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from btfcore.mesh.topology import twins
from btfcore.progress import Progress
from btfcore.render.cast import caster
from btfcore.render.control import ControlEvaluator, control_points
from btfcore.render.cull import cull_table, seen_surfels
from btfcore.render.evaluate import Evaluator
from btfcore.render.lights import Lights
from btfcore.render.material import FactorMaterial, Material
from btfcore.render.shadow_cache import ShadowCache
from btfcore.render.surfels import Placement, Surfels, surfels
from btfcore.types import F4, F8, I4, Prepared, Quilt

_CONTROL = {"midpoints": True, "control": False}  # with the middles of edges or without


@dataclass(frozen=True, eq=False)
class Followed:
    """A quilt after edits, its control points by mode, and its `Backing.halves`."""

    quilt: Quilt
    control: dict[str, ControlEvaluator]
    halves: tuple[I4, I4]


class Backing:
    """Evaluates surfels of one decorated surface in any mode."""

    def __init__(
        self,
        prepared: Prepared,
        quilt: Quilt,
        materials: Sequence[Material],
        surfels: Surfels,
        source: I4,
        place: Placement,
        pool: Executor | None,
        progress: Progress,
    ) -> None:
        """Prepare; `source` is the gutter's, see `btfcore.render.gutter.gutter_source`."""
        self._prepared, self._quilt = prepared, quilt
        self._surfels, self._pool = surfels, pool
        self._place = place
        self._evaluator = Evaluator(materials)
        self._control: dict[str, ControlEvaluator] = {}
        self._factors = any(isinstance(each, FactorMaterial) for each in materials)
        progress(0.3, "preparing the light")
        self._table = cull_table(prepared.atlas, source, place)
        self._open = bool((twins(prepared.mesh.faces) < 0).any())
        progress(0.4, "preparing the light")
        mesh, dense = prepared.mesh, prepared.dense
        self.shadows = ShadowCache(
            caster(
                place.to_scene(mesh.vertices), mesh.faces, surfels,
                face=dense.face, bary=dense.bary,
            ),
            pool,
        )  # fmt: skip

    def offers(self, mode: str) -> bool:
        """Whether there is such a mode for these materials."""
        return mode in ("full", "half") or (mode in _CONTROL and self._factors)

    def seen(self, eye: F8) -> I4:
        """Surfels (n,) i4, ascending, that can influence a picture from `eye`.

        Of a mesh with a boundary the backs count too: they are drawn.
        """
        return seen_surfels(self._table, eye, two_sided=self._open)

    def radiance(
        self,
        mode: str,
        chosen: I4,
        eye: F8,
        lights: Lights,
        shade: F4 | None = None,
        out: F4 | None = None,
    ) -> F4:
        """Radiance (n, 3) f4 of surfels in a mode; shade (L, n): what arrives of each light."""
        way: Evaluator | ControlEvaluator = self._evaluator
        if mode in _CONTROL:
            way = self._contracted(mode)
        return way.radiance(
            self._surfels, eye, lights, chosen, visible=shade, out=out, pool=self._pool
        )

    def _contracted(self, mode: str) -> ControlEvaluator:
        """Evaluate at the control points of a mode, which are found on first use."""
        if mode not in self._control:
            prepared = self._prepared
            control = control_points(
                prepared.mesh, prepared.dense, self._quilt, self._surfels, self._place,
                midpoints=_CONTROL[mode],
            )  # fmt: skip
            self._control[mode] = ControlEvaluator(self._evaluator, control)
        return self._control[mode]

    def followed(self, quilt: Quilt) -> Followed:
        """What modes by whole patches need of another quilt; for any thread."""
        prepared = self._prepared
        shown = surfels(prepared.dense, prepared.field, quilt, self._place)
        control = {
            mode: ControlEvaluator(
                self._evaluator,
                control_points(
                    prepared.mesh, prepared.dense, quilt, shown, self._place,
                    midpoints=_CONTROL[mode],
                ),
            )
            for mode in list(self._control)
        }  # fmt: skip
        return Followed(quilt, control, _halves(prepared, quilt))

    def follow(self, made: Followed) -> None:
        """Go on with another quilt of the same surface, which the surfels show already."""
        self._quilt = made.quilt
        self._control = dict(made.control)

    def halves(self) -> tuple[I4, I4]:
        """Group (n,) i4 of every surfel, 2 x 2 texels of one patch, and a surfel (G,) of each."""
        return _halves(self._prepared, self._quilt)


def _halves(prepared: Prepared, quilt: Quilt) -> tuple[I4, I4]:
    dense, patch = prepared.dense, quilt.patch.astype(np.int64)
    side = dense.size // 2 + 1
    row, column = dense.texel.astype(np.int64).T // 2
    key = ((patch + 1) * side + row) * side + column
    _, first, group = np.unique(key, return_index=True, return_inverse=True)
    return group.reshape(-1).astype(np.int32), first.astype(np.int32)
