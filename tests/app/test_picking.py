"""Places of the picture and places of the surface belong together, both ways."""

import dataclasses

import numpy as np
import pytest

from app.picking import Picker, View
from btfcore.errors import InvalidParameter
from btfcore.files.surface import ExportSurface, export_input
from btfcore.mesh.topology import vertex_normals
from btfcore.render.camera import Turntable
from btfcore.types import DenseMesh
from tests.mesh.test_pick import plain

VIEW = View(Turntable(30.0, 25.0, distance=2.9), (400, 300))


def surface_of(vertices, faces, closed=True):
    """Surface with smooth normals and no useful texture coordinates."""
    vertices, faces = np.asarray(vertices, float), np.asarray(faces, np.int32)
    count = len(vertices)
    return ExportSurface(
        vertices, vertex_normals(vertices, faces).astype(np.float32),
        np.tile(np.float32([1, 0, 0, 1]), (count, 1)), np.zeros((count, 2), np.float32), faces,
        np.arange(count, dtype=np.int32), closed,
    )  # fmt: skip


def wall(x=0.0, side=1.0):
    """Square across the z axis, seen from +z, in two triangles."""
    corner = np.array([[-side, -side, x], [side, -side, x], [side, side, x], [-side, side, x]])
    return corner, np.array([[0, 1, 2], [0, 2, 3]])


@pytest.fixture(scope="module")
def torus(ring):
    mesh, atlas, dense, _ = ring
    return export_input(mesh, atlas), dense


def pixels_of(count, size=(400, 300), seed=0):
    return np.random.default_rng(seed).uniform(0, 1, (count, 2)) * size


def test_a_pixel_shows_what_the_plain_search_finds(torus):
    surface, _ = torus
    picker = Picker(surface)
    places = pixels_of(60)
    hits = picker.pick(VIEW, places)
    scene = picker.place.to_scene(surface.positions)
    rays = VIEW.camera.rays(places, VIEW.size)
    for n in range(60):
        face, distance, bary = plain(scene, surface.faces, VIEW.camera.position, rays[n])
        assert hits.face[n] == face
        if face >= 0:
            assert hits.bary[n] == pytest.approx(bary, abs=1e-8)
            seen = VIEW.camera.local(scene[surface.faces[face]].T @ bary)
            assert hits.depth[n] == pytest.approx(seen[2])
    assert 10 < hits.on.sum() < 50
    off = ~hits.on
    assert np.isnan(hits.position[off]).all() and np.isinf(hits.depth[off]).all()


@pytest.mark.parametrize(("shift", "size"), [(0.0, 1.0), (1e6, 1.0), (-3e4, 1e-3), (0.0, 1e9)])
def test_a_hit_lies_under_its_pixel_wherever_and_however_large_the_mesh_is(torus, shift, size):
    surface, _ = torus
    moved = dataclasses.replace(surface, positions=surface.positions * size + shift)
    picker = Picker(moved)
    places = pixels_of(500)
    hits = picker.pick(VIEW, places)
    back = picker.pixels(VIEW, hits.position)[hits.on]
    # what a double far from the origin can tell
    finest = np.spacing(abs(shift) + size) / size * 1000
    assert np.abs(back[:, :2] - places[hits.on]).max() < 1e-6 + finest
    assert back[:, 2] == pytest.approx(hits.depth[hits.on], abs=1e-6 + finest)
    assert np.array_equal(hits.face, Picker(surface).pick(VIEW, places).face)


def test_normals_are_smooth_unit_and_outward(torus):
    surface, _ = torus
    hits = Picker(surface).pick(VIEW, pixels_of(500))
    point, normal = hits.position[hits.on], hits.normal[hits.on]
    around = point * [1, 0, 1]
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    true = point - around
    true /= np.linalg.norm(true, axis=1, keepdims=True)
    assert np.linalg.norm(normal, axis=1) == pytest.approx(1.0)
    assert np.einsum("nj,nj->n", normal, true).min() > 0.98
    assert hits.front[hits.on].all()


def test_the_texel_and_the_dense_vertex_lie_where_the_hit_does(torus):
    surface, dense = torus
    picker = Picker(surface, dense=dense)
    hits = picker.pick(VIEW, pixels_of(300))
    texel = picker.texels(hits, dense.size)
    vertex = picker.vertices(hits)
    assert np.array_equal(vertex >= 0, hits.on) and np.array_equal(
        np.isfinite(texel).all(axis=1), hits.on
    )
    on = hits.on
    assert np.abs(texel[on][:, ::-1] - dense.texel[vertex[on]]).max() < 1.6
    away = np.linalg.norm(dense.vertices[vertex[on]] - hits.position[on], axis=1)
    assert away.max() < 2 * dense.step
    nearest = np.linalg.norm(dense.vertices[None] - hits.position[on][:20, None], axis=2)
    assert (away[:20] < nearest.min(axis=1) + 0.6 * dense.step).all()
    with pytest.raises(InvalidParameter, match="no dense mesh"):
        Picker(surface).vertices(hits)


def test_an_atlas_without_a_texel_near_gives_no_vertex(torus):
    surface, dense = torus
    few = DenseMesh(
        dense.vertices[:1], dense.normals[:1], dense.faces[:0], dense.texel[:1], dense.chart[:1],
        dense.face[:1], dense.bary[:1], dense.size, 0,
    )  # fmt: skip
    picker = Picker(surface, dense=few)
    found = picker.vertices(picker.pick(VIEW, pixels_of(300)))
    assert set(found.tolist()) <= {-1, 0} and (found == -1).sum() > 250


def test_the_inside_of_a_closed_surface_is_no_hit_and_hides_what_is_behind():
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    box = np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
         [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    )  # fmt: skip
    surface = surface_of(corner, box)
    outside = Picker(surface).pick(View(Turntable(0, 0, distance=5.0), (100, 100)), [[50, 50]])
    assert outside.on.all() and outside.position[0] == pytest.approx([0, 0, 1])
    inside = View(Turntable(0, 0, distance=0.2), (100, 100))
    assert not Picker(surface).pick(inside, [[50, 50]]).on.any()
    opened = dataclasses.replace(surface, closed=False)
    seen = Picker(opened).pick(inside, [[50, 50]])
    assert seen.on.all() and not seen.front.any() and seen.position[0, 2] == pytest.approx(-1)
    assert seen.normal[0, 2] < 0, "the surface's own normal, though it is seen from behind"


def test_what_is_cut_away_in_front_of_the_camera_is_not_hit():
    front, faces = wall(0.999, 0.2)
    back, _ = wall(-0.5, 0.2)
    surface = surface_of(np.concatenate([front, back]), np.concatenate([faces, faces + 4]), False)
    place = Picker(surface).place
    near = (0.999 - place.centre[2]) * place.scale
    view = View(Turntable(0, 0, focus=(0, 0, near - 1.0), distance=1.0 + 0.002), (100, 100))
    assert Picker(surface).pick(view, [[50, 50]]).position[0, 2] == pytest.approx(-0.5)


def test_points_are_visible_unless_something_is_in_the_way(torus):
    surface, _ = torus
    picker = Picker(surface)
    hits = picker.pick(VIEW, pixels_of(300))
    assert picker.visible(VIEW, hits.position[hits.on]).all()
    opposite = View(Turntable(210.0, -25.0, distance=2.9), VIEW.size)
    assert picker.visible(opposite, hits.position[hits.on]).mean() < 0.2
    behind = VIEW.camera.position * 1.5 / picker.place.scale + np.array(picker.place.centre)
    assert not picker.visible(VIEW, behind).any()


def test_a_pixel_is_the_one_that_is_drawn(torus):
    """The scene's own picture of a texture that names its texels agrees with the picks."""
    from app.scene import Scene, off_screen_plotter

    surface, _ = torus
    size, side = (300, 220), 256
    row, column = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    named = np.stack([column, row, np.full_like(row, 255)], axis=-1).astype(np.uint8)
    plotter = off_screen_plotter(size)
    plotter.render_window.SetMultiSamples(0)  # a pixel shows its middle and nothing else
    try:
        scene = Scene(plotter)
        plotter.set_background("black")
        scene.show(surface)
        scene.set_texture(named, radiance=True)
        scene.filter_reduced(False)
        scene.camera = Turntable(40.0, 35.0, focus=(0.1, -0.05, 0.0), distance=2.4)
        scene.place_camera()
        plotter.render()
        drawn = np.asarray(plotter.screenshot(return_img=True))[..., :3].astype(float)
    finally:
        plotter.close()
    x, y = (each.ravel() for each in np.meshgrid(np.arange(size[0]), np.arange(size[1])))
    picker = Picker(surface, place=scene.place)
    hits = picker.pick(View(scene.camera, size), np.stack([x, y], axis=1) + 0.5)
    shown = drawn[y, x]
    assert ((shown[:, 2] > 128) != hits.on).mean() < 1e-4, "the same outline"
    both = (shown[:, 2] > 254) & hits.on
    apart = np.abs(shown[both, :2] - picker.texels(hits, side)[both])
    # colours are rounded to whole texels; at a pixel or two of a seam VTK takes the other side
    assert both.sum() > 8000 and np.quantile(apart, 0.99) < 0.6 and apart.mean() < 0.3
