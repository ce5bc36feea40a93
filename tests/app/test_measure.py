"""The Measure tool, driven by real mouse events."""

import numpy as np
import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QEvent, Qt  # noqa: E402
from PyQt6.QtGui import QKeyEvent  # noqa: E402
from PyQt6.QtWidgets import QApplication, QWidget  # noqa: E402

from app.picking import Picker, View  # noqa: E402
from app.tools.base import Tool  # noqa: E402
from app.tools.marks import Dots, Label, Line  # noqa: E402
from app.tools.measure import Measure, ruler_of  # noqa: E402
from app.tools.overlay import Overlay  # noqa: E402
from app.tools.pointer import Pointer  # noqa: E402
from app.tools.trail import along  # noqa: E402
from app.units import length_text  # noqa: E402
from btfcore.files.surface import export_input  # noqa: E402
from btfcore.render.camera import Turntable  # noqa: E402
from tests.app.test_pointer import LEFT, PLAIN, down, move, up  # noqa: E402


class Canvas(QWidget):
    """A view without a scene, which is the tools' stage."""

    def __init__(self, surface):
        super().__init__()
        self.pointer = None
        self.setMouseTracking(True)
        self.resize(400, 300)
        self.picker = Picker(surface)
        self.overlay = Overlay(self, self)
        self.pointer = Pointer(parent=self)

    def view(self):
        return View(Turntable(0.0, 30.0, distance=2.6), (400, 300))

    def draw(self, marks):
        self.overlay.draw(marks)

    def event(self, event):
        if self.pointer is not None and self.pointer.handle(event):
            return True
        return super().event(event)

    def find(self, kind):
        return [mark for mark in self.overlay.marks if isinstance(mark, kind)]


@pytest.fixture(scope="module")
def surface(ring):
    mesh, atlas, *_ = ring
    return export_input(mesh, atlas)


@pytest.fixture
def canvas(qtbot, surface):
    canvas = Canvas(surface)
    qtbot.addWidget(canvas)
    ruler = ruler_of(surface)
    canvas.questions = []

    def ask(start, end, answer):
        canvas.questions.append((start, end, answer))
        if not canvas.late:
            answer(ruler.between(start, end))

    canvas.late = False
    canvas.tool = Measure(canvas, lambda length: length_text(length, "cm"), ask, canvas)
    canvas.pointer.set_tool(canvas.tool)
    return canvas


def places(canvas):
    """Two pixels of the ring's front, left and right."""
    points = np.array([[-0.9, 0.3, 0.9], [0.9, 0.3, 0.9]])
    return [tuple(each[:2]) for each in canvas.picker.pixels(canvas.view(), points)]


def picked(canvas):
    return canvas.picker.pick(canvas.view(), np.array(places(canvas))).position


def test_a_drag_measures_straight_and_over_the_surface(qtbot, canvas):
    one, two = places(canvas)
    down(canvas, *one)
    move(canvas, *two, LEFT)
    assert canvas.tool.straight > 0 and not canvas.questions, "live, and cheap"
    with qtbot.waitSignal(canvas.tool.measured) as signal:
        up(canvas, *two)
    straight = np.linalg.norm(np.diff(picked(canvas), axis=0))
    assert canvas.tool.straight == pytest.approx(straight)
    assert signal.args == [canvas.tool.straight, canvas.tool.over]
    (run,) = along(canvas.picker, canvas.view(), one, two, 0.02)
    walked = np.concatenate([picked(canvas)[:1], run.hits.position])
    longer = np.linalg.norm(np.diff(walked, axis=0), axis=1).sum()
    assert straight < canvas.tool.over < 1.002 * longer, "no longer than another way"
    (label,) = canvas.find(Label)
    assert length_text(straight, "cm") in label.text
    assert length_text(canvas.tool.over, "cm") in label.text
    way = canvas.find(Line)[0].points
    assert way[[0, -1]] == pytest.approx(picked(canvas))
    length = np.linalg.norm(np.diff(way, axis=0), axis=1).sum()
    assert length == pytest.approx(canvas.tool.over, rel=0.02)


def test_two_clicks_measure_the_same_with_a_preview_between_them(canvas):
    one, two = places(canvas)
    down(canvas, *one)
    up(canvas, *one)
    assert canvas.tool.straight is None and len(canvas.find(Dots)) == 1
    move(canvas, *two)
    assert canvas.tool.straight is not None and not canvas.questions
    down(canvas, *two)
    up(canvas, *two)
    assert canvas.tool.straight == pytest.approx(np.linalg.norm(np.diff(picked(canvas), axis=0)))
    assert len(canvas.questions) == 1 and canvas.tool.over > canvas.tool.straight
    move(canvas, 5, 5)
    assert canvas.find(Label), "it stays while the pointer goes on"
    QApplication.sendEvent(canvas, QEvent(QEvent.Type.Leave))
    assert canvas.find(Label)


def test_off_the_surface_nothing_begins_and_the_end_stays_where_it_was(canvas):
    one, two = places(canvas)
    down(canvas, 3, 3)
    move(canvas, *one, LEFT)
    up(canvas, *one)
    assert canvas.tool.straight is None and not canvas.questions
    down(canvas, *one)
    move(canvas, *two, LEFT)
    move(canvas, 3, 3, LEFT)
    up(canvas, 3, 3)
    assert canvas.tool.straight == pytest.approx(np.linalg.norm(np.diff(picked(canvas), axis=0)))


def test_escape_clears_and_an_answer_that_comes_too_late_is_dropped(canvas):
    one, two = places(canvas)
    canvas.late = True
    down(canvas, *one)
    move(canvas, *two, LEFT)
    up(canvas, *two)
    escape = QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_Escape, PLAIN)
    QApplication.sendEvent(canvas, escape)
    assert canvas.tool.straight is None and canvas.overlay.marks == ()
    start, end, answer = canvas.questions[0]
    answer(ruler_of(canvas.picker.surface).between(start, end))
    assert canvas.tool.over is None and canvas.overlay.marks == ()
    down(canvas, *one)
    move(canvas, *two, LEFT)
    QApplication.sendEvent(canvas, QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_Escape, PLAIN))
    up(canvas, *two)
    assert canvas.tool.straight is None and len(canvas.questions) == 1


def test_another_tool_leaves_a_clean_view(canvas):
    one, two = places(canvas)
    down(canvas, *one)
    move(canvas, *two, LEFT)
    up(canvas, *two)
    canvas.pointer.set_tool(Tool(canvas, canvas))
    assert canvas.overlay.marks == ()


def test_a_measurement_begun_anew_forgets_the_one_before(canvas):
    one, two = places(canvas)
    down(canvas, *one)
    move(canvas, *two, LEFT)
    up(canvas, *two)
    down(canvas, *two)
    assert canvas.tool.over is None and canvas.tool.straight is None
    up(canvas, *two)


def test_the_ruler_joins_what_only_the_texture_parts(surface):
    ruler = ruler_of(surface)
    middle = np.full(3, 1 / 3)
    ways = [ruler.between((0, middle), (face, middle)) for face in range(0, len(surface.faces), 97)]
    assert all(np.isfinite(way.length) for way in ways)
