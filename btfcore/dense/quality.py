"""How well charts lie flat: mirrored faces, overlaps and stretch, chart by chart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from btfcore.dense.unwrap import C16
from btfcore.types import F8, I4, I8

_GRID = 96  # overlaps are looked for on at least as many cells a side of a chart's bounding box
_MOST = 2**22  # on about as many cells in all at most,
_LONGEST = 2**16  # and a side
_DIRECTIONS = 12  # tried over a quarter turn for the smallest bounding box
_FAR = 1.5  # a face stretched or squeezed by more is a bad one


@dataclass(frozen=True)
class Quality:
    """How charts lie, (C,) f8 each; shares are of a chart's area.

    mirrored; overlap: sample points covered twice or more over all covered; twice: such points,
    in number on a grid of the step asked for; bad: faces whose singular values leave
    [1/1.5, 1.5]; strain: mean of (s1-1)² + (s2-1)²; fill: area over that of the smallest
    bounding box; area: in the plane. culprit (C, 2) i4: two faces that lie one over the other,
    else the largest mirrored face and -1, else -1.
    """

    mirrored: F8
    overlap: F8
    twice: F8
    bad: F8
    strain: F8
    fill: F8
    area: F8
    culprit: I4


def measure(chart: I4, count: int, shape: C16, place: C16, *, step: float = np.inf) -> Quality:
    """Quality of charts 0 … count-1; shape and place (F, 3) c16, edges and flat corners.

    step : most distance between the points where overlaps are looked for, > 0; a chart whose
    bounding box would have too many gets fewer.
    """
    area = np.abs((shape[:, 0].conj() * -shape[:, 2]).imag) / 2
    edge = np.roll(place, -1, axis=1) - place
    signed = (edge[:, 0].conj() * -edge[:, 2]).imag / 2
    along, across = _derivatives(shape, edge)
    larger, smaller = np.abs(along) + np.abs(across), np.abs(along) - np.abs(across)
    whole = np.maximum(np.bincount(chart, area, count), np.finfo(float).tiny)
    strain = (larger - 1) ** 2 + (smaller - 1) ** 2
    bad = (larger > _FAR) | (smaller < 1 / _FAR)
    order = np.argsort(chart, kind="stable")
    bounds = np.searchsorted(chart[order], np.arange(count + 1))
    culprit = np.full((count, 2), -1, np.int32)
    flat = place.view(np.float64).reshape(-1, 3, 2)
    overlap = _overlaps(flat, signed, order, bounds, step, culprit)
    covered: F8 = np.bincount(chart, np.abs(signed), count).astype(np.float64)
    return Quality(
        np.bincount(chart, np.where(signed < 0, area, 0), count) / whole,
        overlap,
        overlap * covered / step / step,
        np.bincount(chart, np.where(bad, area, 0), count) / whole,
        np.bincount(chart, area * strain, count) / whole,
        covered / np.maximum(_boxes(flat, order, bounds), np.finfo(float).tiny),
        covered,
        culprit,
    )


def _derivatives(shape: C16, edge: C16) -> tuple[C16, C16]:
    """Each face's map as z -> along * z + across * conj(z)."""
    p, q = shape[:, 0], -shape[:, 2]
    u, v = edge[:, 0], -edge[:, 2]
    cross = p * q.conj() - p.conj() * q
    flat = np.abs(cross) <= 1e-12 * np.abs(p) * np.abs(q)
    cross = np.where(flat, 1, cross)
    along = np.where(flat, 1, (u * q.conj() - v * p.conj()) / cross)
    across = np.where(flat, 0, (p * v - q * u) / cross)
    return along, across


@njit(cache=True)
def _boxes(place: F8, order: I8, bounds: I8) -> F8:
    """Area of each chart's smallest bounding box over a few directions."""
    box = np.full(len(bounds) - 1, np.inf)
    for c in range(len(box)):
        for step in range(_DIRECTIONS):
            one = np.cos(np.pi / 2 * step / _DIRECTIONS)
            two = np.sin(np.pi / 2 * step / _DIRECTIONS)
            low_x = low_y = np.inf
            high_x = high_y = -np.inf
            for at in range(bounds[c], bounds[c + 1]):
                for k in range(3):
                    x = one * place[order[at], k, 0] + two * place[order[at], k, 1]
                    y = one * place[order[at], k, 1] - two * place[order[at], k, 0]
                    low_x, high_x = min(low_x, x), max(high_x, x)
                    low_y, high_y = min(low_y, y), max(high_y, y)
            box[c] = min(box[c], (high_x - low_x) * (high_y - low_y))
    return box


@njit(cache=True)
def _crossing(ax: float, ay: float, bx: float, by: float, y: float) -> float:
    """Where the edge a b is at height y; the same to the last bit for b a."""
    if ay > by or (ay == by and ax > bx):
        ax, ay, bx, by = bx, by, ax, ay
    return ax + (bx - ax) * ((y - ay) / (by - ay))


@njit(cache=True)
def _overlaps(place: F8, signed: F8, order: I8, bounds: I8, spacing: float, culprit: I4) -> F8:
    """Share of covered sample points that more than one face covers.

    A point on an edge belongs to one of its two faces: heights and crossings are half open.
    """
    count = len(bounds) - 1
    overlap = np.zeros(count)
    owner = np.empty(_GRID * _GRID, np.int32)
    for c in range(count):
        faces = order[bounds[c] : bounds[c + 1]]
        if len(faces) < 2:
            continue
        low_x = low_y = np.inf
        high_x = high_y = -np.inf
        largest = 0.0
        for f in faces:
            if signed[f] < largest:
                largest = signed[f]
                culprit[c, 0], culprit[c, 1] = f, -1
            for k in range(3):
                low_x, high_x = min(low_x, place[f, k, 0]), max(high_x, place[f, k, 0])
                low_y, high_y = min(low_y, place[f, k, 1]), max(high_y, place[f, k, 1])
        wide, high = high_x - low_x, high_y - low_y
        least = max(np.sqrt(wide * high / _MOST), max(wide, high) / _LONGEST)
        step = min(max(wide, high) / (_GRID - 1), max(spacing, least))
        if not step > 0:
            continue
        columns, rows = int(wide / step) + 2, int(high / step) + 2
        if columns * rows > len(owner):
            owner = np.empty(columns * rows, np.int32)
        owner[: columns * rows] = -1
        hits, twice = 0, 0
        for f in faces:
            ax, ay = (place[f, 0, 0] - low_x) / step, (place[f, 0, 1] - low_y) / step
            bx, by = (place[f, 1, 0] - low_x) / step, (place[f, 1, 1] - low_y) / step
            cx, cy = (place[f, 2, 0] - low_x) / step, (place[f, 2, 1] - low_y) / step
            for y in range(int(np.ceil(min(ay, by, cy))), int(np.ceil(max(ay, by, cy)))):
                left, right = np.inf, -np.inf
                if (ay <= y) != (by <= y):
                    x = _crossing(ax, ay, bx, by, y)
                    left, right = min(left, x), max(right, x)
                if (by <= y) != (cy <= y):
                    x = _crossing(bx, by, cx, cy, y)
                    left, right = min(left, x), max(right, x)
                if (cy <= y) != (ay <= y):
                    x = _crossing(cx, cy, ax, ay, y)
                    left, right = min(left, x), max(right, x)
                for at in range(
                    y * columns + int(np.ceil(left)), y * columns + int(np.ceil(right))
                ):
                    if owner[at] >= 0:
                        if twice == 0:
                            culprit[c, 0], culprit[c, 1] = owner[at], f
                        twice += 1
                    else:
                        owner[at] = f
                        hits += 1
        overlap[c] = twice / max(hits, 1)
    return overlap
