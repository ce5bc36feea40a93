"""Lines of damage: the weakest way through a material, and wandering strokes."""

from __future__ import annotations

import numpy as np
from scipy import ndimage
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from btfcore.types import F8

_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))


def weakest(cost: F8, start: tuple[float, float], ends: list[tuple[float, float]]) -> list[F8]:
    """Cheapest ways (m, 2) (row, column) over a grid of costs > 0 from `start` to each end.

    Not periodic: the ways stay on the sheet. Ends share what they can of the way, as the
    branches of a crack do.
    """
    height, width = cost.shape
    number = np.arange(height * width).reshape(height, width)
    flat = cost.ravel()
    one, other, price = [], [], []
    for down, right in _STEPS:
        here = number[: height - down, max(-right, 0) : width - max(right, 0)]
        there = number[down:, max(right, 0) : width + min(right, 0)]
        one.append(here.ravel())
        other.append(there.ravel())
        length = np.hypot(down, right) / 2
        price.append(length * (flat[here.ravel()] + flat[there.ravel()]))
    pairs = np.concatenate(one), np.concatenate(other)
    graph = csr_array((np.concatenate(price), pairs), shape=(flat.size, flat.size))
    source = int(round(start[0])) * width + int(round(start[1]))
    _, before = dijkstra(graph, directed=False, indices=source, return_predecessors=True)
    ways = []
    for row, column in ends:
        at = int(round(row)) * width + int(round(column))
        way = [at]
        while way[-1] != source:
            way.append(int(before[way[-1]]))
        ways.append(np.stack(np.divmod(np.array(way[::-1]), width), 1).astype(np.float64))
    return ways


def dense(path: F8, spacing: float, smooth: float = 0.0) -> F8:
    """Resample a line (m, 2 or 3) at `spacing`, after smoothing over `smooth` of its points."""
    if smooth > 0:
        path = ndimage.gaussian_filter1d(path, smooth, axis=0, mode="nearest")
    length = np.concatenate([[0.0], np.linalg.norm(np.diff(path, axis=0), axis=1).cumsum()])
    at = np.arange(0, length[-1], spacing)
    return np.stack([np.interp(at, length, each) for each in path.T], 1)


def stroke(
    rng: np.random.Generator, middle: F8, heading: float, length: float, bend: float, spacing: float
) -> F8:
    """Slightly curved line (m, 2) through `middle`; bend is its total turn in radians."""
    share = np.arange(-length / 2, length / 2, spacing) / max(length, 1e-9)
    turn = heading + bend * share + 0.02 * rng.standard_normal() * np.sin(6 * share)
    path = np.stack([-np.sin(turn), np.cos(turn)], 1).cumsum(0) * spacing
    return path - path.mean(0) + middle
