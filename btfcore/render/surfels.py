"""Points of a decorated surface that can be shaded: where, in which frame, of which texel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from btfcore.connection import frames
from btfcore.errors import InvalidParameter
from btfcore.types import F4, F8, I4, U2, DenseMesh, Field, Frozen, Quilt

BARE = 65535  # sample number of a surfel on which no patch lies
_LEAST = 1e-6


@dataclass(frozen=True)
class Placement:
    """Scene coordinates: scene = (world - centre) · scale, inside the unit ball.

    Meshes far from the origin or of absurd size keep their precision in single floats.
    """

    centre: tuple[float, float, float]
    scale: float

    def to_scene(self, points: F8) -> F8:
        """Scene coordinates (…, 3) f8 of world positions (…, 3)."""
        return (np.asarray(points, np.float64) - np.array(self.centre)) * self.scale


@dataclass(frozen=True, eq=False)
class Surfels(Frozen):
    """Surface elements, numbered like the dense vertices that they were made from.

    position (n, 3) f4 scene coordinates; frame (n, 3, 3) f4: rows s, t, n, unit, orthogonal
    and right-handed: where the sample's +column and -row point, and the outward normal;
    source (n, 2) f4 (column, row) in the sample; sample (n,) u2, `BARE` where none is.
    """

    position: F4
    frame: F4
    source: F4
    sample: U2

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.sample)


def placement(points: F8) -> Placement:
    """Bring the bounding box of world positions (n, 3) into the unit ball around the origin."""
    low, high = points.min(axis=0), points.max(axis=0)
    radius = float(np.linalg.norm(high / 2 - low / 2))
    centre = low / 2 + high / 2
    return Placement(
        (float(centre[0]), float(centre[1]), float(centre[2])), 1.0 / max(radius, 1e-300)
    )


def surfels(dense: DenseMesh, field: Field, quilt: Quilt, place: Placement) -> Surfels:
    """One surfel per dense vertex.

    s is the field's tangent turned by the quilt's angle about the normal. Where normal or
    tangent are degenerate any orthonormal frame is taken. Raises `InvalidParameter` where a
    covered vertex has a position in the sample, or an angle, that is not finite, and where
    the arrays are of different meshes.
    """
    count = len(dense.vertices)
    if len(field.tangents) != count or len(quilt.patch) != count:
        raise InvalidParameter(
            f"a field of {len(field.tangents)} and a quilt of {len(quilt.patch)} vertices on a"
            f" dense mesh of {count}"
        )
    covered = quilt.patch >= 0
    good = np.isfinite(quilt.source).all(axis=1) & np.isfinite(quilt.angle)
    if not good[covered].all():
        raise InvalidParameter(
            f"the quilt holds {int((covered & ~good).sum())} positions that are not finite"
        )
    angle = np.where(covered, quilt.angle, 0).astype(np.float64)
    return Surfels(
        place.to_scene(dense.vertices).astype(np.float32),
        turned_frames(dense.normals, field.tangents, angle),
        np.where(covered[:, None], quilt.source, 0).astype(np.float32),
        np.where(covered, quilt.sample, BARE).astype(np.uint16),
    )


def rewrite(there: Surfels, vertices: I4, part: Quilt, normals: F4, tangents: F4) -> None:
    """Give the surfels `vertices` (n,) the values `part` (n,) of a quilt that is being painted.

    The only way in which surfels change, for those who own them. normals, tangents (n, 3): there.
    Raises `InvalidParameter` as `surfels` does.
    """
    covered = part.patch >= 0
    good = np.isfinite(part.source).all(axis=1) & np.isfinite(part.angle)
    if not good[covered].all():
        raise InvalidParameter(
            f"the quilt holds {int((covered & ~good).sum())} positions that are not finite"
        )
    angle = np.where(covered, part.angle, 0).astype(np.float64)
    values = (
        (there.frame, turned_frames(normals, tangents, angle)),
        (there.source, np.where(covered[:, None], part.source, 0)),
        (there.sample, np.where(covered, part.sample, BARE)),
    )
    for array, value in values:
        array.flags.writeable = True
        array[vertices] = value
        array.flags.writeable = False


def turned_frames(normals: F4, tangents: F4, angle: F8) -> F4:
    """Frames (n, 3, 3) f4 with rows s, t, n; s is the tangent turned by `angle` (n,) about n."""
    up, lost = _unit(normals.astype(np.float64))
    up[lost] = (0.0, 0.0, 1.0)
    flat = tangents.astype(np.float64)
    flat = flat - up * (flat * up).sum(axis=1)[:, None]
    along, lost = _unit(flat)
    along[lost] = frames(up[lost])[0]
    across = np.cross(up, along)
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    column, away = c * along + s * across, c * across - s * along
    return np.stack([column, away, up], axis=1).astype(np.float32)


def _unit(vectors: F8) -> tuple[F8, NDArray[np.bool_]]:
    """Unit vectors, and which (n,) were too short or not finite."""
    sound = np.asarray(np.isfinite(vectors).all(axis=1))
    vectors = np.where(sound[:, None], vectors, 0.0)
    length = np.asarray(np.linalg.norm(vectors, axis=1), np.float64)
    lost = np.asarray(~((length > _LEAST) & (length < np.inf)), bool)
    return vectors / np.where(lost, 1.0, length)[:, None], lost
