"""A flattened patch in the field's frame, ready to be placed on the sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from btfcore.patch.bend import bent, fit_bend
from btfcore.patch.connectivity import Connectivity
from btfcore.patch.distortion import field_directions
from btfcore.patch.flatten import FlatPatch
from btfcore.quilt.patches import median_direction
from btfcore.types import F8, I4

C16 = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Lay:
    """A patch about its centre, the field's median along +x.

    plane (n,) complex: its vertices in dense-mesh steps, y up; turn (inner,) complex: the
    field's unit directions in it; mean: the direction that the plane was turned back by.
    """

    patch: FlatPatch
    plane: C16
    turn: C16
    mean: complex

    def points(self, unit: float) -> C16:
        """Vertices (n,) complex in grid texels of `unit` steps."""
        return self.plane / unit

    def angles(self, rotation: C16) -> F8:
        """Angles (inner,) from the field to the sample where a placement turns by `rotation`."""
        return np.asarray(-np.angle(self.turn * rotation[: len(self.turn)]))


def lay_along_field(
    net: Connectivity, local: I4, patch: FlatPatch, *, bend: float, core: int | None = None
) -> Lay:
    """Bend a patch along the field by at most `bend` and turn the field's median to +x.

    local (N,): positions in the patch; core: vertices whose median counts, None: all proper.
    """
    turn = _directions(net, local, patch)
    if bend > 0.0:
        everywhere = np.ones(patch.inner, np.bool_)
        by, _ = fit_bend(turn, patch.plane, everywhere, patch.inner, bend)
        patch.plane = bent(patch.plane, by)
        turn = _directions(net, local, patch)
    mean = complex(median_direction(turn[:core], turn[0]))
    plane = (patch.plane[:, 0] + 1j * patch.plane[:, 1]) * mean.conjugate()
    return Lay(patch, plane, turn * mean.conjugate(), mean)


def _directions(net: Connectivity, local: I4, patch: FlatPatch) -> C16:
    turn = field_directions(
        net.indptr, net.indices, net.edge, patch.order, patch.inner, local, patch.plane
    )
    return np.asarray(turn[:, 0] + 1j * turn[:, 1])
