"""The shortest way over a surface between two of its points, and its length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.errors import InvalidMesh
from btfcore.mesh.topology import twins
from btfcore.paint.geodesic import press, unreached
from btfcore.patch.connectivity import Connectivity, adjacency, faces_at_vertices
from btfcore.progress import Progress, silent
from btfcore.types import F4, F8, I4, Frozen

REACH = 1.5  # times the straight distance, how far the first search goes
GROWTH = 2.0
ENOUGH = 40.0  # diagonals of the bounding box, a way longer than which is none
CROSSED = 100_000  # triangles that a way may cross


@dataclass(frozen=True, eq=False)
class Way(Frozen):
    """A way over the surface: points (n, 3) f8 from one end to the other, and its length.

    World units; between neighbouring points it is straight within a triangle. Where the ends are
    on parts that do not hang together, the length is inf and there are no points.
    """

    points: F8
    length: float


class Ruler:
    """Measures on one surface; made once, in any thread."""

    def __init__(self, vertices: F8, faces: I4) -> None:
        """Prepare for faces (F, 3) of vertices (V, 3) in world units, corners shared.

        Raises `InvalidMesh` for a mesh without faces or of no size.
        """
        self._corner = np.ascontiguousarray(faces, np.int32)
        if len(self._corner) == 0:
            raise InvalidMesh("distances on a mesh of 0 faces")
        side = vertices[np.roll(self._corner, -1, axis=1)] - vertices[self._corner]
        self._step = float(np.linalg.norm(side, axis=2).mean())  # of the mesh's edges
        self._middle = vertices.mean(axis=0)
        if not 0 < self._step < np.inf:
            raise InvalidMesh(f"distances on a mesh whose edges are {self._step:g} long")
        self._points = (vertices - self._middle) / self._step
        self._diagonal = float(np.linalg.norm(np.ptp(self._points, axis=0)))
        self._twin = twins(self._corner)
        indptr, indices = adjacency(self._corner, len(vertices))
        tail = np.repeat(np.arange(len(vertices)), np.diff(indptr))
        length = np.linalg.norm(self._points[indices] - self._points[tail], axis=1)
        edge = np.stack([length, np.zeros_like(length)], axis=1).astype(np.float32)
        pointer, face_of = faces_at_vertices(self._corner, len(vertices))
        none, flat = np.zeros(0, np.float32), np.zeros((0, 2), np.float32)
        self._net = Connectivity(indptr, indices, pointer, face_of, self._corner, edge, flat, none)

    def between(
        self, start: tuple[int, F8], end: tuple[int, F8], *, progress: Progress = silent
    ) -> Way:
        """Shortest way between two places, each a face and weights (3,) of its corners.

        Distances grow from `start` as circles unfolded over the triangles (see
        `btfcore.paint.geodesic.press`): exact on developable surfaces, and elsewhere as good as
        the mesh is fine. The way follows their steepest descent from `end`, so it lies on the
        surface; of the two lengths the smaller counts, for neither is shorter than the shortest
        by more than the former's error. `progress` may raise `Cancelled`.
        """
        (face, weight), (last, aim) = start, end
        one, two = weight @ self._points[self._corner[face]], aim @ self._points[self._corner[last]]
        straight = float(np.linalg.norm(two - one))
        if face == last:
            return self._way(np.stack([one, two]), straight)
        seeds = self._corner[face]
        away = np.linalg.norm(self._points[seeds] - one, axis=1)
        limit = REACH * straight + 2.0
        while True:
            progress(min(limit / (ENOUGH * self._diagonal), 1.0), "measuring")
            value = unreached(self._net)
            press(self._net, value, unreached(self._net), seeds, away, 0.0, limit)
            if np.isfinite(value[self._corner[last]]).all():
                break
            if limit > ENOUGH * self._diagonal:
                return Way(np.zeros((0, 3)), np.inf)
            limit *= GROWTH
        points = self._descend(value, one, face, two, last)
        marched = self._unfolded(value, two, last)
        walked = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        return self._way(points, min(marched, walked))

    def _way(self, points: F8, length: float) -> Way:
        return Way(points * self._step + self._middle, length * self._step)

    def _flat(self, point: F8, face: int) -> F8:
        """Distances (3,) of a point of a face from its corners."""
        return np.asarray(np.linalg.norm(self._points[self._corner[face]] - point, axis=1))

    def _unfolded(self, value: F4, point: F8, face: int) -> float:
        """Distance of a point of a face: circles over each side, or along from a corner."""
        known, away = value[self._corner[face]].astype(np.float64), self._flat(point, face)
        best = float((known + away).min())
        for one, two in ((0, 1), (1, 2), (2, 0)):
            a, b = self._points[self._corner[face][[one, two]]]
            base = float(np.linalg.norm(b - a))
            if base < 1e-12:
                continue
            # along the side from its first end, and across it: the middle lies below, the
            # point above
            middle = (known[one] ** 2 - known[two] ** 2 + base**2) / (2 * base)
            x = (away[one] ** 2 - away[two] ** 2 + base**2) / (2 * base)
            below = max(known[one] ** 2 - middle**2, 0.0) ** 0.5
            above = max(away[one] ** 2 - x**2, 0.0) ** 0.5
            if below + above > 0.0:
                foot = middle + (x - middle) * below / (below + above)
                if 0.0 < foot < base:
                    best = min(best, float(np.hypot(x - middle, above + below)))
        return best

    def _descend(self, value: F4, goal: F8, home: int, point: F8, face: int) -> F8:
        """Points from `goal` in the face `home` to `point`, walked down from the latter."""
        way = [point]
        start = set(self._corner[home].tolist())
        vertex = -1  # the one at which the way stands, or -1 within a face
        for _ in range(CROSSED):
            if vertex >= 0:
                if vertex in start:
                    break
                face, vertex = self._from_vertex(value, vertex)
                if vertex >= 0:
                    way.append(self._points[vertex])
                    continue
            if face == home:
                break
            step = self._cross(value, face, way[-1])
            if step is None:  # no way down within the face: on along an edge
                corners = self._corner[face]
                vertex = int(corners[np.argmin(value[corners] + self._flat(way[-1], face))])
                way.append(self._points[vertex])
                continue
            side, reached = step
            way.append(reached)
            beyond = self._twin[3 * face + side]
            ahead = -1 if beyond < 0 else int(beyond) // 3
            if ahead < 0 or (ahead != home and not self._goes_on(value, ahead, reached)):
                # along a valley or the border: to the lower end of the edge
                ends = self._corner[face][[side, (side + 1) % 3]]
                vertex = int(ends[np.argmin(value[ends])])
                way.append(self._points[vertex])
            else:
                face = ahead
        way.append(goal)
        return np.array(way[::-1])

    def _gradient(self, value: F4, face: int) -> F8:
        """Gradient (3,) in a face of what its corners' values say; 0 where it has no area."""
        a, b, c = self._points[self._corner[face]]
        low, one, two = value[self._corner[face]].astype(np.float64)
        across = np.cross(b - a, c - a)
        double = float(across @ across)
        if double < 1e-18:
            return np.zeros(3)
        turned = (one - low) * np.cross(c - a, across) + (two - low) * np.cross(across, b - a)
        return np.asarray(turned / double)

    def _cross(self, value: F4, face: int, point: F8) -> tuple[int, F8] | None:
        """Edge over which steepest descent from a point leaves a face, and where."""
        down = -self._gradient(value, face)
        rates, weights = self._weights(face, down, vector=True), self._weights(face, point)
        best = None
        for opposite in range(3):
            if rates[opposite] < -1e-12:
                share = max(weights[opposite], 0.0) / -rates[opposite]
                if best is None or share < best[0]:
                    best = (share, (opposite + 1) % 3)
        # on the edge that it would leave by, at once: no way down in here
        if best is None or best[0] * np.linalg.norm(down) < 1e-7:
            return None
        return best[1], point + best[0] * down

    def _goes_on(self, value: F4, face: int, point: F8) -> bool:
        return self._cross(value, face, point) is not None

    def _from_vertex(self, value: F4, vertex: int) -> tuple[int, int]:
        """Face into which the descent from a vertex leads, or the neighbour along an edge."""
        net, here = self._net, self._points[vertex]
        best, chosen = 0.0, -1
        for face in net.face_of[net.face_ptr[vertex] : net.face_ptr[vertex + 1]]:
            down = -self._gradient(value, int(face))
            rates = self._weights(int(face), down, vector=True)
            corner = int(np.flatnonzero(self._corner[face] == vertex)[0])
            others = rates[[(corner + 1) % 3, (corner + 2) % 3]]
            if (others > 1e-9).all() and np.linalg.norm(down) > best:
                best, chosen = float(np.linalg.norm(down)), int(face)
        near = net.indices[net.indptr[vertex] : net.indptr[vertex + 1]]
        fall = (value[vertex] - value[near]) / np.linalg.norm(self._points[near] - here, axis=1)
        if chosen >= 0 and best >= fall.max():
            return chosen, -1
        return -1, int(near[np.argmax(fall)])

    def _weights(self, face: int, point: F8, *, vector: bool = False) -> F8:
        """Barycentric weights (3,) of a point in a face's plane, or their rates along a vector."""
        a, b, c = self._points[self._corner[face]]
        one, two = b - a, c - a
        way = point if vector else point - a
        d = np.array([[one @ one, one @ two], [one @ two, two @ two]])
        size = d[0, 0] * d[1, 1] - d[0, 1] ** 2
        if size < 1e-18:
            return np.zeros(3)
        x, y = way @ one, way @ two
        u = (d[1, 1] * x - d[0, 1] * y) / size
        v = (d[0, 0] * y - d[0, 1] * x) / size
        return np.array([(0.0 if vector else 1.0) - u - v, u, v])
