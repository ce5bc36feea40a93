"""Plots are sound SVG whose points lie where their figures say."""

from xml.etree import ElementTree

import pytest

from tests.bench.plot import BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH, Axis, line_plot

SVG = "{http://www.w3.org/2000/svg}"


def drawn(path):
    """Points of every line of a plot."""
    root = ElementTree.fromstring(path.read_text(encoding="utf-8"))
    lines = root.findall(f"{SVG}polyline")
    return [
        [tuple(map(float, pair.split(","))) for pair in line.get("points").split()]
        for line in lines
    ]


@pytest.mark.parametrize("log", [False, True])
def test_lines_run_as_their_figures_do(log, tmp_path):
    path = tmp_path / "deep" / "plot.svg"
    series = {"up & <down>": ([1, 2, 4], [5, 1, 3]), "flat": ([1, 3], [2.5, 2.5])}
    line_plot(path, series, x_label="x", y_label="y", title="t", log_x=log, log_y=log)
    one, two = drawn(path)
    assert one[0][0] < one[1][0] < one[2][0]
    assert one[0][1] < one[2][1] < one[1][1]  # pixels run down
    assert two[0][1] == two[1][1]
    for x, y in (*one, *two):
        assert LEFT <= x <= WIDTH - RIGHT and TOP <= y <= HEIGHT - BOTTOM
    first = path.read_bytes()
    line_plot(path, series, x_label="x", y_label="y", title="t", log_x=log, log_y=log)
    assert path.read_bytes() == first


def test_what_cannot_be_placed_is_left_out(tmp_path):
    path = tmp_path / "plot.svg"
    series = {"a": ([1, 2, 3], [0, float("nan"), 7]), "none": ([], [])}
    line_plot(path, series, x_label="x", y_label="y", log_y=True)
    assert [len(points) for points in drawn(path)] == [1, 0]
    line_plot(path, {}, x_label="x", y_label="y")
    assert drawn(path) == []


@pytest.mark.parametrize(
    ("values", "log"),
    [
        ((0, 7), False),
        ((3, 3), False),
        ((1e-4, 2), True),
        ((0.011, 0.013), True),
        ((-5, 1e6), False),
    ],
)
def test_ticks_lie_on_the_axis(values, log):
    axis = Axis(values, 100, 500, log)
    assert 2 <= len(axis.ticks) <= 12
    places = [axis.place(tick) for tick in axis.ticks]
    assert places == sorted(places)
    assert 99.9 <= places[0] and places[-1] <= 500.1
