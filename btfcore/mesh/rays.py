"""Whether rays meet a triangle mesh: a bounding volume hierarchy in kernels of our own.

Only "is anything in the way" is answered, which is all that shadows need and which may stop at the
first triangle found. Rays of neighbouring points are likely blocked by the same triangle, which is
therefore tried first. libigl's tree answers one ray after the other under the interpreter's lock
and looks for the nearest triangle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from btfcore.errors import InvalidMesh
from btfcore.types import F4, F8, I4, Frozen

_LEAF = 4  # triangles that are not divided further
_BINS = 16
_DEEPEST = 60
_EDGE = 1e-9  # of a triangle, by which it is enlarged, so that rays do not slip between two


@dataclass(frozen=True, eq=False)
class RayTree(Frozen):
    """A hierarchy of boxes over triangles.

    box (B, 6) f4: low and high corner, rounded outwards; child (B,) i4: first of two children
    that follow each other, or first triangle; count (B,) i4: triangles of a leaf, 0 for a node
    with children; triangle (F, 9) f8: a corner and the edges to the others, in the tree's order;
    face (F,) i4: number that each of these had in the mesh.
    """

    box: F4
    child: I4
    count: I4
    triangle: F8
    face: I4


def ray_tree(vertices: ArrayLike, faces: ArrayLike) -> RayTree:
    """Hierarchy over faces (F, 3) of vertices (V, 3); binned surface area heuristic.

    (Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007.) F may be 0.
    Raises `InvalidMesh` where a face names no vertex or one that is not finite.
    """
    points = np.asarray(vertices, np.float64).reshape(-1, 3)
    corners = np.asarray(faces, np.int64).reshape(-1, 3)
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(points):
        raise InvalidMesh(
            f"faces name {corners.min()}..{corners.max()}, the mesh has {len(points)} vertices"
        )
    used = points[corners]
    if not (np.abs(used) < 1e30).all():
        raise InvalidMesh("rays against a mesh with vertices that are not finite or beyond 1e30")
    box, child, count, order = _build(used.min(axis=1), used.max(axis=1)) if len(corners) else (
        np.zeros((0, 6)), np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0, np.int64)
    )  # fmt: skip
    low = np.nextafter(box[:, :3].astype(np.float32), np.float32(-np.inf))
    high = np.nextafter(box[:, 3:].astype(np.float32), np.float32(np.inf))
    a, b, c = np.moveaxis(used[order], 1, 0)
    triangle = np.ascontiguousarray(np.concatenate([a, b - a, c - a], axis=1))
    boxes = np.concatenate([low, high], axis=1)
    return RayTree(boxes, child, count, triangle, order.astype(np.int32))


def blocked(tree: RayTree, origins: F8, directions: F8) -> NDArray[np.bool_]:
    """Whether the half-lines from `origins` (n, 3) along `directions` (n, 3) meet the mesh.

    Both sides of a triangle count, its rim too; a triangle in whose plane a ray lies does not.
    """
    start = np.ascontiguousarray(origins, np.float64).reshape(-1, 3)
    along = np.ascontiguousarray(directions, np.float64).reshape(-1, 3)
    out = np.zeros(len(start), np.bool_)
    _blocked(tree.box, tree.child, tree.count, tree.triangle, start, along, out)
    return out


@njit(cache=True, nogil=True)
def _blocked(box, child, count, triangle, origins, directions, out):  # type: ignore[no-untyped-def]
    last = 0
    stack = np.empty(2 * _DEEPEST + 8, np.int64)
    for n in range(len(origins)):
        found = any_hit(box, child, count, triangle, origins[n], directions[n], last, stack)
        out[n] = found >= 0
        last = max(found, 0)


@njit(cache=True, nogil=True)
def any_hit(box, child, count, triangle, origin, direction, last, stack):  # type: ignore[no-untyped-def]
    """Number of a triangle that the half-line meets, or -1; `last` is tried first.

    stack : scratch of `stack_size()` i8. Which triangle is found may depend on `last`, whether
    one is found does not.
    """
    if len(box) == 0:
        return -1
    ox, oy, oz = origin[0], origin[1], origin[2]
    dx, dy, dz = direction[0], direction[1], direction[2]
    if _meets(triangle, last, ox, oy, oz, dx, dy, dz):
        return last
    ix, iy, iz = inverse(dx), inverse(dy), inverse(dz)
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = stack[top]
        here = child[node]
        if count[node] > 0:
            for t in range(here, here + count[node]):
                if _meets(triangle, t, ox, oy, oz, dx, dy, dz):
                    return t
            continue
        for k in range(2):
            b = here + k
            x0, x1 = (box[b, 0] - ox) * ix, (box[b, 3] - ox) * ix
            y0, y1 = (box[b, 1] - oy) * iy, (box[b, 4] - oy) * iy
            z0, z1 = (box[b, 2] - oz) * iz, (box[b, 5] - oz) * iz
            enter = max(max(min(x0, x1), min(y0, y1)), min(z0, z1))
            leave = min(min(max(x0, x1), max(y0, y1)), max(z0, z1))
            if leave >= max(enter, 0.0):
                stack[top] = b
                top += 1
    return -1


def stack_size() -> int:
    """Numbers of scratch that `any_hit` needs."""
    return 2 * _DEEPEST + 8


@njit(cache=True, nogil=True)
def inverse(value):  # type: ignore[no-untyped-def]
    """Return 1 / value, huge for 0."""
    # not infinite: 0 times infinity would be no number
    if abs(value) > 1e-60:
        return 1.0 / value
    return 1e60 if value >= 0 else -1e60


@njit(cache=True, nogil=True)
def _meets(triangle, t, ox, oy, oz, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Möller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997."""
    ax, ay, az = triangle[t, 3], triangle[t, 4], triangle[t, 5]
    bx, by, bz = triangle[t, 6], triangle[t, 7], triangle[t, 8]
    px, py, pz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
    volume = ax * px + ay * py + az * pz
    if volume == 0.0:
        return False
    inverse = 1.0 / volume
    tx, ty, tz = ox - triangle[t, 0], oy - triangle[t, 1], oz - triangle[t, 2]
    u = (tx * px + ty * py + tz * pz) * inverse
    if not -_EDGE <= u <= 1.0 + _EDGE:
        return False
    qx, qy, qz = ty * az - tz * ay, tz * ax - tx * az, tx * ay - ty * ax
    v = (dx * qx + dy * qy + dz * qz) * inverse
    if not (v >= -_EDGE and u + v <= 1.0 + _EDGE):
        return False
    return (bx * qx + by * qy + bz * qz) * inverse > 0.0


@njit(cache=True, nogil=True)
def _build(low, high):  # type: ignore[no-untyped-def]
    """Boxes (B, 6), first children or triangles, counts, and the triangles' order."""
    triangles = len(low)
    middle = (low + high) / 2
    order = np.arange(triangles)
    spare = np.empty(triangles, np.int64)
    box = np.empty((2 * triangles, 6))
    child = np.zeros(2 * triangles, np.int32)
    count = np.zeros(2 * triangles, np.int32)
    work = np.empty((2 * _DEEPEST + 8, 4), np.int64)  # node, begin, end, depth
    work[0] = 0, 0, triangles, 0
    top, made = 1, 1
    while top > 0:
        top -= 1
        node, begin, end, depth = work[top]
        for k in range(3):
            box[node, k], box[node, 3 + k] = np.inf, -np.inf
            for i in range(begin, end):
                box[node, k] = min(box[node, k], low[order[i], k])
                box[node, 3 + k] = max(box[node, 3 + k], high[order[i], k])
        split = begin
        if end - begin > _LEAF and depth < _DEEPEST:
            split = _split(low, high, middle, order, spare, begin, end)
        if split == begin:
            child[node], count[node] = begin, end - begin
            continue
        child[node] = made
        work[top] = made, begin, split, depth + 1
        work[top + 1] = made + 1, split, end, depth + 1
        top += 2
        made += 2
    return box[:made].copy(), child[:made].copy(), count[:made].copy(), order


@njit(cache=True, nogil=True)
def _split(low, high, middle, order, spare, begin, end):  # type: ignore[no-untyped-def]
    """Divide order[begin:end] where the heuristic is cheapest; returns the place."""
    best, best_axis, best_bin = np.inf, -1, 0
    start, width = np.zeros(3), np.zeros(3)
    for axis in range(3):
        least, most = np.inf, -np.inf
        for i in range(begin, end):
            least = min(least, middle[order[i], axis])
            most = max(most, middle[order[i], axis])
        start[axis], width[axis] = least, (most - least) / _BINS
        if not width[axis] > 0.0:
            continue
        number = np.zeros(_BINS, np.int64)
        bound = np.empty((_BINS, 6))
        bound[:, :3], bound[:, 3:] = np.inf, -np.inf
        for i in range(begin, end):
            at = order[i]
            b = min(int((middle[at, axis] - least) / width[axis]), _BINS - 1)
            number[b] += 1
            for k in range(3):
                bound[b, k] = min(bound[b, k], low[at, k])
                bound[b, 3 + k] = max(bound[b, 3 + k], high[at, k])
        right = np.zeros(_BINS)
        grown = np.array([np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf])
        total = 0
        for b in range(_BINS - 1, 0, -1):
            total += number[b]
            right[b] = total * _grow(grown, bound[b])
        grown[:3], grown[3:] = np.inf, -np.inf
        total = 0
        for b in range(1, _BINS):
            total += number[b - 1]
            cost = total * _grow(grown, bound[b - 1]) + right[b]
            if 0 < total < end - begin and cost < best:
                best, best_axis, best_bin = cost, axis, b
    if best_axis < 0:
        return begin
    left, rest = begin, 0
    for i in range(begin, end):
        at = order[i]
        b = int((middle[at, best_axis] - start[best_axis]) / width[best_axis])
        if min(b, _BINS - 1) < best_bin:
            order[left] = at
            left += 1
        else:
            spare[rest] = at
            rest += 1
    order[left:end] = spare[:rest]
    return left


@njit(cache=True, nogil=True)
def _grow(box, other):  # type: ignore[no-untyped-def]
    """Enlarge `box` by `other` and return half its surface, 0 while it is empty."""
    for k in range(3):
        box[k] = min(box[k], other[k])
        box[3 + k] = max(box[3 + k], other[3 + k])
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    if x < 0.0:
        return 0.0
    return x * y + y * z + z * x
