"""Edits as data: what an artist asked for, apart from any rate, mesh index or result.

Positions are points near the surface in world units, so that an edit can be replayed on
another dense mesh of the same shape.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Literal

import numpy as np

from btfcore.errors import InvalidEdit
from btfcore.types import F8, I4, Frozen

Orientation = Literal["auto", "field", "search", "stroke"]
ORIENTATIONS = ("auto", "field", "search", "stroke")
MOST_POINTS = 100_000
MOST_WIDTH = 1e300  # what a file can hold


@dataclass(frozen=True, eq=False)
class Stroke(Frozen):
    """One movement of the brush.

    points (n, 3) f8: the polyline, in world units; normals (n, 3) f8 or None: where given, the
    side of the surface that is meant; radius: of the brush at full pressure, in world units;
    pressure (n,) f8 in 0–1 or None (full): the radius at a point is radius times it;
    hardness: 1 is a sharp brush; below it, the edge is faded over (1 - hardness) of the radius.
    """

    points: F8
    radius: float
    normals: F8 | None = None
    pressure: F8 | None = None
    hardness: float = 1.0

    def __post_init__(self) -> None:
        """Check shapes and numbers, then lock the arrays."""
        shape = self.points.shape
        if self.points.ndim != 2 or shape[1] != 3 or not 1 <= shape[0] <= MOST_POINTS:
            raise InvalidEdit(
                f"a stroke of shape {shape}; it needs 1 … {MOST_POINTS:,} x 3 numbers"
            )
        _finite("points of a stroke", self.points)
        if not 0 < self.radius < math.inf:
            raise InvalidEdit(f"the radius of a stroke is {self.radius:g}; it must be above 0")
        if not 0 <= self.hardness <= 1:
            raise InvalidEdit(f"the hardness of a stroke is {self.hardness:g}, outside 0 … 1")
        if self.normals is not None:
            if self.normals.shape != shape:
                raise InvalidEdit(f"normals of shape {self.normals.shape} for {shape[0]} points")
            _finite("normals of a stroke", self.normals)
        if self.pressure is not None:
            if self.pressure.shape != shape[:1]:
                raise InvalidEdit(f"{self.pressure.size} pressures for {shape[0]} points")
            wrong = ~((self.pressure >= 0) & (self.pressure <= 1))  # also true for NaN
            if wrong.any():
                first = int(np.flatnonzero(wrong)[0])
                raise InvalidEdit(
                    f"pressure {first} of a stroke is {self.pressure[first]:g}, outside 0 … 1"
                )
        super().__post_init__()


@dataclass(frozen=True, eq=False)
class Area(Frozen):
    """Where an edit applies: the union of its parts.

    strokes; faces (n,) i4: triangles of the input mesh; region: one of the mesh's named
    regions; everywhere: the whole surface; vertices (n,) i4: vertices of the dense mesh, which
    only mean something at sampling rate `rate`.
    """

    strokes: tuple[Stroke, ...] = ()
    faces: I4 | None = None
    region: str | None = None
    everywhere: bool = False
    vertices: I4 | None = None
    rate: int | None = None

    def __post_init__(self) -> None:
        """Refuse an area of nothing."""
        parts = (self.faces, self.vertices)
        if not (
            self.strokes
            or self.region is not None
            or self.everywhere
            or any(part is not None and len(part) for part in parts)
        ):
            raise InvalidEdit("the area of an edit is empty: no stroke, face, region or vertex")
        if self.vertices is not None and self.rate is None:
            raise InvalidEdit("an area of dense vertices needs the rate that they belong to")
        super().__post_init__()


@dataclass(frozen=True)
class Symmetry:
    """Images of an edit that are made along with it.

    mirror: axes among "xyz" across whose planes through `origin` it is mirrored, all
    combinations; radial: how many copies stand around the axis `axis` through `origin`.
    """

    mirror: str = ""
    radial: int = 1
    axis: Literal["x", "y", "z"] = "y"
    origin: tuple[float, float, float] | None = None  # None: middle of the bounding box

    def __post_init__(self) -> None:
        """Check axes and counts."""
        if len(set(self.mirror)) != len(self.mirror) or not set(self.mirror) <= set("xyz"):
            raise InvalidEdit(f"symmetry across {self.mirror!r}; there are x, y and z, each once")
        if not 1 <= self.radial <= 64:
            raise InvalidEdit(f"radial symmetry of {self.radial}, outside 1 … 64")
        if self.axis not in ("x", "y", "z"):
            raise InvalidEdit(f"radial symmetry around {self.axis!r}; there are x, y and z")
        if self.origin is not None:
            _finite("the origin of a symmetry", np.array(self.origin))

    @property
    def plain(self) -> bool:
        """Whether there is no image but the edit itself."""
        return not self.mirror and self.radial == 1


@dataclass(frozen=True, eq=False, kw_only=True)
class Edit:
    """What all edits have; `uid` (≥ 0) never changes and is never given again."""

    uid: int = -1
    name: str = ""
    visible: bool = True
    seed: int = 0
    symmetry: Symmetry = field(default_factory=Symmetry)

    def __post_init__(self) -> None:
        """Check what all edits have."""
        if not 0 <= self.seed < 2**32:
            raise InvalidEdit(f"the seed is {self.seed}, outside 0 … {2**32 - 1}")


@dataclass(frozen=True, eq=False, kw_only=True)
class PaintEdit(Edit):
    """Foreground synthesis: the sample's feature S_f over an area F (Zhou §IV-A).

    sample: which of the document's samples; weight: λ of the constraint energy; transition:
    width in world units of the zone, centred on the area's edge, over which m_0 falls from 1
    to 0 (None: the feature's own half-width, but no more than a brush's radius; 0: abrupt);
    orientation: the sample follows the
    field, or the best of 24 turns is searched, or the feature follows the stroke, or "auto":
    searched where the sample's background has no orientation of its own; protect:
    features that are there already are wanted too; work_patch: radius of a patch in levels
    (None: from the feature's and the brush's width).
    """

    area: Area
    sample: int
    weight: float = 0.5
    transition: float | None = None
    orientation: Orientation = "auto"
    protect: bool = True
    work_patch: int | None = None

    def __post_init__(self) -> None:
        """Check the knobs."""
        super().__post_init__()
        _within("weight", self.weight, 0.0, 1e3)
        if self.transition is not None:
            _within("transition", self.transition, 0.0, MOST_WIDTH)
        if self.orientation not in ORIENTATIONS:
            raise InvalidEdit(
                f"orientation {self.orientation!r}; there are {', '.join(ORIENTATIONS)}"
            )
        if self.work_patch is not None:
            _within("work_patch", self.work_patch, 4, 200)


@dataclass(frozen=True, eq=False, kw_only=True)
class StampEdit(Edit):
    """Verbatim copy of the sample's feature (Zhou §IV-B, Kwatra et al. 2003, §4.4).

    point (3,), normal (3,) or None: where the feature's middle goes; rotation: degrees from the
    field to the sample's +column axis, counter-clockwise about the normal; scale: times its
    natural size; feature: which connected part of the mask, by falling area, None: all of it;
    protect: features that are there already may not be overwritten by the stamp's background.
    """

    point: tuple[float, float, float]
    sample: int
    normal: tuple[float, float, float] | None = None
    rotation: float = 0.0
    scale: float = 1.0
    feature: int | None = 0
    weight: float = 0.5
    protect: bool = True

    def __post_init__(self) -> None:
        """Check the knobs."""
        super().__post_init__()
        _finite("the point of a stamp", np.array(self.point))
        if self.normal is not None:
            _finite("the normal of a stamp", np.array(self.normal))
        _within("rotation", self.rotation, -1e6, 1e6)
        _within("scale", self.scale, 0.05, 20.0)
        _within("weight", self.weight, 0.0, 1e3)
        if self.feature is not None and self.feature < 0:
            raise InvalidEdit(f"feature {self.feature} of a stamp; they are numbered from 0")


@dataclass(frozen=True, eq=False, kw_only=True)
class EraseEdit(Edit):
    """Bring the background back where features lie in the area, seamlessly."""

    area: Area


@dataclass(frozen=True, eq=False, kw_only=True)
class RepairEdit(Edit):
    """Synthesise the area anew with this edit's seed; features in it are kept if `protect`."""

    area: Area
    protect: bool = True


@dataclass(frozen=True, eq=False, kw_only=True)
class RequiltEdit(Edit):
    """Cut the seams in the area again with fresh placements, at most `tries` times."""

    area: Area
    tries: int = 12

    def __post_init__(self) -> None:
        """Check the knobs."""
        super().__post_init__()
        _within("tries", self.tries, 1, 10_000)


AnyEdit = PaintEdit | StampEdit | EraseEdit | RepairEdit | RequiltEdit
KINDS: dict[str, type[AnyEdit]] = {
    "paint": PaintEdit,
    "stamp": StampEdit,
    "erase": EraseEdit,
    "repair": RepairEdit,
    "requilt": RequiltEdit,
}


def kind_of(edit: Edit) -> str:
    """Name of an edit's kind."""
    return next(name for name, kind in KINDS.items() if type(edit) is kind)


def knobs_of(edit: Edit) -> tuple[str, ...]:
    """Names of an edit's fields."""
    return tuple(item.name for item in fields(edit))


def _finite(what: str, values: F8) -> None:
    wrong = ~np.isfinite(values)
    if wrong.any():
        raise InvalidEdit(f"{int(wrong.sum())} of {values.size} numbers of {what} are not finite")


def _within(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:  # also false for NaN
        raise InvalidEdit(f"{name} is {value:g}, outside {low:g} … {high:g}")
