"""The rasteriser against exact rational arithmetic, and laws of what it draws."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from btfcore.errors import InvalidParameter
from btfcore.render.camera import Turntable
from btfcore.render.raster import NEAREST, gbuffer, raster

FRONT = Turntable(0, 0, distance=4.0)


def grid(count=5, seed=0, jitter=0.3):
    """A wavy square sheet of triangles wound towards +z, larger than the picture."""
    rng = np.random.default_rng(seed)
    side = np.linspace(-3, 3, count)
    x, y = np.meshgrid(side, side)
    points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    points += jitter * rng.uniform(-1, 1, points.shape)
    at = np.arange(count * count).reshape(count, count)
    a, b, c, d = (each.ravel() for each in (at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]))
    return points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)


def plain(drawn):
    """How often each sample is inside, by exact edge functions in Python's own numbers."""
    columns, rows = drawn.grid
    hits = np.zeros((rows, columns), int)
    for corner in drawn.corner.tolist():
        for row in range(rows):
            for column in range(columns):
                x, y = Fraction(256 * column + 128), Fraction(256 * row + 128)
                inside = True
                for (ax, ay), (bx, by) in zip(corner, corner[1:] + corner[:1], strict=True):
                    value = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
                    closed = by < ay or (by == ay and bx > ax)
                    inside &= value > 0 or (closed and value == 0)
                hits[row, column] += inside
    return hits


@settings(max_examples=10)
@given(st.integers(0, 99), st.floats(-50, 50), st.floats(-40, 40))
def test_a_sheet_covers_every_sample_once(seed, azimuth, elevation):
    points, faces = grid(4, seed, 0.2)
    drawn = raster(points, faces, Turntable(azimuth / 5, elevation / 5, distance=3.0),
                   size=(9, 7), samples=2)  # fmt: skip
    hits = plain(drawn)
    assert (hits == 1).all()
    assert (gbuffer(drawn).face >= 0).all()


@settings(max_examples=15)
@given(st.integers(0, 999))
def test_samples_are_those_of_exact_arithmetic(seed):
    rng = np.random.default_rng(seed)
    # on a coarse lattice, so that samples lie on edges and corners
    points = np.round(rng.uniform(-1, 1, (3, 3)) * 4) / 4
    points[:, 2] = 0
    drawn = raster(points, np.array([[0, 1, 2]], np.int32), FRONT, size=(12, 8), samples=1)
    assert np.array_equal(plain(drawn) > 0, gbuffer(drawn).face >= 0)


@settings(max_examples=25)
@given(st.integers(0, 999), st.floats(0, 360), st.floats(-80, 80))
def test_barycentric_coordinates_and_depth_are_of_the_point_seen(seed, azimuth, elevation):
    points = np.random.default_rng(seed).uniform(-1, 1, (9, 3))
    faces = np.arange(9, dtype=np.int32).reshape(3, 3)
    camera = Turntable(azimuth, elevation, distance=3.5)
    size = (24, 20)
    seen = gbuffer(raster(points, faces, camera, size=size, samples=2))
    row, column = np.nonzero(seen.face >= 0)
    second, third = seen.bary[row, column].astype(np.float64).T
    corner = points[faces[seen.face[row, column]]]
    place = ((1 - second - third)[:, None] * corner[:, 0] + second[:, None] * corner[:, 1]
             + third[:, None] * corner[:, 2])  # fmt: skip
    found = camera.pixels(place, size)
    away = np.abs(found[:, :2] - np.stack([column + 0.5, row + 0.5], axis=1) / 2).max(axis=1)
    assert (away < 0.01).all()
    assert np.allclose(found[:, 2], seen.depth[row, column], rtol=1e-4)


def test_the_nearest_face_is_seen_whatever_the_order():
    points, faces = grid(4, 3, 0.0)
    behind = points - [0, 0, 0.5]
    both = np.concatenate([behind, points])
    near_last = np.concatenate([faces, faces + len(points)])
    near_first = near_last[::-1]
    one = gbuffer(raster(both, near_last, FRONT, size=(16, 12), samples=1))
    two = gbuffer(raster(both, near_first, FRONT, size=(16, 12), samples=1))
    assert (one.face >= len(faces)).all()
    assert np.array_equal(near_last[one.face], near_first[two.face])
    assert np.array_equal(one.depth, two.depth)


def test_faces_from_behind_are_drawn_only_where_asked():
    points, faces = grid(3, 1, 0.0)
    turned = faces[:, ::-1]
    hidden = gbuffer(raster(points, turned, FRONT, size=(8, 8), samples=1, both_sides=False))
    shown = gbuffer(raster(points, turned, FRONT, size=(8, 8), samples=1))
    front = gbuffer(raster(points, faces, FRONT, size=(8, 8), samples=1, both_sides=False))
    assert (hidden.face < 0).all()
    assert (shown.face >= 0).all()
    assert (front.face >= 0).all()


def test_a_floor_that_runs_through_the_eye_is_cut_off_in_front_of_it():
    points = np.array([[-50, -0.5, -50], [50, -0.5, -50], [50, -0.5, 50], [-50, -0.5, 50.0]])
    faces = np.array([[0, 2, 1], [0, 3, 2]], np.int32)
    camera = Turntable(0, 0, distance=2.0)
    drawn = raster(points, faces, camera, size=(40, 30), samples=1)
    seen = gbuffer(drawn)
    ground = seen.face >= 0
    horizon = camera.pixels(np.array([0, -0.5, -50.0]), (40, 30))[1]
    rows = np.arange(30) + 0.5
    assert ground[rows > horizon].all()
    assert not ground[rows < horizon].any()
    assert seen.depth.min() > NEAREST
    assert (np.diff(seen.depth[rows > horizon, 20]) < 0).all()


def test_corners_almost_in_the_eye_overflow_nothing():
    points = np.array([[1e-9, 1.0, 4 - 1e-9], [-40, -40, 0], [40, -40, 0]])
    drawn = raster(points, np.array([[0, 1, 2]], np.int32), FRONT, size=(30, 20), samples=4)
    assert np.abs(drawn.corner).max() < 2**31
    assert np.isfinite(gbuffer(drawn).bary).all()


def test_bands_are_the_whole_picture():
    points, faces = grid(6, 5)
    drawn = raster(points, faces, Turntable(20, 10, distance=5.0), size=(31, 23), samples=3)
    whole = gbuffer(drawn)
    for first, last in ((0, 5), (5, 6), (6, 23)):
        part = gbuffer(drawn, first, last)
        rows = slice(first * 3, last * 3)
        assert np.array_equal(part.face, whole.face[rows])
        assert np.array_equal(part.bary, whole.bary[rows])
        assert np.array_equal(part.depth, whole.depth[rows])
    large = raster(points, faces, FRONT, size=(4000, 4000), samples=2)
    bands = large.bands()
    assert bands[0][0] == 0
    assert bands[-1][1] == 4000
    assert all(one[1] == two[0] for one, two in zip(bands, bands[1:], strict=False))
    assert max((last - first) * 4 * 4000 for first, last in bands) <= 1 << 20


@pytest.mark.parametrize(
    ("size", "samples", "told"),
    [((0, 5), 1, "0 x 5"), ((20000, 5), 1, "20000"), ((16000, 16000), 1, "16000"),
     ((8, 8), 9, "9 samples"), ((8, 8), 0, "0 samples")],
)  # fmt: skip
def test_absurd_sizes_are_refused(size, samples, told):
    points, faces = grid(3)
    with pytest.raises(InvalidParameter, match=told):
        raster(points, faces, FRONT, size=size, samples=samples)


def test_positions_that_are_not_finite_are_refused():
    points, faces = grid(3)
    points[2, 1] = np.nan
    with pytest.raises(InvalidParameter, match="1 positions"):
        raster(points, faces, FRONT, size=(8, 8))
