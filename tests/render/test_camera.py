import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from btfcore.render.camera import ANGLE, Turntable


def projected(camera, points, aspect):
    """Picture coordinates in -1 … 1 of points, and their depth."""
    x, y, z = ((points - camera.position) @ camera.axes().T).T
    slope = np.tan(np.radians(ANGLE / 2))
    return x / (-z * slope * aspect), y / (-z * slope), -z


@given(
    st.floats(-720, 720), st.floats(-89, 89), st.floats(0.3, 3), st.integers(0, 99),
    st.floats(0.001, 1000),
)  # fmt: skip
def test_framing_fills_the_picture_and_cuts_nothing(azimuth, elevation, aspect, seed, size):
    points = size * (np.random.default_rng(seed).standard_normal((40, 3)) + [3, -7, 1])
    camera = Turntable(azimuth, elevation).framing(points, aspect=aspect, margin=0.1)
    x, y, depth = projected(camera, points, aspect)
    assert depth.min() > 0
    assert max(np.abs(x).max(), np.abs(y).max()) == pytest.approx(0.8, abs=1e-6)


def test_axes_are_right_handed_and_up_is_up():
    axes = Turntable(37, 25).axes()
    assert np.allclose(axes @ axes.T, np.eye(3))
    assert np.linalg.det(axes) == pytest.approx(1)
    assert axes[1, 1] > 0


def test_orbiting_never_goes_over_the_top():
    camera = Turntable(0, 0)
    for _ in range(50):
        camera = camera.orbited(13, 10)
    assert camera.elevation == -89


def test_panning_follows_the_mouse():
    camera = Turntable(20, 10, distance=4)
    point = np.array([[0.1, 0.2, 0.0]])
    before, after = projected(camera, point, 1), projected(camera.panned(0.25, 0.1), point, 1)
    focus_moves = np.array([0.5, 0.2])  # a quarter and a tenth of the height, in -1 … 1
    moved = np.array([after[0] - before[0], after[1] - before[1]]).ravel()
    assert np.allclose(moved, focus_moves, atol=0.03)


@given(st.floats(-720, 720), st.floats(-89, 89), st.integers(0, 99))
def test_pixels_are_those_that_the_rays_go_through(azimuth, elevation, seed):
    rng = np.random.default_rng(seed)
    camera = Turntable(azimuth, elevation, (0.3, -0.2, 0.1), 4.0)
    points = rng.uniform(-0.5, 0.5, (20, 3))
    size = (300, 200)
    found = camera.pixels(points, size)
    x, y, depth = projected(camera, points, 1.5)
    assert np.allclose(found[:, 0], 150 * (1 + x))
    assert np.allclose(found[:, 1], 100 * (1 - y))
    assert np.allclose(found[:, 2], depth)
    towards = points - camera.position
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    assert np.allclose(camera.rays(found[:, :2], size), towards)


def test_the_eye_is_a_point_and_what_lies_behind_it_has_no_pixel():
    camera = Turntable(10, 20, distance=3.0)
    assert np.allclose(camera.eye, [*camera.position, 1.0])
    behind = camera.pixels(camera.position * 2, (64, 64))
    assert np.isnan(behind[:2]).all()
    assert behind[2] == pytest.approx(-3)
