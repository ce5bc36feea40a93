"""The samples on offer, as small pictures of which one is chosen."""

from __future__ import annotations

from pathlib import Path

from PyQt6.QtCore import QModelIndex, QPersistentModelIndex, QRect, QRectF, QSize, Qt, pyqtSignal
from PyQt6.QtGui import (
    QColor,
    QImage,
    QPainter,
    QPainterPath,
    QPen,
    QPixmap,
    QStandardItem,
    QStandardItemModel,
)
from PyQt6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QLabel,
    QListView,
    QPushButton,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QVBoxLayout,
    QWidget,
)

from app.document import U1, Document, SampleEntry
from app.theme import ACCENT, FAINT, RAISED, TEXT, named

SIDE, CELL = 84, QSize(95, 112)
PATH, STATE = Qt.ItemDataRole.UserRole + 1, Qt.ItemDataRole.UserRole + 2
LOADING, READY, BROKEN = range(3)


class SamplesPanel(QWidget):
    """Grid of thumbnails; folder_wanted() asks for a folder of samples."""

    folder_wanted = pyqtSignal()

    def __init__(self, document: Document, parent: QWidget | None = None) -> None:
        """Show the samples of `document`."""
        super().__init__(parent)
        self._document = document
        heading = named(QLabel(self.tr("SAMPLE")), "heading")
        folder = QPushButton(self.tr("Folder…"))
        folder.setToolTip(self.tr("Offer the images of a folder as samples"))
        folder.clicked.connect(self.folder_wanted)
        self.view = named(QListView(), "samples")
        self.view.setAccessibleName(self.tr("Samples"))
        self.view.setViewMode(QListView.ViewMode.IconMode)
        self.view.setResizeMode(QListView.ResizeMode.Adjust)
        self.view.setMovement(QListView.Movement.Static)
        self.view.setUniformItemSizes(True)
        self.view.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.view.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.view.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.view.setMouseTracking(True)
        self.view.setItemDelegate(_Tile(self.view))
        self._model = QStandardItemModel(self)
        self.view.setModel(self._model)
        self._items: dict[Path, QStandardItem] = {}
        self._shown: dict[Path, SampleEntry] = {}
        top = QHBoxLayout()
        top.addWidget(heading)
        top.addStretch()
        top.addWidget(folder)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addLayout(top)
        layout.addWidget(self.view)
        selection = self.view.selectionModel()
        assert selection is not None
        selection.currentChanged.connect(self._picked)
        document.samples_changed.connect(self._refresh)
        document.sample_chosen.connect(self._mark)

    def _refresh(self) -> None:
        for entry in self._document.samples:
            if self._shown.get(entry.path) is entry:
                continue
            self._shown[entry.path] = entry
            item = self._items.get(entry.path)
            if item is None:
                item = QStandardItem(readable(entry.path))
                item.setData(str(entry.path), PATH)
                self._items[entry.path] = item
                self._model.appendRow(item)
            self._fill(item, entry)
        self._mark()

    def _fill(self, item: QStandardItem, entry: SampleEntry) -> None:
        state = BROKEN if entry.error else READY if entry.thumbnail is not None else LOADING
        item.setData(state, STATE)
        item.setEnabled(state != BROKEN)
        tip = entry.error or self.tr("{0}\n{1}").format(readable(entry.path), entry.path)
        item.setToolTip(tip)
        item.setData(entry.error or readable(entry.path), Qt.ItemDataRole.AccessibleTextRole)
        if entry.thumbnail is not None:
            item.setData(pixmap(entry.thumbnail), Qt.ItemDataRole.DecorationRole)

    def _picked(self, index: QModelIndex) -> None:
        if index.isValid():
            self._document.choose_sample(Path(index.data(PATH)))

    def _mark(self) -> None:
        path = self._document.sample_path
        item = self._items.get(path) if path is not None else None
        if item is None:
            self.view.clearSelection()
        elif self.view.currentIndex() != item.index():
            self.view.setCurrentIndex(item.index())


class _Tile(QStyledItemDelegate):
    """Draws a rounded square of the sample and its name below."""

    def sizeHint(  # noqa: N802
        self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> QSize:
        """Every tile is as large as the others."""
        return CELL

    def paint(
        self,
        painter: QPainter | None,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
    ) -> None:
        """Draw one tile."""
        if painter is None:
            return
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        left = option.rect.left() + (option.rect.width() - SIDE) // 2
        square = QRect(left, option.rect.top() + 5, SIDE, SIDE)
        shape = QPainterPath()
        shape.addRoundedRect(QRectF(square), 6, 6)
        picture = index.data(Qt.ItemDataRole.DecorationRole)
        state = index.data(STATE)
        if isinstance(picture, QPixmap):
            painter.setClipPath(shape)
            painter.drawPixmap(square, picture, _square_of(picture))
            painter.setClipping(False)
        else:
            painter.fillPath(shape, QColor(RAISED))
            painter.setPen(QColor(FAINT))
            mark = "✕" if state == BROKEN else "…"
            painter.drawText(square, Qt.AlignmentFlag.AlignCenter, mark)
        chosen = bool(option.state & QStyle.StateFlag.State_Selected)
        if chosen or option.state & QStyle.StateFlag.State_MouseOver:
            painter.setPen(QPen(QColor(ACCENT if chosen else FAINT), 3 if chosen else 1.5))
            painter.drawPath(shape)
        painter.setPen(QColor(ACCENT if chosen else TEXT if state != BROKEN else FAINT))
        font = painter.font()
        font.setPixelSize(11)
        painter.setFont(font)
        below = QRect(option.rect.left() + 3, square.bottom() + 3, CELL.width() - 6, 18)
        text = painter.fontMetrics().elidedText(
            index.data(), Qt.TextElideMode.ElideRight, below.width()
        )
        painter.drawText(below, Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignVCenter, text)
        painter.restore()


def readable(path: Path) -> str:
    """Turn a file's name into words."""
    return path.stem.replace("_", " ").replace("-", " ")


def pixmap(image: U1) -> QPixmap:
    """Copy an (H, W, 3) u8 image."""
    height, width, _ = image.shape
    data = image.tobytes()
    return QPixmap.fromImage(
        QImage(data, width, height, 3 * width, QImage.Format.Format_RGB888).copy()
    )


def _square_of(picture: QPixmap) -> QRect:
    """The largest square in the middle."""
    side = min(picture.width(), picture.height())
    return QRect((picture.width() - side) // 2, (picture.height() - side) // 2, side, side)
