"""The sample large, its mask over it, and the mouse, pen and keys that draw on it."""

from __future__ import annotations

import numpy as np
from PyQt6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, pyqtSignal
from PyQt6.QtGui import (
    QColor,
    QEnterEvent,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPointingDevice,
    QResizeEvent,
    QTabletEvent,
    QWheelEvent,
)
from PyQt6.QtWidgets import QWidget

from app.panels.mask_model import MaskModel
from app.panels.mask_picture import MaskPicture, draw_outline, draw_pointer
from app.panels.mask_work import MaskTool
from btfcore.btf.mask_history import Box
from btfcore.btf.mask_tools import reach

MOST_ZOOM = 64.0  # units of the view for one texel
STEP = 1.25  # of the zoom for a notch of the wheel
MARGIN = 16  # units left around the sample when all of it is shown
CLICK = 4.0  # units that the pointer may move within a click
GHOST = 0.35  # opacity of a tile's neighbours
_LEFT, _MIDDLE = Qt.MouseButton.LeftButton, Qt.MouseButton.MiddleButton
_RIGHT = Qt.MouseButton.RightButton


class MaskView(QWidget):
    """Wheel zooms about the pointer, middle drag or Space with the left button moves the view.

    Left button: the model's tool; with Alt, or with the right button, it removes. Shift draws a
    straight line from where the last stroke ended. The lasso is dragged, or clicked corner by
    corner and closed by Enter or a double click. zoom_changed(units a texel).
    """

    zoom_changed = pyqtSignal(float)

    def __init__(self, model: MaskModel, parent: QWidget | None = None) -> None:
        """Show the mask of `model`."""
        super().__init__(parent)
        self._model = model
        self._picture = MaskPicture(model.colour, model.mask)
        self.opacity = 0.55
        self.zoom = 1.0
        self._origin = QPointF(0, 0)  # of the corner of the first texel, in the view
        self._fitted = True
        self._pointer: QPointF | None = None
        self._panning: QPointF | None = None
        self._space = False
        self._alt = False
        self._pen = False  # the pen is down: what mouse events come too are its doubles
        self._outline: list[QPointF] = []  # of the lasso, in texels
        self._outline_remove = False
        self._pressed: QPointF | None = None  # where the lasso's button went down
        self._travel = 0.0
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setMinimumSize(240, 200)
        self.setAccessibleName(self.tr("Sample with its mask"))
        self.setAccessibleDescription(
            self.tr("Draw on the sample; wheel zooms, middle button or Space moves the view")
        )
        model.mask_changed.connect(self._mask_changed)
        model.picture_changed.connect(self._picture_changed)
        model.settings_changed.connect(self._settings_changed)

    def sizeHint(self) -> QSize:  # noqa: N802
        """Large."""
        return QSize(760, 620)

    def set_opacity(self, opacity: float) -> None:
        """How strongly the mask covers the sample, 0–1."""
        self.opacity = opacity
        self.update()

    def set_tint(self, tint: QColor) -> None:
        """Colour of the mask."""
        self._picture.set_tint(tint)
        self.update()

    def fit(self) -> None:
        """Show all of the sample, in the middle."""
        height, width = self._model.mask.shape
        room = QSize(max(self.width() - 2 * MARGIN, 8), max(self.height() - 2 * MARGIN, 8))
        zoom = min(room.width() / width, room.height() / height, MOST_ZOOM)
        self._set_zoom(zoom)
        self._origin = QPointF(
            (self.width() - width * zoom) / 2, (self.height() - height * zoom) / 2
        )
        self._fitted = True
        self.update()

    def actual_size(self) -> None:
        """One texel for each pixel of the screen, about the middle of the view."""
        self._zoom_about(QPointF(self.rect().center()), 1 / self.devicePixelRatioF())

    def zoom_by(self, factor: float) -> None:
        """Zoom about the middle of the view."""
        self._zoom_about(QPointF(self.rect().center()), self.zoom * factor)

    def texel_at(self, place: QPointF) -> QPointF:
        """Position (column, row) in texels below a place in the view, whole at centres."""
        return (place - self._origin) / self.zoom - QPointF(0.5, 0.5)

    def place_of(self, column: float, row: float) -> QPointF:
        """Place in the view of a position in texels."""
        return (QPointF(column, row) + QPointF(0.5, 0.5)) * self.zoom + self._origin

    def cancel(self) -> bool:
        """Leave off what is being drawn; False where there was nothing."""
        drawing = bool(self._outline) or self._model.stroking
        self._outline, self._pressed = [], None
        self._model.cancel_stroke()
        self.update()
        return drawing

    def close_outline(self) -> bool:
        """Fill the lasso that was clicked so far; False where it has no three corners."""
        points = [(p.x(), p.y()) for p in self._outline]
        if not points:
            return False
        remove, self._outline, self._pressed = self._outline_remove, [], None
        if len(points) >= 3:
            self._model.fill_outline(points, remove=remove)
        self.update()
        return len(points) >= 3

    def mousePressEvent(self, event: QMouseEvent | None) -> None:  # noqa: N802
        """Begin what the button and the tool say."""
        if event is None or self._pen:
            return
        self.setFocus(Qt.FocusReason.MouseFocusReason)
        place, button = event.position(), event.button()
        if button == _MIDDLE or (button == _LEFT and self._space):
            self._panning = place
            self._show_cursor()
        elif button in (_LEFT, _RIGHT) and self._panning is None:
            self._press(place, event.modifiers(), remove=button == _RIGHT)

    def mouseMoveEvent(self, event: QMouseEvent | None) -> None:  # noqa: N802
        """Go on."""
        if event is not None and not self._pen:
            self._move(event.position(), event.modifiers())

    def mouseReleaseEvent(self, event: QMouseEvent | None) -> None:  # noqa: N802
        """End it."""
        if event is None or self._pen:
            return
        if self._panning is not None:
            self._panning = None
            self._show_cursor()
        else:
            self._release(event.position())

    def mouseDoubleClickEvent(self, event: QMouseEvent | None) -> None:  # noqa: N802
        """Close the lasso; otherwise a press like another."""
        if event is not None and self._outline:
            self.close_outline()
        else:
            self.mousePressEvent(event)

    def tabletEvent(self, event: QTabletEvent | None) -> None:  # noqa: N802
        """Draw with a pen: its pressure scales the brush, its other end removes."""
        if event is None:
            return
        kind, place = event.type(), event.position()
        if kind == QEvent.Type.TabletPress:
            if event.button() == _MIDDLE or self._space:
                self._panning = place
            else:
                self._pen = True
                eraser = event.pointerType() == QPointingDevice.PointerType.Eraser
                self._press(place, event.modifiers(), remove=eraser, pressure=event.pressure())
        elif kind == QEvent.Type.TabletRelease:
            self._pen = False
            if self._panning is not None:
                self._panning = None
            else:
                self._release(place)
        else:
            self._move(place, event.modifiers(), pressure=event.pressure() if self._pen else 1.0)
        event.accept()

    def wheelEvent(self, event: QWheelEvent | None) -> None:  # noqa: N802
        """Zoom about the pointer."""
        if event is not None:
            notches = event.angleDelta().y() / 120
            self._zoom_about(event.position(), self.zoom * STEP**notches)
            event.accept()

    def keyPressEvent(self, event: QKeyEvent | None) -> None:  # noqa: N802
        """Space moves the view, Alt removes; Enter and Backspace are the lasso's."""
        if event is None:
            return
        key = event.key()
        if key == Qt.Key.Key_Space:
            self._space = True
            self._show_cursor()
        elif key == Qt.Key.Key_Alt:
            self._set_alt(True)
        elif key in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and self._outline:
            self.close_outline()
        elif key == Qt.Key.Key_Backspace and self._outline:
            self._outline.pop()
            self.update()
        elif key == Qt.Key.Key_Escape and self.cancel():
            pass
        else:
            event.ignore()

    def keyReleaseEvent(self, event: QKeyEvent | None) -> None:  # noqa: N802
        """Let go of Space and Alt."""
        if event is None:
            return
        if event.key() == Qt.Key.Key_Space and not event.isAutoRepeat():
            self._space = False
            self._show_cursor()
        elif event.key() == Qt.Key.Key_Alt:
            self._set_alt(False)
        else:
            event.ignore()

    def enterEvent(self, event: QEnterEvent | None) -> None:  # noqa: N802
        """Keys go where the pointer is."""
        self.setFocus(Qt.FocusReason.MouseFocusReason)
        self._show_cursor()

    def leaveEvent(self, event: QEvent | None) -> None:  # noqa: N802
        """Hide the brush."""
        self._pointer = None
        self.update()

    def resizeEvent(self, event: QResizeEvent | None) -> None:  # noqa: N802
        """Stay fitted, or keep the middle in the middle."""
        if self._fitted:
            self.fit()
        elif event is not None and event.oldSize().isValid():
            change = event.size() - event.oldSize()
            self._origin += QPointF(change.width() / 2, change.height() / 2)

    def paintEvent(self, event: QPaintEvent | None) -> None:  # noqa: N802
        """Draw the sample, the mask, the lasso and the brush."""
        painter = QPainter(self)
        exposed = QRectF(self.rect() if event is None else event.rect())
        painter.fillRect(exposed, self.palette().color(self.palette().ColorRole.Base))
        height, width = self._model.mask.shape
        ratio = self.devicePixelRatioF()
        for i in (-1, 0, 1) if self._model.tiles else (0,):
            for j in (-1, 0, 1) if self._model.tiles else (0,):
                corner = self._origin + QPointF(j * width, i * height) * self.zoom
                seen = exposed.translated(-corner)
                visible = QRectF(seen.topLeft() / self.zoom, seen.size() / self.zoom)
                painter.save()
                painter.translate(corner)
                painter.setOpacity(1.0 if i == j == 0 else GHOST)
                self._picture.draw(painter, self.zoom, visible, self.opacity, ratio)
                painter.restore()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if self._outline:
            points = [self.place_of(p.x(), p.y()) for p in self._outline]
            if self._pointer is not None and self._pressed is None:
                points.append(self._pointer)
            draw_outline(painter, points)
        if self._pointer is not None and not self._space and self._panning is None:
            settings = self._model.settings
            radius, far = settings.radius, reach(settings.radius, settings.hardness)
            brush = settings.tool is MaskTool.BRUSH
            circles = (radius * self.zoom, far * self.zoom) if brush else ()
            draw_pointer(painter, self._pointer, circles, self._alt or settings.remove)
        painter.end()

    def _press(
        self,
        place: QPointF,
        keys: Qt.KeyboardModifier,
        *,
        remove: bool,
        pressure: float = 1.0,
    ) -> None:
        at = self.texel_at(place)
        self._set_alt(bool(keys & Qt.KeyboardModifier.AltModifier))
        remove = remove or self._alt
        tool = self._model.settings.tool
        if tool is MaskTool.BRUSH:
            line = bool(keys & Qt.KeyboardModifier.ShiftModifier)
            self._model.begin_stroke(at.x(), at.y(), pressure=pressure, remove=remove, line=line)
        elif tool is MaskTool.FLOOD:
            column, row = int(np.rint(at.x())), int(np.rint(at.y()))
            height, width = self._model.mask.shape
            if self._model.tiles:
                column, row = column % width, row % height
            if 0 <= column < width and 0 <= row < height:
                self._model.flood_from(column, row, remove=remove)
        else:
            if not self._outline:
                self._outline_remove = remove
            self._outline.append(at)
            self._pressed, self._travel = place, 0.0
        self._point(place)

    def _move(self, place: QPointF, keys: Qt.KeyboardModifier, *, pressure: float = 1.0) -> None:
        if self._panning is not None:
            self._origin += place - self._panning
            self._panning, self._fitted = place, False
            self.update()
            return
        self._set_alt(bool(keys & Qt.KeyboardModifier.AltModifier))
        at = self.texel_at(place)
        if self._model.stroking:
            self._model.extend_stroke(at.x(), at.y(), pressure=pressure)
        elif self._pressed is not None:
            step = place - self._pressed
            self._travel = max(self._travel, float(np.hypot(step.x(), step.y())))
            if self._travel > CLICK:
                self._outline.append(at)
        self._point(place)

    def _release(self, place: QPointF) -> None:
        if self._model.stroking:
            self._model.finish_stroke()
        elif self._pressed is not None:
            self._pressed = None
            if self._travel > CLICK:
                self.close_outline()
            self.update()

    def _point(self, place: QPointF) -> None:
        """Show the brush elsewhere; only what changes is painted again."""
        old, self._pointer = self._pointer, place
        if self._outline:
            self.update()
            return
        settings = self._model.settings
        far = max(reach(settings.radius, settings.hardness) * self.zoom, 12) + 4
        for each in (old, place):
            if each is not None:
                box = QRectF(each.x() - far, each.y() - far, 2 * far, 2 * far)
                self.update(box.toAlignedRect())

    def _zoom_about(self, place: QPointF, zoom: float) -> None:
        """Change the zoom so that the texel below `place` stays there."""
        texel = (place - self._origin) / self.zoom
        height, width = self._model.mask.shape
        least = min(1.0, 32 / max(width, height))
        self._set_zoom(min(max(zoom, least), MOST_ZOOM))
        self._origin = place - texel * self.zoom
        self._fitted = False
        self.update()

    def _set_zoom(self, zoom: float) -> None:
        self.zoom = zoom
        self.zoom_changed.emit(zoom)

    def _set_alt(self, held: bool) -> None:
        if held != self._alt:
            self._alt = held
            self.update()

    def _show_cursor(self) -> None:
        shape = Qt.CursorShape
        if self._panning is not None:
            self.setCursor(shape.ClosedHandCursor)
        else:
            self.setCursor(shape.OpenHandCursor if self._space else shape.CrossCursor)

    def _mask_changed(self, box: Box) -> None:
        left, top, right, bottom = box
        self._picture.set_mask(self._model.mask, box)
        if self._model.tiles:
            self.update()
            return
        block = max(2 / self.zoom, 1.0)  # of the reduced mask
        corner = QPointF(left - block, top - block) * self.zoom + self._origin
        size = QPointF(right - left + 2 * block, bottom - top + 2 * block) * self.zoom
        self.update(QRectF(corner, corner + size).toAlignedRect())

    def _picture_changed(self) -> None:
        self._picture.set_colour(self._model.colour)
        self.update()

    def _settings_changed(self) -> None:
        if self._model.settings.tool is not MaskTool.LASSO and self._outline:
            self.cancel()
        self.update()
