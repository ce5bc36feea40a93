"""One row of the list of layers: eye, kind, name, sample, and a mark while it is computed."""

from __future__ import annotations

from PyQt6.QtCore import QAbstractItemModel, QEvent, QModelIndex, QPointF, QRect, QRectF, QSize, Qt
from PyQt6.QtGui import QColor, QMouseEvent, QPainter, QPalette, QPen
from PyQt6.QtWidgets import QStyle, QStyledItemDelegate, QStyleOptionViewItem, QWidget

from app.panels.glyphs import GLYPHS, draw_glyph
from app.panels.layer_model import BUSY, KIND, SAMPLE

HEIGHT, EYE, ICON = 34, 30, 24  # logical pixels: of a row, of its first and second column
SPIN_DEGREES = 30
Role = Qt.ItemDataRole


class LayerTile(QStyledItemDelegate):
    """Draws a row and turns a click on its eye into another visibility; `turn` spins the mark."""

    turn = 0

    def sizeHint(self, option: QStyleOptionViewItem, index: QModelIndex) -> QSize:  # noqa: N802
        """Every row is as high as the others, and higher with a larger font."""
        return QSize(120, max(HEIGHT, round(option.fontMetrics.height() * 2.2)))

    def paint(
        self, painter: QPainter | None, option: QStyleOptionViewItem, index: QModelIndex
    ) -> None:
        """Draw one row in the palette's colours."""
        if painter is None:
            return
        painter.save()
        palette = option.palette
        chosen = bool(option.state & QStyle.StateFlag.State_Selected)
        if chosen:
            painter.fillRect(option.rect, palette.brush(QPalette.ColorRole.Highlight))
        elif option.state & QStyle.StateFlag.State_MouseOver:
            painter.fillRect(option.rect, palette.brush(QPalette.ColorRole.Midlight))
        role = QPalette.ColorRole.HighlightedText if chosen else QPalette.ColorRole.Text
        ink = palette.color(role)
        faint = QColor(ink)
        faint.setAlphaF(0.6)
        shown = index.data(Role.CheckStateRole) == Qt.CheckState.Checked
        eye, icon, name, mark = _places(option.rect)
        draw_glyph(painter, "eye" if shown else "eye_shut", eye, ink if shown else faint)
        kind = index.data(KIND)
        if kind in GLYPHS:
            draw_glyph(painter, kind, icon, ink if shown else faint)
        font = option.font
        painter.setFont(font)
        painter.setPen(ink if shown else faint)
        metrics = painter.fontMetrics()
        left = Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft
        text = metrics.elidedText(index.data(), Qt.TextElideMode.ElideRight, name.width())
        painter.drawText(name, left, text)
        room = name.width() - metrics.horizontalAdvance(text) - 12
        sample = index.data(SAMPLE)
        if sample and room > 40:
            painter.setPen(faint)
            right = Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignRight
            painter.drawText(
                name, right, metrics.elidedText(sample, Qt.TextElideMode.ElideRight, room)
            )
        if index.data(BUSY):
            self._spin(painter, mark, ink)
        if option.state & QStyle.StateFlag.State_HasFocus and not chosen:
            painter.setPen(QPen(palette.color(QPalette.ColorRole.Highlight), 1))
            painter.drawRect(option.rect.adjusted(0, 0, -1, -1))
        painter.restore()

    def _spin(self, painter: QPainter, place: QRectF, ink: QColor) -> None:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        pen = QPen(ink, 2)
        pen.setCapStyle(Qt.PenCapStyle.RoundCap)
        painter.setPen(pen)
        painter.drawArc(place, -self.turn * SPIN_DEGREES * 16, 250 * 16)

    def setEditorData(self, editor: QWidget | None, index: QModelIndex) -> None:  # noqa: N802
        """Fill the field once: what is typed stays when the document changes meanwhile."""
        if editor is not None and not editor.property("filled"):
            super().setEditorData(editor, index)
            editor.setProperty("filled", True)

    def updateEditorGeometry(  # noqa: N802
        self, editor: QWidget | None, option: QStyleOptionViewItem, index: QModelIndex
    ) -> None:
        """Let the field for the name lie where the name is."""
        if editor is not None:
            _, _, name, _ = _places(option.rect)
            editor.setGeometry(name.adjusted(-4, 2, 0, -2))

    def editorEvent(  # noqa: N802
        self,
        event: QEvent | None,
        model: QAbstractItemModel | None,
        option: QStyleOptionViewItem,
        index: QModelIndex,
    ) -> bool:
        """Show or hide the layer whose eye is clicked; the selection stays."""
        kinds = QEvent.Type
        if not isinstance(event, QMouseEvent) or model is None:
            return False
        if not eye_column(option.rect).contains(event.position().toPoint()):
            return False
        if event.type() == kinds.MouseButtonRelease and event.button() == LEFT:
            toggle(model, index)
        return event.type() in (
            kinds.MouseButtonPress, kinds.MouseButtonRelease, kinds.MouseButtonDblClick
        )  # fmt: skip


LEFT = Qt.MouseButton.LeftButton


def toggle(model: QAbstractItemModel, index: QModelIndex) -> None:
    """Ask for the other visibility of a layer."""
    shown = index.data(Role.CheckStateRole) == Qt.CheckState.Checked
    other = Qt.CheckState.Unchecked if shown else Qt.CheckState.Checked
    model.setData(index, other, Role.CheckStateRole)


def eye_column(row: QRect) -> QRect:
    """Where a click shows or hides."""
    return QRect(row.left(), row.top(), EYE, row.height())


def _places(row: QRect) -> tuple[QRectF, QRectF, QRect, QRectF]:
    """Squares of the eye and the kind, the rectangle of the name, the square of the busy mark."""
    middle = row.top() + row.height() / 2
    eye = QRectF(row.left() + (EYE - 18) / 2, middle - 9, 18, 18)
    icon = QRectF(row.left() + EYE + 2, middle - 9, 18, 18)
    name = row.adjusted(EYE + ICON + 4, 0, -26, 0)
    mark = QRectF(QPointF(row.right() - 20, middle - 7), QPointF(row.right() - 6, middle + 7))
    return eye, icon, name, mark
