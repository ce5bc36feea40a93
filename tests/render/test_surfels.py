"""Laws of surfels: orthonormal frames that follow field and quilt, whatever the mesh."""

import numpy as np
import pytest

from btfcore.errors import InvalidParameter
from btfcore.render.surfels import BARE, placement, surfels, turned_frames
from btfcore.types import Field, Quilt
from tests.surfaces import plane


def scene(angle=0.0, patch=0):
    dense = plane(4, 5)
    count = len(dense.vertices)
    tangents = np.tile(np.float32([1, 0, 0]), (count, 1))
    quilt = Quilt(
        np.full((count, 2), 2.5, np.float32),
        np.full(count, angle, np.float32),
        np.zeros(count, np.uint16),
        np.full(count, patch, np.int32),
    )
    return dense, Field(tangents, np.zeros((0, 3))), quilt


def made(dense, field, quilt):
    return surfels(dense, field, quilt, placement(dense.vertices))


def test_frames_are_right_handed_with_the_normal_last():
    found = made(*scene())
    np.testing.assert_allclose(found.frame, np.tile(np.eye(3), (len(found), 1, 1)), atol=1e-6)


def test_the_angle_turns_counter_clockwise_about_the_normal():
    found = made(*scene(np.pi / 2))
    np.testing.assert_allclose(found.frame[0], [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-6)


def test_positions_lie_in_the_unit_ball_whatever_the_mesh_s_size():
    dense, _, _ = scene()
    for size, away in ((1e-9, 0.0), (1.0, 1e7), (1e12, 0.0)):
        points = dense.vertices * size + away
        inside = placement(points).to_scene(points)
        assert np.linalg.norm(inside, axis=1).max() == pytest.approx(1.0, abs=1e-6)


def test_a_point_mesh_has_finite_positions():
    points = np.ones((3, 3))
    assert np.isfinite(placement(points).to_scene(points)).all()


@pytest.mark.parametrize("normal", [(0, 0, 0), (np.nan, 0, 1), (np.inf, 0, 0), (1e-30, 0, 0)])
@pytest.mark.parametrize("tangent", [(0, 0, 0), (0, 0, 1), (np.nan, 1, 0), (1, 0, 0)])
def test_degenerate_normals_and_tangents_give_some_orthonormal_frame(normal, tangent):
    frame = turned_frames(
        np.array([normal], np.float32), np.array([tangent], np.float32), np.array([0.3])
    )[0].astype(np.float64)
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=1e-6)


def test_bare_vertices_are_named_so_and_may_hold_anything():
    dense, field, quilt = scene(patch=-1)
    source = quilt.source.copy()
    source[:] = np.nan
    found = made(dense, field, Quilt(source, quilt.angle, quilt.sample, quilt.patch))
    assert (found.sample == BARE).all()
    assert np.isfinite(found.source).all()


def test_positions_that_are_not_finite_are_refused_with_their_number():
    dense, field, quilt = scene()
    source = quilt.source.copy()
    source[3] = np.nan
    with pytest.raises(InvalidParameter, match="1 positions"):
        made(dense, field, Quilt(source, quilt.angle, quilt.sample, quilt.patch))


def test_a_quilt_of_another_mesh_is_refused():
    dense, field, quilt = scene()
    short = Quilt(quilt.source[1:], quilt.angle[1:], quilt.sample[1:], quilt.patch[1:])
    with pytest.raises(InvalidParameter, match="19"):
        made(dense, field, short)
