"""The curve of the pen's pressure, drawn and dragged."""

from __future__ import annotations

from PyQt6.QtCore import QPointF, QRectF, QSize, Qt, pyqtSignal
from PyQt6.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen, QPolygonF
from PyQt6.QtWidgets import QSizePolicy, QWidget

from app.pressure import CLOSEST, LINEAR, MOST_POINTS, Curve

SIDE = 200  # logical pixels
_MARGIN = 10
_REACH = 12.0  # of the pointer, from a point
_STEP = 0.02  # of an arrow key
_SAMPLES = 100


class PressureEditor(QWidget):
    """Shows a curve; drags move its points, double clicks add some, Del takes them away.

    edited(curve) asks for another curve; the widget shows it when `show_curve` is called.
    """

    edited = pyqtSignal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        """Show the straight line."""
        super().__init__(parent)
        self._curve, self._at, self._grip = LINEAR, 0, False
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(self.tr("Pressure curve of the pen"))
        self.setAccessibleDescription(
            self.tr("Arrow keys move the marked point, + and - mark the next and the one before")
        )
        self.setToolTip(
            self.tr(
                "From left to right how hard the pen presses, upwards what the tool gets.\n"
                "Drag a point, double-click to add one, Del to take the marked one away."
            )
        )

    def sizeHint(self) -> QSize:  # noqa: N802
        """A square."""
        return QSize(SIDE, SIDE)

    def show_curve(self, curve: Curve) -> None:
        """Show another curve."""
        self._curve = curve
        self._at = min(self._at, len(curve.points) - 1)
        self.update()

    # --- the pointer and the keys

    def mousePressEvent(self, event: QMouseEvent | None) -> None:  # noqa: N802
        """Take the point under the pointer."""
        if event is not None and event.button() == Qt.MouseButton.LeftButton:
            found = self._under(event.position())
            self._grip = found is not None
            if found is not None:
                self._at = found
            self.update()

    def mouseMoveEvent(self, event: QMouseEvent | None) -> None:  # noqa: N802
        """Move the point that was taken."""
        if event is not None and self._grip:
            self._move(*self._value(event.position()))

    def mouseReleaseEvent(self, event: QMouseEvent | None) -> None:  # noqa: N802
        """Let go."""
        self._grip = False

    def mouseDoubleClickEvent(self, event: QMouseEvent | None) -> None:  # noqa: N802
        """Add a point where there is room for one."""
        points = self._curve.points
        if event is None or self._under(event.position()) is not None:
            return
        x, y = self._value(event.position())
        at = sum(each[0] < x for each in points)
        room = all(abs(each[0] - x) >= CLOSEST for each in points)
        if len(points) < MOST_POINTS and room:
            lowest = points[at - 1][1] if at else 0.0
            highest = points[at][1] if at < len(points) else 1.0
            self._at, self._grip = at, True
            new = (x, min(max(y, lowest), highest))
            self.edited.emit(Curve((*points[:at], new, *points[at:])))

    def keyPressEvent(self, event: QKeyEvent | None) -> None:  # noqa: N802
        """Move, mark or take away points."""
        if event is None:
            return
        key, points = event.key(), self._curve.points
        ways = {
            Qt.Key.Key_Left: (-_STEP, 0.0), Qt.Key.Key_Right: (_STEP, 0.0),
            Qt.Key.Key_Up: (0.0, _STEP), Qt.Key.Key_Down: (0.0, -_STEP),
        }  # fmt: skip
        if key in ways:
            (x, y), (right, up) = points[self._at], ways[Qt.Key(key)]
            self._move(x + right, y + up)
        elif key in (Qt.Key.Key_Plus, Qt.Key.Key_Minus):
            step = 1 if key == Qt.Key.Key_Plus else -1
            self._at = (self._at + step) % len(points)
            self.update()
        elif key in (Qt.Key.Key_Delete, Qt.Key.Key_Backspace):
            if 0 < self._at < len(points) - 1:  # both ends stay
                self.edited.emit(Curve((*points[: self._at], *points[self._at + 1 :])))
        else:
            event.ignore()

    def _move(self, x: float, y: float) -> None:
        """Ask for the marked point at another place, as far as its neighbours let it."""
        points, at = self._curve.points, self._at
        left = points[at - 1][0] + CLOSEST if at else 0.0
        right = points[at + 1][0] - CLOSEST if at + 1 < len(points) else 1.0
        low = points[at - 1][1] if at else 0.0
        high = points[at + 1][1] if at + 1 < len(points) else 1.0
        new = (round(min(max(x, left), right), 4), round(min(max(y, low), high), 4))
        if new != points[at]:
            self.edited.emit(Curve((*points[:at], new, *points[at + 1 :])))

    # --- places

    def _box(self) -> QRectF:
        return QRectF(self.rect()).adjusted(_MARGIN, _MARGIN, -_MARGIN, -_MARGIN)

    def place(self, point: tuple[float, float]) -> QPointF:
        """Where a point of the curve is in the widget."""
        box = self._box()
        return QPointF(box.left() + point[0] * box.width(), box.bottom() - point[1] * box.height())

    def _value(self, place: QPointF) -> tuple[float, float]:
        box = self._box()
        x = (place.x() - box.left()) / box.width()
        y = (box.bottom() - place.y()) / box.height()
        return min(max(x, 0.0), 1.0), min(max(y, 0.0), 1.0)

    def _under(self, place: QPointF) -> int | None:
        away = [(place - self.place(each)).manhattanLength() for each in self._curve.points]
        nearest = min(range(len(away)), key=away.__getitem__)
        return nearest if away[nearest] <= _REACH else None

    def paintEvent(self, event: QPaintEvent | None) -> None:  # noqa: N802
        """Draw a grid, the curve and its points."""
        palette, box = self.palette(), self._box()
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(self.rect(), palette.base())
        faint = QColor(palette.text().color())
        faint.setAlphaF(0.18)
        painter.setPen(QPen(faint, 1))
        for i in range(5):
            x, y = box.left() + i * box.width() / 4, box.top() + i * box.height() / 4
            painter.drawLine(QPointF(x, box.top()), QPointF(x, box.bottom()))
            painter.drawLine(QPointF(box.left(), y), QPointF(box.right(), y))
        painter.setPen(QPen(palette.highlight().color(), 2))
        steps = (i / _SAMPLES for i in range(_SAMPLES + 1))
        painter.drawPolyline(QPolygonF([self.place((t, self._curve(t))) for t in steps]))
        for i, point in enumerate(self._curve.points):
            marked = i == self._at and self.hasFocus()
            painter.setPen(QPen(palette.text().color(), 2.5 if marked else 1.2))
            painter.setBrush(palette.highlight() if marked else palette.base())
            painter.drawEllipse(self.place(point), 5.0, 5.0)
        painter.end()
