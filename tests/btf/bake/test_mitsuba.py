"""Agreement with an independent renderer, Mitsuba 3, where it is installed."""

import numpy as np
import pytest

from btfcore.btf.bake.build import baked
from tests.btf.bake import fields
from tests.btf.bake.agreement import LIGHTS, VIEWS, agreement, bounce_agreement
from tests.btf.bake.fields import direction

mi = pytest.importorskip("mitsuba")

RELIEFS = {
    "bumps": (fields.bumps(), 6.0),
    "fine": (fields.bumps(width=2.0, seed=3), 4.0),
    "blocks": (fields.blocks(), 3.0),
}


@pytest.mark.parametrize("name", RELIEFS)
def test_points_shadows_and_radiance_agree(name):
    height, depth = RELIEFS[name]
    found = agreement(height, depth, fine=2)
    assert len(found) == len(VIEWS) * len(LIGHTS)
    for each in found:
        assert each.distance < 0.01
        assert each.shadows >= 0.98
        assert each.mean == pytest.approx(1, abs=0.02)
    assert max(each.dark for each in found) > 0.3  # there is something to agree on


def test_a_mesh_of_two_triangles_a_texel_agrees_too():
    found = agreement(*RELIEFS["bumps"], fine=1)
    for each in found:
        assert each.shadows >= 0.97 and each.mean == pytest.approx(1, abs=0.02)
    assert np.mean([each.shadows for each in found]) >= 0.99


def test_the_integrator_sees_what_we_see():
    """All of it, not just points and shadows, where no normal turns away from the viewer."""
    from tests.btf.bake.mitsuba_door import Scene

    height, depth = RELIEFS["bumps"]
    scene = Scene(height * depth, fine=2)
    light = direction(50, 100)
    for view in (direction(5, 17), direction(45, 30)):
        wanted = scene.radiance(view, light)
        sample = baked(fields.plain(height, depth=depth), [view], [light], reflectance=0)
        found = sample.image(0, 0)[..., 1]
        assert np.abs(found - wanted).max() < 0.01 and found.mean() == pytest.approx(
            wanted.mean(), rel=2e-3
        )


@pytest.mark.parametrize("name", ["bumps", "blocks"])
def test_one_bounce_agrees(name):
    height, depth = RELIEFS[name]
    found = bounce_agreement(height, depth * 1.5, albedo=0.8, samples=16)
    for bounced, total in found:
        assert bounced == pytest.approx(1, abs=0.05 if name == "bumps" else 0.25)
        assert total == pytest.approx(1, abs=0.02)


def value(bsdf, view, light):
    mi.set_variant("scalar_rgb")
    point = mi.SurfaceInteraction3f()
    point.wi = mi.Vector3f(*(float(part) for part in view))
    point.n = mi.Vector3f(0, 0, 1)
    point.sh_frame = mi.Frame3f(mi.Vector3f(0, 0, 1))
    point.uv = mi.Point2f(0.5, 0.5)
    outgoing = mi.Vector3f(*(float(part) for part in light))
    return np.array(mi.load_dict(bsdf).eval(mi.BSDFContext(), point, outgoing))


@pytest.mark.parametrize("rough", [0.4, 0.7])
@pytest.mark.parametrize("view", [(5, 0), (45, 30), (70, 200)])
@pytest.mark.parametrize("light", [(20, 10), (50, 100), (70, 20)])
def test_gloss_agrees(rough, view, light):
    mi.set_variant("scalar_rgb")
    view, light = direction(*view), direction(*light)
    colour = [0.3, 0.6, 0.9]
    base = {"type": "principled", "base_color": {"type": "rgb", "value": colour}}
    albedo = np.full((1, 1, 3), colour, np.float32)
    metal = fields.PbrSet("metal", albedo, metallic=np.ones((1, 1), np.float32))
    found = baked(metal, [view], [light], roughness=rough).image(0, 0)[0, 0] / np.pi

    def smith(cosine):
        return (np.sqrt(1 + rough**4 * (1 / cosine**2 - 1)) - 1) / 2

    one, two = smith(view[2]), smith(light[2])
    correlated = (1 + one) * (1 + two) / (1 + one + two)  # theirs takes both for independent
    wanted = value({**base, "metallic": 1.0, "roughness": rough}, view, light) * correlated
    assert np.allclose(found, wanted, rtol=1e-5)
    plastic = fields.PbrSet("plastic", albedo)
    found = baked(plastic, [view], [light], roughness=rough).image(0, 0)[0, 0] / np.pi
    wanted = value({**base, "metallic": 0.0, "roughness": rough}, view, light)
    # diffuse models differ towards grazing angles
    steep = max(view[2], light[2]) > 0.6 and min(view[2], light[2]) > 0.6
    assert np.allclose(found, wanted, rtol=0.02 if steep else 0.2)
