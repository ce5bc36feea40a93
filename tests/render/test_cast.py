"""Shadows fall where geometry says, and a smooth surface throws none onto itself."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from btfcore.errors import InvalidParameter
from btfcore.mesh.rays import ray_tree
from btfcore.mesh.topology import vertex_normals
from btfcore.render.cast import caster, disc, ray_origins, visibility
from btfcore.render.lights import Lights, directional
from btfcore.render.surfels import Surfels, turned_frames
from tests.render.skies import normals as evenly


def icosphere(levels):
    """Unit sphere of 20 · 4^levels flat faces."""
    g = (1 + 5**0.5) / 2
    vertices = np.array(
        [[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0], [0, -1, g], [0, 1, g]]
        + [[0, -1, -g], [0, 1, -g], [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1]],
        float,
    )
    faces = np.array(
        [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4]]
        + [[11, 10, 2], [10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8]]
        + [[3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1]]
    )
    for _ in range(levels):
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), 1)
        pairs, number = np.unique(edges, axis=0, return_inverse=True)
        ab, bc, ca = len(vertices) + number.ravel().reshape(3, -1)
        a, b, c = faces.T
        vertices = np.concatenate([vertices, vertices[pairs].mean(axis=1)])
        parts = ([a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca])
        faces = np.concatenate([np.stack(part, axis=1) for part in parts])
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    return vertices, faces.astype(np.int32)


def points_on(vertices, faces, count, seed=0):
    """Random points of a surface: face, bary, smooth normals (n, 3) f4."""
    rng = np.random.default_rng(seed)
    corner = vertices[faces]
    area = np.linalg.norm(
        np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1
    )
    face = rng.choice(len(faces), count, p=area / area.sum())
    bary = rng.dirichlet([1, 1, 1], count).astype(np.float32)
    smooth = np.einsum("nk,nkc->nc", bary, vertex_normals(vertices, faces)[faces[face]])
    smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
    return face, bary, smooth.astype(np.float32)


def seen(vertices, faces, count, lights, **knobs):
    face, bary, smooth = points_on(vertices, faces, count)
    origins = ray_origins(vertices, faces, face, bary, smooth)
    found = visibility(ray_tree(vertices, faces), origins, smooth, lights, **knobs)
    place = np.einsum("nk,nkc->nc", bary, vertices[faces[face]])
    return found, place, smooth


def ball_over_plane(radius=0.3, height=0.5):
    ball, ball_faces = icosphere(4)
    plane = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    vertices = np.concatenate([ball * radius + [0, 0, height], plane])
    return vertices, np.concatenate([ball_faces, len(ball) + np.array([[0, 1, 2], [0, 2, 3]])])


def test_a_ball_throws_the_shadow_that_geometry_says():
    vertices, faces = ball_over_plane()
    lights = directional([[0, 0, 1], [0.5, 0.2, 1], [-1, 1, 0.8]])
    found, place, smooth = seen(vertices, faces, 20_000, lights)
    ground = np.abs(place[:, 2]) < 1e-9
    for light, direction in enumerate(lights.direction):
        away = place[ground] - [0, 0, 0.5]
        beside = np.linalg.norm(np.cross(away, direction), axis=1)
        towards = np.einsum("nc,c->n", away, direction) < 0
        shadow = towards & (beside < 0.3)
        clear = np.abs(beside - 0.3) > 0.003  # the ball has flat faces
        assert shadow.any()
        assert np.array_equal(found[light, ground][clear] == 0, shadow[clear])


@pytest.mark.parametrize("levels", [0, 1, 2, 4])
def test_a_low_poly_sphere_throws_none_onto_its_lit_side(levels):
    vertices, faces = icosphere(levels)
    lights = directional(evenly(12))
    found, _, smooth = seen(vertices, faces, 4000, lights)
    lit = np.einsum("lc,nc->ln", lights.direction, smooth.astype(float)) > 0
    assert (found[~lit] == 0).all()
    if levels:
        assert (found[lit] == 1).all()
    else:  # twenty faces are no sphere, but nearly
        assert found[lit].mean() > 0.97


def test_without_the_lift_the_faces_would_show():
    vertices, faces = icosphere(1)
    face, bary, smooth = points_on(vertices, faces, 4000)
    flat = np.einsum("nk,nkc->nc", bary, vertices[faces[face]]) + 2e-4 * smooth
    light = directional([[1, 2, 3]])
    lit = smooth @ light.direction[0] > 0
    found = visibility(ray_tree(vertices, faces), flat.astype(np.float32), smooth, light)
    assert (found[0, lit] == 0).mean() > 0.03


def test_a_stretched_closed_convex_mesh_throws_none():
    vertices, faces = icosphere(3)
    found, _, smooth = seen(vertices * [1, 0.4, 0.7], faces, 5000, directional(evenly(8)))
    lit = np.einsum("lc,nc->ln", evenly(8), smooth.astype(float)) > 0
    assert (found[lit] == 1).all()


def test_a_soft_light_has_a_penumbra_and_the_same_umbra():
    vertices, faces = ball_over_plane()
    light = directional([0, 0, 1])
    hard, place, _ = seen(vertices, faces, 6000, light)
    soft, _, _ = seen(vertices, faces, 6000, light, radius=6, rays=16)
    ground = np.abs(place[:, 2]) < 1e-9
    beside = np.hypot(place[:, 0], place[:, 1])
    reach = 0.5 * np.tan(np.radians(6)) + 0.01
    for inside in (ground & (beside < 0.3 - reach), ground & (beside > 0.3 + reach)):
        assert inside.any() and np.array_equal(soft[0, inside], hard[0, inside])
    edge = ground & (np.abs(beside - 0.3) < 0.02)
    assert 0.3 < soft[0, edge].mean() < 0.7
    assert ((soft > 0) & (soft < 1)).any()


def test_the_disc_covers_its_angle_evenly():
    for direction in evenly(5):
        aims = disc(direction, 10, 64)
        cosine = aims @ direction
        assert np.allclose(np.linalg.norm(aims, axis=1), 1)
        assert cosine.min() > np.cos(np.radians(10))
        assert (
            np.linalg.norm(aims.mean(axis=0) / np.linalg.norm(aims.mean(axis=0)) - direction) < 0.01
        )


def test_chosen_surfels_and_threads_give_the_same_bits():
    vertices, faces = ball_over_plane()
    lights = directional([[0.5, 0.2, 1], [0, 0, -1]])
    face, bary, smooth = points_on(vertices, faces, 9000)
    origins = ray_origins(vertices, faces, face, bary, smooth)
    tree = ray_tree(vertices, faces)
    whole = visibility(tree, origins, smooth, lights, radius=2, rays=3)
    chosen = np.random.default_rng(0).permutation(9000)[:5000]
    with ThreadPoolExecutor(2) as pool:
        part = visibility(tree, origins, smooth, lights, chosen=chosen, radius=2, rays=3, pool=pool)
    assert np.array_equal(part, whole[:, chosen])
    assert whole.dtype == np.float32 and whole.shape == (2, 9000)
    assert visibility(tree, origins, smooth, directional(np.zeros((0, 3)))).shape == (0, 9000)


def test_a_sharp_edge_lifts_nothing():
    # a cube's averaged normals describe no curved surface
    vertices = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])])
    face, bary, smooth = points_on(vertices, faces, 500)
    origins = ray_origins(vertices, faces, face, bary, smooth)
    place = np.einsum("nk,nkc->nc", bary, vertices[faces[face]])
    assert np.linalg.norm(origins - place, axis=1).max() < 1e-3


def test_impossible_knobs_are_named():
    vertices, faces = icosphere(0)
    face, bary, smooth = points_on(vertices, faces, 10)
    origins = ray_origins(vertices, faces, face, bary, smooth)
    tree = ray_tree(vertices, faces)
    for knobs, said in (({"rays": 0}, "0 rays"), ({"radius": 90, "rays": 4}, "90 degrees")):
        with pytest.raises(InvalidParameter, match=said):
            visibility(tree, origins, smooth, directional([0, 0, 1]), **knobs)


def surfels_on(vertices, faces, count):
    """Surfels at random points of a mesh, and where they lie: face, bary."""
    face, bary, smooth = points_on(vertices, faces, count)
    place = np.einsum("nk,nkc->nc", bary, vertices[faces[face]]).astype(np.float32)
    frame = turned_frames(smooth, np.ones_like(smooth), np.zeros(count))
    texel = np.zeros((count, 2), np.float32)
    return Surfels(place, frame, texel, np.zeros(count, np.uint16)), face, bary


def test_a_caster_finds_by_itself_where_its_surfels_lie():
    vertices, faces = icosphere(1)
    surfels, face, bary = surfels_on(vertices, faces, 3000)
    known = caster(vertices, faces, surfels, face=face, bary=bary)
    found = caster(vertices, faces, surfels)
    assert np.abs(known.origins - found.origins).max() < 1e-5
    # vertices that textures split keep their common normals
    split = caster(vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3), surfels)
    assert np.abs(split.origins - known.origins).max() < 1e-5
    lights = directional(evenly(6))
    assert np.array_equal(split.visibility(lights), known.visibility(lights))


def test_an_environment_may_cast_none():
    vertices, faces = ball_over_plane()
    surfels, face, bary = surfels_on(vertices, faces, 3000)
    made = caster(vertices, faces, surfels, face=face, bary=bary)
    point = directional([[0, 0, 1], [0, 1, 1]])
    lights = Lights(point.direction, point.intensity, sampled=1)
    chosen = np.arange(0, 3000, 3)
    some = made.visibility(lights, chosen, environment=False)
    every = made.visibility(lights, chosen)
    assert np.array_equal(some[0], every[0]) and (every[0] == 0).any()
    assert (some[1] == 1).all() and (every[1] == 0).any()


def test_a_caster_without_a_face_casts_nothing():
    vertices, faces = icosphere(0)
    surfels, _, _ = surfels_on(vertices, faces, 50)
    made = caster(vertices, np.zeros((0, 3), np.int32), surfels)
    lit = surfels.frame[:, 2, 2] > 0
    assert np.array_equal(made.visibility(directional([0, 0, 1]))[0] == 1, lit)
