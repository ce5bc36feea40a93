"""A cube with its atlas and dense mesh made by formula, and a tiny texture renderer."""

import itertools

import numpy as np

from btfcore.types import Atlas, DenseMesh, Field, Mesh, Quilt

_AXES = [np.eye(3)[k] * sign for k in range(3) for sign in (1, -1)]


def _frames():
    """(normal, s, t) of the cube's six sides, right-handed."""
    return [(n, np.roll(n, 1), np.cross(n, np.roll(n, 1))) for n in _AXES]


def box(side=24, gap=4, centre=(0.0, 0.0, 0.0), edge=1.0):
    """Cube as (Atlas, DenseMesh): six charts of `side`² texels; dense mesh closed and zipped."""
    points, texels, normals, charts = [], [], [], []
    corners, faces, uv = [], [], []
    for k, (n, s, t) in enumerate(_frames()):
        at = np.array([gap + (k // 3) * (side + gap), gap + (k % 3) * (side + gap)])
        row, column = np.divmod(np.arange(side * side), side)
        x, y = (column + 0.5) / side - 0.5, 0.5 - (row + 0.5) / side
        points.append(n / 2 + x[:, None] * s + y[:, None] * t)
        texels.append(np.stack([row, column], axis=1) + at)
        normals.append(np.repeat(n[None], side * side, axis=0))
        charts.append(np.full(side * side, k))
        square = np.array([(0, 1), (1, 1), (1, 0), (0, 0)])  # counter-clockwise, image up
        place = [n / 2 + (c - 0.5) * s + (0.5 - r) * t for c, r in square]
        corners.extend(place)
        for three in ((0, 1, 2), (0, 2, 3)):
            faces.append([4 * k + i for i in three])
            uv.append(square[list(three)] * side - 0.5 + at[::-1])
    points, normals = np.concatenate(points), np.concatenate(normals)
    texels, charts = np.concatenate(texels), np.concatenate(charts)
    cell = np.arange(side * side).reshape(side, side)
    a, b, c, d = cell[:-1, :-1], cell[:-1, 1:], cell[1:, :-1], cell[1:, 1:]
    one = np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ((a, c, b), (b, c, d))])
    grid = np.concatenate([one + k * side * side for k in range(6)])
    dense_faces = np.concatenate([grid, _zipper(points, charts)])
    unique, merged = np.unique(np.round(corners, 9), axis=0, return_inverse=True)
    mesh = Mesh(
        unique * edge + np.asarray(centre), merged.reshape(-1)[np.array(faces)].astype(np.int32)
    )
    size = int(texels.max()) + gap + 1
    atlas = Atlas(mesh, np.array(uv, float), np.repeat(np.arange(6, dtype=np.int32), 2), size)
    dense = DenseMesh(
        points * edge + np.asarray(centre),
        normals.astype(np.float32),
        dense_faces.astype(np.int32),
        texels.astype(np.int32),
        charts.astype(np.int32),
        np.zeros(len(points), np.int32),
        np.zeros((len(points), 3), np.float32),
        size,
        len(grid),
    )
    return atlas, dense


def _zipper(points, charts):
    """Strips over the cube's 12 edges and triangles at its 8 corners."""
    triangles = []
    for (i, n), (j, m) in itertools.combinations(enumerate(_AXES), 2):
        if n @ m:
            continue
        along = np.cross(n, m)
        rows = []
        for chart, towards in ((i, m), (j, n)):
            inside = np.flatnonzero(charts == chart)
            reach = points[inside] @ towards
            rim = inside[reach > reach.max() - 1e-9]
            rows.append(rim[np.argsort(points[rim] @ along)])
        one, two = rows
        for k in range(len(one) - 1):
            triangles.append(((one[k], one[k + 1], two[k + 1]), n + m))
            triangles.append(((one[k], two[k + 1], two[k]), n + m))
    for signs in itertools.product((1, -1), repeat=3):
        reach = points @ np.array(signs)
        triangles.append((np.flatnonzero(reach > reach.max() - 1e-9), np.array(signs)))
    out = []
    for (a, b, c), outward in triangles:
        normal = np.cross(points[b] - points[a], points[c] - points[a])
        out.append((a, b, c) if normal @ outward > 0 else (a, c, b))
    return np.array(out)


def quilt_on(dense, seed=0, width=16, height=12):
    """A quilt of random look-ups and an orthogonal field, for `dense`."""
    random = np.random.default_rng(seed)
    count = len(dense.vertices)
    normals = dense.normals.astype(float)
    tangents = np.cross(normals, np.where(np.abs(normals[:, :1]) < 0.7, [1, 0, 0], [0, 1, 0]))
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    source = random.random((count, 2)) * [width - 1, height - 1]
    quilt = Quilt(
        source.astype(np.float32),
        random.uniform(-3, 3, count).astype(np.float32),
        np.zeros(count, np.uint16),
        random.integers(0, 9, count).astype(np.int32),
    )
    return quilt, Field(tangents.astype(np.float32), np.zeros((0, 3)))


def scatter(positions, faces, uv, count=20000, seed=0):
    """Random points of a textured surface by area: positions (count, 3) and uv (count, 2).

    positions (F, 3, 3) and uv (F, 3, 2) are given per face corner when `faces` is None.
    """
    random = np.random.default_rng(seed)
    corner = positions if faces is None else positions[faces]
    flat = uv if faces is None else uv[faces]
    area = np.linalg.norm(
        np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1
    )
    face = random.choice(len(corner), count, p=area / area.sum())
    weight = random.dirichlet((1, 1, 1), count)
    return (
        np.einsum("nk,nkx->nx", weight, corner[face]),
        np.einsum("nk,nkx->nx", weight, flat[face].astype(float)),
    )


def bilinear(image, column, row):
    """Bilinear look-up of an image (H, W, C) with clamping, as float."""
    height, width = image.shape[:2]
    column, row = np.clip(column, 0, width - 1), np.clip(row, 0, height - 1)
    c, r = np.minimum(column.astype(int), width - 2), np.minimum(row.astype(int), height - 2)
    x, y = (column - c)[:, None], (row - r)[:, None]
    image = image.astype(float)
    above = (1 - x) * image[r, c] + x * image[r, c + 1]
    below = (1 - x) * image[r + 1, c] + x * image[r + 1, c + 1]
    return (1 - y) * above + y * below
