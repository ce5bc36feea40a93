"""From the area of an edit to the constraint m_0 on dense vertices (Zhou §IV-A, §IV-B)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.errors import InvalidEdit
from btfcore.paint.brush import MARGIN, BrushField, Dabs
from btfcore.paint.edits import Area
from btfcore.paint.geodesic import march
from btfcore.paint.locate import Locator
from btfcore.patch.connectivity import Connectivity
from btfcore.types import F4, F8, I4, Frozen, Mesh

WHOLE = "all"  # name of the one region of a mesh without regions
_SHOWN = 12  # names that an error lists


@dataclass(frozen=True, eq=False)
class Constraint(Frozen):
    """m_0 where it is above 0.

    vertices (n,) i4: dense vertices, ascending; target (n,) f4: m_0 there, in 0–1; dabs: of
    the area's strokes, in their order.
    """

    vertices: I4
    target: F4
    dabs: Dabs

    def spread(self, count: int) -> F4:
        """m_0 (count,) f4 at all vertices of the dense mesh."""
        whole = np.zeros(count, np.float32)
        whole[self.vertices] = self.target
        return whole


def zone(radius: float, hardness: float, width: float) -> float:
    """Width of the zone in which m_0 falls from 1 to 0 about the edge of a brush.

    The wider of `width` and what the brush's hardness asks for, 2·radius·(1 - hardness); all
    in one unit.
    """
    return max(width, 2.0 * radius * (1.0 - hardness))


def target(psi: F4 | F8, width: float) -> F4:
    """Constraint m_0 at signed distances `psi` from an area's edge, negative inside.

    It falls linearly from 1 to 0 over a zone of `width`, in the unit of psi; with width 0 it
    is 1 inside and on the edge and 0 outside (Zhou §IV-B and fig. 10: a sudden fall breaks the
    feature off at the edge). The zone is centred on the edge: the area where the feature is
    wanted more than not then keeps the size of what was painted, while a zone that lay
    outside would make it larger by half for a brush as narrow as most cracks.
    """
    away = np.asarray(psi, np.float64)
    if width <= 0:
        return (away <= 0).astype(np.float32)
    fall = np.clip(0.5 - away / width, 0.0, 1.0)
    return fall.astype(np.float32)


def constrain(
    area: Area, mesh: Mesh, net: Connectivity, locator: Locator, *, width: float = 0.0
) -> Constraint:
    """Find the m_0 of an area; `width` of the transition zone is in world units.

    m_0 is the largest of its parts': faces, region and vertices are one set, whose edge is
    where dense edges leave it; each stroke has the zone that its hardness asks for. The
    border of an open mesh is no edge of an area. Raises `InvalidEdit` for faces, vertices,
    regions and rates that the mesh does not have, and with the counts where the area covers
    no vertex.
    """
    count = len(locator.dense.vertices)
    step = locator.step
    whole = np.zeros(count, np.float32)
    inside, said = members(area, mesh, locator)
    if inside.any():
        psi = signed_distance(net, inside, width / step / 2 + MARGIN)
        np.maximum(whole, target(psi, width / step), out=whole)
    dabs = []
    fields: dict[float, BrushField] = {}
    for number, stroke in enumerate(area.strokes):
        wide = zone(stroke.radius, stroke.hardness, width) / step
        if wide not in fields:
            fields[wide] = BrushField(net, locator, reach=wide / 2)
        field = fields[wide]
        field.strokes = number
        dabs.append(field.paint(stroke))
        lowered = dabs[-1].lowered
        whole[lowered] = np.maximum(whole[lowered], target(field.value[lowered], wide))
    vertices = np.flatnonzero(whole).astype(np.int32)
    joined = Dabs.joined(dabs)
    if not len(vertices):
        raise InvalidEdit(_nothing(area, joined, said, locator))
    return Constraint(vertices, whole[vertices], joined)


def members(area: Area, mesh: Mesh, locator: Locator) -> tuple[NDArray[np.bool_], list[str]]:
    """Dense vertices (N,) bool of an area's faces, region and vertices, and what these are.

    Raises `InvalidEdit` for those that the mesh does not have.
    """
    dense = locator.dense
    inside = np.full(len(dense.vertices), area.everywhere)
    said = []
    if area.faces is not None and len(area.faces):
        _numbers("face", area.faces, len(mesh.faces), "the mesh")
        chosen = np.zeros(len(mesh.faces), np.bool_)
        chosen[area.faces] = True
        inside |= chosen[dense.face]
        said.append(f"{int(chosen.sum())} faces")
    if area.region is not None:
        names = mesh.region_names or (WHOLE,)
        if area.region not in names:
            raise InvalidEdit(f"the mesh has no region {area.region!r}; it has {_some(names)}")
        label = np.zeros(len(mesh.faces), np.int32) if mesh.region is None else mesh.region
        inside |= (label == names.index(area.region))[dense.face]
        said.append(f"region {area.region!r}")
    if area.vertices is not None and len(area.vertices):
        if area.rate != dense.size:
            raise InvalidEdit(
                f"the area's vertices are of rate {area.rate}, the dense mesh has {dense.size}"
            )
        _numbers("vertex", area.vertices, len(dense.vertices), f"the dense mesh at {dense.size}")
        inside[area.vertices] = True
        said.append(f"{len(area.vertices)} vertices")
    return inside, said


def signed_distance(net: Connectivity, inside: NDArray[np.bool_], limit: float) -> F4:
    """Geodesic distance (N,) f4 to the edge of a set of vertices, in steps, negative inside.

    The edge runs through the middles of the dense edges that leave `inside` (N,); fronts go
    from there to both sides. Beyond `limit` it is -inf inside and +inf outside.
    """
    seeds, start = _edge_of(net.indptr, net.indices, net.edge, inside)
    sides = []
    for side in (inside, ~inside):
        value = np.where(side, np.float32(np.inf), np.float32(-np.inf))
        own = side[seeds]
        march(net, value, seeds[own], start[own], limit)
        sides.append(value)
    return np.where(inside, -sides[0], sides[1])


@njit(cache=True)
def _edge_of(indptr, indices, edge, inside):  # type: ignore[no-untyped-def]
    """Vertices at the edge of a set, and half the shortest dense edge that crosses it there."""
    seeds = np.empty(len(inside), np.int32)
    start = np.empty(len(inside), np.float64)
    count = 0
    for vertex in range(len(inside)):
        nearest = np.inf
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            if inside[indices[slot]] != inside[vertex]:
                s, t = np.float64(edge[slot, 0]), np.float64(edge[slot, 1])
                nearest = min(nearest, np.sqrt(s * s + t * t) / 2)
        if nearest < np.inf:
            seeds[count], start[count] = vertex, nearest
            count += 1
    return seeds[:count].copy(), start[:count].copy()


def _numbers(kind: str, numbers: I4, count: int, where: str) -> None:
    wrong = np.flatnonzero((numbers < 0) | (numbers >= count))
    if len(wrong):
        raise InvalidEdit(
            f"{kind} {int(numbers[wrong[0]])} of an area is not among the {count:,} of {where}"
        )


def _some(names: Sequence[str]) -> str:
    shown = ", ".join(repr(name) for name in names[:_SHOWN])
    return shown if len(names) <= _SHOWN else f"{shown} and {len(names) - _SHOWN} more"


def _nothing(area: Area, dabs: Dabs, said: list[str], locator: Locator) -> str:
    """Say what an area without a vertex consists of."""
    parts = [f"{' and '.join(said)} hold none of them"] if said else []
    if area.strokes:
        reach = max(stroke.radius for stroke in area.strokes) / locator.step
        parts.append(
            f"of {len(area.strokes)} strokes of up to {reach:.2g} steps radius {len(dabs)} dabs lie"
            f" on the surface, {dabs.skipped} beside it, and {dabs.weightless} have no pressure"
        )
    return (
        f"the area covers none of the {len(locator.dense.vertices):,} vertices of the dense mesh: "
        + "; ".join(parts)
    )
