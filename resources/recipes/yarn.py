"""Plied yarn: fibre by fibre about a strand's path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.types import F8
from resources.recipes.canvas import Canvas
from resources.recipes.tubes import frame


@dataclass(frozen=True)
class Yarn:
    """How a yarn is spun, lengths in texels.

    radius of the strand; flat : its height over its width; plies twisted about each other and
    fibres in each of them; twist of the plies and of the fibres within a ply, turns a texel;
    fibre : radius of a fibre; loose : how far fibres stray from their place, in ply radii.
    """

    radius: float
    flat: float = 1.0
    plies: int = 3
    fibres: int = 14
    twist: float = 0.06
    spin: float = -0.05
    fibre: float = 0.38
    loose: float = 0.18


@dataclass(frozen=True, eq=False)
class Fibres:
    """Spheres of many fibres: places (n, 3), radius (n,), the fibre each belongs to (n,) and
    how deep it lies in its strand (n,), 1 at the surface.
    """  # noqa: D205

    places: F8
    radius: F8
    fibre: np.ndarray
    depth: F8

    @staticmethod
    def joined(parts: list[Fibres]) -> Fibres:
        """Return all fibres in one, numbered on."""
        starts = np.cumsum([0] + [int(each.fibre.max()) + 1 for each in parts])
        numbers = [each.fibre + at for each, at in zip(parts, starts, strict=False)]
        return Fibres(
            np.concatenate([each.places for each in parts]),
            np.concatenate([each.radius for each in parts]),
            np.concatenate(numbers),
            np.concatenate([each.depth for each in parts]),
        )


def spin(
    canvas: Canvas,
    what: str,
    path: F8,
    yarn: Yarn,
    *,
    closed: F8 | None = None,
    thickness: F8 | float = 1.0,
) -> Fibres:
    """Fibres about `path` (m, 3), points less than half a drawing sample apart.

    closed : (3,) one period of a strand without ends (its twists are rounded to whole turns),
    or None for a loose piece. thickness : (m,) factor of the radius along the strand.
    """
    rng = canvas.rng(what)
    count = len(path)
    back = np.zeros(3) if closed is None else closed
    if closed is None:
        back = path[-1] - path[0] + (path[-1] - path[-2])
    along, side, up = frame(path, back)
    if closed is None:
        along[0], along[-1] = along[1], along[-2]
        side[0], side[-1], up[0], up[-1] = side[1], side[-2], up[1], up[-2]
    pace = np.linalg.norm(np.diff(path, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(pace)])
    total = length[-1] + pace[-1]
    turns = yarn.twist * total, yarn.spin * total
    if closed is not None:
        turns = float(round(turns[0])), float(round(turns[1]))
    share = length / total
    thick = np.broadcast_to(np.asarray(thickness, np.float64), (count,))
    ply_radius = yarn.radius * (0.52 if yarn.plies > 1 else 1.0)
    orbit = yarn.radius - ply_radius
    places, fibre, depth = [], [], []
    for ply in range(yarn.plies):
        about = 2 * np.pi * (turns[0] * share + ply / yarn.plies) + rng.uniform(0, 0.3)
        for each in range(yarn.fibres):
            # Fibres fill the ply's disc evenly; most of what is seen lies at its surface.
            out = np.sqrt((each + 0.5) / yarn.fibres) * rng.uniform(0.92, 1.04)
            start = rng.uniform(0, 2 * np.pi)
            stray = _wander(rng, share, closed is not None)
            within = 2 * np.pi * turns[1] * share + start + stray[0] * yarn.loose * 2
            out = np.clip(out + stray[1] * yarn.loose, 0.0, 1.25)
            a = (orbit * np.cos(about) + ply_radius * out * np.cos(about + within)) * thick
            b = (orbit * np.sin(about) + ply_radius * out * np.sin(about + within)) * thick
            places.append(path + a[:, None] * side + (b * yarn.flat)[:, None] * up)
            fibre.append(np.full(count, ply * yarn.fibres + each))
            depth.append(np.hypot(a, b) / (yarn.radius * thick))
    spheres = np.concatenate(places)
    return Fibres(
        spheres,
        np.full(len(spheres), yarn.fibre),
        np.concatenate(fibre),
        np.concatenate(depth),
    )


def _wander(rng: np.random.Generator, share: F8, closed: bool) -> F8:
    """Two slow random walks (2, m) along a strand, deviation about 1."""
    waves = max(4, len(share) // 60)
    knots = rng.standard_normal((2, waves))
    if closed:
        knots = np.concatenate([knots, knots[:, :1]], 1)
    at = share * (knots.shape[1] - 1)
    low = np.minimum(at.astype(np.int64), knots.shape[1] - 2)
    part = at - low
    part = part * part * (3 - 2 * part)
    return knots[:, low] * (1 - part) + knots[:, low + 1] * part


def hairs(
    canvas: Canvas, what: str, roots: F8, *, length: float, radius: float, lift: float
) -> Fibres:
    """Fuzz: a curled fibre from every root (n, 3), about `length` texels long."""
    rng = canvas.rng(what)
    steps = max(4, int(np.ceil(length * canvas.fine * 2.2)))
    share = np.linspace(0, 1, steps)
    heading = rng.uniform(0, 2 * np.pi, len(roots))
    curl = rng.normal(0, 1.6, len(roots))
    reach = length * rng.uniform(0.4, 1.2, len(roots))
    bend = heading[:, None] + curl[:, None] * share
    ahead = reach[:, None] / steps
    path = np.stack([np.sin(bend), np.cos(bend)], -1).cumsum(1) * ahead[..., None]
    arch = lift * rng.uniform(0.2, 1.0, (len(roots), 1)) * np.sin(np.pi * share**0.8)
    places = np.concatenate([path, arch[..., None]], -1) + roots[:, None]
    number = np.repeat(np.arange(len(roots)), steps)
    total = len(roots) * steps
    return Fibres(places.reshape(-1, 3), np.full(total, radius), number, np.ones(total))
