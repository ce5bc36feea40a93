"""Last resort: the largest manifold part of triangles that do not make a surface."""

from __future__ import annotations

import numpy as np

from btfcore.mesh.topology import fans, twins
from btfcore.types import I4


def manifold_part(faces: I4) -> I4:
    """Keep triangles, in the given order, while edges stay simple; then one fan per vertex.

    Returns the kept rows, (K,) i4 ascending; they form a coherently wound manifold with
    boundary, which may be empty.
    """
    taken: set[tuple[int, int]] = set()
    kept = []
    for row, (a, b, c) in enumerate(faces.tolist()):
        mine = ((a, b), (b, c), (c, a))
        if a == b or b == c or c == a or any(edge in taken for edge in mine):
            continue
        taken.update(mine)
        kept.append(row)
    rows = np.array(kept, np.int32)
    while len(rows):
        part = faces[rows]
        fan, count = fans(twins(part))
        size = np.bincount(fan, minlength=count)
        vertex = np.zeros(count, np.int32)
        vertex[fan] = part.reshape(-1)
        order = np.lexsort((np.arange(count), -size, vertex))
        extra = np.ones(count, bool)
        extra[order[np.r_[True, np.diff(vertex[order]) != 0]]] = False
        bad = extra[fan].reshape(-1, 3).any(axis=1)
        if not bad.any():
            break
        rows = rows[~bad]
    return rows
