"""Packs charts into a square image: uniform texel density, as large as they fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from btfcore.dense.charts import Charts, signed_areas
from btfcore.dense.placement import place
from btfcore.dense.stencil import Stencils, cut_stencils, quarter_turn, stack
from btfcore.errors import AtlasFailed
from btfcore.progress import Progress, silent
from btfcore.types import F8, I4, I8, Atlas

GAP = 3  # texels between charts: room for bilinear look-ups on both sides
_BOARD = 512  # cells a side at most; larger images use cells of several texels
_SKETCH = 250  # cells a side, about, of the board on which orders are tried
_CROWDED = 0.25  # where charts would fill less of the image than this, the gap shrinks
_SHUFFLES = 40  # random orders tried besides the sorted ones,
_MANY = 150  # where there are at most so many charts
_DIRECTIONS = 45  # tried over a quarter turn for the smallest bounding box
_TURNS = np.array([[[1, 0], [0, 1]], [[0, 1], [-1, 0]], [[-1, 0], [0, -1]], [[0, -1], [1, 0]]])


@dataclass(frozen=True)
class _Board:
    """Upright charts (F, 3, 2) in lengths of any unit, faces by chart, and the cells."""

    uv: F8
    order: I8
    bounds: I8
    size: int  # cells a side
    cell: int  # texels a cell's side
    tick: Callable[[], None]  # called before each attempt

    @property
    def phase(self) -> float:
        """From a cell's centre to the nearest texel centre, in cells, along both axes."""
        return 0.5 / self.cell if self.cell % 2 == 0 else 0.0

    @property
    def count(self) -> int:
        """Number of charts."""
        return len(self.bounds) - 1

    def margin(self, gap: int) -> int:
        """Free cells between charts whose texels are to be `gap` apart."""
        return -(-(gap - 1) // self.cell)

    def room(self, gap: int) -> int:
        """Number of charts of a single cell that fit."""
        return int(-(-self.size // (self.margin(gap) + 1))) ** 2


@dataclass(frozen=True)
class _Layout:
    """Charts placed at `scale` cells per unit of length; placement as `place` returns it.

    rank: which of the orders tried was the one that fitted.
    """

    scale: float
    rank: int
    placement: I4
    stencils: Stencils


def pack(charts: Charts, *, rate: int, gap: int = GAP, progress: Progress = silent) -> Atlas:
    """Lay charts out in a rate x rate image, all at one scale, the largest found to fit.

    Texels of different charts are at least `gap` columns or rows apart; where that would
    leave less than a quarter of the image to the charts, 2 or 1 is tried instead. Everything
    lies within 0.5 … rate-1.5, and the middle of every chart's largest face is a texel
    centre, so that each chart has one.

    Raises `AtlasFailed` where there are more charts than texels.
    """
    order = np.argsort(charts.chart, kind="stable")
    bounds = np.searchsorted(charts.chart[order], np.arange(charts.count + 1))
    unit = max(float(np.abs(charts.uv).max()), np.finfo(float).tiny)
    uv = _upright(charts.uv / unit, order, bounds)  # areas must neither overflow nor vanish
    cell = max(1, -(-(rate - 2) // _BOARD))
    board = _Board(
        uv, order, bounds, (rate - 2) // cell, cell, lambda: progress(0.0, "packing charts")
    )
    area = float(np.abs(signed_areas(uv)).sum())
    orders = _orders(board)
    found: _Layout | None = None
    for tried in range(gap, 0, -1):
        layout = _search(board, area, orders, tried)
        if layout is not None and (found is None or layout.scale > found.scale):
            found = layout
            if area * layout.scale**2 > _CROWDED * board.size**2:
                break
    if found is None:
        raise AtlasFailed(
            f"{charts.count} charts cannot have a texel each in an image of {rate} x {rate}:"
            f" use a rate of at least {2 * int(np.ceil(np.sqrt(charts.count))) + 2}"
        )
    return Atlas(charts.mesh, _texels(board, found, charts.chart), charts.chart, rate)


def _orders(board: _Board) -> list[I8]:
    """Orders of the charts worth trying: by several sizes, then shuffled a little."""
    corner = board.uv[board.order].reshape(-1, 2)
    low = np.minimum.reduceat(corner, 3 * board.bounds[:-1])
    side = np.maximum.reduceat(corner, 3 * board.bounds[:-1]) - low
    area = np.add.reduceat(np.abs(signed_areas(board.uv))[board.order], board.bounds[:-1])
    longest = side.max(axis=1)
    sizes = [area, longest * np.sqrt(area), side.prod(axis=1), side.sum(axis=1), longest]
    random = np.random.default_rng(0)
    for k in range(_SHUFFLES if len(area) <= _MANY else 0):
        sizes.append(sizes[k % 5] * np.exp(random.normal(0, 0.25, len(area))))
    return [np.argsort(-size, kind="stable") for size in sizes]


def _search(board: _Board, area: float, orders: list[I8], gap: int) -> _Layout | None:
    """Largest scale found to fit: many orders on a coarse board, the best on the real one."""
    if board.room(gap) < board.count:
        return None
    ceiling = board.size / np.sqrt(max(area, np.finfo(float).tiny))
    stride = 0.93 if board.count <= _MANY else 0.8
    times = max(1, round(board.size / _SKETCH))
    rough = replace(board, size=board.size // times, cell=board.cell * times)
    if times == 1 or rough.room(gap) < 4 * board.count:
        found = _descend(board, orders[:3], gap, ceiling * 0.9, stride)
        return found and _climb(board, orders, gap, found, (1.05, 1.01))
    sketch = _descend(rough, orders[:3], gap, ceiling / times * 0.9, stride)
    if sketch is None:
        return None
    sketch = _climb(rough, orders, gap, sketch, (1.05, 1.015))
    chosen = [orders[sketch.rank]]
    found = _descend(board, chosen, gap, sketch.scale * times * 1.05, 0.98)
    return found and _climb(board, chosen, gap, found, (1.03, 1.008, 1.003))


def _descend(
    board: _Board, orders: list[I8], gap: int, scale: float, ratio: float
) -> _Layout | None:
    """Try ever smaller scales until one of the orders fits; None where none ever does."""
    smallest = scale * 1e-6
    while scale > smallest:
        found = _attempt(board, orders, gap, scale)
        if found is not None:
            return found
        scale *= ratio
    return None


def _climb(
    board: _Board, orders: list[I8], gap: int, found: _Layout, ratios: tuple[float, ...]
) -> _Layout:
    """Try ever larger scales, by smaller and smaller strides, until no order fits."""
    for ratio in ratios:
        while (better := _attempt(board, orders, gap, found.scale * ratio, found.rank)) is not None:
            found = better
    return found


def _attempt(
    board: _Board, orders: list[I8], gap: int, scale: float, first: int = 0
) -> _Layout | None:
    """Place all charts at `scale` in the first order that fits, beginning with `first`."""
    board.tick()
    uv = board.uv * scale + board.phase
    if np.abs(uv).max() > 2 * board.size:
        return None
    turned = [cut_stencils(uv, board.order, board.bounds)]
    if turned[0].cells().sum() > board.size**2:
        return None
    for _ in range(3):
        turned.append(quarter_turn(turned[-1]))
    stencils = stack(turned)
    margin = board.margin(gap)
    for k in range(len(orders)):
        rank = (first + k) % len(orders)
        board.tick()
        placement = place(stencils, orders[rank], board.size, margin)
        if placement is not None:
            return _Layout(scale, rank, placement, stencils)
    return None


def _texels(board: _Board, layout: _Layout, chart: I4) -> F8:
    """Corners (F, 3, 2) in texels: turn each chart and move it to its place."""
    count = len(layout.placement)
    turn = layout.placement[:, 0]
    box = layout.stencils.corner[turn * count + np.arange(count)]
    move = (layout.placement[:, 1:] - box).astype(np.float64)
    uv = board.uv * layout.scale + board.phase
    uv = (
        np.einsum("fij,fkj->fki", _TURNS[turn].astype(np.float64)[chart], uv) + move[chart][:, None]
    )
    return 1 + (board.cell - 1) / 2 + board.cell * uv


@njit(cache=True)
def _upright(uv: F8, order: I8, bounds: I8) -> F8:
    """Turn charts to their smallest bounding box; the largest face's middle to the origin."""
    out = np.empty_like(uv)
    for c in range(len(bounds) - 1):
        faces = order[bounds[c] : bounds[c + 1]]
        least, cosine, sine = np.inf, 1.0, 0.0
        for step in range(_DIRECTIONS):
            angle = np.pi / 2 * step / _DIRECTIONS
            one, two = np.cos(angle), np.sin(angle)
            x_low, x_high, y_low, y_high = np.inf, -np.inf, np.inf, -np.inf
            for f in faces:
                for k in range(3):
                    x = one * uv[f, k, 0] + two * uv[f, k, 1]
                    y = one * uv[f, k, 1] - two * uv[f, k, 0]
                    x_low, x_high = min(x_low, x), max(x_high, x)
                    y_low, y_high = min(y_low, y), max(y_high, y)
            box = (x_high - x_low) * (y_high - y_low)
            if box < least * (1 - 1e-9):
                least, cosine, sine = box, one, two
        largest, middle_x, middle_y = -1.0, 0.0, 0.0
        for f in faces:
            for k in range(3):
                out[f, k, 0] = cosine * uv[f, k, 0] + sine * uv[f, k, 1]
                out[f, k, 1] = cosine * uv[f, k, 1] - sine * uv[f, k, 0]
            area = abs(
                (out[f, 1, 0] - out[f, 0, 0]) * (out[f, 2, 1] - out[f, 0, 1])
                - (out[f, 1, 1] - out[f, 0, 1]) * (out[f, 2, 0] - out[f, 0, 0])
            )
            if area > largest:
                largest = area
                middle_x = (out[f, 0, 0] + out[f, 1, 0] + out[f, 2, 0]) / 3
                middle_y = (out[f, 0, 1] + out[f, 1, 1] + out[f, 2, 1]) / 3
        for f in faces:
            for k in range(3):
                out[f, k, 0] -= middle_x
                out[f, k, 1] -= middle_y
    return out
