"""Pictures by the fragment shader against the reference at the same fragments."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.shader import machine_of
from btfcore.btf.directions import layout
from btfcore.btf.sample import Encoding, from_picture
from btfcore.errors import InvalidParameter
from btfcore.files.samples import open_sample
from btfcore.files.surface import export_input
from btfcore.render.camera import Turntable
from btfcore.render.glsl.samples import pack
from btfcore.render.glsl.surface import pack_maps
from btfcore.render.gutter import gutter_source
from btfcore.render.lights import NONE, Lights, directional
from btfcore.render.material import factor_material, truncated
from btfcore.render.reference import local_views, radiance
from btfcore.render.surfels import BARE, placement, surfels
from btfcore.render.tonemap import displayed
from btfcore.types import Atlas, Mesh, Quilt
from tests.app.fragments import Stage, differences, patched
from tests.render.chance import factor_sample, harmonic_sample
from tests.surfaces import constant_field, plane

ONE = directional([0.5, 0.6, 1.0])
THREE = directional([[0.5, 0.6, 1.0], [-1.0, 0.2, 0.3], [0.0, 1.0, -0.4]], [0.7, 0.5, 0.4])
ENCODINGS = {
    "linear": Encoding("linear"),
    "sqrt": Encoding("sqrt"),
    "log": Encoding("log", 0.01),
    "logluma": Encoding("logluma", 0.01),
    "sqrt with a knee": Encoding("sqrt", knee=0.3),
    "logluma with a knee": Encoding("logluma", 0.01, knee=0.2),
}


@pytest.fixture(scope="module")
def build(ring):
    """A function that stages the torus, its sixteen patches of so many samples."""
    mesh, atlas, dense, field = ring
    surface, gutter = export_input(mesh, atlas), gutter_source(dense)
    opened = []

    def made(samples=1, *, bare=False, **details):
        quilt = patched(dense, samples, bare=bare)
        elements = surfels(dense, field, quilt, placement(mesh.vertices))
        opened.append(Stage(surface, elements, gutter, **details))
        return opened[-1]

    yield made
    for each in opened:
        each.close()


@pytest.fixture(scope="module")
def near(build):
    """One sample seen in perspective, and the fragments."""
    stage = build()
    return stage, stage.fragments()


@pytest.fixture(scope="module")
def far(build):
    """Three samples and a bare patch seen in parallel, and the fragments."""
    stage = build(3, bare=True, parallel=True, size=(120, 90))
    return stage, stage.fragments()


def close_to_reference(stage, materials, lights, fragments, **details):
    apart, wanted = differences(stage, materials, lights, fragments=fragments, **details)
    assert len(apart) > 500
    assert apart.mean() <= 1 and np.percentile(apart, 99.9) <= 4
    return wanted


@pytest.mark.parametrize("encoding", ENCODINGS.values(), ids=list(ENCODINGS))
def test_every_encoding(near, encoding):
    wanted = close_to_reference(near[0], [factor_sample(encoding=encoding)], ONE, near[1])
    assert wanted.std() > 20 and wanted.mean() > 60


@pytest.mark.parametrize("directions", ["12x8x12x8", "ubo81", "ubo151"])
@pytest.mark.parametrize("method", ["grid", "barycentric", "nearest4", "nearest"])
def test_every_interpolation_of_directions(near, directions, method):
    sample = factor_sample(layout=directions, method=method)
    wanted = close_to_reference(near[0], [sample], ONE, near[1])
    assert wanted.std() > 20


@pytest.mark.parametrize("method", ["grid", "barycentric", "nearest4", "nearest"])
def test_few_directions(near, method):
    """Fewer than a scheme mixes, on one line, and a single one."""
    pole = np.array([[0.0, 0.0, 1.0]])
    line = layout("3x1x3x1").views[:2]
    views = pole if method == "grid" else line
    sample = factor_sample(layout=(views, pole), method=method)
    close_to_reference(near[0], [sample], ONE, near[1])


@pytest.mark.parametrize(
    "details",
    [
        {"tiles": True},
        {"cosine": False},
        {"shape": (1, 1)},
        {"shape": (1, 7), "tiles": True},
        {"rank": 0},
        {"rank": 1},
        {"rank": 4},
        {"rank": 12},
    ],
    ids=str,
)
def test_samples_of_all_kinds(near, details):
    close_to_reference(near[0], [factor_sample(**details)], THREE, near[1])


@pytest.mark.parametrize("method", ["barycentric", "nearest4", "nearest"])
def test_views_below_the_horizon_count_as_on_it(near, method):
    """Every frame is turned by 70 degrees about its s, so that half of them look away."""
    stage, fragments = near
    straight = stage.surfels
    s, t, n = np.moveaxis(straight.frame, 1, 0)
    c, d = np.cos(np.radians(70)), np.sin(np.radians(70))
    turned = np.stack([s, c * t + d * n, c * n - d * t], axis=1).astype(np.float32)
    stage.surfels = replace(straight, frame=turned)
    try:
        below = local_views(stage.surfels, stage.gutter.ravel()[fragments[1]], stage.eye)[:, 2]
        assert (below == 0).sum() > 300
        sample = factor_sample(method=method, layout="ubo151")
        close_to_reference(stage, [sample], THREE, fragments)
    finally:
        stage.surfels = straight


@pytest.mark.parametrize("kind", ["spherical", "hemispherical"])
@pytest.mark.parametrize("order", [0, 2, 4])
def test_harmonics(near, kind, order):
    sample = harmonic_sample(kind=kind, order=order, tiles=order == 2)
    wanted = close_to_reference(near[0], [sample], THREE, near[1])
    assert wanted.std() > 20


def mixed():
    colours = np.random.default_rng(3).uniform(size=(6, 5, 3)).astype(np.float32)
    return [
        factor_sample(rank=5),
        harmonic_sample(),
        factor_material(from_picture("picture", colours, tiles=True)),
    ]


def test_three_samples_and_bare_texels_at_once(far):
    stage, fragments = far
    named = stage.surfels.sample[stage.gutter.ravel()[fragments[1]]]
    assert set(np.unique(named).tolist()) == {0, 1, 2, BARE}
    close_to_reference(stage, mixed(), THREE, fragments)


@pytest.mark.parametrize(
    "tone",
    [
        {"exposure": 1.5},
        {"exposure": -1.0, "curve": "reinhard", "white": 3.0},
        {"exposure": 1.0, "curve": "filmic"},
        {"exposure": 110.0},
        {"exposure": -110.0, "curve": "filmic"},
    ],
    ids=str,
)
def test_tone(far, tone):
    close_to_reference(far[0], mixed(), THREE, far[1], tone=tone)


def test_cast_shadows(far):
    visible = np.random.default_rng(0).uniform(size=(3, len(far[0].surfels))).astype(np.float32)
    visible[:, ::3], visible[:, 1::3] = 0, 1
    dark = close_to_reference(far[0], mixed(), THREE, far[1], visible=visible)
    light = close_to_reference(far[0], mixed(), THREE, far[1])
    assert dark.mean() < light.mean() - 10


def test_many_lights_and_none(far):
    random = np.random.default_rng(1)
    many = directional(random.normal(size=(64, 3)), random.uniform(0, 0.1, size=(64, 3)))
    close_to_reference(far[0], mixed(), many, far[1])
    wanted = close_to_reference(far[0], mixed(), NONE, far[1])
    assert wanted.max() == 0
    with pytest.raises(InvalidParameter, match="65 lights, where a shader takes 64"):
        far[0].shader.set_lights(directional(np.tile([0.0, 0.0, 1.0], (65, 1))))


def test_smooth_blends_the_radiance_of_four_texels(far):
    stage, (pixel, _, place) = far
    where = stage.coordinates(pixel) * len(stage.gutter) - 0.5
    first = np.floor(where).astype(int)
    part = where - first
    total = np.zeros((len(pixel), 3))
    for column, row in ((0, 0), (1, 0), (0, 1), (1, 1)):
        texel = np.clip(first + [column, row], 0, len(stage.gutter) - 1)
        share = np.abs(1 - column - part[:, 0]) * np.abs(1 - row - part[:, 1])
        chosen = stage.gutter[texel[:, 1], texel[:, 0]]
        radiances = radiance(
            mixed(), stage.surfels, stage.eye, THREE, chosen=chosen, position=place
        )
        total += share[:, None] * radiances
    stage.show(mixed(), THREE)
    nearest = stage.draw()[tuple(pixel.T)]
    stage.shader.set_smooth(True)
    found = stage.draw()[tuple(pixel.T)]
    apart = np.abs(found.astype(int) - np.rint(displayed(total) * 255).astype(int))
    assert apart.mean() <= 1 and np.percentile(apart, 99.9) <= 4
    assert np.abs(found.astype(int) - nearest).mean() > 2
    stage.shader.set_smooth(False)
    assert np.array_equal(stage.draw()[tuple(pixel.T)], nearest)


def test_a_measured_sample(build):
    path = Path(__file__).resolve().parents[2] / "resources/samples/leather.btfz"
    sample = open_sample(path)
    stage = build(parallel=False, size=(120, 90))
    one = truncated(factor_material(sample), 12)
    wanted = close_to_reference(stage, [one], THREE, stage.fragments(), tone={"exposure": 2.0})
    assert wanted.std() > 20


@pytest.mark.parametrize("kind", ["spherical", "hemispherical"])
@pytest.mark.parametrize(("order", "sky"), [(4, 4), (2, 6), (6, 6)])
def test_an_environment_of_harmonics(far, kind, order, sky):
    """Samples of harmonics take its coefficients, the others the lights that stand for it."""
    random = np.random.default_rng(2)
    coefficients = random.normal(size=((sky + 1) ** 2, 3)) * 0.3
    coefficients[0] = 3.0
    lights = Lights(THREE.direction, THREE.intensity * 0.4, 2, coefficients)
    samples = mixed()
    samples[1] = harmonic_sample(kind=kind, order=order)
    lit = close_to_reference(far[0], samples, lights, far[1])
    without = Lights(THREE.direction, THREE.intensity * 0.4)
    other = close_to_reference(far[0], samples, without, far[1])
    assert np.abs(lit.astype(int) - other).mean() > 3


def test_lights_and_eye_change_uniforms_only(build):
    """The code and the textures stay the same objects, and the picture follows."""
    stage = build()
    sample = factor_sample()
    stage.show([sample], ONE)
    first = stage.draw()
    actor = stage.scene._actor
    code = actor.GetShaderProperty().GetShaderMTime()
    textures = [actor.GetProperty().GetTexture(each) for each in ("patinaQuilt", "patinaTable")]
    uploaded = [each.GetMTime() for each in textures]
    stage.shader.set_lights(THREE)
    stage.plotter.camera.azimuth += 40
    stage.shader.set_eye(stage.eye)
    moved = stage.draw()
    assert np.abs(moved.astype(int) - first).max() > 60
    assert actor.GetShaderProperty().GetShaderMTime() == code
    assert [each.GetMTime() for each in textures] == uploaded
    fragments = stage.fragments()
    close_to_reference(stage, [sample], THREE, fragments)


def test_a_stroke_changes_the_quilting_map_only(build, ring):
    mesh, _, dense, field = ring
    stage = build()
    samples = [factor_sample(), factor_sample(seed=8)]
    stage.show(samples, ONE)
    packed = pack(samples)
    actor = stage.scene._actor
    table = actor.GetProperty().GetTexture("patinaTable")
    other = surfels(dense, field, patched(dense, 2), placement(mesh.vertices))
    stage.shader.set_maps(pack_maps(other, stage.gutter, packed))
    drawn = stage.draw()
    assert actor.GetProperty().GetTexture("patinaTable") is table
    stage.surfels = other
    stage.show(samples, ONE)
    assert np.array_equal(stage.draw(), drawn)


def test_a_lost_context_and_another_window_show_the_same_picture(build):
    stage = build()
    stage.show([factor_sample()], ONE)
    first = stage.draw()
    stage.plotter.ren_win.Finalize()
    assert np.array_equal(stage.draw(), first)
    other = build()
    other.plotter.renderer.RemoveActor(other.scene._actor)
    stage.plotter.renderer.RemoveActor(stage.scene._actor)
    other.plotter.renderer.AddActor(stage.scene._actor)
    other.plotter.renderer.ResetCameraClippingRange()
    assert np.array_equal(other.draw(), first)


def test_without_the_shader_the_actor_is_what_it_was(build):
    stage = build()
    clay = stage.draw()
    stage.show([factor_sample()], ONE)
    assert stage.shader.shown
    assert not np.array_equal(stage.draw(), clay)
    stage.shader.remove()
    assert not stage.shader.shown
    assert np.array_equal(stage.draw(), clay)
    stage.shader.remove()  # once more changes nothing


@pytest.mark.parametrize("textured", [False, True])
def test_a_flat_surface_keeps_its_coordinates(textured):
    """VTK shifts and scales some meshes, and has a texture of its own where one was set."""
    dense = plane(32, 32)
    corner = dense.vertices[[0, 31, -32, -1]]
    corner[:, 2] = [0.0, 1e-4, 3e-4, 2e-4]
    faces = np.array([[0, 2, 1], [1, 2, 3]], np.int32)
    texel = dense.texel[[0, 31, -32, -1], ::-1].astype(float)
    mesh = Mesh(corner, faces)
    surface = export_input(mesh, Atlas(mesh, texel[faces], np.zeros(2, np.int32), 32))
    count = len(dense.vertices)
    quilt = Quilt(
        dense.texel[:, ::-1].astype(np.float32), np.full(count, 0.4, np.float32),
        np.zeros(count, np.uint16), np.zeros(count, np.int32),
    )  # fmt: skip
    elements = surfels(dense, constant_field(dense), quilt, placement(mesh.vertices))
    stage = Stage(surface, elements, gutter_source(dense), camera=Turntable(20.0, 25.0))
    if textured:
        stage.scene.set_texture(np.full((32, 32, 3), 90, np.uint8))
    close_to_reference(stage, [factor_sample()], THREE, stage.fragments())
    stage.close()


def test_values_that_are_not_finite_end_black(near):
    """Weights and intensities at the end of their range, and weights that are no numbers."""
    stage, fragments = near
    sample = factor_sample(encoding=Encoding("linear"))
    sample.weights.flags.writeable = True
    sample.weights[:4] = np.nan
    stage.show([sample], Lights(ONE.direction, ONE.intensity * 1e30))
    drawn = stage.draw()[tuple(fragments[0].T)]
    assert set(np.unique(drawn)) <= {0, 255}
    assert (drawn == 0).all(axis=1).any() and (drawn == 255).any()


def test_the_window_tells_what_it_runs_on(near):
    near[0].draw()
    machine = machine_of(near[0].plotter.ren_win)
    assert machine.renderer and machine.version[0].isdigit()
    assert machine.side >= 4096 and machine.samplers >= 8
