"""Films: nothing jumps, everything comes round, all of it stays in the picture."""

import numpy as np
import pytest

from btfcore.errors import InvalidParameter
from btfcore.render.camera import Turntable
from btfcore.render.film import framing_all, moved_lights, orbited, shots
from btfcore.render.lights import directional


@pytest.mark.parametrize("seed", range(4))
def test_a_turntable_shows_all_points_from_one_distance(seed):
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((200, 3)) * [1.0, 0.4, 0.2] + [0.1, 0.3, -0.2]
    start = framing_all(Turntable(40, 25), points, aspect=1.5, turns=24, margin=0.05)
    film = shots(start, turntable=24)
    fullest = 0.0
    for shot in film:
        assert shot.camera.distance == start.distance
        place = shot.camera.pixels(points, (300, 200))
        assert place[:, 2].min() > 0
        across = np.abs(place[:, 0] - 150).max() / 150
        along = np.abs(place[:, 1] - 100).max() / 100
        fullest = max(fullest, across, along)
    assert fullest == pytest.approx(0.9, abs=1e-6)


def test_the_first_picture_of_a_film_is_that_of_no_film():
    camera = Turntable(10, 20, (0.1, 0.2, 0.3), 3.0)
    for path in ("around", "over"):
        first = shots(camera, turntable=5, light_sweep=8, path=path)[0]
        assert first.camera == camera
        lights = directional([[1, 2, 3], [0, 0, -1.0]])
        assert np.allclose(moved_lights(lights, first).direction, lights.direction)
    assert len(shots(camera)) == 1


def test_orbiting_turns_the_camera_about_the_vertical_axis():
    camera = Turntable(10, 20, (0.3, 0.2, 0.1), 3.0)
    around = orbited(camera, 90)
    x, y, z = camera.position
    assert np.allclose(around.position, [z, y, -x])
    assert np.allclose(orbited(camera, 360).position, camera.position)


def test_lights_go_around_once_in_even_steps():
    lights = directional([[1.0, 1.0, 0.0]], 2.5)
    film = shots(Turntable(), light_sweep=12)
    ways = np.array([moved_lights(lights, shot).direction[0] for shot in film])
    assert np.allclose(ways[:, 1], np.sqrt(0.5))
    angle = np.unwrap(np.arctan2(ways[:, 0], ways[:, 2]))
    assert np.allclose(np.diff(angle), np.radians(30))  # from +z to +x, like the azimuth
    assert np.allclose(moved_lights(lights, film[3]).intensity, 2.5)


def test_lights_go_over_from_side_to_side_as_the_camera_sees_it():
    camera = Turntable(70, 15)
    film = shots(camera, light_sweep=40, path="over")
    ways = np.array([moved_lights(directional([0, 1.0, 0]), shot).direction[0] for shot in film])
    right = camera.axes()[0]
    assert np.allclose(ways @ [np.sin(np.radians(70)), 0, np.cos(np.radians(70))], 0, atol=1e-12)
    across = ways @ right
    assert across[10] == pytest.approx(np.sin(np.radians(80)))
    assert across[30] == pytest.approx(-np.sin(np.radians(80)))
    loop = np.concatenate([ways, ways[:1]])
    assert np.linalg.norm(np.diff(loop, axis=0), axis=1).max() < 0.25


def test_where_both_move_both_come_round():
    film = shots(Turntable(0, 0), turntable=4, light_sweep=8)
    assert len(film) == 8
    assert [shot.camera.azimuth for shot in film] == [45.0 * each for each in range(8)]
    assert [shot.turned for shot in film] == [45.0 * each for each in range(8)]


@pytest.mark.parametrize("given", [{"turntable": -1}, {"light_sweep": 10**6}, {"path": "up"}])
def test_absurd_films_are_refused(given):
    with pytest.raises(InvalidParameter):
        shots(Turntable(), **given)
