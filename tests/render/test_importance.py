"""A few lights stand for a whole map: all of its energy, and nearly its irradiance."""

import numpy as np
import pytest

from btfcore.errors import InvalidParameter
from btfcore.render.env_harmonics import environment_harmonics
from btfcore.render.environment import Environment, total, turned
from btfcore.render.importance import environment_lights, light_tree
from tests.render.skies import irradiance, normals, studio, sun_and_sky


def lit(lights, at):
    """Lambertian radiance of white at normals under lights."""
    cosine = np.maximum(np.einsum("nc,lc->nl", at, lights.direction), 0)
    return np.einsum("nl,lc->nc", cosine, lights.intensity)


def test_the_energy_is_the_maps_for_any_count():
    for radiance in (sun_and_sky(64), studio(300)):
        environment = Environment(radiance, rotation=20, intensity=1.5)
        tree = light_tree(environment, 300)
        for count in (1, 2, 3, 16, 17, 100, 256, 300):
            lights = tree.lights(count, rotation=20, intensity=1.5)
            assert len(lights) == lights.sampled == count
            energy = lights.intensity.sum(axis=0) * np.pi
            assert np.allclose(energy, total(environment), rtol=1e-6)


@pytest.mark.parametrize("sky", [sun_and_sky, studio])
def test_more_lights_come_nearer_to_the_irradiance(sky):
    radiance, at = sky(128), normals()
    truth = irradiance(radiance, at)
    tree = light_tree(Environment(radiance), 1024)
    errors = []
    for count in (16, 64, 256, 1024):
        off = lit(tree.lights(count), at) - truth
        errors.append(np.sqrt((off**2).sum() / (truth**2).sum()))
    assert np.all(np.array(errors) < [0.03, 0.008, 0.002, 0.0005])
    assert np.all(np.diff(errors) < 0)


def test_a_white_room_makes_white_diffuse_white():
    white = Environment(np.ones((64, 128, 3), np.float32))
    for count, most in ((64, 0.05), (256, 0.015), (1024, 0.004)):
        shade = lit(light_tree(white, count).lights(count), normals())
        assert np.abs(shade - 1).max() < most
        assert abs(shade.mean() - 1) < most / 10


def test_few_lights_are_the_coarse_ones_of_many():
    environment = Environment(sun_and_sky(64))
    many, few = light_tree(environment, 256), light_tree(environment, 16)
    assert np.array_equal(many.lights(16).direction, few.lights(16).direction)
    assert np.array_equal(many.lights(16).intensity, few.lights(16).intensity)


def test_a_small_sun_takes_one_light():
    radiance = 10 * sun_and_sky(128, radius=1.0)
    lights = light_tree(Environment(radiance), 16).lights(16)
    sun = np.array([0.55, 0.6, 0.58]) / np.linalg.norm([0.55, 0.6, 0.58])
    near = lights.direction @ sun > np.cos(np.radians(5))
    assert near.sum() == 1
    assert np.argmax(lights.intensity.sum(axis=1)) == np.flatnonzero(near)[0]


def test_rotation_and_intensity_of_the_map_are_those_of_the_lights():
    radiance = studio(32)
    still = environment_lights(Environment(radiance), 32, order=None)
    moved = environment_lights(Environment(radiance, rotation=77, intensity=3), 32, order=None)
    assert np.allclose(moved.direction, turned(still.direction, 77))
    assert np.allclose(moved.intensity, 3 * still.intensity)
    assert still.harmonics is None


def test_harmonics_go_along():
    lights = environment_lights(Environment(np.ones((16, 32, 3), np.float32)), 8, order=2)
    assert lights.harmonics.shape == (9, 3)
    assert np.allclose(lights.harmonics[0], np.sqrt(4 * np.pi))
    assert np.abs(lights.harmonics[1:]).max() < 1e-12
    turned_map = Environment(sun_and_sky(64), rotation=50, intensity=2)
    lights = environment_lights(turned_map, 8, order=4)
    assert np.allclose(lights.harmonics, environment_harmonics(turned_map, 4), atol=1e-12)
    with pytest.raises(InvalidParameter, match="order 7"):
        environment_lights(turned_map, 8, order=7)


def test_the_same_map_gives_the_same_bits():
    one = environment_lights(Environment(sun_and_sky(64)), 100)
    two = environment_lights(Environment(sun_and_sky(64)), 100)
    assert one.direction.tobytes() == two.direction.tobytes()
    assert one.intensity.tobytes() == two.intensity.tobytes()


def test_poor_maps_are_borne():
    black = environment_lights(Environment(np.zeros((8, 16, 3), np.float32)), 16)
    assert len(black) == 0
    one = np.zeros((8, 16, 3), np.float32)
    one[2, 3] = 5
    lights = environment_lights(Environment(one), 16)
    assert len(lights) == lights.sampled == 1
    wild = np.random.default_rng(0).uniform(-35, 27, (16, 32, 1))
    wild = np.repeat(10.0**wild, 3, axis=2).astype(np.float32)
    lights = environment_lights(Environment(wild), 64)
    assert np.isfinite(lights.intensity).all() and len(lights) == 64
    tiny = environment_lights(Environment(np.ones((1, 2, 3), np.float32)), 64)
    assert len(tiny) == 2
    for count in (0, 5000):
        with pytest.raises(InvalidParameter, match=f"{count} lights"):
            environment_lights(Environment(one), count)
