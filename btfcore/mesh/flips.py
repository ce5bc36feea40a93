"""Edge flips that mend triangles without area and polygons that were cut up badly.

Dropping a cap (three vertices on one line) tears the surface open along its long edge;
flipping that edge mends it. A fan over a concave polygon folds back onto itself; flipping the
folded edges lays it flat.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.mesh.topology import edges, twins
from btfcore.types import F8, I4, I8

_ROUNDS = 20
_FOLDED = -0.9999  # cosine between the normals of two faces that lie on each other


def flat_faces(vertices: F8, faces: I4, height: float) -> I8:
    """Find the faces whose smallest height is at most `height`."""
    return np.flatnonzero(_flat(vertices, faces, height))


def flip_caps(vertices: F8, faces: I4, height: float) -> tuple[I4, int]:
    """Flip the longest edge of every flat face where the neighbour there allows it.

    faces : (F, 3) manifold; stays so. Returns the faces and the number of flips; faces that
    are still flat had no neighbour, or the flipped edge exists already.
    """

    def long_edges(current: I4) -> I8:
        flat = flat_faces(vertices, current, height)
        corner = vertices[current[flat]]
        side = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2)
        return 3 * flat + side.argmax(axis=1)

    return _flip_in_rounds(faces, long_edges, lambda start, far, stop, tip: True)


def unfold(vertices: F8, faces: I4) -> tuple[I4, int]:
    """Flip edges whose two faces lie on each other, where that lays them side by side.

    faces : (F, 3) manifold and coherently wound; stays so. A fold stays where no flip gives
    two faces that agree in direction and cover just what the larger covered alone.
    Returns the faces and the number of flips.
    """

    def folded(current: I4) -> I8:
        normal = _unit_normals(vertices, current)
        twin = twins(current)
        half = np.flatnonzero(twin > np.arange(len(twin)))
        cosine = np.einsum("hi,hi->h", normal[half // 3], normal[twin[half] // 3])
        return half[cosine < _FOLDED]

    def lies_flat(start: int, far: int, stop: int, tip: int) -> bool:
        one, two = _area(vertices, start, stop, tip), _area(vertices, stop, start, far)
        new_one, new_two = _area(vertices, tip, far, stop), _area(vertices, far, tip, start)
        total = one + two
        size = np.linalg.norm(total)
        both = min(float(new_one @ total), float(new_two @ total))
        spread = np.linalg.norm(new_one) + np.linalg.norm(new_two)
        return bool(both > 1e-6 * size * size and spread <= size * 1.001)

    return _flip_in_rounds(faces, folded, lies_flat)


def _flip_in_rounds(
    faces: I4, choose: Callable[[I4], I8], accept: Callable[[int, int, int, int], bool]
) -> tuple[I4, int]:
    """Flip the half-edges that `choose` names, round after round, until none can be."""
    result = faces.copy()
    flips = 0
    for _ in range(_ROUNDS):
        chosen = choose(result)
        done = _flip(result, chosen.tolist(), accept) if len(chosen) else 0
        flips += done
        if done == 0:
            break
    return result, flips


def _flip(
    faces: I4, half_edges: Iterable[int], accept: Callable[[int, int, int, int], bool]
) -> int:
    """Flip in place, no face twice and never onto an edge that exists; returns how many.

    accept : asked with the quadrilateral's vertices in turn, of which the first and third
    are the ends of the present edge.
    """
    twin = twins(faces)
    pairs = edges(faces)[0].astype(np.int64)
    keys = pairs[:, 0] << 32 | pairs[:, 1]
    touched: set[int] = set()
    made: set[int] = set()
    for half_edge in half_edges:
        (face, corner), other = divmod(half_edge, 3), int(twin[half_edge])
        if other < 0 or face in touched or other // 3 in touched:
            continue
        start, stop, tip = (int(faces[face, (corner + k) % 3]) for k in range(3))
        far = int(faces[other // 3, (other + 2) % 3])
        key = min(tip, far) << 32 | max(tip, far)
        place = int(np.searchsorted(keys, key))
        if tip == far or key in made or (place < len(keys) and keys[place] == key):
            continue
        if not accept(start, far, stop, tip):
            continue
        made.add(key)
        faces[face] = (tip, far, stop)
        faces[other // 3] = (far, tip, start)
        touched |= {face, other // 3}
    return len(touched) // 2


def _area(vertices: F8, a: int, b: int, c: int) -> F8:
    """Twice the area of a triangle, along its normal."""
    return np.cross(vertices[b] - vertices[a], vertices[c] - vertices[a])


def _unit_normals(vertices: F8, faces: I4) -> F8:
    corner = vertices[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)


@njit(cache=True)
def _flat(vertices: F8, faces: I4, height: float) -> NDArray[np.bool_]:
    flat = np.empty(len(faces), np.bool_)
    side = np.empty((3, 3))
    for face in range(len(faces)):
        longest = 0.0
        for corner in range(3):
            squared = 0.0
            for axis in range(3):
                step = (
                    vertices[faces[face, (corner + 1) % 3], axis]
                    - vertices[faces[face, corner], axis]
                )
                side[corner, axis] = step
                squared += step * step
            longest = max(longest, squared)
        x = side[0, 1] * side[1, 2] - side[0, 2] * side[1, 1]
        y = side[0, 2] * side[1, 0] - side[0, 0] * side[1, 2]
        z = side[0, 0] * side[1, 1] - side[0, 1] * side[1, 0]
        flat[face] = np.sqrt(x * x + y * y + z * z) <= height * np.sqrt(longest)
    return flat
