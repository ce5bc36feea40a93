"""Rendered pictures against the definition of radiance, through every way in."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from btfcore.btf.colour import linear_to_srgb, srgb_to_linear
from btfcore.errors import InvalidParameter
from btfcore.files.light_file import parse_light
from btfcore.library import meshes
from btfcore.painting import new_document
from btfcore.relighting import Look, Renderer, materials, of_painting
from btfcore.render.backdrop import GRADIENT
from btfcore.render.environment import Environment
from btfcore.render.film import Shot, shots
from btfcore.render.picture import render_linear
from btfcore.render.reference import radiance

ROOT = Path(__file__).resolve().parents[1]
MESH = next(path for path in meshes() if path.name == "spot.obj")
LIGHTS = [parse_light("camera:-40,30,0.7"), parse_light("80,20,0.5,#ffc890")]
LOOK = Look(size=(80, 60), samples=2)


@pytest.fixture(scope="module")
def painting():
    return new_document(MESH, ROOT / "resources" / "samples" / "linen.btfz", rate=96)


@pytest.fixture(scope="module")
def subject(painting):
    return of_painting(painting, "spot")


def shown(renderer, **knobs):
    camera = renderer.camera(140, 15)
    return Shot(camera, **knobs)


@pytest.mark.parametrize("per_pixel", [False, True])
def test_a_picture_is_that_of_the_definition(subject, per_pixel):
    look = replace(LOOK, per_pixel=per_pixel)
    renderer = Renderer(subject, look, LIGHTS)
    shot = shown(renderer)
    made, lights = materials(subject), renderer.lights(shot)

    def shade(chosen, eye, position):
        return radiance(made, subject.surfels, eye, lights, chosen=chosen, position=position)

    expected = render_linear(
        subject.subject, shade, shot.camera, size=LOOK.size, samples=2, per_pixel=per_pixel
    )
    apart = np.abs(linear_to_srgb(renderer.linear(shot)) - linear_to_srgb(expected)) * 255
    assert expected[..., :3].max() > 0.1
    assert apart.mean() < 0.1
    assert np.quantile(apart, 0.999) < 1


def test_both_ways_agree_but_for_texels(subject):
    """Views differ by no more than texels are apart; colours by what a texel is off."""
    one = Renderer(subject, LOOK, LIGHTS)
    two = Renderer(subject, replace(LOOK, per_pixel=True), LIGHTS)
    shot = shown(one)
    a, b = one.linear(shot), two.linear(shot)
    assert np.array_equal(a[..., 3], b[..., 3])
    inside = a[..., 3] == 1
    ratio = a[inside].mean(axis=0) / b[inside].mean(axis=0)
    assert np.abs(ratio - 1).max() < 0.02


def test_radiance_is_linear_in_the_lights(subject):
    both = Renderer(subject, LOOK, LIGHTS)
    shot = shown(both)
    parts = [Renderer(subject, LOOK, [each]).linear(shot) for each in LIGHTS]
    whole = both.linear(shot)
    assert np.allclose(whole[..., :3], parts[0][..., :3] + parts[1][..., :3], atol=1e-5)
    dark = Renderer(subject, LOOK, []).linear(shot)
    assert not dark[..., :3].any()
    assert np.array_equal(dark[..., 3], whole[..., 3])


def test_shadows_only_take_light_away(subject):
    # from behind the head, so that it shades the neck
    lights = [parse_light("camera:0,75")]
    shot = shown(Renderer(subject, LOOK, lights))
    free = Renderer(subject, LOOK, lights).linear(shot)
    cast = Renderer(subject, replace(LOOK, shadows=True), lights).linear(shot)
    assert (cast <= free + 1e-6).all()
    lost = free[..., :3].sum() - cast[..., :3].sum()
    assert 0.01 < lost / free[..., :3].sum() < 0.6
    assert np.array_equal(cast[..., 3], free[..., 3])


def test_a_light_that_goes_along_with_the_camera_stays_in_its_frame(subject):
    renderer = Renderer(subject, LOOK, [parse_light("camera:0,0")])
    for shot in shots(renderer.camera(10, 20), turntable=5):
        assert np.allclose(renderer.lights(shot).direction[0], shot.camera.axes()[2])


def test_an_environment_turns_with_the_sweep(subject):
    sky = np.zeros((16, 32, 3), np.float32)
    sky[4:6, 8:10] = 100.0
    renderer = Renderer(subject, LOOK, [], environment=Environment(sky), environment_lights=8)
    still, turned = (renderer.lights(shown(renderer, turned=angle)) for angle in (0.0, 90.0))
    x, y, z = still.direction.T
    assert np.allclose(turned.direction, np.stack([z, y, -x], axis=1))
    assert turned.sampled == len(turned)
    assert renderer.environment(shown(renderer, turned=90.0)).rotation == 90.0


@pytest.mark.parametrize("representation", ["raw", "harmonics"])
def test_a_picture_is_lambertian_however_it_is_asked_for(painting, representation):
    """A sample without its images is rendered from its colours."""
    plain = replace(painting.materials[0], btf=None)
    bare = replace(painting)  # the document is shared, the materials are not
    bare.materials = (plain,)
    subject = of_painting(bare, "colours")
    assert "without its images" in subject.notes[-1]
    renderer = Renderer(subject, replace(LOOK, representation=representation), LIGHTS[:1])
    shot = shown(renderer)
    light = renderer.lights(shot)
    surfels = subject.surfels
    height = (surfels.frame[:, 2].astype(float) @ light.direction[0]).clip(0)

    def shade(chosen, eye, position):
        column, row = np.rint(surfels.source[chosen]).astype(int).T % 128
        colours = srgb_to_linear(plain.sample.colour)[row, column]
        return (colours * height[chosen, None] * 0.7).astype(np.float32)

    rough = render_linear(subject.subject, shade, shot.camera, size=LOOK.size, samples=2)
    found = renderer.linear(shot)
    inside = found[..., 3] == 1
    assert np.abs(found[inside].mean(axis=0) / rough[inside].mean(axis=0) - 1).max() < 0.05


def test_a_low_rank_is_a_coarser_picture(subject):
    shot = shown(Renderer(subject, LOOK, LIGHTS))
    pictures = [Renderer(subject, replace(LOOK, rank=rank), LIGHTS).picture(shot, GRADIENT)
                .astype(float) for rank in (None, 12, 2)]  # fmt: skip
    few, fewer = (np.abs(each - pictures[0]).mean() for each in pictures[1:])
    assert 0 < few < fewer
    for rank, representation in ((-1, "auto"), (3, "raw")):
        with pytest.raises(InvalidParameter, match="rank"):
            materials(subject, rank=rank, representation=representation)


def test_knobs_are_checked_before_the_work(subject):
    for wrong, told in (
        ({"curve": "s"}, "'s'"), ({"exposure": np.inf}, "inf"), ({"size": (0, 1)}, "0 x 1"),
        ({"samples": 0}, "0 samples"), ({"interpolation": "x"}, "x"),
    ):  # fmt: skip
        with pytest.raises(InvalidParameter, match=told):
            Renderer(subject, replace(LOOK, **wrong), LIGHTS)
