"""Pictures against formulas, against the window's renderer, and against themselves."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from btfcore.errors import Cancelled, InvalidParameter
from btfcore.library import meshes
from btfcore.render.camera import Turntable
from btfcore.render.footprint import level_offsets, mark, spread_down, texel_places
from btfcore.render.picture import Subject, render_linear, shown_surfels
from btfcore.render.raster import gbuffer, raster

FRONT = Turntable(0, 0, distance=3.0)


def sheet(size=64, side=1.0):
    """A square of two triangles that shows the whole atlas, texel centres at its corners."""
    points = np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * side
    low, high = 0.5 / size, 1 - 0.5 / size
    uv = np.array([[low, low], [high, low], [high, high], [low, high]], np.float32)
    faces = np.array([[0, 3, 2], [0, 2, 1]], np.int32)
    return Subject(
        points, uv, faces, False, np.arange(size * size, dtype=np.int32).reshape(size, size)
    )


def fixed(colours):
    """Radiance that depends on the surfel only."""
    table = np.asarray(colours, np.float32).reshape(-1, 3)
    return lambda chosen, eye, position: table[chosen]


def ramp(size):
    """Radiance that grows linearly over the atlas."""
    column, row = np.meshgrid(np.arange(size), np.arange(size))
    return np.stack([column, row, 0 * row], axis=-1) / (size - 1.0)


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize("side", [1.0, 0.05])
def test_a_linear_ramp_is_seen_where_perspective_puts_it(samples, side):
    subject, camera = sheet(64, side), Turntable(35, 25, distance=3.0)
    size = (120, 90)
    picture = render_linear(subject, fixed(ramp(64)), camera, size=size, samples=samples)
    inside = picture[..., 3] == 1.0
    row, column = np.nonzero(inside)
    if side == 1.0:
        assert len(row) > 800
    rays = camera.rays(np.stack([column + 0.5, row + 0.5], axis=1), size)
    hit = camera.position - rays * (camera.position[2] / rays[:, 2])[:, None]
    expected = np.stack([hit[:, 0] / side + 1, 1 - hit[:, 1] / side], axis=1) / 2
    found = picture[inside][:, :2]
    # the mean of a linear function is that at the pixel's middle, but for perspective
    tolerance = 2e-3 if side == 1.0 else 0.08  # a pixel is a fourth of the small sheet
    assert np.abs(found - expected).max() < tolerance


def test_texels_smaller_than_pixels_are_averaged():
    size = 256
    checker = np.repeat((np.indices((size, size)).sum(axis=0) % 2)[..., None], 3, axis=2)
    values = []
    for azimuth in np.linspace(-3, 3, 7):
        camera = Turntable(azimuth, 0, distance=40.0)
        picture = render_linear(sheet(size), fixed(checker), camera, size=(96, 96), samples=1)
        inside = picture[..., 3] == 1.0
        values.append(picture[inside][:, 0])
    values = np.concatenate(values)
    assert len(values) > 50
    assert np.abs(values - 0.5).max() < 0.03


def test_a_sharp_edge_shares_its_pixels():
    subject, camera = sheet(32), Turntable(0, 0, distance=6.0)
    picture = render_linear(subject, fixed(np.ones((32, 32, 3))), camera, size=(80, 60), samples=4)
    alpha = picture[..., 3]
    assert np.allclose(picture[..., :3], alpha[..., None])
    assert np.array_equal(np.unique(np.round(alpha * 16) / 16), np.unique(alpha))
    focal = 60 / (2 * np.tan(np.radians(14)))
    assert alpha.sum() == pytest.approx((2 * focal / 6) ** 2, rel=0.02)


def test_threads_bands_and_repeats_give_the_same_bits():
    subject = sheet(64)
    shade = fixed(np.random.default_rng(0).random((64 * 64, 3)))
    camera = Turntable(20, 40, distance=4.0)
    options = {"size": (900, 400), "samples": 2}
    alone = render_linear(subject, shade, camera, pool=None, **options)
    for workers in (2, 5):
        with ThreadPoolExecutor(workers) as pool:
            assert np.array_equal(
                render_linear(subject, shade, camera, pool=pool, **options), alone
            )
    assert len(raster(subject.positions, subject.faces, camera, **options).bands()) > 2


def test_only_what_is_seen_is_shaded_and_all_of_that():
    subject = sheet(64)
    camera = Turntable(10, 5, focus=(0.7, 0.7, 0.0), distance=0.8)
    asked = []

    def shade(chosen, eye, position):
        asked.append(chosen)
        assert position is None
        assert np.array_equal(eye, camera.eye)
        return np.ones((len(chosen), 3), np.float32)

    picture = render_linear(subject, shade, camera, size=(60, 40), samples=2)
    chosen = np.concatenate(asked)
    shown = shown_surfels(subject, camera, size=(60, 40), samples=2)
    assert np.array_equal(chosen, shown)
    assert 0 < len(chosen) < 64 * 64 / 3
    assert np.allclose(picture[picture[..., 3] == 1], 1.0)


def test_needed_texels_are_those_of_a_plain_reading():
    """The marks of level 0 contain the four texels around every magnified sample."""
    subject = sheet(16)
    camera = Turntable(15, 10, distance=2.5)
    drawn = raster(subject.positions, subject.faces, camera, size=(40, 40), samples=1)
    seen = gbuffer(drawn)
    places, offsets = texel_places(subject.uv, 16), level_offsets(16)
    marks = np.zeros(offsets[-1], np.uint8)
    mark(seen, drawn, 0, places, offsets, marks)
    assert spread_down(marks, offsets) == 1
    row, column = np.nonzero(seen.face >= 0)
    later = seen.bary[row, column].astype(float)
    share = np.column_stack([1 - later.sum(axis=1), later])
    at = np.einsum("nk,nkj->nj", share, places[subject.faces[seen.face[row, column]]])
    plain = np.zeros((16, 16), bool)
    for dx in (0, 1):
        for dy in (0, 1):
            x, y = np.clip(np.floor(at).astype(int) + [dx, dy], 0, 15).T
            plain[y, x] = True
    assert np.array_equal(marks[:256].reshape(16, 16) > 0, plain)


def test_a_pyramid_of_any_side_ends_in_one_texel():
    for size in (1, 2, 7, 64, 100):
        offsets = level_offsets(size)
        assert offsets[1] == size * size
        assert offsets[-1] - offsets[-2] == 1


def test_per_pixel_sees_the_same_surfels_from_its_own_place():
    subject = sheet(64)
    camera = Turntable(15, 20, distance=3.0)
    seen = []

    def shade(chosen, eye, position):
        seen.append((chosen, position))
        return np.stack([chosen % 64, chosen // 64, 0 * chosen], axis=1).astype(np.float32) / 63

    picture = render_linear(subject, shade, camera, size=(90, 70), samples=2, per_pixel=True)
    smooth = render_linear(subject, fixed(ramp(64)), camera, size=(90, 70), samples=2)
    assert np.array_equal(picture[..., 3], smooth[..., 3])
    inside = picture[..., 3] == 1
    assert np.abs(picture - smooth)[inside].max() < 0.6 / 63 + 1e-3
    chosen, position = (np.concatenate(each) for each in zip(*seen, strict=True))
    assert np.abs(position[:, 2]).max() < 1e-6
    texel = np.stack([chosen % 64, chosen // 64], axis=1)
    expected = np.stack([position[:, 0] + 1, 1 - position[:, 1]], axis=1) / 2 * 63
    assert np.abs(texel - expected).max() < 0.51


def test_an_empty_view_is_transparent():
    away = Turntable(0, 0, focus=(50.0, 0, 0), distance=3.0)
    for per_pixel in (False, True):
        picture = render_linear(
            sheet(), fixed(np.ones((64, 64, 3))), away, size=(20, 10), per_pixel=per_pixel
        )
        assert not picture.any()


def test_a_picture_can_be_cancelled():
    def stop(fraction, label):
        if fraction > 0.5:
            raise Cancelled

    with pytest.raises(Cancelled):
        render_linear(sheet(), fixed(np.ones((64, 64, 3))), FRONT, size=(500, 500), progress=stop)


def test_radiance_beyond_floats_is_refused():
    huge = np.full((64, 64, 3), np.inf)
    with pytest.raises(InvalidParameter, match="too bright"):
        render_linear(sheet(), fixed(huge), FRONT, size=(20, 10))


def test_the_window_draws_the_same_picture():
    """Same silhouette and texture as VTK's, but for how edges and minification are smoothed."""
    from app.scene import Scene, off_screen_plotter
    from btfcore.files.surface import export_input
    from btfcore.pipeline import load_mesh, prepare
    from btfcore.render.gutter import gutter_source
    from btfcore.render.surfels import placement

    path = next(each for each in meshes() if each.name == "spot.obj")
    prepared = prepare(load_mesh(path)[0], rate=128)
    surface, dense = export_input(prepared.mesh, prepared.atlas), prepared.dense
    gutter = gutter_source(dense)
    place = placement(surface.positions)
    wave = 0.5 + 0.4 * np.sin(place.to_scene(dense.vertices) * 9.0)
    codes = np.round(wave * 255).astype(np.uint8)
    size, fine = (320, 240), 3
    plotter = off_screen_plotter((size[0] * fine, size[1] * fine))
    try:
        scene = Scene(plotter)
        plotter.set_background("black")
        scene.show(surface)
        scene.set_texture(codes[gutter])
        for actor in plotter.renderer.actors.values():
            actor.prop.lighting, actor.prop.ambient, actor.prop.diffuse = False, 0.0, 1.0
        scene.camera = Turntable(150, 12)
        scene.frame(aspect=4 / 3)
        scene.place_camera()
        plotter.render()
        drawn = plotter.screenshot(transparent_background=True, return_img=True)
    finally:
        plotter.close()
    theirs = drawn.reshape(size[1], fine, size[0], fine, 4).mean(axis=(1, 3))
    subject = Subject(
        place.to_scene(surface.positions), surface.uv, surface.faces, surface.closed, gutter
    )
    ours = render_linear(subject, fixed(codes / 255), scene.camera, size=size, samples=fine) * 255
    apart = np.abs(ours - theirs)
    assert apart[..., 3].mean() < 0.15
    assert np.quantile(apart[..., 3], 0.99) < 40  # a sample or two of nine along the edges
    inside = (ours[..., 3] == 255) & (theirs[..., 3] == 255)
    assert inside.mean() > 0.2
    assert apart[inside].mean() < 0.3
    assert np.quantile(apart[inside], 0.99) < 2
