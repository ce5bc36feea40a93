"""Small surfaces made by formula, as plain vertex and face arrays."""

import numpy as np

TETRAHEDRON = (
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
)


def grid(rows, columns):
    """Open plane z = 0, wound counter-clockwise seen from +z."""
    y, x = np.mgrid[:rows, :columns]
    vertices = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3).astype(float)
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, d), (a, d, c))])
    return vertices, faces


def torus(around=24, across=12):
    """Closed surface of Euler number 0, normals outward."""
    u, v = np.mgrid[:around, :across]
    s, t = 2 * np.pi * u / around, 2 * np.pi * v / across
    radius = 2 + np.cos(t)
    vertices = np.stack([radius * np.cos(s), radius * np.sin(s), np.sin(t)], -1).reshape(-1, 3)
    index = np.arange(around * across).reshape(around, across)
    right, up = np.roll(index, -1, 0), np.roll(index, -1, 1)
    both = np.roll(right, -1, 1)
    faces = [np.stack(t, -1).reshape(-1, 3) for t in ((index, right, both), (index, both, up))]
    return vertices, np.concatenate(faces)


def sphere(rows=16, columns=24):
    """Unit sphere with two poles, normals outward."""
    theta = np.pi * np.arange(1, rows) / rows
    phi = 2 * np.pi * np.arange(columns) / columns
    ring = np.stack(
        [
            np.sin(theta)[:, None] * np.cos(phi),
            np.sin(theta)[:, None] * np.sin(phi),
            np.repeat(np.cos(theta)[:, None], columns, 1),
        ],
        -1,
    ).reshape(-1, 3)
    vertices = np.concatenate([ring, [[0, 0, 1.0], [0, 0, -1.0]]])
    index = np.arange((rows - 1) * columns).reshape(rows - 1, columns)
    after = np.roll(index, -1, 1)
    north, south = len(ring), len(ring) + 1
    a, b, c, d = index[:-1], after[:-1], index[1:], after[1:]
    faces = [np.stack(t, -1).reshape(-1, 3) for t in ((a, c, d), (a, d, b))]
    faces.append(np.stack([np.full(columns, north), index[0], after[0]], -1))
    faces.append(np.stack([np.full(columns, south), after[-1], index[-1]], -1))
    return vertices, np.concatenate(faces)


def moebius(around=20):
    """One-sided strip of 2 * around triangles."""
    s = 2 * np.pi * np.arange(around) / around
    edge = []
    for side in (-0.3, 0.3):
        radius = 1 + side * np.cos(s / 2)
        edge.append(np.stack([radius * np.cos(s), radius * np.sin(s), side * np.sin(s / 2)], -1))
    vertices = np.concatenate(edge)
    low, high = np.arange(around), np.arange(around) + around
    low_next, high_next = np.roll(low, -1), np.roll(high, -1)
    low_next[-1], high_next[-1] = high[0], low[0]
    first = np.stack([low, low_next, high], -1)
    second = np.stack([low_next, high_next, high], -1)
    return vertices, np.concatenate([first, second])


def cube(corner=(0, 0, 0)):
    """Unit cube of 12 triangles, normals outward."""
    vertices = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return vertices + corner, np.array(faces)


def together(*shapes):
    """Several shapes as one, without merging anything."""
    start = np.cumsum([0] + [len(v) for v, _ in shapes])
    vertices = np.concatenate([v for v, _ in shapes])
    return vertices, np.concatenate([f + s for (_, f), s in zip(shapes, start, strict=False)])


def volume(vertices, faces):
    """Signed volume enclosed by a closed surface."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)
