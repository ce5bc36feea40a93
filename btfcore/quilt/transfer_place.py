"""What the patches of one dense mesh have at the vertices of another that lie on it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.quilt.transfer_locate import Surface
from btfcore.types import F4, F8, I4, U2


class Carried(NamedTuple):
    """The quilt that is carried, as the kernels read it.

    on: the old dense mesh; normals (N, 3) f4; source, patch, sample as in `Quilt`; heading
    (N, 3) f8: the sample's +column axis in the world; indptr, indices and ghost (M, 2) f4:
    continuations in sample texels; rate (R,): sample texels per world unit; limit (R, 4):
    first and last column, first and last row.
    """

    on: Surface
    normals: F4
    source: F4
    patch: I4
    sample: U2
    heading: F8
    indptr: I4
    indices: I4
    ghost: F4
    rate: F8
    limit: F8


class Target(NamedTuple):
    """The vertices that the quilt is carried to; face and weight say where they lie."""

    vertices: F8
    normals: F4
    tangents: F4
    face: I4
    weight: F4
    allowed: NDArray[np.bool_]


@njit(cache=True)
def headings(normals, tangents, angle):  # type: ignore[no-untyped-def]
    """The world directions (N, 3) f8 that angles from tangents stand for."""
    out = np.empty(normals.shape)
    for i in range(len(normals)):
        n, s = normals[i], tangents[i]
        cos, sin = np.cos(float(angle[i])), np.sin(float(angle[i]))
        out[i, 0] = cos * s[0] + sin * (float(n[1]) * s[2] - float(n[2]) * s[1])
        out[i, 1] = cos * s[1] + sin * (float(n[2]) * s[0] - float(n[0]) * s[2])
        out[i, 2] = cos * s[2] + sin * (float(n[0]) * s[1] - float(n[1]) * s[0])
    return out


@njit(cache=True)
def _continued(old, vertex, other):  # type: ignore[no-untyped-def]
    """Where the patch of `vertex` would put `other`: its ghost, else by rotation."""
    for slot in range(old.indptr[vertex], old.indptr[vertex + 1]):
        if old.indices[slot] == other:
            return old.ghost[slot, 0], old.ghost[slot, 1]
    return _rotated(old, vertex, old.on.vertices[other])


@njit(cache=True)
def _rotated(old, vertex, point):  # type: ignore[no-untyped-def]
    """Where the rotation at an old vertex would put a world position."""
    normal, heading = old.normals[vertex], old.heading[vertex]
    x = point[0] - old.on.vertices[vertex, 0]
    y = point[1] - old.on.vertices[vertex, 1]
    z = point[2] - old.on.vertices[vertex, 2]
    across = x * heading[0] + y * heading[1] + z * heading[2]
    up = (
        x * (normal[1] * heading[2] - normal[2] * heading[1])
        + y * (normal[2] * heading[0] - normal[0] * heading[2])
        + z * (normal[0] * heading[1] - normal[1] * heading[0])
    )
    rate = old.rate[old.sample[vertex]]
    return old.source[vertex, 0] + rate * across, old.source[vertex, 1] - rate * up


@njit(cache=True)
def _anchor(old, new, vertex, patch):  # type: ignore[no-untyped-def]
    """The old vertex of `patch` nearest to a new one: a corner of its face, else next to one."""
    corners = old.on.faces[new.face[vertex]]
    best, most = -1, -1.0
    for corner in range(3):
        if old.patch[corners[corner]] == patch and new.weight[vertex, corner] > most:
            best, most = corners[corner], new.weight[vertex, corner]
    if best >= 0:
        return best
    least = np.inf
    for corner in corners:
        for slot in range(old.on.face_ptr[corner], old.on.face_ptr[corner + 1]):
            for other in old.on.faces[old.on.face_of[slot]]:
                if old.patch[other] == patch:
                    away = 0.0
                    for axis in range(3):
                        away += (old.on.vertices[other, axis] - new.vertices[vertex, axis]) ** 2
                    if away < least:
                        best, least = other, away
    return best


@njit(cache=True)
def _position(old, new, vertex, patch, clamp):  # type: ignore[no-untyped-def]
    """Position in the sample (x, y, inside) that `patch` has at a new vertex.

    Linear in the old triangle: at its corners the patch's own positions, or its ghosts. Beyond
    the triangle (at the rim of an open surface) it goes on by rotation.
    """
    corners, weight = old.on.faces[new.face[vertex]], new.weight[vertex]
    a, b, c = corners[0], corners[1], corners[2]
    if (
        old.patch[a] == old.patch[b] == old.patch[c] == patch
        and min(weight[0], weight[1], weight[2]) > 0.0
    ):  # nearly all are so, and all that follows says the same
        x, y = float(old.source[a, 0]), float(old.source[a, 1])
        x += weight[1] * (old.source[b, 0] - x) + weight[2] * (old.source[c, 0] - x)
        y += weight[1] * (old.source[b, 1] - y) + weight[2] * (old.source[c, 1] - y)
        return x, y, True
    anchor = _anchor(old, new, vertex, patch)
    limit = old.limit[old.sample[anchor]]
    low_x, high_x, low_y, high_y = limit[0], limit[1], limit[2], limit[3]
    beyond = np.zeros(3)
    at = np.zeros((3, 2))
    mine = 0
    for corner in range(3):
        k = corners[corner]
        if old.patch[k] == patch:
            at[corner, 0], at[corner, 1] = old.source[k, 0], old.source[k, 1]
            # what is there may stay, even where rounding put it past the border
            low_x, high_x = min(low_x, at[corner, 0]), max(high_x, at[corner, 0])
            low_y, high_y = min(low_y, at[corner, 1]), max(high_y, at[corner, 1])
            mine += 1
    if mine == 0:
        x, y = _rotated(old, anchor, new.vertices[vertex])
    else:
        if mine < 3:
            for corner in range(3):
                k = corners[corner]
                if old.patch[k] != patch:
                    for other in corners:
                        if old.patch[other] == patch:
                            gx, gy = _continued(old, other, k)
                            at[corner, 0] += gx / mine
                            at[corner, 1] += gy / mine
        # differences from one corner: a weight of 1 gives that corner's very bits
        x = at[0, 0] + weight[1] * (at[1, 0] - at[0, 0]) + weight[2] * (at[2, 0] - at[0, 0])
        y = at[0, 1] + weight[1] * (at[1, 1] - at[0, 1]) + weight[2] * (at[2, 1] - at[0, 1])
        if min(weight[0], weight[1], weight[2]) <= 0.0:
            v = old.on.vertices
            lift = 0.0
            for axis in range(3):
                a, b, c = v[corners[0], axis], v[corners[1], axis], v[corners[2], axis]
                foot = a + weight[1] * (b - a) + weight[2] * (c - a)
                beyond[axis] = new.vertices[vertex, axis] - foot
                lift += beyond[axis] * old.on.facing[new.face[vertex], axis]
            for axis in range(3):
                beyond[axis] += v[anchor, axis] - lift * old.on.facing[new.face[vertex], axis]
            gx, gy = _rotated(old, anchor, beyond)
            x += gx - old.source[anchor, 0]
            y += gy - old.source[anchor, 1]
    inside = low_x <= x <= high_x and low_y <= y <= high_y
    if clamp:
        x, y = min(max(x, low_x), high_x), min(max(y, low_y), high_y)
    return x, y, inside


@njit(cache=True)
def _turn(old, new, vertex, patch):  # type: ignore[no-untyped-def]
    """Angle from the new field's tangent to where `patch` has the sample's columns run."""
    corners = old.on.faces[new.face[vertex]]
    normal, tangent = new.normals[vertex], new.tangents[vertex]
    s = t = 0.0
    for turn in range(4):  # the last time the anchor alone, where the corners say nothing
        if turn == 3:
            if s * s + t * t > 1e-6:
                break
            k, weight = _anchor(old, new, vertex, patch), 1.0
        else:
            k, weight = corners[turn], max(float(new.weight[vertex, turn]), 1e-6)
        if old.patch[k] != patch:
            continue
        along, onto = 1.0, 0.0
        for axis in range(3):
            along += old.normals[k, axis] * normal[axis]
            onto += old.heading[k, axis] * normal[axis]
        if along < 0.05 and turn < 3:
            continue
        onto /= max(along, 0.05)
        x = old.heading[k, 0] - onto * (old.normals[k, 0] + normal[0])
        y = old.heading[k, 1] - onto * (old.normals[k, 1] + normal[1])
        z = old.heading[k, 2] - onto * (old.normals[k, 2] + normal[2])
        s += weight * (x * tangent[0] + y * tangent[1] + z * tangent[2])
        t += weight * (
            x * (normal[1] * tangent[2] - normal[2] * tangent[1])
            + y * (normal[2] * tangent[0] - normal[0] * tangent[2])
            + z * (normal[0] * tangent[1] - normal[1] * tangent[0])
        )
    return np.arctan2(t, s)


@njit(cache=True)
def _listed(old, new, vertex, patches, share):  # type: ignore[no-untyped-def]
    """Patches of a triangle's corners with their weights, -1 where bare; returns how many."""
    corners, count = old.on.faces[new.face[vertex]], 0
    for corner in range(3):
        patch = old.patch[corners[corner]]
        entry = 0
        while entry < count and patches[entry] != patch:
            entry += 1
        if entry == count:
            patches[entry], share[entry] = patch, 0.0
            count += 1
        share[entry] += new.weight[vertex, corner]
    return count


@njit(cache=True)
def _may(old, new, vertex, patch):  # type: ignore[no-untyped-def]
    """Whether a new vertex may have the sample of a patch around it."""
    if new.allowed.shape[1] == 0 or patch < 0:
        return True
    return new.allowed[old.sample[_anchor(old, new, vertex, patch)], vertex]


@njit(cache=True)
def _around(old, new, vertex):  # type: ignore[no-untyped-def]
    """The nearest patch next to a triangle whose sample a new vertex may have; -2: none."""
    best, least = -2, np.inf
    for corner in old.on.faces[new.face[vertex]]:
        for slot in range(old.on.face_ptr[corner], old.on.face_ptr[corner + 1]):
            for k in old.on.faces[old.on.face_of[slot]]:
                if old.patch[k] < 0 or not new.allowed[old.sample[k], vertex]:
                    continue
                away = 0.0
                for axis in range(3):
                    away += (old.on.vertices[k, axis] - new.vertices[vertex, axis]) ** 2
                if away < least:
                    best, least = old.patch[k], away
    return best


@njit(cache=True)
def choose(begin, end, old, new, patch, mixed):  # type: ignore[no-untyped-def]
    """Patch of each new vertex: of the corners' patches the one with the largest weight.

    A patch whose sample is not allowed or ends before here gives way to another; `mixed`
    marks where two patches or more would do.
    """
    patches, share = np.empty(3, np.int32), np.empty(3)
    for vertex in range(begin, end):
        count = _listed(old, new, vertex, patches, share)
        if count == 1 and _may(old, new, vertex, patches[0]):
            patch[vertex] = patches[0]
            continue
        best, fit, bare, allowed = 0, 0, False, False
        for entry in range(count):
            bare |= patches[entry] < 0
            if not _may(old, new, vertex, patches[entry]):
                share[entry] -= 4.0
            else:
                allowed = True
                if patches[entry] < 0 or _position(old, new, vertex, patches[entry], False)[2]:
                    fit += 1
                else:
                    share[entry] -= 2.0
            if share[entry] > share[best]:
                best = entry
        patch[vertex] = patches[best]
        mixed[vertex] = fit > 1 and not bare
        if not allowed:
            near = _around(old, new, vertex)
            if near >= 0:
                patch[vertex] = near


@njit(cache=True)
def place(vertices, old, new, patch, source, angle, sample):  # type: ignore[no-untyped-def]
    """Position, angle and sample of new vertices from their patches."""
    for vertex in vertices:
        mine = patch[vertex]
        if mine < 0:
            continue
        x, y, _ = _position(old, new, vertex, mine, True)
        source[vertex, 0], source[vertex, 1] = x, y
        angle[vertex] = _turn(old, new, vertex, mine)
        sample[vertex] = old.sample[_anchor(old, new, vertex, mine)]


@njit(cache=True)
def candidates(band, old, new):  # type: ignore[no-untyped-def]
    """Patches (n, 3) i4 that vertices may have, -1 for none; their samples and positions."""
    patch = np.full((len(band), 3), -1, np.int32)
    sample = np.zeros((len(band), 3), np.uint16)
    at = np.zeros((len(band), 3, 2))
    patches, share = np.empty(3, np.int32), np.empty(3)
    for index in range(len(band)):
        vertex, used = band[index], 0
        for entry in range(_listed(old, new, vertex, patches, share)):
            mine = patches[entry]
            if not _may(old, new, vertex, mine):
                continue
            x, y, inside = _position(old, new, vertex, mine, False)
            if inside:
                patch[index, used] = mine
                sample[index, used] = old.sample[_anchor(old, new, vertex, mine)]
                at[index, used, 0], at[index, used, 1] = x, y
                used += 1
    return patch, sample, at
