"""Makes a clean, manifold, coherently wound mesh of whatever triangles a file held."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from btfcore.errors import InvalidMesh
from btfcore.mesh.distance import nearest_face
from btfcore.mesh.duplicates import unrepeated
from btfcore.mesh.flips import flat_faces, flip_caps, unfold
from btfcore.mesh.regions import Regions
from btfcore.mesh.split import split_nonmanifold
from btfcore.mesh.topology import edges, is_manifold
from btfcore.mesh.weld import collapse_short_edges, weld
from btfcore.mesh.winding import agree, outward
from btfcore.progress import Progress, silent
from btfcore.types import F8, I4, I8, Mesh

# Single precision, in which files and graphics cards keep coordinates, must hold a volume.
_SMALLEST, _LARGEST = 1e-12, 1e12
# Of the extent: lower triangles and shorter edges count as having no area and no length.
_FLAT = 1e-12
# Double precision must leave this many steps across the extent of a mesh far from the origin.
_STEPS = 1e6
_LABEL = "repairing"
_ROUNDS = 4


def repair(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    regions: Regions | None = None,
    progress: Progress = silent,
) -> tuple[Mesh, tuple[str, ...]]:
    """Mend what can be mended without changing the shape, and say what was done.

    vertices (V, 3) and faces (F, 3) as a file gave them: positions may repeat, faces may be
    degenerate, duplicated, wound at random and crowded around edges. The result is manifold
    with coherent winding, every position merged where that keeps it manifold, closed
    components turned outward, borders kept, no face lower than 1e-12 of the extent and no
    vertex without a face. Notes name each thing mended and its number. `regions` of the
    given faces go with them.

    Raises `InvalidMesh` where faces name vertices that do not exist, no face of positive area
    is left, the extent lies outside 1e-12 … 1e12, or the mesh lies so far from the origin
    that double precision leaves fewer than 1e6 steps across it.
    """
    points, triangles = _checked(vertices, faces)
    notes: list[str] = []
    triangles, origin = _without_nonfinite(points, triangles, notes)
    if len(triangles) == 0:
        raise InvalidMesh("no triangle is left: the mesh has no face with finite corners")
    tolerance = _FLAT * _extent(points[triangles.reshape(-1)])
    points, triangles = weld(points, triangles)
    progress(0.1, _LABEL)
    triangles, merged = collapse_short_edges(points, triangles, tolerance)
    _note(notes, merged, "merged vertices at the ends of edges without length")
    triangles, kept = _without_repeats(triangles, notes)
    points, triangles = _compact(points, triangles)
    progress(0.2, _LABEL)
    triangles, reversed_count = agree(triangles)
    progress(0.4, _LABEL)
    _note(notes, reversed_count, "faces reversed to agree with their neighbours")
    points, triangles, left = _manifold(points, triangles, tolerance, notes, progress)
    progress(0.7, _LABEL)
    triangles, turned = outward(points, triangles)
    _note(notes, turned, "closed components turned outward")
    progress(0.8, _LABEL)
    _recheck(points, triangles, tolerance)
    if regions is None:
        return Mesh(points, triangles), tuple(notes)
    label = regions.label[origin[kept[left]]]
    return Mesh(points, triangles, label, regions.names), tuple(notes)


def _checked(vertices: ArrayLike, faces: ArrayLike) -> tuple[F8, I4]:
    """Bring the arrays into shape and check what the faces name."""
    points = np.asarray(vertices, np.float64)
    triangles = np.asarray(faces)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InvalidMesh(f"vertices have shape {points.shape}, not (V, 3)")
    if triangles.size == 0:
        raise InvalidMesh(f"the mesh has {len(points)} vertices but no triangle")
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
        raise InvalidMesh(f"faces have shape {triangles.shape}, not (F, 3) of integers")
    low, high = int(triangles.min()), int(triangles.max())
    if low < 0 or high >= len(points):
        raise InvalidMesh(f"faces name vertices {low}..{high}, the mesh has {len(points)}")
    return points, np.ascontiguousarray(triangles, np.int32)


def _without_nonfinite(points: F8, triangles: I4, notes: list[str]) -> tuple[I4, I8]:
    """Faces with finite corners, and which they were; so the functions below."""
    finite = np.asarray(np.isfinite(points).all(axis=1))
    kept = np.flatnonzero(finite[triangles].all(axis=1))
    _note(notes, len(triangles) - len(kept), "dropped faces with corners that are not finite")
    return triangles[kept], kept


def _extent(points: F8) -> float:
    """Longest side of the bounding box, checked to be a size that can be worked with."""
    low, high = points.min(axis=0), points.max(axis=0)
    with np.errstate(over="ignore"):
        extent = float((high - low).max())
    if not _SMALLEST <= extent <= _LARGEST:
        raise InvalidMesh(
            f"the mesh's extent is {extent:.3g} units; sizes from {_SMALLEST:g} to"
            f" {_LARGEST:g} can be worked with: rescale it"
        )
    farthest = float(max(np.abs(low).max(), np.abs(high).max()))
    if float(np.spacing(farthest)) * _STEPS > extent:
        raise InvalidMesh(
            f"the mesh is {extent:.3g} units large but lies {farthest:.3g} from the origin,"
            " where coordinates are too coarse for it: move it to the origin"
        )
    return extent


def _without_repeats(triangles: I4, notes: list[str]) -> tuple[I4, I8]:
    """Drop faces that name a vertex twice, and duplicates."""
    proper = np.flatnonzero((triangles != np.roll(triangles, 1, axis=1)).all(axis=1))
    _note(notes, len(triangles) - len(proper), "dropped faces whose corners coincide")
    if len(proper) == 0:
        raise InvalidMesh("no triangle is left: all faces have zero area")
    kept, copies, folded = unrepeated(triangles[proper])
    _note(notes, copies, "dropped duplicate faces")
    _note(notes, folded, "dropped faces of folds without thickness")
    return triangles[proper[kept]], proper[kept]


def _manifold(
    points: F8, triangles: I4, tolerance: float, notes: list[str], progress: Progress
) -> tuple[F8, I4, I8]:
    """Split what is not manifold, and mend or drop faces of no area.

    A face changed by a flip comes from the face that covers its middle.
    """
    corners, origin = points[triangles], np.arange(len(triangles))
    crowded = int((edges(triangles)[1] > 2).sum())
    extra, flipped, dropped = 0, 0, 0
    for _ in range(_ROUNDS):
        progress(0.5, _LABEL)
        triangles, source = split_nonmanifold(points, triangles)
        extra += len(source) - len(points)
        points = points[source]
        triangles, count = flip_caps(points, triangles, tolerance)
        flipped += count
        flat = flat_faces(points, triangles, tolerance)
        if len(flat) == 0:
            break
        dropped += len(flat)
        triangles, origin = np.delete(triangles, flat, axis=0), np.delete(origin, flat)
        if len(triangles) == 0:
            raise InvalidMesh("no triangle is left: all faces have zero area")
        points, triangles = _compact(points, triangles)
    progress(0.6, _LABEL)
    triangles, unfolded = unfold(points, triangles)
    _note(notes, crowded, "edges of more than two faces taken apart")
    _note(notes, extra, "vertices split where surfaces merely touch")
    _note(notes, flipped, "edges flipped at faces without area")
    _note(notes, dropped, "dropped faces without area")
    _note(notes, unfolded, "edges flipped where faces were folded onto each other")
    if flipped or unfolded:
        moved = np.flatnonzero((points[triangles] != corners[origin]).any(axis=(1, 2)))
        middle = points[triangles[moved]].mean(axis=1)
        origin[moved] = nearest_face(middle, corners)
    return points, triangles, origin


def _compact(points: F8, triangles: I4) -> tuple[F8, I4]:
    """Drop vertices that no face names."""
    named = np.zeros(len(points), bool)
    named[triangles] = True
    return points[named], (np.cumsum(named) - 1)[triangles].astype(np.int32)


def _recheck(points: F8, triangles: I4, tolerance: float) -> None:
    """Trust nothing: the promises of `repair`, tested on its result."""
    if not is_manifold(triangles):
        crowded = int((edges(triangles)[1] > 2).sum())
        raise InvalidMesh(f"the mesh cannot be made manifold: {crowded} crowded edges remain")
    flat = len(flat_faces(points, triangles, tolerance))
    if flat:
        raise InvalidMesh(f"{flat} faces without area cannot be removed")


def _note(notes: list[str], count: int, what: str) -> None:
    if count:
        notes.append(f"{what}: {count:,}")
