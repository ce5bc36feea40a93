"""Draws the marks of tools over the view, without drawing the view anew.

It is a transparent widget above the view's own. Qt keeps the view's last frame and lays the
marks over it, so that moving a brush's ring costs no frame of the scene.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from PyQt6.QtCore import QEvent, QObject, QPointF, QRect, QRectF, Qt
from PyQt6.QtGui import (
    QColor,
    QFontMetricsF,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPen,
    QPolygonF,
    QRegion,
)
from PyQt6.QtWidgets import QWidget

from app.picking import Picker, View
from app.tools.base import Stage
from app.tools.marks import Arrows, Colour, Dots, Label, Line, Mark, Marks, Ring
from btfcore.types import F8

THIN = 1.5  # pixels
CASING = QColor(0, 0, 0, 150)  # around every line, so that it is seen on any colour
FAINT = 0.3  # opacity of what the surface hides
HEAD = 7.0  # pixels, of an arrow
FAR = 1e5  # pixels beyond which nothing is drawn
REGIONS = 24  # parts of the picture that are told apart when it is redrawn


@dataclass
class _Shape:
    """Something to draw in pixels: lines of a colour, filled where asked, or a text's box."""

    path: QPainterPath
    colour: Colour
    width: float = THIN
    opacity: float = 1.0
    dashed: bool = False
    filled: bool = False
    text: str = ""
    box: QRectF = field(default_factory=QRectF)

    def reach(self) -> QRect:
        """The pixels that it may touch."""
        wide = self.width / 2 + 3
        whole = self.path.boundingRect().adjusted(-wide, -wide, wide, wide)
        return whole.united(self.box.adjusted(-2, -2, 2, 2)).toAlignedRect()


class Overlay(QWidget):
    """Marks over a view; `parent` is the view's widget, which it covers and never takes from."""

    def __init__(self, stage: Stage, parent: QWidget) -> None:
        """Cover `parent`; `stage` knows the camera and the surface."""
        super().__init__(parent)
        self._stage = stage
        self._marks: Marks = ()
        self._shapes: list[_Shape] = []
        self._drawn: tuple[View, Picker | None] | None = None  # what they were made for
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setAttribute(Qt.WidgetAttribute.WA_NoSystemBackground)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setAccessibleName(self.tr("Marks of the tool in use"))
        self.setGeometry(parent.rect())
        parent.installEventFilter(self)

    @property
    def marks(self) -> Marks:
        """What is shown."""
        return self._marks

    def draw(self, marks: Marks) -> None:
        """Show `marks` instead of those before."""
        if marks or self._marks:
            self._marks = marks
            self._renew()

    def follow(self) -> None:
        """Bring the marks to where they belong after the camera or the surface has changed."""
        now = (self._stage.view(), self._stage.picker)
        if self._marks and now != self._drawn:
            self._renew()

    def eventFilter(self, target: QObject | None, event: QEvent | None) -> bool:  # noqa: N802
        """Stay as large as the view."""
        parent = self.parentWidget()
        if event is not None and event.type() == QEvent.Type.Resize and parent is not None:
            self.setGeometry(parent.rect())
            self.follow()
        return False

    def paintEvent(self, event: QPaintEvent | None) -> None:  # noqa: N802
        """Draw the shapes within the event's region."""
        if event is None or not self._shapes:
            return
        region = event.region()
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        for shape in self._shapes:
            if region.intersects(shape.reach()):
                painter.setOpacity(shape.opacity)
                _draw(painter, shape)

    def _renew(self) -> None:
        """Make the shapes, and have only those parts of the picture redrawn that they touch."""
        touched = _region(self._shapes)
        view, picker = self._stage.view(), self._stage.picker
        self._drawn = (view, picker)
        self._shapes = []
        if picker is not None:
            for mark in self._marks:
                self._shapes += self._made(mark, picker, view)
        self.update(touched.united(_region(self._shapes)))

    def _made(self, mark: Mark, picker: Picker, view: View) -> list[_Shape]:
        """Shapes of one mark."""
        if isinstance(mark, Ring):
            shapes = [_curve(_pixels(picker, view, mark.circle()), mark.colour)]
            if mark.hardness < 1.0:
                inner = _pixels(picker, view, mark.circle(max(mark.hardness, 0.02)))
                shapes.append(_curve(inner, mark.colour, width=1.0, opacity=0.7))
            return shapes
        if isinstance(mark, Label):
            return [self._label(_pixels(picker, view, mark.point[None])[0], mark.text)]
        if isinstance(mark, Line):
            return _line(
                mark, _pixels(picker, view, mark.points), picker.visible(view, mark.points)
            )
        if isinstance(mark, Dots):
            return _dots(
                mark, _pixels(picker, view, mark.points), picker.visible(view, mark.points)
            )
        tails, heads = (_pixels(picker, view, each) for each in (mark.tails, mark.heads))
        return _arrows(mark, tails, heads, picker.visible(view, mark.tails))

    def _label(self, at: F8, text: str) -> _Shape:
        """Text beside a place, within the picture; nothing behind the camera."""
        if not np.isfinite(at).all():
            return _Shape(QPainterPath(), (0, 0, 0))
        size = QFontMetricsF(self.font()).boundingRect(QRectF(0, 0, 1e4, 1e4), 0, text).size()
        width, height = size.width() + 12, size.height() + 6
        left = min(max(float(at[0]) + 12, 2.0), max(self.width() - width - 2, 2.0))
        top = min(max(float(at[1]) - height - 8, 2.0), max(self.height() - height - 2, 2.0))
        return _Shape(
            QPainterPath(), (255, 255, 255), text=text, box=QRectF(left, top, width, height)
        )


def _draw(painter: QPainter, shape: _Shape) -> None:
    colour = QColor(*shape.colour)
    if shape.text:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(20, 22, 24, 215))
        painter.drawRoundedRect(shape.box, 4, 4)
        painter.setPen(colour)
        painter.drawText(shape.box, Qt.AlignmentFlag.AlignCenter, shape.text)
        return
    painter.setBrush(colour if shape.filled else Qt.BrushStyle.NoBrush)
    if shape.filled:
        painter.setPen(QPen(CASING, 1.5))
        painter.drawPath(shape.path)
        return
    pen = QPen(CASING, shape.width + 2)
    pen.setCapStyle(Qt.PenCapStyle.RoundCap)
    pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    painter.setPen(pen)
    painter.drawPath(shape.path)
    pen.setColor(colour)
    pen.setWidthF(shape.width)
    if shape.dashed:
        pen.setCapStyle(Qt.PenCapStyle.FlatCap)
        pen.setDashPattern([4.0, 3.0])
    painter.setPen(pen)
    painter.drawPath(shape.path)


def _pixels(picker: Picker, view: View, points: F8) -> F8:
    """Column and row (n, 2); NaN where a point has no place in or near the picture."""
    found = picker.pixels(view, np.asarray(points).reshape(-1, 3))[:, :2]
    near = np.abs(found).max(axis=1, keepdims=True) < FAR
    return np.where(near, found, np.nan)


def _path(points: F8) -> QPainterPath:
    """Polylines through points (n, 2), interrupted where they are not finite."""
    path = QPainterPath()
    good = ~np.isnan(points[:, 0])
    for part in np.split(np.arange(len(points)), np.flatnonzero(np.diff(good)) + 1):
        if len(part) > 1 and good[part[0]]:
            path.addPolygon(QPolygonF([QPointF(x, y) for x, y in points[part]]))
    return path


def _curve(
    points: F8, colour: Colour, *, width: float = THIN, opacity: float = 1.0, dashed: bool = False
) -> _Shape:
    return _Shape(_path(points), colour, width, opacity, dashed)


def _line(mark: Line, points: F8, seen: np.ndarray) -> list[_Shape]:
    """What is seen of a line, and faintly what is hidden."""
    clear = seen[:-1] & seen[1:]
    shapes = []
    for wanted, opacity in ((~clear, FAINT), (clear, 1.0)):
        chosen = np.flatnonzero(wanted)
        if len(chosen) == 0:
            continue
        parts = np.split(chosen, np.flatnonzero(np.diff(chosen) > 1) + 1)
        path = QPainterPath()
        for part in parts:
            path.addPath(_path(points[part[0] : part[-1] + 2]))
        shapes.append(_Shape(path, mark.colour, mark.thickness, opacity, mark.dashed))
    return shapes


def _dots(mark: Dots, points: F8, seen: np.ndarray) -> list[_Shape]:
    shapes = []
    for wanted, opacity in ((~seen, FAINT), (seen, 1.0)):
        path = QPainterPath()
        for x, y in points[wanted & ~np.isnan(points[:, 0])]:
            path.addEllipse(QPointF(x, y), mark.size / 2, mark.size / 2)
        if not path.isEmpty():
            shapes.append(_Shape(path, mark.colour, opacity=opacity, filled=True))
    return shapes


def _arrows(mark: Arrows, tails: F8, heads: F8, seen: np.ndarray) -> list[_Shape]:
    """Shafts with two barbs of fixed size, shorter on short arrows."""
    way = heads - tails
    length = np.linalg.norm(way, axis=1, keepdims=True)
    unit = way / np.maximum(length, 1e-9)
    barb = np.minimum(HEAD, length / 2)
    across = unit[:, ::-1] * [-1.0, 1.0]
    left = heads - barb * (0.9 * unit - 0.5 * across)
    right = heads - barb * (0.9 * unit + 0.5 * across)
    good = ~np.isnan(way[:, 0])
    shapes = []
    for wanted, opacity in ((~seen & good, FAINT), (seen & good, 1.0)):
        path = QPainterPath()
        for tail, head, one, two in zip(
            tails[wanted], heads[wanted], left[wanted], right[wanted], strict=True
        ):
            path.moveTo(*tail)
            path.lineTo(*head)
            path.addPolygon(QPolygonF([QPointF(*one), QPointF(*head), QPointF(*two)]))
        if not path.isEmpty():
            shapes.append(_Shape(path, mark.colour, opacity=opacity))
    return shapes


def _region(shapes: list[_Shape]) -> QRegion:
    """Pixels that shapes may touch: a few rectangles, or one for many shapes."""
    region = QRegion()
    for shape in shapes[:REGIONS]:
        region = region.united(shape.reach())
    rest = QRect()
    for shape in shapes[REGIONS:]:
        rest = rest.united(shape.reach())
    return region.united(rest)
