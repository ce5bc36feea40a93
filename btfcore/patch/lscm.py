"""Least squares conformal map of a patch: the paper's flattening, through libigl."""

from __future__ import annotations

import numpy as np

from btfcore.types import F8, I4, I8


def patch_faces(faces: I4, face_ptr: I4, face_of: I4, order: I4, local: I4) -> I8:
    """Faces (m, 3) with all corners in the patch, as positions in `order`."""
    starts, stops = face_ptr[order], face_ptr[order + 1]
    around = np.concatenate([face_of[a:b] for a, b in zip(starts, stops, strict=True)])
    mine = local[faces[np.unique(around)]].astype(np.int64)
    return np.asarray(mine[(mine >= 0).all(axis=1)])


def lscm(points: F8, faces: I8, normal: F8, tangent: F8) -> F8 | None:
    """Flatten a patch by LSCM (Lévy et al. 2002), its first vertex at the origin.

    points (n, 3), faces (m, 3) in patch numbering. Two vertices are pinned: the first and the
    one farthest from it; the size is then set so that the area is kept, and the plane is
    turned so that `tangent` at the first vertex keeps its direction in (tangent, normal ×
    tangent). Returns (n, 2) f8, NaN at vertices without a face, or None where the patch has
    no such map.
    """
    import igl

    used = np.zeros(len(points), bool)
    used[faces] = True
    if len(faces) == 0 or not used[0]:
        return None
    place = np.cumsum(used) - 1
    inner, mine = points[used], place[faces]
    away = int(np.argmax(((inner - inner[0]) ** 2).sum(axis=1)))
    reach = float(np.linalg.norm(inner[away] - inner[0]))
    if reach == 0.0:
        return None
    pins = np.array([0, away], np.int64)
    try:
        flat, _ = igl.lscm(inner, mine, pins, np.array([[0.0, 0.0], [reach, 0.0]]))
    except RuntimeError:  # a singular system: the patch is no disk
        return None
    if not np.isfinite(flat).all():
        return None
    u, v = flat[mine[:, 1]] - flat[mine[:, 0]], flat[mine[:, 2]] - flat[mine[:, 0]]
    signed = float((u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum()) / 2
    if signed < 0:
        flat = flat * np.array([1.0, -1.0])
        signed = -signed
    edge1, edge2 = inner[mine[:, 1]] - inner[mine[:, 0]], inner[mine[:, 2]] - inner[mine[:, 0]]
    area = float(np.linalg.norm(np.cross(edge1, edge2), axis=1).sum()) / 2
    if signed <= 1e-12 * area:
        return None
    flat = flat * np.sqrt(area / signed)
    flat = _turn_home(flat, inner, mine, normal, tangent)
    result = np.full((len(points), 2), np.nan)
    result[used] = flat - flat[0]
    return result


def _turn_home(flat: F8, points: F8, faces: I8, normal: F8, tangent: F8) -> F8:
    """Rotate `flat` so that directions at vertex 0 agree with the surface frame."""
    near = np.unique(faces[(faces == 0).any(axis=1)])
    vector = points[near] - points[0]
    seen = vector @ tangent + 1j * (vector @ np.cross(normal, tangent))
    drawn = (flat[near] - flat[0]) @ np.array([1.0, 1j])
    turn = complex((seen * drawn.conj()).sum())
    turn = turn / abs(turn) if abs(turn) > 0 else 1.0 + 0j
    spun = (flat @ np.array([1.0, 1j])) * turn
    return np.stack([spun.real, spun.imag], axis=1)
