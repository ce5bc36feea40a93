"""Small line plots as SVG text, so that the benchmarks' page needs no plotting library."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

WIDTH, HEIGHT = 640, 400
LEFT, RIGHT, TOP, BOTTOM = 72, 150, 34, 52
# told apart by people who see colours differently too (Okabe and Ito), and in grey by markers
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8A6D00")
MARKERS = ("circle", "square", "diamond", "up", "down", "cross", "ring", "frame")


def line_plot(
    path: Path,
    series: Mapping[str, tuple[Sequence[float], Sequence[float]]],
    *,
    x_label: str,
    y_label: str,
    title: str = "",
    log_x: bool = False,
    log_y: bool = False,
) -> None:
    """Write lines with markers, a name beside each, to `path`.

    series : name → (x, y); points that are not finite, or not positive on a logarithmic axis,
    are left out. The same figures give the same file.
    """
    lines = {name: _points(xs, ys, log_x, log_y) for name, (xs, ys) in series.items()}
    every = [point for points in lines.values() for point in points]
    x_axis = Axis([x for x, _ in every], LEFT, WIDTH - RIGHT, log_x)
    y_axis = Axis([y for _, y in every], HEIGHT - BOTTOM, TOP, log_y)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}"'
        f' height="{HEIGHT}" font-family="sans-serif" font-size="12">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    for value in x_axis.ticks:
        x = x_axis.place(value)
        parts.append(_line(x, TOP, x, HEIGHT - BOTTOM, "#ddd"))
        parts.append(_text(x, HEIGHT - BOTTOM + 18, f"{value:g}", "middle"))
    for value in y_axis.ticks:
        y = y_axis.place(value)
        parts.append(_line(LEFT, y, WIDTH - RIGHT, y, "#ddd"))
        parts.append(_text(LEFT - 8, y + 4, f"{value:g}", "end"))
    parts.append(_line(LEFT, HEIGHT - BOTTOM, WIDTH - RIGHT, HEIGHT - BOTTOM, "#333"))
    parts.append(_line(LEFT, TOP, LEFT, HEIGHT - BOTTOM, "#333"))
    middle = (LEFT + WIDTH - RIGHT) / 2
    parts.append(_text(middle, HEIGHT - 14, x_label, "middle"))
    parts.append(_text(middle, 20, title, "middle", bold=True))
    centre = (TOP + HEIGHT - BOTTOM) / 2
    parts.append(
        f'<text x="18" y="{centre:.1f}" text-anchor="middle" transform="rotate(-90 18'
        f' {centre:.1f})">{escape(y_label)}</text>'
    )
    for number, (name, points) in enumerate(lines.items()):
        colour, marker = COLOURS[number % 8], MARKERS[number % 8]
        placed = [(x_axis.place(x), y_axis.place(y)) for x, y in points]
        drawn = " ".join(f"{x:.1f},{y:.1f}" for x, y in placed)
        parts.append(
            f'<polyline points="{drawn}" fill="none" stroke="{colour}" stroke-width="1.8"/>'
        )
        parts += [_marker(x, y, marker, colour) for x, y in placed]
        level = TOP + 12 + 20 * number
        parts.append(_marker(WIDTH - RIGHT + 18, level - 4, marker, colour))
        parts.append(_text(WIDTH - RIGHT + 30, level, name, "start"))
    parts.append("</svg>\n")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(parts), encoding="utf-8")


class Axis:
    """Places values between two pixels, with round ticks; linear or logarithmic."""

    def __init__(self, values: Sequence[float], start: float, stop: float, log: bool) -> None:
        self._log, self._start, self._stop = log, start, stop
        low, high = (min(values), max(values)) if values else (0.0, 1.0)
        low, high = self._warp(low), self._warp(high)
        margin = 0.04 * (high - low) or 0.5
        self._low, self._high = low - margin, high + margin
        self.ticks = _decades(self._low, self._high) if log else _round(self._low, self._high)

    def _warp(self, value: float) -> float:
        return math.log10(value) if self._log and value > 0 else value

    def place(self, value: float) -> float:
        """Pixel of a value."""
        share = (self._warp(value) - self._low) / (self._high - self._low)
        return self._start + share * (self._stop - self._start)


def _points(
    xs: Sequence[float], ys: Sequence[float], log_x: bool, log_y: bool
) -> list[tuple[float, float]]:
    return [
        (float(x), float(y))
        for x, y in zip(xs, ys, strict=True)
        if math.isfinite(x) and math.isfinite(y) and (x > 0 or not log_x) and (y > 0 or not log_y)
    ]


def _round(low: float, high: float) -> list[float]:
    rough = (high - low) / 6
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * k for k in (1, 2, 5, 10) if power * k >= rough)
    first = math.ceil(low / step)
    return [round(step * k, 12) for k in range(first, math.floor(high / step) + 1)]


def _decades(low: float, high: float) -> list[float]:
    few = high - low > 2.5
    factors = (1,) if few else (1, 2, 5)
    ticks = [
        factor * 10.0**power
        for power in range(math.floor(low), math.ceil(high) + 1)
        for factor in factors
        if low <= math.log10(factor) + power <= high
    ]
    return ticks if len(ticks) > 1 else [10**low, 10**high]


def _line(x0: float, y0: float, x1: float, y1: float, colour: str) -> str:
    return f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" stroke="{colour}"/>'


def _text(x: float, y: float, text: str, anchor: str, *, bold: bool = False) -> str:
    weight = ' font-weight="bold"' if bold else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{weight}>{escape(text)}</text>'


def _marker(x: float, y: float, kind: str, colour: str) -> str:
    if kind in ("circle", "ring"):
        fill = colour if kind == "circle" else "white"
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{fill}" stroke="{colour}"/>'
    shapes = {
        "square": [(-3, -3), (3, -3), (3, 3), (-3, 3)],
        "frame": [(-3, -3), (3, -3), (3, 3), (-3, 3)],
        "diamond": [(0, -4.5), (4.5, 0), (0, 4.5), (-4.5, 0)],
        "up": [(-4, 3), (4, 3), (0, -4)],
        "down": [(-4, -3), (4, -3), (0, 4)],
        "cross": [(-4, -1), (-1, -1), (-1, -4), (1, -4), (1, -1), (4, -1), (4, 1), (1, 1), (1, 4),
                  (-1, 4), (-1, 1), (-4, 1)],
    }  # fmt: skip
    points = " ".join(f"{x + dx:.1f},{y + dy:.1f}" for dx, dy in shapes[kind])
    fill = "white" if kind == "frame" else colour
    return f'<polygon points="{points}" fill="{fill}" stroke="{colour}"/>'
