"""Pattern mapping with graphcut on the input mesh: what Zhou's figure 2 compares with.

After the paper's reference [25] (Soler, Cani and Angelidis 2002, "Hierarchical pattern
mapping"): groups of the mesh's own triangles are flattened, and each takes a piece of the
sample that fits the groups around it; a group that flattens badly is replaced by a smaller one.
As Zhou's §III-A extends it, groups overlap and a graph cut chooses, triangle by triangle, who
keeps the old piece; its edges cost what is seen along the triangles' shared edges, integrated.
So seams can run along the input mesh's edges only. Matching, number of placements,
registration, piece size and channels are the quilting's, to compare the mesh and nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from btfcore.mesh.topology import edges, twins, vertex_normals
from btfcore.mincut import minimum_cut
from btfcore.patch.connectivity import faces_at_vertices
from btfcore.patch.lscm import lscm
from btfcore.patch.resample import look_up, work_image
from btfcore.quilt.grid import SampleGrid
from btfcore.quilt.matching import Matcher, Placement
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.register import register
from btfcore.types import F4, F8, I4, I8, Mesh

SHRINK = 0.8
AHEAD = 1.0  # radii from the frontier to a group's centre: the best of .3, .5, .75 and 1
BAD_AREA = 0.005  # share of a patch's area that may lie outside [1/T_d, T_d], as in quilting
REACH, ROUNDS = 1.5, 6  # texels and iterations of a placement's registration
B1 = NDArray[np.bool_]
C16 = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Mapping:
    """Texture coordinates per triangle.

    source (F, 3, 2) f4: (column, row) in the grid at every corner; patch (F,) i4.
    """

    source: F4
    patch: I4


@dataclass(frozen=True, eq=False)
class _Group:
    """Flattened triangles: faces (m,), plane (m, 3) complex in texels, the field along +x."""

    faces: I8
    plane: C16


class PatternMapper:
    """One run over one mesh; texels are its unit of length."""

    def __init__(
        self, mesh: Mesh, tangents: F8, grid: SampleGrid, parameters: QuiltParameters, step: float
    ) -> None:
        """Take tangents (V, 3) unit at the vertices; `step` is a texel in world units."""
        self.grid, self.knobs = grid, parameters
        self.faces = np.ascontiguousarray(mesh.faces, np.int32)
        self.points = mesh.vertices / (step * grid.unit)
        self.normals = vertex_normals(self.points, self.faces)
        self.tangents = tangents
        self.twin = twins(self.faces)
        self.around, self.face_of = faces_at_vertices(self.faces, len(self.points))
        corner = self.points[self.faces]
        self.length = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).reshape(-1)
        cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        self.area = np.linalg.norm(cross, axis=1) / 2
        pairs, _ = edges(self.faces)
        apart = np.linalg.norm(self.points[pairs[:, 0]] - self.points[pairs[:, 1]], axis=1)
        both = np.concatenate([pairs, pairs[:, ::-1]]).T
        count = len(self.points)
        self.graph = csr_matrix((np.tile(apart, 2), both), (count, count))
        self.source = np.zeros((len(self.faces), 3, 2), np.float32)
        self.patch = np.full(len(self.faces), -1, np.int32)
        self.patches = 0
        side = min(grid.cut.shape[:2])
        self.radius = float(parameters.work_patch or np.clip(0.3125 * side, 4, 48))
        self._matcher = Matcher(grid)
        self._random = np.random.default_rng(parameters.seed)
        self._tie = self._random.permutation(count)
        self._flow = self._gained = 0.0

    def run(self) -> Mapping:
        """Cover every triangle."""
        while (self.patch < 0).any():
            self._piece(self._seed())
        return Mapping(self.source, self.patch)

    def _seed(self) -> int:
        """Vertex ahead of the most constrained one, as the quilting goes about it."""
        bare = self.patch < 0
        open_, whole = (
            np.bincount(self.faces[chosen].ravel(), minlength=len(self.points))
            for chosen in (bare, slice(None))
        )
        able = np.flatnonzero(open_)
        done = (whole - open_)[able] / whole[able]
        first = int(able[np.lexsort((self._tie[able], -done))[0]])
        away = self._away(first, AHEAD * self.radius)
        ahead = np.flatnonzero(np.isfinite(away) & (open_ == whole) & (whole > 0))
        return int(ahead[np.argmax(away[ahead])]) if len(ahead) else first

    def _piece(self, centre: int) -> None:
        """Map one group around a vertex; where nothing fits, one bare triangle alone."""
        for radius in (self.radius, self.radius / 2, 0.0):
            group = self._flattened(centre, radius)
            if group is not None and self._mapped(group):
                return
        mine = self.face_of[self.around[centre] : self.around[centre + 1]]
        face = int(mine[self.patch[mine] < 0][0])
        self._force(face)

    def _away(self, vertex: int, limit: float) -> F8:
        """Length (V,) of the shortest way along edges from a vertex, inf beyond `limit`."""
        found = dijkstra(self.graph, indices=np.array([vertex]), limit=max(limit, 1e-9))
        return np.asarray(found[0], np.float64)

    # -- groups ---------------------------------------------------------------------------

    def _flattened(self, centre: int, radius: float) -> _Group | None:
        """Flatten the largest sound group around a vertex (LSCM, T_d as an area test)."""
        away = self._away(centre, 2 * radius)[self.faces].mean(axis=1)
        near = np.flatnonzero(np.isfinite(away))
        near = near[np.argsort(away[near], kind="stable")]
        area = np.cumsum(self.area[near])
        mine = self.face_of[self.around[centre] : self.around[centre + 1]]
        ring: I8 = np.unique(mine).astype(np.int64)
        while True:
            # as much surface as a disk of this radius: triangles are too coarse to count rings
            faces: I8 = near[area <= np.pi * radius**2]
            least = len(faces) <= len(ring)
            faces = ring if least else self._connected(np.union1d(faces, ring), int(ring[0]))
            group = self._flat(faces, centre)
            if group is not None or least:
                return group
            radius *= SHRINK

    def _connected(self, faces: I8, start: int) -> I8:
        """Those of `faces` that are joined to `start` across edges."""
        inside = np.zeros(len(self.faces), bool)
        inside[faces] = True
        reached = np.zeros(len(self.faces), bool)
        reached[start] = True
        rim: NDArray[Any] = np.array([start])
        while len(rim):
            over = self.twin[(3 * rim[:, None] + np.arange(3)).ravel()]
            beside = over[over >= 0] // 3
            rim = np.unique(beside[inside[beside] & ~reached[beside]])
            reached[rim] = True
        return np.flatnonzero(reached)

    def _flat(self, faces: I8, centre: int) -> _Group | None:
        vertices, local = np.unique(self.faces[faces], return_inverse=True)
        local = local.reshape(-1, 3)
        if len(vertices) - len(edges(local)[0]) + len(faces) != 1:
            return None  # no disk
        # the map's centre comes first
        home = int(np.searchsorted(vertices, centre))
        order = np.r_[home, np.delete(np.arange(len(vertices)), home)]
        place = np.argsort(order)
        plane = lscm(
            self.points[vertices[order]], place[local], self.normals[centre], self.tangents[centre]
        )
        if plane is None or not np.isfinite(plane).all():
            return None
        flat = (plane[:, 0] + 1j * plane[:, 1])[place[local]]
        one, two = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
        area = (one.conj() * two).imag / 2
        bound, real = self.knobs.max_distortion, self.area[faces]
        bad = (area > bound * real) | (area * bound < real)
        if real[bad].sum() > BAD_AREA * real.sum():
            return None
        heading = self._heading(faces, one, two)
        return _Group(faces, flat * heading.conjugate())

    def _heading(self, faces: I8, one: C16, two: C16) -> complex:
        """Mean unit direction of the field in the plane, over the bare triangles."""
        bare = self.patch[faces] < 0
        mean = complex((self.field_in(faces, one, two) * self.area[faces])[bare].sum())
        return mean / abs(mean) if abs(mean) > 1e-9 else 1.0 + 0j

    def field_in(self, faces: I8, one: C16, two: C16) -> C16:
        """Unit direction (m,) of the field where the edges from corner 0 are `one` and `two`."""
        corner = self.points[self.faces[faces]]
        u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        field = self.tangents[self.faces[faces]].mean(axis=1)
        # the field as a u + b v, by least squares
        uu, uv, vv = (u * u).sum(1), (u * v).sum(1), (v * v).sum(1)
        fu, fv = (field * u).sum(1), (field * v).sum(1)
        below = np.maximum(uu * vv - uv * uv, 1e-12 * np.maximum(uu * vv, 1e-300))
        turned = ((vv * fu - uv * fv) * one + (uu * fv - uv * fu) * two) / below
        return np.asarray(turned / np.maximum(np.abs(turned), 1e-300), np.complex128)

    # -- placements -----------------------------------------------------------------------

    def _mapped(self, group: _Group) -> bool:
        """Place a group's triangles, cut, and keep the cheapest; False where none covers any."""
        running = self._flow / max(self._gained, 1e-9)
        bare = self.patch[group.faces] < 0
        best = None
        for at in self._placements(group):
            spun = group.plane * np.exp(1j * at.turn)
            place = np.stack([at.column + spun.real, at.row - spun.imag], axis=-1)
            place = place.astype(np.float32)
            fresh, flow = self._cut(group.faces, place)
            gained = float(self.area[group.faces[fresh & bare]].sum())
            missed = float(self.area[group.faces[bare]].sum()) - gained
            score = flow + running * missed
            if gained > 0 and (best is None or score < best[0]):
                best = score, place, fresh, flow, gained
        if best is None:
            return False
        _, place, fresh, flow, gained = best
        self._accept(group.faces[fresh], place[fresh])
        self._flow += flow
        self._gained += gained
        return True

    def _accept(self, faces: I8, place: F4) -> None:
        self.source[faces] = place
        self.patch[faces] = self.patches
        self.patches += 1

    def _force(self, face: int) -> None:
        """Lay one triangle over the sample's middle, whatever its size."""
        corner = self.points[self.faces[face]]
        u, v = corner[1] - corner[0], corner[2] - corner[0]
        x = u / max(np.linalg.norm(u), 1e-300)
        y = np.cross(np.cross(u, v), x)
        y /= max(np.linalg.norm(y), 1e-300)
        flat = np.stack([(corner - corner.mean(axis=0)) @ x, -(corner - corner.mean(0)) @ y], 1)
        middle = (np.array(self.grid.cut.shape[1::-1]) - 1) / 2
        self._accept(np.array([face]), (flat + middle).astype(np.float32)[None])

    def _placements(self, group: _Group) -> list[Placement]:
        height, width = self.grid.cut.shape[:2]
        image, mask = self._work_image(group)
        found: list[Placement] = []
        if mask.any():
            found = self._matcher.match(
                image, mask, most=self.knobs.placements, overlap=self.knobs.overlap,
                margin=self.knobs.margin,
            )  # fmt: skip
        if not found:
            x, y = 0.35 + 0.3 * self._random.random(2)
            return [Placement(float(x * (width - 1)), float(y * (height - 1)), 0.0)]
        half = len(mask) // 2
        row, column = np.nonzero(mask)
        point = np.stack([column - half, row - half], axis=1).astype(np.float64)
        values = np.ascontiguousarray(image[:, row, column].T)
        out = []
        for at in found:
            better = register(
                self.grid.match, point, values, (at.column, at.row, at.turn), REACH,
                np.radians(self.knobs.sway), ROUNDS,
            )  # fmt: skip
            out.append(
                Placement(better[0], better[1], better[3], better[2])
                if np.isfinite(better[3])
                else at
            )
        return out

    def _work_image(self, group: _Group) -> tuple[F4, F4]:
        """Draw what is mapped already, on the texels of the group's plane."""
        known = np.flatnonzero(self.patch[group.faces] >= 0)
        count = len(known)
        flat = np.stack([group.plane.real, -group.plane.imag], axis=-1)
        reach = float(np.abs(flat).max())
        most = max(self.grid.cut.shape[:2])
        half = int(min(-(-(reach + 1) // 4) * 4, -(-most // 4) * 4))
        alone = np.arange(3 * count, dtype=np.int32)  # every corner is a vertex of its own
        # texture coordinates are linear in a triangle, so they are drawn first, then looked up
        where, mask = work_image(
            alone.reshape(-1, 3), np.arange(3 * count + 1, dtype=np.int32),
            np.repeat(np.arange(count, dtype=np.int32), 3), alone, alone,
            flat[known].reshape(-1, 2), self.source[group.faces[known]].reshape(-1, 2),
            np.ones(3 * count, bool), half,
        )  # fmt: skip
        values = look_up(self.grid.match, np.ascontiguousarray(where.reshape(2, -1).T))
        image = values.T.reshape(-1, *mask.shape) * mask
        return np.ascontiguousarray(image, np.float32), mask

    # -- the cut --------------------------------------------------------------------------

    def _cut(self, faces: I8, place: F4) -> tuple[B1, float]:
        """Which triangles (m,) take the new coordinates `place` (m, 3, 2), and the cost.

        The graph is Kwatra's (2003, §3) on the dual mesh, with a node for each old seam.
        """
        height, width = self.grid.cut.shape[:2]
        last = np.array([width - 1, height - 1], np.float32)
        covered = ((place >= 0) & (place <= last)).all(axis=(1, 2))
        bare = self.patch[faces] < 0
        node = np.full(len(self.faces), -1, np.int32)
        free = covered & ~bare
        node[faces[free]] = np.arange(int(free.sum()))
        fresh = np.zeros(len(self.faces), bool)
        fresh[faces[covered & bare]] = True
        new = np.zeros((len(self.faces), 3, 2), np.float32)
        new[faces] = place
        count = int(free.sum())
        if count == 0:
            return covered & bare, 0.0
        # half-edges of the nodes' triangles
        half = (3 * faces[free][:, None] + np.arange(3)).ravel()
        half = half[self.twin[half] >= 0]
        other = self.twin[half] // 3
        me = node[half // 3]
        ours, theirs = self._ends(self.source, half), self._ends(self.source, self.twin[half])
        theirs = theirs[:, ::-1]  # twins run the other way
        ahead = self._ends(new, half)
        length = self.length[half]
        keep, change = np.zeros(count), np.zeros(count)
        # beside a bare triangle that will be new, staying old makes a seam
        at = fresh[other]
        np.add.at(keep, me[at], self._jump(ours[at], ahead[at], length[at]))
        # beside an old one for good, changing makes one, and staying keeps what there is
        at = (node[other] < 0) & (self.patch[other] >= 0)
        np.add.at(change, me[at], self._jump(theirs[at], ahead[at], length[at]))
        np.add.at(keep, me[at], self._jump(ours[at], theirs[at], length[at]))
        # between two nodes, each pair once
        at = (node[other] >= 0) & (half < self.twin[half])
        mine, yours = me[at], node[other[at]]
        left = self._jump(ours[at], ahead[at], length[at])
        right = self._jump(theirs[at], ahead[at], length[at])
        seam = self.patch[half[at] // 3] != self.patch[other[at]]
        old = self._jump(ours[at][seam], theirs[at][seam], length[at][seam])
        extra = count + np.arange(int(seam.sum()), dtype=np.int32)
        tail = np.concatenate([mine[~seam], mine[seam], extra]).astype(np.int32)
        head = np.concatenate([yours[~seam], extra, yours[seam]]).astype(np.int32)
        # inside one old patch both sides see the same step
        cost = np.concatenate([left[~seam], left[seam], right[seam]])
        none = np.zeros(len(old))
        flow, side = minimum_cut(
            count + len(old), tail, head, cost, cost, np.concatenate([change, none]),
            np.concatenate([keep, old]),
        )  # fmt: skip
        fresh[faces[free]] = side[:count]
        return fresh[faces], flow

    def _ends(self, source: F4, half: I4 | I8) -> F4:
        """Coordinates (n, 2, 2) at the start and the end of half-edges."""
        face, corner = half // 3, half % 3
        return np.stack([source[face, corner], source[face, (corner + 1) % 3]], axis=1)

    def _jump(self, one: F4, two: F4, length: F8) -> F8:
        return jumps(self.grid, one, two, length)


def jumps(grid: SampleGrid, one: F4, two: F4, length: F8) -> F8:
    """∫ ‖A − B‖ along edges, at midpoints of pieces no longer than a texel: (n,) f8.

    one, two (n, 2, 2): grid coordinates at both ends on either side; length (n,) in texels.
    """
    count = np.maximum(np.ceil(length), 1).astype(np.int64)
    edge = np.repeat(np.arange(len(length)), count)
    start = np.cumsum(count) - count
    part = ((np.arange(len(edge)) - start[edge] + 0.5) / count[edge])[:, None]
    values = []
    for ends in (one, two):
        point = ends[edge, 0] * (1 - part) + ends[edge, 1] * part
        values.append(look_up(grid.cut, point.astype(np.float32)).astype(np.float64))
    apart = np.sqrt(((values[0] - values[1]) ** 2).sum(axis=1))
    return np.bincount(edge, apart, len(length)) / count * length
