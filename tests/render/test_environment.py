"""An environment map is looked up continuously, turned the right way and reduced fairly."""

import numpy as np
import pytest

from btfcore.errors import InvalidParameter
from btfcore.render.environment import (
    Environment,
    reduced,
    row_solid_angles,
    texel_directions,
    total,
    turned,
)
from tests.render.skies import band_limited, normals, studio, sun_and_sky


def plain_lookup(radiance, directions):
    """The lookup in plain numpy, on a map that is continued over its edges."""
    height, width = radiance.shape[:2]
    high = radiance.astype(np.float64)
    tall = np.concatenate(
        [np.roll(high[:1], width // 2, 1), high, np.roll(high[-1:], width // 2, 1)]
    )
    x, y, z = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).T
    column = (np.arctan2(z, x) / (2 * np.pi) + 0.5) * width - 0.5
    row = np.arccos(np.clip(y, -1, 1)) / np.pi * height + 0.5
    left, above = np.floor(column).astype(int), np.clip(np.floor(row).astype(int), 0, height)
    fx, fy = (column - left)[:, None], (row - above)[:, None]
    at = lambda i, j: tall[above + i, (left + j) % width]  # noqa: E731
    return (1 - fy) * ((1 - fx) * at(0, 0) + fx * at(0, 1)) + fy * (
        (1 - fx) * at(1, 0) + fx * at(1, 1)
    )


def test_texel_centres_give_their_own_values():
    radiance = studio(16)
    found = Environment(radiance).radiance_towards(texel_directions(16).reshape(-1, 3))
    assert np.allclose(found, radiance.reshape(-1, 3), rtol=1e-5, atol=1e-6)


def test_the_kernel_is_its_plain_twin():
    radiance = np.random.default_rng(0).gamma(0.5, 2, (9, 18, 3)).astype(np.float32)
    at = np.concatenate([normals(500) * 7.0, np.eye(3), -np.eye(3)])
    found = Environment(radiance, intensity=2.5).radiance_towards(at)
    assert np.allclose(found, 2.5 * plain_lookup(radiance, at), rtol=1e-5, atol=1e-5)


def test_named_directions_are_where_they_should_be():
    height = 64
    radiance = np.zeros((height, 2 * height, 3), np.float32)
    radiance[: height // 8] = 1, 0, 0  # top
    radiance[height // 2 - 4 : height // 2 + 4, height - 4 : height + 4] = 0, 1, 0  # middle
    radiance[height // 2 - 4 : height // 2 + 4, 96 - 4 : 96 + 4] = 0, 0, 1  # right of the middle
    at = np.array([[0, 1, 0], [1, 0, 0], [0, 0, 1], [-1, 0, 0], [0, 0, -1]], float)
    found = Environment(radiance).radiance_towards(at)
    assert found.tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0], [0, 0, 0]]


def test_rotation_turns_the_light_like_a_turntable_its_camera():
    radiance = studio(32)
    at = normals()
    still = Environment(radiance).radiance_towards(at)
    for degrees in (90.0, -33.0, 360.0 * 5 + 12):
        moved = Environment(radiance, rotation=degrees).radiance_towards(turned(at, degrees))
        assert np.allclose(moved, still, rtol=1e-5, atol=1e-5)
    assert np.allclose(turned(np.array([[0, 0, 1.0]]), 90), [[1, 0, 0]])


def test_the_lookup_is_continuous_at_the_back_and_at_the_poles():
    radiance, _ = band_limited(32, 3)
    environment = Environment(radiance)
    step = 1e-4
    for at in ((-1, 0.1, step), (step, 1, 0), (step, -1, 0), (0, 1, step)):
        here = np.array([at], float)
        there = here * np.where(np.abs(here) == step, -1, 1)
        near = environment.radiance_towards(np.concatenate([here, there]))
        assert np.abs(near[0] - near[1]).max() < 1e-3


def test_a_direction_that_is_none_sees_black():
    at = np.array([[0, 0, 0], [np.nan, 0, 1], [np.inf, 0, 0], [0, 1e-300, 0], [1e300, 0, 0]])
    found = Environment(np.ones((4, 8, 3), np.float32)).radiance_towards(at)
    assert found[:, 0].tolist() == pytest.approx([0, 0, 0, 1, 1])


def test_solid_angles_cover_the_sphere():
    for height in (1, 2, 5, 512):
        angles = row_solid_angles(height)
        edges = np.cos(np.pi * np.arange(height + 1) / height)
        assert np.allclose(angles, (edges[:-1] - edges[1:]) * np.pi / height, atol=1e-15)
        assert angles.sum() * 2 * height == pytest.approx(4 * np.pi, rel=1e-13)
    white = Environment(np.full((8, 16, 3), 0.5, np.float32), intensity=2)
    assert np.allclose(total(white), 4 * np.pi)


@pytest.mark.parametrize("height", [64, 50, 37, 1])
def test_reducing_keeps_the_energy(height):
    radiance = sun_and_sky(128)
    small = reduced(radiance, height)
    assert small.shape == (height, 2 * height, 3)
    assert np.allclose(total(Environment(small)), total(Environment(radiance)), rtol=1e-6)
    assert reduced(small, height) is small


def test_what_is_no_environment_is_refused():
    white = np.ones((4, 8, 3), np.float32)
    for wrong, said in (
        (white[:, :7], r"\(4, 7, 3\)"),
        (white[..., :1], r"\(4, 8, 1\)"),
        (white * np.nan, "nan"),
        (-white, "-1"),
        (white * np.float32(1e30), "1e\\+30"),
        (white.astype(np.float64), "float64"),
    ):
        with pytest.raises(InvalidParameter, match=said):
            Environment(wrong)
    with pytest.raises(InvalidParameter, match="turned by nan"):
        Environment(white, rotation=np.nan)
    with pytest.raises(InvalidParameter, match="intensity -1"):
        Environment(white, intensity=-1)
