"""Meshes and atlases made by formula, for the laws of the dense mesh."""

import numpy as np

from btfcore.mesh.topology import twins
from btfcore.types import Atlas, Mesh


def mesh(vertices, faces):
    return Mesh(np.array(vertices, np.float64), np.array(faces, np.int32))


def grid(rows, columns, wrap_rows=False, wrap_columns=False, keep=None):
    """Faces of a quad grid of rows x columns cells, counter-clockwise for row = -y."""
    down = rows if wrap_rows else rows + 1
    right = columns if wrap_columns else columns + 1
    r, c = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    if keep is not None:
        r, c = r[keep], c[keep]
    a, b = r * right + c, r * right + (c + 1) % right
    d, e = (r + 1) % down * right + c, (r + 1) % down * right + (c + 1) % right
    low, high = np.stack([a, d, b], -1), np.stack([b, d, e], -1)
    return np.concatenate([low.reshape(-1, 3), high.reshape(-1, 3)])


def used_only(vertices, faces):
    number = np.full(len(vertices), -1)
    kept = np.unique(faces)
    number[kept] = np.arange(len(kept))
    return mesh(np.asarray(vertices, float)[kept], number[faces])


def plane(rows=6, columns=8, keep=None):
    r, c = np.meshgrid(np.arange(rows + 1), np.arange(columns + 1), indexing="ij")
    points = np.stack([c, -r, 0 * r], -1).reshape(-1, 3)
    return used_only(points, grid(rows, columns, keep=keep))


def plane_with_holes():
    keep = np.ones((12, 15), bool)
    for r, c in ((2, 2), (2, 7), (6, 4), (9, 11)):
        keep[r, c : c + 2] = False
    keep[5, 10] = False
    return plane(12, 15, keep)


def icosphere(level=3):
    from tests.surfaces import sphere

    ball = sphere(level)
    return mesh(ball.vertices, ball.faces)


def torus(around=24, across=12, radius=0.4):
    u, v = np.meshgrid(
        2 * np.pi * np.arange(across) / across, 2 * np.pi * np.arange(around) / around,
        indexing="ij",
    )  # fmt: skip
    ring = 1 + radius * np.cos(u)
    points = np.stack([ring * np.cos(v), ring * np.sin(v), -radius * np.sin(u)], -1)
    return mesh(points.reshape(-1, 3), grid(across, around, True, True))


def cylinder(around=16, rows=6, closed=False):
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.stack([np.sin(angle), np.zeros(around), np.cos(angle)], -1)
    points = np.concatenate([ring - [0, 0.4 * r, 0] for r in range(rows + 1)])
    faces = grid(rows, around, wrap_columns=True)
    if closed:
        top, bottom = len(points), len(points) + 1
        points = np.concatenate([points, [[0, 0, 0], [0, -0.4 * rows, 0]]])
        here, after = np.arange(around), (np.arange(around) + 1) % around
        low = rows * around
        lid = np.stack([0 * here + top, here, after], -1)
        floor = np.stack([0 * here + bottom, low + after, low + here], -1)
        faces = np.concatenate([faces, lid, floor])
    return mesh(points, faces)


def tetrahedron(size=1.0):
    points = size * np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)])
    return mesh(points, [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)])


def triangle():
    return mesh([(0, 0, 0), (1, 0, 0), (0.2, 0.9, 0)], [(0, 1, 2)])


def voxels(solid):
    """Boundary of a union of unit cubes; it must touch itself along faces only."""
    solid = np.pad(np.asarray(solid, bool), 1)
    corners, faces = {}, []
    for axis in range(3):
        for sign in (1, -1):
            shown = solid & ~np.roll(solid, -sign, axis)
            b, c = (axis + 1) % 3, (axis + 2) % 3
            for cell in np.argwhere(shown):
                square = []
                for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    point = cell.copy()
                    point[axis] += sign > 0
                    point[b] += i
                    point[c] += j
                    square.append(corners.setdefault(tuple(point), len(corners)))
                if sign < 0:
                    square.reverse()
                faces += [square[:3], [square[0], square[2], square[3]]]
    return mesh(np.array(list(corners), float), faces)


def cube(cells=3):
    return voxels(np.ones((cells, cells, cells)))


def genus_two():
    solid = np.ones((3, 5, 1))
    solid[1, 1] = solid[1, 3] = 0
    return voxels(solid)


def joined(*parts):
    """One mesh of several, each shifted beside the other."""
    points, faces, shift, count = [], [], 0.0, 0
    for part in parts:
        low, high = part.vertices.min(0), part.vertices.max(0)
        points.append(part.vertices - low + [shift, 0, 0])
        faces.append(part.faces + count)
        shift += (high - low)[0] * 1.2 + 0.1
        count += len(part.vertices)
    return mesh(np.concatenate(points), np.concatenate(faces))


def deformed(shape, seed=0, bumps=0.0, scale=(1, 1, 1), twist=0.0):
    """Smooth random displacement (relative to the size), anisotropic scale, twist about z."""
    rng = np.random.default_rng(seed)
    points = (shape.vertices - shape.vertices.mean(0)) / shape.diagonal
    waves, phase = rng.normal(0, 4, (5, 3)), rng.uniform(0, 6, (5, 3))
    moves = rng.normal(0, 1, (5, 3))
    points = points + bumps / 5 * np.einsum(
        "nk,kd->nd", np.sin(points @ waves.T + phase[:, 0]), moves
    )
    points = points * np.asarray(scale, float)
    angle = twist * points[:, 2]
    x, y = points[:, 0].copy(), points[:, 1].copy()
    points[:, 0] = np.cos(angle) * x - np.sin(angle) * y
    points[:, 1] = np.sin(angle) * x + np.cos(angle) * y
    return mesh(points, shape.faces)


def box_atlas(shape, rate=64):
    """Atlas of orthogonal views: charts of faces that look mostly along one axis."""
    corner = shape.vertices[shape.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    axis = np.abs(normal).argmax(1)
    sign = np.take_along_axis(normal, axis[:, None], 1)[:, 0] >= 0
    view = 2 * axis + sign
    right, up = (axis + 1) % 3, (axis + 2) % 3
    x = np.take_along_axis(corner, right[:, None, None], 2)[..., 0]
    y = np.take_along_axis(corner, up[:, None, None], 2)[..., 0]
    uv = np.stack([np.where(sign[:, None], x, -x), -y], -1)
    return packed(shape, uv, connected(shape.faces, view), rate)


def connected(faces, label):
    """Number the edge-connected sets of faces with one label."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    twin = twins(faces)
    one = np.flatnonzero(twin >= 0)
    one = one[label[one // 3] == label[twin[one] // 3]]
    graph = coo_matrix((np.ones(len(one)), (one // 3, twin[one] // 3)), (len(faces),) * 2)
    return connected_components(graph, directed=False)[1].astype(np.int32)


def packed(shape, uv, chart, rate):
    """Put charts on shelves, three texels apart, as large as fits."""
    count = int(chart.max()) + 1
    low = np.array([uv[chart == c].min((0, 1)) for c in range(count)])
    size = np.array([uv[chart == c].max((0, 1)) for c in range(count)]) - low
    order = np.argsort(-size[:, 1], kind="stable")
    scale = (rate - 3) / max(float(size.max()), 1e-9)
    while True:
        place, x, y, shelf = np.zeros((count, 2)), 1.0, 1.0, 0.0
        for c in order:
            if x + size[c, 0] * scale > rate - 2:
                x, y, shelf = 1.0, y + np.ceil(shelf) + 3, 0.0
            place[c] = x, y
            x += np.ceil(size[c, 0] * scale) + 3
            shelf = max(shelf, size[c, 1] * scale)
        if x <= rate + 2 and y + shelf <= rate - 2:
            break
        scale *= 0.93
    moved = (uv - low[chart][:, None]) * scale + place[chart][:, None]
    return Atlas(shape, moved + 0.137, chart, rate)


def unrolled_cylinder(rate=64, around=16, rows=6):
    """An open cylinder in one chart, both sides of whose cut are its own."""
    shape = cylinder(around, rows)
    column, row = shape.faces % around, shape.faces // around
    last = (column.max(1) == around - 1) & (column.min(1) == 0)
    column = np.where(last[:, None] & (column == 0), around, column)
    uv = np.stack([column * 2 * np.pi / around, 0.4 * row], -1)
    return packed(shape, uv, np.zeros(len(shape.faces), np.int32), rate)


def slit_cone(rate=64, around=14, gap=0.0):
    """A closed-tip cone in one chart; `gap` > 0 unrolls it flatter, the slit stays or opens."""
    angle = np.arange(around + 1) * (2 * np.pi - gap) / around
    uv_ring = np.stack([np.cos(angle), -np.sin(angle)], -1)
    turn = 2 * np.pi * np.arange(around) / around
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], -1)
    points = np.concatenate([[[0, 0, 0.3]], 0.5 * ring + [0, 0, 0.15], ring])
    faces, uv = [], []
    for k in range(around):
        after = (k + 1) % around
        faces += [(0, 1 + k, 1 + after)]
        uv += [(0 * uv_ring[0], 0.5 * uv_ring[k], 0.5 * uv_ring[k + 1])]
        faces += [(1 + k, 1 + around + k, 1 + around + after)]
        uv += [(0.5 * uv_ring[k], uv_ring[k], uv_ring[k + 1])]
        faces += [(1 + k, 1 + around + after, 1 + after)]
        uv += [(0.5 * uv_ring[k], uv_ring[k + 1], 0.5 * uv_ring[k + 1])]
    shape = mesh(points, faces)
    return packed(shape, np.array(uv), np.zeros(len(faces), np.int32), rate)


def one_view(shape, rate=64):
    """The whole (flat) mesh as one chart, whatever holes it has."""
    uv = shape.vertices[shape.faces][..., :2] * [1, -1]
    return packed(shape, uv, np.zeros(len(shape.faces), np.int32), rate)


def two_disks(rate=64, level=2):
    """A sphere in two charts that meet along their whole border, without any node."""
    shape = icosphere(level)
    corner = shape.vertices[shape.faces]
    north = corner[..., 2].mean(1) > 0
    flat = corner / np.linalg.norm(corner[..., :2], axis=-1, keepdims=True).clip(1e-9)
    reach = np.arccos(np.clip(np.where(north[:, None], 1, -1) * corner[..., 2], -1, 1))
    uv = flat[..., :2] * reach[..., None] * [1, -1]
    uv = np.where(north[:, None, None], uv, uv * [-1, 1])
    return packed(shape, uv, connected(shape.faces, north.astype(int)), rate)


def folded(atlas, seed=0, share=0.01):
    """Move a few inner corners so that some triangles of the charts turn over."""
    rng = np.random.default_rng(seed)
    uv, faces = atlas.uv.copy(), atlas.mesh.faces
    for vertex in rng.choice(len(atlas.mesh.vertices), max(1, int(share * faces.max()))):
        here = faces == vertex
        if len(np.unique(atlas.chart[here.any(1)])) == 1 and np.ptp(uv[here], axis=0).max() < 1e-6:
            uv[here] += rng.normal(0, 3, 2)
    return Atlas(atlas.mesh, uv.clip(0, atlas.size - 1), atlas.chart, atlas.size)
