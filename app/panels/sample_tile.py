"""One sample in the library: a rounded square of it, and its name below."""

from __future__ import annotations

from pathlib import Path

from PyQt6.QtCore import QModelIndex, QRect, QRectF, QSize, Qt
from PyQt6.QtGui import QColor, QPainter, QPainterPath, QPalette, QPen, QPixmap
from PyQt6.QtWidgets import QStyle, QStyledItemDelegate, QStyleOptionViewItem, QWidget

from app.panels.moving_light import MovingLight
from app.panels.pictures import middle
from app.panels.sample_model import BROKEN, ERROR, PATH, STATE

SIDE, WIDTH = 84, 95  # logical pixels
_TEXT = 11  # pixels
Role = QPalette.ColorRole


class SampleTile(QStyledItemDelegate):
    """Draws a tile in the palette's colours, under the moving light where the pointer is."""

    def __init__(self, light: MovingLight, parent: QWidget) -> None:
        """`light` : moves over the hovered one."""
        super().__init__(parent)
        self._light = light

    def sizeHint(self, option: QStyleOptionViewItem, index: QModelIndex) -> QSize:  # noqa: N802
        """Every tile is as large as the others."""
        return QSize(WIDTH, SIDE + 28)

    def paint(
        self, painter: QPainter | None, option: QStyleOptionViewItem, index: QModelIndex
    ) -> None:
        """Draw one tile."""
        if painter is None:
            return
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        palette = option.palette
        ink, accent = palette.color(Role.Text), palette.color(Role.Highlight)
        faint = QColor(ink)
        faint.setAlphaF(0.55)
        left = option.rect.left() + (option.rect.width() - SIDE) // 2
        square = QRect(left, option.rect.top() + 5, SIDE, SIDE)
        shape = QPainterPath()
        shape.addRoundedRect(QRectF(square), 6, 6)
        font = painter.font()
        font.setPixelSize(_TEXT)
        painter.setFont(font)
        broken = index.data(STATE) == BROKEN
        picture = self._light.frame(Path(index.data(PATH)))
        if picture is None:
            picture = index.data(Qt.ItemDataRole.DecorationRole)
        if isinstance(picture, QPixmap):
            painter.setClipPath(shape)
            painter.drawPixmap(square, picture, middle(picture))
            painter.setClipping(False)
        else:
            painter.fillPath(shape, palette.color(Role.Midlight))
            painter.setPen(faint)
            if broken:
                self._reason(painter, square, index.data(ERROR), ink)
            else:
                painter.drawText(square, Qt.AlignmentFlag.AlignCenter, "…")
        chosen = bool(option.state & QStyle.StateFlag.State_Selected)
        if chosen or option.state & QStyle.StateFlag.State_MouseOver:
            painter.setPen(QPen(accent if chosen else faint, 3 if chosen else 1.5))
            painter.drawPath(shape)
        if option.state & QStyle.StateFlag.State_HasFocus:
            pen = QPen(ink, 1, Qt.PenStyle.DotLine)
            painter.setPen(pen)
            painter.drawRoundedRect(QRectF(square).adjusted(-3, -3, 3, 3), 8, 8)
        painter.setPen(faint if broken else ink)
        font.setBold(chosen)
        painter.setFont(font)
        below = QRect(option.rect.left() + 3, square.bottom() + 4, option.rect.width() - 6, 18)
        text = painter.fontMetrics().elidedText(
            index.data(), Qt.TextElideMode.ElideRight, below.width()
        )
        painter.drawText(below, Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignVCenter, text)
        painter.restore()

    def _reason(self, painter: QPainter, square: QRect, reason: str, ink: QColor) -> None:
        """Write as much of the reason as there is room for; the tooltip has all of it."""
        font = painter.font()
        font.setPixelSize(9)
        painter.setFont(font)
        painter.setPen(ink)
        words = reason.split(": ", 1)[-1]  # the name is written below
        wrap = Qt.TextFlag.TextWordWrap
        painter.drawText(square.adjusted(6, 5, -6, -5), wrap, f"✕ {words}")
