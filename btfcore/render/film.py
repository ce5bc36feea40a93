"""Sequences of pictures: the camera goes around the surface, the lights move, or both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from btfcore.errors import InvalidParameter
from btfcore.render.camera import ANGLE, Turntable
from btfcore.render.lights import Lights
from btfcore.types import F8

MOST_FRAMES = 10_000
PATHS = ("around", "over")
_SWING = 80.0  # degrees to either side


@dataclass(frozen=True)
class Shot:
    """One picture of a sequence.

    turned : degrees by which all lights and the environment are turned about +y, from +z to +x.
    swung : degrees by which the lights are tilted, to the right as the first camera sees it.
    axis (3,): about which they are tilted, that camera's horizontal backwards.
    """

    camera: Turntable
    turned: float = 0.0
    swung: float = 0.0
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)


def shots(
    camera: Turntable, *, turntable: int = 0, light_sweep: int = 0, path: str = "around"
) -> list[Shot]:
    """Cameras and lights of a film that can be played in a loop.

    turntable, light_sweep : pictures in which camera or lights go around once (0: they stay).
    Where both move, the film has as many as the longer of them, and each goes around once.
    path : of the lights, "around" the vertical axis, or "over" the surface from side to side
    and back, as the first camera sees it. Raises `InvalidParameter`.
    """
    for name, count in (("turntable", turntable), ("light sweep", light_sweep)):
        if not 0 <= count <= MOST_FRAMES:
            raise InvalidParameter(f"a {name} of {count} pictures, 0 to {MOST_FRAMES:,} can be")
    if path not in PATHS:
        raise InvalidParameter(f"lights go {path!r}; there are {' and '.join(PATHS)}")
    a = np.radians(camera.azimuth)
    axis = (float(np.sin(a)), 0.0, float(np.cos(a)))
    count = max(turntable, light_sweep, 1)
    out = []
    for frame in range(count):
        done = 360.0 * frame / count
        seen = orbited(camera, done) if turntable else camera
        turned = done if light_sweep and path == "around" else 0.0
        over = light_sweep and path == "over"
        swung = _SWING * float(np.sin(np.radians(done))) if over else 0.0
        out.append(Shot(seen, turned, swung, axis))
    return out


def orbited(camera: Turntable, degrees: float) -> Turntable:
    """Camera and its focus carried around the vertical axis through the origin."""
    if degrees == 0.0:
        return camera
    focus = _about((0.0, 1.0, 0.0), degrees) @ np.array(camera.focus)
    return replace(
        camera,
        azimuth=camera.azimuth + degrees,
        focus=(float(focus[0]), float(focus[1]), float(focus[2])),
    )


def framing_all(
    camera: Turntable, points: F8, *, aspect: float, turns: int = 0, margin: float = 0.06
) -> Turntable:
    """Frame `points` (n, 3) for a whole film, so that the distance stays the same throughout.

    turns : how many pictures the camera goes around in; each shows all points.
    """
    if turns <= 1:
        return camera.framing(points, aspect=aspect, margin=margin)
    slope = np.tan(np.radians(ANGLE / 2)) * (1 - 2 * margin)
    right, up, back = camera.axes()
    sides = (
        right + slope * aspect * back, slope * aspect * back - right,
        up + slope * back, slope * back - up, back, -back,
    )  # fmt: skip
    extreme = []
    for frame in range(turns):
        turn = _about((0.0, 1.0, 0.0), -360.0 * frame / turns)
        # what is farthest on each side of the view pyramid is all that framing looks at
        for side in sides:
            there = np.einsum("nj,j->n", points, turn.T @ side).argmax()
            extreme.append(turn @ points[there])
    return camera.framing(np.array(extreme), aspect=aspect, margin=margin)


def moved_lights(lights: Lights, shot: Shot) -> Lights:
    """Directional lights where a shot has them; without any environment."""
    turn = _about((0.0, 1.0, 0.0), shot.turned) @ _about(shot.axis, -shot.swung)
    direction = np.einsum("ij,lj->li", turn, lights.direction)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return Lights(direction, lights.intensity.copy())


def _about(axis: tuple[float, float, float], degrees: float) -> F8:
    """Rotation matrix (3, 3) about a unit axis, counter-clockwise seen from its tip."""
    turn = np.radians(degrees % 360.0)
    x, y, z = axis
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(turn) * skew + (1 - np.cos(turn)) * skew @ skew
