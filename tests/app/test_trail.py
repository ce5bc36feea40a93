"""The way of the pointer leaves no gap on the surface and does not jump."""

import numpy as np
import pytest

from app.picking import Picker, View
from app.tools.trail import Trail, along
from btfcore.errors import InvalidParameter
from btfcore.files.surface import export_input
from btfcore.render.camera import Turntable
from tests.app.test_picking import surface_of, wall

VIEW = View(Turntable(0.0, 0.0), (400, 300))


@pytest.fixture(scope="module")
def torus(ring):
    mesh, atlas, *_ = ring
    return Picker(export_input(mesh, atlas))


@pytest.fixture(scope="module")
def walls():
    """A small wall in front of a large one."""
    front, faces = wall(0.5, 0.3)
    back, _ = wall(-0.5)
    vertices = np.concatenate([front, back])
    return Picker(surface_of(vertices, np.concatenate([faces, faces + 4]), closed=False))


def gaps(run):
    return np.linalg.norm(np.diff(run.hits.position, axis=0), axis=1)


def test_one_fast_move_over_a_wall_is_one_run_without_gaps(walls):
    corner = walls.pixels(VIEW, np.array([[-0.9, -0.9, -0.5], [0.9, -0.9, -0.5]]))
    (run,) = along(walls, VIEW, tuple(corner[0, :2]), tuple(corner[1, :2]), 0.1, pressure=(0, 1))
    assert run.joined
    assert gaps(run).max() <= 0.1 + 1e-9 and np.median(gaps(run)) > 0.049
    assert run.hits.position[:, 1] == pytest.approx(-0.9) and run.hits.position[0, 0] > -0.9
    assert run.hits.position[-1, 0] == pytest.approx(0.9)
    # straight in the picture and in space, so the pressure rises with the way
    assert run.pressure == pytest.approx((run.hits.position[:, 0] + 0.9) / 1.8)
    assert np.einsum("nj,j->n", run.hits.normal, [0, 0, 1]) == pytest.approx(1.0)


def test_a_silhouette_breaks_the_way_into_runs_that_reach_it(walls):
    at = walls.pixels(VIEW, np.array([[-0.9, 0, -0.5], [0.9, 0, -0.5]]))
    runs = along(walls, VIEW, tuple(at[0, :2]), tuple(at[1, :2]), 0.1)
    assert [run.joined for run in runs] == [True, False, False]
    assert [set(np.round(run.hits.position[:, 2], 6)) for run in runs] == [{-0.5}, {0.5}, {-0.5}]
    assert all(gaps(run).max() <= 0.1 + 1e-9 for run in runs)
    middle = runs[1].hits.position[:, 0]
    pixel = walls.pixel_size(VIEW, 5.0)
    assert middle[0] == pytest.approx(-0.3, abs=pixel) and middle[-1] == pytest.approx(
        0.3, abs=pixel
    )


def test_the_way_off_the_surface_leaves_nothing_and_comes_back_as_a_new_run(torus):
    y = 150.0
    runs = along(torus, VIEW, (0.0, y), (400.0, y), 0.05)
    assert len(runs) >= 1 and not any(run.joined for run in runs)
    assert all(gaps(run).max() <= 0.05 + 1e-9 for run in runs if len(run) > 1)
    assert along(torus, VIEW, (0.0, 0.0), (400.0, 0.0), 0.05) == []
    up = View(Turntable(0.0, 89.0), VIEW.size)  # through the hole
    over = along(torus, up, (0.0, y), (400.0, y), 0.05)
    assert len(over) == 2 and not any(run.joined for run in over)


def test_a_steep_surface_is_followed_and_is_no_jump():
    vertices, faces = wall(0.0)
    picker = Picker(surface_of(vertices, faces, closed=False))
    view = View(Turntable(88.0, 0.0), VIEW.size)  # 2 degrees from its plane
    at = picker.pixels(view, np.array([[-0.9, 0, 0], [0.9, 0, 0]]))
    assert abs(at[1, 0] - at[0, 0]) < 9
    (run,) = along(picker, view, tuple(at[0, :2]), tuple(at[1, :2]), 0.1)
    assert gaps(run).max() <= 0.1 + 1e-9
    assert run.hits.position[-1, 0] - run.hits.position[0, 0] > 1.65


def test_pieces_of_a_move_give_what_the_whole_gives(walls):
    """However the events fall, the stroke is on the same line, as dense, and as long."""
    at = walls.pixels(VIEW, np.array([[-0.8, 0.7, -0.5], [0.8, 0.7, -0.5]]))[:, :2]
    rng = np.random.default_rng(3)
    for shares in ([1.0], np.sort(rng.uniform(0, 1, 7)), np.linspace(0, 1, 900)):
        trail = Trail(walls, 0.1)
        runs = trail.begin(VIEW, tuple(at[0]), 0.0)
        for share in shares:
            runs += trail.move(VIEW, tuple(at[0] + share * (at[1] - at[0])), share)
        runs += trail.end(VIEW, tuple(at[1]), 1.0)
        assert [run.joined for run in runs[1:]] == [True] * (len(runs) - 1)
        points = np.concatenate([run.hits.position for run in runs])
        pressure = np.concatenate([run.pressure for run in runs])
        steps = np.diff(points[:, 0])
        assert 0 < steps.min() and steps.max() <= 0.1 + 1e-9
        assert len(points) < 45
        assert points[[0, -1], 0] == pytest.approx([-0.8, 0.8])
        assert pressure == pytest.approx((points[:, 0] + 0.8) / 1.6, abs=1e-6)


def test_a_trail_leaves_the_surface_and_comes_back(torus):
    trail = Trail(torus, 0.05)
    assert trail.begin(VIEW, (1.0, 1.0)) == []
    assert trail.move(VIEW, (2.0, 1.0)) == []
    runs = trail.move(VIEW, (200.0, 160.0))
    assert runs and not runs[0].joined
    away = trail.move(VIEW, (200.0, 299.0))
    assert away[0].joined and trail.move(VIEW, (210.0, 299.0)) == []
    assert not trail.move(VIEW, (200.0, 160.0))[0].joined
    assert trail.end(VIEW, (200.0, 160.0)) == [] or trail.end(VIEW, (200.0, 160.0))[0].joined


def test_the_camera_may_turn_within_a_trail(torus):
    trail = Trail(torus, 0.05)
    first = trail.begin(VIEW, (200.0, 170.0))[0].hits.position[0]
    turned = View(Turntable(12.0, 5.0), VIEW.size)
    place = torus.pixels(turned, first)
    runs = trail.move(turned, (float(place[0]) + 12.0, float(place[1])))
    assert runs[0].joined
    assert np.linalg.norm(runs[0].hits.position[0] - first) < 0.1
    hidden = View(Turntable(180.0, 0.0), VIEW.size)
    assert not trail.move(hidden, (205.0, 170.0))[0].joined, "what was there is out of sight"


@pytest.mark.parametrize("spacing", [0.0, -1.0, np.nan, np.inf])
def test_a_spacing_without_sense_is_refused(torus, spacing):
    with pytest.raises(InvalidParameter, match="spacing"):
        along(torus, VIEW, (0.0, 0.0), (1.0, 1.0), spacing)
