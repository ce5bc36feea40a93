"""Dense meshes made by formula, for tests that need no atlas."""

import numpy as np

from btfcore.types import DenseMesh, Field, Sample


def dense_mesh(vertices, faces, texel=None, chart=None):
    """DenseMesh of bare arrays; without `texel` every vertex is a chart of its own."""
    vertices = np.asarray(vertices, np.float64)
    faces = np.asarray(faces, np.int32)
    count = len(vertices)
    corner = vertices[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normals = np.zeros((count, 3))
    for k in range(3):
        np.add.at(normals, faces[:, k], normal)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]
    alone = texel is None
    if alone:
        texel = np.stack([3 * np.arange(count)] * 2, axis=1)
        chart = np.arange(count)
    return DenseMesh(
        vertices,
        normals.astype(np.float32),
        faces,
        np.asarray(texel, np.int32),
        np.asarray(chart, np.int32),
        np.zeros(count, np.int32),
        np.zeros((count, 3), np.float32),
        int(np.max(texel)) + 2,
        0 if alone else len(faces),
    )


def grid_faces(rows, columns, wrap=False):
    """Two triangles per cell, counter-clockwise for column = +x and row = -y."""
    row, column = np.meshgrid(
        np.arange(rows - 1), np.arange(columns if wrap else columns - 1), indexing="ij"
    )
    a, b = row * columns + column, row * columns + (column + 1) % columns
    c, d = a + columns, b + columns
    low = np.stack([a, c, b], axis=-1).reshape(-1, 3)
    high = np.stack([b, c, d], axis=-1).reshape(-1, 3)
    return np.concatenate([low, high])


def plane(rows=40, columns=50, one_chart=True):
    """Flat grid in the xy plane, texel edge 1."""
    row, column = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    vertices = np.stack([column, -row, 0 * row], axis=-1).reshape(-1, 3)
    texel = np.stack([row, column], axis=-1).reshape(-1, 2) if one_chart else None
    chart = np.zeros(rows * columns) if one_chart else None
    return dense_mesh(vertices, grid_faces(rows, columns), texel, chart)


def cylinder(around=60, rows=80):
    """Open cylinder of edge length 1 about the y axis, outward normals."""
    radius = around / (2 * np.pi)
    row, column = np.meshgrid(np.arange(rows), np.arange(around), indexing="ij")
    angle = 2 * np.pi * column / around
    vertices = np.stack([radius * np.sin(angle), -row, radius * np.cos(angle)], axis=-1)
    return dense_mesh(vertices.reshape(-1, 3), grid_faces(rows, around, wrap=True))


def sphere(level=5, radius=1.0):
    """Subdivided icosahedron."""
    golden = (1 + 5**0.5) / 2
    points = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)]
    points = np.array(
        points + [(z, x, y) for x, y, z in points] + [(y, z, x) for x, y, z in points]
    )
    from scipy.spatial import ConvexHull

    faces = ConvexHull(points).simplices
    for _ in range(level):
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        unique, inverse = np.unique(edges, axis=0, return_inverse=True)
        middle = len(points) + inverse.reshape(-1, 3)
        points = np.concatenate([points, points[unique].mean(axis=1)])
        a, b, c = faces.T
        ab, bc, ca = middle.T
        faces = np.concatenate(
            [np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    points = points / np.linalg.norm(points, axis=1)[:, None] * radius
    corner = points[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    inward = (normal * corner.mean(axis=1)).sum(axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return dense_mesh(points, faces)


def constant_field(dense, direction=(1.0, 0.0, 0.0)):
    """Projection of one direction to the tangent planes."""
    normals = dense.normals.astype(np.float64)
    vector = np.asarray(direction) - normals * (normals @ np.asarray(direction))[:, None]
    short = np.linalg.norm(vector, axis=1) < 1e-6
    vector[short] = np.cross(normals[short], [0.3, 0.5, 0.8])
    vector /= np.linalg.norm(vector, axis=1)[:, None]
    return Field(vector.astype(np.float32), np.zeros((0, 3)))


def random_field(dense, seed=0):
    """Unit tangents without any order."""
    normals = dense.normals.astype(np.float64)
    vector = np.random.default_rng(seed).standard_normal(normals.shape)
    vector -= normals * (vector * normals).sum(axis=1)[:, None]
    vector /= np.linalg.norm(vector, axis=1)[:, None]
    return Field(vector.astype(np.float32), np.zeros((0, 3)))


def blobs(height=64, width=64, seed=0):
    """Smooth random colours in 0–1, a sample with structure at several texels."""
    from scipy.ndimage import gaussian_filter

    noise = np.random.default_rng(seed).standard_normal((height, width, 3))
    colour = np.stack([gaussian_filter(noise[..., k], 2.5) for k in range(3)], axis=-1)
    colour = ((colour - colour.min()) / (colour.max() - colour.min())).astype(np.float32)
    return Sample("blobs", colour, colour.copy())
