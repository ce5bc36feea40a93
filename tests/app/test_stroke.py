"""Strokes over a real view: mouse and pen draw, other drags move the camera as before."""

import numpy as np
import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QEvent, Qt  # noqa: E402
from PyQt6.QtGui import QKeyEvent  # noqa: E402
from PyQt6.QtWidgets import QApplication  # noqa: E402

from app.document import Document  # noqa: E402
from app.picking import Picker, View  # noqa: E402
from app.tools.base import Tool  # noqa: E402
from app.tools.marks import Line, Ring  # noqa: E402
from app.tools.overlay import Overlay  # noqa: E402
from app.tools.pointer import Pointer  # noqa: E402
from app.tools.stroke import Brush, StrokeTool  # noqa: E402
from app.viewport import Viewport  # noqa: E402
from btfcore.files.surface import export_input  # noqa: E402
from btfcore.paint.edits import Stroke  # noqa: E402
from tests.app.test_pointer import (  # noqa: E402  # noqa: E402
    LEFT,
    MIDDLE,
    PLAIN,
    down,
    move,
    pen_down,
    pen_move,
    pen_up,
    stylus,
    up,
)


class Recorder(StrokeTool):
    """Keeps strokes as an edit would have them."""

    set = Brush(0.15, 0.5)

    def __init__(self, stage):
        super().__init__(stage)
        self.strokes, self.said = [], []

    def brush(self):
        return self.set

    def begin_stroke(self, run, brush):
        self.said.append("begin")
        self.strokes.append((brush, [run]))

    def extend_stroke(self, run):
        self.strokes[-1][1].append(run)

    def finish_drag(self):
        self.said.append("finish")

    def cancel_drag(self):
        self.said.append("cancel")

    def made(self):
        """The strokes as edits take them."""
        found = []
        for brush, runs in self.strokes:
            parts = [(run.hits.position, run.hits.normal, run.pressure) for run in runs]
            points, normals, pressure = (np.concatenate(part) for part in zip(*parts, strict=True))
            found.append(Stroke(points, brush.radius, normals, pressure, brush.hardness))
        return found


class Stage:
    """What a viewport with tools offers."""

    def __init__(self, viewport, surface):
        self.viewport = viewport
        self.picker = Picker(surface, place=viewport.scene.place)
        self.overlay = Overlay(self, viewport)
        self.overlay.show()

    def view(self):
        plotter = self.viewport._plotter
        return View(self.viewport.scene.camera, (plotter.width(), plotter.height()))

    def draw(self, marks):
        self.overlay.draw(marks)

    def marks(self, kind):
        return [each for each in self.overlay.marks if isinstance(each, kind)]


@pytest.fixture
def stage(qtbot, ring):
    mesh, atlas, *_ = ring
    surface = export_input(mesh, atlas)
    viewport = Viewport(Document())
    qtbot.addWidget(viewport)
    viewport.resize(420, 320)
    viewport.show()
    qtbot.waitExposed(viewport)
    viewport.scene.show(surface)
    viewport.frame()
    stage = Stage(viewport, surface)
    stage.pointer = Pointer(parent=viewport)
    stage.pointer.attach(viewport._plotter)
    stage.tool = Recorder(stage)
    stage.pointer.set_tool(stage.tool)
    yield stage
    viewport.close_view()


def at(stage, azimuth):
    """Pixel of a place on the front of the ring, degrees from the front to the right."""
    angle = np.radians(azimuth + stage.viewport.scene.camera.azimuth)
    point = np.array([1.2 * np.sin(angle), 0.3, 1.2 * np.cos(angle)])
    return tuple(stage.picker.pixels(stage.view(), point)[:2])


def test_a_left_drag_draws_one_stroke_and_leaves_the_camera(stage):
    view, camera = stage.viewport._plotter, stage.viewport.scene.camera
    move(view, *at(stage, -30))
    (ring,) = stage.marks(Ring)
    assert (ring.radius, ring.hardness) == (0.15, 0.5) and not stage.tool.drawing
    down(view, *at(stage, -30))
    move(view, *at(stage, 20), LEFT)
    assert stage.tool.drawing and len(stage.marks(Line)) == 1
    up(view, *at(stage, 20))
    assert stage.tool.said == ["begin", "finish"] and not stage.marks(Line)
    (stroke,) = stage.tool.made()
    steps = np.linalg.norm(np.diff(stroke.points, axis=0), axis=1)
    assert 5 < len(stroke.points) and steps.max() <= 0.15 / 4 + 1e-9
    assert (stroke.pressure == 1.0).all() and stage.viewport.scene.camera == camera
    assert view.cursor().shape() == Qt.CursorShape.CrossCursor


def test_other_drags_and_the_wheel_are_the_cameras_as_before(stage):
    view, camera = stage.viewport._plotter, stage.viewport.scene.camera
    down(view, 100, 100, MIDDLE)
    move(view, 150, 110, MIDDLE)
    up(view, 150, 110, MIDDLE)
    panned = stage.viewport.scene.camera
    assert panned != camera and stage.tool.said == []
    stage.pointer.set_tool(None)
    down(view, 100, 100)
    move(view, 150, 110, LEFT)
    up(view, 150, 110)
    assert stage.viewport.scene.camera.azimuth != panned.azimuth
    assert view.cursor().shape() == Qt.CursorShape.ArrowCursor


def test_a_pen_gives_pressure_and_lifting_it_does_not_take_the_last_of_it(stage):
    view, pen = stage.viewport._plotter, stylus()
    pen_down(view, pen, *at(stage, -20), 0.2)
    pen_move(view, pen, *at(stage, 20), 0.8)
    assert stage.marks(Ring)[0].radius == pytest.approx(0.8 * 0.15)
    pen_up(view, pen, *at(stage, 21))
    (stroke,) = stage.tool.made()
    assert stroke.pressure[0] == pytest.approx(0.2) and stroke.pressure[-1] == pytest.approx(0.8)
    assert (np.diff(stroke.pressure) >= -1e-9).all()
    stage.tool.set = Brush(0.15, sized=False)
    pen_down(view, pen, *at(stage, -20), 0.2)
    pen_up(view, pen, *at(stage, -20))
    assert stage.tool.made()[1].pressure.tolist() == [1.0], "a tap is a stroke of one point"


def test_a_drag_over_the_hole_is_two_strokes_and_one_step(stage):
    stage.viewport.look(azimuth=30.0, elevation=70.0)
    view, (width, height) = stage.viewport._plotter, stage.view().size
    down(view, 2, height / 2)
    for x in (width * 0.3, width * 0.6, width - 2):
        move(view, x, height / 2, LEFT)
    up(view, width - 2, height / 2)
    assert stage.tool.said == ["begin", "begin", "finish"]
    for stroke in stage.tool.made():
        steps = np.linalg.norm(np.diff(stroke.points, axis=0), axis=1)
        assert len(stroke.points) > 10 and steps.max() <= 0.15 / 4 + 1e-9


def test_a_drag_beside_the_surface_is_no_step(stage):
    view = stage.viewport._plotter
    down(view, 2, 2)
    move(view, 40, 2, LEFT)
    up(view, 40, 2)
    down(view, 2, 2)
    QApplication.sendEvent(view, QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_Escape, PLAIN))
    assert stage.tool.said == [] and not stage.overlay.marks


@pytest.mark.parametrize("way", ["escape", "tool", "focus"])
def test_an_interrupted_drag_is_taken_back(stage, way):
    view = stage.viewport._plotter
    down(view, *at(stage, -20))
    move(view, *at(stage, 0), LEFT)
    if way == "escape":
        QApplication.sendEvent(view, QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_Escape, PLAIN))
    elif way == "tool":
        stage.pointer.set_tool(Tool(stage, stage.pointer))
    else:
        QApplication.sendEvent(view, QEvent(QEvent.Type.WindowDeactivate))
    up(view, *at(stage, 0))
    assert stage.tool.said == ["begin", "cancel"] and not stage.overlay.marks


def test_without_a_surface_a_brush_does_nothing(stage):
    view = stage.viewport._plotter
    stage.picker = None
    move(view, *at_middle(stage))
    down(view, *at_middle(stage))
    up(view, *at_middle(stage))
    assert stage.tool.said == [] and not stage.overlay.marks


def at_middle(stage):
    width, height = stage.view().size
    return width / 2, height / 2
