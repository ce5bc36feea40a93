"""What the benchmark of rendering measures is right where the answer is known."""

import os
from unittest import mock

import numpy as np
import pytest

from btfcore.render.camera import Turntable
from tests.bench.render import clocked, moving, off, ways, window
from tests.bench.truth import Miss, Shot, miss
from tests.bench.truth_scenes import plane, towards


def test_time_is_that_of_one_frame_and_every_light_is_asked_for():
    asked = []
    cpu, wall = clocked(asked.append, moving(3))
    assert len(asked) == 4  # the first warms up
    assert np.isfinite([cpu, wall]).all()
    directions = np.concatenate([light.direction for light in asked[1:]])
    turned = np.degrees(np.arccos((directions[:-1] * directions[1:]).sum(axis=1)))
    assert ((turned > 1) & (turned < 4)).all()


def test_errors_of_known_pictures():
    one = np.zeros((10, 3), np.float32)
    assert off(one, one) == 0
    assert off(one, one + 1) == pytest.approx(1.0)
    scene = plane((12, 12), 40, 0)
    truth = np.full((144, 3), 0.25, np.float32)
    shots = [Shot(scene, towards(50, 0), truth)]
    assert miss([truth], [truth], shots) == Miss(0.0, 0.0, 1.0)
    found = miss([truth * 1.2], [truth], shots)
    assert found.L2 == pytest.approx(0.2, rel=1e-5)
    assert 0 < found.RMSE < 0.1


def test_more_factors_and_better_interpolation_cost_error():
    rows = ways(16, "6x3x6x3", 20, 48)
    kinds = {(row[0], row[1]): row[4:] for row in rows}
    assert ("images", "nearest4") in kinds and ("harmonics of order 2", "grid") in kinds
    assert kinds["20 factors", "grid"][1] < kinds["4 factors", "grid"][1]
    assert kinds["images", "grid"][0] < kinds["images", "nearest"][0]
    assert all(np.isfinite(row[2:]).all() for row in rows)


def test_without_a_display_the_window_says_why():
    hidden = {"DISPLAY": "", "WAYLAND_DISPLAY": ""}
    with mock.patch.dict(os.environ, hidden):
        assert window() == "Frames in the window were not measured: there is no display."


def test_the_camera_sees_all_of_the_mesh():
    points = np.random.default_rng(0).normal(size=(50, 3)) * [1, 2, 3]
    camera = Turntable().framing(points, aspect=800 / 600)
    assert (camera.local(points)[:, 2] > 0).all()
