"""The discrete connection: directions carried from normal to normal by the least rotation.

Carrying a direction around a triangle turns it by the area of the spherical triangle of the
three normals, so that the sum over a closed surface is its total curvature, 2π times the
Euler number, whenever the normals follow the surface.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.progress import Progress, blocks, silent
from btfcore.types import F4, F8, I4

C16 = NDArray[np.complex128]
OPPOSED = -0.95  # beyond this cosine the least rotation between two normals says nothing


def frames(normals: F8) -> tuple[F8, F8]:
    """Two unit tangents (s, t) at each unit normal, (n, 3) each, with t = n × s."""
    rows, least = np.arange(len(normals)), np.abs(normals).argmin(axis=1)
    s = -normals * normals[rows, least][:, None]
    s[rows, least] += 1.0
    s /= np.linalg.norm(s, axis=1)[:, None]
    return s, np.cross(normals, s)


def carried(vectors: F8, start: F8, stop: F8) -> F8:
    """Tangent vectors at unit normals `start` by the least rotation to `stop`; all (n, 3)."""
    both = start + stop
    scale = (stop * vectors).sum(axis=1) / np.maximum(1.0 + (start * stop).sum(axis=1), 1e-9)
    return vectors - scale[:, None] * both


def transports(normals: F8, pairs: I4) -> C16:
    """Connect pairs (E, 2) of unit normals by complex numbers of length 1.

    r[e] takes the coordinates of a tangent vector in the frame of pairs[e, 0] to those of its
    carried copy in the frame of pairs[e, 1]. 0 where the two normals are opposed.
    """
    s, t = frames(normals)
    tail, head = pairs.T
    moved = carried(s[tail], normals[tail], normals[head])
    turn = (moved * s[head]).sum(axis=1) + 1j * (moved * t[head]).sum(axis=1)
    turn /= np.maximum(np.abs(turn), 1e-12)
    turn[(normals[tail] * normals[head]).sum(axis=1) < OPPOSED] = 0.0
    return turn


def face_indices(normals: F4, tangents: F4, faces: I4, *, progress: Progress = silent) -> I4:
    """How often a direction field turns around in each triangle, (G,) i4; usually 0.

    normals, tangents : (N, 3) f4 unit and orthogonal. On a closed component the indices sum
    to the Euler number (Poincaré and Hopf), as the turns along edges cancel and the areas of
    the normals' triangles sum to the total curvature.
    """
    out = np.zeros(len(faces), np.int32)
    for begin, end in blocks(len(faces), 1 << 20, progress, "singularities"):
        _face_indices(normals, tangents, faces[begin:end], out[begin:end])
    return out


@njit(cache=True)
def _turn(n0: F8, s0: F8, n1: F8, s1: F8) -> float:
    """Angle from the carried s0 to s1, about n1."""
    onto = (n1 * s0).sum() / max(1.0 + (n0 * n1).sum(), 1e-9)
    moved = s0 - onto * (n0 + n1)
    across = np.cross(n1, moved)
    return np.arctan2((across * s1).sum(), (moved * s1).sum())


@njit(cache=True)
def _face_indices(normals: F4, tangents: F4, faces: I4, out: I4) -> None:
    n = np.empty((3, 3))
    s = np.empty((3, 3))
    for face in range(len(faces)):
        calm = True
        for k in range(3):
            a, b = faces[face, k], faces[face, (k + 1) % 3]
            along, lean = 0.0, 0.0
            for axis in range(3):
                along += tangents[a, axis] * tangents[b, axis]
                lean += normals[a, axis] * normals[b, axis]
            calm = calm and along > 0.7 and lean > 0.7
        if calm:  # three small turns and a small area cannot make a whole turn
            continue
        for k in range(3):
            vertex = faces[face, k]
            for axis in range(3):
                n[k, axis] = normals[vertex, axis]
                s[k, axis] = tangents[vertex, axis]
        total = 0.0
        for k in range(3):
            # each edge is turned along from its lower vertex, lest ±π round differently
            other = (k + 1) % 3
            if faces[face, k] < faces[face, other]:
                total += _turn(n[k], s[k], n[other], s[other])
            else:
                total -= _turn(n[other], s[other], n[k], s[k])
        triple = (n[0] * np.cross(n[1], n[2])).sum()
        dots = (n[0] * n[1]).sum() + (n[1] * n[2]).sum() + (n[2] * n[0]).sum()
        area = 2.0 * np.arctan2(triple, 1.0 + dots)
        out[face] = np.int32(np.rint((total + area) / (2.0 * np.pi)))
