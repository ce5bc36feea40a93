"""What tools draw lies where the surface shows it, and costs the view no frame."""

import numpy as np
import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QEvent, QObject, QPoint, Qt  # noqa: E402
from PyQt6.QtGui import QColor, QImage, QPainter  # noqa: E402
from PyQt6.QtWidgets import QApplication, QWidget  # noqa: E402

from app.picking import Picker, View  # noqa: E402
from app.tools.marks import Arrows, Dots, Label, Line, Ring, points_of  # noqa: E402
from app.tools.overlay import Overlay  # noqa: E402
from btfcore.files.surface import export_input  # noqa: E402
from btfcore.render.camera import Turntable  # noqa: E402
from tests.app.test_window import pixels  # noqa: E402

SIZE = (400, 300)


class Stage:
    """A view without a scene."""

    def __init__(self, picker):
        self.picker, self.camera = picker, Turntable(20.0, 25.0, distance=2.9)

    def view(self):
        return View(self.camera, SIZE)


@pytest.fixture
def stage(ring):
    mesh, atlas, *_ = ring
    return Stage(Picker(export_input(mesh, atlas)))


@pytest.fixture
def overlay(qtbot, stage):
    parent = QWidget()
    qtbot.addWidget(parent)
    parent.resize(*SIZE)
    yield Overlay(stage, parent)  # the parent is kept as long


def drawn(overlay, over=Qt.GlobalColor.transparent, ratio=1):
    """What it paints, (H, W, 4), on a ground of one colour."""
    image = QImage(SIZE[0] * ratio, SIZE[1] * ratio, QImage.Format.Format_RGBA8888)
    image.setDevicePixelRatio(ratio)
    image.fill(over)
    painter = QPainter(image)
    overlay.render(painter, QPoint(), flags=QWidget.RenderFlag(0))
    painter.end()
    bits = image.constBits()
    bits.setsize(image.sizeInBytes())
    return np.frombuffer(bits, np.uint8).reshape(SIZE[1] * ratio, -1, 4).astype(int).copy()


def hit(stage, share=(0.5, 0.62)):
    return stage.picker.pick(stage.view(), np.array([share]) * SIZE)


def ring_at(stage, **knobs):
    hits = hit(stage)
    assert hits.on[0]
    return Ring(hits.position[0], hits.normal[0], 0.2, **knobs)


@pytest.mark.parametrize("ratio", [1, 2])
def test_the_ring_lies_on_the_circle_around_the_hit_and_nowhere_else(stage, overlay, ratio):
    ring = ring_at(stage)
    overlay.draw((ring,))
    rows, columns = np.nonzero(drawn(overlay, ratio=ratio)[..., 3] > 60)
    corners = stage.picker.pixels(stage.view(), ring.circle(1.0, 720))[:, :2]
    places = (np.stack([columns, rows], axis=1) + 0.5) / ratio
    away = np.linalg.norm(places[:, None] - corners[None], axis=2)
    assert away.min(axis=1).max() < 3.0 and away.min(axis=0).max() < 1.5
    assert np.ptp(corners, axis=0).min() > 20
    around = np.linalg.norm(ring.circle() - ring.point, axis=1)
    assert around == pytest.approx(0.2) and (ring.circle() - ring.point) @ ring.normal == (
        pytest.approx(0.0, abs=1e-12)
    )


def test_a_soft_brush_has_a_second_ring_inside(stage, overlay):
    overlay.draw((ring_at(stage),))
    hard = (drawn(overlay)[..., 3] > 60).sum()
    overlay.draw((ring_at(stage, hardness=0.5),))
    assert (drawn(overlay)[..., 3] > 60).sum() > 1.3 * hard


@pytest.mark.parametrize("ground", ["white", "black", "gray"])
def test_lines_are_seen_on_any_colour(stage, overlay, ground):
    ring = ring_at(stage)
    overlay.draw((ring,))
    bare = np.array(QColor(ground).getRgb())
    changed = np.abs(drawn(overlay, QColor(ground)) - bare)[..., :3].max(axis=2)
    rows, columns = np.nonzero(changed > 90)
    corners = stage.picker.pixels(stage.view(), ring.circle())[:, :2]
    away = np.linalg.norm(np.stack([columns, rows], 1)[:, None] + 0.5 - corners[None], axis=2)
    assert away.min(axis=0).max() < 2.0, "at every place of the ring"


def test_marks_follow_the_camera_and_the_surface(stage, overlay):
    ring = ring_at(stage)
    overlay.draw((ring,))
    before = drawn(overlay)
    stage.camera = Turntable(26.0, 20.0, distance=2.9)
    overlay.follow()
    after = drawn(overlay)
    middle = [np.argwhere(each[..., 3] > 60).mean(axis=0)[::-1] + 0.5 for each in (before, after)]
    moved = stage.picker.pixels(stage.view(), ring.point)[:2]
    assert np.linalg.norm(middle[1] - moved) < 3 < np.linalg.norm(middle[1] - middle[0])
    stage.picker = None
    overlay.follow()
    assert not drawn(overlay).any() and overlay.marks == (ring,)


def test_what_the_surface_hides_is_faint(stage, overlay):
    front = hit(stage).position
    away = front * [-1, -1, -1]  # through the ring's middle
    for mark, strength in ((Dots(front), 200), (Dots(away), 110)):
        overlay.draw((mark,))
        opacity = drawn(overlay)[..., 3].max()
        assert (opacity > 200) == (strength == 200) and opacity > 40
    both = np.concatenate([front, front + [[0, 0.05, 0]], away])
    overlay.draw((Line(both[:2]), Arrows(both[:1], both[1:2]), Arrows(away, away * 1.1)))
    assert drawn(overlay)[..., 3].max() > 200


def test_a_label_is_read_beside_its_place_and_never_leaves_the_picture(stage, overlay):
    position = hit(stage).position[0]
    overlay.draw((Label(position, "12.5 mm\n14 mm over the surface"),))
    box = np.argwhere(drawn(overlay)[..., 3] > 150)
    assert len(box) > 2000
    at = stage.picker.pixels(stage.view(), position)[:2]
    assert box[:, 0].max() < at[1] and 0 < box[:, 1].min() - at[0] < 25
    overlay.draw((Label(position, "a long text " * 6),))
    held = np.argwhere(drawn(overlay)[..., 3] > 150)
    assert held[:, 1].min() >= 1


def test_nothing_is_drawn_for_what_is_behind_the_camera_or_far_off(stage, overlay):
    behind = stage.camera.position * 2.0 / stage.picker.place.scale
    marks = (
        Dots(behind[None]), Label(behind, "behind"), Line(np.stack([behind, behind * 1.1])),
        Arrows(behind[None], behind[None] * 1.1), Ring(behind, np.array([0.0, 0, 1]), 1e9),
    )  # fmt: skip
    overlay.draw(marks)
    assert not drawn(overlay).any()
    assert all(points_of(mark).shape[1] == 3 for mark in marks)


def test_the_overlay_covers_its_parent_and_takes_no_event(qtbot, overlay):
    overlay.parentWidget().resize(333, 222)
    QApplication.sendPostedEvents()
    overlay.parentWidget().show()
    qtbot.waitExposed(overlay.parentWidget())
    assert overlay.size() == overlay.parentWidget().size()
    assert overlay.testAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
    assert overlay.accessibleName()


class Frames(QObject):
    """Counts how often a widget paints."""

    count = 0

    def eventFilter(self, target, event):  # noqa: N802
        self.count += event.type() == QEvent.Type.Paint
        return False


def test_marks_over_a_real_view_are_seen_and_draw_no_frame_of_the_scene(qtbot, ring):
    from app.document import Document
    from app.viewport import Viewport

    mesh, atlas, *_ = ring
    surface = export_input(mesh, atlas)
    view = Viewport(Document())
    qtbot.addWidget(view)
    view.resize(*SIZE)
    view.show()
    qtbot.waitExposed(view)
    view.scene.show(surface)
    view.frame()
    stage = Stage(Picker(surface, place=view.scene.place))
    stage.camera = view.scene.camera
    overlay = Overlay(stage, view)
    overlay.show()
    plain = lambda: pixels(view.grab().toImage()).astype(int)  # noqa: E731
    qtbot.wait(600)  # until the view rests
    before = plain()
    frames = Frames()
    view._plotter.installEventFilter(frames)
    for share in np.linspace(0.4, 0.6, 12):
        hits = hit(stage, (share, 0.6))
        if hits.on[0]:
            overlay.draw((Ring(hits.position[0], hits.normal[0], 0.25),))
            qtbot.wait(5)
    assert frames.count == 0
    changed = np.abs(plain() - before).max(axis=2) > 40
    rows, columns = np.nonzero(changed)
    corners = stage.picker.pixels(stage.view(), overlay.marks[0].circle(1.0, 720))[:, :2]
    away = np.linalg.norm(np.stack([columns, rows], 1)[:, None] + 0.5 - corners[None], axis=2)
    assert len(rows) > 60 and away.min(axis=1).max() < 4.0
    view.close_view()
