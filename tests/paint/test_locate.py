"""Laws of finding places on the dense mesh."""

import numpy as np
import pytest

from btfcore.errors import InvalidEdit
from btfcore.paint.locate import Locator, _closest
from tests.paint.grounds import ball, cow, flat, walls
from tests.surfaces import dense_mesh


def near_surface(dense, count=200, seed=0):
    """Points within a twentieth of the diagonal of the surface, off it both ways."""
    random = np.random.default_rng(seed)
    face = dense.faces[random.integers(0, len(dense.faces), count)]
    weight = random.dirichlet([1, 1, 1], count)
    on = np.einsum("nk,nkx->nx", weight, dense.vertices[face])
    size = np.linalg.norm(np.ptp(dense.vertices, axis=0))
    return on + random.uniform(-0.02, 0.02, (count, 1)) * size * dense.normals[face[:, 0]]


def by_hand(point, a, b, c):
    """Nearest point of a triangle: the plane's foot where it is inside, else of three sides."""
    normal = np.cross(b - a, c - a)
    best = None
    if normal @ normal > 0:
        flat = point - (point - a) @ normal / (normal @ normal) * normal
        signs = [np.cross(q - p, flat - p) @ normal for p, q in ((a, b), (b, c), (c, a))]
        if min(signs) >= 0:
            best = flat
    if best is None:
        feet = []
        for p, q in ((a, b), (b, c), (c, a)):
            along = (q - p) @ (q - p)
            share = np.clip((point - p) @ (q - p) / along, 0, 1) if along else 0.0
            feet.append(p + share * (q - p))
        best = min(feet, key=lambda foot: np.linalg.norm(foot - point))
    return best


def test_the_nearest_point_of_a_triangle_equals_its_twin():
    random = np.random.default_rng(3)
    weight = np.empty(3)
    for number in range(400):
        point, *corner = random.standard_normal((4, 3))
        if number % 10 == 0:
            corner[2] = corner[0] + random.uniform(-1, 2) * (corner[1] - corner[0])  # no area
        if number % 40 == 0:
            corner[1] = corner[0].copy()
        _closest(point, *corner, weight)
        assert np.isclose(weight.sum(), 1) and (weight >= 0).all()
        reached = np.linalg.norm(weight @ np.array(corner) - point)
        assert np.isclose(reached, np.linalg.norm(by_hand(point, *corner) - point), atol=1e-6)


@pytest.mark.parametrize("place", [flat, ball, cow])
def test_the_triangle_found_is_the_nearest_of_all(place):
    import igl

    place = place()
    points = near_surface(place.dense)
    feet = place.locator().nearest(points)
    squared, _, _ = igl.point_mesh_squared_distance(
        points, np.ascontiguousarray(place.dense.vertices), place.dense.faces.astype(np.int64)
    )
    # a sliver of the zipper may have all its corners farther away than the eight that are tried
    assert (feet.distance >= np.sqrt(squared) - 1e-9).all()
    exact = feet.distance <= np.sqrt(squared) + 1e-9
    assert exact.mean() > 0.98
    assert (feet.distance - np.sqrt(squared)).max() < 0.5 * place.step


@pytest.mark.parametrize("place", [flat, ball, cow])
def test_what_is_said_of_a_place_agrees(place):
    place = place()
    dense, points = place.dense, near_surface(place.dense, seed=1)
    feet = place.locator().nearest(points)
    assert np.array_equal(feet.corner, dense.faces[feet.face])
    corner = dense.vertices[feet.corner]
    assert np.allclose(np.einsum("nk,nkx->nx", feet.bary, corner), feet.position)
    assert np.allclose(np.linalg.norm(points - feet.position, axis=1), feet.distance)
    inner = feet.beyond == 0
    assert inner.any()
    away = np.linalg.norm(corner - feet.position[:, None], axis=2) / place.step
    assert np.allclose(feet.start[inner], away[inner])
    nearest = feet.start.argmin(axis=1)
    assert np.array_equal(feet.vertex, feet.corner[np.arange(len(feet)), nearest])


def test_one_by_one_gives_the_same_bits():
    place = cow()
    points = near_surface(place.dense, 60, seed=2)
    normals = np.random.default_rng(0).standard_normal((60, 3))
    together = place.locator().nearest(points, normals)
    for index in range(60):
        alone = place.locator().nearest(points[index], normals[index])
        for name in vars(together):
            assert np.array_equal(getattr(together, name)[[index]], getattr(alone, name))


def test_a_normal_chooses_the_side_of_a_thin_wall():
    place = walls(gap=1.0)
    locator, half = place.locator(), len(place.dense.vertices) // 2
    points = np.tile([20.3, -20.4, -0.1], (3, 1))  # nearer to the upper wall
    normals = np.array([[0, 0, 1.0], [0, 0, -1], [0, 0, 0]])
    feet = locator.nearest(points, normals)
    assert (feet.vertex >= half).tolist() == [False, True, False]
    assert np.allclose(feet.position[:, 2], [0, -1, 0])
    assert locator.find(points[1], normals[1]).vertex[0] == feet.vertex[1]
    slanted = locator.nearest(points[1], np.array([0.9, 0.0, -0.1]))
    assert slanted.vertex[0] == feet.vertex[1], "89 degrees are still within 90"


def test_a_side_that_nothing_looks_to_is_refused():
    place = flat()
    with pytest.raises(InvalidEdit, match=r"a click at \(50, -40, 0\) has no surface that looks"):
        place.locator().find(np.array([50.0, -40, 0]), np.array([0, 0, -1.0]), what="a click")
    with pytest.raises(InvalidEdit, match="has no surface that looks its way"):
        place.locator().find(np.array([50.0, -40, 0]), np.array([1.0, 0, 0]))


def test_a_point_off_the_surface_is_refused_with_its_distance():
    locator = flat().locator()
    assert np.isclose(locator.tolerance, 0.05 * np.hypot(100, 80))
    assert locator.find(np.array([50.0, -40, 6.4])).distance[0] == 6.4
    with pytest.raises(InvalidEdit, match=r"\(50, -40, 6\.5\) is 6\.5 away .* than 6\.4"):
        locator.find(np.array([50.0, -40, 6.5]))
    with pytest.raises(InvalidEdit, match="not finite"):
        locator.find(np.array([np.nan, 0, 0]))


def test_beyond_the_border_distances_start_at_the_point():
    place = flat()
    for y in (-40.4, -40.0, 0.0):  # an edge, a vertex, a corner
        feet = place.locator().nearest(np.array([[103.0, y, 1.0], [100.0, y, 1.0]]))
        assert np.allclose(feet.position, [[100, y, 0]] * 2)
        assert np.allclose(feet.beyond, [3 / place.step, 0])
        corner = place.dense.vertices[feet.corner[0]]
        away = np.linalg.norm(corner - [103.0, y, 0.0], axis=1) / place.step
        assert np.allclose(feet.start[0], away)


def test_an_edge_between_two_faces_is_no_border():
    place = ball()
    a, b, _ = place.dense.vertices[place.dense.faces[7]]
    feet = place.locator().nearest(np.stack([(a + b) / 2 * 1.02, a * 1.02]))
    assert (feet.beyond == 0).all()


def test_a_mesh_of_one_triangle():
    dense = dense_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    feet = Locator(dense).nearest(np.array([[0.2, 0.3, 0.01]]))
    assert np.allclose(feet.bary, [[0.5, 0.2, 0.3]]) and feet.face[0] == 0
    assert len(Locator(dense).nearest(np.zeros((0, 3)))) == 0
