"""What holds for every atlas, checked in plain numpy."""

import numpy as np


def areas(uv):
    """Signed area of every face, positive where it is not mirrored (rows go down)."""
    one, two = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return (one[:, 1] * two[:, 0] - one[:, 0] * two[:, 1]) / 2


def surface(mesh):
    corner = mesh.vertices[mesh.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return np.linalg.norm(normal, axis=1) / 2


def cover(atlas):
    """Chart at every texel centre (size, size), -1 where none; and centres hit more than once."""
    image = np.full((atlas.size, atlas.size), -1)
    crowded = 0
    for f, corner in enumerate(atlas.uv):
        low = np.maximum(np.ceil(corner.min(axis=0)).astype(int), 0)
        high = np.minimum(np.floor(corner.max(axis=0)).astype(int), atlas.size - 1)
        if (high < low).any():
            continue
        x, y = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1))
        point = np.stack([x, y], axis=-1)
        sides = []
        for k in range(3):
            edge, to = corner[(k + 1) % 3] - corner[k], point - corner[k]
            sides.append(edge[1] * to[..., 0] - edge[0] * to[..., 1])
        inside = np.min(np.stack(sides) * np.sign(areas(atlas.uv[f][None])[0]), axis=0) > 1e-9
        part = image[low[1] : high[1] + 1, low[0] : high[0] + 1]
        crowded += int((part[inside] >= 0).sum())
        part[inside] = atlas.chart[f]
    return image, crowded


def least_gap(image, most=4):
    """Smallest difference in rows or columns between texels of two charts, up to `most`."""
    for gap in range(1, most):
        for dy in range(-gap, gap + 1):
            for dx in range(-gap, gap + 1):
                if max(abs(dy), abs(dx)) != gap:
                    continue
                a = image[max(dy, 0) : len(image) + min(dy, 0)]
                b = image[max(-dy, 0) : len(image) + min(-dy, 0)]
                a = a[:, max(dx, 0) : image.shape[1] + min(dx, 0)]
                b = b[:, max(-dx, 0) : image.shape[1] + min(-dx, 0)]
                if ((a >= 0) & (b >= 0) & (a != b)).any():
                    return gap
    return most


def stretches(atlas):
    """Area stretch of every face, max(r, 1/r), about the atlas's own density; and its weight."""
    area, flat = surface(atlas.mesh), np.abs(areas(atlas.uv))
    ratio = flat / np.maximum(area, 1e-300) * area.sum() / flat.sum()
    return np.maximum(ratio, 1 / np.maximum(ratio, 1e-9)).clip(0, 10), area / area.sum()


def torn(atlas):
    """Number of edges inside a chart whose two faces place it differently."""
    sides = {}
    wrong = 0
    for f, face in enumerate(atlas.mesh.faces):
        for k in range(3):
            a, b = int(face[k]), int(face[(k + 1) % 3])
            ends = atlas.uv[f, k], atlas.uv[f, (k + 1) % 3]
            other = sides.pop((b, a), None)
            if other is None:
                sides[a, b] = f, ends
            elif atlas.chart[other[0]] == atlas.chart[f]:
                apart = np.abs([other[1][1] - ends[0], other[1][0] - ends[1]]).max()
                wrong += apart > 1e-6
    return wrong


def covered_twice(charts, fine=512):
    """Points of a grid, `fine` along a square as large as the surface, that each chart covers anew.

    (C,) ints; the grid is laid through every chart's own plane.
    """
    corner = charts.uv * (fine / np.sqrt(np.abs(areas(charts.uv)).sum())) + [0.37, 0.61]
    low = np.ceil(corner.min(axis=1)).astype(np.int64)
    size = np.maximum(np.floor(corner.max(axis=1)).astype(np.int64) - low + 1, 0)
    number = size[:, 0] * size[:, 1]
    face = np.repeat(np.arange(len(number)), number)
    at = np.arange(len(face)) - np.repeat(np.cumsum(number) - number, number)
    point = low[face] + np.stack([at % size[face, 0], at // size[face, 0]], axis=1)
    inside = np.ones(len(face), bool)
    side = np.sign(areas(corner))[face]
    for k in range(3):
        edge = (corner[:, (k + 1) % 3] - corner[:, k])[face]
        to = point - corner[face, k]
        inside &= (edge[:, 1] * to[:, 0] - edge[:, 0] * to[:, 1]) * side > 1e-9
    point, chart = point[inside], charts.chart[face[inside]].astype(np.int64)
    point -= point.min(axis=0)
    wide, high = point.max(axis=0) + 1
    key, times = np.unique((chart * high + point[:, 1]) * wide + point[:, 0], return_counts=True)
    count = int(charts.chart.max()) + 1
    return np.bincount(key // (wide * high), times - 1, count).astype(int)


def check_atlas(atlas, *, gap=3, mirrored=1e-3, stretch=1.06, occupancy=0.0):
    """Assert every law; the mesh should be small, the texels are visited one by one."""
    faces = len(atlas.mesh.faces)
    assert atlas.uv.shape == (faces, 3, 2) and atlas.uv.dtype == np.float64
    assert atlas.chart.shape == (faces,) and atlas.chart.dtype == np.int32
    assert np.array_equal(np.unique(atlas.chart), np.arange(atlas.chart.max() + 1))
    assert np.isfinite(atlas.uv).all()
    assert atlas.uv.min() >= 0.5 - 1e-9 and atlas.uv.max() <= atlas.size - 1.5 + 1e-9
    area = areas(atlas.uv)
    total = np.abs(area).sum()
    assert -area[area < 0].sum() <= mirrored * total
    assert torn(atlas) == 0
    factor, weight = stretches(atlas)
    assert (factor * weight).sum() <= stretch
    image, crowded = cover(atlas)
    covered = np.unique(image)
    assert np.array_equal(covered[covered >= 0], np.arange(atlas.chart.max() + 1))
    assert crowded <= 2e-3 * (image >= 0).sum() + 2
    assert least_gap(image) >= gap
    assert total >= occupancy * atlas.size**2
