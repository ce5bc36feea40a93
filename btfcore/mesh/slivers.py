"""Triangles of no area whose corners are distinct: three vertices on one line.

Dropping such a cap tears the surface open along its long edge; flipping that edge mends it.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.mesh.topology import edges, twins
from btfcore.types import F8, I4, I8

_ROUNDS = 20


def flat_faces(vertices: F8, faces: I4, height: float) -> I8:
    """Find the faces whose smallest height is at most `height`."""
    return np.flatnonzero(_flat(vertices, faces, height))


def flip_caps(vertices: F8, faces: I4, height: float) -> tuple[I4, int]:
    """Flip the longest edge of every flat face where the neighbour there allows it.

    faces : (F, 3) manifold; stays so. Returns the faces and the number of flips; faces that
    are still flat had no neighbour, or the flipped edge exists already.
    """
    result = faces.copy()
    flips = 0
    for _ in range(_ROUNDS):
        flat = flat_faces(vertices, result, height)
        if len(flat) == 0:
            break
        done = _flip_round(vertices, result, flat)
        flips += done
        if done == 0:
            break
    return result, flips


def _flip_round(vertices: F8, faces: I4, flat: I8) -> int:
    """Flip in place what can be flipped without two flips touching one face."""
    twin = twins(faces)
    pairs = edges(faces)[0].astype(np.int64)
    keys = pairs[:, 0] << 32 | pairs[:, 1]
    touched: set[int] = set()
    made: set[int] = set()
    for face in flat.tolist():
        corner = vertices[faces[face]]
        longest = int(np.linalg.norm(np.roll(corner, -1, axis=0) - corner, axis=1).argmax())
        other = int(twin[3 * face + longest])
        if other < 0 or face in touched or other // 3 in touched:
            continue
        start, stop, tip = (int(faces[face, (longest + k) % 3]) for k in range(3))
        far = int(faces[other // 3, (other + 2) % 3])
        key = min(tip, far) << 32 | max(tip, far)
        place = int(np.searchsorted(keys, key))
        if tip == far or key in made or (place < len(keys) and keys[place] == key):
            continue
        made.add(key)
        faces[face] = (tip, far, stop)
        faces[other // 3] = (far, tip, start)
        touched |= {face, other // 3}
    return len(touched) // 2


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
