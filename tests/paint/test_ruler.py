"""The way over a surface lies on it and is as long as geometry says."""

import numpy as np
import pytest

from btfcore.errors import InvalidMesh
from btfcore.paint.ruler import Ruler
from tests.surfaces import grid_faces

MIDDLE = np.full(3, 1 / 3)


def grid(count=21, shape=lambda x, y: (x, y, 0 * x)):
    """Square of count x count vertices over 0–1, bent by `shape`."""
    y, x = np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, count), indexing="ij")
    points = np.stack(np.broadcast_arrays(*shape(x.ravel(), y.ravel())), axis=-1)
    return np.asarray(points, float), grid_faces(count, count, wrap=False)


def ball(rings=48):
    """Unit ball in rings and twice as many meridians."""
    theta = np.pi * np.arange(1, rings) / rings
    phi = np.pi * np.arange(2 * rings) / rings
    t, p = (each.ravel() for each in np.meshgrid(theta, phi, indexing="ij"))
    points = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=1)
    points = np.concatenate([points, [[0, 0, 1], [0, 0, -1]]])
    across, many = 2 * rings, len(points)
    faces = []
    for c in range(across):
        d = (c + 1) % across
        faces += [[many - 2, c, d], [many - 1, many - 2 - across + d, many - 2 - across + c]]
        for r in range(rings - 2):
            a, b = r * across, (r + 1) * across
            faces += [[a + c, b + c, b + d], [a + c, b + d, a + d]]
    return points, np.array(faces, np.int32)


def place(points, faces, at):
    """Face and weights nearest to a point, by its flattest face."""
    corner = points[faces]
    face = int(np.linalg.norm(corner.mean(axis=1) - at, axis=1).argmin())
    return face, MIDDLE, corner[face].mean(axis=0)


def on_surface(points, faces, way):
    """Greatest distance of a way's points from the nearest face's plane and box."""
    corner = points[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    away = []
    for point in way:
        height = np.abs(np.einsum("fj,fj->f", point - corner[:, 0], normal))
        outside = np.maximum(corner.min(axis=1) - point, point - corner.max(axis=1)).max(axis=1)
        away.append(np.maximum(height, outside).min())
    return max(away)


@pytest.mark.parametrize(
    ("start", "end"),
    [((0.1, 0.2), (0.85, 0.7)), ((0.5, 0.1), (0.5, 0.9)), ((0.9, 0.1), (0.1, 0.12))],
)
def test_on_a_plane_the_way_is_straight(start, end):
    points, faces = grid()
    one, two = place(points, faces, [*start, 0]), place(points, faces, [*end, 0])
    way = Ruler(points, faces).between(one[:2], two[:2])
    straight = np.linalg.norm(two[2] - one[2])
    assert way.length == pytest.approx(straight, rel=2e-3)
    assert way.points[0] == pytest.approx(one[2]) and way.points[-1] == pytest.approx(two[2])
    unit = (two[2] - one[2]) / straight
    apart = np.linalg.norm(np.cross(way.points - one[2], unit), axis=1)
    assert apart.max() < 0.03, "less than a triangle's edge beside the line"


def test_a_sheet_that_is_bent_keeps_its_lengths():
    bent = grid(41, lambda x, y: (np.sin(3 * x) / 3, y, np.cos(3 * x) / 3))
    flat = grid(41)
    one, two = place(*flat, [0.05, 0.2, 0]), place(*flat, [0.95, 0.8, 0])
    way = Ruler(*bent).between(one[:2], two[:2])
    assert way.length == pytest.approx(np.linalg.norm(two[2] - one[2]), rel=3e-3)
    assert way.length > 1.2 * np.linalg.norm(way.points[-1] - way.points[0])
    assert on_surface(*bent, way.points) < 1e-6


def test_around_a_corner_the_way_crosses_the_edge_where_it_is_shortest():
    """Two walls at a right angle: unfolded, the way is a straight line."""
    fold = grid(41, lambda x, y: (np.minimum(x, 0.5), y, np.minimum(0.5 - x, 0.0)))
    flat = grid(41)
    one, two = place(*flat, [0.1, 0.1, 0]), place(*flat, [0.9, 0.9, 0])
    way = Ruler(*fold).between(one[:2], two[:2])
    assert way.length == pytest.approx(np.linalg.norm(two[2] - one[2]), rel=2e-3)
    edge = way.points[np.abs(way.points[:, 0] - 0.5).argmin()]
    assert edge[1] == pytest.approx(0.5, abs=0.04)


def test_on_a_ball_the_way_is_a_great_circle():
    points, faces = ball()
    one, two = place(points, faces, [1, 0, 0.1]), place(points, faces, [-0.5, 0.8, 0.4])
    way = Ruler(points * 7.0 + 1e4, faces).between(one[:2], two[:2])
    a, b = (each[2] / np.linalg.norm(each[2]) for each in (one, two))
    assert way.length == pytest.approx(7 * np.arccos(a @ b), rel=5e-3)
    moved = (way.points - 1e4) / 7
    assert on_surface(points, faces, moved) < 1e-6
    across = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
    assert np.abs(moved @ across).max() < 0.05


def test_the_way_back_is_as_long():
    points, faces = ball(24)
    ruler = Ruler(points, faces)
    rng = np.random.default_rng(5)
    for _ in range(12):
        ends = [(int(rng.integers(len(faces))), rng.dirichlet(np.ones(3))) for _ in range(2)]
        there, back = ruler.between(*ends), ruler.between(*ends[::-1])
        assert there.length == pytest.approx(back.length, rel=0.02, abs=1e-9)
        assert there.length >= np.linalg.norm(there.points[-1] - there.points[0]) * 0.999
        assert on_surface(points, faces, there.points) < 1e-6


def test_parts_that_do_not_hang_together_have_no_way():
    points, faces = grid(5)
    two = np.concatenate([points, points + [3.0, 0, 0]])
    ruler = Ruler(two, np.concatenate([faces, faces + len(points)]))
    way = ruler.between((0, MIDDLE), (len(faces) + 3, MIDDLE))
    assert np.isinf(way.length) and way.points.shape == (0, 3)
    same = ruler.between((4, np.array([1.0, 0, 0])), (4, np.array([0, 1.0, 0])))
    assert same.length == pytest.approx(np.linalg.norm(same.points[1] - same.points[0]))


def test_a_mesh_without_faces_or_size_is_refused():
    with pytest.raises(InvalidMesh, match="0 faces"):
        Ruler(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    with pytest.raises(InvalidMesh, match="0 long"):
        Ruler(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32))
