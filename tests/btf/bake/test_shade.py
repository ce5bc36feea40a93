"""Radiance of points: against the textbook, and by the laws that light keeps."""

import numpy as np
import pytest

from btfcore.btf.bake import shade as kernels
from btfcore.btf.bake.build import baked
from btfcore.btf.bake.relief import relief
from tests.btf.bake import fields, reference
from tests.btf.bake.fields import direction

ANGLES = [(0, 0), (5, 17), (40, 90), (60, 200), (75, 0), (85, 45)]


def looked(made, x, y, view):
    out = np.zeros((kernels.blocks(len(x)), kernels.ROWS, kernels.LANES), np.float32)
    kernels.look(made.maps, x, y, view.astype(np.float32), made.coat, out)
    return out


def rows(surface, count):
    return surface.transpose(1, 0, 2).reshape(kernels.ROWS, -1)[:, :count]


def anywhere(count=700):  # more than two blocks, and not whole ones
    return np.random.default_rng(0).random((2, count)) * [[32], [24]]


def test_material_is_fetched_bilinearly():
    made = relief(fields.colourful())
    x, y = anywhere()
    view = direction(50, 100)
    found = rows(looked(made, x, y, view), len(x))
    wanted = reference.seen(made, x, y).T
    wanted[10] **= 2
    cosine = np.maximum(wanted[:3].T @ view, 0.05)
    mean = 0.04 + 0.96 / 21
    wanted[3:6] *= (0.96 - 0.96 * (1 - cosine) ** 5) / (1 - mean)
    assert np.allclose(found[:12], wanted, atol=2e-6)
    assert np.allclose(found[12], cosine, atol=1e-6)
    assert np.allclose(found[13], np.sqrt(cosine**2 * (1 - wanted[10]) + wanted[10]), atol=1e-6)


def test_normals_that_cancel_out_point_up():
    made = relief(fields.plain((1, 2)))
    maps = made.maps.copy()
    maps[0, 0, :3], maps[0, 1, :3] = (1, 0, 0), (-1, 0, 0)
    out = np.zeros((1, kernels.ROWS, kernels.LANES), np.float32)
    half, zero = np.array([0.5]), np.array([0.0])
    kernels.look(maps, half, zero, np.array([0, 0, 1], np.float32), made.coat, out)
    assert out[0, :3, 0].tolist() == [0, 0, 1]


def test_shading_is_the_textbooks():
    made = relief(fields.colourful())
    x, y = anywhere()
    random = np.random.default_rng(1)
    lights = np.array([direction(*angles) for angles in ANGLES])
    way = np.arange(len(lights)) % 3
    horizon = random.random((3, len(x)), np.float32)
    tangent = random.random(len(lights)).astype(np.float32)
    for angles in ANGLES:
        view = direction(*angles)
        surface = looked(made, x, y, view)
        images = np.full((len(lights) + 1, len(x) + 5, 3), -1, np.float32)
        kernels.shade(
            surface,
            horizon,
            way,
            tangent,
            view.astype(np.float32),
            made.coat,
            lights.astype(np.float32),
            images,
            np.arange(len(lights))[::-1].copy(),
            np.array([3, 3 + len(x)]),
        )
        assert (images[-1] == -1).all() and (images[:, :3] == -1).all()
        assert (images[:, -2:] == -1).all()  # only what was asked for
        material = reference.seen(made, x, y)
        for k, light in enumerate(lights):
            visible = tangent[k] > horizon[way[k]]
            wanted = reference.radiance(material, view, light, visible, made.coat)
            found = images[len(lights) - 1 - k, 3:-2]
            assert np.allclose(found, wanted, rtol=2e-3, atol=2e-5)
            assert np.median(np.abs(found - wanted)) < 1e-6


def test_a_white_lambertian_facing_the_light_has_radiance_one():
    lights = [direction(theta, 30) for theta in (0, 30, 60, 75, 89)]
    sample = baked(fields.plain((3, 3), albedo=1.0), [direction(50, 200)], lights, reflectance=0)
    found = sample.stack.read(np.arange(5))
    wanted = np.array(lights)[:, 2]
    assert np.allclose(found, wanted[:, None, None, None], atol=1e-6)


def test_light_and_view_may_be_exchanged():
    directions = np.array([direction(*angles) for angles in ANGLES[:-1]])
    for rough in (0.3, 0.8):
        made = fields.plain((1, 1), metallic=np.full((1, 1), 0.5, np.float32))
        sample = baked(made, directions, directions, roughness=rough)
        value = sample.stack.read(np.arange(25)).reshape(5, 5, 3)
        brdf = value / directions[None, :, 2, None]
        assert np.allclose(brdf, brdf.transpose(1, 0, 2), rtol=1e-4)


@pytest.mark.parametrize("rough", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("metal", [0.0, 1.0])
def test_no_more_light_leaves_than_arrives(rough, metal):
    made = fields.plain((1, 1), albedo=1.0, metallic=np.full((1, 1), metal, np.float32))
    sine = (np.arange(80) + 0.5) / 80
    views = np.array(
        [direction(np.degrees(np.arccos(s)), 360 * (k + 0.5) / 60) for s in sine for k in range(60)]
    )
    lights = [direction(theta, 0) for theta in (5, 45, 70)]
    value = baked(made, views, lights, roughness=rough).stack.read(np.arange(len(views) * 3))
    value = value.reshape(len(views), 3, 3)[..., 0]
    flux = (value * views[:, 2:]).mean(axis=0) * 2  # ∫ L cos dω / π
    share = flux / np.array(lights)[:, 2]
    assert (share < 1.02).all()
    if metal and rough == 1:  # in closed form, 1 - ln 2 for light along the normal
        assert share[0] == pytest.approx(1 - np.log(2), abs=5e-3)
    elif not metal:
        assert (share > 0.85).all()


def test_mirrors_shine_only_where_they_should():
    metal = {"metallic": np.ones((1, 1), np.float32), "roughness": np.zeros((1, 1), np.float32)}
    made = fields.plain((1, 1), albedo=1.0, **metal)
    views = [direction(theta, 0) for theta in (30, 36)]
    found = baked(made, views, [direction(30, 180)]).stack.read([0, 1])[:, 0, 0, 0]
    assert np.isfinite(found).all()
    assert found[0] > 1000 and found[1] < 5  # high dynamic range, never clamped


def test_nothing_shines_from_below_and_nothing_is_nan():
    random = np.random.default_rng(3)
    normal = random.normal(size=(16, 16, 3))
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)  # many point down
    normal[0, 0] = 0
    made = fields.plain((16, 16), normal=normal.astype(np.float32))
    directions = [*fields.ring(90, 3), *fields.ring(85, 3, 10), direction(0, 0)]
    found = baked(made, directions, directions).stack.read(np.arange(49))
    assert np.isfinite(found).all() and (found >= 0).all()
